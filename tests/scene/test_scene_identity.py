"""A scene survives its file to the last bit, and its digest follows its content."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dembench.scene import Bodies, Mesh, Scene, Sdf, load_scene, save_scene, scene_from, scene_schema

SCHEMA = jsonschema.Draft202012Validator(scene_schema())
EXAMPLES = sorted((Path(__file__).parents[2] / "data" / "scenes").glob("*.json"))

finite = st.floats(-1e3, 1e3, allow_nan=False)
positive = st.floats(1e-9, 1e9)
names = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,20}", fullmatch=True)
vectors = st.tuples(finite, finite, finite)
directions = vectors.filter(lambda v: any(abs(x) > 1e-3 for x in v))
motions = st.none() | st.fixed_dictionaries({"velocity": vectors, "angular_velocity": vectors, "centre": vectors})


def walls(name):
    common = {"name": st.just(name), "material": st.just("stone"), "motion": motions}
    axial = {"start": vectors, "end": vectors, "closed_start": st.booleans(), "closed_end": st.booleans()}
    return st.one_of(
        st.fixed_dictionaries({**common, "kind": st.just("plane"), "point": vectors, "normal": directions}),
        st.fixed_dictionaries(
            {
                **common,
                "kind": st.just("box"),
                "lower": vectors,
                "upper": st.just((2e3, 2e3, 2e3)),
                "open_faces": st.lists(st.sampled_from(["x-", "z+"]), unique=True),
            }
        ),
        st.fixed_dictionaries({**common, **axial, "kind": st.just("cylinder"), "radius": positive}),
        st.fixed_dictionaries(
            {**common, **axial, "kind": st.just("frustum"), "radius_start": positive, "radius_end": positive}
        ),
        st.fixed_dictionaries(
            {
                **common,
                "kind": st.just("mesh"),
                "triangles": st.lists(st.lists(vectors, min_size=3, max_size=3), min_size=1, max_size=3),
            }
        ),
    ).filter(lambda w: w.get("start") is None or w["start"] != w["end"])


@st.composite
def scenes(draw):
    n = draw(st.integers(0, 5))
    bodies = {"position": draw(st.lists(vectors, min_size=n, max_size=n))}
    if draw(st.booleans()):
        bodies["radius"] = draw(st.lists(positive, min_size=n, max_size=n))
        bodies["velocity"] = draw(st.lists(vectors, min_size=n, max_size=n))
    return {
        "name": draw(names),
        "law": draw(
            st.sampled_from(
                [
                    {"kind": "hertz-mindlin", "variant": "rescaled"},
                    {"kind": "rigid"},
                    {"kind": "linear", "normal_stiffness": 1e5, "tangential_stiffness": 0.0},
                ]
            )
        ),
        "materials": [{"name": "stone", "density": draw(positive), "young": draw(positive), "poisson": 0.25}],
        "pair_laws": [{"a": "stone", "b": "stone", "restitution": draw(st.floats(0.01, 1)), "friction": 0.5}],
        "species": [{"name": draw(names), "material": "stone", "radius": draw(positive)}],
        "walls": [draw(walls(f"wall{k}")) for k in range(draw(st.integers(0, 2)))],
        "bodies": bodies,
        "domain": {"lower": (-1e4, -1e4, -1e4), "upper": (1e4, 1e4, 1e4)},
        "gravity": draw(vectors),
        "duration": draw(positive),
    }


@settings(max_examples=50, deadline=None)
@given(data=scenes())
def test_any_scene_survives_json(data):
    scene = scene_from(data)
    text = json.dumps(scene.model_dump(mode="json"))
    again = scene_from(json.loads(text))
    assert again.digest() == scene.digest()
    assert again == scene
    SCHEMA.validate(json.loads(text))


@pytest.mark.parametrize("count", [3, 2000])
def test_round_trip_through_a_file(small_scene, tmp_path, count):
    rng = np.random.default_rng(0)
    bodies = Bodies(position=rng.uniform(-0.1, 0.1, (count, 3)), velocity=rng.normal(size=(count, 3)))
    scene = small_scene(bodies=bodies, observables=())
    path = tmp_path / "scene.json"
    save_scene(scene, path)
    assert load_scene(path).digest() == scene.digest()
    np.testing.assert_array_equal(load_scene(path).bodies.velocity, bodies.velocity)
    assert (tmp_path / "scene.npz").exists() == (count > 100)
    SCHEMA.validate(json.loads(path.read_text()))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_examples_are_scenes_and_fit_the_schema(path):
    SCHEMA.validate(json.loads(path.read_text()))
    assert len(load_scene(path).bodies) > 0


def test_there_is_an_example():
    assert EXAMPLES


@pytest.mark.parametrize(
    "fault",
    [
        lambda d: d.update(name="a;b"),
        lambda d: d["species"][0].update(radius=-1),
        lambda d: d["bodies"].update(position=[[0, 0]]),
        lambda d: d.update(surprise=1),
        lambda d: d.update(bodies={"file": "../x.npz"}),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(fault):
    data = json.loads(EXAMPLES[0].read_text())
    fault(data)
    with pytest.raises(jsonschema.ValidationError):
        SCHEMA.validate(data)


@pytest.mark.parametrize(
    "change",
    [
        {"duration": 0.011},
        {"gravity": (0.0, 0.0, -9.80)},
        {"name": "other"},
        {"walls": ()},
        {"observables": ()},
        {"time_step": None},
    ],
)
def test_the_digest_changes_with_the_content(small_scene, change):
    assert small_scene(**change).digest() != small_scene().digest()


@pytest.mark.parametrize("field", ["position", "velocity", "angular_velocity"])
def test_the_digest_changes_with_the_last_bit_of_an_array(small_scene, field):
    scene = small_scene()
    array = getattr(scene.bodies, field).copy()
    array[2, 1] = np.nextafter(array[2, 1], 1)
    assert (
        scene.model_copy(update={"bodies": scene.bodies.model_copy(update={field: array})}).digest() != scene.digest()
    )


def test_the_digest_is_the_same_for_the_same_content(small_scene):
    assert small_scene().digest() == small_scene().digest()
    assert Scene.model_validate(small_scene().model_dump()).digest() == small_scene().digest()


def test_arrays_cannot_be_changed(small_scene):
    with pytest.raises(ValueError):
        small_scene().bodies.position[0, 0] = 1.0


def test_grids_compare_by_content_and_survive_their_file(small_scene, tmp_path):
    def wall(shift):
        height = np.broadcast_to(np.linspace(-1, 1, 17), (17, 17, 17)) / 7 + shift
        return Sdf(name="void", material="glass", values=height, origin=(0, 0, -1), spacing=1 / 7)

    a, b, c = (small_scene(walls=(wall(shift),)) for shift in (0.0, 0.0, 1e-16))
    assert a.walls == b.walls and hash(a.walls[0]) == hash(b.walls[0]) and a.digest() == b.digest()
    assert a.walls != c.walls and a.digest() != c.digest()
    save_scene(a, tmp_path / "scene.json")
    assert len((tmp_path / "scene.json").read_text()) < 10000
    assert load_scene(tmp_path / "scene.json") == a


def test_meshes_compare_by_content():
    a = [Mesh(name="m", material="s", triangles=[[[0, 0, 0], [1, 0, 0], [0, x, 0]]]) for x in (1.0, 1.0, 2.0)]
    assert a[0] == a[1] and hash(a[0]) == hash(a[1]) and a[0] != a[2]


def test_a_state_at_rest_is_one_zero_in_memory():
    """It has the content of an array of zeros; what is not exactly 0, a sign for one, is kept."""
    position = [[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]
    still = Bodies(position=position)
    assert still.velocity.strides == still.angular_velocity.strides == (0, 0)
    assert still == Bodies(position=position, velocity=np.zeros((2, 3)))
    assert np.signbit(Bodies(position=position, velocity=np.full((2, 3), -0.0)).velocity).all()

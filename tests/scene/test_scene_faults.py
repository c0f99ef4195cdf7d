"""Every bad scene gets an error that names the field, the value and what would be accepted."""

import copy
import json

import numpy as np
import pytest

from dembench.scene import SceneError, check_scene, load_scene, save_scene, scene_from
from dembench.scene.checks import accepted_overlap

GOOD = {
    "name": "two_beads",
    "materials": [
        {"name": "glass", "density": 2500.0, "young": 1e9, "poisson": 0.2},
        {"name": "steel", "density": 7200.0, "young": 210e9, "poisson": 0.2},
    ],
    "pair_laws": [
        {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},
        {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0.2},
    ],
    "species": [{"name": "bead", "material": "glass", "radius": 0.001}],
    "walls": [
        {
            "kind": "box",
            "name": "box",
            "material": "steel",
            "lower": [-0.01, -0.01, 0.0],
            "upper": [0.01, 0.01, 0.02],
            "open_faces": ["z+"],
        }
    ],
    "bodies": {"position": [[0.0, 0.0, 0.001], [0.002, 0.0, 0.001]]},
    "domain": {"lower": [-0.02, -0.02, -0.01], "upper": [0.02, 0.02, 0.05]},
    "duration": 0.01,
    "observables": [{"kind": "energy", "name": "energy", "interval": 1e-3}],
}


def changed(**fields):
    return {**copy.deepcopy(GOOD), **fields}


def at(*path, value):
    data = copy.deepcopy(GOOD)
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return data


def message(data):
    with pytest.raises(SceneError) as caught:
        check_scene(scene_from(data))
    return str(caught.value)


def test_the_good_scene_is_accepted():
    check_scene(scene_from(GOOD))


def test_missing_pair_law_names_the_pair():
    assert "steel" in (text := message(at("pair_laws", value=GOOD["pair_laws"][:1])))
    assert "glass-steel" in text and "restitution and friction" in text


def test_a_pair_of_wall_materials_alone_needs_no_law():
    scene = scene_from(GOOD)  # no two steel things can touch
    with pytest.raises(KeyError, match="steel-steel"):
        scene.pair_law("steel", "steel")


@pytest.mark.parametrize("radius", [-0.001, 0.0, "thick", None])
def test_bad_radius_names_field_and_value(radius):
    text = message(at("species", 0, "radius", value=radius))
    assert "species.0.radius" in text
    assert "greater than 0" in text if isinstance(radius, float) else "number" in text


def test_negative_radius_of_one_body():
    text = message(at("bodies", "radius", value=[0.001, -0.5]))
    assert "particle 1" in text and "-0.5" in text and "above 0" in text


@pytest.mark.parametrize("value", [float("nan"), float("inf"), None])
def test_coordinates_that_are_no_numbers_name_the_particle(value):
    text = message(at("bodies", "position", value=[[0, 0, 0.001], [0.002, value, 0.001]]))
    assert "bodies.position" in text and "particle 1" in text and "finite" in text


@pytest.mark.parametrize("position", [7, "here", [[0, 0]], [[0, 0, 0], [0, 0]], [{"x": 1}], {"x": 1}])
def test_positions_of_another_shape(position):
    assert "position" in message(at("bodies", "position", value=position))


def test_arrays_of_different_length():
    assert "velocity has 1 rows, position has 2" in message(at("bodies", "velocity", value=[[0, 0, 0]]))


@pytest.mark.parametrize("species", [[0, 3], [0, -1]])
def test_unknown_species_of_a_body(species):
    text = message(at("bodies", "species", value=species))
    assert "particle 1" in text and "0 to 0" in text


@pytest.mark.parametrize("species", [[0, 0.5], [0, float("nan")], [0, 1e12]])
def test_species_that_is_no_index(species):
    assert "whole numbers" in message(at("bodies", "species", value=species))


@pytest.mark.parametrize(
    "name", ["a;shell rm -rf x", "../x", "<b>", "", "1st", "a b", "a\nshell ls", "ä", "a" * 60, "${x}", "a'b", "box\n"]
)
@pytest.mark.parametrize(
    "path",
    [("name",), ("materials", 0, "name"), ("species", 0, "name"), ("walls", 0, "name"), ("observables", 0, "name")],
)
def test_names_are_identifiers(path, name):
    field = message(at(*path, value=name)).split(": ")[1].split(".")
    assert field[: len(path) - 1] == [str(p) for p in path[:-1]] and field[-1] == "name"


@pytest.mark.parametrize("path", [("comment",), ("materials", 0, "colour"), ("bodies", "mass"), ("walls", 0, "file")])
def test_unknown_fields_are_refused(path):
    text = message(at(*path, value="x"))
    assert str(path[-1]) in text and "not permitted" in text


def test_unknown_material_names_those_known():
    text = message(at("walls", 0, "material", value="stel"))
    assert "'stel'" in text and "glass, steel" in text


def test_names_given_twice():
    assert "box" in message(changed(walls=GOOD["walls"] * 2))
    assert "glass-glass" in message(changed(pair_laws=[*GOOD["pair_laws"], GOOD["pair_laws"][0]]))


@pytest.mark.parametrize("field,value", [("restitution", -0.1), ("restitution", 1.2), ("friction", -0.1)])
def test_pair_law_values(field, value):
    assert f"pair_laws.0.{field}" in message(at("pair_laws", 0, field, value=value))


@pytest.mark.parametrize("poisson", [-1, 0.6, float("nan")])
def test_poisson_ratio(poisson):
    assert "materials.0.poisson" in message(at("materials", 0, "poisson", value=poisson))


def test_domain_turned_inside_out():
    text = message(at("domain", "upper", value=[0.02, -0.05, 0.05]))
    assert "axis y" in text and "-0.05" in text


def test_trajectory_of_a_body_that_is_not_there():
    seen = [{"kind": "trajectory", "name": "ball", "body": 5, "interval": 1e-3, "track_interval": 1e-4}]
    assert "0 to 1" in message(changed(observables=seen))


def test_track_interval_must_divide_the_interval():
    seen = [{"kind": "trajectory", "name": "ball", "body": 0, "interval": 1e-3, "track_interval": 3e-4}]
    assert "0.0003" in message(changed(observables=seen))


def test_particles_outside_the_walls_are_counted_and_the_worst_named():
    text = message(at("bodies", "position", value=[[0, 0, -0.002], [0.0135, 0, 0.001]]))
    assert "2 of 2 particles are outside wall box" in text
    assert "particle 1" in text and "0.0035 m beyond" in text


def test_particles_outside_the_domain():
    data = at("bodies", "position", value=[[0, 0, 0.09], [0.002, 0, 0.001]])
    text = message(data)
    assert "1 of 2 particles" in text and "particle 0 with z = 0.09 m" in text and "-0.01 to 0.05" in text


def test_a_particle_in_an_open_face_is_inside():
    check_scene(scene_from(at("bodies", "position", value=[[0, 0, 0.03], [0.002, 0, 0.001]])))


@pytest.mark.parametrize("overlap,accepted", [(0.009, True), (0.011, False)])
def test_particles_may_overlap_by_one_percent(overlap, accepted):
    data = at("bodies", "position", value=[[0, 0, 0.005], [0.002 - overlap * 0.001, 0, 0.005]])
    if accepted:
        check_scene(scene_from(data))
    else:
        text = message(data)
        assert "1 pairs of particles" in text and "particles 0 and 1" in text and "1.10%" in text


@pytest.mark.parametrize("overlap,accepted", [(0.009, True), (0.011, False)])
def test_particles_may_overlap_a_wall_by_one_percent(overlap, accepted):
    data = at("bodies", "position", value=[[0, 0, 0.001 * (1 - overlap)], [0.005, 0, 0.005]])
    if accepted:
        check_scene(scene_from(data))
    else:
        text = message(data)
        assert "wall box" in text and "particle 0" in text and "1.10%" in text


@pytest.mark.parametrize("young,accepted", [(1e9, 0.01), (1e7, 0.08957)])
def test_soft_particles_may_overlap_as_their_weight_makes_them(young, accepted):
    """A bed 0.2 m high of radius 3.2 mm: p = 0.6 2500 9.81 0.2 = 2943 Pa, F = p (6.4 mm)^2 = 0.1205 N, E* = 5.208e6 Pa,
    overlap (3 F/(4 E* 0.04 sqrt(m)))^(2/3) = 57.3 um = 1.79 % of the radius, five times that for the strongest."""
    data = at("materials", 0, "young", value=young)
    data["materials"][1]["young"] = young
    data["species"][0]["radius"] = 0.0032
    data["walls"][0]["upper"][2] = 0.4
    data["domain"]["upper"][2] = 0.4
    data["bodies"] = {"position": [[0, 0, 0.0032], [0, 0, 0.2032]]}
    assert accepted_overlap(scene_from(data)) == pytest.approx(accepted, rel=1e-3)


def test_overlap_is_measured_by_the_smaller_particle():
    data = at("bodies", "radius", value=[0.008, 0.001])
    data["bodies"]["position"] = [[0, 0, 0.008], [0.008 + 0.001 - 2e-5, 0, 0.008]]
    text = message(data)
    assert "2.00%" in text and "particles 0 and 1" in text


def test_all_overlapping_pairs_are_found_among_many_sizes():
    rng = np.random.default_rng(1)
    n = 300
    position = rng.uniform(-0.02, 0.02, (n, 3))
    radius = rng.choice([0.0005, 0.0011, 0.004], n)
    data = changed(walls=[])
    data["domain"] = {"lower": [-0.03] * 3, "upper": [0.03] * 3}
    data["bodies"] = {"position": position.tolist(), "radius": radius.tolist()}
    i, j = np.triu_indices(n, 1)
    overlap = radius[i] + radius[j] - np.linalg.norm(position[i] - position[j], axis=1)
    expected = np.count_nonzero(overlap > 0.01 * np.minimum(radius[i], radius[j]))
    assert expected > 100
    assert f"{expected} pairs" in message(data)


def test_overlap_across_a_periodic_face():
    data = changed(walls=[])
    data["domain"] = {"lower": [-0.02] * 3, "upper": [0.02] * 3, "periodic": [True, False, False]}
    data["bodies"] = {"position": [[-0.0195, 0, 0], [0.0195, 0, 0]]}
    assert "1 pairs" in message(data)
    data["domain"]["periodic"] = [False, True, True]
    check_scene(scene_from(data))


def test_overlap_with_a_mesh():
    triangles = [[[-0.01, -0.01, 0], [0.01, -0.01, 0], [0, 0.02, 0]]]
    wall = {"kind": "mesh", "name": "plate", "material": "steel", "triangles": triangles}
    data = changed(walls=[wall])
    data["bodies"] = {"position": [[0, 0, 0.0011], [0.004, 0, 0.0009], [0.0115, 0, 0]]}
    text = message(data)
    assert "1 of 3 particles overlap wall plate" in text and "particle 1" in text and "10.00%" in text


@pytest.mark.parametrize("name", ["/etc/passwd.npz", "../arrays.npz", "a/b.npz", "x.npy", ".npz", "x.npz\n", 5, None])
def test_arrays_only_from_a_file_beside_the_scene(tmp_path, name):
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(at("bodies", value={"file": name})))
    with pytest.raises(SceneError, match=r"bodies\.file"):
        load_scene(path)


def test_arrays_of_another_scene_are_refused(tmp_path):
    path = tmp_path / "scene.json"
    np.savez(tmp_path / "scene.npz", position=np.array([[0, 0, 0.001]]))
    path.write_text(json.dumps(at("bodies", value={"file": "scene.npz", "sha256": "0" * 64})))
    with pytest.raises(SceneError, match=r"bodies\.sha256"):
        load_scene(path)


@pytest.mark.parametrize("content", [b"", b"PK", b"not an archive", b"PK\x03\x04" + 40 * b"x"])
def test_damaged_arrays_are_refused(tmp_path, content):
    path = tmp_path / "scene.json"
    (tmp_path / "scene.npz").write_bytes(content)
    path.write_text(json.dumps(at("bodies", value={"file": "scene.npz"})))
    with pytest.raises(SceneError, match=r"scene\.npz"):
        load_scene(path)


def test_pickled_arrays_are_refused(tmp_path):
    path = tmp_path / "scene.json"
    np.savez(tmp_path / "scene.npz", position=np.array([{"a": 1}], dtype=object))
    path.write_text(json.dumps(at("bodies", value={"file": "scene.npz"})))
    with pytest.raises(SceneError, match=r"scene\.npz"):
        load_scene(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "\x00\xff", '{"bodies": 3}'])
def test_files_that_are_no_scene(tmp_path, text):
    path = tmp_path / "scene.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(SceneError, match=r"scene\.json"):
        load_scene(path)


def test_missing_file(tmp_path):
    with pytest.raises(SceneError, match="No such file"):
        load_scene(tmp_path / "none.json")


def test_a_failed_save_leaves_no_scene(tmp_path):
    scene = scene_from(GOOD)
    with pytest.raises(OSError):
        save_scene(scene, tmp_path / "absent" / "scene.json")
    assert list(tmp_path.iterdir()) == []

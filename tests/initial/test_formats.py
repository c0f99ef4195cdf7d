"""States of spheres go through every format and come back with all their bits; what does not fit is refused."""

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from dembench.initial import formats
from dembench.initial.formats.registry import FORMATS
from dembench.initial.formats.state import FIELDS, StateError, state_of
from dembench.initial.rows import CoordinatesError

NAMES = [known.name for known in FORMATS]
finite = st.floats(-1e6, 1e6, allow_nan=False, allow_subnormal=False)
positive = st.floats(1e-9, 1e6)


@st.composite
def states(draw):
    """States that know everything: values over many magnitudes, numbers with gaps, one density per species."""
    n = draw(st.integers(1, 4))
    rows = nps.arrays(np.float64, (n, 3), elements=finite)
    species = draw(nps.arrays(np.int64, n, elements=st.integers(0, 3)))
    density = np.array(draw(st.lists(positive, min_size=4, max_size=4)))
    return state_of(
        draw(rows),
        id=np.array(draw(st.lists(st.integers(1, 2**40), min_size=n, max_size=n, unique=True))),
        radius=draw(nps.arrays(np.float64, n, elements=positive)),
        density=density[species],
        velocity=draw(rows),
        angular_velocity=draw(rows),
        species=species,
    )


def held(state, *through):
    """The state that is left after some formats: what one of them has no place for is dropped."""
    lost = [name for name in FIELDS if any(name not in formats.format_named(f).holds for f in through)]
    return state.with_fields(**dict.fromkeys(lost))


def same(one, other):
    """Equal to the last bit; what is not known is zero velocities, species 0."""
    zeros = {"velocity": np.zeros((len(one), 3)), "angular_velocity": np.zeros((len(one), 3))}
    zeros["species"] = np.zeros(len(one))
    for name in ("position", *FIELDS):
        a, b = (zeros.get(name) if getattr(s, name) is None else getattr(s, name) for s in (one, other))
        assert (a is None) == (b is None), name
        assert a is None or np.array_equal(a, b), (name, a, b)
    return True


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(state=states())
def test_every_bit_comes_back(tmp_path, name, state):
    path, wanted = tmp_path / "state", held(state, name)
    formats.write(wanted, path, formats.format_named(name))
    assert formats.format_of(path).name == name
    assert same(formats.read(path), wanted)


@pytest.mark.parametrize("first,second", list(itertools.permutations(NAMES, 2)))
def test_all_pairs(tmp_path, first, second):
    """What both formats hold survives both; a radius or density that the first cannot hold is given again."""
    rng = np.random.default_rng(3)
    species = np.array([1, 0, 1, 0, 2])
    state = state_of(
        rng.normal(size=(5, 3)) / 3,
        id=[9, 2, 4, 5, 7],
        radius=rng.random(5) / 700,
        density=np.array([2500.0, 2000.0, 7200.1])[species],
        velocity=rng.normal(size=(5, 3)),
        angular_velocity=rng.normal(size=(5, 3)) * 1e3,
        species=species,
    )
    formats.write(held(state, first), tmp_path / "one", formats.format_named(first))
    found = formats.read(tmp_path / "one")
    into = formats.format_named(second)
    lacking = {name: np.full(5, 0.1) for name in into.needs if getattr(found, name) is None}
    wanted = held(found.with_fields(**lacking), second)
    formats.write(wanted, tmp_path / "two", into)
    assert same(formats.read(tmp_path / "two"), wanted)
    kept = {name for name in FIELDS if name in into.holds and name in formats.format_named(first).holds}
    for name in kept:
        assert np.array_equal(getattr(formats.read(tmp_path / "two"), name), getattr(state, name)), name


# ---- what a format cannot hold


def test_what_has_no_place_is_refused(tmp_path):
    moving = state_of(np.zeros((1, 3)), radius=[1.0], velocity=[[0, 0, 1.0]])
    path = tmp_path / "bed.txt"
    with pytest.raises(CoordinatesError, match=r"has no place for velocity, only for radius; --drop velocity"):
        formats.write(moving, path, formats.format_named("published"))
    with pytest.raises(CoordinatesError, match="needs density, which is not known; give --density"):
        formats.write(moving, tmp_path / "bed.data")
    assert not list(tmp_path.iterdir())


def test_a_species_with_two_densities_is_no_material(tmp_path):
    state = state_of(np.zeros((2, 3)), radius=[1.0, 1.0], density=[1.0, 2.0])
    with pytest.raises(CoordinatesError, match=r"musen: species 0 has 2 densities, 1 and 2 kg/m3"):
        formats.write(state, tmp_path / "scene.txt", formats.format_named("musen"))
    assert not list(tmp_path.iterdir())


def test_silence_is_no_loss():
    """Spheres at rest, of one species, numbered without gaps, say no more than their positions."""
    quiet = state_of(np.zeros((2, 3)), velocity=np.zeros((2, 3)), species=[0, 0], id=[0, 1])
    assert quiet.said() == [] and quiet.id.tolist() == [1, 2]
    assert state_of(np.zeros((2, 3)), id=[2, 1]).said() == []
    assert state_of(np.zeros((2, 3)), id=[1, 3]).said() == ["id"]


@pytest.mark.parametrize(
    "fields,message",
    [
        ({"radius": [1.0, 0.0]}, r"radius of sphere 2 is 0 m; accepted is one above 0"),
        ({"density": [-1.0, 1.0]}, r"density of sphere 1 is -1 kg/m3"),
        ({"velocity": [[0, 0, 0], [0, np.nan, 0]]}, r"velocity of sphere 2 in the file is nan"),
        ({"radius": [1.0]}, r"radius has the shape \(1,\); accepted is \(2,\)"),
        ({"species": [0.5, 0]}, r"species of sphere 1 in the file is 0.5; accepted are whole numbers"),
        ({"id": [3, 3]}, r"two spheres have the number 3"),
        ({"id": [-1, 3]}, r"id of sphere 1 in the file is -1"),
    ],
)
def test_bad_values(fields, message):
    with pytest.raises(StateError, match=message):
        state_of(np.zeros((2, 3)), **fields)


def test_no_spheres():
    with pytest.raises(StateError, match="no spheres"):
        state_of(np.zeros((0, 3)))


def test_files_of_no_format(tmp_path):
    greeting = tmp_path / "greeting"
    greeting.write_text("hello\n")
    with pytest.raises(CoordinatesError, match="of no known format; known are liggghts-data"):
        formats.read(greeting)
    with pytest.raises(CoordinatesError, match="No such file"):
        formats.read(tmp_path / "none")
    with pytest.raises(CoordinatesError, match="several formats end like this; name one of musen, published"):
        formats.format_for(tmp_path / "a.txt")
    with pytest.raises(CoordinatesError, match=r"no format has the ending '\.foo'"):
        formats.format_for(tmp_path / "a.foo")
    with pytest.raises(CoordinatesError, match="Did you mean 'musen'"):
        formats.format_named("musn")
    np.savez(tmp_path / "a.npz", centres=np.zeros(3))
    with pytest.raises(CoordinatesError, match="has the arrays centres; accepted are position"):
        formats.read(tmp_path / "a.npz")

"""Fillings: settled, as dense as asked, the same for the same seed, in any container, and resumed where interrupted."""

import numpy as np
import pytest

from dembench.initial import filling
from dembench.initial.cache import cache_directory
from dembench.initial.container import clearance
from dembench.initial.filling import Filling, Layer, PackingError, Protocol, check_packing, filled, measure
from dembench.initial.packings import Packing
from dembench.initial.stacking import stacked
from dembench.scene import (
    Bodies,
    Box,
    Cylinder,
    Domain,
    Frustum,
    Material,
    Motion,
    PairLaw,
    Plane,
    Scene,
    Species,
    check_scene,
)

BOX = Box(name="box", material="steel", lower=(-0.015, 0, -0.01), upper=(0.015, 0.03, 0.1), open_faces=("z+",))
SILO = (
    Cylinder(name="barrel", material="steel", start=(0, 0, 0.014), end=(0, 0, 0.1), radius=0.02),
    Frustum(name="cone", material="steel", start=(0, 0, 0), end=(0, 0, 0.014), radius_start=0.006, radius_end=0.02),
    Plane(name="plug", material="steel", point=(0, 0, 0), normal=(0, 0, 1)),
)
DRUM = Cylinder(
    name="drum",
    material="steel",
    start=(0, -0.01, 0),
    end=(0, 0.01, 0),
    radius=0.02,
    closed_start=True,
    closed_end=True,
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))


def plan(count=300, **changes):
    fields = {
        "materials": (
            Material(name="glass", density=2500, young=1e7, poisson=0.2),
            Material(name="steel", density=7200, young=1e9, poisson=0.2),
        ),
        "pair_laws": (
            PairLaw(a="glass", b="glass", restitution=0.5, friction=0.3),
            PairLaw(a="glass", b="steel", restitution=0.4, friction=0.2),
        ),
        "species": (
            Species(name="grain", material="glass", radius=0.002),
            Species(name="fine", material="glass", radius=0.0015),
        ),
        "walls": (BOX,),
        "layers": (Layer(species="grain", count=count),),
    }
    return Filling(**{**fields, **changes})


def start(asked, seed=0):
    return filling._lattice(asked, seed)


def nearest(position):
    return (np.linalg.norm(position[:, None] - position[None], axis=2) + np.eye(len(position))).min()


def scene_of(asked, position):
    return Scene(
        name="bed",
        materials=asked.materials,
        pair_laws=asked.pair_laws,
        species=asked.species,
        walls=asked.walls,
        bodies=Bodies(position=position, species=asked.body_species()),
        domain=Domain(lower=(-0.1, -0.1, -0.1), upper=(0.1, 0.1, 0.2)),
        duration=1.0,
    )


def test_the_lattice_is_loose_and_complete():
    asked = plan()
    position = start(asked, seed=3)
    assert position.shape == (300, 3)
    assert (clearance(asked.walls, position) >= 0.002).all()
    assert 2 * 0.002 < nearest(position) < 2.2 * 0.002
    assert measure(asked, position).fraction < 0.45
    assert not np.array_equal(position, start(asked, seed=4))


@pytest.mark.parametrize("walls", [SILO, (DRUM,)], ids=["silo", "drum"])
def test_layers_start_inside_the_walls_one_upon_the_other(walls):
    layers = (Layer(species="grain", count=40), Layer(species="fine", count=100))
    asked = plan(walls=walls, layers=layers)
    position = start(asked)
    assert asked.count == len(position) == 140
    np.testing.assert_array_equal(asked.radii(), np.repeat([0.002, 0.0015], [40, 100]))
    assert (clearance(walls, position) >= asked.radii()).all()
    assert nearest(position[:40]) > 0.004 and nearest(position[40:]) > 0.003
    assert position[:40, 2].max() + 0.002 <= position[40:, 2].min() - 0.0015
    check_scene(scene_of(asked, position))


def test_a_settled_bed_rests_on_the_floor():
    asked, seen = plan(), []
    position = filled(asked, seed=1, progress=lambda done, message: seen.append((done, message)))
    found = measure(asked, position)
    assert found.count == 300
    assert 0.45 < found.fraction < 0.6
    assert 3 < found.coordination < 5.5
    assert 0 < found.largest_overlap < 0.01
    assert position[:, 2].min() == pytest.approx(-0.01 + 0.002, rel=1e-2)
    assert 0.01 < found.height < start(asked, seed=1)[:, 2].max() + 0.01
    check_scene(scene_of(asked, position))
    assert seen[0] == (0.0, "settling 300 particles, stage 1 of 2, t = 0.000 s"), "said before the first step"
    fractions = [done for done, _ in seen]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert "settling 300 particles, stage 1 of 2" in seen[0][1] and "coordination" in seen[-1][1]


def test_a_settled_drum_keeps_its_layers():
    """The fine particles stay on the coarse ones, as the lattice put them, and the level is that of their volume."""
    asked = plan(walls=(DRUM,), layers=(Layer(species="grain", count=80), Layer(species="fine", count=150)))
    position = filled(asked, seed=0)
    check_scene(scene_of(asked, position))
    assert position[80:, 2].mean() > position[:80, 2].mean() + 0.005
    assert 0.4 < measure(asked, position).fraction < 0.65


def test_the_same_seed_makes_the_same_bits(monkeypatch):
    asked, made = plan(count=60), []
    for k, seed in enumerate((5, 5, 6)):
        monkeypatch.setenv("DEMBENCH_CACHE", str(cache_directory().parent / str(k)))
        made.append(filled(asked, seed))
    np.testing.assert_array_equal(made[0], made[1])
    assert not np.array_equal(made[0], made[2])


@pytest.mark.parametrize("stage", [0, 1])
def test_an_interrupted_filling_goes_on_with_the_same_bits(stage, monkeypatch):
    monkeypatch.setattr(filling, "CHECKPOINT", 0.0)
    asked = plan(count=60)
    whole = filled(asked, seed=0)
    (stored,) = cache_directory().iterdir()  # the checkpoints are gone
    stored.unlink()

    def interrupt(done, message):
        if done > (stage + 0.3) / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        filled(asked, 0, interrupt)
    assert [path.name[-10:] for path in cache_directory().iterdir()] == [f"stage{stage}.npz"]
    seen = []
    np.testing.assert_array_equal(filled(asked, 0, lambda done, message: seen.append(done)), whole)
    assert seen[0] > (stage + 0.2) / 2
    assert list(cache_directory().iterdir()) == [stored]


def test_a_damaged_checkpoint_is_left_aside(monkeypatch):
    asked = plan(count=60)
    whole = filled(asked, seed=0)
    (stored,) = cache_directory().iterdir()
    stored.unlink()
    stored.with_name(stored.stem + "-stage1.npz").write_bytes(b"no state")
    np.testing.assert_array_equal(filled(asked, seed=0), whole)
    assert list(cache_directory().iterdir()) == [stored]


def test_a_bed_that_is_refused_need_not_settle_anew(monkeypatch):
    monkeypatch.setattr(filling, "CHECKPOINT", 0.0)
    asked = plan(count=60, height=0.05)
    with pytest.raises(PackingError, match="not as it should be"):
        filled(asked, seed=0)
    assert [path.name[-10:] for path in cache_directory().iterdir()] == ["stage1.npz"]
    seen = []
    with pytest.raises(PackingError, match="not as it should be"):
        filled(asked, 0, lambda done, message: seen.append(done))
    assert seen[0] > 0.5


def test_locked_particles_arch_and_the_loose_protocol_is_looser():
    fractions = {}
    for name, protocol in (("default", Protocol()), ("loose", filling.LOOSE)):
        asked = plan(count=600, protocol=protocol)
        fractions[name] = measure(asked, filled(asked, 0)).fraction
    assert fractions["loose"] < fractions["default"] - 0.01


def test_a_bed_stacked_on_itself():
    """The copy stands on the bed without overlap, in the same box, touching; settled it is about twice as high."""
    asked = plan(count=150)
    bed = filled(asked, seed=0)
    start = stacked(bed, 0.002)
    assert (clearance(asked.walls, start) > 0.99 * 0.002).all()
    across = np.linalg.norm(start[:150, None] - start[None, 150:], axis=2)
    assert across.min() == pytest.approx(2 * 0.002, rel=1e-9)
    twice = plan(count=300, protocol=filling.STACKED)
    position = filled(twice, 0, start=start)
    low, high = measure(asked, bed), measure(twice, position)
    assert 1.7 * low.height < high.height < 2.1 * low.height
    assert high.coordination > 3
    assert len(list(cache_directory().iterdir())) == 2
    assert np.array_equal(filled(twice, 0, start=start), position)
    assert not np.array_equal(filled(twice, 0), position)


def test_a_filling_comes_from_the_cache_the_second_time(monkeypatch):
    asked = plan(count=60)
    first = filled(asked, seed=0)
    monkeypatch.setattr(filling, "_settle", None)
    np.testing.assert_array_equal(filled(asked, seed=0), first)


@pytest.mark.parametrize(
    "changes,named", [({"height": 0.05}, r"height 50\.00 \+- 1\.00 mm"), ({"bulk_fraction": 0.7}, r"fraction 0\.700")]
)
def test_a_bed_that_is_not_as_asked_is_refused(changes, named):
    found = Packing(
        count=9,
        height=0.032,
        fraction=0.55,
        bulk_fraction=0.58,
        coordination=4.3,
        mean_overlap=1e-4,
        largest_overlap=1e-3,
    )
    check_packing(plan(height=0.0325, bulk_fraction=0.585), found)
    with pytest.raises(PackingError, match=named) as caught:
        check_packing(plan(**changes), found)
    assert "height 32.00 mm" in str(caught.value) and "coordination 4.30" in str(caught.value)


def test_a_bed_without_a_bulk_does_not_pass_for_one():
    flat = Packing(
        count=9,
        height=0.005,
        fraction=0.5,
        bulk_fraction=float("nan"),
        coordination=3.0,
        mean_overlap=0.0,
        largest_overlap=0.0,
    )
    with pytest.raises(PackingError, match="bulk solid fraction"):
        check_packing(plan(bulk_fraction=0.58), flat)


def test_a_filling_that_does_not_rest_is_refused():
    asked = plan(count=60, protocol=Protocol(longest=0.01))
    with pytest.raises(PackingError, match=r"60 particles do not rest after 0\.01 s"):
        filled(asked, seed=0)
    assert not cache_directory().exists()


def test_particles_without_room_are_refused():
    with pytest.raises(PackingError, match=r"layer 1 has 9000 particles of radius 0.002 m.*sites for \d+ of them"):
        filled(plan(count=9000), seed=0)
    with pytest.raises(PackingError, match=r"up to z = 0 m"):
        filled(plan(top=0.0), seed=0)


@pytest.mark.parametrize(
    "changes,named",
    [
        (
            {"layers": (Layer(species="sand", count=3),)},
            r"layers\[0\].species: 'sand' is not known; accepted are grain",
        ),
        ({"walls": SILO[2:]}, "plug leave the container open without end along x"),
        ({"walls": (DRUM.model_copy(update={"motion": Motion(angular_velocity=(0, -2, 0))}),)}, "drum moves"),
        ({"layers": ()}, "at least 1 item"),
    ],
)
def test_plans_that_cannot_be_filled(changes, named):
    with pytest.raises(ValueError, match=named):
        plan(**changes)

"""Generated beds: settled, as dense as asked, the same for the same seed."""

import numpy as np
import pytest

from dembench.initial import generate
from dembench.initial.generate import BedPlan, PackingError, check_packing, lattice, measure, settled_bed
from dembench.initial.progress import silent
from dembench.initial.quality import Packing
from dembench.scene import Bodies, Box, Domain, Material, PairLaw, Scene, Species, check_scene


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))


def plan(**changes):
    fields = {
        "count": 300,
        "radius": 0.002,
        "material": Material(name="glass", density=2500, young=1e7, poisson=0.2),
        "wall_material": Material(name="steel", density=7200, young=1e9, poisson=0.2),
        "pair_laws": (
            PairLaw(a="glass", b="glass", restitution=0.5, friction=0.3),
            PairLaw(a="glass", b="steel", restitution=0.4, friction=0.2),
        ),
        "box": Box(
            name="box", material="steel", lower=(-0.015, 0, -0.01), upper=(0.015, 0.03, 0.1), open_faces=("z+",)
        ),
    }
    return BedPlan(**{**fields, **changes})


def test_the_lattice_is_loose_and_complete():
    asked = plan()
    position = lattice(asked, seed=3)
    assert position.shape == (300, 3)
    assert (asked.box.signed_distance(position) >= asked.radius).all()
    distance = np.linalg.norm(position[:, None] - position[None], axis=2) + np.eye(300)
    assert 2 * asked.radius < distance.min() < 2.2 * asked.radius
    assert measure(asked, position).fraction < 0.45
    assert not np.array_equal(position, lattice(asked, seed=4))


def test_a_settled_bed_rests_on_the_floor():
    asked, seen = plan(), []
    position = settled_bed(asked, seed=1, progress=lambda done, message: seen.append((done, message)))
    found = measure(asked, position)
    assert found.count == 300
    assert 0.45 < found.fraction < 0.6
    assert 3 < found.coordination < 5.5
    assert 0 < found.largest_overlap < 0.01
    assert position[:, 2].min() == pytest.approx(-0.01 + asked.radius, rel=1e-2)
    assert 0.01 < found.height < lattice(asked, seed=1)[:, 2].max() + 0.01
    check_scene(
        Scene(
            name="bed",
            materials=(asked.material, asked.wall_material),
            pair_laws=asked.pair_laws,
            species=(Species(name="grain", material="glass", radius=asked.radius),),
            walls=(asked.box,),
            bodies=Bodies(position=position),
            domain=Domain(lower=(-0.02, -0.01, -0.02), upper=(0.02, 0.04, 0.2)),
            duration=1.0,
        )
    )
    fractions = [done for done, _ in seen]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert "settling 300 grains" in seen[0][1] and "coordination" in seen[-1][1]


def test_the_same_seed_makes_the_same_bits():
    asked = plan(count=60)
    first, again, other = (generate._settle(asked, seed, silent) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_locked_grains_arch_and_the_loose_protocol_is_looser():
    fractions = {}
    for name, protocol in (("default", generate.Protocol()), ("loose", generate.LOOSE)):
        asked = plan(count=600, protocol=protocol)
        fractions[name] = measure(asked, generate._settle(asked, 0, silent)).fraction
    assert fractions["loose"] < fractions["default"] - 0.01


def test_a_bed_comes_from_the_cache_the_second_time(monkeypatch):
    asked = plan(count=60)
    first = settled_bed(asked, seed=0)
    monkeypatch.setattr(generate, "_settle", None)
    np.testing.assert_array_equal(settled_bed(asked, seed=0), first)


@pytest.mark.parametrize(
    "changes,named", [({"height": 0.05}, r"height 50\.00 \+- 1\.00 mm"), ({"bulk_fraction": 0.7}, r"fraction 0\.700")]
)
def test_a_bed_that_is_not_as_asked_is_refused(changes, named):
    found = Packing(count=9, height=0.032, fraction=0.55, bulk_fraction=0.58, coordination=4.3, largest_overlap=0.001)
    check_packing(plan(height=0.0325, bulk_fraction=0.585), found)
    with pytest.raises(PackingError, match=named) as caught:
        check_packing(plan(**changes), found)
    assert "height 32.00 mm" in str(caught.value) and "coordination 4.30" in str(caught.value)


def test_a_bed_without_a_bulk_does_not_pass_for_one():
    flat = Packing(
        count=9, height=0.005, fraction=0.5, bulk_fraction=float("nan"), coordination=3.0, largest_overlap=0.0
    )
    with pytest.raises(PackingError, match="bulk solid fraction"):
        check_packing(plan(bulk_fraction=0.58), flat)


def test_a_bed_that_does_not_rest_is_refused():
    asked = plan(count=60, protocol=generate.Protocol(longest=0.01))
    with pytest.raises(PackingError, match=r"60 grains do not rest after 0\.01 s"):
        settled_bed(asked, seed=0)

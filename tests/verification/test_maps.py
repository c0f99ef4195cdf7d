"""Stability maps: bounds against closed forms, searches on engines that are known exactly, scenes, the page."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from dembench.cli import app
from dembench.runs.plan import EngineChoice, RequestError
from dembench.scene.checks import check_scene
from dembench.verification.maps import breaking, families, grains, impacts, lattices, store
from dembench.verification.maps.bounds import Pair, critical_step, hertz_damping, largest_frequency
from dembench.verification.maps.breaking import Outcome
from dembench.verification.maps.rigs import AXES
from dembench.verification.maps.search import Search

# ---- bounds


def test_the_modes_of_a_free_pair_are_those_of_the_closed_form() -> None:
    """Two equal spheres: w^2 = 2 kn/m along the normal, 7 kt/m across it with rotation."""
    position, free = np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.array([True, True])
    for kn, kt, expected in ((5.0, 0.0, 2 * 5.0 / 3), (0.0, 5.0, 7 * 5.0 / 3)):
        found = largest_frequency(position, free, [(0, 1)], 1.0, 3.0, kn, kt)
        assert found**2 == pytest.approx(expected, rel=1e-12)


def test_a_sphere_in_a_fixed_cage_spins_at_its_highest_frequency() -> None:
    """With Z contacts around it w^2 = (5/3) Z kt/m, from 2/3 Z kt r^2 over 2/5 m r^2; moving it is slower here."""
    cage = np.vstack([np.eye(3), -np.eye(3)]) * 2
    position = np.vstack([np.zeros(3), cage])
    free = np.arange(7) == 0
    found = largest_frequency(position, free, [(0, k) for k in range(1, 7)], 1.0, 2.0, 1.0, 0.9)
    assert found**2 == pytest.approx(5 / 3 * 6 * 0.9 / 2, rel=1e-12)


def test_a_block_is_between_a_cage_and_an_endless_lattice() -> None:
    """The bound of one sphere in a cage is 1.549 sqrt(m/(Z kt)), that of the endless lattice 1.095 sqrt(m/(Z kt))."""
    mass = 4 / 3 * math.pi * lattices.RADIUS**3 * lattices.DENSITY
    pair = Pair(lattices.YOUNG, lattices.POISSON, (lattices.RADIUS,) * 2, (mass, mass))
    for contacts in AXES["coordination"]:
        unit = math.sqrt(mass / (contacts * pair.tangential(1e-3 * 2 * lattices.RADIUS)))
        found = lattices.bound(int(contacts), 1e-3) / unit
        assert 1.095 < found < 1.549


def test_the_undamped_bound_of_an_impact_is_half_the_contact_time() -> None:
    """2/w at the largest overlap a: w^2 = 1.875 v^2/a^2 and t_c = 2.9432 a/v give 0.4962 t_c."""
    pair = Pair(1e9, 0.25, (1e-3, 1e-3), (1e-5, 1e-5))
    depth = pair.impact_overlap(2.0)
    step = critical_step(math.sqrt(pair.normal(depth) / pair.mass))
    assert step / pair.contact_time(2.0) == pytest.approx(2 / math.sqrt(1.875) / 2.9432, rel=1e-9)
    assert pair.tangential(depth) / pair.normal(depth) == pytest.approx(2 * 0.75 / 1.75)


def test_the_damped_bound_is_where_central_differences_with_a_lagging_dashpot_lose_stability() -> None:
    """The recursion v += (-w^2 x - 2 z w v) dt, x += v dt has an eigenvalue of -1 exactly at the bound."""
    z = hertz_damping(0.3)
    step = critical_step(1.0, z)
    matrix = np.array([[1 - step**2, step - 2 * z * step**2], [-step, 1 - 2 * z * step]])
    assert np.min(np.linalg.eigvals(matrix).real) == pytest.approx(-1, abs=1e-12)
    assert hertz_damping(1.0) == 0


# ---- rigs


@pytest.mark.parametrize("family", families.FAMILIES, ids=lambda family: family.name)
def test_every_rig_is_a_scene_whose_cells_do_not_touch(family) -> None:
    """All values on all axes are there once; starts are inside the domain with at most a percent of overlap."""
    rigs = family.rigs(family.values(list(AXES)))
    found = [tuple(cell.at[axis] for axis in family.axes) for rig in rigs for cell in rig.cells]
    assert len(found) == len(set(found)) == math.prod(len(AXES[axis]) for axis in family.axes)
    for rig in rigs:
        check_scene(rig.scene)
        covered = sorted(k for cell in rig.cells for k in cell.bodies)
        assert covered == list(range(len(rig.scene.bodies)))
        low = [rig.scene.bodies.position[list(cell.bodies)].min(axis=0) for cell in rig.cells]
        high = [rig.scene.bodies.position[list(cell.bodies)].max(axis=0) for cell in rig.cells]
        reach = 2 * max(rig.scene.radii())
        for k in range(1, len(rig.cells)):
            gap = max(np.max(np.array(low[k]) - high[k - 1]), np.max(np.array(low[k - 1]) - high[k]))
            assert gap > 0.9 * reach or family.name == "lattices"
        alone = family.guard_rig(rig)
        assert len(alone.cells) == 1 and alone.cells[0].at in [cell.at for cell in rig.cells]


def test_impacts_of_a_rig_have_one_bound() -> None:
    """Each pair's own bound, from its radius, speed and damping, is that of the rig to rounding."""
    rig = impacts.rigs(impacts.FAMILY.values(["speed", "restitution"]))[0]
    for cell in rig.cells:
        radius = rig.scene.radii()[cell.bodies[0]]
        mass = rig.scene.masses()[cell.bodies[0]]
        pair = Pair(cell.at["stiffness"], impacts.POISSON, (radius, radius), (mass, mass))
        frequency = math.sqrt(pair.normal(pair.impact_overlap(cell.at["speed"])) / pair.mass)
        own = critical_step(frequency, hertz_damping(cell.at["restitution"]))
        assert own == pytest.approx(rig.bound, rel=1e-9)


def test_heavy_grains_turn_at_the_largest_overlap() -> None:
    """The kinetic energy of both goes into two Hertz contacts with 2/5 k a^(5/2) each."""
    rig = grains.rigs(grains.FAMILY.values(["mass ratio", "restitution"]))[0]
    for cell in rig.cells:
        left = cell.bodies[0]
        radius, speed = rig.scene.radii()[left], rig.scene.bodies.velocity[left, 0]
        pair = Pair(grains.YOUNG, grains.POISSON, (radius, radius), (1.0, 1.0))
        elastic = 2 * 0.4 * pair.hertz * (grains.SOFTNESS * radius) ** 2.5
        assert rig.scene.masses()[left] * speed**2 == pytest.approx(elastic, rel=1e-9)


# ---- classes and searches


def test_classes_follow_their_thresholds() -> None:
    """Energy first, then sides, then the rebound; what is no number is none of them."""
    assert breaking.of_impact(1.2, True, 1.0, 1.0).kind == "energy growth"
    assert breaking.of_impact(0.9, True, 1.0, 1.0).kind == "tunnelling"
    assert breaking.of_impact(0.0, False, 0.05, 1.0).kind == "no rebound"
    assert breaking.of_impact(0.3, False, 0.5, 0.5).kind == "stable"
    assert breaking.of_impact(math.nan, False, 0.5, 0.5).kind == "not a number"
    assert breaking.of_lattice(2.5).kind == "energy growth"
    assert breaking.of_lattice(0.6).kind == "stable"


def _searched(limits: list[float], guards: bool = False) -> Search:
    """A search on impacts whose cells break exactly above given factors."""
    rig = impacts.rigs(impacts.FAMILY.values(["speed"]))[0]
    search = Search(EngineChoice("peclet-hertz"), impacts.FAMILY, rig, guards=rig if guards else None)
    word: breaking.Class = "refused" if guards else "energy growth"
    while (count := search.next()) is not None:
        search.runs[count] = "run"
        search.found[count] = [Outcome(word if search.factor(count) > limit else "stable") for limit in limits]
        assert len(search.found) < 40
    return search


def test_a_search_brackets_every_cell_and_shares_its_runs() -> None:
    """Cells that break at one step need as many runs as one cell; each limit is inside its bracket of 15 %."""
    alone = _searched([0.9] * 4)
    assert len(alone.found) <= 7
    limits = [0.2, 0.9, 0.95, 3.0]
    search = _searched(limits)
    row = store.gather([impacts.FAMILY], [search], "", True).maps[0].rows[0]
    for cell, limit in zip(row.cells, limits, strict=True):
        assert cell.stable is not None and cell.breaks is not None
        assert cell.stable.factor <= limit < cell.breaks.factor
        # close to the end of the range only a few whole numbers of steps remain
        assert cell.breaks.factor / cell.stable.factor < 1.16 or limit == 3.0


def test_what_never_breaks_costs_two_runs() -> None:
    """The end of the range and half the bound."""
    search = _searched([math.inf] * 4)
    assert len(search.found) == 2
    cell = store.gather([impacts.FAMILY], [search], "", True).maps[0].rows[0].cells[0]
    assert cell.breaks is None and cell.stable is not None and cell.stable.factor == pytest.approx(4, rel=0.1)


def test_a_guard_is_searched_by_refusals_alone() -> None:
    """A guard at 0.7 bounds is bracketed, and stands beside the row that it belongs to."""
    stable, guard = _searched([2.0] * 4), _searched([0.7] * 4, guards=True)
    guard.guards = stable.rig
    row = store.gather([impacts.FAMILY], [stable, guard], "", True).maps[0].rows[0]
    assert row.guard is not None and row.guard.accepted is not None and row.guard.refused is not None
    assert row.guard.accepted <= 0.7 < row.guard.refused


def test_axes_choose_the_maps() -> None:
    """An axis that is not known is named with those that are."""
    assert [f.name for f in families.families(families.axes(["mass-ratio"]))] == ["grains"]
    assert [f.name for f in families.families(families.axes([]))] == ["impacts", "lattices", "grains"]
    with pytest.raises(RequestError, match=r"no axis 'stifness'\. Did you mean 'stiffness'"):
        families.axes(["stifness"])


# ---- from the command to the page


def test_an_engine_without_contacts_never_rebounds(standin, tmp_path: Path) -> None:
    """Free flight: bodies go on into each other whatever the step, down to the end of the range; the page says so.

    A repeated command takes all its answers from the runs that are there.
    """
    standin()
    words = ["map", "--engines", "standin", "--axes", "restitution", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    (row,) = json.loads(done.stdout)["maps"][0]["rows"]
    assert row["guard"] is None and len(row["cells"]) == len(AXES["restitution"])
    assert {probe["kind"] for cell in row["cells"] for probe in cell["probes"]} == {"no rebound"}
    assert min(probe["factor"] for probe in row["cells"][0]["probes"]) < 0.075
    assert "no rebound (3)" in (tmp_path / "map.html").read_text()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/status.json")}
    again = CliRunner().invoke(app, words)
    assert json.loads(again.stdout)["maps"] == json.loads(done.stdout)["maps"]
    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/status.json")}


def test_a_run_that_dies_is_an_answer(standin, tmp_path: Path) -> None:
    """A program that crashes before its first frame refuses every step, and no step is tried twice."""
    standin(standin=["crash", 0])
    words = ["map", "--engines", "standin", "--axes", "restitution", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    (row,) = json.loads(done.stdout)["maps"][0]["rows"]
    probes = [probe for cell in row["cells"] for probe in cell["probes"]]
    assert {probe["kind"] for probe in probes} == {"refused"} and probes[0]["detail"] == "exit code 3"
    assert len(list(tmp_path.glob("*/status.json"))) == len({probe["run"] for probe in probes})


@pytest.mark.slow
def test_the_soft_sphere_solver_breaks_near_the_bound_and_the_page_says_so(tmp_path: Path) -> None:
    """A light grain between heavy ones, elastic and damped: stable to 0.9 bounds at least, broken at 1.3 at most.

    Linear stability of the two springs at their largest overlap is exact there: in heavy company the light grain makes
    hundreds of oscillations before the overlap has changed.
    """
    words = ["map", "--engines", "peclet-hertz", "--axes", "mass-ratio", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    found = store.Maps.model_validate({k: v for k, v in json.loads(done.stdout).items() if k != "report"})
    row = found.maps[0].rows[0]
    heavy = [cell for cell in row.cells if cell.at["mass ratio"] >= 100]
    for cell in heavy:
        assert cell.stable is not None and cell.breaks is not None
        assert cell.stable.factor > 0.85 and cell.breaks.factor < 1.3
        assert cell.breaks.kind == "energy growth"
    assert row.guard is not None and row.guard.refused is not None and "dt" in row.guard.detail
    page = (tmp_path / "map.html").read_text()
    assert "A light grain between heavy ones" in page and "energy growth" in page
    assert not (tmp_path / ".map.json.tmp").exists()

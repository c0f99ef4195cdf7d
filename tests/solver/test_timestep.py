"""The automatic time step against what it stands on, and softening by an overlap budget."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from grains import DENSITY, FLOOR, RADIUS, YOUNG, grains
from typer.testing import CliRunner

from dembench.cli import app
from dembench.engines.registry import engine
from dembench.scene import Domain, LinearSpring, Motion, Rigid, Scene, save_scene
from dembench.solver import Simulation, SolverError
from dembench.solver.guard import check_step
from dembench.solver.loads import Loads
from dembench.solver.softening import softening_of
from dembench.solver.timestep import COLLISION, RAYLEIGH, STABILITY, choose_step

MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3


def head_on(speed: float = 1.0, **changes: Any) -> Scene:
    """Two grains that meet at a relative speed."""
    position = [[-1.01 * RADIUS, 0, 0], [1.01 * RADIUS, 0, 0]]
    return grains(position, [[speed / 2, 0, 0], [-speed / 2, 0, 0]], **{"duration": 0.004, **changes})


def test_contact_time_and_overlap_are_those_of_the_impact() -> None:
    """Fastest impact, contact time and largest overlap as the solver itself makes them."""
    scene = head_on(restitution=1.0)
    found = choose_step(scene)
    assert found.speed == pytest.approx(1.0)
    simulation = Simulation(scene, found.contact_time / 500, precision="float64")
    speed = []
    for _ in range(650):
        simulation.step()
        speed.append(simulation.velocity[1, 0])
    changing = np.flatnonzero(np.abs(np.diff(speed)) > 0)
    assert (changing[-1] - changing[0]) * simulation.dt == pytest.approx(found.contact_time, rel=1e-2)
    assert simulation.largest_overlap() == pytest.approx(found.overlap, rel=1e-3)


def test_the_collision_bound_keeps_the_restitution() -> None:
    """1 % of e on average over the phases of the first contact, with either dashpot, with the step that it chooses."""
    for midpoint in (True, False):
        gaps = np.linspace(0, 1, 20, endpoint=False)
        y = 0.01 * np.arange(20)
        made = head_on(friction=0.0)
        found = choose_step(made, midpoint)
        assert found.bound in (STABILITY, COLLISION)
        apart = RADIUS + (1 + gaps) * found.step / 2
        position = np.concatenate([np.stack([s * apart, y, 0 * y], axis=1) for s in (-1, 1)])
        velocity = np.repeat([[0.5, 0, 0], [-0.5, 0, 0]], 20, axis=0)
        scene = grains(position, velocity, friction=0.0)
        simulation = Simulation(scene, found.step, precision="float64", midpoint=midpoint)
        simulation.step(60)
        measured = simulation.velocity[20:, 0] - simulation.velocity[:20, 0]
        assert measured.mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("friction", "factor"), [(0.5, 1.095), (0.0, 2.449)])
def test_d3_a_strained_lattice_is_stable_below_the_critical_step_and_not_above(friction: float, factor: float) -> None:
    """D3: face-centred lattice, 12 contacts, periodic, linear springs: noise grows beyond the formula's step alone.

    All spheres spin in phase, or all move against their neighbours: the box holds the mode that the formula names.
    """
    edge, kn = 4, 1000.0
    kt = 857.0
    a = 2 * RADIUS * np.sqrt(2) * (1 - 1e-3)
    base = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])
    cells = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    position = ((cells + base + 0.25) * a).reshape(-1, 3)
    random = np.random.default_rng(1)
    critical = factor * np.sqrt(MASS / (12 * (kt if friction else kn)))
    growth = {}
    for ratio in (0.95, 1.05):
        scene = grains(
            position,
            1e-6 * random.normal(size=position.shape),
            1e-6 / RADIUS * random.normal(size=position.shape) * (friction > 0),
            law=LinearSpring(normal_stiffness=kn, tangential_stiffness=kt),
            friction=friction,
            restitution=1.0,
            domain=Domain(lower=(0, 0, 0), upper=(edge * a,) * 3, periodic=(True, True, True)),
        )
        simulation = Simulation(scene, ratio * critical, precision="float64", allow_unstable=True)
        start = simulation.kinetic_energy()
        simulation.step(400)
        growth[ratio] = simulation.kinetic_energy() / start
    assert growth[0.95] < 3
    assert growth[1.05] > 10


def test_critical_step_of_a_bed_is_that_of_twelve_contacts() -> None:
    """Many grains: the formula with Z = 12 at the largest overlap; one pair: its own frequencies."""
    law = LinearSpring(normal_stiffness=1000.0, tangential_stiffness=857.0)
    many = grains(2.2 * RADIUS * np.arange(60).reshape(20, 3), law=law)
    assert choose_step(many).critical == pytest.approx(1.095 * np.sqrt(MASS / (12 * 857)), rel=1e-9)
    assert choose_step(head_on(law=law)).critical == pytest.approx(2 * np.sqrt(MASS / (7 * 857)), rel=1e-9)
    smooth = head_on(law=law, friction=0.0)
    assert choose_step(smooth).critical == pytest.approx(np.sqrt(2) * np.sqrt(MASS / 1000), rel=1e-9)


def test_speeds_include_the_fall_onto_the_floor_and_out_of_the_domain() -> None:
    """v^2 = v0^2 + 2 g h with h to the floor, below it to the face of the domain; moving walls add theirs."""
    gravity = (0, 0, -9.81)
    domain = Domain(lower=(-1, -1, -0.2), upper=(1, 1, 1))
    fields: dict[str, Any] = {"gravity": gravity, "domain": domain}
    position = [[0, 0, 0.1 + RADIUS], [0, 0.1, 0.05 + RADIUS]]
    velocity = [[0, 0, 0], [0, 1.5, 0]]
    on_floor = Loads.of(grains(position, velocity, walls=(FLOOR,), **fields))
    assert on_floor.impact == pytest.approx(np.sqrt(1.5**2 + 2 * 9.81 * 0.05), rel=1e-6)
    free = Loads.of(grains(position, velocity, **fields))
    assert free.impact == pytest.approx(np.sqrt(1.5**2 + 2 * 9.81 * (0.25 + RADIUS)), rel=1e-6)
    belt = FLOOR.model_copy(update={"motion": Motion(velocity=(2.0, 0, 0))})
    moving = Loads.of(grains(position, velocity, walls=(belt,), **fields))
    assert moving.impact == pytest.approx(on_floor.impact + 2, rel=1e-6)
    assert Loads.of(grains(position, velocity)).impact == pytest.approx(1.5)


def test_resting_grains_are_bound_by_the_guard() -> None:
    """No speed and no load: the guard's Rayleigh bound."""
    found = choose_step(grains([[0, 0, 0], [0, 0, 1]]))
    assert found.bound == RAYLEIGH
    assert found.step <= 0.6 * found.rayleigh
    assert found.plain()["contact_time"] is None


def test_the_automatic_step_is_taken_when_asked_for() -> None:
    scene = head_on()
    assert Simulation(scene, "auto", midpoint=True).dt == choose_step(scene).step
    assert Simulation(scene, "auto").dt == choose_step(scene, midpoint=False).step
    assert Simulation(scene).dt == scene.closed_step()
    assert engine("peclet-hertz").settings(scene, "open").dt == choose_step(scene).step
    with pytest.raises(SolverError, match="softening and dt 'auto' are for the soft-sphere solver, not for impulse"):
        Simulation(scene, "auto", method="impulse")


@pytest.mark.parametrize("speed", [0.01, 0.1, 1.0, 5.0])
def test_d2_the_guard_refuses_steps_beyond_its_bound(speed: float) -> None:
    """D2: the guard's bound, 0.35 of the contact time, is within 20 % of 0.4, where an impact blows up; and below it
    the impact is bounded: nobody leaves faster than a tenth beyond what came."""
    scene = head_on(speed, restitution=0.5, friction=0.0)
    contact = 2.868 * ((MASS / 2) ** 2 / (RADIUS / 2 * (YOUNG / (2 * (1 - 0.2**2))) ** 2 * speed / 2)) ** 0.2
    limit = min(0.35 * contact, 0.6 * scene.rayleigh_time())
    assert check_step(scene, 0.99 * limit, allow=False) == []
    with pytest.raises(SolverError, match="choose a smaller dt, or allow an unstable step"):
        check_step(scene, 1.01 * limit, allow=False)
    assert "is above" in check_step(scene, 1.01 * limit, allow=True)[0]
    simulation = Simulation(scene, 0.99 * limit, precision="float64")
    simulation.step(int(0.06 * RADIUS / speed / simulation.dt) + 20)
    assert simulation.velocity[1, 0] - simulation.velocity[0, 0] < 1.1 * speed


def test_d2_an_impact_blows_up_beyond_the_bound_on_the_contact_time() -> None:
    """D2: r = 1 mm, E = 1e9, 100 m/s, e = 0.5: 3 % at 0.2 Rayleigh times, blow-up at 0.7, which is 0.42 contacts."""
    gap = np.linspace(0, 1, 10, endpoint=False)
    y = 0.01 * np.arange(10)
    scene = grains([[0, 0, 0]], young=1e9, poisson=0.25)
    ends = {}
    for ratio in (0.2, 0.7):
        dt = ratio * scene.rayleigh_time()
        apart = RADIUS + (1 + gap) * 100 * dt / 2
        position = np.concatenate([np.stack([s * apart, y, 0 * y], axis=1) for s in (-1, 1)])
        velocity = np.repeat([[50.0, 0, 0], [-50.0, 0, 0]], 10, axis=0)
        made = grains(position, velocity, young=1e9, poisson=0.25, friction=0.0)
        simulation = Simulation(made, dt, precision="float64", allow_unstable=True)
        simulation.step(40)
        ends[ratio] = (simulation.velocity[10:, 0] - simulation.velocity[:10, 0]) / 100
    assert np.abs(ends[0.2] - 0.5).max() < 0.04
    assert np.abs(ends[0.7] - 0.5).max() > 0.5


def test_softening_takes_what_the_budget_leaves() -> None:
    """Impact overlaps of 5 % of the diameter, never softer than a tenth and never stiffer than the material."""
    hard = head_on(5.0, young=1e9)
    softer = softening_of(hard)
    assert 0.1 < softer.factor < 1
    assert softer.overlaps["impact"] == pytest.approx(0.05)
    assert choose_step(softer.apply(hard)).overlap == pytest.approx(0.05 * 2 * RADIUS)
    assert softening_of(head_on(0.1, young=1e12)).factor == 0.1
    soft = softening_of(head_on(5.0, young=1e7))
    assert soft.factor == 1
    assert soft.apply(head_on(5.0, young=1e7)) == head_on(5.0, young=1e7)


def test_softening_is_never_silent(tmp_path: Any) -> None:
    scene = head_on(0.1, young=1e10, restitution=1.0)
    simulation = Simulation(scene, "auto", softening=True)
    assert simulation.warnings == [softening_of(scene).text()]
    assert simulation.settings["softening"] is True
    assert "Young's moduli times 0.1" in simulation.warnings[0]
    stiff = Simulation(scene, "auto")
    assert simulation.dt > 2 * stiff.dt
    simulation.step(round(0.1 * RADIUS / 0.1 / simulation.dt))
    assert simulation.largest_overlap() == pytest.approx(softening_of(scene).overlaps["impact"] * 2 * RADIUS, rel=0.05)
    hertz = engine("peclet-hertz")
    for division in ("closed", "open"):
        settings = hertz.settings(scene, division, {"softening": "true"})
        assert settings.softening and "softened" in hertz.law(scene, settings)
        plain = hertz.settings(scene, division)
        assert not plain.softening and hertz.law(scene, plain) == ""
    assert settings.dt == pytest.approx(choose_step(softening_of(scene).apply(scene)).step)
    for wrong in (Rigid(), LinearSpring(normal_stiffness=1.0, tangential_stiffness=1.0)):
        with pytest.raises(SolverError, match="softening"):
            Simulation(scene.model_copy(update={"law": wrong}), softening=True)


def test_the_command_prints_time_scales_and_forecasts(tmp_path: Any) -> None:
    path = tmp_path / "pair.json"
    save_scene(head_on(), path)
    shown = CliRunner().invoke(app, ["timestep", str(path)])
    assert shown.exit_code == 0, shown.output
    for text in ("Rayleigh time", "shortest contact", "critical step", "automatic step", "peclet-hertz", "open"):
        assert text in shown.output
    plain = json.loads(CliRunner().invoke(app, ["timestep", str(path), "--json"]).stdout)
    assert plain["step"] == choose_step(head_on()).step
    assert [row["division"] for row in plain["forecasts"]] == ["closed", "open"]
    save_scene(head_on(law=Rigid()), path)
    assert CliRunner().invoke(app, ["timestep", str(path)]).exit_code == 2

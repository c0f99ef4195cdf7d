"""Fast impacts, head-on and grazing: D9 and D10."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from dembench.results import Result
from dembench.scene import Constraint, Domain, Plane, Rigid, Scene, Sdf
from dembench.scene.materials import Law
from dembench.scene.walls import WallShape
from dembench.verification.checks import Check, Experiment, Trial, at_least, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, scene_of
from dembench.verification.stability.common import changed, closed_step, contact_time, fitted, motion

FAST, BULLET_E = 100.0, 0.8
"""Speed [m/s] and restitution of the impacts of unit spheres."""
THICKNESSES = (2.0, 1.0, 0.2, 0.02)
"""Thicknesses of the slabs in radii."""
RIGID_STEPS = (1e-4, 1e-3, 1e-2, 2e-2, 5e-2)
APART = 200.0
FLIGHT = 20.0
"""Distance of a bullet from its target [m]."""

GRAZE, GRAZE_YOUNG = 0.99, 1e12
"""Impact parameter in diameters and Young's modulus [Pa]; much softer spheres pass by with hardly a deflection."""


def bullet_scene(name: str, step: float | None, slabs: bool) -> Scene:
    """Unit spheres at 100 m/s: into a fixed sphere and a plane, or into slabs of four thicknesses, one behind another.

    Args:
        name: Name of the scene.
        step: Step of rigid spheres [s]; None makes soft ones with a fiftieth of a contact time.
        slabs: Whether the targets are slabs on grids of signed distances.
    """
    kind = Kind(1e9, 2500, 1.0, restitution=BULLET_E)
    dt = step or fitted(contact_time(kind, FAST) / 50, 0.4)
    targets = len(THICKNESSES) if slabs else 2
    offset = 0.37 * FAST * dt
    bodies = [Body("grain", (APART * k - FLIGHT - offset, 0, 0), (FAST, 0, 0)) for k in range(targets)]
    walls: list[WallShape] = []
    if slabs:
        walls = [_slab(k, thickness) for k, thickness in enumerate(THICKNESSES)]
    else:
        bodies.append(Body("grain", (0, 0, 0)))
        walls = [Plane(name="plane", material=WALL, point=(APART + 1, 0, 0), normal=(-1, 0, 0))]
    scene = scene_of(
        name,
        {"grain": kind},
        bodies,
        time_step=dt,
        times=[0, 0.4],
        walls=walls,
        law=None if step is None else Rigid(),
    )
    room = Domain(lower=(-100, -20, -20), upper=(APART * targets, 20, 20))
    held = () if slabs else (Constraint(kind="fixed", bodies=(targets,)),)
    return changed(scene, domain=room, constraints=held)


def _slab(k: int, thickness: float) -> Sdf:
    """A slab across x that reaches out of the grid on all other sides; its nearer face is a radius beyond a target."""
    near, half = APART * k + 1.0, 0.5 * thickness
    spacing = min(half, 0.5)
    return Sdf.from_function(
        name=f"slab{k}",
        material=WALL,
        function=lambda points: np.abs(points[:, 0] - near - half) - half,
        lower=(near - 3, -spacing, -spacing),
        upper=(near + thickness + 3, spacing, spacing),
        spacing=spacing,
    )


def stopped(result: Result, targets: int) -> np.ndarray:
    """Restitution of every bullet [-], shape (targets,); -1 where it is beyond its target or still moves forward."""
    seen = motion(result)
    x, v = seen.position[-1, :targets, 0] - APART * np.arange(targets), seen.velocity[-1, :targets, 0]
    return np.where((x < 1) & (v < 0), -v / FAST, -1.0)


def _bullets(
    results: Mapping[str, Result], name: str, steps: tuple[float, ...], targets: int, slabs: bool, ids: str
) -> Mapping[str, float]:
    """Share of impacts with v dt <= thickness + r that come back, of all that come back, and their worst error of e."""
    bound = np.array(THICKNESSES) + 1 if slabs else np.full(targets, math.inf)
    due, slow, every_one, errors = [], [], [], [0.0]
    for k, step in enumerate(steps):
        result = results.get(f"{name}_{k}")
        found = np.full(targets, -1.0) if result is None else stopped(result, targets)
        back = found >= 0
        within = FAST * step <= bound
        due.append(within)
        slow.append(back & within)
        every_one.append(back)
        errors += list(np.abs(found[back & within] - BULLET_E))
    return {
        f"D9{ids[0]}": float(np.sum(slow) / np.sum(due)),
        f"D9{ids[1]}": float(np.mean(every_one)),
        f"D9{ids[2]}": float(max(errors)),
    }


def _bullet_experiment(ids: str, name: str, steps: tuple[float | None, ...], slabs: bool) -> Experiment:
    targets = len(THICKNESSES) if slabs else 2
    rigid = steps[0] is not None
    what = f"{'rigid' if rigid else 'soft'} at 100 m/s into {'slabs of 2 to 0.02 r' if slabs else 'a sphere, a plane'}"
    trials = []
    for k, step in enumerate(steps):
        scene = partial(bullet_scene, f"{name}_{k}", step, slabs)
        trials.append(Trial(f"{name}_{k}", scene, closed_step(scene)))
    taken = tuple(step or 0.0 for step in steps)
    return Experiment(
        name,
        f"Fast impacts, {what}",
        tuple(trials),
        partial(_bullets, name=name, steps=taken, targets=targets, slabs=slabs, ids=ids),
        (
            at_least(f"D9{ids[0]}", f"{what}: share back where v dt <= thickness + r", "1", 1.0, "no tunnel"),
            at_least(f"D9{ids[1]}", f"{what}: share that comes back with every step", "1", 1.0, "a swept test"),
            at_most(f"D9{ids[2]}", f"{what}: error of e = 0.8", "1", 0.02, "definition of e", scale=1.0),
        ),
        "long",
        deaths_count=True,
    )


def graze_scene(name: str, law: Law | None) -> Scene:
    """Two elastic unit spheres that meet at 100 m/s with an impact parameter of 0.99 d."""
    kind = Kind(GRAZE_YOUNG, 2500, 1.0)
    dt = 0.2 / FAST if law else fitted(contact_time(kind, FAST) / 100, 0.2)
    bodies = [Body("grain", (side * 5.013, side * GRAZE, 0), (-side * FAST / 2, 0, 0)) for side in (-1, 1)]
    return scene_of(name, {"grain": kind}, bodies, time_step=dt, times=[0, 0.2], law=law)


def _deflection(result: Result) -> float:
    end = motion(result).velocity[-1]
    away = end[1] - end[0]
    return math.degrees(math.atan2(away[1], -away[0]))


def soft_deflection() -> float:
    """Deflection of the relative motion of the elastic soft pair [degrees], from its equation of motion."""
    kind = Kind(GRAZE_YOUNG, 2500, 1.0)
    k = 4 / 3 * kind.modulus / 2 * math.sqrt(kind.radius / 2) / (kind.mass / 2)

    def rate(_t: float, y: np.ndarray) -> list[float]:
        distance = math.hypot(y[0], y[1])
        pull = k * max(0.0, 2 * kind.radius - distance) ** 1.5 / distance
        return [y[2], y[3], pull * y[0], pull * y[1]]

    start = [2 * math.sqrt(1 - GRAZE**2), 2 * GRAZE, -FAST, 0.0]
    end = solve_ivp(rate, (0, 0.01), start, rtol=1e-9, atol=1e-9, max_step=2e-5).y[:, -1]
    return math.degrees(math.atan2(end[3], -end[2]))


def experiments() -> tuple[Experiment, ...]:
    """D9 and D10."""
    rigid = Rigid()
    sharp = 2 * math.degrees(math.acos(GRAZE))
    return (
        _bullet_experiment("abc", "d9_rigid", RIGID_STEPS, False),
        _bullet_experiment("def", "d9_rigid_slabs", RIGID_STEPS, True),
        _bullet_experiment("ghi", "d9_soft", (None,), False),
        _bullet_experiment("jkl", "d9_soft_slabs", (None,), True),
        on_one_scene(
            "d10_rigid",
            "A grazing impact at 100 m/s, rigid spheres",
            partial(graze_scene, "d10_rigid", rigid),
            lambda result: {"D10a": _deflection(result)},
            (Check("D10a", "rigid, v dt = 0.2 r: deflection in degrees", "1", sharp, 1.0, "2 acos(b/d)"),),
            "long",
            {"dt": repr(0.2 / FAST)},
        ),
        on_one_scene(
            "d10_soft",
            "A grazing impact at 100 m/s, soft spheres",
            partial(graze_scene, "d10_soft", None),
            lambda result: {"D10b": _deflection(result)},
            (
                Check(
                    "D10b", "soft: deflection in degrees", "1", soft_deflection(), 1.0, "Hertz's pair", scene_law=True
                ),
            ),
            "long",
            closed_step(partial(graze_scene, "d10_soft", None)),
        ),
    )

"""Contact stiffness and time step: D1 to D3."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Domain, Scene
from dembench.verification.checks import Check, Experiment, Trial, at_least, at_most
from dembench.verification.scenes import Body, Kind, scene_of
from dembench.verification.stability.common import (
    changed,
    closed_step,
    contact_time,
    kinetic_energy,
    motion,
    rayleigh,
)

RADIUS = 1e-3
RESTITUTIONS = (0.1, 0.5, 0.9)
DECADES = tuple(range(5, 13))
REFERENCE = 8
"""Decade of Young's modulus that the others are compared with."""

SPEEDS = (0.01, 1.0, 100.0)
SHARES = (0.05, 0.2, 0.32, 0.48, 0.8)
"""Steps in contact times."""
PHASES = 10
"""Places within a step where the contacts of a run begin."""
REFUSED_SHARE = 1.0
STEP_SOURCE = "a twentieth of the contact time is the step at which e is right to one per cent"

STRAIN = 1e-3
EDGE = 4
"""Cells of the face-centred block along an edge: 4 x 64 spheres."""
LOADS = (0.9, 0.95, 1.05, 1.1, 1.5)
"""Steps in critical steps of the block."""
BLOCK_STEPS, LONG_STEPS = 5000, 50000
COORDINATION = 12


# ---- D1: Young's modulus


def _name(restitution: float) -> str:
    return f"e{round(100 * restitution)}"


def young_scene(decade: int) -> Scene:
    """Three pairs that meet at 1 m/s, one for each restitution, after a contact time of flight."""
    kinds = {_name(e): Kind(10.0**decade, 2500, RADIUS, restitution=e) for e in RESTITUTIONS}
    one = next(iter(kinds.values()))
    half, dt = RADIUS + 0.5 * contact_time(one, 1.0), 0.1 * rayleigh(one)
    bodies = [
        Body(name, (side * half, 10 * RADIUS * k, 0), (-0.5 * side, 0, 0))
        for k, name in enumerate(kinds)
        for side in (-1, 1)
    ]
    end = math.ceil(8 * contact_time(one, 1.0) / dt) * dt
    return scene_of(f"d1_young_1e{decade}", kinds, bodies, time_step=dt, times=[0, end])


def _young_trial(decade: int) -> Trial:
    scene = partial(young_scene, decade)
    return Trial(f"d1_young_1e{decade}", scene, closed_step(scene))


def _rebound(result: Result, pair: int) -> tuple[float, float]:
    """Restitution and duration [s] of the contact of a pair: free flight before and after tells when it was."""
    seen, r = motion(result), result.scene.radii()
    a, b = 2 * pair, 2 * pair + 1
    gap = seen.position[:, b, 0] - seen.position[:, a, 0] - r[a] - r[b]
    speed = seen.velocity[:, b, 0] - seen.velocity[:, a, 0]
    touch, part = seen.time[0] - gap[0] / speed[0], seen.time[-1] - gap[-1] / speed[-1]
    return -speed[-1] / speed[0], part - touch


def _young(results: Mapping[str, Result]) -> Mapping[str, float]:
    found = np.array([[_rebound(results[f"d1_young_1e{k}"], p) for p in range(len(RESTITUTIONS))] for k in DECADES])
    restitution, time = found[:, :, 0], found[:, 1, 1]
    reference = restitution[DECADES.index(REFERENCE)]
    change = np.abs(restitution / reference - 1).max(axis=0)
    exponent = np.polyfit(DECADES, np.log10(time), 1)[0]
    return {**{f"D1{'abc'[k]}": change[k] for k in range(len(RESTITUTIONS))}, "D1d": exponent}


def _young_checks() -> tuple[Check, ...]:
    source = (
        "Antypov & Elliott 2011: e does not depend on E; a contact has 15 steps of 0.1 Rayleigh times at 1e5 Pa, 30 at "
        "1e8 and 76 at 1e12"
    )
    changes = (
        at_most(f"D1{'abc'[k]}", f"E = 1e5 to 1e12 Pa: largest relative change of e = {e:g}", "1", 0.01, source)
        for k, e in enumerate(RESTITUTIONS)
    )
    exponent = Check(
        "D1d", "E = 1e5 to 1e12 Pa: exponent of the contact time", "1", -0.4, 0.005, "Hertz: E^(-2/5)", scene_law=True
    )
    return (*changes, exponent)


# ---- D2: steps of a collision


def step_scene(speed: float, share: float, name: str) -> Scene:
    """Pairs of restitution 0.5 that meet at a relative speed, each at another place within a step."""
    kinds = {"grain": Kind(1e9, 2500, RADIUS, restitution=0.5)}
    dt = share * contact_time(kinds["grain"], speed)
    bodies = []
    for phase in range(PHASES):
        half = RADIUS + 0.5 * speed * dt * (1 + phase / PHASES)
        bodies += [Body("grain", (side * half, 8 * RADIUS * phase, 0), (-0.5 * side * speed, 0, 0)) for side in (-1, 1)]
    steps = math.ceil(5 / share)
    return scene_of(name, kinds, bodies, time_step=dt, times=[0, steps * dt])


def _step_name(speed: float, share: float) -> str:
    return f"d2_v{speed:g}_dt{share:g}".replace(".", "p")


def _step_trial(speed: float, share: float) -> Trial:
    name = _step_name(speed, share)
    scene = partial(step_scene, speed, share, name)
    return Trial(name, scene, closed_step(scene) | {"allow_unstable": "true"})


def _restitutions(result: Result) -> np.ndarray:
    return np.array([_rebound(result, pair)[0] for pair in range(PHASES)])


def stable_share(found: Mapping[float, np.ndarray | None]) -> float:
    """Largest step [contact times] up to which no pair parted faster than it came; 0 where there is none.

    Args:
        found: Restitutions by step; None where the run died.
    """
    limit = 0.0
    for share in sorted(found):
        restitution = found[share]
        if restitution is None or not (np.abs(restitution) <= 1).all():
            break
        limit = share
    return limit


def _steps(results: Mapping[str, Result]) -> Mapping[str, float]:
    limits, errors = [], []
    for speed in SPEEDS:
        found: dict[float, np.ndarray | None] = {}
        for share in SHARES:
            result = results.get(_step_name(speed, share))
            found[share] = None if result is None else _restitutions(result)
        limits.append(stable_share(found))
        finest = found[SHARES[0]]
        errors.append(math.inf if finest is None else float(np.abs(finest - 0.5).max()))
    return {**{f"D2{'abc'[k]}": limits[k] for k in range(len(SPEEDS))}, "D2d": max(errors)}


def _step_checks() -> tuple[Check, ...]:
    source = "central differences blow up at 0.4 contact times, less 20 %"
    limits = (
        at_least(
            f"D2{'abc'[k]}", f"{v:g} m/s: largest stable step in contact times (tried up to 0.8)", "1", 0.32, source
        )
        for k, v in enumerate(SPEEDS)
    )
    error = at_most("D2d", "step of a twentieth of the contact: error of e = 0.5, worst phase", "1", 0.01, STEP_SOURCE)
    return (*limits, error)


def _guard(results: Mapping[str, Result]) -> Mapping[str, float]:
    """1 where a step beyond the bound was refused or the answer is bounded, else 0."""
    if not results:
        return {"D2e": 1.0}
    return {"D2e": float((np.abs(_restitutions(results["d2_guard"])) <= 1).all())}


# ---- D3: steps of a bed


def _block_kind() -> Kind:
    return Kind(1e8, 2500, RADIUS, restitution=1.0, friction=0.5)


def critical_step() -> float:
    """1.095 sqrt(m/(Z kt)) of the strained block [s]: all spheres spin in phase against their shear springs.

    kt = 8 G* sqrt(R* a), 1/G* = 2 (2 - nu)/G, with the overlap a of the strain. Source: exact dispersion relation of
    the face-centred lattice.
    """
    kind = _block_kind()
    shear = kind.young / (2 * (1 + kind.poisson)) / (2 * (2 - kind.poisson))
    stiffness = 8 * shear * math.sqrt(kind.radius / 2 * 2 * kind.radius * STRAIN)
    return 1.095 * math.sqrt(kind.mass / (COORDINATION * stiffness))


def block_scene(load: float, steps: int, name: str) -> Scene:
    """A periodic face-centred block, strained alike in all directions, with speeds of 1e-6 of that of sound."""
    kind = _block_kind()
    cell = 2 * math.sqrt(2) * RADIUS * (1 - STRAIN)
    corner = np.array([[i, j, k] for i in range(EDGE) for j in range(EDGE) for k in range(EDGE)], dtype=float)
    base = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    position = cell * ((corner[:, None] + base).reshape(-1, 3) + 0.25)
    speed = 1e-6 * math.sqrt(kind.young / kind.density)
    velocity = speed * np.random.default_rng(3).normal(size=position.shape)
    velocity -= velocity.mean(axis=0)
    dt = load * critical_step()
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p, v) for p, v in zip(position, velocity, strict=True)],
        time_step=dt,
        times=[k * steps // 20 * dt for k in range(21)],
    )
    domain = Domain(lower=(0, 0, 0), upper=(EDGE * cell,) * 3, periodic=(True, True, True))
    return changed(scene, domain=domain)


def _block_name(load: float) -> str:
    return f"d3_dt{load:g}".replace(".", "p")


def _block_trial(load: float) -> Trial:
    scene = partial(block_scene, load, LONG_STEPS if load < 0.95 else BLOCK_STEPS, _block_name(load))
    return Trial(_block_name(load), scene, {"dt": repr(load * critical_step()), "allow_unstable": "true"})


def growth(result: Result | None) -> float:
    """Largest kinetic energy in that of the start [-]; infinite where the run died."""
    if result is None:
        return math.inf
    energy = kinetic_energy(result)
    return float(energy.max() / energy[0]) if np.isfinite(energy).all() else math.inf


def _block(results: Mapping[str, Result]) -> Mapping[str, float]:
    found = {load: growth(results.get(_block_name(load))) for load in LOADS}
    limit = 0.0
    for load in LOADS:
        if found[load] > 1.01:
            break
        limit = load
    return {"D3a": found[LOADS[0]], "D3b": limit}


def experiments() -> tuple[Experiment, ...]:
    """D1 to D3."""
    guard = partial(step_scene, 1.0, REFUSED_SHARE, "d2_guard")
    return (
        Experiment(
            "d1_young",
            "Young's modulus over seven decades",
            tuple(_young_trial(k) for k in DECADES),
            _young,
            _young_checks(),
            "long",
        ),
        Experiment(
            "d2_steps",
            "Steps of a collision up to blow-up",
            tuple(_step_trial(speed, share) for speed in SPEEDS for share in SHARES),
            _steps,
            _step_checks(),
            "long",
            deaths_count=True,
        ),
        Experiment(
            "d2_guard",
            "A step of a whole contact time",
            (Trial("d2_guard", guard, closed_step(guard)),),
            _guard,
            (
                at_least(
                    "D2e",
                    "step of a contact time: refused, or no pair parts faster than it came (1 = so)",
                    "1",
                    1.0,
                    "no silent blow-up",
                ),
            ),
            "long",
            deaths_count=True,
        ),
        Experiment(
            "d3_bed",
            "Steps of a strained block of 256 spheres (periodic, strain 1e-3, 5e4 steps instead of 1e5)",
            tuple(_block_trial(load) for load in LOADS),
            _block,
            (
                at_most("D3a", "step of 0.9 critical: growth of the kinetic energy", "1", 1.01, "linear stability"),
                at_least(
                    "D3b",
                    "largest stable step in critical ones (tried up to 1.5)",
                    "1",
                    0.95,
                    "1.095 sqrt(m/(Z kt)), within 5 %; Otsubo, O'Sullivan & Shire 2017",
                ),
            ),
            "long",
            deaths_count=True,
        ),
    )

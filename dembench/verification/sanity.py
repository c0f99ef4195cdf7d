"""The sanity suite: the sixteen checks of the peclet.dem sanity-check page, against closed forms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.verification import sanity_scenes as scenes
from dembench.verification.checks import Check, Published, Suite, on_one_scene
from dembench.verification.sanity_scenes import (
    BED,
    BOUNCE,
    COLUMN,
    DROP,
    GRAVITY,
    HEAD_ON,
    LAST,
    MOTION,
    RADIUS,
    SLIDE,
    SPEED,
    SPIN_FRICTION,
    SPIN_RESTITUTION,
)

ROLLING_TIME = 1.0
"""Time at which the sliding sphere has long been rolling: 2 v/(7 mu g) = 0.17 s [s]."""
COULOMB = SPIN_FRICTION * (1 + SPIN_RESTITUTION) * SPEED
"""Bound of the tangential impulse per mass, mu (1 + e) v_rel m*/m with v_rel = 2 v and m* = m/2 [m/s]."""
STICKING = (2 / 7) * scenes.SPIN * RADIUS
"""Tangential velocity that would stop the slip of 2 w r: (2/7) w r, with 1/m_t = 7/(2 m) of a sphere [m/s]."""

PAGE_DEFLECTION = 2.974
"""Lateral velocity that the published page measured [m/s]."""

SPIN_NOTE = (
    f"The page's number is not reached because it is not physics: the tangential impulse cannot exceed Coulomb's bound "
    f"μ (1 + e) v = {COULOMB:.2f} m/s per unit mass, nor what stops the slip, 2/7 ω r = {STICKING:.3f} m/s; the page "
    "expects more than both. The pair slides through the whole contact, so the bound is the answer."
)


# ---- what is measured


def _collisions(result: Result) -> Mapping[str, float]:
    end = motion(result).velocity[-1]
    found = {f"SP1{'abcde'[k]}": (end[2 * k + 1, 0] - end[2 * k, 0]) / (2 * SPEED) for k in range(len(HEAD_ON))}
    equal, opposite = 2 * len(HEAD_ON), 2 * len(HEAD_ON) + 2
    return {
        **found,
        "SP5a": end[equal, 1] + end[equal + 1, 1],
        "SP5b": abs(end[equal, 1]),
        "SP5c": np.abs(end[opposite : opposite + 2, 1]).max(),
    }


def _floor(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    column = seen.position[-1, 2 : 2 + COLUMN, 2]
    return {
        "SP2a": bounce(seen),
        "SP3": seen.velocity[np.searchsorted(seen.time, ROLLING_TIME), 1, 0] / SLIDE,
        "SP4a": peak_speed(seen, slice(2, 2 + COLUMN)),
        "SP4b": float(np.diff(column).mean()),
    }


def _sdf_floor(result: Result) -> Mapping[str, float]:
    return {"SP2b": bounce(motion(result))}


def _bed(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    return {
        "SP6a": peak_speed(seen, slice(None)),
        "SP6b": float(np.diff(layers(seen)[-1], axis=0).min()),
        "SP6c": float(layers(seen)[0, -1].mean() - layers(seen)[-1, -1].mean()),
    }


def motion(result: Result) -> SnapshotSeries:
    """All bodies at the recorded times."""
    return result.snapshots[MOTION]


def bounce(seen: SnapshotSeries) -> float:
    """Height of the first bounce of body 0 over the height of its fall [-].

    The apex follows from height and velocity of the sample nearest to it, z + v^2/(2 g), since it lies between samples.
    """
    z, v = seen.position[:, 0, 2], seen.velocity[:, 0, 2]
    rising = int(np.argmax(v > 0))
    apex = rising + int(np.argmax(v[rising:] <= 0))
    return float((z[apex] + v[apex] ** 2 / (2 * GRAVITY) - (z[0] - DROP)) / DROP)


def peak_speed(seen: SnapshotSeries, bodies: slice) -> float:
    """Largest speed of some bodies in the last half second [m/s]."""
    last = seen.time >= seen.time[-1] - LAST * (1 + 1e-9)
    return float(np.linalg.norm(seen.velocity[last][:, bodies], axis=2).max())


def layers(seen: SnapshotSeries) -> np.ndarray:
    """Heights of the bed's spheres by layer [m], shape (t, layers, spheres of a layer)."""
    nx, ny, count = BED
    return seen.position[:, :, 2].reshape(len(seen.time), count, nx * ny)


# ---- what is known


def suite() -> Suite:
    """The suite."""
    return Suite(
        name="sanity",
        title="Sanity checks: unit spheres against closed forms",
        text="Rigid unit spheres with r = 1 m, m = 1 kg, g = 9.8 m/s² and steps of 2 ms meet, fall, slide, spin and "
        "stand. Every number has a closed form; the tolerances are ours, and the published page's stand beside them.",
        source="peclet.dem, sanity-check page (problems, their published values and tolerances)",
        experiments=(
            on_one_scene("sanity_collisions", "Pairs that meet", scenes.collisions, _collisions, _collision_checks()),
            on_one_scene("sanity_floor", "On a plane", scenes.floor, _floor, _floor_checks()),
            on_one_scene(
                "sanity_sdf_floor", "On a signed distance", scenes.sdf_floor, _sdf_floor, (_bounce_check("b"),)
            ),
            on_one_scene("sanity_bed", "A bed of 40 layers", scenes.bed, _bed, _bed_checks()),
        ),
        settings={"dt": f"{scenes.DT:g}", "velocity_sweeps": "30"},
    )


def _collision_checks() -> tuple[Check, ...]:
    return (
        *(_head_on(f"SP1{'abcde'[k]}", e) for k, e in enumerate(HEAD_ON)),
        Check(
            "SP5a",
            "equal spins: sum of both lateral velocities",
            "m/s",
            0.0,
            1e-4,
            "momentum",
            Published(0.0, 0.0, 0.05),
        ),
        Check(
            "SP5b",
            "equal spins: lateral speed of a sphere",
            "m/s",
            COULOMB,
            0.01 * COULOMB,
            "sliding contact: μ (1 + e) v",
            Published(PAGE_DEFLECTION, 2.98, 1.0, SPIN_NOTE),
        ),
        Check("SP5c", "opposite spins: lateral speed", "m/s", 0.0, 1e-4, "no slip", Published(0.0, 0.0, 0.05)),
    )


def _head_on(id: str, e: float) -> Check:
    return Check(id, f"head-on, e = {e:g}: restitution", "1", e, 1e-4, "definition of e", Published(e, e, 0.02))


def _bounce_check(letter: str) -> Check:
    where = {"a": "plane", "b": "signed distance"}[letter]
    exact = BOUNCE**2
    published = Published(0.4918, 0.49, 0.03)
    return Check(f"SP2{letter}", f"first bounce over fall, {where}", "1", exact, 0.005 * exact, "e²", published)


def _floor_checks() -> tuple[Check, ...]:
    return (
        _bounce_check("a"),
        Check("SP3", "sliding to rolling: v/v0", "1", 5 / 7, 1e-4, "5/7", Published(0.7143, 5 / 7, 0.03)),
        Check(
            "SP4a",
            "column of 6: peak speed in the last half second",
            "m/s",
            0.0,
            2e-3,
            "rest",
            Published(0.0006, 0.0, 0.15),
        ),
        Check("SP4b", "column of 6: mean spacing", "m", 2 * RADIUS, 1e-3, "2 r", Published(2.0, 2.0, 0.1)),
    )


def _bed_checks() -> tuple[Check, ...]:
    return (
        Check(
            "SP6a",
            "bed of 40 layers: peak speed in the last half second",
            "m/s",
            0.0,
            0.02,
            "rest; 0.02 m/s is g dt",
            Published(0.0785, 0.0, 0.15),
        ),
        Check("SP6b", "bed: smallest spacing of layers", "m", 2 * RADIUS, 1e-3, "2 r", Published(1.9998, 2.0, 0.1)),
        Check("SP6c", "bed: settling of the top layer", "m", 0.0, 2e-3, "rest", Published(-0.0017, 0.0, 0.3)),
    )

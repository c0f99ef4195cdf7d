"""Small scenes that lack what most solvers compute all the same: each runs for seconds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dembench.scene import Box, Domain, HertzMindlin, Scene, Snapshot, scene_from_arrays

RADIUS, DENSITY, YOUNG = 1e-3, 2500.0, 1e7
"""Of all grains [m], [kg/m^3], [Pa]; of soft grains, so that steps are few."""
GRAVITY = (0.0, 0.0, -9.81)
TIMES = 5
"""Number of states that are compared, the initial one among them."""


def gas() -> Scene:
    """Smooth spheres of one size that collide in a periodic box: no friction, walls or gravity."""
    cells, pitch = 10, 3.0 * RADIUS
    position = _lattice((cells,) * 3, pitch, 0.2)
    velocity = np.random.default_rng(2).normal(0, 0.3, position.shape)
    domain = Domain(lower=(0, 0, 0), upper=(cells * pitch,) * 3, periodic=(True, True, True))
    return _scene("ablation_gas", position, 0.06, velocity=velocity, restitution=0.9, gravity=(0, 0, 0), domain=domain)


def bed() -> Scene:
    """Rough spheres of one size that fall into a box: everything that most beds need, and no more."""
    counts, pitch = (8, 8, 12), 2.2 * RADIUS
    side, height = counts[0] * pitch, 1.5 * counts[2] * pitch
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(side, side, height))
    domain = Domain(lower=(-side, -side, -side), upper=(2 * side, 2 * side, 2 * height))
    position = _lattice(counts, pitch, 0.05)
    return _scene(
        "ablation_bed", position, 0.06, restitution=0.5, friction=0.4, gravity=GRAVITY, walls=[box], domain=domain
    )


def smooth_bed() -> Scene:
    """The same bed without friction: neither history nor rotation."""
    rough = bed()
    laws = tuple(law.model_copy(update={"friction": 0.0}) for law in rough.pair_laws)
    return rough.model_copy(update={"name": "ablation_smooth_bed", "pair_laws": laws})


SCENES: dict[str, Callable[[], Scene]] = {"gas": gas, "bed": bed, "smooth-bed": smooth_bed}
"""By name."""


def _lattice(counts: tuple[int, int, int], pitch: float, jitter: float) -> np.ndarray:
    """Centres in a box from the origin [m], each off its place by up to `jitter` radii per axis."""
    place = (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3) + 0.5) * pitch
    shift = np.random.default_rng(1).uniform(-1, 1, place.shape) * jitter * RADIUS
    found: np.ndarray = place + shift
    return found


def _scene(name: str, position: np.ndarray, duration: float, **fields: object) -> Scene:
    times = tuple(float(t) for t in np.linspace(0, duration, TIMES))
    return scene_from_arrays(
        position,
        RADIUS,
        density=DENSITY,
        young=YOUNG,
        law=HertzMindlin(),
        duration=duration,
        observables=[Snapshot(name="state", times=times)],
        name=name,
        **fields,  # type: ignore[arg-type]
    )

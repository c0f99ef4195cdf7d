"""Beds that pour themselves: solid fraction of random packings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Domain, Plane, Scene, Snapshot
from dembench.verification.checks import Check, Experiment, Trial
from dembench.verification.statistical.grains import RADIUS, SPACING, of_grains

WIDTH, LAYERS, POURING = 10, 18, 0.6
"""Grains along an edge of the poured bed, their layers, and the time in which it comes to rest [s]."""
SEEDS = range(3)
FLOOR, TOP = 4.0, 4.0
"""Distance of the bulk from the floor and from the highest grains, in diameters."""
FRICTIONS = {"smooth": (0.0, 0.636, 0.015), "rough": (0.5, 0.59, 0.02)}
"""Friction, expected solid fraction and half-width of its band, by kind of bed."""


def poured(kind: str, seed: int) -> Scene:
    """Grains that fall from a loose lattice onto a floor between periodic sides."""
    generator = np.random.default_rng(seed)
    pitch = SPACING * RADIUS
    places = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(WIDTH), np.arange(LAYERS)), axis=-1).reshape(-1, 3) + 0.5
    position = places * pitch + generator.uniform(-0.1, 0.1, places.shape) * RADIUS
    velocity = generator.normal(0, 0.1, places.shape)
    size = WIDTH * pitch
    floor = Plane(name="floor", material="solid", point=(0, 0, 0), normal=(0, 0, 1))
    domain = Domain(lower=(0, 0, -2 * RADIUS), upper=(size, size, 2 * LAYERS * pitch), periodic=(True, True, False))
    end = (Snapshot(name="end", times=(POURING,)),)
    return of_grains(f"poured_{kind}", FRICTIONS[kind][0], position, (floor,), domain, POURING, end, velocity=velocity)


def solid_fraction(height: np.ndarray, radius: float, area: float, low: float, high: float) -> float:
    """Share of a layer between two heights that spheres fill [-].

    Args:
        height: Heights of their centres [m], shape (n,).
        radius: [m].
        area: Area of the layer [m^2].
        low, high: Its heights [m].
    """

    def below(level: float) -> np.ndarray:
        """Volume of each sphere below a level, pi d^2 (r - d/3) of a cap of height d [m^3]."""
        cap = np.clip(level - height + radius, 0, 2 * radius)
        return np.asarray(math.pi * cap**2 * (radius - cap / 3))

    return float((below(high) - below(low)).sum() / (area * (high - low)))


def _fractions(results: Mapping[str, Result], kind: str) -> float:
    found = []
    for name, result in results.items():
        if name.startswith(kind):
            height = result.snapshots["end"].position[-1, :, 2]
            size = result.scene.domain.upper[0]
            high = float(np.quantile(height, 0.99)) - TOP * 2 * RADIUS
            found.append(solid_fraction(height, RADIUS, size**2, FLOOR * 2 * RADIUS, high))
    return float(np.mean(found))


def packings() -> Experiment:
    """Solid fractions of poured beds without and with friction."""
    trials = [Trial(f"{kind}_{seed}", partial(poured, kind, seed)) for kind in FRICTIONS for seed in SEEDS]
    text = "poured between periodic sides onto a plane, from 4 diameters above it to 4 below the top"
    checks = [
        Check(
            f"GP3{letter}",
            f"random packing, friction {friction:g}: solid fraction ({text})",
            "1",
            expected,
            band,
            "random close packing (G. D. Scott & D. M. Kilgour 1969)" if not friction else "band of poured spheres",
            kind="publication",
        )
        for letter, (friction, expected, band) in zip("ab", FRICTIONS.values(), strict=True)
    ]
    return Experiment(
        "packings",
        "Poured beds",
        tuple(trials),
        lambda results: {
            f"GP3{letter}": _fractions(results, kind) for letter, kind in zip("ab", FRICTIONS, strict=True)
        },
        tuple(checks),
        tier="statistical",
    )

"""Discharge through an orifice: Beverloo's law in flat-bottomed silos with three orifices."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Count, Cylinder, Domain, Mesh, Region, Scene, Sink, Snapshot
from dembench.verification.checks import Check, Experiment, Trial
from dembench.verification.statistical.beds import solid_fraction
from dembench.verification.statistical.grains import (
    DENSITY,
    DIAMETER,
    GRAVITY,
    MASS,
    RADIUS,
    SPACING,
    column,
    of_grains,
)

ORIFICES, LAYERS = (6, 8, 10), 6
"""Diameters of the orifices in diameters of grains, and layers that are poured in for each of these: at the end of a
run the bed is still twice as high as the orifice is wide."""
WIDTH, FRICTION = 2.5, 0.2
"""Diameter of the silo in diameters of the orifice, and friction of everything [-]: that of glass beads, 0.1 to 0.2,
whose constants the law has. Rougher grains flow more slowly: C of an orifice six grains wide was 0.60 with 0.2, 0.55
with 0.3 and 0.51 with 0.5."""
DURATION, FALLEN, INTERVAL = 0.6, 0.2, 5e-3
"""End of a run, time by which the grains have come down and flow steadily, and time between two counts [s]."""
EMPTY = 1.4
"""Width of the rim of an orifice that no grain passes, k of Beverloo's law, in diameters of grains."""
LOW, HIGH = 0.75, 1.75
"""Between these heights the bulk density is measured, in diameters of the orifice."""
SIDES, BELOW, FALL = 48, 0.02, 0.1
"""Sides of the polygon that is the orifice; depths below the floor of the sink and of the domain [m]."""
SEEDS = range(3)


def scene(width: int, seed: int) -> Scene:
    """Grains that fall from a loose lattice into a silo whose orifice, that many grains wide, is open."""
    hole = width * RADIUS
    radius = WIDTH * hole
    layers = LAYERS * width
    top = (layers + 2) * SPACING * RADIUS
    reach = radius + 4 * RADIUS
    walls = (
        Mesh(name="floor", material="solid", triangles=ring(hole, radius + 2 * RADIUS)),
        Cylinder(name="barrel", material="solid", start=(0, 0, -FALL), end=(0, 0, top), radius=radius),
    )
    return of_grains(
        "beverloo",
        FRICTION,
        column(radius, layers, np.random.default_rng(seed)),
        walls,
        Domain(lower=(-reach, -reach, -FALL), upper=(reach, reach, top)),
        DURATION,
        (
            Count(name="inside", interval=INTERVAL, region=Region(lower=(None, None, 0.0))),
            Snapshot(name="flow", times=(FALLEN, 0.5 * (FALLEN + DURATION), DURATION)),
        ),
        soft=True,
        sinks=(Sink(name="below", region=Region(upper=(None, None, -BELOW))),),
    )


def ring(inner: float, outer: float) -> np.ndarray:
    """Triangles of the plane z = 0 between a regular polygon with the area of a circle and one about another.

    Args:
        inner: Radius of the circle within [m].
        outer: Radius of the circle that the outer edge clears [m].

    Returns:
        Vertices [m], shape (n, 3, 3), with normals up.
    """
    turn = 2 * math.pi / SIDES
    angle = turn * np.arange(SIDES)
    around = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)])
    within = inner * math.sqrt(turn / math.sin(turn)) * around
    beyond = outer / math.cos(0.5 * turn) * around
    after, further = np.roll(within, -1, axis=0), np.roll(beyond, -1, axis=0)
    return np.concatenate([np.stack(t, axis=1) for t in ((within, beyond, further), (within, further, after))])


def constant(rate: float, density: float, width: float) -> float:
    """C of W = C rho_b sqrt(g) (D - k d)^(5/2) (W. A. Beverloo et al. 1961, Chem. Eng. Sci. 15, 260).

    Args:
        rate: W [kg/s].
        density: Bulk density rho_b [kg/m^3].
        width: Diameter of the orifice D [m].
    """
    return rate / (density * math.sqrt(GRAVITY) * (width - EMPTY * DIAMETER) ** 2.5)


def exponent(rates: np.ndarray, widths: np.ndarray) -> float:
    """Slope of the logarithm of the rates over that of D - k d, 5/2 in Beverloo's law.

    Args:
        rates: Rates over the bulk density, in any unit.
        widths: Diameters of the orifices D [m].
    """
    return float(np.polyfit(np.log(np.subtract(widths, EMPTY * DIAMETER)), np.log(rates), 1)[0])


def head_exponent(records: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Exponent of the rate over the number of grains above: 0 in Beverloo's law, 1/2 where a liquid flows out.

    From the rates of the two halves of every record and the mean numbers in them. A record counts as much as grains
    flowed out in it, since the scatter of a rate goes with the inverse root of their number.

    Args:
        records: Times [s] and numbers of grains in the silo, shape (t,) each, t odd.
    """
    found = []
    for time, inside in records:
        middle = len(time) // 2
        halves = [slice(0, middle + 1), slice(middle, None)]
        rates = [-np.polyfit(time[half], inside[half], 1)[0] for half in halves]
        heads = [inside[half].mean() for half in halves]
        found.append((inside[0] - inside[-1], np.log(rates[1] / rates[0]), np.log(heads[1] / heads[0])))
    passed, rising, falling = np.transpose(found)
    return float(passed @ rising / (passed @ falling))


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    widths = np.array([width * DIAMETER for width in ORIFICES])
    rates, densities, records = [], [], []
    for width in ORIFICES:
        own = [results[_name(width, seed)] for seed in SEEDS]
        steady = [_steady(result) for result in own]
        rates.append(MASS * float(np.mean([-np.polyfit(time, inside, 1)[0] for time, inside in steady])))
        densities.append(float(np.mean([_bulk_density(result, width) for result in own])))
        records += steady
    constants = [constant(*numbers) for numbers in zip(rates, densities, widths, strict=True)]
    volumes = np.divide(rates, densities)
    return {"BK2a": float(np.mean(constants)), "BK2b": exponent(volumes, widths), "BK2c": head_exponent(records)}


def _steady(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and numbers of grains in the silo while they flow steadily."""
    seen = result.observables["inside"]
    later = seen.time >= FALLEN - 0.5 * INTERVAL
    return seen.time[later], seen.value[later]


def _bulk_density(result: Result, width: int) -> float:
    """Bulk density above the orifice, mean over the snapshots [kg/m^3]."""
    hole = width * DIAMETER
    area = math.pi * (0.5 * WIDTH * hole) ** 2
    found = []
    for position in result.snapshots["flow"].position:
        height = position[np.isfinite(position[:, 2]), 2]
        found.append(solid_fraction(height, RADIUS, area, LOW * hole, HIGH * hole))
    return DENSITY * float(np.mean(found))


def _name(width: int, seed: int) -> str:
    return f"beverloo_{width}_{seed}"


def experiment() -> Experiment:
    """Beverloo's law for three orifices."""
    trials = [Trial(_name(width, seed), partial(scene, width, seed)) for width in ORIFICES for seed in SEEDS]
    source = "Beverloo et al. 1961: W = C ρ_b √g (D − k d)^5/2"
    return Experiment(
        "beverloo",
        "Discharge through an orifice",
        tuple(trials),
        _measure,
        (
            Check(
                "BK2a",
                "Beverloo: C with k = 1.4, mean of orifices 6, 8 and 10 grains wide",
                "1",
                0.6,
                0.05,
                f"{source}; C of 0.55 to 0.65 (C. Mankoc et al. 2007)",
                kind="publication",
            ),
            Check(
                "BK2b",
                "Beverloo: exponent of the rate over D − 1.4 d",
                "1",
                2.5,
                0.1,
                f"{source}; the tolerance is what k between 1.15 and 1.65 makes of it",
                kind="publication",
            ),
            Check(
                "BK2c",
                "Beverloo: exponent of the rate over the head",
                "1",
                0.0,
                0.2,
                f"{source}, without the head; 1/2 in a liquid (Torricelli)",
                kind="publication",
                scale=1.0,
            ),
        ),
        tier="statistical",
    )

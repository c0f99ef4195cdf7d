"""Two kinds of grains and walls of two materials: every pair of materials has its own restitution and friction."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Plane, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, on_one_scene
from dembench.verification.scenes import MOTION

GRAINS, PLATES = ("cork", "oak"), ("felt", "slate")
RADIUS = {"cork": 1e-3, "oak": 1.5e-3}
RESTITUTION = {
    ("cork", "cork"): 0.95,
    ("cork", "oak"): 0.85,
    ("oak", "oak"): 0.75,
    ("cork", "felt"): 0.3,
    ("cork", "slate"): 0.65,
    ("oak", "felt"): 0.4,
    ("oak", "slate"): 0.55,
}
"""A different one for each pair, so that no two can be taken for each other."""
SPEED, APART, STEP, END = 1.0, 0.02, 1e-6, 1e-3
"""Speed of approach [m/s], distance of neighbouring collisions [m], time step and duration [s]."""
GAP = 2e-4
"""Gap at the start [m]."""


def _collisions() -> list[tuple[str, str]]:
    """The pairs of materials, those of two grains first."""
    between = list(itertools.combinations_with_replacement(GRAINS, 2))
    return between + [pair for pair in RESTITUTION if pair[1] in PLATES]


def scene() -> Scene:
    """Every pair collides once, far from the others: a plate of felt below, one of slate above."""
    position: list[tuple[float, float, float]] = []
    velocity: list[tuple[float, float, float]] = []
    species: list[int] = []
    for k, (a, b) in enumerate(_collisions()):
        y = k * APART
        if b in PLATES:
            side = 1 if b == "felt" else -1
            position.append((0, y, side * (RADIUS[a] + GAP - APART)))
            velocity.append((0, 0, -side * SPEED))
            species.append(GRAINS.index(a))
        else:
            away = (RADIUS[a] + RADIUS[b] + GAP) / 2
            position += [(-away, y, 0), (away, y, 0)]
            velocity += [(SPEED / 2, 0, 0), (-SPEED / 2, 0, 0)]
            species += [GRAINS.index(a), GRAINS.index(b)]
    room = 2 * APART
    return Scene(
        name="pair_table",
        materials=tuple(Material(name=name, density=2500, young=1e8, poisson=0.25) for name in (*GRAINS, *PLATES)),
        pair_laws=tuple(PairLaw(a=a, b=b, restitution=e, friction=0.3) for (a, b), e in RESTITUTION.items()),
        species=tuple(Species(name=name, material=name, radius=RADIUS[name]) for name in GRAINS),
        walls=(
            Plane(name="floor", material="felt", point=(0, 0, -APART), normal=(0, 0, 1)),
            Plane(name="ceiling", material="slate", point=(0, 0, APART), normal=(0, 0, -1)),
        ),
        bodies=Bodies(position=position, velocity=velocity, species=species),
        domain=Domain(lower=(-room, -room, -room), upper=(room, len(RESTITUTION) * APART + room, room)),
        gravity=(0, 0, 0),
        duration=END,
        time_step=STEP,
        observables=(Snapshot(name=MOTION, times=(0.0, END)),),
    )


def _measure(result: Result) -> Mapping[str, float]:
    v = result.snapshots[MOTION].velocity[-1]
    found, at = {}, 0
    for letter, (_a, b) in zip("abcdefg", _collisions(), strict=True):
        if b in PLATES:
            found[f"PT1{letter}"] = float((1 if b == "felt" else -1) * v[at, 2] / SPEED)
            at += 1
        else:
            found[f"PT1{letter}"] = float((v[at + 1, 0] - v[at, 0]) / SPEED)
            at += 2
    return found


def experiment() -> Experiment:
    """The restitution of every pair of materials."""
    checks = tuple(
        Check(f"PT1{letter}", f"{a} on {b}: restitution", "1", RESTITUTION[a, b], 0.02, "pair law")
        for letter, (a, b) in zip("abcdefg", _collisions(), strict=True)
    )
    return on_one_scene("pair_table", "Every pair of materials", scene, _measure, checks)

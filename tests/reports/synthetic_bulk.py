"""Made-up results of a silo and of a drum: kinematic flows that look like the real ones and cost nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import add_run

from dembench.cases import drum, silo
from dembench.cases.registry import parse_case
from dembench.results import Observed, SnapshotSeries, channels
from dembench.runs.directory import RunDirectory
from dembench.scene import Scene

Record = tuple[dict[str, Observed], dict[str, SnapshotSeries]]


def lattice(count: int, pitch: float, inside: Any, low: float) -> np.ndarray:
    """The lowest `count` sites of a cubic lattice with `inside(x, y, z)`, from the height `low` [m] upwards: (n, 3)."""
    k = np.arange(-60, 61) * pitch
    z = np.arange(low, low + 0.45, pitch)
    sites = np.stack(np.meshgrid(k[np.abs(k) < 0.1], k[np.abs(k) < 0.1], z, indexing="ij"), axis=-1).reshape(-1, 3)
    sites = sites[inside(*sites.T)]
    return sites[np.argsort(sites[:, 2], kind="stable")][:count]


def _series(scene: Scene, values: dict[str, Any], until: float = 1.0) -> dict[str, Observed]:
    """Every series of a scene from functions of time; zeros where there is none."""
    found = {}
    for name, channel in channels(scene).items():
        time = channel.time[: max(2, round(len(channel.time) * until))]
        value = values[name](time) if name in values else np.zeros(channel.shape(len(time)))
        step = np.round(time / 1e-5).astype(np.int64)
        found[name] = Observed(step, time, value, channel.unit, channel.components, channel.title)
    return found


# ---- the silo


def silo_scene(text: str = "case1", grains: int = 2000) -> Scene:
    """The quick silo with fewer grains, above the lip."""
    case, parameters = parse_case(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(silo, "bed", lambda name, plan, progress, seed=0: _silo_fill(plan, grains))
        return case.scene(parameters, "quick")


def _silo_fill(plan: Any, grains: int) -> np.ndarray:
    radius = plan.species[0].radius
    lip = next(w for w in plan.walls if w.name == "outlet").point[2]
    opening = next(w for w in plan.walls if w.name == "cone").radius_start

    def inside(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.hypot(x, y) < np.minimum(0.1 - 1.1 * radius, opening + z - lip - 1.6 * radius)

    return lattice(grains, 2.05 * radius, inside, lip + 1.1 * radius)


def silo_record(scene: Scene, rate: float = 5e3, seed: int = 0, until: float = 1.0) -> Record:
    """A silo that loses `rate` grains per second [1/s], fastest in the middle."""
    random = np.random.default_rng(seed)
    total, lip = len(scene.bodies), scene.observables[0].region.lower[2]
    weight = 9.81 * float(scene.masses().sum())

    def count(time: np.ndarray) -> np.ndarray:
        return np.clip(total - rate * np.clip(time - 0.05, 0, None), 0, total).round()

    def force(share: float) -> Any:
        return lambda time: np.column_stack([0 * time, 0 * time, -share * weight * (1 - 0.3 * time / scene.duration)])

    found = _series(scene, {"inside": count, "barrel_force": force(0.35), "cone_force": force(0.45)}, until)
    position = scene.bodies.position.copy()
    gone = int(total - count(np.array([scene.duration / 2]))[0])
    x, y, z = position.T
    away, height = np.hypot(x, y), np.clip(z - lip, 0, None)
    speed = 0.25 * np.exp(-((away / (0.02 + 0.4 * height)) ** 2)) * np.exp(-height / 0.15) + 0.012
    velocity = np.column_stack([-0.3 * speed * x / 0.1, -0.3 * speed * y / 0.1, -speed])
    velocity += random.normal(0, 0.1, velocity.shape) * speed[:, None]
    for array in (position, velocity):
        array[:gone] = np.nan  # the lowest have left
    shots = SnapshotSeries(
        np.array([1]), np.array([scene.duration / 2]), *(a[None] for a in (position, velocity, velocity))
    )
    return found, {"flow": shots} if until > 0.5 else {}


# ---- the drum


def drum_scene(text: str = "case2", preset: str = "quick") -> Scene:
    """The drum with all its grains on lattices, M2 below M1."""
    case, parameters = parse_case(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drum, "bed", lambda name, plan, progress, seed=0: _drum_fill(plan))
        return case.scene(parameters, preset)  # type: ignore[arg-type]


def _drum_fill(plan: Any) -> np.ndarray:
    found, low = [], -0.1
    radii = {s.name: s.radius for s in plan.species}
    for layer in plan.layers:
        radius = radii[layer.species]

        def inside(x: np.ndarray, y: np.ndarray, z: np.ndarray, radius: float = radius) -> np.ndarray:
            return (np.hypot(x, z) < 0.1 - 1.05 * radius) & (np.abs(y) < 0.03 - 1.02 * radius)

        found.append(lattice(layer.count, 2.02 * radius, inside, low + radius))
        low = float(found[-1][:, 2].max()) + radius
    return np.vstack(found)


def drum_record(scene: Scene, lag: float = 0.0, seed: int = 0, until: float = 1.0) -> Record:
    """A drum whose counts swing with a period of 1.85 s, `lag` [s] late, and whose bed turns and mixes."""
    names = [s.name for s in scene.species]
    total = {name: int((scene.bodies.species == k).sum()) for k, name in enumerate(names)}

    def zones(time: np.ndarray) -> np.ndarray:
        phase = 2 * np.pi * (time - lag - 0.64) / 1.85
        swing = np.exp(-time / 4) * np.cos(phase)
        share = {"zone1": 0.15 * (1 - np.exp(-time / 0.3)), "zone2": 0.42 * (1 - np.exp(-(time + 0.5) / 0.4))}
        sign = {"M1": 1, "M2": -0.6}
        columns = [
            total[s] * np.clip(share[zone] * (1 + sign[s] * (0.9 if zone == "zone2" else -0.5) * swing), 0, 1)
            for zone in ("zone1", "zone2")
            for s in names
        ]
        return np.column_stack(columns).round()

    def centres(time: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * (time - lag) / 1.85
        columns = []
        for name, height, size in (("M2", -0.055, 0.02), ("M1", -0.03, 0.03)):
            shrink = size * np.exp(-time / 3)
            columns += [0.02 - shrink * np.cos(angle), 0 * time, height + shrink * np.sin(angle)]
            assert name in names
        return np.column_stack(columns)

    found = _series(scene, {"zones": zones, "centres": centres}, until)
    wanted = next(o for o in scene.observables if o.name == "mixing").times
    times = np.array(wanted[: max(1, round(len(wanted) * until))])
    random = np.random.default_rng(seed)
    shots = [_turned(scene, t, random) for t in times]
    fields = (np.array([s[k] for s in shots]) for k in range(3))
    return found, {"mixing": SnapshotSeries(np.round(times / 1e-5).astype(np.int64), times, *fields)}


def _turned(scene: Scene, time: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The bed turned by up to 25 degrees, with the more places exchanged between species the later it is."""
    angle = np.radians(25) * (1 - np.exp(-time / 0.4))
    position = scene.bodies.position.copy()
    x, z = position[:, 0].copy(), position[:, 2].copy()
    position[:, 0], position[:, 2] = np.cos(angle) * x - np.sin(angle) * z, np.sin(angle) * x + np.cos(angle) * z
    swapped = np.flatnonzero(random.random(len(position)) < 0.8 * (1 - np.exp(-time / 1.5)))
    position[swapped] = position[random.permutation(swapped)]
    spin = np.array([0, -2.0, 0])
    velocity = 0.95 * np.cross(spin, position)
    return position, velocity, np.tile(spin, (len(position), 1)).astype(float)


def add_bulk_run(out: Path, scene: Scene, engine: str, record: Record, case: str, **more: Any) -> RunDirectory:
    """Writes the directory of a run of the quick preset, with its snapshots."""
    observables, snapshots = record
    given = {"preset": "quick", "loop": 100.0, "observables": observables, "snapshots": snapshots, **more}
    return add_run(out, scene, engine, case=case, **given)

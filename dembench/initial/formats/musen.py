"""Text scenes and text exports of MUSEN: one line per object, values introduced by numeric tags.

A line of tag 0 is an object with all its frames, each opened by tag 2 with its time; a line of tag 32 is a material
with its density. Spheres are objects of type 1; walls and bonds are left out. Only densities of materials are written:
laws of materials and pairs are no part of a state.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.state import State, StateError, state_of
from dembench.initial.rows import CoordinatesError, text_lines

OBJECT, TYPE, GEOMETRY, MATERIAL, ACTIVITY, TIME, MATERIAL_LINE = "0", "1", "5", "23", "24", "2", "32"
SPHERE, DENSITY = "1", "0"
FOREVER = 1e300
LENGTHS = {"12": 3, "15": 3, "16": 3, "18": 1, "20": 3, "31": 4, "36": 9, "37": 1, "42": 3}
"""Number of values behind each tag of a frame: coordinate, velocity, angular velocity, force and others."""
KEPT = {"12": "position", "15": "velocity", "16": "angular_velocity"}
MARGIN = 5.0
"""Room between the outermost spheres and the domain, in largest radii [-]: what leaves the domain is removed."""


@dataclass
class _Sphere:
    """A sphere of a file: number, radius [m], material, time of leaving [s], and its frames by time [s]."""

    id: int
    radius: float
    material: str = ""
    end: float = FOREVER
    frames: dict[float, dict[str, list[float]]] = field(default_factory=dict)


def recognises(head: bytes) -> bool:
    """Whether the first line has a tag and one of the first lines is an object with its type."""
    lines = [line.split() for line in head.splitlines()]
    tagged = bool(lines and lines[0] and lines[0][0].isdigit())
    return tagged and any(line[:1] == [b"0"] and line[2:3] == [b"1"] and b"5" in line[4:5] for line in lines)


def read(path: Path, frame: int = -1) -> State:
    """Reads one frame of a scene or an export; spheres that have left the domain by then are left out."""
    spheres: list[_Sphere] = []
    densities: dict[str, float | None] = {}
    for number, line in enumerate(text_lines(path), 1):
        words = line.split()
        try:
            if words[:1] == [OBJECT]:
                spheres += _sphere(words)
            elif words[:1] == [MATERIAL_LINE]:
                properties = dict(zip(words[3::2], words[4::2], strict=True))
                densities[words[1]] = float(properties[DENSITY]) if DENSITY in properties else None
        except (ValueError, IndexError) as error:
            raise CoordinatesError(f"{path}:{number}: no object of this format: {error}") from None
    times = sorted({time for sphere in spheres for time in sphere.frames})
    if not times:
        raise CoordinatesError(
            f"{path}: no spheres; accepted are lines '{OBJECT} ID {TYPE} {SPHERE} {GEOMETRY} R R ...'"
        )
    if not -len(times) <= frame < len(times):
        raise CoordinatesError(f"{path}: frame {frame} of {len(times)}; accepted are 0 to {len(times) - 1}, or -1")
    return _state(path, spheres, times[frame], densities)


def _sphere(words: list[str]) -> list[_Sphere]:
    """The object of a line, if it is a sphere."""
    if words[2] != TYPE:
        raise ValueError(f"tag {words[2]} where the type (tag {TYPE}) stands")
    if words[3] != SPHERE:
        return []
    if words[4] != GEOMETRY:
        raise ValueError(f"tag {words[4]} where radius and contact radius (tag {GEOMETRY}) stand")
    sphere = _Sphere(int(words[1]), float(words[5]))
    k, current = 7, None
    while k < len(words):
        tag = words[k]
        if tag == MATERIAL:
            sphere.material, k = words[k + 1], k + 2
        elif tag == ACTIVITY:
            sphere.end, k = float(words[k + 2]), k + 3
        elif tag == TIME:
            current, k = sphere.frames.setdefault(float(words[k + 1]), {}), k + 2
        elif tag in LENGTHS and current is not None:
            values = words[k + 1 : k + 1 + LENGTHS[tag]]
            if len(values) < LENGTHS[tag]:
                raise ValueError(f"tag {tag} has {len(values)} values, not {LENGTHS[tag]}")
            if tag in KEPT:
                current[KEPT[tag]] = [float(value) for value in values]
            k += 1 + LENGTHS[tag]
        else:
            raise ValueError(f"unknown tag '{tag}'")
    return [sphere]


def _state(path: Path, spheres: list[_Sphere], time: float, densities: dict[str, float | None]) -> State:
    """The spheres that are there at a time; the frame at or behind the time of leaving is no longer valid."""
    there = [s for s in spheres if time in s.frames and (time < s.end or s.end >= FOREVER)]
    arrays: dict[str, np.ndarray] = {}
    for name in KEPT.values():
        values = [s.frames[time].get(name) for s in there]
        if all(value is not None for value in values):
            arrays[name] = np.array(values).reshape(-1, 3)
        elif name == "position" or any(value is not None for value in values):
            lacking = there[next(k for k, value in enumerate(values) if value is None)].id
            raise CoordinatesError(f"{path}: object {lacking} has no {name} at t = {time:g} s")
    keys = list(densities) or sorted({s.material for s in there})
    for sphere in there:
        if sphere.material not in keys:
            raise CoordinatesError(f"{path}: object {sphere.id} is of material '{sphere.material}', which has no line")
    if densities and all(densities[s.material] is not None for s in there):
        arrays["density"] = np.array([densities[s.material] for s in there])
    return state_of(
        arrays.pop("position"),
        id=np.array([s.id for s in there]) + 1,
        radius=np.array([s.radius for s in there]),
        species=np.array([keys.index(s.material) for s in there]),
        **arrays,
    )


def write(state: State, path: Path) -> None:
    """Writes a scene of the spheres alone, one material per species; StateError where a species has two densities."""
    assert state.radius is not None and state.density is not None
    n = len(state)
    species = np.zeros(n, int) if state.species is None else state.species
    materials = []
    for k in range(species.max() + 1):
        own = np.unique(state.density[species == k])
        if len(own) > 1:
            raise StateError(
                f"species {k} has {len(own)} densities, {own[0]:g} and {own[1]:g} kg/m3; a material has one"
            )
        materials.append(f"32 S{k} species{k}" + (f" {DENSITY} {own[0].item()!r}" if len(own) else ""))
    still = np.zeros((n, 3))
    velocity = still if state.velocity is None else state.velocity
    spin = still if state.angular_velocity is None else state.angular_velocity
    lines = []
    for k in range(n):
        radius = state.radius[k].item()
        place, speed, turn = (" ".join(map(repr, rows[k].tolist())) for rows in (state.position, velocity, spin))
        lines.append(
            f"0 {state.id[k] - 1} 1 1 5 {radius!r} {radius!r} 23 S{species[k]} 24 0 1e+300 "
            f"2 0 12 {place} 15 {speed} 16 {turn} 31 1 0 0 0"
        )
    reach = (1 + MARGIN) * state.radius.max()
    corners = [*(state.position.min(axis=0) - reach).tolist(), *(state.position.max(axis=0) + reach).tolist()]
    lines += ["22 " + " ".join(map(repr, corners)), "28" + 10 * " 0", "29 0", "30 0", *materials]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


FORMAT = Format(
    "musen", "MUSEN text scene or text export", (".txt",), recognises, read, write, needs=("radius", "density")
)

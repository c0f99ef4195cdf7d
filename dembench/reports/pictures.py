"""Pictures of the particles: one for every engine and instant, to one scale, with walls, scale bar and legend."""

from __future__ import annotations

import base64
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

from dembench.cases.views import Picture
from dembench.reports.entries import Entry
from dembench.reports.groups import Group, Member
from dembench.reports.spheres import Camera, png, render
from dembench.reports.svg import INK, MUTED
from dembench.reports.tables import significant
from dembench.reports.units import measure
from dembench.results.export import export_vtkhdf
from dembench.results.schema import SnapshotSeries
from dembench.scene import Plane, Scene

SIZE = 52_000.0
"""Area of a picture in units of its drawing, which are about those of the page [px²]."""
NARROWEST, WIDEST = 200, 340
SHARPNESS = 2
"""Pixels of the picture per unit of the drawing."""
LETTER = 7.3
"""Mean width of a letter of the text above a picture, in units of its drawing."""
MOST_ENGINES = 8
SPECIES_COLOURS = ("#d9a62e", "#3f6fae", "#7a9a4c", "#b5568f", "#777777")
"""Colours of species, told apart by everyone (after Tol 2021, 'Colour schemes')."""
SPEED_SCALE, DARKEST = "viridis", 0.06
FASTEST_SHARE = 0.995
"""Share of the particles that the colour scale covers; faster ones have its last colour."""
BAR_SHARE = 0.3
"""Largest length of the scale bar in widths of the picture."""


@dataclass(frozen=True)
class Shot:
    """One picture; lengths are in units of the drawing, which are about those of the page.

    Attributes:
        name: Identifier.
        lines: What is written above it: the engine in one or two lines, then the time.
        label: The same in words, for those who do not see it.
        image: PNG file, base64.
        width, height: Size of the image.
        walls: Path of the walls, from the image's upper left corner.
        bar: Length of the scale bar, and what it stands for.
    """

    name: str
    lines: tuple[str, ...]
    label: str
    image: str
    width: float
    height: float
    walls: str
    bar: tuple[float, str]


@dataclass(frozen=True)
class Legend:
    """What the colours mean: the stops (share, colour) and ticks (share, text) of a scale, or a colour per kind.

    Attributes:
        title: What is coloured, with its unit.
        stops, ticks: Of a scale; empty for kinds.
        kinds: Colour and text of each; empty for a scale.
    """

    title: str
    stops: tuple[tuple[float, str], ...] = ()
    ticks: tuple[tuple[float, str], ...] = ()
    kinds: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Album:
    """The pictures of a figure.

    Attributes:
        name, title, caption, command, tag: As of any figure.
        legend: What the colours mean.
        rows: Shots side by side; a row per engine where there are several instants.
        columns, narrow: Shots side by side on a wide and on a narrow page.
        files: Directory beside the page with the particles as VTKHDF files.
        colours: Colours that follow the page.
    """

    name: str
    title: str
    caption: str
    command: str
    tag: str
    legend: Legend
    rows: tuple[tuple[Shot, ...], ...]
    columns: int
    narrow: int
    files: str
    colours: set[str]


def albums(group: Group, command: str, beside: Path, names: Sequence[str] | None = None) -> list[Album]:
    """The pictures that the group's case asks for; writes the snapshots as VTKHDF into the directory `beside`.

    Of several seeds of an engine the first is shown.

    Args:
        group: The runs.
        command: What reproduces them.
        beside: Directory of the VTKHDF files.
        names: The pictures that are wanted; None for all.
    """
    wanted = [picture for picture in group.first.pictures if names is None or picture.name in names]
    return [found for picture in wanted if (found := _album(group, picture, command, beside))]


def _album(group: Group, picture: Picture, command: str, beside: Path) -> Album | None:
    seen = [e.first_with(picture.snapshot) for e in group.ensembles]
    members = [m for m in seen if m is not None][:MOST_ENGINES]
    scene = group.first.scene
    if not members or scene is None:
        return None
    fastest = picture.fastest or _fastest([_shots(m.shown, picture) for m in members])
    width = float(np.clip(np.sqrt(SIZE * _aspect(picture)), NARROWEST, WIDEST))
    name = f"{group.name}-{picture.name}"
    rows = [tuple(_shot(name, m, picture, k, width, fastest) for k in _instants(m.shown, picture)) for m in members]
    if len(picture.times) == 1:
        rows = [tuple(shot for row in rows for shot in row)]
    for member in members:
        _write(member.shown, beside / member.shown.name)
    return Album(
        name=name,
        title=picture.title,
        caption=picture.caption + (" Of several seeds the first is shown." if group.seeded else ""),
        command=command,
        tag=group.tag,
        legend=_legend(scene, picture, fastest),
        rows=tuple(rows),
        columns=max(len(row) for row in rows),
        narrow=1 if width > 260 else 2,
        files=beside.name,
        colours={INK, MUTED},
    )


def _aspect(picture: Picture) -> float:
    return (picture.x[1] - picture.x[0]) / (picture.z[1] - picture.z[0])


def _shots(entry: Entry, picture: Picture) -> SnapshotSeries:
    assert entry.record.result is not None, "members with the snapshot are chosen"
    return entry.record.result.snapshots[picture.snapshot]


def _instants(entry: Entry, picture: Picture) -> list[int]:
    """Rows of the snapshot that are nearest to the times wanted, without those that a short record does not reach."""
    time = _shots(entry, picture).time
    near = [int(np.argmin(np.abs(time - t))) for t in picture.times]
    gap = np.diff(picture.times).min() if len(picture.times) > 1 else np.inf
    return [k for k, t in zip(near, picture.times, strict=True) if abs(time[k] - t) < 0.5 * gap]


# ---- one picture


def _shot(name: str, member: Member, picture: Picture, k: int, width: float, fastest: float) -> Shot:
    shots, scene = _shots(member.shown, picture), member.shown.scene
    assert scene is not None, "it has a result"
    scale = width / (picture.x[1] - picture.x[0])
    when = f"t = {measure(float(shots.time[k]), 's')}"
    bar = _round(BAR_SHARE * (picture.x[1] - picture.x[0]))
    return Shot(
        name=f"{name}-{member.shown.name}-{k}",
        lines=(*textwrap.wrap(member.label, int(width / LETTER))[:2], when),
        label=f"{picture.title}: {member.label}, {when}",
        image=base64.b64encode(drawn_image(scene, picture, shots, k, width, fastest)).decode(),
        width=width,
        height=width / _aspect(picture),
        walls=_outline(scene, picture, scale),
        bar=(bar * scale, measure(bar, "m")),
    )


def drawn_image(scene: Scene, picture: Picture, shots: SnapshotSeries, k: int, width: float, fastest: float) -> bytes:
    """One picture as a PNG file.

    Args:
        scene: The scene.
        picture: What is to be seen.
        shots: Snapshots of a run.
        k: Which of them.
        width: Width in units of the drawing.
        fastest: Speed at the end of the colour scale [m/s].
    """
    position, velocity = shots.position[k], shots.velocity[k]
    drawn = position[:, 1] >= picture.cut
    drawn[list(picture.always)] = True
    drawn &= np.isfinite(position[:, 1])  # what has left is NaN
    if picture.colour == "speed":
        speed = np.linalg.norm(velocity[drawn], axis=1)
        colours = speed_colours(speed / fastest)
    else:
        colours = np.array([_rgb(_species_colour(s)) for s in range(len(scene.species))])[scene.bodies.species[drawn]]
    camera = Camera(picture.x, picture.z, SHARPNESS * width / (picture.x[1] - picture.x[0]))
    seen = position[drawn][:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
    return png(render(camera, seen, scene.radii()[drawn], colours))


def speed_colours(share: np.ndarray) -> np.ndarray:
    """Colours of speeds given as shares of the fastest, shape (n,): red, green, blue from 0 to 1, shape (n, 3)."""
    scale = matplotlib.colormaps[SPEED_SCALE]
    return np.asarray(scale(DARKEST + (1 - DARKEST) * np.clip(share, 0, 1)))[:, :3]


def _species_colour(species: int) -> str:
    return SPECIES_COLOURS[species % len(SPECIES_COLOURS)]


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))


def _fastest(series: Sequence[SnapshotSeries]) -> float:
    """End of the colour scale [m/s]: a round speed that nearly all particles of all runs stay below."""
    speeds = [np.linalg.norm(s.velocity, axis=2).ravel() for s in series]
    found = max(float(np.quantile(v[np.isfinite(v)], FASTEST_SHARE)) for v in speeds)
    return _round(1.5 * found) if found > 0 else 1.0


def _round(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is at most a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


# ---- walls


def _outline(scene: Scene, picture: Picture, scale: float) -> str:
    """Path of the walls where they cross the plane of the cut; planes without an end are left out."""
    parts = []
    for wall in scene.walls:
        if isinstance(wall, Plane):
            continue
        for ends in crossings(wall.triangulate(), picture.cut):
            (x0, y0), (x1, y1) = (((x - picture.x[0]) * scale, (picture.z[1] - z) * scale) for x, z in ends)
            parts.append(f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}")
    return "".join(dict.fromkeys(parts))


def crossings(triangles: np.ndarray, y: float) -> np.ndarray:
    """Segments in which triangles [m], shape (n, 3, 3), cross the plane of that y: ends as (x, z), shape (m, 2, 2)."""
    offset = triangles[:, :, 1] - y
    offset = np.where(offset == 0, np.finfo(float).tiny, offset)  # a vertex on the plane counts as behind it
    sides = np.array([(0, 1), (1, 2), (2, 0)])
    crossed = offset[:, sides[:, 0]] * offset[:, sides[:, 1]] < 0
    cut = np.flatnonzero(crossed.sum(axis=1) == 2)
    found = np.empty((len(cut), 2, 2))
    for place, t in enumerate(cut):
        for end, side in enumerate(np.flatnonzero(crossed[t])):
            a, b = sides[side]
            share = offset[t, a] / (offset[t, a] - offset[t, b])
            found[place, end] = (triangles[t, a] + share * (triangles[t, b] - triangles[t, a]))[[0, 2]]
    return found


# ---- legend and files


def _legend(scene: Scene, picture: Picture, fastest: float) -> Legend:
    if picture.colour == "species":
        sizes = [2 * float(scene.radii()[scene.bodies.species == k].max(initial=0)) for k in range(len(scene.species))]
        kinds = [f"{s.name}, {measure(size, 'm')}" for s, size in zip(scene.species, sizes, strict=True)]
        return Legend("Species", kinds=tuple((_species_colour(k), text) for k, text in enumerate(kinds)))
    factor, unit = (1e3, "mm/s") if fastest < 0.5 else (1.0, "m/s")
    stops = np.linspace(0, 1, 13)
    colours = [matplotlib.colors.to_hex(c) for c in speed_colours(stops)]
    ticks = [(s, ("≥ " if s == 1 else "") + significant(factor * fastest * s)) for s in (0.0, 0.5, 1.0)]
    return Legend(f"Speed [{unit}]", tuple(zip(stops.tolist(), colours, strict=True)), tuple(ticks))


def _write(entry: Entry, directory: Path) -> None:
    """Writes the snapshots of a run as VTKHDF files; those of an unchanged result stay."""
    result = entry.record.result
    assert result is not None, "members with the snapshot are chosen"
    changed = (entry.record.directory / "result.h5").stat().st_mtime
    files = [directory / f"{name}.vtkhdf" for name in result.snapshots]
    if not all(f.exists() and f.stat().st_mtime >= changed for f in files):
        export_vtkhdf(result, directory)

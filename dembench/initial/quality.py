"""How good a settled packing is: density by height, free surface, contacts, and the stress that it carries."""

from __future__ import annotations

import numpy as np

from dembench.initial.container import enclosure
from dembench.initial.filling import Filling, PackingError, resting
from dembench.initial.packings import Packing, Samples, packing, tops
from dembench.initial.progress import Progress, silent
from dembench.initial.stress import Support, janssen, loads, shaft, support
from dembench.scene.base import Model

SLAB = 2.0
"""Height of the slabs in mean diameters."""
TOLERANCE = 0.01
"""Share of the weight that walls may fail to carry when contact forces are read off."""


class Surface(Model):
    """The free surface: tops of columns 1.5 mean diameters wide, above the lowest point of the walls [m]."""

    mean: float
    deviation: float
    lowest: float
    highest: float


class Level(Model):
    """A horizontal slab and the plane in its middle.

    Attributes:
        height: Of the plane above the lowest point of the walls [m].
        fraction: Solid fraction of the slab inside the walls [-].
        stress: Mean vertical stress on the plane [Pa]; None where forces were not asked for.
        hydrostatic: Weight above over the area of the plane [Pa], likewise.
        janssen: Stress in the shaft by Janssen's formula, with the ratio of stresses and the wall friction that are
            found there [Pa]; None outside the shaft, or where there is none.
    """

    height: float
    fraction: float
    stress: float | None = None
    hydrostatic: float | None = None
    janssen: float | None = None


class Quality(Model):
    """The quality of a packing.

    Attributes:
        packing: Its figures.
        surface: Its free surface.
        levels: By height, from below.
        support: What carries it; None where forces were not asked for, or without a shaft.
    """

    packing: Packing
    surface: Surface
    levels: tuple[Level, ...]
    support: Support | None = None

    def rows(self) -> list[tuple[str, str]]:
        """Figures with their units, for a table."""
        p, top = self.packing, self.surface
        found = [
            ("solid fraction below the surface", f"{p.fraction:.4f}"),
            ("solid fraction of the bulk", f"{p.bulk_fraction:.4f}"),
            ("coordination number", f"{p.coordination:.2f}"),
            ("mean overlap", f"{p.mean_overlap:.3%} of the diameter"),
            ("largest overlap", f"{p.largest_overlap:.3%} of the diameter"),
            ("free surface", f"{top.mean * 1e3:.2f} +- {top.deviation * 1e3:.2f} mm"),
            ("its lowest and highest top", f"{top.lowest * 1e3:.2f}, {top.highest * 1e3:.2f} mm"),
        ]
        if self.support:
            s = self.support
            found += [
                ("weight", f"{s.weight:.4g} N"),
                ("of it not carried by walls", f"{s.residual:.2%}"),
                ("bulk density in the shaft", f"{s.density:.0f} kg/m3"),
                ("horizontal over vertical stress", f"{s.pressure_ratio:.3f}"),
                ("friction of the wall, mobilised", f"{s.mobilised_friction:.3f} of {s.wall_friction:g}"),
                ("Janssen's length", "none" if s.length is None else f"{s.length * 1e3:.1f} mm"),
            ]
        return found

    def level_rows(self) -> list[tuple[str, ...]]:
        """The levels as texts: height, solid fraction, stress, weight above and Janssen's stress."""

        def pascal(value: float | None) -> str:
            return "" if value is None else f"{value:.4g}"

        return [
            (f"{x.height * 1e3:.1f}", f"{x.fraction:.3f}", pascal(x.stress), pascal(x.hydrostatic), pascal(x.janssen))
            for x in reversed(self.levels)
        ]


def quality(plan: Filling, position: np.ndarray, forces: bool = True, progress: Progress | None = None) -> Quality:
    """The quality of a packing.

    Shear springs are not part of positions: for the forces, the packing settles once more with the materials of the
    plan, by a part of its overlaps, until walls carry it. So does every run that starts from positions: its grains are
    without shear at first, press sideways as much as down, and mobilise a part of the friction.

    Args:
        plan: What is packed and between which walls.
        position: Centres [m], shape (n, 3), layer upon layer.
        forces: Whether stresses are wanted; they take most of the time.
        progress: Called while it settles.

    Raises:
        PackingError: It does not come to rest.
    """
    radius, (lower, _) = plan.radii(), enclosure(plan.walls)
    top = tops(position, radius, plan.walls)
    mean = float(top.mean())
    edges = np.arange(lower[2], mean + 1e-12, SLAB * 2 * radius.mean())
    if len(edges) < 2:
        raise PackingError(
            f"{plan.count} particles make no layer of two diameters; nothing is to be seen of its height"
        )
    samples = Samples(position, radius, plan.walls, mean)
    slab = np.digitize(samples.height, edges) - 1
    number = np.bincount(slab, minlength=len(edges))[: len(edges) - 1]
    solid = np.bincount(slab, samples.solid, minlength=len(edges))[: len(edges) - 1]
    level = 0.5 * (edges[1:] + edges[:-1])
    columns = {"height": level - lower[2], "fraction": solid / np.maximum(1, number)}
    held = None
    if forces:
        simulation = resting(plan, position, TOLERANCE, progress or silent)
        gravity = -simulation.scene.gravity[2]
        area = samples.volume * number / len(samples.height) / (edges[1] - edges[0])
        found, column = loads(simulation, level), shaft(plan.walls)
        columns |= {"stress": found.passed / area, "hydrostatic": found.above / area}
        held = support(simulation, column, found, mean) if column else None
        if column and held:
            formula = janssen(mean - level, held.density, held.mobilised_length, gravity)
            columns["janssen"] = np.where(level > column.lower, formula, np.nan)
    rows = np.column_stack(list(columns.values()))
    return Quality(
        packing=packing(position, radius, plan.walls),
        surface=Surface(
            mean=mean - lower[2],
            deviation=float(top.std()),
            lowest=float(top.min()) - lower[2],
            highest=float(top.max()) - lower[2],
        ),
        levels=tuple(
            Level(**{name: float(x) for name, x in zip(columns, row, strict=True) if np.isfinite(x)}) for row in rows
        ),
        support=held,
    )

"""Quantities, references and known curves of the silo."""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.cases.base import Curve, Preset, Quantity, Ratio, Recorded, Reference
from dembench.cases.publication import cited, published
from dembench.cases.quantities import OVERLAP_MARGIN, SHARE, kept_shape, overlap_in_diameters, titled
from dembench.scene import Count, Scene

LEAST = 0.02
"""Share of the grains below which the flow ends: the fit takes no samples there [-]."""

QUANTITIES = {
    "discharge_rate": ("Discharge rate, fit of the count over the window", "1/s"),
    "rate_change": ("Change of the rate over the window, relative to the mean rate, per second", "1/s"),
    "onset": ("Time at which the fitted line leaves the initial count", "s"),
    "emptying_time": ("Time until 2 % of the grains are left", "s"),
    "beverloo_ratio": ("Discharge rate over Beverloo's", "1"),
    "wall_load": ("Share of the grains' weight that the walls carry, mean over the window", "1"),
    "left": ("Grains left at the end", "1"),
    "overlap": ("Largest overlap, in diameters", "1"),
}
"""Title and unit of every quantity, in the order of tables."""


def quantities(scene: Scene, result: Recorded) -> list[Quantity]:
    """The quantities that the record covers."""
    found: dict[str, float | None] = {}
    inside = result.observables.get("inside")
    if inside is not None and len(inside.time):
        time, count = np.asarray(inside.time), np.asarray(inside.value, dtype=float)
        found |= _flow(scene, time, count)
        found["left"] = float(count[-1]) if time[-1] >= scene.duration * (1 - 1e-9) else None
        found["wall_load"] = _wall_load(scene, result, time, count)
    found["overlap"] = overlap_in_diameters(scene, result)
    return titled(QUANTITIES, found, _margins(scene))


def _margins(scene: Scene) -> dict[str, float]:
    """Changes that do not matter of what can be zero.

    A fitted line that turns about the middle of the window by as much as its slope may differ meets the initial count
    earlier or later by that share of the time to the middle; the rate may change by it from one end to the other.
    """
    low, high = window(scene)
    return {
        "rate_change": SHARE / (high - low),
        "onset": SHARE * (low + high) / 2,
        "left": SHARE * len(scene.bodies),
        "overlap": OVERLAP_MARGIN,
    }


def window(scene: Scene) -> tuple[float, float]:
    """Times between which the rate is fitted [s]; the window of the preset whose grains the scene has."""
    low, high = _preset(scene)["rate_window"]
    return float(low), float(high)


def _preset(scene: Scene) -> dict[str, Any]:
    numbers = published("silo")
    radius = float(scene.radii().min())
    found: dict[str, Any] = min(
        (numbers[p] for p in ("published", "quick")), key=lambda p: abs(p["grain_radius"] - radius)
    )
    return found


def _flow(scene: Scene, time: np.ndarray, count: np.ndarray) -> dict[str, float | None]:
    """Rate and what else the count tells; a fit needs samples over a third of the window."""
    low, high = window(scene)
    used = (time >= low - 1e-9) & (time <= high + 1e-9) & (count > LEAST * count[0])
    found: dict[str, float | None] = {}
    if np.count_nonzero(used) >= 3 and np.ptp(time[used]) >= (high - low) / 3:
        slope, start = np.polyfit(time[used], count[used], 1)
        found["discharge_rate"] = -float(slope)
        if slope < 0:
            found["onset"] = float((count[0] - start) / slope)
            if np.count_nonzero(used) >= 5:
                found["rate_change"] = -2 * float(np.polyfit(time[used], count[used], 2)[0]) / -float(slope)
        found["beverloo_ratio"] = -float(slope) / beverloo_rate(scene)
    few = np.flatnonzero(count <= LEAST * count[0])
    if len(few) and few[0] > 0:
        k = few[0]
        share = (count[k - 1] - LEAST * count[0]) / (count[k - 1] - count[k])
        found["emptying_time"] = float(time[k - 1] + share * (time[k] - time[k - 1]))
    return found


def _wall_load(scene: Scene, result: Recorded, time: np.ndarray, count: np.ndarray) -> float | None:
    """Vertical force on all walls over the weight of the grains above the lip, mean over the window."""
    forces = [f for wall in scene.walls if (f := result.observables.get(f"{wall.name}_force")) is not None]
    low, high = window(scene)
    used = (time >= low) & (time <= high) & (count > LEAST * count[0])
    if len(forces) != len(scene.walls) or any(len(f.time) != len(time) for f in forces) or not used.any():
        return None
    vertical = np.sum([np.asarray(f.value).reshape(-1, 3)[:, 2] for f in forces], axis=0)
    weight = float(scene.masses()[0]) * scene.gravity[2] * count
    return float(np.mean(vertical[used] / weight[used]))


def orifice_of(scene: Scene) -> dict[str, Any]:
    """Numbers of the orifice that a scene has, known by the height of its lip."""
    lip = next(o.region.lower[2] for o in scene.observables if isinstance(o, Count))
    found: dict[str, Any] = min(published("silo")["orifices"].values(), key=lambda own: abs(own["lip"] - lip))
    return found


def beverloo_rate(scene: Scene) -> float:
    """Number of grains per second [1/s] by Beverloo's law, W = C rho_b sqrt(g) (D - k d)^2.5.

    Source: Beverloo, Leniger & van de Velde 1961, doi 10.1016/0009-2509(61)85030-6.
    """
    law = published("silo")["beverloo"]
    diameter, density = 2 * float(scene.radii()[0]), float(scene.densities()[0])
    opening = 2 * orifice_of(scene)["radius"] - law["k"] * diameter
    mass_flow = law["C"] * law["bulk_fraction"] * density * np.sqrt(-scene.gravity[2]) * opening**2.5
    return float(mass_flow / scene.masses()[0])


def references(scene: Scene, parameters: Any, preset: Preset) -> list[Reference]:
    """What holds for a variant: published numbers where its contacts are the published ones."""
    numbers = published("silo")
    found = [
        kept_shape(),
        Reference(
            quantity="beverloo_ratio",
            value=1.0,
            low=None,
            high=None,
            unit="1",
            source=numbers["beverloo"]["source"],
            kind="publication",
        ),
    ]
    if preset == "quick":
        return found + cited(numbers["quick"], QUANTITIES, parameters, ("orifice", "material"))
    return found + [
        r
        for r in cited(numbers, QUANTITIES, parameters, ("orifice", "material"))
        if r.quantity != "emptying_time" or np.isclose(scene.duration, numbers["published"]["duration"])
    ]


def ratios() -> tuple[Ratio, ...]:
    """The rate of the large orifice over that of the small one."""
    numbers = published("silo")
    return (
        Ratio(
            title="Discharge rate, large over small orifice",
            quantity="discharge_rate",
            over={"orifice": "large"},
            under={"orifice": "small"},
            value=numbers["ratio"]["value"],
            low=numbers["ratio"]["low"],
            high=numbers["ratio"]["high"],
            source=f"{numbers['ratio']['source']}; doi {numbers['doi']}",
        ),
    )


def curves(scene: Scene, parameters: Any, preset: Preset) -> list[Curve]:
    """The guide line of the published figure, and Beverloo's law."""
    line = published("silo")["guide_line"]
    total = len(scene.bodies)
    source = f"{published('silo')['beverloo']['source']}"
    found = [_line("Beverloo's law", total, beverloo_rate(scene), 0.0, scene.duration, source)]
    same = (parameters.orifice, parameters.material) == (line["orifice"], line["material"])
    if preset == "published" and same and not parameters.changed():
        text = f"{line['source']}; doi {published('silo')['doi']}"
        found.insert(0, _line("published guide line", total, line["rate"], line["onset"], scene.duration, text))
    return found


def _line(label: str, total: int, rate: float, onset: float, duration: float, source: str) -> Curve:
    """A straight count from `total` at the onset [s] down to none."""
    time = np.array([onset, min(duration, onset + total / rate)])
    return Curve("inside", label, time, total - rate * (time - onset), None, None, source)

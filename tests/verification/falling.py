"""A suite of one scene for tests: three spheres in free flight, which the stand-in engines compute exactly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, Published, Suite, Trial, on_one_scene


def falling(name: str = "falling", gravity: float = 10.0) -> Scene:
    return Scene(
        name=name,
        materials=(Material(name="glass", density=2500, young=1e7, poisson=0.25),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=0.8, friction=0.3),),
        species=(Species(name="grain", material="glass", radius=1e-3),),
        bodies=Bodies(position=[[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        domain=Domain(lower=(-1, -1, -1), upper=(3, 1, 1)),
        gravity=(0, 0, -gravity),
        duration=0.1,
        time_step=1e-3,
        observables=(Snapshot(name="end", times=(0.1,)),),
    )


def measure(result: Result) -> Mapping[str, float]:
    end = result.snapshots["end"]
    return {
        "F1": float(end.position[-1, 0, 2]),
        "F2": float(end.velocity[-1, 0, 2]),
        "F3": float("nan") if np.any(end.velocity[-1, :, 0]) else 0.0,
    }


def suite() -> Suite:
    checks = (
        Check("F1", "height", "m", -0.05, 1e-9, "g t²/2", Published(-0.06, -0.06, 1e-3, "The page forgot something.")),
        Check("F2", "speed", "m/s", -1.0, 1e-9, "g t", Published(-1.0, -1.0, 0.1)),
        Check("F3", "sideways", "m/s", 0.0, 1e-9, "no force"),
    )
    return Suite(
        name="falling",
        title="Free fall",
        text="Spheres fall.",
        source="none",
        experiments=(on_one_scene("falling", "Free fall", falling, measure, checks),),
        settings={"spoil": "nothing", "sweeps": "3"},
    )


def heights(results: Mapping[str, Result]) -> Mapping[str, float]:
    """Of two falls: how many came to their end, the ratio of the heights, and a bound on each."""
    fallen = {name: -float(result.snapshots["end"].position[-1, 0, 2]) for name, result in results.items()}
    lowest = max(fallen.values(), default=np.nan)
    return {
        "G1": float(len(fallen)),
        "G2": fallen.get("heavy", np.nan) / fallen.get("light", np.nan),
        "G3": lowest,
        "G4": lowest,
    }


def planets(deaths_count: bool = True) -> Suite:
    """Two falls that are measured together."""
    trials = (
        Trial("heavy", lambda: falling("heavy", 20.0), {"spoil": "more"}),
        Trial("light", lambda: falling("light", 2.0)),
    )
    checks = (
        Check("G1", "falls that came to their end", "1", 2.0, 0.0, "both do"),
        Check("G2", "ratio of the heights", "1", 10.0, 1e-6, "g t²/2", scene_law=True),
        Check("G3", "deepest fall", "m", 0.1, 1e-9, "g t²/2", sense="at most"),
        Check("G4", "deepest fall", "m", 0.05, 0.0, "g t²/2", sense="at least"),
    )
    experiment = Experiment("planets", "Two planets", trials, heights, checks, "long", deaths_count)
    return Suite("planets", "Planets", "Spheres fall.", "none", (experiment,), {"spoil": "nothing"})

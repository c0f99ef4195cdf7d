"""A suite of one scene for tests: three spheres in free flight, which the stand-in engines compute exactly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, Published, Suite


def falling() -> Scene:
    return Scene(
        name="falling",
        materials=(Material(name="glass", density=2500, young=1e7, poisson=0.25),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=0.8, friction=0.3),),
        species=(Species(name="grain", material="glass", radius=1e-3),),
        bodies=Bodies(position=[[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        domain=Domain(lower=(-1, -1, -1), upper=(3, 1, 1)),
        gravity=(0, 0, -10),
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
        experiments=(Experiment("falling", "Free fall", falling, measure, checks),),
        settings={"spoil": "nothing", "sweeps": "3"},
    )

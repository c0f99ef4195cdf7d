"""The force on a wall, from the in-tree solvers through their files to the observable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dembench.engines import registry
from dembench.engines.in_tree_program import simulate
from dembench.results import observe
from dembench.scene import scene_from

RADIUS, DENSITY = 1e-3, 2500.0


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz"])
def test_the_floor_carries_the_weight_of_a_grain_at_rest(name: str, tmp_path: Path) -> None:
    """At the end, after the little bounce of a grain that starts without overlap; the lid carries nothing."""
    planes = [{"kind": "plane", "name": n, "material": "glass", "point": (0, 0, z), "normal": (0, 0, s)} for n, z, s in
              (("floor", 0, 1), ("lid", 0.02, -1))]  # fmt: skip
    scene = scene_from(
        {
            "name": "weight",
            "materials": [{"name": "glass", "density": DENSITY, "young": 1e7, "poisson": 0.2}],
            "pair_laws": [{"a": "glass", "b": "glass", "restitution": 0.3, "friction": 0.3}],
            "species": [{"name": "grain", "material": "glass", "radius": RADIUS}],
            "walls": planes,
            "bodies": {"position": [[0, 0, RADIUS]]},
            "domain": {"lower": (-0.03,) * 3, "upper": (0.03,) * 3},
            "gravity": (0, 0, -9.81),
            "duration": 0.02,
            "time_step": 5e-6,
            "observables": [
                {"kind": "wall-force", "name": n, "wall": n, "interval": 5e-3} for n in ("floor", "lid")
            ],
        }
    )  # fmt: skip
    engine = registry.engine(name)
    settings = engine.settings(scene, "closed", {})
    engine.write(scene, settings, tmp_path)
    simulate(tmp_path, engine.simulation, settings.model_dump())
    found = observe(scene, engine.read(scene, settings, tmp_path).frames)
    weight = DENSITY * 4 / 3 * np.pi * RADIUS**3 * 9.81
    assert found["floor"].value.shape == (5, 3)
    assert found["floor"].value[-1] == pytest.approx([0, 0, -weight], rel=1e-3, abs=1e-6 * weight)
    assert not found["lid"].value.any()

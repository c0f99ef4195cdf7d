"""A small silo of exact walls with all that a resumed run must not lose: contacts, sinks, wall forces and tracks."""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.scene import Scene, scene_from

RADIUS = 1e-3


def hopper(n: int = 120, seed: int = 1, **changes: Any) -> Scene:
    """Fast grains in a barrel on a cone; those that pass the lip at z = 0 leave 2 mm below. Body 0 starts on top.

    Barrel 8 mm in radius, cone from there down to 3 mm, grains of 1 mm with E = 1e7 Pa; 40 ms.
    """
    random = np.random.default_rng(seed)
    sites = np.stack(np.meshgrid(*[2.3e-3 * np.arange(-2, 3)] * 2, 2.3e-3 * np.arange(20), indexing="ij"), axis=-1)
    sites = sites.reshape(-1, 3)
    sites = sites[np.hypot(sites[:, 0], sites[:, 1]) < 6.5e-3]
    sites = sites[np.argsort(-sites[:, 2], kind="stable")][-n:]
    position = sites + np.array([0, 0, 7e-3]) + random.uniform(-1e-4, 1e-4, sites.shape)
    given: dict[str, Any] = {
        "name": "hopper",
        "materials": [{"name": "glass", "density": 2500, "young": 1e7, "poisson": 0.2}],
        "pair_laws": [{"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3}],
        "species": [{"name": "grain", "material": "glass", "radius": RADIUS}],
        "walls": [
            {"kind": "cylinder", "name": "barrel", "material": "glass", "start": (0, 0, 5e-3), "end": (0, 0, 0.1),
             "radius": 8e-3},
            {"kind": "frustum", "name": "cone", "material": "glass", "start": (0, 0, 0), "end": (0, 0, 5e-3),
             "radius_start": 3e-3, "radius_end": 8e-3},
        ],
        "bodies": {"position": position, "velocity": random.normal(0, 0.2, position.shape) - np.array([0, 0, 0.5])},
        "sinks": [{"name": "outlet", "region": {"upper": (None, None, -2e-3)}}],
        "domain": {"lower": (-0.02, -0.02, -0.05), "upper": (0.02, 0.02, 0.12)},
        "gravity": (0, 0, -9.81),
        "duration": 0.04,
        "time_step": 5e-6,
        "observables": [
            {"kind": "count", "name": "inside", "region": {"lower": (None, None, 0.0)}, "interval": 4e-3},
            {"kind": "wall-force", "name": "barrel_force", "wall": "barrel", "interval": 4e-3},
            {"kind": "wall-force", "name": "cone_force", "wall": "cone", "interval": 4e-3},
            {"kind": "energy", "name": "energy", "interval": 4e-3},
            {"kind": "trajectory", "name": "top", "body": 0, "interval": 4e-3, "track_interval": 1e-3},
            {"kind": "snapshot", "name": "flow", "times": (0.02, 0.04)},
        ],
    }  # fmt: skip
    return scene_from({**given, **changes})

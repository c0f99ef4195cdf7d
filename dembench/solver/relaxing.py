"""Overlapping starts: bodies are let apart under a limit of their speed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dembench.solver.guard import SolverError

LOOK = 20
"""Steps between two looks at the overlap."""
SHARE = 1e-3
"""Limit of the speed without gravity: part of the smallest diameter in a step."""


def relax(simulation: Any, speed_limit: float | None, until: float, steps: int) -> int:
    """Steps a simulation until its overlaps are small; see `Simulation.relax`."""
    state, u = simulation.state, simulation.units
    smallest = float(simulation.radii.min(initial=math.inf))
    gravity = math.hypot(*simulation.scene.gravity)
    usual = math.sqrt(4 * gravity * smallest) if gravity else SHARE * 2 * smallest / simulation.dt
    limit = usual if speed_limit is None else speed_limit
    if not limit > 0:
        raise SolverError(f"speed_limit: {limit} m/s is given; accepted are numbers above 0")
    made = 0
    overlap = _overlap(simulation)
    while overlap > until * smallest:
        if made >= steps:
            raise SolverError(
                f"bodies still overlap by {overlap:.3g} m after {made} steps of relaxation, accepted is "
                f"{until * smallest:.3g} m; they may lack room, or need more steps or a larger speed_limit"
            )
        for _ in range(LOOK):
            _hold(state, limit / u.velocity, simulation.dt / u.time)
            simulation.step()
        _hold(state, limit / u.velocity, simulation.dt / u.time)
        made += LOOK
        overlap = _overlap(simulation)
    return made


def _overlap(simulation: Any) -> float:
    """Largest overlap of two bodies or of a body and a wall [m]."""
    overlap = simulation.overlap()
    for wall in simulation.scene.walls:
        if wall.motion is None and hasattr(wall, "signed_distance") and len(simulation.radii):
            probes = simulation.probes
            overlap = max(overlap, float((probes[:, 3] - wall.signed_distance(probes[:, :3])).max()))
    return overlap


def _hold(state: Any, limit: float, dt: float) -> None:
    """Cuts speeds to half the limit and forces to what adds the other half in half a step [scene units]."""
    b, n = state.bodies, state.total
    kin, load = b.kin.numpy()[:n], state.loads().numpy()[:n]
    inverse = b.inv_m.numpy()[:n].astype(np.float64)
    speed = np.linalg.norm(kin[:, 3:6], axis=1)
    fast = (speed > limit / 2) & (inverse > 0)
    kin[fast, 3:6] *= (limit / 2 / speed[fast])[:, None]
    if not len(load):
        return
    gain = np.linalg.norm(load[:, :3].astype(np.float64), axis=1) * inverse * dt / 2
    strong = gain > limit / 2
    load[strong] *= (limit / 2 / gain[strong])[:, None]

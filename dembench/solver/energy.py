"""Balance of the energy of a simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dembench.scene import features
from dembench.solver.walls.loads import WORK


@dataclass(frozen=True)
class Energy:
    """Energy of a simulation and what has changed it [J].

    Attributes:
        kinetic, rotational: Of translation and of rotation.
        gravitational: -m g.x of all bodies that can move.
        elastic: In the springs of the contacts; rigid contacts store none.
        external_work: Work of forces, torques and springs from outside, since the start.
        wall_work: Work of walls and bodies with a prescribed motion, since the start: NaN where it is not measured;
            that of walls is measured with `Simulation(..., wall_loads=True)`.
        dissipated: Energy when the balance began, and work done since, less the energy now; NaN where `wall_work` is.
    """

    kinetic: float
    rotational: float
    gravitational: float
    elastic: float
    external_work: float
    wall_work: float
    dissipated: float

    def total(self) -> float:
        """Mechanical energy now [J]."""
        return self.kinetic + self.rotational + self.gravitational + self.elastic


def kinetic(simulation: Any) -> tuple[float, float]:
    """Kinetic energy of translation and of rotation [J]; the moments of inertia are those about the principal axes."""
    scene, mass, spin = simulation.scene, simulation.masses, simulation.angular_velocity
    moments = 0.4 * (mass * simulation.radii**2)[:, None]
    if features(scene).shapes:
        axes = np.array([s.shape.solid.axes if s.shape else np.eye(3) for s in scene.species])
        spin = Rotation.from_quat(simulation.orientation).apply(spin, inverse=True)
        spin = np.einsum("ijk,ij->ik", axes[simulation.species], spin)
        moments = scene.moments()[simulation.ids]
    return 0.5 * float(mass @ (simulation.velocity**2).sum(axis=1)), 0.5 * float((moments * spin**2).sum())


class Balance:
    """The energy of a simulation from some moment on.

    Attributes:
        begin: Mechanical energy when the balance began less the work done by then [J]; NaN before it begins.
        drained: Number of bodies that sinks had taken by then.
    """

    def __init__(self) -> None:
        self.begin = math.nan
        self.drained = 0

    def energy(self, simulation: Any) -> Energy:
        """The energy now; the balance begins with the first call after `begin` was set to NaN or a sink took a body."""
        scene, work = simulation.scene, simulation.drive.work
        translation, rotation = kinetic(simulation)
        held = [c.bodies for c in scene.constraints if c.kind != "rotation-locked"]
        free = ~np.isin(simulation.ids, np.concatenate([*held, []]))
        gravity = np.array(scene.gravity)
        parts = {
            "kinetic": translation,
            "rotational": rotation,
            "gravitational": -float(simulation.masses[free] @ (simulation.position[free] @ gravity)),
            "elastic": float(simulation.contacts().energy.sum()),
        }
        total, drained = sum(parts.values()), int(simulation.state.drained.sum())
        by_walls = self._wall_work(simulation)
        if math.isnan(self.begin) or drained != self.drained:
            self.begin, self.drained = total - work - np.nan_to_num(by_walls), drained
        return Energy(**parts, external_work=work, wall_work=by_walls, dissipated=self.begin + work + by_walls - total)

    def _wall_work(self, simulation: Any) -> float:
        scene, walls = simulation.scene, simulation.state.walls
        if any(c.kind == "kinematic" for c in scene.constraints):
            return math.nan
        if walls.options.loads:
            return float(walls.loads()[:, WORK].sum()) * simulation.units.energy
        return math.nan if walls.options.moving else 0.0

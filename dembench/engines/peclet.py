"""peclet: the in-tree impulse solver as an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from dembench.engines.base import Division, EngineSettings, Forced, names_of, order_of_contacts
from dembench.engines.in_tree import InTree
from dembench.scene import Rigid, Scene, features

PARTICLE_STEPS_PER_SECOND = {"compliant": 5.0e6, "rigid": 1.4e6}
"""Throughput of one core on which run-time estimates are based; of compliant rows that of substeps."""
SLOWEST_STEP = {"compliant": 0.014, "rigid": 0.007}
"""Largest step in units of sqrt(d/g); compliant rows divide theirs by the stiffness of contacts."""
USUAL_SPEED = 0.1
"""Run-time estimates take the frequency of contacts to be that of collisions at this speed over sqrt(g d) [-]: within a
factor 1.5 of the substeps of the drum, the silo and the impact."""


class PecletSettings(EngineSettings):
    """Settings of a peclet run.

    Attributes:
        rows: Kind of contact rows; `compliant`: the scene's soft-sphere law, implicit in substeps; `rigid`: no
            stiffness, restitution and friction of the pair laws. By default `rigid` for a rigid law, else `compliant`.
        threads: Threads that share a step; the bits of a result depend on their number.
        substeps: Substeps of a step with compliant rows; None takes as many as the contacts of a step need.
        velocity_sweeps: Sweeps over compliant rows in a substep, by default 1; largest number of sweeps over rigid rows
            in a step, by default 8.
        position_sweeps: Largest number of position sweeps in a step with rigid rows, by default 12; compliant rows make
            none.
        stabilization: Rigid rows carry on after the sweeps where matter is at rest, until its weight is carried;
            compliant rows have none to leave out.
        arithmetic: Precision of impulses; positions and velocities are float64 always.
        force: Features that the scene lacks and that are computed all the same, as friction+rotation.
    """

    rows: Literal["compliant", "rigid"] = "compliant"
    threads: Annotated[int, Field(ge=1)] = 1
    substeps: Annotated[int, Field(ge=1)] | None = None
    velocity_sweeps: Annotated[int, Field(ge=1)]
    position_sweeps: Annotated[int, Field(ge=0)]
    stabilization: bool = True
    arithmetic: Literal["float32", "float64"] = "float32"
    force: Forced = None

    @model_validator(mode="before")
    @classmethod
    def _sweeps(cls, values: dict[str, Any]) -> dict[str, Any]:
        usual = {"velocity_sweeps": 1, "position_sweeps": 0}
        if values.get("rows") == "rigid":
            usual = {"velocity_sweeps": 8, "position_sweeps": 12}
            if values.get("substeps") is not None:
                raise ValueError("rigid rows have no substeps")
        return {**usual, **values}

    @model_validator(mode="after")
    def _of_rigid_rows(self) -> PecletSettings:
        if self.rows == "compliant" and not self.stabilization:
            raise ValueError("stabilization: compliant rows have none to leave out; write rows=rigid,stabilization=off")
        if self.rows == "compliant" and self.position_sweeps:
            given = f"position_sweeps={self.position_sweeps}"
            raise ValueError(f"position_sweeps: compliant rows make none; write rows=rigid,{given}")
        return self

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.threads

    def precision(self) -> str:
        """See `EngineSettings.precision`."""
        return "float64" if self.arithmetic == "float64" else "float64 positions, float32 impulses"


class Peclet(InTree):
    """Spheres by velocity-level impulses on NVIDIA Warp, with compliant or rigid contacts."""

    name: ClassVar[str] = "peclet"
    title: ClassVar[str] = "peclet, impulses"
    colour: ClassVar[str] = "#2a78d6"
    settings_type: ClassVar[type[EngineSettings]] = PecletSettings

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        from dembench.solver.impulse import compliant_stepper, stepper

        return (stepper if self._rigid(scene) else compliant_stepper).unsupported(scene)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """The rows follow the scene's law, those of bodies that are no spheres are rigid; the step: see `_step`."""
        rows = "rigid" if self._rigid(scene) else "compliant"
        return {"dt": self._step(scene, rows), "rows": rows}

    def settings(self, scene: Scene, division: Division, overrides: dict[str, str] | None = None) -> Any:
        """See `Engine.settings`; rows that are asked for bring their step with them."""
        asked = overrides or {}
        if asked.get("rows") in SLOWEST_STEP:
            asked = {"dt": repr(self._step(scene, asked["rows"])), **asked}
        return super().settings(scene, division, asked)

    def _step(self, scene: Scene, rows: str) -> float:
        """At most d/8 of travel in a step and SLOWEST_STEP sqrt(d/g), in both divisions; d is the smallest diameter."""
        diameter = 2 * min(scene.extreme_radii())
        limits = [scene.duration]
        speed = float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
        if speed:
            limits.append(0.125 * diameter / speed)
        gravity = math.hypot(*scene.gravity)
        if gravity:
            limits.append(SLOWEST_STEP[rows] * math.sqrt(diameter / gravity))
        return min(limits)

    def _rigid(self, scene: Scene) -> bool:
        """Whether a scene has rigid rows by default."""
        return isinstance(scene.law, Rigid) or features(scene).shapes

    def law(self, scene: Scene, settings: PecletSettings) -> str:
        """See `Engine.law`; compliant rows converge to the scene's law."""
        if settings.rows == "compliant" or isinstance(scene.law, Rigid):
            return ""
        return "rigid contacts with restitution and Coulomb friction"

    def order(self, scene: Scene, settings: PecletSettings) -> float | None:
        """See `Engine.order`: 1 with rigid rows; as many substeps as contacts need leave nothing to the step.

        Compliant rows take the mean force over their way in the middle of a substep, a method of second order.
        """
        if settings.rows == "rigid":
            return 1.0
        return None if settings.substeps is None else order_of_contacts(scene, lagging=False)

    def passes(self, steps: int, settings: Mapping[str, Any], counters: Mapping[str, float]) -> float:
        """See `Engine.passes`: the sweeps that were made."""
        if settings["rows"] == "rigid":
            kinds = ("velocity", "stabilization", "position")
            return steps * sum(counters.get(f"{kind} sweeps per step", 0.0) for kind in kinds)
        return steps * counters.get("mean substeps of a step", 1.0) * float(settings["velocity_sweeps"])

    def estimate(self, scene: Scene, settings: PecletSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        if settings.rows == "compliant":
            steps *= settings.substeps or self._usual_substeps(scene, settings.dt)
        rate = PARTICLE_STEPS_PER_SECOND[settings.rows] * settings.threads
        return 10 + steps * max(len(scene.bodies), 100) / rate

    def _usual_substeps(self, scene: Scene, dt: float) -> float:
        """About as many substeps as a step of `dt` [s] will have."""
        from dembench.solver.impulse.compliant_substeps import USUAL
        from dembench.solver.loads import meetings

        speed = USUAL_SPEED * math.sqrt(math.hypot(*scene.gravity) * 2 * min(scene.extreme_radii()))
        speed = speed or float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
        contact = min((kind.contact_time(speed) for kind in meetings(scene)), default=math.inf)
        return max(1.0, dt * math.pi / (USUAL * contact))

    def forceable(self, scene: Scene, settings: PecletSettings) -> list[str]:
        """See `Engine.forceable`; impulses know no rolling friction."""
        return [name for name in super().forceable(scene, settings) if name != "rolling_friction"]

    def simulation(self, scene: Scene, settings: dict[str, Any]) -> Any:
        """See `InTree.simulation`."""
        from dembench.solver import Simulation

        s = PecletSettings(**settings)
        return Simulation(
            scene,
            s.dt,
            s.threads,
            precision=s.arithmetic,
            method="impulse",
            rows=s.rows,
            substeps=s.substeps,
            velocity_sweeps=s.velocity_sweeps,
            position_sweeps=s.position_sweeps,
            stabilization=s.stabilization,
            force=names_of(s.force),
        )

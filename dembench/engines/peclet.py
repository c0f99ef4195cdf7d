"""peclet: the in-tree impulse solver as an engine."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from dembench.engines.base import Division, Engine, EngineSettings, Phase, Probe, Series
from dembench.engines.in_tree import probe_solver, read_series, write_deck
from dembench.scene import Rigid, Scene

PARTICLE_STEPS_PER_SECOND = 5e5
"""Throughput of one core on which run-time estimates are based."""


class PecletSettings(EngineSettings):
    """Settings of a peclet run.

    Attributes:
        rows: Kind of contact rows; `rigid`: no stiffness, Newton restitution, Coulomb friction.
        velocity_sweeps, position_sweeps: Largest number of sweeps of each kind per step.
        arithmetic: Precision of impulses; positions and velocities are float64 always.
    """

    rows: Literal["rigid"] = "rigid"
    velocity_sweeps: Annotated[int, Field(ge=1)] = 8
    position_sweeps: Annotated[int, Field(ge=0)] = 12
    arithmetic: Literal["float32", "float64"] = "float32"

    def precision(self) -> str:
        """See `EngineSettings.precision`."""
        return "float64" if self.arithmetic == "float64" else "float64 positions, float32 impulses"


class Peclet(Engine):
    """Rigid spheres by velocity-level impulses on NVIDIA Warp."""

    name: ClassVar[str] = "peclet"
    title: ClassVar[str] = "peclet, impulses (rigid contacts)"
    colour: ClassVar[str] = "#2a78d6"
    settings_type: ClassVar[type[EngineSettings]] = PecletSettings

    def probe(self) -> Probe:
        """See `Engine.probe`."""
        return probe_solver()

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        from dembench.solver.impulse.stepper import unsupported

        return unsupported(scene)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """In both divisions a body moves at most d/8 in a step, d the smallest diameter; dt <= 0.007 sqrt(d/g)."""
        diameter = 2 * float(scene.radii().min())
        limits = [scene.duration]
        speed = float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
        if speed:
            limits.append(0.125 * diameter / speed)
        gravity = math.hypot(*scene.gravity)
        if gravity:
            limits.append(0.007 * math.sqrt(diameter / gravity))
        return {"dt": min(limits)}

    def write(self, scene: Scene, settings: PecletSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`."""
        return write_deck(self.name, scene, settings, directory)

    def read(self, scene: Scene, settings: PecletSettings, directory: Path) -> Series:
        """See `Engine.read`."""
        return read_series(scene, settings, directory)

    def law(self, scene: Scene) -> str:
        """See `Engine.law`."""
        return "" if isinstance(scene.law, Rigid) else "rigid contacts with Newton restitution and Coulomb friction"

    def estimate(self, scene: Scene, settings: PecletSettings) -> float:
        """See `Engine.estimate`."""
        return 10 + scene.duration / settings.dt * max(len(scene.bodies), 100) / PARTICLE_STEPS_PER_SECOND

    def simulation(self, scene: Scene, settings: dict[str, Any]) -> Any:
        """The simulation that the child process steps."""
        from dembench.solver import Simulation

        s = PecletSettings(**settings)
        return Simulation(
            scene,
            s.dt,
            precision=s.arithmetic,
            method="impulse",
            velocity_sweeps=s.velocity_sweeps,
            position_sweeps=s.position_sweeps,
        )

"""A stand-in case for tests: grains in free flight, with a parameter that they feel and one that they do not."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from dembench.cases.base import Case, Curve, Preset, Quantity, Recorded, Reference
from dembench.initial.progress import Progress
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Species, Trajectory
from dembench.scene.base import Model


class FlightParameters(Model):
    gravity: float = 9.81
    friction: float = 0.3
    medium: str = "air"


class Flight(Case):
    """What flies free touches nothing: the fall answers to gravity, and friction is dead."""

    name: ClassVar[str] = "flight"
    title: ClassVar[str] = "Free flight"
    source: ClassVar[str] = "none"
    parameters: ClassVar[type[Model]] = FlightParameters

    def check(self, parameters: Any, preset: Preset, initial: Path | None = None) -> None: ...

    def scene(
        self,
        parameters: FlightParameters,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        return Scene(
            name=f"flight_{parameters.medium}",
            materials=(Material(name="glass", density=2500, young=1e7, poisson=0.25),),
            pair_laws=(PairLaw(a="glass", b="glass", restitution=0.8, friction=parameters.friction),),
            species=(Species(name="grain", material="glass", radius=0.002),),
            bodies=Bodies(position=[[0, 0, 0.1 + 1e-4 * seed]], velocity=[[0, 0, -1e-3 * seed]]),
            domain=Domain(lower=(-1, -1, -1), upper=(1, 1, 1)),
            gravity=(0, 0, -parameters.gravity),
            duration=0.01,
            time_step=1e-5,
            observables=(Trajectory(name="grain", body=0, interval=1e-3, track_interval=1e-3),),
        )

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        return [Quantity("fall", "Fall", float(result.observables["grain_displacement"].value[-1]), "m")]

    def references(self, scene: Scene, parameters: Any, preset: Preset) -> list[Reference]:
        return []

    def reference_curves(self, scene: Scene, parameters: Any, preset: Preset) -> list[Curve]:
        return []

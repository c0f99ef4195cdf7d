"""peclet-hertz: the in-tree soft-sphere solver as an engine."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from dembench.engines.base import Division, EngineSettings, Forced, names_of, order_of_contacts
from dembench.engines.in_tree import InTree
from dembench.scene import Scene


class PecletHertzSettings(EngineSettings):
    """Settings of a peclet-hertz run.

    Attributes:
        threads: Threads that share a step.
        arithmetic: Precision of differences, forces and spins; positions and velocities are float64 always.
        midpoint: Dashpots use the mean velocity of the step, which allows a larger step.
        allow_unstable: Accept a step beyond the stability guard.
        softening: Softer materials within the overlap budget; another law, which the report marks.
        force: Features that the scene lacks and that are computed all the same, as friction+rotation.
    """

    threads: Annotated[int, Field(ge=1)] = 1
    arithmetic: Literal["float32", "float64"] = "float32"
    midpoint: bool = False
    allow_unstable: bool = False
    softening: bool = False
    force: Forced = None

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.threads

    def precision(self) -> str:
        """See `EngineSettings.precision`."""
        return "float64" if self.arithmetic == "float64" else "float64 positions, float32 forces"


class PecletHertz(InTree):
    """Hertz-Mindlin soft spheres on NVIDIA Warp."""

    name: ClassVar[str] = "peclet-hertz"
    title: ClassVar[str] = "peclet, soft spheres (Hertz-Mindlin)"
    colour: ClassVar[str] = "#008300"
    settings_type: ClassVar[type[EngineSettings]] = PecletHertzSettings

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        from dembench.solver.soft import unsupported

        return unsupported(scene)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """Closed: the scene's step. Open: the automatic step with midpoint dashpots."""
        if division == "closed":
            return {"dt": scene.closed_step()}
        from dembench.solver.timestep import choose_step

        return {"dt": choose_step(scene).step, "midpoint": True}

    def settings(self, scene: Scene, division: Division, overrides: dict[str, str] | None = None) -> Any:
        """See `Engine.settings`; in the open division softer materials have the automatic step of their own."""
        made = super().settings(scene, division, overrides)
        if not made.softening or division == "closed" or "dt" in (overrides or {}):
            return made
        from dembench.solver.softening import softening_of
        from dembench.solver.timestep import choose_step

        return made.model_copy(update={"dt": choose_step(softening_of(scene).apply(scene), made.midpoint).step})

    def law(self, scene: Scene, settings: PecletHertzSettings) -> str:
        """See `Engine.law`."""
        if not settings.softening:
            return ""
        from dembench.solver.softening import softening_of

        return softening_of(scene).text()

    def order(self, scene: Scene, settings: PecletHertzSettings) -> float:
        """See `Engine.order`."""
        return order_of_contacts(scene, lagging=not settings.midpoint)

    def estimate(self, scene: Scene, settings: PecletHertzSettings) -> float:
        """See `Engine.estimate`."""
        from dembench.solver.timestep import seconds_of

        return 10 + seconds_of(scene, settings.dt) / settings.threads

    def simulation(self, scene: Scene, settings: dict[str, Any]) -> Any:
        """See `InTree.simulation`."""
        from dembench.solver import Simulation

        s = PecletHertzSettings(**settings)
        return Simulation(
            scene,
            s.dt,
            s.threads,
            s.arithmetic,
            s.midpoint,
            s.allow_unstable,
            softening=s.softening,
            force=names_of(s.force),
        )

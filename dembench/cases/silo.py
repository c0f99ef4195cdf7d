"""Case 1 of Dosta et al. 2024: a silo empties through its orifice. All its numbers are in `data/published/`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from dembench.cases import silo_scores, silo_views
from dembench.cases.base import Case, CaseError, Curve, Preset, Quantity, Ratio, Recorded, Reference, Statistics
from dembench.cases.initial_states import FACETS, bed, check_walls, given_coordinates, given_file, given_walls
from dembench.cases.publication import SOURCE, ContactParameters, contacts, moved, published, softened
from dembench.cases.published_results import PublishedResult
from dembench.cases.views import CaseFigure, Picture
from dembench.initial.filling import SOFT, TALL, Filling, Layer
from dembench.initial.progress import Progress
from dembench.initial.published import read_centres
from dembench.scene import (
    Bodies,
    Count,
    Cylinder,
    Domain,
    Energy,
    Frustum,
    Mesh,
    Overlap,
    Plane,
    Region,
    Scene,
    Sink,
    Snapshot,
    Species,
    WallForce,
)
from dembench.scene.base import Model
from dembench.scene.walls import WallShape

INTERVAL = 0.1
DRAIN = 0.02
"""Depth below the lip from which grains are taken away [m]; as in one of the published codes."""
FALL = 0.5
"""Depth of the domain below the lip [m]: no grain falls so far between two records."""


class SiloParameters(ContactParameters):
    """Parameters of the case; see `ContactParameters` for those of the contacts.

    Attributes:
        orifice: Which of the two published orifices.
        material: Material of the grains.
        walls: `exact`: cylinder and frustum; `mesh`: the published triangles, from the initial state's directory.
    """

    orifice: Literal["large", "small"] = "large"
    material: Literal["M1", "M2"] = "M1"
    walls: Literal["exact", "mesh"] = "exact"


class Silo(Case):
    """Silo emptying."""

    name: ClassVar[str] = "case1"
    title: ClassVar[str] = "Silo emptying: grains flow through the orifice of a cone"
    source: ClassVar[str] = SOURCE
    parameters: ClassVar[type[Model]] = SiloParameters

    def check(self, parameters: SiloParameters, preset: Preset, initial: Path | None = None) -> None:
        """See `Case.check`."""
        super().check(parameters, preset, initial)
        check_walls(self.name, parameters.walls, _orifice(parameters)["walls"], preset, initial)

    def scene(
        self,
        parameters: SiloParameters,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        """See `Case.scene`. Every seed starts from the same fill, moved at random by the jitter."""
        self.check(parameters, preset, initial)
        numbers = published("silo")[preset]
        fill, state = self._fill(parameters, preset, initial, progress)
        position = moved(fill, seed, parameters.jitter)
        lip = _orifice(parameters)["lip"]
        top = lip + _orifice(parameters)["cone"] + published("silo")["barrel"]["length"]
        radius = published("silo")["barrel"]["radius"]
        materials, laws = contacts((parameters.material,), parameters, numbers.get("young_factor", 1.0))
        walls = _walls(parameters, initial)
        step = numbers.get("time_step")
        margin = 0.02
        return Scene(
            name=f"{self.name}_{parameters.orifice}_{parameters.material}_{state}",
            materials=materials,
            pair_laws=laws,
            species=(Species(name="grain", material=parameters.material, radius=numbers["grain_radius"]),),
            walls=walls,
            bodies=Bodies(position=position),
            domain=Domain(
                lower=(-radius - margin, -radius - margin, lip - FALL),
                upper=(radius + margin, radius + margin, max(top, float(position[:, 2].max()) + margin)),
            ),
            duration=numbers["duration"],
            time_step=step[parameters.material] if step else None,
            rayleigh_fraction=numbers.get("rayleigh_fraction", 0.1),
            sinks=(Sink(name="outlet", region=Region(upper=(None, None, lip - DRAIN))),),
            observables=(
                Count(name="inside", interval=INTERVAL, region=Region(lower=(None, None, lip))),
                *(WallForce(name=f"{wall.name}_force", wall=wall.name, interval=INTERVAL) for wall in walls),
                Energy(name="energy", interval=INTERVAL),
                Overlap(name="overlap", interval=INTERVAL),
                Snapshot(name="flow", times=(numbers["snapshot"],)),
            ),
        )

    def _fill(
        self, parameters: SiloParameters, preset: Preset, initial: Path | None, progress: Progress | None
    ) -> tuple[np.ndarray, str]:
        """Grain centres [m], shape (n, 3), and the state's part of the scene's name."""
        plan = self.filling(parameters, preset)
        if preset == "quick":
            return bed(self.bed_name(parameters), plan, progress), "quick"
        path = given_file(initial, f"silo {parameters.orifice} {parameters.material}", parameters.walls == "mesh")
        if path is None:
            return bed(None, plan, progress), "filled"
        numbers = published("silo")["published"]
        coordinates = given_coordinates(lambda: read_centres(path, numbers["grain_radius"]))
        if len(coordinates.position) != numbers["grains"]:
            raise CaseError(f"{path}: {len(coordinates.position)} grains; {self.name} has {numbers['grains']}")
        return coordinates.position, "given"  # no digest of the published fills is known

    def filling(self, parameters: SiloParameters, preset: Preset) -> Filling:
        """How the silo is filled: on an outlet that is closed at the lip, with the published contacts.

        For the published triangles it is filled in round walls that clear them. The quick preset has one fill for
        both materials and both kinds of walls.
        """
        numbers, orifice = published("silo")[preset], _orifice(parameters)
        material = "M1" if preset == "quick" else parameters.material
        inset = FACETS if parameters.walls == "mesh" and preset == "published" else 0.0
        materials, laws = contacts((material,), ContactParameters(), numbers.get("young_factor", 1.0))
        outlet = Plane(name="outlet", material="steel", point=(0, 0, orifice["lip"]), normal=(0, 0, 1))
        return Filling(
            materials=materials,
            pair_laws=laws,
            species=(Species(name="grain", material=material, radius=numbers["grain_radius"]),),
            walls=(*exact_walls(parameters.orifice, inset), outlet),
            layers=(Layer(species="grain", count=numbers["grains"]),),
            protocol=SOFT if preset == "quick" else TALL,
        )

    def bed_name(self, parameters: SiloParameters) -> str:
        """See `Case.bed_name`."""
        return f"{self.name}-{parameters.orifice}"

    def softening(self, parameters: SiloParameters, preset: Preset) -> str:
        """See `Case.softening`."""
        return softened(published("silo")[preset].get("young_factor", 1.0))

    def ratios(self) -> tuple[Ratio, ...]:
        """See `Case.ratios`."""
        return silo_scores.ratios()

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        """See `Case.quantities`."""
        return silo_scores.quantities(scene, result)

    def references(self, scene: Scene, parameters: SiloParameters, preset: Preset) -> list[Reference]:
        """See `Case.references`; changed contacts have none but the necessary ones."""
        return silo_scores.references(scene, parameters, preset)

    def statistics(self) -> Statistics:
        """See `Case.statistics`."""
        return Statistics(curve="inside", numbers={"discharge_rate": "rate"})

    def reference_curves(self, scene: Scene, parameters: SiloParameters, preset: Preset) -> list[Curve]:
        """See `Case.reference_curves`."""
        return silo_scores.curves(scene, parameters, preset)

    def figures(self, scene: Scene) -> list[CaseFigure]:
        """See `Case.figures`."""
        return silo_views.figures(scene)

    def pictures(self, scene: Scene) -> list[Picture]:
        """See `Case.pictures`."""
        return silo_views.pictures(scene)

    def published_results(self, parameters: SiloParameters, preset: Preset) -> list[PublishedResult]:
        """See `Case.published_results`; none where the contacts are not the published ones."""
        return (
            []
            if preset == "quick" or parameters.changed()
            else silo_views.published_results(parameters.orifice, parameters.material)
        )


def _walls(parameters: SiloParameters, initial: Path | None) -> tuple[WallShape, ...]:
    if parameters.walls == "exact":
        return exact_walls(parameters.orifice)
    assert initial is not None, "checked before"
    name = f"{parameters.orifice} silo walls"
    return (Mesh(name="silo", material="steel", triangles=given_walls(initial, name)),)


def exact_walls(orifice: str, inset: float = 0.0) -> tuple[Cylinder, Frustum]:
    """Barrel and cone with the given orifice, open at the top and at the lip; all radii are less by `inset` [m]."""
    numbers = published("silo")
    own, barrel = numbers["orifices"][orifice], numbers["barrel"]
    lip, edge = own["lip"], own["lip"] + own["cone"]
    return (
        Cylinder(
            name="barrel",
            material="steel",
            start=(0, 0, edge),
            end=(0, 0, edge + barrel["length"]),
            radius=barrel["radius"] - inset,
        ),
        Frustum(
            name="cone",
            material="steel",
            start=(0, 0, lip),
            end=(0, 0, edge),
            radius_start=own["radius"] - inset,
            radius_end=barrel["radius"] - inset,
        ),
    )


def _orifice(parameters: SiloParameters) -> dict[str, Any]:
    found: dict[str, Any] = published("silo")["orifices"][parameters.orifice]
    return found

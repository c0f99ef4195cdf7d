"""Case 2 of Dosta et al. 2024: a drum mixes two kinds of grains. All its numbers are in `data/published/`."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from dembench.cases import drum_scores, drum_views
from dembench.cases.base import Case, CaseError, Curve, Preset, Quantity, Recorded, Reference, Statistics
from dembench.cases.initial_states import (
    FACETS,
    bed,
    check_walls,
    given_coordinates,
    given_file,
    given_walls,
    positions_digest,
)
from dembench.cases.publication import SOURCE, ContactParameters, contacts, moved, published, softened
from dembench.cases.published_results import PublishedResult
from dembench.cases.views import CaseFigure, Picture
from dembench.initial.filling import SOFT, TALL, Filling, Layer
from dembench.initial.progress import Progress
from dembench.initial.published import read_coordinates
from dembench.scene import (
    Bodies,
    CentreOfMass,
    Cylinder,
    Domain,
    Energy,
    Mesh,
    Motion,
    Overlap,
    Region,
    Scene,
    Snapshot,
    Species,
    ZoneCount,
)
from dembench.scene.base import Model
from dembench.scene.walls import WallShape

INTERVAL = 0.1
MARGIN = 0.005
ZONES = {"zone1": Region(lower=(0, None, 0)), "zone2": Region(upper=(0, None, 0))}
"""Zone 1: x > 0 and z > 0, where the wall carries the bed up; zone 2: x < 0 and z < 0."""


class DrumParameters(ContactParameters):
    """Parameters of the case; see `ContactParameters` for those of the contacts.

    Attributes:
        walls: `exact`: a closed cylinder; `mesh`: the published triangles, from the initial state's directory.
    """

    walls: Literal["exact", "mesh"] = "exact"


class Drum(Case):
    """Rotating drum."""

    name: ClassVar[str] = "case2"
    title: ClassVar[str] = "Rotating drum: two kinds of grains mix in layers"
    source: ClassVar[str] = SOURCE
    parameters: ClassVar[type[Model]] = DrumParameters

    def check(self, parameters: DrumParameters, preset: Preset, initial: Path | None = None) -> None:
        """See `Case.check`."""
        super().check(parameters, preset, initial)
        check_walls(self.name, parameters.walls, published("drum")["published"]["walls"], preset, initial)

    def scene(
        self,
        parameters: DrumParameters,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        """See `Case.scene`. M2 comes first; every seed starts from the same fill, moved at random by the jitter."""
        self.check(parameters, preset, initial)
        numbers, drum = published("drum")[preset], published("drum")["drum"]
        fill, state = self._fill(parameters, preset, initial, progress)
        position = moved(fill, seed, parameters.jitter)
        materials, laws = contacts(("M1", "M2"), parameters, numbers.get("young_factor", 1.0))
        counts = [s["count"] for s in numbers["species"].values()]
        half = (drum["radius"] + MARGIN, drum["half_depth"] + MARGIN, drum["radius"] + MARGIN)
        duration = numbers["duration"]
        return Scene(
            name=f"{self.name}_{state}",
            materials=materials,
            pair_laws=laws,
            species=_species(preset),
            walls=(_wall(parameters, initial),),
            bodies=Bodies(position=position, species=np.repeat(np.arange(len(counts)), counts).astype(np.int32)),
            domain=Domain(lower=tuple(-x for x in half), upper=half),
            duration=duration,
            time_step=numbers.get("time_step"),
            rayleigh_fraction=numbers.get("rayleigh_fraction", 0.1),
            observables=(
                ZoneCount(name="zones", interval=INTERVAL, zones=ZONES),
                CentreOfMass(name="centres", interval=INTERVAL),
                Energy(name="energy", interval=INTERVAL),
                Overlap(name="overlap", interval=INTERVAL),
                Snapshot(name="mixing", times=_times(duration, numbers["snapshots"])),
            ),
        )

    def _fill(
        self, parameters: DrumParameters, preset: Preset, initial: Path | None, progress: Progress | None
    ) -> tuple[np.ndarray, str]:
        """Grain centres [m], shape (n, 3), M2 first, and the state's part of the scene's name."""
        plan = self.filling(parameters, preset)
        if preset == "quick":
            return bed(self.bed_name(parameters), plan, progress), "quick"
        path = given_file(initial, "drum", parameters.walls == "mesh")
        if path is None:
            return bed(None, plan, progress), "filled"
        species = published("drum")["published"]["species"].values()
        radii, counts = [s["radius"] for s in species], [s["count"] for s in species]
        coordinates = given_coordinates(lambda: read_coordinates(path, radii))
        expected = np.repeat(radii, counts)
        if len(coordinates.radius) != len(expected) or (coordinates.radius != expected).any():
            text = ", then ".join(f"{n} of {r:g} m" for r, n in zip(radii, counts, strict=True))
            raise CaseError(f"{path}: these are not the grains of {self.name}; accepted are {text}")
        known = positions_digest(coordinates.position) == published("drum")["published"]["positions_sha256"]
        return coordinates.position, "published" if known else "given"

    def filling(self, parameters: DrumParameters, preset: Preset) -> Filling:
        """How the drum is filled: at rest, M2 first, with the published contacts; it clears the published triangles.

        The quick preset has one fill for both kinds of walls.
        """
        numbers = published("drum")[preset]
        materials, laws = contacts(("M1", "M2"), ContactParameters(), numbers.get("young_factor", 1.0))
        inset = FACETS if parameters.walls == "mesh" and preset == "published" else 0.0
        return Filling(
            materials=materials,
            pair_laws=laws,
            species=_species(preset),
            walls=(exact_wall(inset).model_copy(update={"motion": None}),),
            layers=tuple(Layer(species=name, count=s["count"]) for name, s in numbers["species"].items()),
            protocol=SOFT if preset == "quick" else TALL,
        )

    def softening(self, parameters: DrumParameters, preset: Preset) -> str:
        """See `Case.softening`."""
        return softened(published("drum")[preset].get("young_factor", 1.0))

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        """See `Case.quantities`."""
        return drum_scores.quantities(scene, result)

    def references(self, scene: Scene, parameters: DrumParameters, preset: Preset) -> list[Reference]:
        """See `Case.references`; changed contacts have none but the necessary ones."""
        return drum_scores.references(scene, parameters, preset)

    def statistics(self) -> Statistics:
        """See `Case.statistics`."""
        return Statistics(
            curve="zones.zone2.M1", cycles=True, numbers={"first_period": "period", "amplitude": "amplitude"}
        )

    def reference_curves(self, scene: Scene, parameters: DrumParameters, preset: Preset) -> list[Curve]:
        """See `Case.reference_curves`."""
        return drum_scores.curves(scene, parameters, preset)

    def figures(self, scene: Scene) -> list[CaseFigure]:
        """See `Case.figures`."""
        return drum_views.figures(scene)

    def pictures(self, scene: Scene) -> list[Picture]:
        """See `Case.pictures`."""
        return drum_views.pictures(scene)

    def published_results(self, parameters: DrumParameters, preset: Preset) -> list[PublishedResult]:
        """See `Case.published_results`; none where the contacts are not the published ones."""
        return [] if preset == "quick" or parameters.changed() else drum_views.published_results()


def _species(preset: Preset) -> tuple[Species, ...]:
    found = published("drum")[preset]["species"]
    return tuple(Species(name=name, material=name, radius=s["radius"]) for name, s in found.items())


def _wall(parameters: DrumParameters, initial: Path | None) -> WallShape:
    wall = exact_wall()
    if parameters.walls == "exact":
        return wall
    assert initial is not None, "checked before"
    triangles = given_walls(initial, "drum walls")
    return Mesh(name=wall.name, material=wall.material, motion=wall.motion, triangles=triangles)


def exact_wall(inset: float = 0.0) -> Cylinder:
    """The drum with both end plates, turning as a whole; its radius is less by `inset` [m]."""
    drum = published("drum")["drum"]
    return Cylinder(
        name="drum",
        material="steel",
        start=(0, -drum["half_depth"], 0),
        end=(0, drum["half_depth"], 0),
        radius=drum["radius"] - inset,
        closed_start=True,
        closed_end=True,
        motion=Motion(angular_velocity=tuple(drum["angular_velocity"])),
    )


def _times(duration: float, interval: float) -> tuple[float, ...]:
    return tuple(float(t) for t in interval * np.arange(round(duration / interval) + 1))

"""Case 3 of Dosta et al. 2024: a steel ball hits a bed of grains in a box. All its numbers are in `data/`."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from dembench.cases import impact_scores, impact_views
from dembench.cases.base import Case, CaseError, Curve, Preset, Quantity, Recorded, Reference, Statistics
from dembench.cases.initial_states import bed, given_coordinates, given_file, positions_digest
from dembench.cases.publication import SOURCE, ContactParameters, contacts, moved, published
from dembench.cases.published_results import PublishedResult
from dembench.cases.views import Picture
from dembench.initial.filling import LOOSE, STACKED, Filling, Layer, Protocol
from dembench.initial.progress import Progress
from dembench.initial.published import read_coordinates
from dembench.initial.stacking import stacked
from dembench.scene import (
    Bodies,
    Box,
    Domain,
    ElasticEnergy,
    Energy,
    Overlap,
    Scene,
    Snapshot,
    Species,
    Trajectory,
)
from dembench.scene.base import Model

INTERVAL = 1e-3
TRACK_INTERVAL = 5e-5
QUICK_GRAIN_RADIUS = 0.002
QUICK_GRAINS = 3125
QUICK_DURATION = 0.06
QUICK_RAYLEIGH_FRACTION = 0.1
STACK = {"height_tolerance": 5e-3, "fraction_tolerance": 0.015}
"""What the 100k bed may differ from its targets by where it is the 50k bed twice [m], [-]."""
MARGIN = (0.006, 0.006, 0.01)
DOMAIN_TOP = 0.4


class ImpactParameters(ContactParameters):
    """Parameters of the case; see `ContactParameters` for those of the contacts.

    Attributes:
        bed: Number of grains of the published beds; the quick preset has one bed of its own.
    """

    bed: Literal["25k", "50k", "100k"] = "25k"


class Impact(Case):
    """Particle impact."""

    name: ClassVar[str] = "case3"
    title: ClassVar[str] = "Particle impact: a steel ball at 5 m/s hits a bed of grains"
    source: ClassVar[str] = SOURCE
    parameters: ClassVar[type[Model]] = ImpactParameters

    def check(self, parameters: ImpactParameters, preset: Preset, initial: Path | None = None) -> None:
        """See `Case.check`: the quick preset takes neither a bed nor an initial state."""
        super().check(parameters, preset, initial)
        if preset == "published":
            return
        given = sorted(parameters.model_fields_set & {"bed", "jitter"})
        if given:
            raise CaseError(
                f"{self.name}[{given[0]}={getattr(parameters, given[0])}]: the quick preset has one bed of its own, "
                f"{QUICK_GRAINS} grains of {2e3 * QUICK_GRAIN_RADIUS:g} mm; '{given[0]}' needs the preset published"
            )
        if initial is not None:
            raise CaseError(
                f"{self.name}: initial {initial} has grains of 2 mm, the quick preset has grains of "
                f"{2e3 * QUICK_GRAIN_RADIUS:g} mm and makes its own bed; an initial state needs the preset published"
            )

    def scene(
        self,
        parameters: ImpactParameters,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        """See `Case.scene`. The ball is the last body."""
        self.check(parameters, preset, initial)
        plan = self.filling(parameters, preset)
        if preset == "quick":
            shipped = self.bed_name(parameters) if seed == 0 else None
            grains, state = bed(shipped, plan, progress, seed), "quick"
        elif initial is None:
            grains, state = bed(None, plan, progress, seed), f"{parameters.bed}_generated"
        elif (half := _half_bed(parameters, initial)) is not None:
            start = stacked(half, published("impact")["published"]["grain_radius"])
            plan = plan.model_copy(update={"protocol": STACKED, **STACK})
            grains, state = bed(None, plan, progress, start=start), f"{parameters.bed}_stacked"
            grains = moved(grains, seed, parameters.jitter)
        else:
            grains, state = _given_bed(parameters, initial, seed)
        return _scene(f"{self.name}_{state}", grains, parameters, preset)

    def filling(self, parameters: ImpactParameters, preset: Preset) -> Filling:
        """How a bed is made, and what it should come out as."""
        materials, laws = contacts(("M1",), ContactParameters())
        numbers = published("impact")["beds"][parameters.bed] if preset == "published" else None
        radius = published("impact")["published"]["grain_radius"] if numbers else QUICK_GRAIN_RADIUS
        return Filling(
            materials=materials,
            pair_laws=laws,
            species=(Species(name="grain", material=materials[0].name, radius=radius),),
            walls=(_box(),),
            layers=(Layer(species="grain", count=numbers["grains"] if numbers else QUICK_GRAINS),),
            height=numbers["height"] if numbers else None,
            bulk_fraction=numbers["fraction"] if numbers else None,
            protocol=LOOSE if numbers and numbers["loose"] else Protocol(),
        )

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        """See `Case.quantities`."""
        return impact_scores.quantities(scene, result)

    def references(self, scene: Scene, parameters: ImpactParameters, preset: Preset) -> list[Reference]:
        """See `Case.references`; what holds depends on whether the bed is that of the published file."""
        return impact_scores.references(scene, published("impact"), parameters, preset)

    def statistics(self) -> Statistics:
        """See `Case.statistics`."""
        return Statistics(curve="ball_displacement", numbers={"deepest": "depth", "end_point": "depth"})

    def reference_curves(self, scene: Scene, parameters: ImpactParameters, preset: Preset) -> list[Curve]:
        """See `Case.reference_curves`."""
        return impact_scores.curves(scene, published("impact"), parameters, preset)

    def pictures(self, scene: Scene) -> list[Picture]:
        """See `Case.pictures`."""
        return impact_views.pictures(scene)

    def published_results(self, parameters: ImpactParameters, preset: Preset) -> list[PublishedResult]:
        """See `Case.published_results`; none where the contacts are not the published ones."""
        return [] if preset == "quick" or parameters.changed() else impact_views.published_results(parameters.bed)


def _box() -> Box:
    return Box(name="box", material="steel", open_faces=("z+",), **published("impact")["box"])


def _given_bed(parameters: ImpactParameters, initial: Path, seed: int) -> tuple[np.ndarray, str]:
    """Grain centres of a given file [m], shape (n, 3), and the state's part of the scene's name."""
    path = given_file(initial, f"impact {parameters.bed}")
    assert path is not None, "a file is given"
    found, numbers = _read_bed(path), published("impact")["beds"][parameters.bed]
    if len(found) != numbers["grains"]:
        raise CaseError(f"{path}: {len(found)} grains; case3[bed={parameters.bed}] has {numbers['grains']}")
    known = positions_digest(found) == numbers.get("positions_sha256")
    return moved(found, seed, parameters.jitter), f"{parameters.bed}_{'published' if known else 'given'}"


def _half_bed(parameters: ImpactParameters, initial: Path) -> np.ndarray | None:
    """Grain centres of the 50k bed [m], shape (n, 3), where it is given and the 100k bed that was asked for is not."""
    if parameters.bed != "100k" or given_file(initial, "impact 100k", optional=True) is not None:
        return None
    path = given_file(initial, "impact 50k", optional=True)
    return None if path is None else _read_bed(path)


def _read_bed(path: Path) -> np.ndarray:
    """Grain centres of a bed's file [m], shape (n, 3), without the ball."""
    numbers = published("impact")
    radii, ball = [numbers["published"]["grain_radius"]], numbers["ball"]["radius"]
    return given_coordinates(lambda: read_coordinates(path, radii, ball)).position


def _scene(name: str, grains: np.ndarray, parameters: ImpactParameters, preset: Preset) -> Scene:
    numbers = published("impact")
    materials, laws = contacts(("M1",), parameters)
    box, ball, settings = _box(), numbers["ball"], numbers["published"]
    quick = preset == "quick"
    duration = QUICK_DURATION if quick else settings["duration"]
    n = len(grains)
    velocity = np.zeros((n + 1, 3))
    velocity[n] = ball["velocity"]
    lower = tuple(x - m for x, m in zip(box.lower, MARGIN, strict=True))
    upper = (box.upper[0] + MARGIN[0], box.upper[1] + MARGIN[1], DOMAIN_TOP)
    return Scene(
        name=name,
        materials=materials,
        pair_laws=laws,
        species=(
            Species(name="grain", material="M1", radius=QUICK_GRAIN_RADIUS if quick else settings["grain_radius"]),
            Species(name="ball", material="steel", radius=ball["radius"]),
        ),
        walls=(box,),
        bodies=Bodies(
            position=np.vstack([grains, ball["position"]]),
            species=np.append(np.zeros(n, np.int32), 1),
            velocity=velocity,
        ),
        domain=Domain(lower=lower, upper=upper),
        duration=duration,
        time_step=None if quick else settings["time_step"],
        rayleigh_fraction=QUICK_RAYLEIGH_FRACTION,
        observables=(
            Trajectory(name="ball", body=n, interval=INTERVAL, track_interval=TRACK_INTERVAL),
            Energy(name="energy", interval=INTERVAL),
            ElasticEnergy(name="springs", interval=INTERVAL),
            Overlap(name="overlap", interval=INTERVAL),
            Snapshot(name="deepest", times=(numbers["beds"][parameters.bed]["deepest_near"],)),
            Snapshot(name="final", times=(duration,)),
        ),
    )

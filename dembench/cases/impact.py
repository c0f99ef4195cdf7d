"""Case 3 of Dosta et al. 2024: a steel ball hits a bed of grains in a box. All its numbers are in `data/`."""

from __future__ import annotations

import hashlib
import tomllib
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from dembench.cases import impact_scores
from dembench.cases.base import Case, CaseError, Curve, Preset, Quantity, Recorded, Reference
from dembench.cases.share import share
from dembench.initial.filling import LOOSE, Filling, Layer, PackingError, Protocol, filled
from dembench.initial.progress import Progress
from dembench.initial.published import find_file, read_coordinates
from dembench.initial.rows import CoordinatesError
from dembench.scene import (
    Bodies,
    Box,
    Domain,
    ElasticEnergy,
    Energy,
    Material,
    Overlap,
    PairLaw,
    Scene,
    Snapshot,
    Species,
    Trajectory,
)
from dembench.scene.base import Model, NotNegative

INTERVAL = 1e-3
TRACK_INTERVAL = 5e-5
QUICK_GRAIN_RADIUS = 0.002
QUICK_GRAINS = 3125
QUICK_DURATION = 0.06
QUICK_RAYLEIGH_FRACTION = 0.1
MARGIN = (0.006, 0.006, 0.01)
DOMAIN_TOP = 0.4


class ImpactParameters(Model):
    """Parameters of the case.

    Attributes:
        bed: Number of grains of the published beds; the quick preset has one bed of its own.
        jitter: Largest random displacement [m] of a grain of a given bed per axis, for seeds above 0. Seed 0 is the bed
            as it is; a generated bed differs by its seed anyway.
    """

    bed: Literal["25k", "50k", "100k"] = "25k"
    jitter: NotNegative = 1e-6


@cache
def published() -> dict[str, Any]:
    """The published numbers of the case."""
    return tomllib.loads(share("data", "dosta2024-impact.toml").read_text(encoding="utf-8"))


class Impact(Case):
    """Particle impact."""

    name: ClassVar[str] = "case3"
    title: ClassVar[str] = "Particle impact: a steel ball at 5 m/s hits a bed of grains"
    source: ClassVar[str] = "Dosta et al. 2024, Comput. Phys. Commun. 296, 109066, doi 10.1016/j.cpc.2023.109066"
    parameters: ClassVar[type[Model]] = ImpactParameters

    def check(self, parameters: ImpactParameters, preset: Preset, initial: Path | None = None) -> None:
        """See `Case.check`: the quick preset takes neither a bed nor an initial state."""
        if preset not in self.presets:
            raise CaseError(f"{self.name} has no preset '{preset}'; accepted are {', '.join(self.presets)}")
        if preset == "published":
            return
        given = sorted(parameters.model_fields_set)
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
        if preset == "quick":
            bed, state = _generated_bed(None, seed, progress), "quick"
        elif initial is None:
            bed, state = _generated_bed(parameters.bed, seed, progress), f"{parameters.bed}_generated"
        else:
            bed, state = _given_bed(parameters, initial, seed)
        return _scene(f"{self.name}_{state}", bed, preset)

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        """See `Case.quantities`."""
        return impact_scores.quantities(scene, result)

    def references(self, scene: Scene, parameters: ImpactParameters, preset: Preset) -> list[Reference]:
        """See `Case.references`; what holds depends on whether the bed is that of the published file."""
        bed = parameters.bed if preset == "published" else None
        return impact_scores.references(scene, published(), bed)

    def reference_curves(self, scene: Scene, parameters: ImpactParameters, preset: Preset) -> list[Curve]:
        """See `Case.reference_curves`."""
        bed = parameters.bed if preset == "published" else None
        return impact_scores.curves(scene, published(), bed)


def _materials() -> tuple[tuple[Material, ...], tuple[PairLaw, ...]]:
    return tuple(Material(**m) for m in published()["materials"]), tuple(PairLaw(**p) for p in published()["pair_laws"])


def _box() -> Box:
    return Box(name="box", material="steel", open_faces=("z+",), **published()["box"])


def _filling(bed: str | None) -> Filling:
    """What the bed is made of, and what it should come out as; None is the quick bed."""
    materials, laws = _materials()
    numbers = published()["beds"][bed] if bed else None
    radius = published()["published"]["grain_radius"] if numbers else QUICK_GRAIN_RADIUS
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


def _generated_bed(bed: str | None, seed: int, progress: Progress | None) -> np.ndarray:
    try:
        return filled(_filling(bed), seed, progress)
    except PackingError as error:
        raise CaseError(f"case3: {error}; another seed may do, or give the published bed as initial state") from None


def _given_bed(parameters: ImpactParameters, initial: Path, seed: int) -> tuple[np.ndarray, str]:
    """Grain centres of a given file [m], shape (n, 3), and the state's part of the scene's name."""
    numbers = published()["beds"][parameters.bed]
    try:
        path = find_file(initial, f"impact {parameters.bed}")
        coordinates = read_coordinates(path, [published()["published"]["grain_radius"]], published()["ball"]["radius"])
    except CoordinatesError as error:
        raise CaseError(str(error)) from None
    if len(coordinates.position) != numbers["grains"]:
        raise CaseError(
            f"{path}: {len(coordinates.position)} grains; case3[bed={parameters.bed}] has {numbers['grains']}"
        )
    known = positions_digest(coordinates.position) == numbers.get("positions_sha256")
    position = coordinates.position
    if seed:
        position = position + np.random.default_rng(seed).uniform(-parameters.jitter, parameters.jitter, position.shape)
    return position, f"{parameters.bed}_{'published' if known else 'given'}"


def positions_digest(position: np.ndarray) -> str:
    """SHA-256 of centres [m], shape (n, 3), as little-endian float64 in C order: by it a published bed is known."""
    return hashlib.sha256(np.ascontiguousarray(position, dtype="<f8").tobytes()).hexdigest()


def _scene(name: str, bed: np.ndarray, preset: Preset) -> Scene:
    numbers = published()
    materials, laws = _materials()
    box, ball, settings = _box(), numbers["ball"], numbers["published"]
    quick = preset == "quick"
    duration = QUICK_DURATION if quick else settings["duration"]
    n = len(bed)
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
            position=np.vstack([bed, ball["position"]]),
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
            Snapshot(name="final", times=(duration,)),
        ),
    )

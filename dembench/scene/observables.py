"""What is recorded: regions and observables, each with its sampling interval."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from dembench.scene.base import Finite, Model, Name, NotNegative, Positive


class Region(Model):
    """An axis-aligned region [m]; a missing bound is open.

    Attributes:
        lower, upper: Bounds per axis [m], None where the region is unbounded.
    """

    lower: tuple[Finite | None, Finite | None, Finite | None] = (None, None, None)
    upper: tuple[Finite | None, Finite | None, Finite | None] = (None, None, None)

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which points [m], shape (n, 3), lie strictly above the lower and at most at the upper bounds: (n,) bool."""
        inside = np.ones(len(points), dtype=bool)
        for axis in range(3):
            if (low := self.lower[axis]) is not None:
                inside &= points[:, axis] > low
            if (high := self.upper[axis]) is not None:
                inside &= points[:, axis] <= high
        return inside


class Sampled(Model):
    """An observable that is sampled at t = 0 and then every `interval` seconds [s]."""

    name: Name
    interval: Positive


class Count(Sampled):
    """Number of particle centres in a region [-]."""

    kind: Literal["count"] = "count"
    region: Region = Region()


class ZoneCount(Sampled):
    """Number of particle centres in each zone, by species where asked for [-]."""

    kind: Literal["zone-count"] = "zone-count"
    zones: dict[Name, Region]
    by_species: bool = True


class Trajectory(Sampled):
    """Position and velocity of one body, and the lowest vertical displacement since the last sample.

    Attributes:
        body: Index of the body in the initial state.
        track_interval: Interval of the finer record from which the minimum between samples is taken [s]; it must
            divide `interval`.
    """

    kind: Literal["trajectory"] = "trajectory"
    body: Annotated[int, Field(ge=0)]
    track_interval: Positive

    @model_validator(mode="after")
    def _divides(self) -> Trajectory:
        ratio = self.interval / self.track_interval
        if abs(ratio - round(ratio)) > 1e-9 * ratio or round(ratio) < 1:
            raise ValueError(f"track_interval {self.track_interval:g} s must divide interval {self.interval:g} s")
        return self


class CentreOfMass(Sampled):
    """Centre of mass of each species [m]."""

    kind: Literal["centre-of-mass"] = "centre-of-mass"


class Energy(Sampled):
    """Translational and rotational kinetic energy and potential energy in the gravity field [J]."""

    kind: Literal["energy"] = "energy"


class ElasticEnergy(Sampled):
    """Energy of the normal springs that the law puts between bodies and at walls, from the overlaps [J]."""

    kind: Literal["elastic-energy"] = "elastic-energy"


class Overlap(Sampled):
    """Largest overlap of any two particles [m]."""

    kind: Literal["overlap"] = "overlap"


class WallForce(Sampled):
    """Total contact force on one wall [N]."""

    kind: Literal["wall-force"] = "wall-force"
    wall: Name


class Snapshot(Model):
    """Positions, velocities and angular velocities of all particles at given times [s]."""

    kind: Literal["snapshot"] = "snapshot"
    name: Name
    times: Annotated[tuple[NotNegative, ...], Field(min_length=1)]


Observable = Annotated[
    Count | ZoneCount | Trajectory | CentreOfMass | Energy | ElasticEnergy | Overlap | WallForce | Snapshot,
    Field(discriminator="kind"),
]

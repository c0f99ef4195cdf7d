"""Many collisions in one scene: spheres shot at the floor and at each other, and what became of each of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.scene import PairLaw, Scene
from dembench.scene.materials import Law
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.scenes import MOTION, Body, Kind, every, floor, scene_of

LEAD = 3.37
"""Steps before the first touch, so that it falls between two steps."""
SPACING, HEIGHT = 6.0, 12.0
"""Distance of neighbouring collisions, and height of those of two spheres above the floor, in largest radii."""


@dataclass(frozen=True)
class Shot:
    """One collision, with the floor or of two spheres above each other; z is the normal, x the tangent.

    Attributes:
        kind: Kind of the sphere that comes from above.
        speed: Normal speed of approach [m/s].
        along: Its velocity along x relative to what it meets [m/s].
        spin: Its spin [rad/s]; a positive one adds to the slip that `along` makes.
        partner: Kind of the sphere that it meets; empty for the floor.
        partner_spin: Spin of that sphere, also positive where it adds to the slip [rad/s].
        resting: Whether the partner is at rest before; otherwise both have half of the speeds.
    """

    kind: str
    speed: float
    along: float = 0.0
    spin: float = 0.0
    partner: str = ""
    partner_spin: float = 0.0
    resting: bool = False

    def contact(self, kinds: Mapping[str, Kind]) -> Contact:
        """The contact with the floor or of the two spheres."""
        kind = kinds[self.kind]
        return Contact.between(kind, kinds[self.partner]) if self.partner else Contact.with_wall(kind)

    def slip(self, kinds: Mapping[str, Kind]) -> float:
        """Speed at which the surfaces slide over each other [m/s]."""
        other = kinds[self.partner].radius * self.partner_spin if self.partner else 0.0
        return self.along + kinds[self.kind].radius * self.spin + other


@dataclass(frozen=True)
class Outcome:
    """What became of a shot.

    Attributes:
        rebound: Normal speed of parting [m/s].
        along: Relative velocity along x [m/s].
        spin, partner_spin: Spins, in the sense of the shot's [rad/s].
        overlap: Largest overlap [m].
        force: Largest normal force [N].
        duration: From the first touch to the parting [s].
        energy: Kinetic energy after over that before [-].
    """

    rebound: float
    along: float
    spin: float
    partner_spin: float
    overlap: float
    force: float
    duration: float
    energy: float


@dataclass(frozen=True)
class Volley:
    """Shots of one scene.

    Attributes:
        name: Name of the scene.
        kinds: Kinds of spheres by name.
        shots: The shots, in the order of the bodies.
        time_step, duration: [s].
        between: Pair laws of two kinds that meet.
        law: Contact law; None takes Hertz-Mindlin.
    """

    name: str
    kinds: Mapping[str, Kind]
    shots: tuple[Shot, ...]
    time_step: float
    duration: float
    between: tuple[PairLaw, ...] = ()
    law: Law | None = None

    def scene(self) -> Scene:
        """The scene; every step is recorded."""
        return scene_of(
            self.name,
            self.kinds,
            self.bodies(),
            time_step=self.time_step,
            times=every(self.time_step, self.duration),
            walls=(floor(),),
            between=self.between,
            law=self.law,
        )

    def seen(self, result: Result) -> list[tuple[Shot, Outcome]]:
        """Every shot with what became of it."""
        return list(zip(self.shots, self.outcomes(result), strict=True))

    def bodies(self) -> list[Body]:
        """The spheres, of two that meet the upper one first."""
        largest = max(kind.radius for kind in self.kinds.values())
        found = []
        for k, shot in enumerate(self.shots):
            own, y, gap = self.kinds[shot.kind], SPACING * largest * k, shot.speed * LEAD * self.time_step
            other = self.kinds[shot.partner] if shot.partner else None
            share = 0.5 if other and not shot.resting else 1.0
            low = 0.0 if other is None else HEIGHT * largest + other.radius
            velocity = (share * shot.along, 0, -share * shot.speed)
            found.append(Body(shot.kind, (0, y, low + gap + own.radius), velocity, (0, -shot.spin, 0)))
            if other is not None:
                back = tuple((share - 1) * v for v in (shot.along, 0, -shot.speed))
                # the line of centres is vertical in the middle of the contact
                ahead = shot.along * (LEAD * self.time_step + 0.5 * shot.contact(self.kinds).duration(shot.speed))
                centre = (ahead, y, HEIGHT * largest)
                found.append(Body(shot.partner, centre, back, (0, -shot.partner_spin, 0)))
        return found

    def outcomes(self, result: Result) -> list[Outcome]:
        """What became of every shot."""
        seen = result.snapshots[MOTION]
        masses, moments = result.scene.masses(), result.scene.moments()[:, 0]
        found, body = [], 0
        for shot in self.shots:
            n = 2 if shot.partner else 1
            found.append(self._outcome(shot, seen, slice(body, body + n), masses, moments))
            body += n
        return found

    def _outcome(
        self, shot: Shot, seen: SnapshotSeries, own: slice, masses: np.ndarray, moments: np.ndarray
    ) -> Outcome:
        x, v, w = seen.position[:, own], seen.velocity[:, own], seen.angular_velocity[:, own]
        radius, mass = self.kinds[shot.kind].radius, masses[own]
        if shot.partner:
            radius += self.kinds[shot.partner].radius
            offset, velocity, mass_r = x[:, 0] - x[:, 1], v[:, 0] - v[:, 1], mass[0] * mass[1] / mass.sum()
        else:
            offset, velocity, mass_r = x[:, 0], v[:, 0], mass[0]
        overlap = radius - (np.linalg.norm(offset, axis=1) if shot.partner else offset[:, 2])
        rebound = velocity[-1, 2]
        energy = 0.5 * (mass * (v**2).sum(axis=2) + moments[own] * (w**2).sum(axis=2)).sum(axis=1)
        force = mass_r * np.gradient(velocity[:, 2], seen.time)
        return Outcome(
            rebound=rebound,
            along=velocity[-1, 0],
            spin=-w[-1, 0, 1],
            partner_spin=-w[-1, 1, 1] if shot.partner else 0.0,
            overlap=peak(overlap),
            force=peak(force),
            duration=seen.time[-1] + overlap[-1] / rebound - LEAD * self.time_step if rebound > 0 else np.nan,
            energy=energy[-1] / energy[0],
        )


def peak(values: np.ndarray) -> float:
    """Maximum of the parabola through the largest value of a series and its neighbours."""
    k = int(np.clip(np.argmax(values), 1, len(values) - 2))
    before, top, after = values[k - 1 : k + 2]
    bend = before - 2 * top + after
    return float(top - (after - before) ** 2 / (8 * bend) if bend < 0 else max(before, top, after))


def angles(kind: str, speed: float, degrees: Sequence[float]) -> tuple[Shot, ...]:
    """Shots of one speed [m/s] at the floor under several angles to its normal [degrees]."""
    tilt = np.radians(degrees)
    return tuple(Shot(kind, float(speed * np.cos(a)), float(speed * np.sin(a))) for a in tilt)

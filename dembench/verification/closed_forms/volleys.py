"""Many collisions in one scene: spheres shot at the floor and at each other, and what became of each of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dembench.results import Result
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
        """Every shot with what became of it.

        Of two spheres both are measured from the line of centres where these are closest: in the middle of a soft
        contact, at the touch of a rigid one, which turn as far apart as the spheres slide past each other meanwhile.
        """
        return [(self._shot(*one), self._outcome(*one)) for one in self._flights(result)]

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
        return [outcome for _, outcome in self.seen(result)]

    def _flights(self, result: Result) -> Iterator[tuple[Shot, _Flight]]:
        seen, body = result.snapshots[MOTION], 0
        masses, moments = result.scene.masses(), result.scene.moments()[:, 0]
        for shot in self.shots:
            own = slice(body, body + (2 if shot.partner else 1))
            x, v, w = seen.position[:, own], seen.velocity[:, own], seen.angular_velocity[:, own]
            mass, radius, normal = masses[own], self.kinds[shot.kind].radius, np.array([0.0, 0, 1])
            offset, velocity, mass_r = x[:, 0], v[:, 0], mass[0]
            if shot.partner:
                radius += self.kinds[shot.partner].radius
                offset, velocity, mass_r = offset - x[:, 1], velocity - v[:, 1], mass[0] * mass[1] / mass.sum()
                closest = offset[np.argmin(np.linalg.norm(offset, axis=1))]
                normal = closest / np.linalg.norm(closest)
            overlap = radius - (np.linalg.norm(offset, axis=1) if shot.partner else offset[:, 2])
            energy = 0.5 * (mass * (v**2).sum(axis=2) + moments[own] * (w**2).sum(axis=2)).sum(axis=1)
            along = velocity @ (normal[2], 0, -normal[0])
            yield shot, _Flight(seen.time, overlap, velocity @ normal, along, -w[:, :, 1], mass_r, energy)
            body += len(mass)

    def _shot(self, shot: Shot, flight: _Flight) -> Shot:
        """A shot as it met its partner."""
        return replace(shot, speed=-flight.normal[0], along=flight.along[0]) if shot.partner else shot

    def _outcome(self, shot: Shot, flight: _Flight) -> Outcome:
        rebound = flight.normal[-1]
        return Outcome(
            rebound=rebound,
            along=flight.along[-1],
            spin=flight.spins[-1, 0],
            partner_spin=flight.spins[-1, 1] if shot.partner else 0.0,
            overlap=peak(flight.overlap),
            force=peak(flight.mass * np.gradient(flight.normal, flight.time)),
            duration=flight.time[-1] + flight.overlap[-1] / rebound - LEAD * self.time_step if rebound > 0 else np.nan,
            energy=flight.energy[-1] / flight.energy[0],
        )


@dataclass(frozen=True)
class _Flight:
    """A collision over time.

    Attributes:
        time: [s], shape (t,).
        overlap: Distance by which surfaces overlap [m], shape (t,).
        normal, along: Relative velocity along the normal, positive in parting, and along the tangent [m/s], shape (t,).
        spins: In the sense of the shot's [rad/s], shape (t, bodies).
        mass: Reduced mass [kg].
        energy: Kinetic energy [J], shape (t,).
    """

    time: np.ndarray
    overlap: np.ndarray
    normal: np.ndarray
    along: np.ndarray
    spins: np.ndarray
    mass: float
    energy: np.ndarray


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

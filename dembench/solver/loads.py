"""What the contacts of a scene must be expected to bear: speeds, overlaps, contact times and stiffnesses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dembench.scene import LinearSpring, Scene
from dembench.scene.overlap import largest_overlap
from dembench.solver.laws import Elastic

SOLID_FRACTION = 0.6
"""Share of a bed that is solid, for its weight."""
NEIGHBOURS = 12
"""Most spheres that can touch one of their size."""
CANDIDATES = 256
"""How many of the highest and of the fastest bodies are followed down to where they would land."""


@dataclass(frozen=True)
class Meeting:
    """The lightest body of a species and what it can touch: the lightest body of a species, or a wall.

    Attributes:
        species: Index of the species.
        body, reduced: Mass of the body and reduced mass of the two [kg].
        radius, reduced_radius: Radius of the body and reduced radius of the two [m].
        contacts: Most contacts of this kind that the body can have at a time.
        elastic: Moduli and damping ratio of the pair.
        friction: Whether the two resist sliding.
        spring: The scene's law where it is linear.
    """

    species: int
    body: float
    reduced: float
    radius: float
    reduced_radius: float
    contacts: float
    elastic: Elastic
    friction: bool
    spring: LinearSpring | None

    @property
    def hertz(self) -> float:
        """Force per overlap^(3/2) of Hertz's law, 4/3 E* sqrt(R*) [N/m^1.5]."""
        return 4 / 3 * self.elastic.young * math.sqrt(self.reduced_radius)

    def impact_overlap(self, speed: float) -> float:
        """Largest overlap of an elastic impact [m]: Hertz (5 m* v^2/(4 k))^(2/5); linear v sqrt(m*/kn)."""
        if self.spring:
            return speed * math.sqrt(self.reduced / self.spring.normal_stiffness)
        return (1.25 * self.reduced * speed**2 / self.hertz) ** 0.4

    def static_overlap(self, force: float) -> float:
        """Overlap under a force [N] at rest [m]."""
        return force / self.spring.normal_stiffness if self.spring else (force / self.hertz) ** (2 / 3)

    def contact_time(self, speed: float) -> float:
        """Duration of an elastic impact [s]: Hertz 2.868 (m*^2/(R* E*^2 v))^(1/5); linear pi/sqrt(kn/m* (1 - b^2))."""
        if self.spring:
            rate = self.spring.normal_stiffness / self.reduced * (1 - self.elastic.damping**2)
            return math.pi / math.sqrt(rate) if rate else math.inf
        if speed == 0:
            return math.inf
        return 2.868 * (self.reduced**2 / (self.reduced_radius * self.elastic.young**2 * speed)) ** 0.2

    def stiffness(self, overlap: float) -> tuple[float, float]:
        """Normal and tangential stiffness at an overlap [N/m]; the latter is 0 without friction."""
        if self.spring:
            normal, tangential = self.spring.normal_stiffness, self.spring.tangential_stiffness
        else:
            normal = 1.5 * self.hertz * math.sqrt(overlap)
            tangential = 8 * self.elastic.shear * math.sqrt(self.reduced_radius * overlap)
        return normal, tangential * self.friction


def meetings(scene: Scene) -> list[Meeting]:
    """All kinds of contacts that a scene can have, each for the lightest bodies that can have it."""
    radii, masses = scene.radii(), scene.masses()
    spring = scene.law if isinstance(scene.law, LinearSpring) else None
    members = {k: np.flatnonzero(scene.bodies.species == k) for k in range(len(scene.species))}
    lightest = {k: int(own[np.argmin(masses[own])]) for k, own in members.items() if len(own)}
    found = []
    for k, i in lightest.items():
        a = scene.species[k].material
        # a partner that is small covers the body with many contacts
        partners = [
            (
                scene.species[q].material,
                radii[j],
                masses[j],
                min(len(members[q]) - (q == k), NEIGHBOURS * ((radii[i] + radii[j]) / (2 * radii[j])) ** 2),
            )
            for q, j in lightest.items()
        ]
        partners += [(w, math.inf, math.inf, 1.0) for w in dict.fromkeys(wall.material for wall in scene.walls)]
        for b, radius, mass, contacts in partners:
            if contacts:
                pair = scene.pair_law(a, b)
                found.append(
                    Meeting(
                        species=k,
                        body=float(masses[i]),
                        reduced=float(1 / (1 / masses[i] + 1 / mass)),
                        radius=float(radii[i]),
                        reduced_radius=float(1 / (1 / radii[i] + 1 / radius)),
                        contacts=float(contacts),
                        elastic=Elastic.of(scene.material(a), scene.material(b), pair),
                        friction=pair.friction > 0,
                        spring=spring,
                    )
                )
    return found


@dataclass(frozen=True)
class Loads:
    """Largest loads of a scene, from its initial state.

    Attributes:
        impact: Fastest impact [m/s]: largest difference of initial velocities, or what a body falls onto the walls or
            out of the domain with, and the speed of the walls. Energy that drives the scene later is not in it.
        flow: Impacts that go on for long [m/s]: a fall over one median diameter, and the speed of the walls.
        pressure: Weight of the bed on its lowest layer per area [Pa].
        overlap: Largest overlap of the initial state [m].
    """

    impact: float
    flow: float
    pressure: float
    overlap: float

    @classmethod
    def of(cls, scene: Scene) -> Loads:
        """The loads of a scene."""
        if not len(scene.bodies):
            return cls(0.0, 0.0, 0.0, 0.0)
        position, velocity, radii = scene.bodies.position, scene.bodies.velocity, scene.radii()
        gravity = np.array(scene.gravity)
        g = float(np.linalg.norm(gravity))
        walls = _wall_speed(scene)
        spread = np.linalg.norm(velocity.max(axis=0).clip(min=0) - velocity.min(axis=0).clip(max=0))
        # a ball above a bed does not make it higher or heavier
        height = float(np.ptp(np.quantile(position @ gravity, (0.01, 0.99)))) / g if g else 0.0
        return cls(
            impact=max(float(spread), _landing_speed(scene)) + walls,
            flow=math.sqrt(2 * g * 2 * float(np.median(radii))) + walls,
            pressure=SOLID_FRACTION * float(np.median(scene.densities())) * g * height,
            overlap=largest_overlap(position, radii, scene.domain),
        )

    def overlap_of(self, meeting: Meeting, gravity: float) -> float:
        """Largest overlap of a kind of contact [m] under gravity [m/s^2]."""
        return max(self.overlap, meeting.impact_overlap(self.impact), self.static_overlap(meeting, gravity))

    def static_overlap(self, meeting: Meeting, gravity: float) -> float:
        """Overlap at rest under the bed and the body's own weight [m]."""
        return meeting.static_overlap(self.pressure * (2 * meeting.radius) ** 2 + meeting.body * gravity)


def _landing_speed(scene: Scene) -> float:
    """Largest speed with which a body falls onto a wall or out of the domain [m/s]; other bodies do not stop it."""
    gravity = np.array(scene.gravity)
    g = float(np.linalg.norm(gravity))
    velocity = np.linalg.norm(scene.bodies.velocity, axis=1)
    if not g:
        return float(velocity.max())
    down = gravity / g
    high = np.argsort(scene.bodies.position @ down)[:CANDIDATES]
    chosen = np.unique(np.concatenate([high, np.argsort(-velocity)[:CANDIDATES]]))
    start, radius = scene.bodies.position[chosen], scene.radii()[chosen]
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = np.where(down > 0, scene.domain.upper, scene.domain.lower)
        depth = np.where(down != 0, (faces - start) / down, np.inf).min(axis=1).clip(min=0)
    fallen = np.zeros(len(start))
    # steps of the distance to the nearest wall cannot pass it
    for _ in range(64):
        at = start + fallen[:, None] * down
        gaps = [wall.signed_distance(at) for wall in scene.walls]
        step = np.min(gaps, axis=0) - radius if gaps else np.full(len(start), np.inf)
        step = np.minimum(step.clip(min=0), depth - fallen)
        fallen += step
        if (step <= 1e-3 * radius).all():
            break
    return float(np.sqrt(velocity[chosen] ** 2 + 2 * g * fallen).max())


def _wall_speed(scene: Scene) -> float:
    """Largest speed of a wall's surface at the bodies [m/s]."""
    largest = 0.0
    for wall in scene.walls:
        motion = wall.motion
        if motion is not None:
            arm = np.linalg.norm(scene.bodies.position - np.array(motion.centre), axis=1).max()
            speed = math.hypot(*motion.velocity) + arm * math.hypot(*motion.angular_velocity)
            largest = max(largest, float(speed + 2 * math.pi * motion.frequency * math.hypot(*motion.amplitude)))
    return largest

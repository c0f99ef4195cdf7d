"""Checks of oblique collisions: how far velocities and spins are from Coulomb's bound and from the scene's law."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from dembench.verification.closed_forms.collisions import SLIP, SPHERE, impacts
from dembench.verification.closed_forms.volleys import Outcome, Shot
from dembench.verification.scenes import Kind

COULOMB = "sliding contact of rigid spheres: impulse μ (1 + e) m* v"
LAW = "the scene's law integrated over the contact"

Seen = Iterable[tuple[Shot, Outcome]]


def push(shot: Shot, outcome: Outcome) -> float:
    """Change of the relative tangential velocity, against the slip [m/s]."""
    return shot.along - outcome.along


def turn(shot: Shot, outcome: Outcome, kinds: Mapping[str, Kind]) -> float:
    """Change of the surface speed of the upper sphere by its spin, against the slip [m/s]."""
    return kinds[shot.kind].radius * (shot.spin - outcome.spin)


def from_coulomb(seen: Seen, kinds: Mapping[str, Kind], what: str) -> float:
    """Largest relative deviation of collisions that slide from Coulomb's bound [-].

    Args:
        seen: Shots that slide, with what became of them.
        kinds: Kinds by name.
        what: `velocity`, `spin`, or `slip` of the surfaces after the collision.
    """
    found = []
    for shot, outcome in seen:
        contact = shot.contact(kinds)
        bound = contact.sliding_push(shot.speed)
        share = contact.mass / kinds[shot.kind].mass
        measured = {
            "velocity": push(shot, outcome) / bound,
            "spin": turn(shot, outcome, kinds) / (SPHERE * share * bound),
            "slip": (push(shot, outcome) + turn(shot, outcome, kinds) / share) / (SLIP * bound),
        }[what]
        found.append(abs(measured - 1))
    return max(found)


def from_law(seen: Seen, kinds: Mapping[str, Kind], scale: Callable[[Shot], float]) -> float:
    """Largest deviation of tangential velocities from those of the scene's law, in a scale [m/s] of each shot [-]."""
    shots, outcomes = zip(*seen, strict=True)
    known = impacts(
        [shot.contact(kinds) for shot in shots],
        np.array([shot.speed for shot in shots]),
        np.array([shot.slip(kinds) for shot in shots]),
    )
    return max(
        abs(push(shot, outcome) - one.push) / scale(shot)
        for shot, outcome, one in zip(shots, outcomes, known, strict=True)
    )


def about_contact(seen: Seen, kinds: Mapping[str, Kind]) -> float:
    """Largest relative change of the angular momentum of the upper sphere about its contact point [-].

    What friction takes from its velocity it gives to its spin: R dw = (5/2) dv, whatever the law.
    """
    found = []
    for shot, outcome in seen:
        share = shot.contact(kinds).mass / kinds[shot.kind].mass
        found.append(abs(turn(shot, outcome, kinds) / (SPHERE * share * push(shot, outcome)) - 1))
    return max(found)


def returned(seen: Seen) -> np.ndarray:
    """Tangential velocities after over those before [-]."""
    return np.array([outcome.along / shot.along for shot, outcome in seen])

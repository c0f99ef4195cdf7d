"""Head-on collisions of Chung & Ooi (CO1 to CO3): overlap, force and duration by Hertz, and the restitution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dembench.verification.checks import Check, Published
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.closed_forms.volleys import Outcome

HERTZ = "Hertz 1882"
KRATOS_FORCE = {"limestone": 7108.0, "magnesium": 7233.0}
"""Largest forces that Kratos lists for the tests of Chung & Ooi [N]."""
LETTERS = "abcdefghijklmnop"


def elastic_checks(prefix: str, contacts: Mapping[str, Contact], speed: float, tolerance: float) -> tuple[Check, ...]:
    """Largest overlap, largest force and duration of elastic collisions, with ids prefix + a, b, c, ...

    Args:
        prefix: Beginning of the ids.
        contacts: The contact of each material by its name.
        speed: Speed of approach [m/s].
        tolerance: Largest relative deviation that is accepted [-].
    """
    found: list[Check] = []
    for name, contact in contacts.items():
        force = KRATOS_FORCE.get(name)
        published = None if force is None else Published(force, force, tolerance * force)
        for what, unit, value, page in (
            ("largest overlap", "m", contact.largest_overlap(speed), None),
            ("largest force", "N", contact.largest_force(speed), published),
            ("duration", "s", contact.duration(speed), None),
        ):
            id = prefix + LETTERS[len(found)]
            found.append(Check(id, f"{name}: {what}", unit, value, tolerance * value, HERTZ, page, scene_law=True))
    return tuple(found)


def elastic_values(prefix: str, outcomes: Sequence[Outcome]) -> dict[str, float]:
    """What was measured of elastic collisions, with the ids of `elastic_checks`."""
    values = [value for one in outcomes for value in (one.overlap, one.force, one.duration)]
    return {prefix + letter: value for letter, value in zip(LETTERS, values, strict=False)}


def restitution_checks(prefix: str, names: Sequence[tuple[str, float]], tolerance: float) -> tuple[Check, ...]:
    """The restitution of collisions of a material with a given one, with ids prefix + a, b, c, ...

    The dashpot of the scene's law makes the restitution that of the pair law where tension is not clipped (Antypov &
    Elliott 2011, EPL 94, 50004); a rigid contact has it by definition.
    """
    source = "pair law; Antypov & Elliott 2011, EPL 94, 50004"
    return tuple(
        Check(prefix + letter, f"{name}: restitution for e = {e:g}", "1", e, tolerance * max(e, 0.1), source)
        for letter, (name, e) in zip(LETTERS, names, strict=False)
    )

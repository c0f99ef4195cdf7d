"""The impact tests of Chung & Ooi 2011, doi 10.1007/s10035-011-0277-0: parameters, scenes and checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dembench.results import Result
from dembench.scene import PairLaw
from dembench.verification.checks import Check, Experiment, Published, at_most, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import SPHERE, Contact, impact
from dembench.verification.closed_forms.head_on import (
    LETTERS,
    elastic_checks,
    elastic_values,
    restitution_checks,
)
from dembench.verification.closed_forms.oblique import (
    COULOMB,
    LAW,
    about_contact,
    from_coulomb,
    from_law,
    push,
    returned,
)
from dembench.verification.closed_forms.volleys import Shot, Volley, angles
from dembench.verification.scenes import Kind

SOURCE = "Chung & Ooi 2011, doi 10.1007/s10035-011-0277-0"
WALTON = "Walton 1993: sliding contact, slip changes by (7/2) μ (1 + e) v"

# ---- CO1: two equal spheres

SPHERES = {
    "glass": Kind(4.8e10, 2800, 0.01, 0.20, friction=0.35),
    "limestone": Kind(2.0e10, 2500, 0.01, 0.25, friction=0.35),
}
SPHERE_SPEED = 20.0
"""Relative speed of the pairs [m/s]."""
PAIRS = Volley(
    name="impact_pairs",
    kinds=SPHERES,
    shots=tuple(Shot(kind, SPHERE_SPEED, partner=kind) for kind in SPHERES),
    time_step=5e-7,
    duration=7e-5,
)

# ---- CO2, CO6, CO7, CO8: spheres of 0.2 m

ALUMINIUM, COPPER = (7e10, 2699, 0.1, 0.33), (1.2e11, 8900, 0.1, 0.35)
SPUN: dict[str, Any] = {"restitution": 0.5, "friction": 0.4}
ALLOYS = {
    "aluminium": Kind(*ALUMINIUM),
    "magnesium": Kind(4e10, 1800, 0.1, 0.35),
    "spun_aluminium": Kind(*ALUMINIUM, **SPUN),
    "spun_copper": Kind(*COPPER, **SPUN),
    "anvil": Kind(7e13, 2.699e6, 0.5, 0.33),
}
ALLOY_SPEED = 0.2
SPINS = (1.0, 2.0, 3.0, 5.0, 6.0, 8.0, 10.0)
"""Initial spins [rad/s]; those above 4.2 slide through the whole contact."""
SPINNING = ("spun_aluminium", "spun_copper")
"""Kinds of CO6 and CO7; the first is also that of CO8."""
ON_FLOOR = tuple(Shot(kind, ALLOY_SPEED, spin=w) for kind in SPINNING for w in SPINS)
OPPOSITE = tuple(Shot(kind, 2 * ALLOY_SPEED, spin=5.0, partner=kind, partner_spin=-5.0) for kind in SPINNING)
ON_ANVIL = tuple(Shot(SPINNING[0], ALLOY_SPEED, spin=w, partner="anvil", resting=True) for w in SPINS)
LARGE = Volley(
    name="impact_alloys",
    kinds=ALLOYS,
    shots=(Shot("aluminium", ALLOY_SPEED), Shot("magnesium", ALLOY_SPEED), *ON_FLOOR, *OPPOSITE, *ON_ANVIL),
    time_step=5e-6,
    duration=1.2e-3,
    between=(PairLaw(a=SPINNING[0], b="anvil", restitution=0.5, friction=0.4),),
)

# ---- CO3, CO4: spheres of 5 mm

OXIDE, IRON, ALLOY = (3.8e11, 4000, 0.0025, 0.23), (1e11, 7000, 0.0025, 0.25), (7e10, 2700, 0.0025, 0.33)
RESTITUTIONS = (0.2, 0.4, 0.6, 0.8, 1.0)
OBLIQUE: dict[str, Any] = {"restitution": 0.98, "friction": 0.092}
SMALL_SPEED = 3.9
PAPER_ANGLES, SLIDING_ANGLES = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0), (40.0, 50.0, 60.0, 70.0, 80.0)
PAPER = (0.948, 0.687, 0.624, 0.616, 0.634, 0.684, 0.737)
"""Tangential restitutions of aluminium oxide at `PAPER_ANGLES`, read from a figure of Chung & Ooi [-]."""
DAMPED = tuple(f"{name}_{round(100 * e)}" for name in ("oxide", "iron") for e in RESTITUTIONS)
STEEP = ("oxide", "alloy")
GRAINS = {
    **{f"oxide_{round(100 * e)}": Kind(*OXIDE, restitution=e) for e in RESTITUTIONS},
    **{f"iron_{round(100 * e)}": Kind(*IRON, restitution=e) for e in RESTITUTIONS},
    "oxide": Kind(*OXIDE, **OBLIQUE),
    "alloy": Kind(*ALLOY, **OBLIQUE),
}
PAIR_ANGLES = (45.0, 60.0, 75.0)
"""Angles of oblique collisions of two oxide spheres, all of which slide [degrees]."""
GRAIN_VOLLEY = Volley(
    name="impact_grains",
    kinds=GRAINS,
    shots=(
        *(Shot(kind, SMALL_SPEED) for kind in DAMPED),
        *(shot for kind in STEEP for shot in angles(kind, SMALL_SPEED, (*PAPER_ANGLES, *SLIDING_ANGLES))),
        *(
            Shot("oxide", 2 * SMALL_SPEED * np.cos(a), 2 * SMALL_SPEED * np.sin(a), partner="oxide")
            for a in np.radians(PAIR_ANGLES)
        ),
    ),
    time_step=4e-8,
    duration=2.4e-5,
)

# ---- CO5: spheres of 20 micrometres

STEEL = {"steel": Kind(2.08e11, 7850, 1e-5, 0.3, friction=0.3), "spare": Kind(2.08e11, 7850, 1e-5, 0.3)}
STEEL_SPEED = 5.0
STEEL_ANGLES = (5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 70.0, 75.0, 80.0)
"""Angles [degrees]; above 64.5 the spheres slide through the whole contact."""
TINY = Volley(
    name="impact_steel",
    kinds=STEEL,
    shots=tuple(Shot("steel", STEEL_SPEED, STEEL_SPEED * float(np.tan(a))) for a in np.radians(STEEL_ANGLES)),
    time_step=4e-10,
    duration=4.4e-8,
)

BOUND_NOTE = (
    "The paper's number is Coulomb's bound for a force that never pulls. The law of the scene bounds friction by the "
    "size of the normal force also while its dashpot pulls at the end of the contact, so that a sphere with e = 0.5 "
    "takes up a sixth more."
)


# ---- what is measured


def _pairs(result: Result) -> Mapping[str, float]:
    return elastic_values("CO1", PAIRS.outcomes(result))


def _large(result: Result) -> Mapping[str, float]:
    seen = LARGE.seen(result)
    count = len(SPINS)
    rows = {kind: seen[2 + k * count : 2 + (k + 1) * count] for k, kind in enumerate(SPINNING)}
    facing, anvil = seen[2 + 2 * count : 4 + 2 * count], seen[4 + 2 * count :]
    fastest = {name: spun[-1] for name, spun in (("al", rows[SPINNING[0]]), ("cu", rows[SPINNING[1]]), ("on", anvil))}
    pushed = {name: push(*last) for name, last in fastest.items()}
    return {
        **elastic_values("CO2", [outcome for _, outcome in seen[:2]]),
        "CO6a": pushed["al"],
        "CO6b": pushed["cu"],
        "CO6c": fastest["al"][1].spin - SPINS[-1],
        "CO6d": fastest["cu"][1].spin - SPINS[-1],
        "CO6e": from_law(rows[SPINNING[0]], ALLOYS, _coulomb),
        "CO6f": from_law(rows[SPINNING[1]], ALLOYS, _coulomb),
        "CO6g": max(about_contact(row, ALLOYS) for row in rows.values()),
        "CO7a": max(abs(outcome.along) for _, outcome in facing),
        "CO7b": max(
            abs(after / before - 1)
            for shot, outcome in facing
            for before, after in ((shot.spin, outcome.spin), (shot.partner_spin, outcome.partner_spin))
        ),
        "CO7c": facing[0][1].rebound / facing[0][0].speed,
        "CO7d": facing[1][1].rebound / facing[1][0].speed,
        "CO8a": pushed["on"],
        "CO8b": from_law(anvil, ALLOYS, _coulomb),
        "CO8c": about_contact(anvil, ALLOYS),
    }


def _coulomb(shot: Shot) -> float:
    return shot.contact(ALLOYS).sliding_push(shot.speed)


def _small(result: Result) -> Mapping[str, float]:
    seen = GRAIN_VOLLEY.seen(result)
    n, angles = len(DAMPED), len(PAPER_ANGLES) + len(SLIDING_ANGLES)
    oxide, alloy, pairs = seen[n : n + angles], seen[n + angles : n + 2 * angles], seen[n + 2 * angles :]
    gentle = len(PAPER_ANGLES)
    sliding = {"oxide": oxide[gentle:], "alloy": alloy[gentle:]}
    return {
        **{f"CO3{letter}": o.rebound / s.speed for letter, (s, o) in zip(LETTERS, seen[:n], strict=False)},
        "CO4a": from_coulomb(sliding["oxide"], GRAINS, "velocity"),
        "CO4b": from_coulomb(sliding["alloy"], GRAINS, "velocity"),
        "CO4c": from_coulomb(sliding["oxide"], GRAINS, "spin"),
        "CO4d": from_coulomb(sliding["alloy"], GRAINS, "spin"),
        "CO4e": from_law(oxide, GRAINS, _along),
        "CO4f": from_law(alloy, GRAINS, _along),
        "CO4g": float(np.mean(np.abs(returned(oxide[:gentle]) / PAPER - 1))),
        "IM1a": from_coulomb([*sliding["oxide"], *sliding["alloy"]], GRAINS, "slip"),
        "IM3a": from_coulomb(pairs, GRAINS, "velocity"),
        "IM3b": from_coulomb(pairs, GRAINS, "spin"),
        "IM3c": max(outcome.energy for _, outcome in seen),
    }


def _along(shot: Shot) -> float:
    return shot.along


def _tiny(result: Result) -> Mapping[str, float]:
    seen = TINY.seen(result)
    sliding = [one for one in seen if one[0].contact(STEEL).slides(one[0].speed, one[0].along)]
    return {"CO5a": from_coulomb(sliding, STEEL, "velocity"), "CO5b": from_law(seen, STEEL, _along)}


# ---- what is known


def experiments() -> tuple[Experiment, ...]:
    """The experiments, with the oblique impacts of Walton's map among them."""
    floor = {name: Contact.with_wall(ALLOYS[name]) for name in ("aluminium", "magnesium")}
    pairs = {name: Contact.between(kind, kind) for name, kind in SPHERES.items()}
    return (
        _volley(PAIRS, "Two equal spheres", _pairs, elastic_checks("CO1", pairs, SPHERE_SPEED, 4e-3)),
        _volley(LARGE, "Spheres of 0.2 m, elastic and spinning", _large, _large_checks(floor)),
        _volley(GRAIN_VOLLEY, "Grains of 5 mm at many angles", _small, _small_checks()),
        _volley(TINY, "Steel spheres of 20 μm at many angles", _tiny, _tiny_checks()),
    )


def _volley(
    volley: Volley, title: str, measure: Callable[[Result], Mapping[str, float]], checks: tuple[Check, ...]
) -> Experiment:
    settings = {"dt": f"{volley.time_step:g}"}
    return on_one_scene(volley.name, title, volley.scene, measure, checks, settings=settings)


def _large_checks(floor: Mapping[str, Contact]) -> tuple[Check, ...]:
    law = f"{LAW}; {SOURCE}"
    found = [*elastic_checks("CO2", floor, ALLOY_SPEED, 4e-3)]
    for letter, kind in zip("ab", SPINNING, strict=True):
        contact, name = Contact.with_wall(ALLOYS[kind]), kind.removeprefix("spun_")
        found += _fastest(f"CO6{letter}", f"CO6{'cd'['ab'.index(letter)]}", contact, name, law)
    for letter, kind in zip("ef", SPINNING, strict=True):
        what = f"{kind.removeprefix('spun_')}, all spins: largest deviation of the velocity, over μ (1 + e) v"
        found.append(deviation(f"CO6{letter}", what, 0.034, law, scene_law=True))
    moment = "angular momentum about the contact"
    anvil = Contact.between(ALLOYS[SPINNING[0]], ALLOYS["anvil"])
    return (
        *found,
        deviation("CO6g", f"all spins: largest change of the {moment}", 2e-3, moment),
        Check("CO7a", "opposite spins: largest lateral speed", "m/s", 0.0, 1e-6, "no slip", scale=ALLOY_SPEED),
        deviation("CO7b", "opposite spins: largest change of a spin", 1e-6, "no slip"),
        *(
            Check(
                f"CO7{k}", f"opposite spins, {name.removeprefix('spun_')}: restitution", "1", 0.5, 3.75e-3, "pair law"
            )
            for k, name in zip("cd", SPINNING, strict=True)
        ),
        _fastest("CO8a", "", anvil, "aluminium on a sphere of 1 m", law)[0],
        deviation("CO8b", "on a sphere of 1 m: largest deviation of the velocity, over μ (1 + e) v", 0.042, law, True),
        deviation("CO8c", f"on a sphere of 1 m: largest change of the {moment}", 2e-3, moment),
    )


def _fastest(id: str, spin_id: str, contact: Contact, name: str, source: str) -> list[Check]:
    """Velocity and change of spin after the fastest spin, with Coulomb's numbers beside."""
    known = impact(contact, ALLOY_SPEED, contact.arm * SPINS[-1])
    bound = contact.sliding_push(ALLOY_SPEED)
    turned, bound_turned = -known.turn / contact.arm, -SPHERE * bound / contact.arm
    start = f"{name}, {SPINS[-1]:g} rad/s"
    tolerance = 0.034
    velocity = Published(bound, bound, tolerance * bound, BOUND_NOTE)
    spin = Published(bound_turned, bound_turned, tolerance * abs(bound_turned), BOUND_NOTE)
    found = [
        Check(
            id,
            f"{start}: tangential speed",
            "m/s",
            known.push,
            tolerance * known.push,
            source,
            velocity,
            scene_law=True,
        )
    ]
    if spin_id:
        limit = tolerance * abs(turned)
        found.append(
            Check(spin_id, f"{start}: change of the spin", "rad/s", turned, limit, source, spin, scene_law=True)
        )
    return found


def _small_checks() -> tuple[Check, ...]:
    names = [(kind.partition("_")[0], GRAINS[kind].restitution) for kind in DAMPED]
    coulomb, law = f"{COULOMB}; {SOURCE}", f"{LAW}; {SOURCE}"
    sliding, all_angles = "40° to 80°: largest deviation of the", "5° to 80°: largest deviation of the"
    return (
        *restitution_checks("CO3", names, 7.5e-3),
        deviation("CO4a", f"oxide, {sliding} change of velocity", 0.01, coulomb),
        deviation("CO4b", f"aluminium alloy, {sliding} change of velocity", 0.01, coulomb),
        deviation("CO4c", f"oxide, {sliding} spin", 0.01, coulomb),
        deviation("CO4d", f"aluminium alloy, {sliding} spin", 0.01, coulomb),
        deviation("CO4e", f"oxide, {all_angles} tangential restitution", 0.01, law, True),
        deviation("CO4f", f"aluminium alloy, {all_angles} tangential restitution", 0.01, law, True),
        deviation(
            "CO4g",
            "oxide, 5° to 35°: mean deviation of the tangential restitution from the paper",
            0.05,
            SOURCE,
            True,
            kind="publication",
        ),
        deviation("IM1a", "oxide and alloy, sliding: largest deviation of the change of slip", 0.01, WALTON),
        deviation("IM3a", "pairs of oxide, sliding: largest deviation of the velocity", 0.01, WALTON),
        deviation("IM3b", "pairs of oxide, sliding: largest deviation of the spin", 0.01, WALTON),
        at_most(
            "IM3c",
            "largest kinetic energy after a collision over that before",
            "1",
            1.0,
            "no contact of the scene gives energy",
            tolerance=1e-3,
        ),
    )


def _tiny_checks() -> tuple[Check, ...]:
    return (
        deviation("CO5a", "70° to 80°: largest deviation of the change of velocity", 0.015, f"{COULOMB}; {SOURCE}"),
        deviation(
            "CO5b", "5° to 80°: largest deviation of the tangential restitution", 0.015, f"{LAW}; {SOURCE}", True
        ),
    )

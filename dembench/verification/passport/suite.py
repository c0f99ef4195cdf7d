"""The suite `passport`: the contact law of an engine, measured before any bulk case."""

from __future__ import annotations

from collections.abc import Mapping

from dembench.results import Result
from dembench.verification.checks import Check, Suite, deviation, on_one_scene
from dembench.verification.laws import LAWS, SCENE_LAW
from dembench.verification.passport.measure import (
    ASPECTS,
    distances,
    motion_of,
    nearest,
    rolling,
    rolling_losses,
    scene,
    together,
)
from dembench.verification.passport.record import keep, passports
from dembench.verification.passport.scenes import DT, ROLLING, rolling_pairs

TOLERANCE = 0.01
"""Distance to a law up to which an engine computes it [-]: with 400 steps a contact the codes that compute it are
within 0.006, and no two named laws are nearer than 0.012."""
SLIP_TOLERANCE = 0.02
"""The same in gross slip, where the spring reaches its bound and loses its dashpot within the first steps of a contact,
so that the error falls as the square root of the step: 0.013 with 400 steps a contact and 0.007 with 1600."""
SOURCE = "named laws in the limit of vanishing time steps"


def suite() -> Suite:
    """The suite."""
    return Suite(
        name="passport",
        title="Law passports: which contact law an engine computes",
        text="47 pairs of spheres collide in one scene: head-on with ten restitutions, three speeds and two sizes, "
        "spinning fast enough to slide through the whole contact, obliquely with little and with much friction, and of "
        f"two materials with a table of pairs. What came out is compared with {len(LAWS)} named laws that are "
        "integrated in the limit of vanishing time steps. A distance is a root mean square in the scale of its aspect.",
        source="Dosta et al. 2024, doi 10.1016/j.cpc.2023.109066, and the codes that it compares; Schwager & Poeschel "
        "2007, doi 10.1007/s10035-007-0065-z; Thornton et al. 2013, doi 10.1016/j.powtec.2012.08.012; Walton 1993",
        experiments=(
            on_one_scene("passport_pairs", "Pairs of spheres", scene, _measure, _checks()),
            on_one_scene(
                "passport_rolling", "Pairs that roll on each other", rolling_pairs, _rolling, _rolling_checks()
            ),
        ),
        settings={"dt": f"{DT:g}"},
        keep=lambda runs, directory: keep(passports(runs), directory),
    )


def _measure(result: Result) -> Mapping[str, float]:
    found = distances(motion_of(result))
    own = found[SCENE_LAW.name]
    return {
        "LP0": together(found[nearest(found).name]),
        "LP1": together(own),
        **{f"LP1-{aspect.name}": own[aspect.name] for aspect in ASPECTS},
    }


def _rolling(result: Result) -> Mapping[str, float]:
    share = rolling(result) / rolling_losses()
    return {f"LP2-{c:g}": float(s) for c, s in zip(ROLLING, share, strict=True)}


def _rolling_checks() -> tuple[Check, ...]:
    source = "constant torque μr R* |Fn|: Ai et al. 2011, doi 10.1016/j.powtec.2010.09.030"
    return tuple(
        Check(
            f"LP2-{c:g}",
            f"spin lost in rolling, over the closed form, μr {c:g}",
            "1",
            1.0,
            0.01,
            source,
            scene_law=True,
        )
        for c in ROLLING
    )


def _checks() -> tuple[Check, ...]:
    return (
        deviation("LP0", "distance to the nearest named law", TOLERANCE, SOURCE),
        deviation("LP1", f"distance to the scene's law: {SCENE_LAW.title}", TOLERANCE, SOURCE, True),
        *(
            deviation(
                f"LP1-{a.name}",
                f"distance to it in {a.title}",
                SLIP_TOLERANCE if a.slips else TOLERANCE,
                SOURCE,
                True,
            )
            for a in ASPECTS
        ),
    )

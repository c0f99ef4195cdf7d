"""The suite `closed-forms`."""

from __future__ import annotations

from dembench.verification.checks import Suite
from dembench.verification.closed_forms import (
    chains,
    chung_ooi,
    clusters,
    crystal,
    inclines,
    meetings,
    mfix,
    on_floor,
    order,
    pair_table,
    tops,
    trough,
    walton,
    wedge,
)


def suite() -> Suite:
    """The suite."""
    return Suite(
        name="closed-forms",
        title="Closed forms: few bodies whose motion is known",
        text="Few bodies collide, bounce, slide, roll and stand, many of them in one scene. Expected values are closed "
        "forms or integrals of the equations of motion, computed when the suite is run; numbers of the published "
        "batteries stand beside them. What belongs to the law of the scene, and not to any law of contact, does not "
        "apply to engines that compute another law. Terminal velocities (MF06) are left out: scenes have no drag.",
        source="Chung & Ooi 2011, doi 10.1007/s10035-011-0277-0; Garg et al. 2012 and the manual of MFiX; Walton 1993",
        experiments=(
            *chung_ooi.experiments(),
            *mfix.experiments(),
            walton.experiment(),
            chains.experiment(),
            pair_table.experiment(),
            meetings.experiment(),
            on_floor.experiment(),
            trough.experiment(),
            *inclines.experiments(),
            wedge.experiment(),
            *clusters.experiments(),
            crystal.experiment(),
            tops.experiment(),
            *order.experiments(),
        ),
    )

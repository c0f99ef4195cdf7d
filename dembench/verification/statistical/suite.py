"""The statistical suite."""

from __future__ import annotations

from dembench.verification.checks import Suite
from dembench.verification.statistical import beds, collapse, gas, heaps, incline, orifice, silo


def suite() -> Suite:
    """The suite: every number is a mean over seeds."""
    return Suite(
        name="statistical",
        title="Statistical bulk behaviour",
        text="What no single run tells: every number is the mean of an ensemble of seeds, beside theory or the band "
        "that publications leave. Grains are softer than real ones: that is part of the scenes, for all engines.",
        source="Janssen 1895; Beverloo et al. 1961; Haff 1983; Scott & Kilgour 1969; Lube et al. 2004; "
        "Silbert et al. 2001; Jop et al. 2006",
        experiments=(
            gas.experiment(),
            beds.packings(),
            silo.experiment(),
            orifice.experiment(),
            collapse.experiment(),
            heaps.experiment(),
            incline.experiment(),
        ),
    )

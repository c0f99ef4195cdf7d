"""The statistical suite."""

from __future__ import annotations

from dembench.verification.checks import Suite
from dembench.verification.statistical import beds, gas, silo


def suite() -> Suite:
    """The suite: every number is a mean over seeds."""
    return Suite(
        name="statistical",
        title="Statistical bulk behaviour",
        text="What no single run tells: every number is the mean of an ensemble of seeds, beside theory or the band "
        "that publications leave. Grains are softer than real ones: that is part of the scenes, for all engines.",
        source="Janssen 1895; Haff 1983; Scott & Kilgour 1969",
        experiments=(gas.experiment(), beds.packings(), silo.experiment()),
    )

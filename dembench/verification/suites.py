"""The suites: those of this package and those that other packages announce by the entry point `dembench.suites`."""

from __future__ import annotations

from functools import cache

from dembench import plugins
from dembench.verification.checks import Suite

BUILT_IN = {
    "sanity": "dembench.verification.sanity:suite",
    "closed-forms": "dembench.verification.closed_forms.suite:suite",
    "stability": "dembench.verification.stability:suite",
    "passport": "dembench.verification.passport.suite:suite",
    "statistical": "dembench.verification.statistical.suite:suite",
}
GROUP = "dembench.suites"


class UnknownSuite(ValueError):
    """A name that no suite has."""


def names() -> list[str]:
    """Names of all suites, the built-in ones first."""
    return plugins.names(BUILT_IN, GROUP)


@cache
def suite(name: str) -> Suite:
    """The suite of that name.

    Raises:
        UnknownSuite: No suite has that name; the nearest known one is named.
    """
    found: Suite = plugins.find("suite", name, BUILT_IN, GROUP, UnknownSuite)
    return found

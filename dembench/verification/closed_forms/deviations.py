"""Checks of deviations: numbers that are zero where everything is right."""

from __future__ import annotations

from dembench.verification.checks import Check


def deviation(id: str, title: str, tolerance: float, source: str, scene_law: bool = False) -> Check:
    """A check that a relative deviation is at most `tolerance` [-]."""
    return Check(id, title, "1", 0.0, tolerance, source, sense="at most", scene_law=scene_law, scale=1.0)

"""Regression tracking: what runs measured beside what a baseline expects, over time, and between two sets of runs."""


class RegressionError(ValueError):
    """Runs, a baseline or a history that cannot be used; the message says what would be accepted."""

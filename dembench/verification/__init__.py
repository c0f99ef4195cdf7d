"""Suites of problems whose answers are known: scenes, what is measured on them, and how far off it may be."""

"""Regression tracking: what runs measured beside what a baseline expects, over time, and between two sets of runs."""

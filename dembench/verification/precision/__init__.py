"""Error against run time: sweeps of one setting, their points and what they cost."""

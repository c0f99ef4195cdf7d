"""The in-tree discrete-element solver, a library of its own on top of the scene: `Simulation(scene).step(100)`."""

from dembench.solver.guard import SolverError
from dembench.solver.simulation import Simulation

__all__ = ["Simulation", "SolverError"]

"""Results made by hand, with what a case needs of one."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Seen:
    """A recorded observable."""

    time: np.ndarray
    value: np.ndarray
    components: tuple = ()


@dataclass
class Shots:
    """Recorded snapshots."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


@dataclass
class Record:
    """A result."""

    observables: dict
    snapshots: dict = field(default_factory=dict)

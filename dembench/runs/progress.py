"""How far a run is and how long it will take, as shown while it goes on."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from dembench.runs.states import State

WINDOW = 600.0
"""Wall time over which the speed is taken that the estimate rests on [s]."""


@dataclass
class Progress:
    """How far a run is.

    Attributes:
        state: Its state; None before its start.
        time: Simulated time reached [s].
        fraction: The same as a share of the duration [-].
        elapsed: Wall time since the start of this attempt [s].
        memory: Peak memory of its processes so far [bytes].
        note: What it is doing, or the reason of its end.
    """

    state: State | None = None
    time: float = 0.0
    fraction: float = 0.0
    elapsed: float = 0.0
    memory: int = 0
    note: str = "waiting"
    _passed: deque[tuple[float, float]] = field(default_factory=deque)

    def reach(self, time: float, duration: float) -> None:
        """Notes the simulated time [s], of a duration [s], that is reached by now."""
        self.time, self.fraction = time, min(1.0, time / duration)
        if len(self._passed) == 1 and self._passed[0][1] == self.fraction:
            self._passed.clear()  # not begun yet: reading the scene and compiling say nothing about the speed
        if not self._passed or self._passed[-1][1] < self.fraction:
            self._passed.append((self.elapsed, self.fraction))
        while len(self._passed) > 2 and self._passed[1][0] < self.elapsed - WINDOW:
            self._passed.popleft()

    def left(self) -> float | None:
        """Estimated wall time to the end at the recent speed of this attempt [s]; None while too little is known."""
        if len(self._passed) < 2:
            return None
        (begin, start), (end, reached) = self._passed[0], self._passed[-1]
        whole = (1 - reached) * (end - begin) / (reached - start)
        return max(0.0, whole - (self.elapsed - end))

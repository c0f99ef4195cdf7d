"""The states of a run: all of them are rows of the report."""

from __future__ import annotations

from typing import Any, Literal

from dembench.scene.base import Model

State = Literal["running", "ok", "inaccurate", "failed", "timeout", "interrupted", "skipped", "missing"]
FINISHED: tuple[State, ...] = ("ok", "inaccurate", "skipped")
"""States that are reused; a run in any other state is run again."""


RESUMED: tuple[State, ...] = ("interrupted", "timeout")
"""States from which a run goes on where its engine has left a checkpoint."""


class Resumption(Model):
    """Where a run went on after an interruption.

    Attributes:
        step, time: Step number and simulated time [s] of the checkpoint.
        reached: Simulated time that the attempt before had reached [s]; what lies between was computed again.
        when: Time in ISO 8601 with time zone.
        note: One line where a later checkpoint could not be used, else empty.
    """

    step: int
    time: float
    reached: float
    when: str
    note: str = ""


class Verdict(Model):
    """What scoring says about a run that came to its end.

    Attributes:
        state: `ok`, or `inaccurate` where a quantity lies outside the gate.
        scored: Whether there was a reference to compare with.
        detail: One line: which quantities are outside.
    """

    state: Literal["ok", "inaccurate"] = "ok"
    scored: bool = False
    detail: str = ""


class Status(Model):
    """How a run ended.

    Attributes:
        state: See `State`; `running` while its supervisor lives.
        reason: Why it failed, was skipped or is missing, in a word or two: for `failed` one of `FAILURES` of the
            engine contract; for `skipped` the features; for `missing` why the engine is not there.
        detail: One line about the reason.
        install: For `missing`: the command that makes the engine available.
        scored: Whether there was a reference to compare with; False for a result without references.
        phase: Phase in which it ended.
        exit_code: Exit code of the last process, None where a signal ended it.
        signal: Name of the signal that ended the last process.
        log_tail: Last lines of the logs.
        note: One line about an earlier attempt that could not be gone on with, else empty.
        resumed: Where it went on after interruptions, in their order; empty for a run in one piece.
        started, ended: Times in ISO 8601 with time zone; of the first and the last attempt; empty where it was never
            started.
        wall: Wall time from start to end of all attempts together [s].
        time: Simulated time reached [s].
        frames, frames_expected: Frames recorded, and those that the scene asks for.
        contended: Whether other programs held the cores of the run.
    """

    state: State
    reason: str = ""
    detail: str = ""
    install: str = ""
    scored: bool = False
    phase: str = ""
    exit_code: int | None = None
    signal: str | None = None
    log_tail: str = ""
    note: str = ""
    resumed: tuple[Resumption, ...] = ()
    started: str = ""
    ended: str = ""
    wall: float | None = None
    time: float = 0.0
    frames: int = 0
    frames_expected: int = 0
    contended: bool = False

    @property
    def finished(self) -> bool:
        """Whether a repeated command reuses the run."""
        return self.state in FINISHED

    def label(self) -> str:
        """The state as shown: with the reason where there is one."""
        if self.state == "ok" and not self.scored:
            return "ok, unscored"
        return f"{self.state}: {self.reason}" if self.reason else self.state

    def plain(self) -> dict[str, Any]:
        """As JSON data."""
        return self.model_dump(mode="json")

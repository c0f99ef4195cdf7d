"""The engine contract: probe, refuse, set, write, read. An engine is a small adapter between plain data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import SEEK_END
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, overload

import numpy as np
from pydantic import BeforeValidator, ValidationError

from dembench.plugins import nearest
from dembench.scene import FORCEABLE, HertzMindlin, Scene
from dembench.scene.base import Model, Positive

Division = Literal["closed", "open"]
FRAMES, CHECKPOINTS = "frames", "checkpoints"
"""Sub-directories of a deck for raw frames and checkpoints; both are removed after a run that ended well."""


class Probe(Model):
    """What was found of an engine on this machine.

    Attributes:
        available: Whether it can run here.
        version: Its version; for an in-tree engine with a digest of its sources.
        path: Path of its program, or None.
        facts: Build facts: binary hash, package, device, compiler.
        reason: Why it is not available.
        install: Command or advice that makes it available.
    """

    available: bool
    version: str = ""
    path: str | None = None
    facts: dict[str, str] = {}
    reason: str = ""
    install: str = ""


class EngineSettings(Model):
    """Settings of one run of an engine; an engine adds its own fields.

    Attributes:
        dt: Time step [s], fitted into the scene's sampling interval.
    """

    dt: Positive

    def cores(self) -> int:
        """Number of cores that a run with these settings occupies."""
        return 1

    def precision(self) -> str:
        """Floating-point precision, as shown in timing tables."""
        return "float64"

    def device(self) -> str:
        """Device, as shown in timing tables."""
        return "cpu"


def _features(text: Any) -> Any:
    names = [name.strip() for name in text.split("+")] if isinstance(text, str) else []
    if unknown := [name for name in names if name not in FORCEABLE]:
        raise ValueError(f"'{unknown[0]}' cannot be forced; accepted are {', '.join(FORCEABLE)}, joined by +")
    return text


Forced = Annotated[str | None, BeforeValidator(_features)]
"""Type of a setting `force`: names of features that the scene lacks and that are computed all the same, joined by +."""


def names_of(forced: str | None) -> list[str]:
    """The names in a setting `force`."""
    return [name.strip() for name in forced.split("+")] if forced else []


class SettingsError(ValueError):
    """A setting that is unknown or has a value that is not accepted."""


class Phase(Model):
    """One command of a run.

    Attributes:
        name: `simulate`, or what comes before and after it.
        command: Program and arguments; run in the deck directory, never through a shell.
        timed: Whether its wall time counts as the run's.
        environment: Variables added to the environment.
    """

    name: str
    command: tuple[str, ...]
    timed: bool = True
    environment: dict[str, str] = {}


@dataclass(frozen=True)
class Frame:
    """All bodies at one time, in the order of the initial state.

    Attributes:
        step, time: Step number and time [s].
        present: Indices of the bodies that are still there, shape (n,), ascending.
        position, velocity, angular_velocity: [m], [m/s], [rad/s], shape (n, 3), float64.
        wall_forces: Contact force on each wall whose force the scene observes [N], shape (3,), by name.
    """

    step: int
    time: float
    present: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    wall_forces: dict[str, np.ndarray] = field(default_factory=dict)


class FrameFiles(Sequence[Frame]):
    """Frames in files, loaded one by one on access.

    Args:
        known: Step, time [s] and file of each complete frame, ascending.
        load: Makes a frame of these.
    """

    def __init__(self, known: list[tuple[int, float, Path]], load: Callable[[int, float, Path], Frame]):
        self._known, self._load = known, load

    def __len__(self) -> int:
        return len(self._known)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...

    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        return self._load(*self._known[index])


@dataclass(frozen=True)
class Tracks:
    """The tracked bodies of a scene at the fine cadence.

    Attributes:
        step, time: Shape (t,), [s].
        position, velocity: Shape (t, b, 3) in the order of `scene.tracked_bodies()`, [m], [m/s].
    """

    step: np.ndarray
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Timing:
    """Where the wall time of a run went [s]; None where it is not known.

    Attributes:
        set_up: Reading the scene, building lists.
        compile: Compiling or loading kernels.
        loop: The stepping loop.
        output: Writing frames and tracks, where it is apart from the loop.
        loop_cpu: CPU time of the stepping loop.
        source: Who measured the loop: `engine`, `difference of two run lengths`, or `wall`.
    """

    set_up: float | None = None
    compile: float | None = None
    loop: float | None = None
    output: float | None = None
    loop_cpu: float | None = None
    source: str = "wall"


@dataclass(frozen=True)
class Series:
    """What an engine has produced so far; `read` may be called while the engine is still running.

    Attributes:
        frames: Frames written completely so far, loaded one by one on access.
        tracks: Tracks so far, or None where the scene tracks no body.
        timing: Known once the run has ended.
        time: Simulated time reached [s].
        failure: Reason, from the engine's own output, why the run is no result: one of `FAILURES`, or None.
        detail: One line about the failure.
        counters: The engine's own figures, shown beside ours (e.g. neighbour builds).
    """

    frames: Sequence[Frame]
    tracks: Tracks | None
    timing: Timing = field(default_factory=Timing)
    time: float = 0.0
    failure: str | None = None
    detail: str = ""
    counters: dict[str, float] = field(default_factory=dict)


class Checkpoint(Model):
    """A complete state that an engine has written during a run.

    Attributes:
        step: Step number.
        time: Simulated time [s].
        note: One line where a later checkpoint was passed over, e.g. because it is damaged; else empty.
    """

    step: int
    time: float
    note: str = ""


def end_of(path: Path, length: int = 4096) -> str:
    """The last bytes of a text file, of its first line perhaps a part; empty where there is none."""
    try:
        with open(path, "rb") as stream:
            stream.seek(max(0, stream.seek(0, SEEK_END) - length))
            return stream.read().decode(errors="replace")
    except OSError:
        return ""


def order_of_contacts(scene: Scene, lagging: bool) -> float:
    """Order of accuracy that contacts leave to a method of second order.

    A method does not know when within a step two bodies touch. A force that sets in as x^p with the overlap x gives an
    error of (v dt)^(p+1)/v in the first step: order 2.5 for the spring of Hertz, which leaves the 2 of the method, 1.25
    for its dashpot with x^(1/4), 1 for a linear dashpot, which sets in at once.

    Args:
        scene: The scene; pairs with a restitution of 1 have no dashpots.
        lagging: Whether dashpots take the velocity of half a step before, which is of first order.
    """
    if not any(pair.restitution < 1 for pair in scene.pair_laws):
        return 2.0
    return 1.25 if isinstance(scene.law, HertzMindlin) and not lagging else 1.0


FAILURES = ("nan", "lost particles", "energy", "tunnelling", "memory", "signal", "no output", "engine error")


class Engine(ABC):
    """An engine: simulates a scene by writing its input, launching it and reading its output.

    Class attributes:
        name: Name on the command line.
        title: One line for tables.
        colour: Fixed colour in all figures.
        dashed: Whether its lines are dashed.
        settings_type: Its EngineSettings.
        cores_setting: Setting that says among how many cores a step is shared; None where there is none.
        imported: Whether results that others computed with the same program can be imported under its name.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    colour: ClassVar[str]
    dashed: ClassVar[bool] = False
    settings_type: ClassVar[type[EngineSettings]]
    cores_setting: ClassVar[str | None] = None
    imported: ClassVar[bool] = True

    @abstractmethod
    def probe(self) -> Probe:
        """Looks for the engine; never raises."""

    @abstractmethod
    def unsupported(self, scene: Scene) -> list[str]:
        """Features of the scene that the engine cannot do, one line each; never a silent approximation."""

    @abstractmethod
    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """Default settings for a scene in a division, as arguments of `settings_type`."""

    @abstractmethod
    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        """Writes the complete, runnable input into an existing directory and says how to launch it.

        Raw frames belong in the sub-directory `FRAMES`, checkpoints in `CHECKPOINTS`.
        """

    @abstractmethod
    def read(self, scene: Scene, settings: Any, directory: Path) -> Series:
        """Reads what the engine has written so far into the directory."""

    def checkpoint(self, scene: Scene, settings: Any, directory: Path) -> Checkpoint | None:
        """The checkpoint in a deck directory from which `resume` goes on: the last one that is whole.

        It only reads. None where there is none, which is what an engine without checkpoints says.
        """
        return None

    def resume(self, scene: Scene, settings: Any, directory: Path) -> list[Phase] | None:
        """Prepares a deck directory for going on from its checkpoint and says how to launch that.

        Called only while no process of an earlier attempt is alive. Frames, tracks and logs up to the checkpoint stay;
        those after it are removed, or written again by the phases, so that `read` never gives a time twice. `Timing`
        and counters of a resumed run are those of the whole run as far as it counts, without the steps that an
        interruption lost.

        Returns:
            The phases, or None where there is no checkpoint and the run begins anew.
        """
        return None

    def reached(self, settings: Any, directory: Path) -> float | None:
        """Simulated time that a running launch has reached [s], found in well under a millisecond for its progress.

        None where nothing is known yet, or where only `read` finds it.
        """
        return None

    def law(self, scene: Scene, settings: Any) -> str:
        """Contact law that the engine computes for a scene, in a few words; empty where it is the scene's own law."""
        return ""

    def order(self, scene: Scene, settings: Any) -> float | None:
        """Order of accuracy in the time step that the method has in theory for a scene; None where none is known."""
        return None

    def passes(self, steps: int, settings: Mapping[str, Any], counters: Mapping[str, float]) -> float:
        """Passes over the contacts in a run, the measure of work that no machine enters; one in a step by default.

        Args:
            steps: Time steps of the run.
            settings: Its settings.
            counters: The engine's own figures of it.
        """
        return float(steps)

    def forceable(self, scene: Scene, settings: Any) -> list[str]:
        """Features that the scene lacks and the engine can compute all the same, by its setting `force`.

        An ablation measures with them what leaving out saves; none where an engine has no such setting.
        """
        return []

    def estimate(self, scene: Scene, settings: Any) -> float | None:
        """Estimated wall time of a run [s], for planning; None where the engine has no guess."""
        return None

    def settings(self, scene: Scene, division: Division, overrides: dict[str, str] | None = None) -> Any:
        """The settings of a run: defaults of the division, then overrides; `dt` is fitted to the sampling.

        Raises:
            SettingsError: An override has an unknown name (the nearest known one is named) or a value not accepted.
        """
        known = list(self.settings_type.model_fields)
        for key in overrides or {}:
            if key not in known:
                hint = nearest(key, known)
                raise SettingsError(f"{self.name} has no setting '{key}'.{hint} Accepted are {', '.join(known)}.")
        try:
            made = self.settings_type(**{**self.defaults(scene, division), **(overrides or {})})
        except ValidationError as error:
            fault = error.errors()[0]
            text = fault["msg"].removeprefix("Value error, ")
            if not fault["loc"]:  # settings that contradict each other: the message names them
                raise SettingsError(f"{self.name}: {text}") from None
            where = ".".join(str(part) for part in fault["loc"])
            raise SettingsError(f"{self.name}[{where}]: {text} (given: {fault.get('input')!r})") from None
        return made.model_copy(update={"dt": scene.fitted_step(made.dt)})

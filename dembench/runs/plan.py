"""From a request to runs: scenes x engines with settings x repeats, each with its hash, state and estimate."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dembench.engines import registry
from dembench.engines.base import Checkpoint, Division, Engine, Probe
from dembench.results.schema import not_recorded
from dembench.runs.directory import RunDirectory
from dembench.runs.environment import available_cores
from dembench.runs.spec import RunSpec
from dembench.runs.states import RESUMED, Status
from dembench.scene import Scene

_CHOICE = re.compile(r"(?P<name>[A-Za-z][A-Za-z0-9_-]*)(?:\[(?P<settings>[^\[\]]*)\])?")


class RequestError(ValueError):
    """A request that cannot be planned; the message says what would be accepted."""


@dataclass(frozen=True)
class EngineChoice:
    """An engine with settings that replace its defaults.

    Attributes:
        engine: Its name.
        overrides: Settings as typed.
        given: Settings that come with the problem; what was typed replaces them.
    """

    engine: str
    overrides: dict[str, str] = field(default_factory=dict)
    given: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SceneChoice:
    """A scene with the words that it was asked for.

    Attributes:
        case: Case as typed, or the name of a scene file.
        preset: Preset of the case, None for a scene file.
        seed: Seed of its initial state.
        scene: The scene.
        unsettled: Whether its initial state is still to be generated, so that others stand for its positions.
    """

    case: str
    preset: str | None
    seed: int
    scene: Scene
    unsettled: bool = False


@dataclass(frozen=True)
class PlannedRun:
    """A run that was asked for.

    Attributes:
        spec: What identifies it.
        scene: Its scene.
        engine: Its engine.
        settings: Settings of the engine.
        probe: What was found of the engine on this machine.
        unsupported: Features of the scene that the engine cannot do.
        directory: Where it takes place.
        before: Status of an earlier run of the same hash, or None.
        checkpoint: Where that run can be gone on with; None where it cannot or need not.
        unsettled: As of the scene's choice: it has no hash yet and cannot be carried out.
    """

    spec: RunSpec
    scene: Scene
    engine: Engine
    settings: Any
    probe: Probe
    unsupported: tuple[str, ...]
    directory: RunDirectory
    before: Status | None
    checkpoint: Checkpoint | None = None
    unsettled: bool = False

    def action(self, fresh: bool = False) -> str:
        """What a campaign does with it: `reuse`, `skip`, `missing`, `resume` or `run`."""
        if self.unsupported:
            return "skip"
        if self.before is not None and self.before.finished and not fresh:
            return "reuse"
        if not self.probe.available:
            return "missing"
        return "resume" if self.checkpoint is not None and not fresh else "run"


def split_list(text: str) -> list[str]:
    """Splits at the commas outside brackets: `a[x=1,y=2],b` gives two parts."""
    parts, depth, start = [], 0, 0
    for k, letter in enumerate(text):
        depth += (letter == "[") - (letter == "]")
        if letter == "," and depth == 0:
            parts.append(text[start:k])
            start = k + 1
    return [part.strip() for part in [*parts, text[start:]] if part.strip()]


def parse_engines(text: str) -> list[EngineChoice]:
    """Engines with settings from a text such as `a,b[dt=1e-6,threads=2]`.

    Raises:
        RequestError: The text has another form.
        UnknownEngine: No engine has that name.
    """
    found: list[EngineChoice] = []
    for part in split_list(text):
        match = _CHOICE.fullmatch(part)
        if match is None:
            raise RequestError(f"'{part}' is no engine; write a name, or a name with settings as in name[dt=1e-6]")
        try:
            registry.engine(match["name"])
        except ImportError as error:
            raise RequestError(f"engine '{match['name']}' cannot be loaded: {error}") from None
        overrides: dict[str, str] = {}
        for setting in split_list(match["settings"] or ""):
            key, equals, value = (piece.strip() for piece in setting.partition("="))
            if not (key and equals and value):
                raise RequestError(f"{match['name']}: '{setting}' is no setting; write name=value")
            if key in overrides:
                raise RequestError(f"{match['name']}: setting '{key}' is given more than once")
            overrides[key] = value
        choice = EngineChoice(match["name"], overrides)
        if choice in found:
            raise RequestError(f"engine '{part}' is given more than once; use --repeat for timing samples")
        found.append(choice)
    if not found:
        raise RequestError(f"no engine is given; known are {', '.join(registry.names())}")
    return found


def plan(
    scenes: Iterable[SceneChoice],
    engines: Sequence[EngineChoice],
    out: Path,
    *,
    division: Division = "closed",
    repeats: int = 1,
    timeout: float | None = None,
) -> list[PlannedRun]:
    """The runs of a request; repeats are interleaved, so that a slow drift of the machine meets all engines.

    Args:
        scenes: Scenes.
        engines: Engines with settings.
        out: Directory that holds the run directories.
        division: `closed` or `open`.
        repeats: Number of timing samples of each run.
        timeout: Time limit of each run [s].

    Raises:
        RequestError: A run needs more cores than there are, the scene records what cannot be computed, or a run is
            asked for twice.
        SettingsError: A setting is not known or not accepted.
    """
    probes = {choice.engine: registry.engine(choice.engine).probe() for choice in engines}
    runs = []
    for chosen in scenes:
        if refused := not_recorded(chosen.scene):
            raise RequestError("\n".join(refused))
        digest = chosen.scene.digest()
        for repeat in range(1, repeats + 1):
            for choice in engines:
                runs.append(_planned(chosen, digest, choice, probes[choice.engine], out, division, repeat, timeout))
    names = [run.spec.name() for run in runs]
    if twice := [run.spec for run in runs if names.count(run.spec.name()) > 1]:
        raise RequestError(f"{twice[0].case} with {twice[0].label()} is asked for more than once; use --repeat")
    return runs


def _planned(
    chosen: SceneChoice,
    digest: str,
    choice: EngineChoice,
    probe: Probe,
    out: Path,
    division: Division,
    repeat: int,
    timeout: float | None,
) -> PlannedRun:
    engine, scene = registry.engine(choice.engine), chosen.scene
    settings = engine.settings(scene, division, {**choice.given, **choice.overrides})
    cores, there = settings.cores(), len(available_cores())
    if cores > there:
        raise RequestError(
            f"{choice.engine} asks for {cores} cores and {there} can be used here; choose settings with at most {there}"
        )
    spec = RunSpec(
        case=chosen.case,
        preset=chosen.preset,
        engine=choice.engine,
        engine_version=probe.version,
        overrides=choice.overrides,
        given=choice.given,
        settings=settings.model_dump(mode="json"),
        division=division,
        seed=chosen.seed,
        repeat=repeat,
        scene_digest=digest,
        scene_name=scene.name,
        bodies=len(scene.bodies),
        duration=scene.duration,
        cores=cores,
        law=engine.law(scene, settings),
        precision=settings.precision(),
        device=settings.device(),
        timeout=timeout,
        estimate=engine.estimate(scene, settings),
    )
    directory = RunDirectory(out / spec.name())
    before, checkpoint = directory.status(), None
    if before is not None and before.state in RESUMED:
        checkpoint = engine.checkpoint(scene, settings, directory.deck)
    return PlannedRun(
        spec=spec,
        scene=scene,
        engine=engine,
        settings=settings,
        probe=probe,
        unsupported=tuple(engine.unsupported(scene)),
        directory=directory,
        before=before,
        checkpoint=checkpoint,
        unsettled=chosen.unsettled,
    )

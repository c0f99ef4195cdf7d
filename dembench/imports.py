"""Results of other programs as run directories: the same scene, quantities, references and page as every run."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dembench import __version__
from dembench.campaign import judged
from dembench.cases.base import CaseError, Preset
from dembench.cases.registry import parse_case
from dembench.engines.base import Division
from dembench.initial.progress import Progress, silent
from dembench.results import Result, write
from dembench.results.foreign import Foreign, ForeignError, read_foreign
from dembench.results.imported import imported
from dembench.runs.directory import RunDirectory, RunRecord, find_runs, now
from dembench.runs.spec import RunSpec
from dembench.runs.states import Status
from dembench.runs.supervise import command_line
from dembench.scene import Scene, SceneError
from dembench.scene.checks import check_scene

UNKNOWN_LAW = "that of the program it comes from"
TIMINGS = "timings.json"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_FILE = re.compile(
    r"case1_(?P<orifice>large|small)_(?P<material>M1|M2)_(?P<silo>\w+)|case2_(?P<drum>\w+)"
    r"|case3_(?P<bed>25k|50k|100k)_(?P<impact>\w+)"
)
"""Names of the files of a folder without their endings: case, variant, program."""


@dataclass(frozen=True)
class Origin:
    """What is known about results that come from elsewhere.

    Attributes:
        preset: Preset of the case that was computed.
        division: Division in which the results stand.
        seed: Seed of the initial state.
        initial: Published initial state that was computed from; None takes the scene of a run in `out` where there is
            one, else that of the quick preset.
        law: Contact law that was computed, in words.
        out: Directory of the runs.
    """

    preset: Preset = "published"
    division: Division = "closed"
    seed: int = 0
    initial: Path | None = None
    law: str = UNKNOWN_LAW
    out: Path = Path("runs")


def import_file(
    case: str,
    path: Path,
    engine: str,
    origin: Origin,
    wall: float | None = None,
    progress: Progress = silent,
    scenes: dict[str, tuple[str, Scene]] | None = None,
) -> RunRecord:
    """Puts a result of another program among the runs; one that is there already is made anew.

    Args:
        case: Case as in `case3[bed=25k]`.
        path: CSV, npz or HDF5 file.
        engine: Name of the program.
        origin: What else is known.
        wall: Wall time that the program took, on whatever machine [s]; None takes `wall_s` of the file.
        progress: Called while an initial state is generated.
        scenes: Cases as typed in the runs and scenes by case, of files before this one; it is added to them.

    Raises:
        CaseError, SceneError, ForeignError: The case, the file, or both together cannot be used. Nothing is written
            then.
    """
    if not _NAME.fullmatch(engine):
        raise ForeignError(f"'{engine}' is no name of a program; accepted are letters, digits, _ and -, a letter first")
    file = read_foreign(path)
    scenes = {} if scenes is None else scenes
    if case not in scenes:
        scenes[case] = _scene(case, origin, progress)
    text, scene = scenes[case]
    series = imported(scene, text, file)
    scalars = file.scalars
    spec = RunSpec(
        case=text,
        preset=origin.preset,
        engine=engine,
        engine_version=f"file {file.sha256[:12]}",
        settings={"dt": scalars["dt"]} if "dt" in scalars else {},
        division=origin.division,
        seed=origin.seed,
        scene_digest=scene.digest(),
        scene_name=scene.name,
        bodies=len(scene.bodies),
        duration=scene.duration,
        cores=0,
        law=origin.law,
        device="",
        imported=path.name,
    )
    result = Result(
        scene=scene,
        engine=engine,
        division=origin.division,
        settings=spec.settings,
        observables=series.observables,
        provenance=_provenance(spec, file, series.notes, scalars.get("wall_s") if wall is None else wall),
    )
    reached = max(float(o.time[-1]) for o in series.observables.values())
    verdict = judged(spec, scene, result)
    status = Status(state=verdict.state, scored=verdict.scored, detail=verdict.detail, time=reached)
    return _written(origin.out, spec, result, status)


def import_folder(folder: Path, origin: Origin, progress: Progress = silent) -> tuple[list[RunRecord], list[str]]:
    """Puts all results of a folder among the runs: `case1_large_M1_NAME.npz`, `case2_NAME.npz`, `case3_25k_NAME.npz`.

    Wall times are those of its `timings.json`.

    Returns:
        The runs, and one line for each file that could not be used.

    Raises:
        ForeignError: The folder has no such file, or its timings are no JSON object of numbers.
    """
    named = [(path, match) for path in sorted(folder.iterdir()) if (match := _FILE.fullmatch(path.stem))]
    if not named:
        raise ForeignError(f"{folder}: no file is called like case1_large_M1_NAME, case2_NAME or case3_25k_NAME")
    walls = _timings(folder / TIMINGS)
    runs: list[RunRecord] = []
    refused: list[str] = []
    scenes: dict[str, tuple[str, Scene]] = {}
    for path, match in named:
        found = match.groupdict()
        engine = (found["silo"] or found["drum"] or found["impact"]).replace("_", "-")
        try:
            runs.append(import_file(_case(found), path, engine, origin, walls.get(path.stem), progress, scenes))
        except (CaseError, ForeignError, SceneError) as error:
            refused.append(str(error))
    return runs, refused


def _case(found: dict[str, Any]) -> str:
    """The case of a file's name; what is the default is left out."""
    if found["drum"]:
        return "case2"
    name, keys = ("case1", ("orifice", "material")) if found["silo"] else ("case3", ("bed",))
    defaults = parse_case(name)[1]
    changed = [f"{key}={found[key]}" for key in keys if getattr(defaults, key) != found[key]]
    return f"{name}[{','.join(changed)}]" if changed else name


def _timings(path: Path) -> dict[str, float]:
    try:
        data = json.loads(path.read_text())
        return {str(name): float(value) for name, value in data.items()}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise ForeignError(f"{path}: {error}; accepted is a JSON object with a wall time [s] by file name") from None


def _scene(case: str, origin: Origin, progress: Progress) -> tuple[str, Scene]:
    """Case as typed before and its scene: that of a run of the same problem where there is one."""
    known, parameters = parse_case(case)
    known.check(parameters, origin.preset, origin.initial)
    if origin.initial is None:
        for record in find_runs(origin.out):
            if _is_same(record.spec, known, parameters, origin) and record.result is not None:
                return record.spec.case, record.result.scene
        if origin.preset == "published":
            raise ForeignError(
                f"{case}, published: {origin.out} has no run of it whose scene could be taken; "
                "give the initial state (--initial DIRECTORY, or dosta2024), or run the case first"
            )
    scene = known.scene(parameters, origin.preset, origin.initial, origin.seed, progress)
    check_scene(scene)
    return case, scene


def _is_same(spec: RunSpec, case: Any, parameters: Any, origin: Origin) -> bool:
    if (spec.preset, spec.seed) != (origin.preset, origin.seed):
        return False
    try:
        other, values = parse_case(spec.case)
    except CaseError:
        return False
    return other.name == case.name and values == parameters


def _provenance(spec: RunSpec, file: Foreign, notes: tuple[str, ...], wall: float | None) -> dict[str, Any]:
    return {
        "imported": {
            "file": file.path.name,
            "format": file.format,
            "sha256": file.sha256,
            "columns": list(file.columns),
            "notes": list(notes),
            "wall": wall,
        },
        "engine_version": spec.engine_version,
        "dembench": __version__,
        "run": spec.name(),
        "hash": spec.digest(),
        "command": command_line(),
        "written": now(),
    }


def _written(out: Path, spec: RunSpec, result: Result, status: Status) -> RunRecord:
    """The run in its directory, all of which is known before the first file is written."""
    directory = RunDirectory(out / spec.name())
    directory.claim(spec)
    write(replace(result, status=status.plain()), directory.result)
    directory.write_status(status)
    return RunRecord(directory.path)

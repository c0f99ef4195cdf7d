"""Results of other programs as run directories: the same scene, quantities, references and page as every run."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dembench import __version__
from dembench.campaign import judged
from dembench.cases.base import Case, CaseError, Preset
from dembench.cases.initial_states import NoInitialState
from dembench.cases.registry import parse_case
from dembench.engines import registry
from dembench.engines.base import Division
from dembench.initial.filling import unsettled
from dembench.initial.progress import Progress, silent
from dembench.results import Result, write
from dembench.results.foreign import Foreign, ForeignError, read_foreign
from dembench.results.imported import check_columns, imported
from dembench.runs.directory import RunDirectory, RunRecord, find_runs, now
from dembench.runs.spec import RunSpec
from dembench.runs.states import Status
from dembench.runs.supervise import command_line
from dembench.scene import Scene, SceneError, Trajectory, ZoneCount
from dembench.scene.checks import check_scene

UNKNOWN_LAW = "that of the program it comes from"
TIMINGS = "timings.json"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_FILE = re.compile(
    r"case1_(?P<orifice>large|small)_(?P<material>M1|M2)_(?P<silo>.+)|case2_(?P<drum>.+)"
    r"|case3_(?P<bed>25k|50k|100k)_(?P<impact>.+)"
)
"""Names of the files of a folder without their endings: case, variant, program."""
LIKE = "case1_large_M1_NAME, case2_NAME or case3_25k_NAME"


@dataclass(frozen=True)
class Origin:
    """What is known about results that come from elsewhere.

    Attributes:
        preset: Preset of the case that was computed.
        division: Division in which the results stand.
        seed: Seed of the initial state.
        initial: Published initial state that was computed from; None takes the scene of a run in `out` where there is
            one. Where bodies are only counted as a whole it is not needed.
        law: Contact law that was computed, in words.
        out: Directory of the runs.
    """

    preset: Preset = "published"
    division: Division = "closed"
    seed: int = 0
    initial: Path | None = None
    law: str = UNKNOWN_LAW
    out: Path = Path("runs")


@dataclass(frozen=True)
class Posed:
    """The problem that files hold results of.

    Attributes:
        case: Case as typed.
        scene: Its scene.
        notes: What is not known of it, one line each.
    """

    case: str
    scene: Scene
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Folder:
    """What became of a folder of results.

    Attributes:
        runs: One for each file that was imported.
        refused: One line for each file that could not be used.
        left_out: Names of the files that are not called like results.
    """

    runs: tuple[RunRecord, ...]
    refused: tuple[str, ...]
    left_out: tuple[str, ...]


def import_file(
    case: str,
    path: Path,
    engine: str,
    origin: Origin,
    wall: float | None = None,
    progress: Progress = silent,
    posed: dict[str, Posed] | None = None,
) -> RunRecord:
    """Puts a result of another program among the runs; one that is there already is made anew.

    Args:
        case: Case as in `case3[bed=25k]`.
        path: CSV, npz or HDF5 file.
        engine: Name of the program. One that is an engine here, too, keeps its name; that the result comes from
            elsewhere stands beside it.
        origin: What else is known.
        wall: Wall time that the program took, on whatever machine [s]; None takes `wall_s` of the file.
        progress: Called while an initial state is generated.
        posed: Problems of the files before this one, by case; it is added to them.

    Raises:
        CaseError, SceneError, ForeignError: The case, the file, or both together cannot be used. Nothing is written
            then.
    """
    _check_name(engine)
    file = read_foreign(path)
    posed = {} if posed is None else posed
    if case not in posed:
        posed[case] = _posed(case, origin, file, progress)
    text, scene = posed[case].case, posed[case].scene
    series = imported(scene, text, file)
    notes = (*posed[case].notes, *series.notes)
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
        provenance=_provenance(spec, file, notes, scalars.get("wall_s") if wall is None else wall),
    )
    reached = max(float(o.time[-1]) for o in series.observables.values())
    verdict = judged(spec, scene, result)
    status = Status(state=verdict.state, scored=verdict.scored, detail=verdict.detail, time=reached)
    return _written(origin.out, spec, result, status)


def import_folder(folder: Path, origin: Origin, progress: Progress = silent) -> Folder:
    """Puts all results of a folder among the runs: `case1_large_M1_NAME.npz`, `case2_NAME.npz`, `case3_25k_NAME.npz`.

    Wall times are those of its `timings.json`.

    Raises:
        ForeignError: The folder has no such file, or its timings are no JSON object of numbers.
    """
    named = [(path, match) for path in sorted(folder.iterdir()) if (match := _FILE.fullmatch(path.stem))]
    if not named:
        raise ForeignError(f"{folder}: no file is called like {LIKE}")
    others = {path.name for path in folder.iterdir()} - {path.name for path, _ in named} - {TIMINGS}
    walls = _timings(folder / TIMINGS)
    runs: list[RunRecord] = []
    refused: list[str] = []
    posed: dict[str, Posed] = {}
    for path, match in named:
        found = match.groupdict()
        engine = (found["silo"] or found["drum"] or found["impact"]).replace("_", "-")
        try:
            runs.append(import_file(_case(found), path, engine, origin, walls.get(path.stem), progress, posed))
        except (CaseError, ForeignError, SceneError) as error:
            refused.append(str(error))
    return Folder(tuple(runs), tuple(refused), tuple(sorted(others)))


def _check_name(engine: str) -> None:
    if not _NAME.fullmatch(engine):
        raise ForeignError(f"'{engine}' is no name of a program; accepted are letters, digits, _ and -, a letter first")
    try:
        own = engine in registry.names() and not registry.engine(engine).imported
    except ImportError:  # a program all the same
        return
    if own:
        raise ForeignError(
            f"'{engine}' is an engine of this package, whose results come from its runs; give the program another name"
        )


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


def _posed(case: str, origin: Origin, file: Foreign, progress: Progress) -> Posed:
    """The case as typed before with the scene of a run of the same problem where there is one, else its own.

    Faults of the file come before those of the initial state, which is generated only where it has to be.
    """
    known, parameters = parse_case(case)
    known.check(parameters, origin.preset, origin.initial)
    if origin.initial is None:
        for record in find_runs(origin.out):
            if _is_same(record.spec, known, parameters, origin) and record.result is not None:
                return Posed(record.spec.case, record.result.scene)
    scene, lattice, missing = _at_hand(known, parameters, origin)
    check_columns(scene, case, file)
    own = "" if lattice else ": the scene's is a fill of our own"
    notes = [] if missing is None else [f"{origin.initial} has no initial state of this problem{own}"]
    if not any(isinstance(o, ZoneCount | Trajectory) for o in scene.observables):
        if lattice:
            scene = scene.model_copy(update={"name": f"{scene.name}_unsettled"})
            notes.append("grains are only counted: where they start is not known here and stands for nothing")
    elif missing is not None:
        raise missing
    elif origin.initial is None and origin.preset == "published":
        raise ForeignError(
            f"{case}, published: {origin.out} has no run of it whose scene could be taken; "
            "give the initial state (--initial DIRECTORY, or dosta2024), or run the case first"
        )
    elif lattice:
        scene = known.scene(parameters, origin.preset, origin.initial, origin.seed, progress)
    check_scene(scene)
    return Posed(case, scene, tuple(notes))


def _at_hand(known: Case, parameters: Any, origin: Origin) -> tuple[Scene, bool, NoInitialState | None]:
    """The scene without generating anything.

    Returns:
        The scene, whether its grains stand on a lattice, and what was raised where the given directory lacks their
        places.
    """
    missing = None
    with unsettled() as lattices:
        try:
            scene = known.scene(parameters, origin.preset, origin.initial, origin.seed)
        except NoInitialState as error:
            missing = error
            scene = known.scene(parameters, origin.preset, None, origin.seed)
    return scene, bool(lattices), missing


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

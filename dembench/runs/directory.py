"""The directory of one run: what it holds, who may write it, and how it reads when its supervisor is gone."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import socket
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import psutil
from pydantic import ValidationError

from dembench.atomic import write_json
from dembench.engines.base import end_of
from dembench.results import Result, ResultError, read
from dembench.runs.spec import RunSpec
from dembench.runs.states import RESUMED, Status

TAIL_LINES = 40
_TAIL_BYTES = 16_000
ENGINE_PATIENCE = 15.0
"""Time that the engine of a killed supervisor has for its end [s]."""


class Occupied(RuntimeError):
    """Another supervisor that is alive works in the directory."""


class RunDirectory:
    """Paths and records of one run.

    It holds `spec.json`, `supervisor.json`, `environment.json`, `deck/`, `log/`, `result.h5`, and `status.json`, which
    is written last: a directory without it is that of a run that goes on, or was cut off. `environment-<k>.json` is
    the environment of attempt k of a run that was gone on with later.
    """

    def __init__(self, path: Path) -> None:
        """The run in that directory, which need not exist."""
        self.path = path
        self.deck = path / "deck"
        self.log = path / "log"
        self.result = path / "result.h5"

    def claim(self, spec: RunSpec, keep: bool = False) -> Status | None:
        """Takes the directory for a run by this process.

        It is made anew, unless `keep` is set and holds an attempt that ended in one of the states `RESUMED`. Waits for
        the engine of a supervisor that was killed: it may still be writing its last checkpoint.

        Args:
            spec: The run.
            keep: Leaves such an attempt where it is, to go on with it.

        Returns:
            The status of the attempt that is kept, None where the directory is new.

        Raises:
            Occupied: A live supervisor works there.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self._claims():
            if (owner := self.supervisor()) is not None:
                raise Occupied(f"{self.path} is in use by process {owner}")
            self._wait_for_engine()
            before = self.status() if keep else None
            if before is None or before.state not in RESUMED:
                self.renew(spec)
                return None
            (self.path / "status.json").unlink(missing_ok=True)
            self._own(spec)
            return before

    def renew(self, spec: RunSpec) -> None:
        """Makes the directory anew; only for the process that has claimed it.

        What an earlier attempt left is kept as `.<name>.previous` beside it, the one before that is removed.
        """
        previous = self.path.with_name(f".{self.path.name}.previous")
        if self.path.exists():
            shutil.rmtree(previous, ignore_errors=True)
            os.replace(self.path, previous)
        self.path.mkdir()
        self._own(spec)
        self.deck.mkdir()
        self.log.mkdir()

    def watch(self, engine: int) -> None:
        """Notes the process that carries the engine, which may outlive this one by some seconds."""
        owner = json.loads((self.path / "supervisor.json").read_text())
        write_json(self.path / "supervisor.json", {**owner, "engine": _identity(psutil.Process(engine))})

    def supervisor(self) -> int | None:
        """Process id of the supervisor that works here, or None where there is none or it is gone."""
        if (self.path / "status.json").exists():
            return None
        return _alive(self._owner())

    def write_environment(self, environment: dict[str, Any]) -> None:
        """Writes `environment.json`; that of an earlier attempt gets its number."""
        file = self.path / "environment.json"
        if file.exists():
            os.replace(file, self.path / f"environment-{len(list(self.path.glob('environment-*.json'))) + 1}.json")
        write_json(self.path / "environment.json", environment)

    def write_status(self, status: Status) -> None:
        """Writes `status.json`: the run has ended."""
        write_json(self.path / "status.json", status.plain())

    def spec(self) -> RunSpec:
        """The spec; ValueError or OSError where there is none."""
        data = json.loads((self.path / "spec.json").read_text())
        data.pop("hash", None)
        return RunSpec.model_validate(data)

    def status(self) -> Status | None:
        """How the run ended; `running` or `interrupted` where it has not; None where there is no run."""
        if not (self.path / "spec.json").exists():
            return None
        try:
            return Status.model_validate_json((self.path / "status.json").read_text())
        except (OSError, ValidationError):
            pass
        if (owner := self.supervisor()) is not None:
            return Status(state="running", detail=f"by process {owner}")
        return Status(
            state="interrupted",
            reason="supervisor gone",
            detail="the process that ran it ended without a word; the result is that of its last checkpoint",
            log_tail=self.log_tail(),
        )

    def log_tail(self) -> str:
        """The last lines of every log that is not empty, in the order in which they were written."""
        files = sorted((p for p in self.log.glob("*.*") if p.stat().st_size), key=lambda p: p.stat().st_mtime)
        parts = []
        for path in files:
            parts += [f"--- {path.name}", *end_of(path, _TAIL_BYTES).splitlines()[-TAIL_LINES:]]
        return "\n".join(parts)

    @contextmanager
    def _claims(self) -> Iterator[None]:
        """One process at a time decides who takes a directory beside this one."""
        with open(self.path.parent / ".claims", "w") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            yield

    def _own(self, spec: RunSpec) -> None:
        write_json(self.path / "supervisor.json", _identity(psutil.Process()))
        write_json(self.path / "spec.json", {**spec.model_dump(mode="json"), "hash": spec.digest()})

    def _owner(self) -> dict[str, Any]:
        """What `supervisor.json` says; empty where it says nothing."""
        try:
            found = json.loads((self.path / "supervisor.json").read_text())
            return found if isinstance(found, dict) else {}
        except (OSError, ValueError):
            return {}

    def _wait_for_engine(self) -> None:
        if (engine := _alive(self._owner().get("engine", {}))) is None:
            return
        try:
            psutil.Process(engine).wait(ENGINE_PATIENCE)
        except psutil.TimeoutExpired:
            raise Occupied(f"{self.path}: process {engine} of an earlier attempt does not end") from None
        except psutil.Error:
            pass


def _identity(process: psutil.Process) -> dict[str, Any]:
    """What tells a process from a later one of the same number."""
    return {"pid": process.pid, "created": process.create_time(), "host": socket.gethostname()}


def _alive(identity: dict[str, Any]) -> int | None:
    """Number of a process that is still alive, or None."""
    try:
        process = psutil.Process(identity["pid"])
        same = abs(process.create_time() - identity["created"]) < 1 and process.status() != psutil.STATUS_ZOMBIE
        return process.pid if same and identity["host"] == socket.gethostname() else None
    except (KeyError, TypeError, ValueError, psutil.Error):
        return None


class RunRecord:
    """A run as others read it: `name`, `directory`, `spec`, `status`, `result`."""

    def __init__(self, directory: Path) -> None:
        """The run in that directory; ValueError or OSError where there is none."""
        self.directory = directory
        self.name = directory.name
        self._run = RunDirectory(directory)
        self.spec = self._run.spec()
        self.status: Status = self._run.status() or Status(state="interrupted")

    @cached_property
    def result(self) -> Result | None:
        """The result, partial where the run was cut off; None where there is none that can be read."""
        try:
            return read(self._run.result)
        except ResultError:
            return None

    @cached_property
    def environment(self) -> dict[str, Any]:
        """The machine and the engine as found at the start; empty where the run never started."""
        try:
            found: dict[str, Any] = json.loads((self.directory / "environment.json").read_text())
            return found
        except (OSError, ValueError):
            return {}


def find_runs(path: Path) -> list[RunRecord]:
    """The runs in a directory, or the one that it is, by name.

    A directory that looks like a run and cannot be read is left out with a warning.
    """
    found = []
    for candidate in [path, *sorted(path.iterdir())] if path.is_dir() else []:
        if candidate != path and (candidate.name.startswith(".") or not candidate.is_dir()):
            continue
        if not (candidate / "spec.json").exists():
            continue
        try:
            found.append(RunRecord(candidate))
        except (OSError, ValueError) as error:
            warnings.warn(f"{candidate}: no readable run: {error}", stacklevel=2)
    return found


def now() -> str:
    """The time in ISO 8601 with time zone."""
    return time.strftime("%Y-%m-%dT%H:%M:%S%z")

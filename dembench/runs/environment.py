"""The machine on which a run takes place."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import psutil

from dembench import __version__

BUSY_SHARE = 0.25
"""Share of a core in use by others before the start from which a run is marked as contended [-]."""
WAITED_SHARE = 0.05
"""Time waited for a core, as a share of the CPU time, from which a run is marked as contended [-]."""


def available_cores() -> tuple[int, ...]:
    """Numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return tuple(sorted(os.sched_getaffinity(0)))
    return tuple(range(os.cpu_count() or 1))


def last_cache() -> float | None:
    """Size of the largest cache of a core [B], or None where the system does not say it."""
    sizes = [_first_line(path) for path in Path("/sys/devices/system/cpu/cpu0/cache").glob("index*/size")]
    found = [re.fullmatch(r"(\d+)([KM]?)", size) for size in sizes if size]
    return max((int(m[1]) * {"": 1, "K": 2**10, "M": 2**20}[m[2]] for m in found if m), default=None)


@cache
def machine() -> dict[str, Any]:
    """What does not change while the program runs: processor, memory, GPU, system, packages, commit."""
    return {
        "cpu": _cpu_model(),
        "cores": len(available_cores()),
        "cores_machine": psutil.cpu_count(),
        "frequency_policy": _first_line(Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")) or "not known",
        "memory": psutil.virtual_memory().total,
        "gpu": _gpus(),
        "system": _system(),
        "kernel": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": dict(sorted((d.metadata["Name"], d.version) for d in distributions() if d.metadata["Name"])),
        "dembench": __version__,
        "commit": _commit(),
    }


def environment(cores: Sequence[int], busy: float | None) -> dict[str, Any]:
    """The machine, the cores of the run and the load at its start.

    Args:
        cores: Numbers of the cores that the run is pinned to.
        busy: Largest share of one of them that was in use before the start [-].
    """
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {**machine(), "pinned_to": list(cores), "load": load, "busy_before": busy}


def busy_shares(cores: Sequence[int], interval: float = 0.3) -> dict[int, float]:
    """Share of each core that is in use, measured over `interval` seconds [-]."""
    shares = psutil.cpu_percent(interval, percpu=True)
    return {core: shares[core] / 100 for core in cores if core < len(shares)}


def contended(busy: float | None, waited: float | None, cpu: float) -> bool:
    """Whether other programs held the cores of a run, before its start or while it ran.

    Args:
        busy: Share of its cores in use before the start [-].
        waited: Time that it waited for a core [s].
        cpu: Its CPU time [s].
    """
    return (busy or 0.0) > BUSY_SHARE or (waited or 0.0) > WAITED_SHARE * max(cpu, 1.0)


def _cpu_model() -> str:
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1].strip() if found else platform.processor() or platform.machine()


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return platform.platform()


def _gpus() -> list[str]:
    if shutil.which("nvidia-smi") is None:
        return []
    query = ["nvidia-smi", "--query-gpu=name,memory.total,driver_version", "--format=csv,noheader"]
    return _output(query).splitlines()


def _commit() -> str:
    """Commit of the checkout that the program runs from, with a mark where files differ; empty for a wheel."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return ""
    commit = _output(["git", "-C", str(root), "rev-parse", "--short=12", "HEAD"])
    changed = _output(["git", "-C", str(root), "status", "--porcelain", "--untracked-files=no"])
    return f"{commit} with changes" if commit and changed else commit


def _output(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        print(f"{command[0]}: {error}", file=sys.stderr)
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _first_line(path: Path) -> str:
    try:
        return path.read_text().splitlines()[0]
    except (OSError, IndexError):
        return ""

"""Runs a job script of MUSEN and ends as the run did: `musen_launch.py SCRIPT GRAINS WALLS PROGRAM ARGUMENT...`.

The program ends with exit code 0 after almost every error, and with an empty scene it never ends. This program keeps
its output as SCRIPT.log, stops it where it has not the objects that were written, and ends with status 1 where the log
or the result files do not show that every job was done. It needs the standard library alone.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

DONE = {
    "IMPORT_FROM_TEXT": "Import from text finished",
    "SIMULATOR": "Simulation finished",
    "EXPORT_TO_TEXT": "Export to text finished",
}
"""What the log says when a job is done, by component."""
_FAULT = re.compile(r"^(Error|Unknown|terminate called|\s*what\(\):).*", re.M)
_COUNT = re.compile(r"^Total number of (particles|walls):\s+(\d+)")
ENDED = "dembench: "
"""How the last line of a log begins; `done` follows, or what went wrong."""
TOOK = "Wall time from start to end [s]: "
"""How the line with the time between the program's own two messages about a simulation begins."""


def main(arguments: list[str]) -> int:
    """Runs the script; returns the exit status."""
    script, counts, command = Path(arguments[0]), arguments[1:3], arguments[3:]
    with open(script.with_suffix(".log"), "w") as log:
        fault = missing(script, "SOURCE_FILE", first=True)
        code = 0
        if not fault:
            code, fault = _run(command, dict(zip(("particles", "walls"), map(int, counts), strict=True)), log)
        log.flush()
        fault = fault or verdict(script, script.with_suffix(".log").read_text(errors="replace"), code)
        log.write(f"{ENDED}{fault or 'done'}\n")
    if fault:
        print(f"{ENDED}{fault}", file=sys.stderr)
    if code < 0 and -code != signal.SIGKILL:
        signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    return 1 if fault else 0


def _run(command: list[str], expected: dict[str, int], log) -> tuple[int, str]:
    """Exit code of the program, and why it was stopped."""
    fault = ""
    try:
        program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    except OSError as error:
        return 0, f"cannot start {command[0]}: {error.strerror}"
    assert program.stdout is not None
    started = time.monotonic()
    for raw in program.stdout:
        line = raw.decode(errors="replace")
        if "Simulation started" in line:
            started = time.monotonic()
        elif DONE["SIMULATOR"] in line:
            line += f"{TOOK}{time.monotonic() - started:.3f}\n"
        for stream in (log, sys.stdout):
            stream.write(line)
            stream.flush()
        count = _COUNT.match(line)
        if count and int(count[2]) != expected[count[1]]:
            fault = f"the program has {count[2]} {count[1]}, written were {expected[count[1]]}"
            program.kill()
    return program.wait(), fault


def verdict(script: Path, log: str, code: int) -> str:
    """What went wrong with a script that has ended with that log and exit code; nothing where all was done."""
    if said := _FAULT.search(log):
        return said[0].strip()
    if code < 0:
        return f"ended by {signal.Signals(-code).name}"
    if code:
        return f"exit code {code}"
    text = script.read_text()
    for component, sign in DONE.items():
        wanted, found = text.count(f"COMPONENT {component}\n"), log.count(sign)
        if found < wanted:
            return f"'{sign}' stands {found} times in the log, not {wanted} times"
    return missing(script, "RESULT_FILE")


def missing(script: Path, key: str, first: bool = False) -> str:
    """The first file of that key of a script that is not there or empty; the first key alone where asked for."""
    names = re.findall(rf"^{key} (.*)$", script.read_text(), re.M)
    for name in names[:1] if first else names:
        path = script.parent / name
        if not path.exists() or not path.stat().st_size:
            return f"{name} is missing or empty"
    return ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

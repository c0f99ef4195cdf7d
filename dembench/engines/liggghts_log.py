"""The logs of LIGGGHTS: how far it is, what went wrong, where its time went."""

from __future__ import annotations

import re

_STEP = re.compile(r"^ +(\d+) +\d+ +\S+ *$")
_LOOP = re.compile(r"^Loop time of (\S+) on")
_SPENT = re.compile(r"^(Pair|Neigh|Comm|Outpt|Other)\s+time \(%\) = (\S+)")
_COUNTED = {
    "Neighbor list builds": "neighbour_builds",
    "Dangerous builds": "dangerous_builds",
    "Ave neighs/atom": "neighbours_per_body",
}


def failure_in(log: str) -> tuple[str | None, str]:
    """Reason (one of `FAILURES`) and detail of a failure that a log tells of, or (None, "")."""
    error = re.search(r"^ERROR[^\n]*", log, re.M)
    if error:
        detail = error[0].strip()
        for sign, reason in (("Lost atoms", "lost particles"), ("Non-numeric", "nan"), ("allocate", "memory")):
            if sign in detail:
                return reason, detail
        return "engine error", detail
    unknown = re.search(r"^ +(\d+) +\d+ +-?nan *$", log, re.M)
    if unknown:
        return "nan", f"the kinetic energy is not a number at step {unknown[1]}"
    return None, ""


def last_step(log: str) -> int:
    """The last step that a log reports."""
    return max((int(step) for step in re.findall(r"^ +(\d+) +\d+ +\S+ *$", log, re.M)), default=0)


def timing_in(log: str, last: int) -> tuple[float | None, dict[str, float]]:
    """The program's own time of the stepping loops that ended by a step [s], output included, and its other figures.

    A run that is cut into parts tells the figures of each part; they are summed. Neither counts a part that did not
    end.
    """
    loop: float | None = None
    counters: dict[str, float] = {}
    step = 0
    for line in log.splitlines():
        if found := _STEP.match(line):
            step = int(found[1])
        if step > last:
            break
        if found := _LOOP.match(line):
            loop = (loop or 0.0) + float(found[1])
        elif found := _SPENT.match(line):
            name = f"{found[1].lower()}_s"
            counters[name] = counters.get(name, 0.0) + float(found[2])
        elif (label := line.partition(" = ")[0]) in _COUNTED:
            name, value = _COUNTED[label], float(line.partition(" = ")[2])
            counters[name] = value + (0.0 if name == "neighbours_per_body" else counters.get(name, 0.0))
    return loop, counters

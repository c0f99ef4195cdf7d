"""Facts in words: the scene and what was left out, the machine, the engines, the settings, the failures."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dembench.cases.registry import problem_title
from dembench.reports.cells import directory_cell, run_cell, state_cell
from dembench.reports.comparisons import verdict_text
from dembench.reports.entries import RANKED, Entry
from dembench.reports.groups import Group, Member
from dembench.reports.tables import Cell, Column, Table, grouped, numbers, significant
from dembench.reports.units import measure
from dembench.runs.states import Resumption
from dembench.scene import Scene, features

Facts = list[tuple[str, str]]
MOST_ITEMS = 20
"""Species, materials and pairs that are written out."""


@dataclass(frozen=True)
class Failure:
    """A run that is not ok: what is known about why."""

    name: str
    run: str
    state: str
    message: str
    facts: Facts
    log: str


# ---- the scene


def scene_facts(group: Group) -> Facts:
    """What was simulated; what is known of a scene that was never run is its name and size."""
    spec, scene = group.first.spec, group.first.scene
    seeds = sorted({e.spec.seed for e in group.entries})
    digests = sorted({e.spec.scene_digest for e in group.entries})
    found: Facts = [
        ("Scene", f"{spec.scene_name}, {grouped(spec.bodies, 0)} bodies, {measure(spec.duration, 's')} simulated"),
    ]
    if scene is not None:
        found += _contents(scene)
    found += [
        ("Division", _division(group)),
        ("Seeds", ", ".join(map(str, seeds))),
        ("SHA-256 of the scene", ", ".join(digests)),
    ]
    return found


def _division(group: Group) -> str:
    if len({e.spec.division for e in group.entries}) > 1:
        return "closed (the scene's law and time step) and open (each engine's best way), as the runs are named"
    spec, scene = group.first.spec, group.first.scene
    if spec.division != "closed":
        return f"{spec.division}: each engine's best way, behind the same accuracy gate"
    if scene is None:
        return "closed: the scene's law and time step"
    own = [f"{m.label} ({measure(m.shown.dt or 0, 's')})" for m in group.members if m.shown.own_step]
    deviating = f"; with a time step of their own: {', '.join(own)}" if own else ""
    laws = [f"{m.label} ({m.shown.spec.law})" for m in group.members if m.shown.spec.law]
    deviating += f"; with a contact law of their own: {', '.join(laws)}" if laws else ""
    return f"closed: the scene's law and its time step of {measure(scene.closed_step(), 's')}{deviating}"


def _contents(scene: Scene) -> Facts:
    present = features(scene)
    law = scene.law.kind + (f", variant {scene.law.variant}" if hasattr(scene.law, "variant") else "")
    walls = [f"{w.name} ({w.kind}, {w.material}{', moving' if w.motion else ''})" for w in scene.walls]
    return [
        ("Contact law", law),
        ("Species", _some(list(_species(scene)))),
        (
            "Materials",
            _some(
                [
                    f"{m.name}: {significant(m.density)} kg/m³, Young {significant(m.young / 1e9)} GPa, "
                    f"Poisson {significant(m.poisson)}"
                    for m in scene.materials
                ]
            ),
        ),
        (
            "Pairs",
            _some(
                [
                    f"{p.a}\u2013{p.b}: restitution {significant(p.restitution)}, friction {significant(p.friction)}"
                    + (f", rolling friction {significant(p.rolling_friction)}" if p.rolling_friction else "")
                    for p in scene.pair_laws
                ]
            ),
        ),
        ("Walls", "; ".join(walls) or "none"),
        ("Gravity", f"({', '.join(significant(g) for g in scene.gravity)}) m/s²"),
        (
            "Recorded",
            "; ".join(
                f"{o.name} ({o.kind}" + (f", every {measure(o.interval, 's')})" if hasattr(o, "interval") else ")")
                for o in scene.observables
            )
            or "nothing",
        ),
        ("Features present", words(present.names())),
        ("Left out", f"{words(present.absent())}; no kernel, buffer or command of a deck is there for them"),
    ]


def _some(items: Sequence[str]) -> str:
    """Items in one line; of many the first, and how many more the scene file has."""
    left = len(items) - MOST_ITEMS
    return "; ".join(items[:MOST_ITEMS]) + (f"; and {left} more in the scene" if left > 0 else "")


def _species(scene: Scene) -> Iterable[str]:
    radii = scene.radii()
    for k, s in enumerate(scene.species):
        own = radii[scene.bodies.species == k]
        if not len(own):
            continue
        low, high = 2 * float(np.min(own)), 2 * float(np.max(own))
        size = measure(low, "m") if low == high else f"{measure(low, 'm')} to {measure(high, 'm')}"
        yield f"{s.name}: {grouped(len(own), 0)} of {s.material}, diameter {size}"


def words(names: Iterable[str]) -> str:
    """Names of features as words."""
    return ", ".join(name.replace("_", " ") for name in names) or "none"


# ---- runs, engines, settings


def all_runs(groups: Sequence[Group]) -> Table:
    """Every run directory with its state: none is left out."""
    columns = (
        Column("Run directory", kind="wrap"),
        Column("State"),
        Column("Engine", kind="long"),
        Column("Division"),
        Column("Seed", kind="number"),
        Column("Repeat", kind="number"),
        Column("Simulated", "% of its time", "number"),
        Column("Wall time", "s", "number"),
        Column("Started", kind="line"),
    )
    listed = [(member, entry) for group in groups for member in group.members for entry in member.entries]
    shares = [100 * e.reached / e.spec.duration if e.spec.duration else None for _, e in listed]
    share = numbers(shares, digits=2, most=1)
    walls = numbers([e.status.wall for _, e in listed])
    rows = tuple(
        (
            directory_cell(e),
            state_cell(e.state, resumed(e)),
            run_cell(m),
            Cell(e.spec.division),
            Cell(str(e.spec.seed), e.spec.seed),
            Cell(str(e.spec.repeat), e.spec.repeat),
            share[k],
            walls[k],
            Cell(e.status.started[:16].replace("T", " "), e.status.started),
        )
        for k, (m, e) in enumerate(listed)
    )
    return Table("all-runs", "All runs", columns, rows)


def resumed(entry: Entry) -> str:
    """From where a run went on after interruptions; empty for one in one piece."""
    times = [measure(r.time, "s") for r in entry.status.resumed]
    return f"resumed at {', '.join(times)}" if times else ""


def problem_name(entry: Entry) -> str:
    """The problem in words, or the name of the scene of a file."""
    return problem_title(entry.spec.case, entry.spec.preset) if entry.spec.preset else entry.spec.scene_name


def engines(groups: Sequence[Group]) -> Table:
    """One row per engine and version that ran: what it is and what was found of it."""
    found: dict[tuple[str, str], tuple[Member, Entry]] = {}
    for group in groups:
        for member in group.members:
            for entry in member.entries:
                if not entry.spec.imported:
                    found.setdefault((entry.spec.engine, entry.spec.engine_version), (member, entry))
    columns = (
        Column("Engine", kind="long"),
        Column("What it is", kind="wrap"),
        Column("Version", kind="long"),
        Column("Program", kind="long"),
        Column("Build", kind="wrap"),
    )
    rows = []
    for (name, version), (member, entry) in sorted(found.items()):
        probe = entry.record.environment.get("engine", {})
        facts = "; ".join(f"{key}: {value}" for key, value in probe.get("facts", {}).items())
        rows.append(
            (
                Cell(name, colour=run_cell(member).colour),
                Cell(entry.look.title),
                Cell(version),
                Cell(probe.get("path") or ""),
                Cell(facts),
            )
        )
    return Table("engines-found", "Engines", columns, tuple(rows))


def settings(groups: Sequence[Group], titles: Sequence[str]) -> list[Table]:
    """One table per group: every setting of every member, and who chose it."""
    tables = []
    for group, title in zip(groups, titles, strict=True):
        rows = []
        for member in group.members:
            spec = member.shown.spec
            default = "the file" if spec.imported else f"default of the {spec.division} division"
            for key, value in spec.settings.items():
                by = "as typed" if key in spec.overrides else "the problem" if key in spec.given else default
                number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
                text = significant(number) if number is not None else json.dumps(value) if value is not None else "none"
                rows.append((run_cell(member), Cell(key), Cell(text.strip('"'), number), Cell(by)))
        columns = (Column("Engine", kind="long"), Column("Setting"), Column("Value", kind="long"), Column("Chosen by"))
        tables.append(Table(f"{group.name}-settings", f"Settings: {title}", columns, tuple(rows)))
    return tables


def counters(groups: Sequence[Group]) -> Table | None:
    """What the engines counted themselves; None where none did."""
    rows = tuple(
        (run_cell(member), directory_cell(entry), Cell(name.replace("_", " ")), *numbers([value], digits=4))
        for group in groups
        for member in group.members
        for entry in member.entries
        for name, value in entry.counters.items()
    )
    columns = (
        Column("Engine", kind="long"),
        Column("Run directory", kind="wrap"),
        Column("Counter"),
        Column("Value", kind="number"),
    )
    note = "Figures of the engines themselves, for cross-checks; they enter no comparison."
    return Table("counters", "Engines' own counters", columns, rows, note) if rows else None


# ---- machines

_NAMES = {
    "cpu": "Processor",
    "cores": "Cores available",
    "cores_machine": "Cores of the machine",
    "memory": "Memory",
    "gpu": "GPU",
    "frequency_policy": "Frequency policy",
    "system": "System",
    "kernel": "Kernel",
    "python": "Python",
    "dembench": "dembench",
    "commit": "Commit",
    "packages": "Python packages",
}
_PER_RUN = ("pinned_to", "load", "busy_before", "engine")


def environments(groups: Sequence[Group]) -> list[tuple[str, Facts]]:
    """The machines: one list of facts for each that differs, with the runs it was used for."""
    recorded = [(e.name, e.record.environment) for g in groups for e in g.entries if e.record.environment]
    alike: dict[str, tuple[dict[str, Any], list[str]]] = {}
    for name, environment in recorded:
        fixed = {k: v for k, v in environment.items() if k not in _PER_RUN}
        alike.setdefault(json.dumps(fixed, sort_keys=True, default=str), (fixed, []))[1].append(name)
    found = []
    for k, (fixed, names) in enumerate(alike.values()):
        title = "Machine and software" if len(alike) == 1 else f"Machine and software {k + 1} of {len(alike)}"
        ordered = sorted(fixed.items(), key=lambda item: isinstance(item[1], dict))
        facts = [(_NAMES.get(key, key), _plain(key, value)) for key, value in ordered]
        found.append((title, [(key, text) for key, text in facts if text] + [("Runs", ", ".join(names))]))
    return found


def load(groups: Sequence[Group]) -> Table | None:
    """Cores and load of each run; None where no run recorded them."""
    listed = [(m, e) for g in groups for m in g.members for e in m.entries if e.record.environment]
    if not listed:
        return None
    environment = [e.record.environment for _, e in listed]
    columns = (
        Column("Run directory", kind="wrap"),
        Column("Engine", kind="long"),
        Column("Pinned to cores"),
        Column("Load at start", kind="number", note="load average of one minute"),
        Column("Cores busy before", "%", "number"),
        Column("CPU time", "s", "number"),
        Column("Waited for a core", "s", "number"),
        Column("Contended"),
    )
    loads = numbers([v.get("load") for v in environment], digits=2, most=2)
    shares = [v.get("busy_before") for v in environment]
    busy = numbers([None if share is None else 100 * share for share in shares], digits=1, most=1)
    cpu = numbers([e.resources.get("cpu") for _, e in listed])
    waited = numbers([e.resources.get("waited") for _, e in listed], digits=2, most=2)
    rows = tuple(
        (
            directory_cell(e),
            run_cell(m),
            Cell(", ".join(map(str, environment[k].get("pinned_to", [])))),
            loads[k],
            busy[k],
            cpu[k],
            waited[k],
            Cell("yes", mark="mark") if e.status.contended else Cell("no"),
        )
        for k, (m, e) in enumerate(listed)
    )
    return Table("load", "Cores and load", columns, rows)


def _plain(key: str, value: Any) -> str:
    if key == "memory" and isinstance(value, int | float):
        return f"{value / 2**30:.1f} GiB"
    if isinstance(value, dict):
        return ", ".join(f"{name} {text}" for name, text in value.items())
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return "" if value is None else str(value)


# ---- failures


def failures(groups: Sequence[Group]) -> list[Failure]:
    """Every run that is not ok, with its log."""
    listed = [(member, entry) for group in groups for member in group.members for entry in member.entries]
    return [_failure(member, entry) for member, entry in listed if entry.state not in (*RANKED, "running")]


def _resumption(where: Resumption) -> str:
    text = f"at {measure(where.time, 's')} on {where.when[:16].replace('T', ' ')}"
    text += f", after {measure(where.reached, 's')} had been reached" if where.reached > where.time else ""
    return f"{text} ({where.note})" if where.note else text


def _failure(member: Member, entry: Entry) -> Failure:
    status = entry.status
    alone = Member((entry,), member.label, member.style)
    listed = [
        ("Run directory", entry.name),
        ("Reason", status.reason),
        ("Detail", status.detail),
        ("Phase", status.phase),
        ("Exit code", "" if status.exit_code is None else str(status.exit_code)),
        ("Signal", status.signal or ""),
        ("Simulated time reached", measure(entry.reached, "s") if status.started else ""),
        ("Frames recorded", f"{status.frames} of {status.frames_expected}" if status.frames_expected else ""),
        ("Resumed", "; ".join(_resumption(r) for r in status.resumed)),
        ("Earlier attempt", status.note),
        ("To get the engine", status.install),
    ]
    facts = [(name, text) for name, text in listed if text]
    run = f"{member.label}, {problem_name(entry)}"
    return Failure(entry.name, run, entry.state, verdict_text(alone), facts, status.log_tail)

"""The runs of a report gathered: repeats by seed, seeds by engine and settings, and all by problem and division."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any

from dembench.reports.entries import RANKED, Entry
from dembench.runs.directory import RunRecord


@dataclass(frozen=True)
class Member:
    """One engine with one setting and one seed: the repeats of one run.

    Attributes:
        entries: The repeats, by number.
        label: Name in tables and legends, unique within the group.
        style: Dash pattern and marker among the members of the same colour.
    """

    entries: tuple[Entry, ...]
    label: str
    style: int

    @property
    def shown(self) -> Entry:
        """The repeat that stands for all in figures and scores: the first that ran to its end, else the first."""
        return next((e for e in self.entries if e.state in RANKED), self.entries[0])

    @property
    def state(self) -> str:
        """The worst state of the repeats: one that failed is not hidden by those that did not."""
        states = [e.state for e in self.entries]
        return next((s for s in states if s not in RANKED), states[0])

    @property
    def loops(self) -> list[float]:
        """Loop times of the complete repeats [s]."""
        ended = [e for e in self.entries if e.complete and e.state in (*RANKED, "inaccurate")]
        return [e.loop for e in ended if e.loop is not None]

    @property
    def loop(self) -> float | None:
        """Median loop time of the complete repeats [s]."""
        return statistics.median(self.loops) if self.loops else None


@dataclass(frozen=True)
class Ensemble:
    """One engine with one setting: its runs with all seeds.

    Attributes:
        members: One per seed.
        label: Name in tables and legends, unique within the group.
    """

    members: tuple[Member, ...]
    label: str

    @property
    def ended(self) -> list[Member]:
        """The members that came to their end."""
        return [m for m in self.members if m.shown.complete and m.state in (*RANKED, "inaccurate")]

    @property
    def entries(self) -> list[Entry]:
        """All runs."""
        return [entry for member in self.members for entry in member.entries]

    @property
    def shown(self) -> Entry:
        """The run that stands for all where one is shown: of the first seed that came to its end, else the first."""
        return (self.ended or list(self.members))[0].shown

    @property
    def state(self) -> str:
        """The worst state of the members."""
        states = [m.state for m in self.members]
        return next((s for s in states if s not in RANKED), states[0])

    @property
    def loop(self) -> float | None:
        """Median loop time of the members [s]."""
        loops = [m.loop for m in self.members if m.loop is not None]
        return statistics.median(loops) if loops else None

    def values(self, quantity: str) -> list[float]:
        """A quantity of the members that came to their end and have it."""
        return [v for m in self.ended if (v := m.shown.quantity(quantity)) is not None]

    def first_with(self, snapshot: str) -> Member | None:
        """The first member with that snapshot, one that came to its end where there is one; None without any."""
        for member in (*self.ended, *self.members):
            result = member.shown.record.result
            if result is not None and snapshot in result.snapshots and len(result.snapshots[snapshot].time):
                return member
        return None


@dataclass(frozen=True)
class Group:
    """The runs of one problem, in one division unless both were gathered together.

    Attributes:
        name: Identifier on the page.
        members: In the order of first appearance of the engines.
    """

    name: str
    members: tuple[Member, ...]

    @property
    def entries(self) -> list[Entry]:
        """All runs."""
        return [entry for member in self.members for entry in member.entries]

    @property
    def first(self) -> Entry:
        """A run that has the scene where one has it."""
        return next((e for e in self.entries if e.scene is not None), self.entries[0])

    @cached_property
    def ensembles(self) -> tuple[Ensemble, ...]:
        """The members gathered by engine, version and settings."""
        found: dict[tuple[Any, ...], list[Member]] = {}
        for member in self.members:
            found.setdefault(_choice(member.shown), []).append(member)
        first = [m[0].shown for m in found.values()]
        labels = _unique(_names(first), first)
        return tuple(Ensemble(tuple(m), label) for m, label in zip(found.values(), labels, strict=True))

    @property
    def seeded(self) -> bool:
        """Whether an engine has several seeds."""
        return len(self.ensembles) < len(self.members)

    @property
    def tag(self) -> str:
        """What to know of all its runs before reading anything: that they are softened, or nothing."""
        return self.first.softening


def gather(records: Iterable[RunRecord], by_division: bool = True) -> list[Group]:
    """Runs by problem: same case, preset and scene; seeds of one case are kept together.

    Args:
        records: The runs.
        by_division: Whether the divisions are kept apart, as where times are ranked.
    """

    def problem(entry: Entry) -> tuple[str, ...]:
        return (*_problem(entry), entry.spec.division if by_division else "")

    entries = sorted((Entry(record) for record in records), key=problem)
    groups: list[Group] = []
    for _, same in groupby(entries, key=problem):
        for parted in _by_scene(list(same)):
            groups.append(_group(f"scene{len(groups) + 1}", parted))
    return groups


def _problem(entry: Entry) -> tuple[str, ...]:
    spec = entry.spec
    scene = spec.scene_name if spec.preset is None else ""
    return (spec.case, spec.preset or "", f"{spec.duration:.9g}", str(spec.bodies), scene)


def _by_scene(entries: list[Entry]) -> list[list[Entry]]:
    """One list where each seed has one scene, else one list per scene."""
    scenes = {(e.spec.seed, e.spec.scene_digest) for e in entries}
    if len(scenes) == len({seed for seed, _ in scenes}):
        return [entries]
    digests = sorted({e.spec.scene_digest for e in entries})
    return [[e for e in entries if e.spec.scene_digest == digest] for digest in digests]


def _group(name: str, entries: list[Entry]) -> Group:
    samples: dict[tuple[Any, ...], list[Entry]] = {}
    for entry in sorted(entries, key=_order):
        samples.setdefault(_sample(entry), []).append(entry)
    labels = _labels([sample[0] for sample in samples.values()])
    members: list[Member] = []
    for sample, label in zip(samples.values(), labels, strict=True):
        before = sum(m.shown.look.colour == sample[0].look.colour for m in members)
        members.append(Member(tuple(sample), label, before + sample[0].look.dashed))
    return Group(name, tuple(members))


def _order(entry: Entry) -> tuple[Any, ...]:
    spec = entry.spec
    return (spec.engine, bool(spec.overrides), spec.label(), spec.seed, spec.repeat, entry.name)


def _choice(entry: Entry) -> tuple[Any, ...]:
    spec = entry.spec
    return (spec.engine, spec.engine_version, repr(sorted(spec.settings.items())), spec.division)


def _sample(entry: Entry) -> tuple[Any, ...]:
    return (*_choice(entry), entry.spec.seed, entry.spec.scene_digest)


def _labels(entries: Sequence[Entry]) -> list[str]:
    """The engine with the settings that were typed, and the division, seed and version where these differ."""
    seeds = len({e.spec.seed for e in entries}) > 1
    found = [
        text + (f", seed {e.spec.seed}" if seeds else "") for text, e in zip(_names(entries), entries, strict=True)
    ]
    return _unique(found, entries)


def _names(entries: Sequence[Entry]) -> list[str]:
    divisions = len({e.spec.division for e in entries}) > 1
    return [e.spec.label() + (f", {e.spec.division}" if divisions else "") for e in entries]


def _unique(found: list[str], entries: Sequence[Entry]) -> list[str]:
    """Labels with the version, and where that does not do a number, where two of them are equal."""
    if len(set(found)) < len(found):
        found = [f"{text}, version {e.spec.engine_version}" for text, e in zip(found, entries, strict=True)]
    if len(set(found)) < len(found):
        found = [f"{text} ({k + 1})" for k, text in enumerate(found)]
    return found

"""What all attempts at a run have used together: an interrupted run that was gone on with has several."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from dembench.results import ResultError, read_records
from dembench.runs.process import Usage
from dembench.runs.states import Status


@dataclass(frozen=True)
class Earlier:
    """The attempts before this one, as their last result, mostly a partial one, tells of them.

    Attributes:
        status: Status of the last one; None where there is none.
        resources: Resources of each, in their order.
    """

    status: Status | None = None
    resources: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def of(cls, result: Path) -> Earlier:
        """The attempts that a result file knows of; none where it cannot be read."""
        try:
            records = read_records(result)
            return cls(Status.model_validate(records["status"]), list(records["resources"]["attempts"]))
        except (ResultError, KeyError, ValueError, TypeError):
            return cls()


def resources(usage: dict[str, Usage], timed: list[str]) -> dict[str, Any]:
    """Resources of one attempt: sums over its timed phases, the largest memory of all, and every phase by itself.

    Args:
        usage: Of each phase, by name.
        timed: Names of the phases whose times count as the run's; all where none of them has begun.
    """
    counted = [u for name, u in usage.items() if name in timed] or list(usage.values())
    waited = [u.waited for u in counted if u.waited is not None]
    return {
        "wall": sum(u.wall for u in counted),
        "cpu": sum(u.cpu for u in counted),
        "waited": sum(waited) if waited else None,
        "peak_memory": max((u.peak_memory for u in usage.values()), default=0),
        "phases": {name: asdict(u) for name, u in usage.items()},
    }


def together(attempts: list[dict[str, Any]]) -> dict[str, Any]:
    """Resources of a run: times added, the largest memory, and every attempt by itself."""
    waited = [a["waited"] for a in attempts if a["waited"] is not None]
    return {
        "wall": sum(a["wall"] for a in attempts),
        "cpu": sum(a["cpu"] for a in attempts),
        "waited": sum(waited) if waited else None,
        "peak_memory": max(a["peak_memory"] for a in attempts),
        "attempts": attempts,
    }

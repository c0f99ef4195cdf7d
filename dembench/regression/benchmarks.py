"""Metrics from results of pytest-benchmark that were timed beside the reference workload."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dembench.regression import RegressionError
from dembench.regression.metrics import SPEED, Key, Metric

PROBLEM = "benchmarks"
RATIOS = "ratios"
"""Name of the extra information in which a benchmark states its ratios to the reference workload."""


def read_benchmarks(path: Path) -> tuple[list[Metric], dict[str, str], str]:
    """The speeds in a file of `pytest --benchmark-json`, the versions that it knows of, and the processor.

    Benchmarks without ratios to the reference workload are left out.

    Raises:
        RegressionError: The file has another form, or no ratio.
    """
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        processor = str(record["machine_info"]["cpu"].get("brand_raw", ""))
        commit = str((record.get("commit_info") or {}).get("id") or "")[:12]
        found = [
            Metric(
                key=Key(PROBLEM, "", str(b["name"]).removeprefix("test_"), processor),
                title=str(b["extra_info"].get("title", b["name"])),
                unit="1",
                kind="speed",
                values=tuple(float(value) for value in b["extra_info"][RATIOS]),
                worse="higher",
                margin=SPEED,
            )
            for b in record["benchmarks"]
            if b.get("extra_info", {}).get(RATIOS)
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RegressionError(f"{path} is no result of pytest-benchmark: {type(error).__name__}: {error}") from None
    if not found:
        raise RegressionError(f"{path} has no benchmark with ratios to the reference workload; `make bench` makes some")
    return found, {"commit": commit} if commit else {}, processor

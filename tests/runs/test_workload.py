"""The reference workload: the same work, measured as CPU time, its fastest passes taken."""

from __future__ import annotations

import pytest
from supervising import CORES, only_record, planned_runs, supervise

from dembench.runs import workload


def test_the_program_measures_every_part() -> None:
    found = workload.measure_on(CORES)
    assert found["version"] == workload.VERSION
    assert {name: len(times) for name, times in found["passes"].items()} == dict.fromkeys(
        ("arithmetic", "scatter", "search"), workload.PASSES
    )
    assert all(time > 0 for times in found["passes"].values() for time in times)


def test_the_reference_is_the_geometric_mean_of_the_fastest_passes() -> None:
    """Fastest of one part 2, of the other 8: their geometric mean is 4."""
    before, after = {"a": [2.0, 9.0], "b": [9.0]}, {"a": [3.0], "b": [8.0, 10.0]}
    assert workload.reference_time([before, after]) == pytest.approx(4.0)
    for nothing in ([], [{}], [{"a": [0.0]}], [{"a": []}]):
        with pytest.raises(ValueError, match="not measured"):
            workload.reference_time(nothing)


def test_the_time_of_the_loop_counts_where_it_is_known() -> None:
    assert workload.cpu_time({"loop_cpu": 2.0}, {"cpu": 5.0}) == 2.0
    assert workload.cpu_time({"loop_cpu": None}, {"cpu": 5.0}) == 5.0
    assert workload.cpu_time({}, {}) is None


def test_a_run_beside_the_workload_records_it_before_and_after(standin, small_scene, tmp_path) -> None:
    (run,) = planned_runs(small_scene(), tmp_path / "runs", "standin")
    assert supervise(run, beside_workload=True).state == "ok"
    found = only_record(run).result.resources[workload.RECORD]
    assert {len(times) for times in found["passes"].values()} == {2 * workload.PASSES}


def test_a_workload_that_fails_costs_no_run(standin, small_scene, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workload, "measure_on", lambda cores: workload.reference_time([]))
    (run,) = planned_runs(small_scene(), tmp_path / "runs", "standin")
    status = supervise(run, beside_workload=True)
    assert status.state == "ok" and "reference workload was not timed" in status.note
    assert workload.RECORD not in only_record(run).result.resources

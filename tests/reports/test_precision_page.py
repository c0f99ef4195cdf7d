"""The page of sweeps: ensembles with a band, runs without a result, several sweeps in one profile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from reading import Page

from dembench.reports.precision import render
from dembench.verification.precision.store import Error, Loop, Measure, Point, Problem, Sweep

BAND = 0.03


def point(engine: str, rank: int, state: Any = "ok", **changes: Any) -> Point:
    """A point whose error is 40 %, 10 %, 2.5 %, ... and whose time doubles."""
    time, error = 0.1 * 2**rank, 0.4 / 4**rank
    fields: dict[str, Any] = {
        "engine": engine,
        "variant": engine,
        "label": f"{engine}[dt={rank}]",
        "value": f"{4 / 2**rank:g}",
        "rank": rank,
        "dt": 1e-5 / 2**rank,
        "state": state,
        "errors": (),
    }
    if state == "ok":
        errors = (
            Error(measure="rate", total=error, own=0.5 * error, low=0.8 * error, high=1.2 * error, band=BAND),
            Error(measure="curve", total=50 * error, band=1.1, own=None),
        )
        loop = Loop(median=time, low=0.9 * time, high=1.1 * time, count=3)
        fields |= {"loop": loop, "steps": 100 * 2**rank, "passes": 100.0 * 2**rank, "seeds": 5, "errors": errors}
    return Point(**{**fields, **changes})


def sweep(target: str, *points: Point) -> Sweep:
    """A sweep over ensembles."""
    words = {"unit": "relative", "scale": "the mean", "source": "ensembles"}
    return Sweep(
        target=target,
        kind="ensemble",
        knob="dt",
        problem=Problem(
            title=f"Flow {target}",
            law="hertz-mindlin",
            features=(),
            bodies=9,
            young=1e7,
            softness=1e-3,
            restitution=0.5,
        ),
        command=f"dembench sweep {target}",
        made="now",
        machine="a machine",
        references=("alpha",),
        converged={"alpha": True, "beta": None},
        notes=("something to know",),
        measures=(
            Measure(name="rate", title="Bias of the rate", kind="number", **words),
            Measure(name="curve", title="Distance D", kind="distance", **words),
        ),
        points=points,
    )


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Two sweeps: in the first one engine fails at its coarsest step and has a point that was not run."""
    first = sweep(
        "one",
        *(point("alpha", rank) for rank in range(4)),
        point("beta", 0, "failed", detail="not a number"),
        point("beta", 1),
        point("beta", 2, contended=True),
        point("beta", 3, "not run"),
    )
    second = sweep("two", *(point("alpha", rank) for rank in range(3)))
    output = tmp_path_factory.mktemp("page") / "precision.html"
    return Page(render([(Path("a"), first), (Path("b"), second)], output).read_text())


def test_each_kind_of_error_has_its_own_diagram(shown) -> None:
    """Numbers and distances are never in one figure; time, work and step are apart."""
    kinds = {
        f"{target}-dt-{kind}-{axis}"
        for target in ("one", "two")
        for kind in ("number", "distance")
        for axis in ("time", "work", "step")
    }
    assert set(shown.figures) == kinds | {"profile"}
    panels = shown.figures["one-dt-number-time"].data["panels"]
    assert [panel["label"] for panel in panels] == ["Relative bias", "Relative bias, own"]


def test_a_run_without_a_result_stands_at_the_top(shown) -> None:
    """Above the largest error, at the time that the engine has per step; what was not run is no failure."""
    lines = {line["label"]: line for line in shown.figures["one-dt-number-time"].data["panels"][0]["lines"]}
    assert lines["beta: no result"]["y"] == [pytest.approx(3 * 0.4)]
    assert lines["beta: no result"]["x"] == [pytest.approx(0.1)]
    assert len(lines["beta"]["x"]) == 2


def test_the_band_of_the_seeds_and_the_front_are_drawn(shown) -> None:
    """The band ends at what the seeds make; the front has every point that no other beats."""
    known = {k["label"]: k for k in shown.figures["one-dt-number-time"].data["panels"][0]["known"]}
    assert set(known["what the seeds alone make"]["high"]) == {BAND}
    assert known["best of all"]["y"] == pytest.approx([0.4, 0.1, 0.025, 0.00625])


def test_the_cheapest_settings_stop_at_the_band(shown) -> None:
    """Errors of 2.5 % reach 5 %; 0.6 % is inside the band of 3 %, so 1 % is not reached by anything."""
    rows = {(row[0].text[:8], row[1].text): row for row in shown.tables["cheapest"][1:]}
    alpha = rows["Flow one", "alpha"]
    assert "not reached" in alpha[2].text
    assert "1 × closed step" in alpha[3].text and alpha[3].value == "0.4"
    assert "c" in rows["Flow one", "beta"][3].text


def test_every_point_is_in_the_table_with_its_state(shown) -> None:
    """Failures with their reason, and what was not run."""
    rows = shown.tables["one-dt-points"][1:]
    states = [row[2].text for row in rows]
    assert len(rows) == 8 and any("failed" in s and "not a number" in s for s in states)
    assert any("not run" in s for s in states)
    assert "something to know" in " ".join(shown.text)


def test_the_profile_covers_all_sweeps(shown) -> None:
    """One engine has done both problems, the other one of two."""
    panel = next(p for p in shown.figures["profile"].data["panels"] if p["lines"])
    shares = {line["label"]: line["y"][-1] for line in panel["lines"]}
    assert shares == {"alpha": 1.0, "beta": 0.5}

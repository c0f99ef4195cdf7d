"""The page says what the runs say: every run, its state, its numbers, its failure; and runs nothing of a stranger's."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import numpy as np
import pytest
from reading import Page
from synthetic import COMMAND, HOSTILE, add_run, impact, series

from dembench.reports.groups import gather
from dembench.reports.report import render
from dembench.reports.timings import ratios
from dembench.results import Observed
from dembench.runs.directory import find_runs
from dembench.scene import Scene


@pytest.fixture(scope="module")
def text(page: Path) -> str:
    """The page's source."""
    return page.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def read(text: str) -> Page:
    """The page, parsed."""
    return Page(text)


def displacement(scene: Scene) -> dict[str, Observed]:
    """One series, for pages that need no more."""
    return {"ball_displacement": series(scene)["ball_displacement"]}


def test_every_run_has_a_row_with_its_state(read: Page, runs: Path) -> None:
    rows = dict(
        zip(
            [cell.text.strip() for cell in read.column("all-runs", "Run directory")],
            [cell.text.strip() for cell in read.column("all-runs", "State")],
            strict=True,
        )
    )
    records = find_runs(runs)
    assert set(rows) == {record.name for record in records}
    for record in records:
        if record.status.state != "ok":
            assert rows[record.name] == record.status.state
    assert {"ok", "ok, unscored", "inaccurate", *(r.status.state for r in records)} == set(rows.values())


def test_a_run_outside_its_references_is_inaccurate_and_never_ranked(read: Page) -> None:
    table = read.table_with("Ratio")
    state = {c.text.strip(): k for k, c in enumerate(read.column(table, "State"))}
    assert read.column(table, "Ratio")[state["inaccurate"]].value == ""
    assert "deepest point of the ball" in read.column(table, "Verdict")[state["inaccurate"]].text
    engines = [c.text.strip() for c in read.column(table, "Engine")]
    ratios = {name: cell.value for name, cell in zip(engines, read.column(table, "Ratio"), strict=True)}
    assert float(ratios["alpha"] or 0) == pytest.approx(1743.2 / 291.4)
    assert float(ratios["beta"] or 0) == 1
    assert {ratios[name] for name in ratios if name not in ("alpha", "beta")} == {""}


def test_timings_are_those_of_the_results(read: Page) -> None:
    table = read.table_with("Particle-steps")
    engines = [c.value for c in read.column(table, "Engine")]
    beta, swept, failed = engines.index("beta"), engines.index("beta[sweeps=8]"), engines.index("gamma")
    loop = read.column(table, "Loop time")
    assert loop[beta].text.split() == ["291.4", "c"] and "288 to 301.7 (3)" in read.column(table, "Spread")[beta].text
    assert loop[swept].text.split() == ["30.2", "w"]
    assert loop[failed].text.split() == ["88.0", "p"]
    rate = 5 * 120_000 / 291.4 / 1e6
    assert float(read.column(table, "Particle-steps")[beta].value or 0) == pytest.approx(rate)
    assert float(read.column(table, "Peak memory")[beta].value or 0) == pytest.approx(123.4)
    assert float(read.column(table, "Core-seconds")[beta].value or 0) == pytest.approx(291.4)


def test_an_own_time_step_in_the_closed_division_is_marked(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    add_run(tmp_path, scene, "alpha", observables=displacement(scene), loop=9.0)
    add_run(tmp_path, scene, "beta", observables=displacement(scene), loop=1.0, overrides={"dt": "5e-6"})
    own = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    for table in (own.table_with("Verdict"), own.table_with("Particle-steps")):
        assert [cell.text.split()[1:] for cell in own.column(table, "Loop time")] == [[], ["s"]]
    assert "with a time step of their own: beta[dt=5e-6] (5 µs)" in "".join(own.text)
    assert "".join(own.text).count("a run with --division open compares") == 2, "under both tables with ratios"


@pytest.mark.parametrize("division", ["closed", "open"])
def test_what_is_not_of_the_closed_division_is_never_ranked(stand_ins: None, tmp_path: Path, division: str) -> None:
    """Nine times faster with a step of its own, or with another law: no ratio, and nobody is measured by it."""
    scene = impact(0.02)
    values = displacement(scene)
    add_run(tmp_path, scene, "alpha", observables=values, loop=9.0, division=division)
    add_run(tmp_path, scene, "alpha", observables=values, loop=18.0, division=division, overrides={"skin": "2"})
    add_run(tmp_path, scene, "beta", observables=values, loop=1.0, division=division, overrides={"dt": "5e-6"})
    add_run(tmp_path, scene, "gamma", observables=values, loop=1.0, division=division, law="rigid contacts")
    page = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    expected = [1.0, 2.0, None, None] if division == "closed" else [9.0, 18.0, 1.0, 1.0]
    for table in (page.table_with("Verdict"), page.table_with("Particle-steps")):
        ratios = [float(cell.value) if cell.value else None for cell in page.column(table, "Ratio")]
        assert ratios == expected


def test_the_two_divisions_are_ranked_apart(stand_ins: None, tmp_path: Path) -> None:
    """The fastest of each division is 1, also where a page shows both."""
    scene = impact(0.02)
    for division, engine, loop in (("closed", "alpha", 8.0), ("closed", "beta", 16.0), ("open", "gamma", 1.0)):
        add_run(tmp_path, scene, engine, observables=displacement(scene), loop=loop, division=division)
    (group,) = gather(find_runs(tmp_path), by_division=False)
    found = dict(zip([m.label for m in group.members], [cell.value for cell in ratios(group.members)], strict=True))
    assert {name.split("[")[0].split(",")[0]: value for name, value in found.items()} == {
        "alpha": 1.0,
        "beta": 2.0,
        "gamma": 1.0,
    }


def test_every_setting_is_printed_with_who_chose_it(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    chosen = {"settings": {"skin": "0.1"}, "overrides": {"sweeps": "8"}}
    add_run(tmp_path, scene, "alpha", observables=displacement(scene), **chosen)
    page = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    table = page.table_with("Chosen by")
    rows = zip(page.column(table, "Setting"), page.column(table, "Chosen by"), strict=True)
    assert {setting.text: by.text for setting, by in rows} == {
        "dt": "default of the closed division",
        "skin": "default of the closed division",
        "sweeps": "as typed",
    }


def test_quantities_stand_beside_their_references(read: Page) -> None:
    table = read.table_with("Accepted")
    titles = [c.text.strip() for c in read.column(table, "Quantity")]
    row = titles.index("Deepest point of the ball, 1 ms samples")
    assert float(read.column(table, "alpha")[row].value or 0) == pytest.approx(-138.7)
    assert "within" in read.column(table, "alpha")[row].classes
    assert "outside" in read.column(table, "beta[sweeps=8]")[row].classes
    assert read.column(table, "Unit")[row].text == "mm"


def test_figures_have_their_data_their_command_and_their_pdf(read: Page, runs: Path) -> None:
    assert read.figures
    for figure in read.figures.values():
        assert COMMAND in figure.command or "--engines" in figure.command
        assert f"dembench report {runs.name}" in figure.command
        assert base64.b64decode(figure.pdf.removeprefix("data:application/pdf;base64,")).startswith(b"%PDF-")
    shown = next(f for name, f in read.figures.items() if name.endswith("ball-displacement")).data["panels"][0]
    alpha = next(line for line in shown["lines"] if line["label"] == "alpha")
    written = series(impact(), -0.1387)["ball_displacement"]
    np.testing.assert_allclose(alpha["x"], written.time * 1e3, rtol=1e-7)
    np.testing.assert_allclose(alpha["y"], written.value * 1e3, rtol=1e-7)
    assert shown["label"] == "Vertical displacement [mm]"
    assert "free fall" in [known["label"] for known in shown["known"]]


def test_failures_come_with_reason_and_log(text: str, read: Page, runs: Path) -> None:
    whole = "".join(read.text)
    for record in find_runs(runs):
        if record.status.state in ("failed", "timeout", "interrupted", "skipped", "missing"):
            assert f'id="failure-{record.name}"' in text
            assert record.status.detail in whole
    assert "WARNING: 12 atoms lost" in whole
    assert "apt install gamma" in whole


def test_a_scene_without_a_case_is_shown_unscored(read: Page) -> None:
    assert "Ran to its end; there is no reference to compare with." in "".join(read.text)
    assert "my_scene" in "".join(read.text)


def test_what_strangers_wrote_is_text(read: Page, text: str) -> None:
    assert HOSTILE.replace("\x1b", "") in "".join(read.text).replace("\x1b", "")
    assert "<script>alert" not in text and "<img" not in text


def test_strange_names_stay_text_in_tables_figures_and_data(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    name = '</script><svg onload=alert(1)>"$x$'
    add_run(tmp_path, scene, name, case="<b>scene</b>.json", preset=None, observables=displacement(scene), loop=1.0)
    add_run(tmp_path, scene, name, case="<b>scene</b>.json", preset=None, overrides={"<i>": "'\"><u>"})
    read = Page(render(find_runs(tmp_path), tmp_path / "report.html", title="<h1>&").read_text(encoding="utf-8"))
    assert not {"b", "i", "u"} & {tag for tag, _ in read.tags}
    assert not [key for _, attributes in read.tags for key in attributes if key.startswith("on")]
    figure = next(iter(read.figures.values()))
    assert figure.data["panels"][0]["lines"][0]["label"] == name
    assert name in figure.texts


def test_the_page_asks_nobody_for_anything(read: Page, text: str) -> None:
    policy = next(a["content"] or "" for tag, a in read.tags if tag == "meta" and "http-equiv" in a)
    script = re.search(r"<script>(.*?)</script>", text, re.DOTALL)
    assert script is not None
    digest = base64.b64encode(hashlib.sha256(script[1].encode()).digest()).decode()
    assert policy.startswith("default-src 'none';") and f"script-src 'sha256-{digest}'" in policy
    links = [a[key] or "" for _, a in read.tags for key in ("href", "src", "xlink:href") if key in a]
    assert links and all(link.startswith(("#", "data:")) for link in links)
    assert not re.search(r"url\((?!#)|@import", text)


def test_a_result_that_cannot_be_read_is_never_ok(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    run = add_run(tmp_path, scene, "alpha", observables=displacement(scene), loop=1.0)
    run.result.write_bytes(b"no HDF5")
    read = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    assert [cell.text.strip() for cell in read.column("all-runs", "State")] == ["failed"]
    assert "its result file cannot be read" in "".join(read.text)


def test_the_recorded_verdict_stands_where_the_case_is_not_known(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    add_run(
        tmp_path,
        scene,
        "alpha",
        "inaccurate",
        case="other",
        observables=displacement(scene),
        loop=1.0,
        detail="too deep",
    )
    read = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    assert [cell.text.strip() for cell in read.column("all-runs", "State")] == ["inaccurate"]
    assert "too deep" in "".join(read.text)


def test_long_records_are_thinned_in_figures_and_say_so(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    time = np.linspace(0, 0.02, 5001)
    dense = Observed(np.arange(5001), time, -5 * time, "m", (), "Depth")
    add_run(tmp_path, scene, "alpha", case="a.json", preset=None, observables={"depth": dense}, loop=1.0)
    read = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    line = next(iter(read.figures.values())).data["panels"][0]["lines"][0]
    assert len(line["x"]) == 1667 and "One sample of 3 is drawn." in "".join(read.text)


def test_ids_are_unique(read: Page) -> None:
    twice = {name for name in read.ids if read.ids.count(name) > 1}
    assert not twice


def test_same_runs_give_the_same_page(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    add_run(tmp_path, scene, "alpha", observables=displacement(scene), loop=1.0)
    first, second = (render(find_runs(tmp_path), tmp_path / name).read_bytes() for name in ("a.html", "b.html"))
    assert first == second


def test_no_runs_is_a_page_too(tmp_path: Path) -> None:
    assert "No runs were given." in render([], tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_page_of_this_size_stays_small(page: Path) -> None:
    assert page.stat().st_size < 3e6


def test_published_run_times_stand_in_a_table_of_their_own(read: Page) -> None:
    times = {c.text.strip(): c for c in read.column("scene1-published-times", "Wall time")}
    assert "1\u202f346.0 c" in times and times["61.0"].value == "61.0"
    assert all("MUSEN" not in cell.text for cell in read.column("scene1-timings", "Engine"))


def test_a_resumed_run_says_from_where(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    there = {"step": 20000, "time": 0.01, "reached": 0.012, "when": "2026-11-01T13:00:00+0000"}
    add_run(tmp_path, scene, "alpha", observables=displacement(scene), loop=1.0, resumed=(there,))
    add_run(tmp_path, scene, "beta", "failed", resumed=(there,), note="begun anew after an attempt")
    read = Page(render(find_runs(tmp_path), tmp_path / "report.html").read_text(encoding="utf-8"))
    assert [c.text for c in read.column("all-runs", "State")] == [
        "ok, unscoredresumed at 10 ms",
        "failedresumed at 10 ms",
    ]
    assert [c.text.split() for c in read.column("scene1-timings", "Loop time")] == [["1.00", "r"], ["–"]]
    text = "".join(read.text)
    assert "at 10 ms on 2026-11-01 13:00, after 12 ms had been reached" in text and "begun anew" in text


def test_published_results_of_single_codes_stand_as_they_were_published(read: Page) -> None:
    """With their deviation over initial conditions, as a range where that is known, and with no more digits."""
    titles = ("Code", "Quantity", "Value", "Standard deviation")
    columns = [read.column("scene1-published-single", name) for name in titles]
    rows = {(code.text.strip(), what.text[:8]): cells for code, what, *cells in zip(*columns, strict=True)}
    value, deviation = rows["Yade", "Deepest "]
    assert (value.text.strip(), deviation.text.strip()) == ("\u2212138.5", "0.22")
    assert rows["MercuryDPM", "Deepest "][0].text.strip() == "\u2212138.48"
    assert rows["seven codes, single runs", "Displace"][0].text.strip() == "\u221275.8 to \u221231.3"
    assert rows["peclet impulse, published file", "Displace"][0].text.strip() == "\u2212140.2"


def test_many_published_results_are_summed_up_by_quantity(read: Page) -> None:
    """The range of each quantity with the codes at its ends; what was published as a range counts with its ends."""
    columns = [read.column("scene1-published", name) for name in ("Quantity", "Lowest", "Highest", "Median", "Results")]
    rows = {what.text[:8]: [cell.text.strip() for cell in cells] for what, *cells in zip(*columns, strict=True)}
    low, high, middle, count = rows["Displace"]
    assert low.startswith("\u2212140.2") and "peclet impulse, published file" in low
    assert high.startswith("\u221211.5") and "peclet Hertz, published file" in high
    assert (middle, count) == ("\u221249.2", "9")
    single = read.column("scene1-published-single", "Quantity")
    assert sum(int(cell.text) for cell in columns[-1]) == len(single)


def test_what_stands_between_backticks_is_code(text: str) -> None:
    """A footnote names an option; markup of strangers in one would stay text."""
    assert "a run with <code>--division open</code> " in text

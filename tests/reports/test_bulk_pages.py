"""Pages of a silo and of a drum: figures hold what was recorded, pictures show it, softening is labelled."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from reading import Page
from synthetic import registered
from synthetic_bulk import add_bulk_run, drum_record, drum_scene, silo_scene

from dembench.cases import silo_views
from dembench.reports.pictures import crossings, drawn_image
from dembench.reports.report import render
from dembench.results import SnapshotSeries
from dembench.runs.directory import find_runs
from dembench.scene import Cylinder

SOFT = "softened: E 1e7 Pa instead of 1e9 Pa, walls alike"


@pytest.fixture(scope="module")
def drum_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One engine in a drum."""
    out = tmp_path_factory.mktemp("drum")
    with registered():
        scene = drum_scene()
        add_bulk_run(out / "runs", scene, "alpha", drum_record(scene), "case2")
        return render(find_runs(out / "runs"), out / "drum.html")


def read(page: Path) -> Page:
    return Page(page.read_text(encoding="utf-8"))


def test_the_count_is_drawn_in_thousands_with_what_is_known_of_it(silo_page: Path) -> None:
    count, rate = read(silo_page).figures["scene1-discharge"].data["panels"]
    alpha = count["lines"][0]
    assert count["label"] == "Grains [thousand]" and alpha["y"][0] == 2.0
    assert alpha["y"][-1] == pytest.approx(2 - 0.4 * 1.95, abs=2e-3)
    assert [k["label"] for k in count["known"]]
    fit = next(line for line in rate["lines"] if line["label"] == "alpha, fit")
    assert fit["y"] == pytest.approx([0.4, 0.4], rel=5e-3) and fit["x"] == [0.3, 1.7]


def test_panels_of_one_axis_have_the_same_ends(silo_page: Path) -> None:
    axes = read(silo_page).figures["scene1-discharge"].data["axes"]["wide"]
    assert axes[0]["x0"] == axes[1]["x0"] < 0 and axes[0]["x1"] == axes[1]["x1"] > 2


def test_histograms_are_densities(silo_page: Path) -> None:
    """The radial velocity covers 94 % of the grains, between its quantiles; the vertical one 95 %."""
    panels = read(silo_page).figures["scene1-velocities"].data["panels"]
    share = {}
    for panel in panels:
        (line,) = panel["lines"]  # the other run ended before the snapshot
        x = np.array(line["x"])
        share[panel["x_label"]] = float(np.sum(line["y"]) * (x[1] - x[0]))
        assert len(x) == 100
    assert share["Radial velocity [mm/s]"] == pytest.approx(0.94, abs=0.005)
    assert share["Vertical velocity [mm/s]"] == pytest.approx(0.95, abs=0.005)


def test_wall_forces_have_a_figure_of_their_own(silo_page: Path) -> None:
    figures = read(silo_page).figures
    assert [p["label"] for p in figures["scene1-wall-force"].data["panels"]] == ["Force [N]"] * 2
    assert not {"scene1-barrel-force", "scene1-cone-force", "scene1-inside"} & set(figures)


def test_softening_stands_in_every_heading(silo_page: Path) -> None:
    text = silo_page.read_text(encoding="utf-8")
    headings = re.findall(r"<h4>(.*?)</h4>", text)
    shown = [h for h in headings if "softened" in h]
    assert {h.partition("<")[0].strip() for h in headings if h not in shown} <= {
        "All runs",
        "Engines",
        "Cores and load",
    }
    assert len(shown) > 8 and all(SOFT in h or "quick, softened" in h for h in shown)


def test_softening_stands_in_every_row_of_tables_of_all_problems(silo_page: Path) -> None:
    tables = read(silo_page).tables
    for name in ("all-runs", "load"):
        assert len(tables[name]) > 1 and all(row[0].text.endswith("softened") for row in tables[name][1:])


def test_pictures_show_the_particles_and_leave_vtkhdf_beside_the_page(silo_page: Path) -> None:
    text = silo_page.read_text(encoding="utf-8")
    images = re.findall(r'href="data:image/png;base64,([^"]+)"', text)
    assert len(images) == 1  # of the run with the snapshot
    content = base64.b64decode(images[0])
    assert len(content) < 400_000
    image = np.array(Image.open(io.BytesIO(content)).convert("RGBA"))
    share = (image[..., 3] > 128).mean()
    assert 0.02 < share < 0.9
    (file,) = silo_page.with_name("silo-particles").glob("*/flow.vtkhdf")
    assert file.parent.name.startswith("case1-quick__alpha")


def test_an_unchanged_run_is_not_written_again(silo_page: Path) -> None:
    (file,) = silo_page.with_name("silo-particles").glob("*/flow.vtkhdf")
    before = file.stat().st_mtime_ns
    with registered():
        render(find_runs(silo_page.parent / "runs"), silo_page)
    assert file.stat().st_mtime_ns == before


def test_zones_centres_and_mixing_of_the_drum_are_drawn(drum_page: Path) -> None:
    figures = read(drum_page).figures
    zones = figures["scene1-zones"].data["panels"]
    assert [p["label"] for p in zones] == ["M1 [thousand]", "M2 [thousand]"] * 2
    path = figures["scene1-centres"].data
    assert path["panels"][0]["equal"] and len(path["panels"][0]["lines"]) == 2
    axes = path["axes"]["wide"][0]
    across, up = axes["right"] - axes["left"], axes["bottom"] - axes["top"]
    assert across > 0 and up > 0
    lacey = figures["scene1-mixing"].data["panels"][0]["lines"][0]
    assert lacey["x"] == [0, 0.5, 1, 1.5, 2, 2.5, 3] and lacey["y"][0] < lacey["y"][-1] < 1.05


def test_a_drum_is_seen_at_five_instants(drum_page: Path) -> None:
    text = drum_page.read_text(encoding="utf-8")
    assert re.findall(r">t = ([\d.]+) s</text>", text) == ["0", "1", "1.5", "2", "3"]
    assert text.count("data:image/png;base64") == 5
    assert "M2, 8 mm" in text and "M1, 4 mm" in text


def test_published_extrema_are_marked_points(tmp_path: Path) -> None:
    with registered():
        scene = drum_scene(preset="published")
        observables, _ = drum_record(scene, until=0.4)
        add_bulk_run(tmp_path, scene, "alpha", (observables, {}), "case2", preset="published")
        page = read(render(find_runs(tmp_path), tmp_path / "drum.html"))
    first, *others = page.figures["scene1-zones"].data["panels"]
    assert [len(k["x"]) for k in first["known"]] == [6] * 4 and not any(p["known"] for p in others)
    peak = next(k for k in first["known"] if k["label"].startswith("LIGGGHTS"))
    assert (peak["x"][1], peak["y"][1]) == (0.637, 23.25)
    assert "softened" not in "".join(page.text)


def test_walls_are_cut_where_they_cross_the_plane() -> None:
    """A cylinder along y is cut in a polygon of 100 corners on its circle; its caps are not."""
    wall = Cylinder(
        name="drum", material="steel", start=(0, -0.03, 0), end=(0, 0.03, 0), radius=0.1,
        closed_start=True, closed_end=True,
    )  # fmt: skip
    ends = crossings(wall.triangulate(), 0.01).reshape(-1, 2)
    away = np.hypot(*ends.T)
    assert len(ends) == 400 and away.max() == pytest.approx(0.1) and away.min() >= 0.1 * np.cos(np.pi / 100) - 1e-9


def test_what_is_always_drawn_is_seen_before_the_cut() -> None:
    """A grain in front of the plane of the cut hides all behind it, where the picture asks for it."""
    scene = silo_scene(grains=50)
    picture = silo_views.pictures(scene)[0]
    position = scene.bodies.position.copy()
    position[:, 1] = np.abs(position[:, 1])
    position[0, 1] = -0.01
    velocity = np.zeros((1, 50, 3))
    velocity[0, 0] = 1.0  # the colour tells it from the grain behind it
    shots = SnapshotSeries(np.zeros(1), np.zeros(1), position[None], velocity, velocity)
    cut, whole = (
        np.array(Image.open(io.BytesIO(drawn_image(scene, p, shots, 0, 200.0, 1.0))).convert("RGBA"))
        for p in (picture, replace(picture, always=(0,)))
    )
    x, z = position[0, 0], position[0, 2]
    column = int((x - picture.x[0]) / (picture.x[1] - picture.x[0]) * cut.shape[1])
    row = int((picture.z[1] - z) / (picture.z[1] - picture.z[0]) * cut.shape[0])
    assert whole[row, column, 1] > 100 > cut[row, column, 1]

"""Figures: text stays text, places map to values, colours follow the page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from dembench.reports.figures import draw
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import DARK, GRID, INK, MUTED, SURFACE, contrast_ratio, legible, palette, variable

TIME = np.linspace(0, 50, 51)


def plot(*lines: Line, name: str = "figure", known: tuple[Known, ...] = ()) -> Plot:
    """A plot with one panel."""
    return Plot(name, "A title", "", "Time [ms]", (Panel("Depth [mm]", lines, known),), "command")


def test_text_is_kept_as_text_and_never_as_a_formula() -> None:
    drawing = draw(plot(Line("5 $x_1$ & <b>", TIME, TIME, "#e34948")))
    for svg in (drawing.wide, drawing.narrow):
        texts = [node.text for node in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]
        assert {"Time [ms]", "Depth [mm]", "5 $x_1$ & <b>"} <= set(texts)


def test_every_colour_is_a_variable_of_the_page() -> None:
    drawing = draw(plot(Line("a", TIME, TIME, "#4a3aa7")))
    assert f"var({variable('#4a3aa7')}, #4a3aa7)" in drawing.wide
    assert drawing.colours >= {"#4a3aa7", INK, MUTED, GRID}
    bare = re.sub(r"var\(--[\w-]+, #[0-9a-f]{6}\)", "", drawing.wide)
    assert not re.findall(r"(?:fill|stroke): #", bare)


def test_ids_of_two_figures_differ() -> None:
    found = []
    for name in ("one", "two"):
        drawing = draw(plot(Line("a", TIME, TIME, "#4a3aa7", style=1), name=name))
        for svg in (drawing.wide, drawing.narrow):
            own = re.findall(r'\bid="([^"]+)"', svg)
            assert set(re.findall(r'(?:href="|url\()#([^")]+)', svg)) <= set(own)
            found += own
    assert len(found) == len(set(found))


def test_axes_are_where_the_data_says() -> None:
    """The end of the drawn line in the SVG lies where place and limits put its last value."""
    drawing = draw(plot(Line("a", TIME, 3 * TIME - 20, "#123456")))
    axes = drawing.data["axes"]["wide"][0]
    root = ElementTree.fromstring(drawing.wide)
    width, height = (float(v) for v in root.attrib["viewBox"].split()[2:])
    paths = [n.attrib["d"] for n in root.iter("{http://www.w3.org/2000/svg}path") if "#123456" in n.get("style", "")]
    x, y = (float(v) for v in max(paths, key=len).split()[-2:])
    across = (50 - axes["x0"]) / (axes["x1"] - axes["x0"])
    up = (130 - axes["y0"]) / (axes["y1"] - axes["y0"])
    assert x == pytest.approx(width * (axes["left"] + across * (axes["right"] - axes["left"])), abs=0.5)
    assert y == pytest.approx(height * (axes["bottom"] + up * (axes["top"] - axes["bottom"])), abs=0.5)


def test_many_decades_get_a_logarithmic_axis_and_negative_values_never() -> None:
    decay = np.exp(-TIME)
    assert draw(plot(Line("a", TIME, decay, "#123456"))).data["axes"]["wide"][0]["log"]
    assert not draw(plot(Line("a", TIME, -decay, "#123456"))).data["axes"]["wide"][0]["log"]
    assert not draw(plot(Line("a", TIME, decay + 1, "#123456"))).data["axes"]["wide"][0]["log"]


def test_values_that_differ_by_rounding_are_drawn_as_equal() -> None:
    axes = draw(plot(Line("a", TIME, 8 + 1e-12 * TIME, "#123456"))).data["axes"]["wide"][0]
    assert axes["y0"] == pytest.approx(7.6) and axes["y1"] == pytest.approx(8.4)


def test_values_that_are_no_numbers_are_gaps() -> None:
    drawing = draw(plot(Line("a", TIME, np.where(TIME > 10, np.nan, TIME), "#123456", cut_short=True)))
    assert drawing.data["panels"][0]["lines"][0]["y"][-1] is None
    assert "ended early" in drawing.wide


@pytest.mark.parametrize("colour", ["#2a78d6", "#008300", "#4a3aa7", "#e34948", "#1baf7a", "#000000", "#ffffff"])
def test_series_stay_legible_in_the_dark(colour: str) -> None:
    assert contrast_ratio(legible(colour, DARK[SURFACE]), DARK[SURFACE]) >= 4.5


def test_text_and_axes_are_legible_in_both_modes() -> None:
    modes = palette({INK, MUTED})
    for light, dark in modes.values():
        assert contrast_ratio(light, SURFACE) >= 4.5
        assert contrast_ratio(dark, DARK[SURFACE]) >= 4.5


def test_contrast_of_black_and_white_is_21() -> None:
    assert contrast_ratio("#000000", "#ffffff") == pytest.approx(21)

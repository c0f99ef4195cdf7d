"""The page in a real browser: nothing leaves it, nothing breaks, it sorts, fits a phone and reads in the dark."""

from __future__ import annotations

import base64
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from dembench.reports.svg import contrast_ratio

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        not (shutil.which("chromium") and shutil.which("chromedriver")), reason="chromium and chromedriver are needed"
    ),
]

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
OWN = ("file:", "data:", "blob:", "chrome:", "about:", "devtools:")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A headless browser that logs its console and its requests."""
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = str(shutil.which("chromium"))
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(shutil.which("chromedriver"))))
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser: Any, page: Path) -> Any:
    """The browser with the page open at desktop size in light mode."""
    _size(browser, 1280, 900)
    _scheme(browser, "light")
    browser.get_log("performance")
    browser.get(page.as_uri())
    return browser


def _size(browser: Any, width: int, height: int) -> None:
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def _scheme(browser: Any, value: str) -> None:
    features = [{"name": "prefers-color-scheme", "value": value}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def _requests(browser: Any) -> list[str]:
    """Addresses of all requests since the last call."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]


def _column(browser: Any, table: str, index: int) -> list[str]:
    script = "return [...document.querySelectorAll(arguments[0])].map(row => row.cells[arguments[1]].dataset.value)"
    found: list[str] = browser.execute_script(script, f"#{table} tbody tr", index)
    return found


def test_nothing_leaves_the_page_and_nothing_breaks(opened: Any) -> None:
    """Also while every button and figure is used."""
    opened.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "deny"})
    opened.execute_script(
        "document.querySelectorAll('button').forEach(b => b.click());"
        "const key = new KeyboardEvent('keydown', {key: 'ArrowRight'});"
        "document.querySelectorAll('.drawing').forEach(d => d.dispatchEvent(key))"
    )
    urls = _requests(opened)
    assert urls and all(url.startswith(OWN) for url in urls), urls
    errors = [e for e in opened.get_log("browser") if e["level"] in ("SEVERE", "ERROR", "WARNING")]
    assert not errors


def test_a_request_that_someone_smuggles_in_is_refused(opened: Any) -> None:
    opened.execute_script("const i = new Image(); i.src = 'http://127.0.0.1:9/x.png'; document.body.append(i);")
    opened.execute_script(
        "const s = document.createElement('script'); s.textContent = 'window.smuggled = 1'; document.body.append(s);"
    )
    assert opened.execute_script("return window.smuggled") is None
    refused = [e["message"] for e in opened.get_log("browser")]
    assert any("127.0.0.1" in message and "Content Security Policy" in message for message in refused)


def test_a_heading_sorts_by_value_and_back(opened: Any) -> None:
    headings = opened.find_elements("css selector", "#all-runs thead th")
    index = next(k for k, h in enumerate(headings) if h.get_attribute("data-title").startswith("Wall time"))
    headings[index].find_element("tag name", "button").click()
    values = [float(v) for v in _column(opened, "all-runs", index) if v]
    assert headings[index].get_attribute("aria-sort") == "ascending"
    assert len(values) > 3 and values == sorted(values)
    headings[index].find_element("tag name", "button").send_keys("\ue007")
    assert [float(v) for v in _column(opened, "all-runs", index) if v] == values[::-1]
    assert headings[index].get_attribute("aria-sort") == "descending"
    assert _column(opened, "all-runs", index)[-1] == ""


def test_downloads_are_what_they_say(opened: Any) -> None:
    """CSV, SVG and PNG of a figure; the last two in plain light colours, whatever the page shows."""
    _scheme(opened, "dark")
    saved = opened.execute_async_script(
        """
        const done = arguments[0], saved = {};
        HTMLAnchorElement.prototype.click = function () {
          saved[this.download.split(".").pop()] = this.href;
          if (Object.keys(saved).length === 3) done(saved);
        };
        document.querySelectorAll("figure [data-save]").forEach((b, k) => k < 3 && b.click());
        """
    )
    lines = unquote(saved["csv"]).split("\r\n")
    assert lines[0].endswith("panel,series,Time [ms],value,low,high")
    assert any(line.startswith("Vertical displacement [mm],alpha,1,-5.0049") for line in lines)
    svg = unquote(saved["svg"].partition(",")[2])
    assert svg.startswith("<svg") and "var(" not in svg and "#e34948" in svg
    assert base64.b64decode(saved["png"].partition(",")[2])[:8] == b"\x89PNG\r\n\x1a\n"


def test_arrow_keys_read_values(opened: Any) -> None:
    figure = opened.find_element("css selector", "figure")
    drawing = figure.find_element("css selector", ".drawing")
    drawing.send_keys("\ue014\ue014")
    shown = figure.find_element("css selector", ".readout").text
    assert "Time [ms]: 1" in shown and "alpha" in shown and "\u22125.0049" in shown


@pytest.mark.parametrize("width", [375, 768, 1280])
def test_the_page_never_scrolls_sideways(opened: Any, width: int) -> None:
    _size(opened, width, 800)
    script = "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    content, window = opened.execute_script(script)
    assert content <= window
    visible = opened.execute_script(
        "return [...document.querySelectorAll('.drawing svg')].filter(s => s.getBoundingClientRect().width).map(s => "
        "s.getBoundingClientRect().right)"
    )
    assert visible and max(visible) <= window


def test_text_in_figures_is_large_enough_on_a_phone(opened: Any) -> None:
    _size(opened, 375, 800)
    heights = opened.execute_script(
        "return [...document.querySelectorAll('.narrow svg text')].map(t => parseFloat(getComputedStyle(t).fontSize) * "
        "t.ownerSVGElement.getBoundingClientRect().width / t.ownerSVGElement.viewBox.baseVal.width)"
    )
    assert min(heights) >= 9


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_legible(opened: Any, scheme: str) -> None:
    """Contrast of at least 4.5 with the background, for every element with text of its own."""
    _scheme(opened, scheme)
    pairs = opened.execute_script(
        """
        const found = new Set();
        const background = (element) => {
          for (let e = element; e; e = e.parentElement) {
            const colour = getComputedStyle(e).backgroundColor;
            if (!/, 0\\)$|transparent/.test(colour)) return colour;
          }
          return "rgb(255, 255, 255)";
        };
        for (const e of document.body.querySelectorAll("*")) {
          const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
          if (!own || !e.getClientRects().length || ["SCRIPT", "STYLE"].includes(e.tagName)) continue;
          const style = getComputedStyle(e);
          const ink = e.tagName === "text" ? style.fill : style.color;
          found.add(JSON.stringify([ink, background(e), e.tagName + "." + e.className]));
        }
        return [...found].map((text) => JSON.parse(text));
        """
    )
    assert len(pairs) > 10
    dark = contrast_ratio(
        _hex(opened.execute_script("return getComputedStyle(document.body).backgroundColor")), "#ffffff"
    )
    assert (dark > 10) == (scheme == "dark")
    weak = [(text, ground, what) for text, ground, what in pairs if contrast_ratio(_hex(text), _hex(ground)) < 4.5]
    assert not weak


def _hex(colour: str) -> str:
    channels = [int(float(v)) for v in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    return "#{:02x}{:02x}{:02x}".format(*channels)


@pytest.fixture
def pictures(browser: Any, silo_page: Path) -> Any:
    """The browser with a page that has pictures."""
    _size(browser, 1280, 900)
    _scheme(browser, "light")
    browser.get(silo_page.as_uri())
    return browser


def test_pictures_are_saved_as_one_drawing_with_their_legend(pictures: Any) -> None:
    saved = pictures.execute_async_script(
        """
        const done = arguments[0], saved = {};
        HTMLAnchorElement.prototype.click = function () {
          saved[this.download.split(".").pop()] = this.href;
          if (Object.keys(saved).length === 2) done(saved);
        };
        document.querySelectorAll("figure.album [data-save]").forEach((b) => b.click());
        """
    )
    svg = unquote(saved["svg"].partition(",")[2])
    assert svg.count("data:image/png") == 1 and "Speed [mm/s]" in svg and "t = 1 s" in svg and "var(" not in svg
    assert base64.b64decode(saved["png"].partition(",")[2])[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("width", [375, 1280])
def test_pictures_fit_and_their_text_is_large_enough(pictures: Any, width: int) -> None:
    _size(pictures, width, 800)
    content, window = pictures.execute_script(
        "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    )
    assert content <= window
    heights = pictures.execute_script(
        "return [...document.querySelectorAll('.shots svg text, .legend svg text')].map(t => 13 * "
        "t.ownerSVGElement.getBoundingClientRect().width / t.ownerSVGElement.viewBox.baseVal.width)"
    )
    assert heights and min(heights) >= 9


def test_every_panel_with_an_axis_of_its_own_is_read_by_itself(pictures: Any) -> None:
    figure = pictures.find_element("css selector", "#scene1-velocities")
    figure.find_element("css selector", ".drawing").send_keys("\ue014")
    shown = figure.find_element("css selector", ".readout").text
    assert "Radial velocity [mm/s]" in shown and "Rotation" not in shown
    assert len(figure.find_elements("css selector", ".wide .crosshair")) == 1

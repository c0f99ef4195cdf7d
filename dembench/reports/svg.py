"""Vector figures that follow the page: colours by CSS variables, text as text, unique ids."""

from __future__ import annotations

import re

INK = "#1b1f25"
MUTED = "#5d6672"
GRID = "#e1e4e8"
SURFACE = "#ffffff"
DARK = {INK: "#e6e9ed", MUTED: "#a0a8b3", GRID: "#343a43", SURFACE: "#15181d"}
"""Colours of text, axes, grid and page in light mode, and what replaces them in dark mode."""

_PROLOGUE = re.compile(r"^.*?(?=<svg)", re.DOTALL)
_METADATA = re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL)
_GLOBAL_STYLE = re.compile(r'<defs>\s*<style type="text/css">.*?</style>\s*</defs>\s*', re.DOTALL)
_SIZE = re.compile(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"')
_COLOUR = re.compile(r"#[0-9a-f]{6}(?=[;\"])")
_FONT = re.compile(r"'DejaVu Sans'[^;\"]*?sans-serif")


def variable(colour: str) -> str:
    """Name of the CSS variable that stands for a light-mode colour."""
    return f"--ink-{colour.lstrip('#').lower()}"


def themed(svg: str, prefix: str, label: str) -> tuple[str, set[str]]:
    """A matplotlib SVG as an inline element of a page that has light and dark mode.

    Args:
        svg: The file's text, with text kept as text.
        prefix: What makes its ids unique on the page.
        label: Plain text that says what is shown, for those who do not see it.

    Returns:
        The `<svg>` element, with every colour a CSS variable that falls back to itself, and the colours found.
    """
    svg = _GLOBAL_STYLE.sub("", _METADATA.sub("", _PROLOGUE.sub("", svg)))
    svg = _SIZE.sub(r"\1", svg, count=1)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', svg)
    svg = re.sub(r'(xlink:href="|url\()#([^")]+)', rf"\1#{prefix}-\2", svg)
    found = set(_COLOUR.findall(svg))
    svg = _COLOUR.sub(lambda match: f"var({variable(match[0])}, {match[0]})", svg)
    svg = _FONT.sub("sans-serif", svg)
    svg = re.sub(r"\s*\n\s*", " ", svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{_attribute(label)}" ', 1).strip(), found


def palette(colours: set[str]) -> dict[str, tuple[str, str]]:
    """CSS variables of colours: name -> (light, dark); a series colour keeps its hue and is lightened until legible."""
    return {variable(c): (c, DARK.get(c) or legible(c, DARK[SURFACE])) for c in sorted(colours)}


def legible(colour: str, background: str, contrast: float = 4.5) -> str:
    """The colour, mixed with white until it has the contrast ratio of WCAG 2.2 (1.4.3) with a dark background."""
    channels = _channels(colour)
    for share in range(0, 101, 2):
        mixed = tuple(round(c + (255 - c) * share / 100) for c in channels)
        found = "#{:02x}{:02x}{:02x}".format(*mixed)
        if contrast_ratio(found, background) >= contrast:
            return found
    return "#ffffff"


def contrast_ratio(a: str, b: str) -> float:
    """Contrast ratio of two colours, from 1 to 21 (WCAG 2.2, definition of contrast ratio)."""
    first, second = sorted((_luminance(a), _luminance(b)))
    return (second + 0.05) / (first + 0.05)


def _luminance(colour: str) -> float:
    shares = [c / 255 for c in _channels(colour)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _channels(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5))


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;").replace(">", "&gt;")

"""Verdicts for other programs: JUnit for continuous integration, Markdown for a comment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from dembench.atomic import write_text
from dembench.regression.compare import Comparison
from dembench.regression.metrics import margin_text
from dembench.regression.verdicts import Verdict, counts
from dembench.scoring.ensembles import Interval

_SHOWN = 50
"""Metrics that are ok beyond this number are counted, not listed."""


def write(text: str, path: Path) -> None:
    """Writes a file, whole or not at all; what is no plain file, such as /dev/stdout, is written to and stays."""
    if path.is_symlink() or (path.exists() and not path.is_file()):
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def junit(verdicts: Sequence[Verdict]) -> str:
    """The verdicts as JUnit XML: a metric is a test case, a regression a failure, an undecided one is skipped.

    The elements are those of the schema that the Jenkins xUnit plugin publishes (junit-10.xsd).
    """
    suite = ElementTree.Element(
        "testsuite",
        name="dembench check",
        tests=str(len(verdicts)),
        failures=str(sum(v.fails and v.word != "failed" for v in verdicts)),
        errors=str(sum(v.word == "failed" for v in verdicts)),
        skipped=str(sum(v.word == "undecided" for v in verdicts)),
    )
    for v in verdicts:
        place = ".".join(part for part in (v.key.problem, v.key.engine) if part)
        case = ElementTree.SubElement(suite, "testcase", classname=place, name=v.key.name)
        if v.fails or v.word == "undecided":
            kind = "error" if v.word == "failed" else "failure" if v.fails else "skipped"
            found = ElementTree.SubElement(case, kind, message=_clean(f"{v.word}: {sentence(v)}"))
            if kind != "skipped":
                found.set("type", v.word)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def markdown(verdicts: Sequence[Verdict], title: str) -> str:
    """The verdicts as a Markdown table, what is not ok first."""
    lines = [f"### {title}", "", f"{counts(verdicts) or 'no metrics'}", ""]
    shown = [v for v in verdicts if v.word != "ok"]
    shown += [v for v in verdicts if v.word == "ok"][: max(0, _SHOWN - len(shown))]
    if shown:
        lines += ["| verdict | metric | expected | found | change | tolerance |", "|---|---|---:|---:|---:|---:|"]
        lines += ["| " + " | ".join(_cell(text) for text in row(v)) + " |" for v in shown]
    if len(shown) < len(verdicts):
        lines += ["", f"and {len(verdicts) - len(shown)} more that are ok"]
    return "\n".join(lines) + "\n"


def row(v: Verdict) -> tuple[str, ...]:
    """A verdict as words: verdict, metric, expected, found, change with its interval, tolerance."""
    unit = "" if v.unit == "1" else f" {v.unit}"
    found = v.metric.value if v.metric and v.metric.values else None
    change = v.change
    share, size = v.relative(), abs(v.expected.value) if v.expected else 0.0
    if share is not None and v.margin < size:  # a share of what is nearly 0 says nothing
        text, tolerance = _percent(share), f"{100 * v.margin / size:.2g}%"
    else:
        text = "" if change is None else f"{change.value:+.3g} [{change.low:+.3g}, {change.high:+.3g}]{unit}"
        tolerance = f"{v.margin:.2g}{unit}" if v.margin == v.margin else ""
    metric = f"{v.key}: {v.title}" + (f" ({v.detail})" if v.detail else "")
    expected = f"{v.expected.value:.6g}{unit}" if v.expected else ""
    return (v.word, metric, expected, "" if found is None else f"{found:.6g}{unit}", text, tolerance)


def comparison_row(c: Comparison) -> tuple[str, ...]:
    """A comparison as words: verdict, metric, A, B, difference with its interval, margin."""
    unit = "" if c.first.unit == "1" else f" {c.first.unit}"
    numbers = tuple(
        f"{m.value:.6g}{unit}" + (f" ({len(m.values)} values)" if len(m.values) > 1 else "")
        for m in (c.first, c.second)
    )
    known = math.isfinite(c.change.low + c.change.high)
    ends = f" [{c.change.low:+.3g}, {c.change.high:+.3g}]" if known else ", interval not known"
    return (c.word, f"{c.key}: {c.first.title}", *numbers, f"{c.change.value:+.3g}{ends}{unit}", margin_text(c.margin))


def sentence(v: Verdict) -> str:
    """A verdict in one line."""
    _, _, expected, found, change, tolerance = row(v)
    parts = [f"{v.title}: {found or 'no value'}"] if v.title != "run" else []
    if expected:
        parts.append(f"expected {expected} within {tolerance}" if tolerance else f"expected {expected}")
    if change:
        parts.append(f"change {change}")
    return ", ".join([*parts, *filter(None, [v.detail])])


def _percent(share: Interval) -> str:
    if share.low == share.high:
        return f"{100 * share.value:+.3g}%"
    return f"{100 * share.value:+.3g}% [{100 * share.low:+.3g}, {100 * share.high:+.3g}]"


def _cell(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")


def _clean(text: str) -> str:
    """Text without the control characters that XML 1.0 does not allow."""
    return "".join(letter for letter in text if letter >= " " or letter in "\t\n")

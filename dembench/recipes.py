"""Recipes: TOML files that name a campaign, cases x engines x settings x seeds, and what its page shows."""

from __future__ import annotations

import itertools
import tomllib
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from dembench.campaign import Request, seconds
from dembench.cases.base import Preset
from dembench.engines.base import Division
from dembench.plugins import nearest
from dembench.runs.plan import RequestError
from dembench.scene.base import Model, NotNegative, Positive
from dembench.share import share

Value = str | bool | int | float


class Entry(Model):
    """An engine with settings; a setting with a list of values stands for one run with each of them.

    Attributes:
        engine: Name of the engine.
        title: What the runs have in common, for legends; the engine's name where it is left out.
        settings: Settings by name. Several lists give every combination.
    """

    engine: str
    title: str = ""
    settings: dict[str, Value | Annotated[list[Value], Field(min_length=1)]] = {}

    def choices(self) -> list[str]:
        """Engines as typed on the command line: `name[dt=1e-6,sweeps=8]`, one for each combination."""
        lists = [value if isinstance(value, list) else [value] for value in self.settings.values()]
        found = []
        for values in itertools.product(*lists):
            typed = ",".join(f"{k}={_typed(v)}" for k, v in zip(self.settings, values, strict=True))
            found.append(f"{self.engine}[{typed}]" if typed else self.engine)
        return found

    def short(self, choice: str) -> str:
        """What tells one of the choices from the others: the values of the settings that have several."""
        values = dict(part.split("=") for part in choice.partition("[")[2].rstrip("]").split(",") if part)
        return " × ".join(values[key] for key, value in self.settings.items() if isinstance(value, list))


class StudyPage(Model):
    """What the page of a study shows.

    Attributes:
        curves: Observables that are drawn over time.
        start: Time from which they are drawn [s].
        quantities: Columns of its table.
        errors: Quantities that are drawn against run time, as the difference from the mean of the references.
    """

    curves: tuple[str, ...] = ()
    start: NotNegative = 0.0
    quantities: Annotated[tuple[str, ...], Field(min_length=1)]
    errors: tuple[str, ...] = ()


class Recipe(Model):
    """A campaign.

    Attributes:
        title, text: Heading of the page and what it is about.
        cases: Cases, or scene files, as typed on the command line.
        preset, division, seeds: As on the command line.
        time: Simulated time to cut the scenes to [s]; None takes the whole.
        timeout: Time limit of each run, as 45s, 30m, 2h.
        variants: Engines that are studied.
        references: Engines that they are compared with.
        page: What the page shows; None writes the common report.
    """

    title: str
    text: str = ""
    cases: Annotated[tuple[str, ...], Field(min_length=1)]
    preset: Preset | None = None
    division: Division = "closed"
    seeds: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] = (0,)
    time: Positive | None = None
    timeout: str = "6h"
    variants: Annotated[tuple[Entry, ...], Field(min_length=1)]
    references: tuple[Entry, ...] = ()
    page: StudyPage | None = None

    def request(self, out: Path, initial: Path | None = None, **changes: Any) -> Request:
        """The request of the campaign.

        Args:
            out: Directory of the run directories.
            initial: Published initial state of the cases.
            changes: Fields of `Request` that replace the recipe's; None keeps it.

        Raises:
            RequestError: The time limit is no time.
        """
        choices = [choice for entry in (*self.variants, *self.references) for choice in entry.choices()]
        fields: dict[str, Any] = {
            "preset": self.preset,
            "seeds": self.seeds,
            "time": self.time,
            "timeout": seconds(self.timeout),
            **{key: value for key, value in changes.items() if value is not None},
        }
        return Request(
            what=self.cases,
            engines=",".join(choices),
            initial=initial,
            division=self.division,
            out=out,
            **fields,
        )


def names() -> list[str]:
    """Names of the recipes that travel with the package."""
    return sorted(path.stem for path in share("recipes").glob("*.toml"))


def find(text: str) -> Path:
    """The file of a recipe: a path that ends in `.toml`, or the name of one that travels with the package.

    Raises:
        RequestError: There is none; the nearest known name is named.
    """
    path = Path(text) if text.endswith(".toml") else share("recipes") / f"{text}.toml"
    if not path.is_file():
        hint = nearest(Path(text).stem, names())
        raise RequestError(f"no recipe is called '{text}'.{hint} Known are {', '.join(names())}; or give a *.toml file")
    return path


def load(path: Path) -> Recipe:
    """The recipe in a file.

    Raises:
        RequestError: The file is no TOML, or a field is unknown, missing or not accepted; the message names it.
    """
    try:
        return Recipe.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RequestError(f"{path}: {error}") from None
    except ValidationError as error:
        raise RequestError("\n".join(f"{path}: {_fault(fault)}" for fault in error.errors())) from None


def _fault(fault: Any) -> str:
    where = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        models: dict[str, type[Model]] = {"variants": Entry, "references": Entry, "page": StudyPage}
        known = models.get(str(fault["loc"][0]), Recipe) if len(fault["loc"]) > 1 else Recipe
        accepted = list(known.model_fields)
        return f"{where} is not known.{nearest(str(fault['loc'][-1]), accepted)} Accepted are {', '.join(accepted)}."
    if fault["type"] == "missing":
        return f"{where} is missing"
    return f"{where}: {fault['msg']} (given: {fault['input']!r})"


def _typed(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)

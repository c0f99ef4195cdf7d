"""Recipes: TOML files that name a campaign in blocks of cases x engines x settings x seeds, and what its page shows."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from dembench.campaign import Request, is_file, seconds
from dembench.cases import registry as cases
from dembench.cases.base import Preset
from dembench.engines.base import Division
from dembench.initial.fetch import initial_state
from dembench.plugins import nearest
from dembench.runs.plan import RequestError
from dembench.scene.base import Model, NotNegative, Positive
from dembench.share import share

Value = str | bool | int | float
Values = Value | Annotated[list[Value], Field(min_length=1)]
"""One value, or a list of values that stands for one run with each of them."""


@dataclass(frozen=True)
class CaseChoice:
    """A case with one combination of the parameters of a block.

    Attributes:
        base: The case as the block names it.
        values: Parameters that are added to it.
    """

    base: str
    values: Mapping[str, Value]

    @property
    def text(self) -> str:
        """The case as typed on the command line: `case1[orifice=small,friction=0.3]`."""
        if not self.values:
            return self.base
        name, _, given = self.base.partition("[")
        return f"{name}[{','.join([*filter(None, [given.rstrip(']')]), _typed(self.values)])}]"


class Block(Model):
    """Runs that are alike: every case with every combination of parameters, engines, settings and seeds.

    Attributes:
        cases: Cases, or scene files, as typed on the command line.
        parameters: Parameters of the cases by name. Several lists give every combination.
        engines: Names of engines.
        settings: Settings of these engines by name. Several lists give every combination.
        title: What the runs have in common, for legends; the engine's name where it is left out.
        reference: Whether the other blocks are compared with this one.
        initial, preset, division, seeds, repeats, time, timeout: As on the command line; `initial` is for the preset
            published.
    """

    cases: Annotated[tuple[str, ...], Field(min_length=1)]
    parameters: dict[str, Values] = {}
    engines: Annotated[tuple[str, ...], Field(min_length=1)]
    settings: dict[str, Values] = {}
    title: str = ""
    reference: bool = False
    initial: Path | None = None
    preset: Preset | None = None
    division: Division = "closed"
    seeds: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] = (0,)
    repeats: Annotated[int, Field(ge=1)] = 1
    time: Positive | None = None
    timeout: str = "6h"

    def case_choices(self) -> list[CaseChoice]:
        """Every case with every combination of the parameters."""
        return [CaseChoice(case, values) for case in self.cases for values in _combinations(self.parameters)]

    def engine_choices(self, engines: Sequence[str]) -> list[str]:
        """Engines as typed on the command line: `name[dt=1e-6,sweeps=8]`, one for each combination of the settings."""
        typed = [_typed(values) for values in _combinations(self.settings)]
        return [f"{engine}[{text}]" if text else engine for engine in engines for text in typed]

    def swept(self, settings: Mapping[str, str]) -> str:
        """What tells one run from the others of the block: the values of the settings that have several."""
        return " × ".join(settings[key] for key, value in self.settings.items() if isinstance(value, list))

    def request(self, engines: Sequence[str], out: Path, changes: Mapping[str, Any]) -> Request:
        """The request of the block; see `Recipe.requests`."""
        if self.parameters and any(is_file(case) for case in self.cases):
            raise RequestError(f"parameters are for cases; of {', '.join(self.cases)} one is a scene file")
        preset = changes.get("preset", self.preset)
        own = preset == "published" and "initial" not in changes
        fields: dict[str, Any] = {
            "preset": preset,
            "initial": initial_state(self.initial) if own else None,
            "division": self.division,
            "seeds": self.seeds,
            "repeats": self.repeats,
            "time": self.time,
            "timeout": seconds(self.timeout),
            **changes,
        }
        what = tuple(choice.text for choice in self.case_choices())
        return Request(what=what, engines=",".join(self.engine_choices(engines)), out=out, **fields)


class Sensitivity(Model):
    """The parameter whose effect is studied.

    Attributes:
        parameter: Its name; every block has a list of its values.
        must_vary: Quantities that are known to depend on it: one that does not is flagged. Empty where none is.
        least_change: Smallest range over the parameter that counts, as a share of the largest magnitude.
    """

    parameter: str
    must_vary: tuple[str, ...] = ()
    least_change: Positive = 0.02

    @property
    def words(self) -> str:
        """The parameter as a person writes it."""
        return self.parameter.replace("_", " ")


class Page(Model):
    """What the page of a recipe shows.

    Attributes:
        pictures: Pictures of the case's particles, by name.
        figures: Figures of the common report, by name: those of the case, or observables.
        curves: Observables that are drawn over time, each block against the range of the references; of one with
            several components one of them, as `zones.zone2.M1`.
        start: Time from which `curves` are drawn [s].
        quantities: Columns of the table.
        costs: Quantities that are drawn against run time, as the difference from the mean of the references.
    """

    pictures: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    curves: tuple[str, ...] = ()
    start: NotNegative = 0.0
    quantities: Annotated[tuple[str, ...], Field(min_length=1)]
    costs: tuple[str, ...] = ()


SHARED = tuple(name for name in Block.model_fields if name not in ("title", "reference"))
"""Fields of a block that may stand above the blocks: they hold for every block that does not say otherwise."""


class Recipe(Model):
    """A campaign.

    Attributes:
        title, text: Heading of the page and what it is about.
        runs: Its blocks.
        workload: Whether the reference workload is timed beside each run, for `dembench check`.
        sensitivity: The parameter whose effect is studied; None for none.
        page: What the page shows; None writes the common report.
    """

    title: str
    text: str = ""
    runs: Annotated[tuple[Block, ...], Field(min_length=1)]
    workload: bool = False
    sensitivity: Sensitivity | None = None
    page: Page | None = None

    @model_validator(mode="before")
    @classmethod
    def _with_shared_fields(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("runs"), list):
            return data
        shared = {name: data[name] for name in SHARED if name in data}
        runs = [{**shared, **block} if isinstance(block, dict) else block for block in data["runs"]]
        return {**{name: value for name, value in data.items() if name not in SHARED}, "runs": runs}

    @model_validator(mode="after")
    def _parameter_has_values(self) -> Recipe:
        if self.sensitivity is not None:
            name = self.sensitivity.parameter
            for k, block in enumerate(self.runs):
                values = block.parameters.get(name)
                if not isinstance(values, list) or len(values) < 2:
                    raise ValueError(f"sensitivity: parameter '{name}' needs several values in runs.{k}.parameters")
            if self.page is None:
                raise ValueError("sensitivity needs a page that shows it")
        return self

    def requests(self, out: Path, engines: Sequence[str] | None = None, **changes: Any) -> list[tuple[Block, Request]]:
        """The blocks of the campaign with their requests.

        Args:
            out: Directory of the run directories.
            engines: Names of the engines to run; None for all. A block without any of them is left out.
            changes: Fields of `Request` that replace the recipe's; None keeps it.

        Raises:
            RequestError: A time limit is no time, or an engine is none of the recipe's.
        """
        known = {engine for block in self.runs for engine in block.engines}
        for engine in engines or ():
            if engine not in known:
                raise RequestError(
                    f"the recipe has no engine '{engine}'.{nearest(engine, known)} Its engines are "
                    f"{', '.join(sorted(known))}; settings stand in the recipe"
                )
        given = {name: value for name, value in changes.items() if value is not None}
        kept = [(b, [e for e in b.engines if engines is None or e in engines]) for b in self.runs]
        return [(block, block.request(names, out, given)) for block, names in kept if names]


def names() -> list[str]:
    """Names of the recipes that travel with the package."""
    return sorted(path.stem for path in share("recipes").glob("*.toml"))


def asked_for(what: Sequence[str]) -> Path | None:
    """The file of the recipe that is asked for; None where cases and scene files are.

    A recipe is a path that ends in `.toml`, or the name of one that travels with the package and is no case.

    Raises:
        RequestError: There is no such file, something stands beside the recipe, or a word is neither a case nor a
            recipe; the nearest known name is named.
    """
    found = [path for text in what if (path := _recipe(text)) is not None]
    if found and len(what) > 1:
        raise RequestError(f"a recipe says everything itself; run {found[0].stem} alone")
    return found[0] if found else None


def _recipe(text: str) -> Path | None:
    if text.endswith(".toml"):
        if not Path(text).is_file():
            raise RequestError(f"{text}: there is no such recipe. Those of the package are {', '.join(names())}")
        return Path(text)
    if is_file(text) or "[" in text or text in cases.names():
        return None
    if text in names():
        return share("recipes") / f"{text}.toml"
    hint = nearest(text, [*cases.names(), *names()])
    raise RequestError(
        f"no case is called '{text}', and no recipe.{hint} Cases are {', '.join(cases.names())}; recipes are "
        f"{', '.join(names())}, or a file *.toml; scenes are files *.json"
    )


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
        models: dict[str, type[Model]] = {"runs": Block, "page": Page, "sensitivity": Sensitivity}
        nested = len(fault["loc"]) > 1
        accepted = list(models[str(fault["loc"][0])].model_fields if nested else (*Recipe.model_fields, *SHARED))
        return f"{where} is not known.{nearest(str(fault['loc'][-1]), accepted)} Accepted are {', '.join(accepted)}."
    if fault["type"] == "missing":
        return f"{where} is missing"
    if not fault["loc"]:
        return str(fault["msg"])
    return f"{where}: {fault['msg']} (given: {fault['input']!r})"


def _combinations(lists: Mapping[str, Values]) -> list[dict[str, Value]]:
    values = [value if isinstance(value, list) else [value] for value in lists.values()]
    return [dict(zip(lists, chosen, strict=True)) for chosen in itertools.product(*values)]


def _typed(values: Mapping[str, Value]) -> str:
    words = {key: str(value).lower() if isinstance(value, bool) else str(value) for key, value in values.items()}
    return ",".join(f"{key}={word}" for key, word in words.items())

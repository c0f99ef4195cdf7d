"""The published numbers of the three bulk cases, and the contacts that they share."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from dembench.cases.base import Reference
from dembench.scene import Material, PairLaw
from dembench.scene.base import Model, NotNegative
from dembench.share import share

SOURCE = "Dosta et al. 2024, Comput. Phys. Commun. 296, 109066, doi 10.1016/j.cpc.2023.109066"


@cache
def published(name: str) -> dict[str, Any]:
    """The numbers of a case (`silo`, `drum`, `impact`) with those that all cases share: see `data/published/`."""
    own = share("data", "published", f"{name}.toml").read_text(encoding="utf-8")
    return {**common(), **tomllib.loads(own)}


@cache
def common() -> dict[str, Any]:
    """Materials, pair laws and citation."""
    return tomllib.loads(share("data", "published", "common.toml").read_text(encoding="utf-8"))


class ContactParameters(Model):
    """What a study of sensitivity changes in the contacts; None keeps what is published.

    Attributes:
        friction: Friction of all pairs of grains [-].
        wall_friction: Friction of all pairs of grain and wall [-].
        restitution: Restitution of all pairs [-], above 0, at most 1.
        pairs: `table`: each pair of materials has its law; `global`: all have that of the first grains.
        jitter: Largest random displacement [m] of a grain per axis, for seeds above 0; seed 0 is the initial state as
            it is.
    """

    friction: NotNegative | None = None
    wall_friction: NotNegative | None = None
    restitution: Annotated[float, Field(gt=0, le=1)] | None = None
    pairs: Literal["table", "global"] = "table"
    jitter: NotNegative = 1e-6

    def changed(self) -> list[str]:
        """What differs from the published contacts, as `name=value`."""
        names = ("friction", "wall_friction", "restitution", "pairs")
        defaults = {name: field.default for name, field in ContactParameters.model_fields.items()}
        return [f"{n}={getattr(self, n)}" for n in names if getattr(self, n) != defaults[n]]


def contacts(
    grains: tuple[str, ...], changes: ContactParameters, young_factor: float = 1.0
) -> tuple[tuple[Material, ...], tuple[PairLaw, ...]]:
    """Materials and pair laws of a scene with these grains in steel walls.

    Args:
        grains: Materials of the grains, the first being the one whose law `pairs=global` gives to all.
        changes: What differs from the published contacts.
        young_factor: Factor of all Young's moduli [-].
    """
    names = (*grains, "steel")
    made = [Material(**m) for m in common()["materials"] if m["name"] in names]
    materials = tuple(m.model_copy(update={"young": young_factor * m.young}) for m in made)
    laws = [PairLaw(**p) for p in common()["pair_laws"] if p["a"] in names and p["b"] in names]
    if changes.pairs == "global":
        one = next(p for p in laws if p.a == p.b == grains[0])
        laws = [p.model_copy(update={"restitution": one.restitution, "friction": one.friction}) for p in laws]
    return materials, tuple(_changed(p, changes) for p in laws)


def _changed(law: PairLaw, changes: ContactParameters) -> PairLaw:
    values: dict[str, float] = {}
    wall = "steel" in (law.a, law.b)
    friction = changes.wall_friction if wall else changes.friction
    if friction is not None and law.a != "steel":
        values["friction"] = friction
    if changes.restitution is not None:
        values["restitution"] = changes.restitution
    return PairLaw(**{**law.model_dump(), **values})


def cited(
    numbers: Mapping[str, Any], quantities: Mapping[str, tuple[str, str]], parameters: Any, keys: tuple[str, ...] = ()
) -> list[Reference]:
    """The references that `numbers` states for a variant; none where its contacts are not the published ones.

    Args:
        numbers: Has the list `references`; each entry may say by `keys` for which parameters it holds.
        quantities: Title and unit by name of quantity.
        parameters: The case's parameters.
        keys: Names of parameters that an entry may state.
    """
    if parameters.changed():
        return []
    return [
        stated(entry, quantities)
        for entry in numbers.get("references", [])
        if all(entry.get(key, getattr(parameters, key)) == getattr(parameters, key) for key in keys)
    ]


def stated(entry: Mapping[str, Any], quantities: Mapping[str, tuple[str, str]]) -> Reference:
    """A reference that `data/published/` states; what is published names the publication.

    Args:
        entry: Its fields there.
        quantities: Title and unit by name of quantity.
    """
    return Reference(
        quantity=entry["quantity"],
        value=entry["value"],
        low=entry.get("low"),
        high=entry.get("high"),
        unit=quantities[entry["quantity"]][1],
        source=entry["source"] if entry["kind"] == "ensemble" else f"{entry['source']}; doi {common()['doi']}",
        kind=entry["kind"],
    )


def moved(position: np.ndarray, seed: int, jitter: float) -> np.ndarray:
    """Centres [m], shape (n, 3), each moved at random by at most `jitter` [m] per axis; as they are for seed 0."""
    if not seed:
        return position
    return position + np.random.default_rng(seed).uniform(-jitter, jitter, position.shape)


def softened(young_factor: float) -> str:
    """How the materials differ from the published ones, for tables; empty where they do not."""
    if young_factor == 1:
        return ""
    grain = common()["materials"][0]["young"]
    return f"softened: E {young_factor * grain:.0e} Pa instead of {grain:.0e} Pa, walls alike".replace("e+0", "e")

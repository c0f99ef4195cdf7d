"""Verbs about what is there: engines, cases, the machine, the schema of scenes."""

from __future__ import annotations

from typing import Any

from dembench import console
from dembench.cases import registry as cases_registry
from dembench.cli.options import Json, print_json
from dembench.engines import registry
from dembench.engines.base import Probe
from dembench.initial.cache import cache_directory
from dembench.runs.environment import machine
from dembench.scene import Scene


def engines(json_: Json = False) -> None:
    """Lists the engines: which are here, in which version, and how to get the others."""
    found = [(name, _probe(name)) for name in registry.names()]
    if json_:
        print_json({name: probe.model_dump(mode="json") for name, probe in found})
        return
    console.table(
        ("engine", "version", "where, or how to get it"),
        [
            (name, p.version, p.path or "")
            if p.available
            else (name, "missing", ". ".join(text for text in (p.reason, p.install) if text))
            for name, p in found
        ],
    )


def cases(json_: Json = False) -> None:
    """Lists the cases with their parameters, presets and sources."""
    found = [cases_registry.case(name) for name in cases_registry.names()]
    rows: list[dict[str, Any]] = [
        {
            "name": case.name,
            "title": case.title,
            "source": case.source,
            "presets": list(case.presets),
            "parameters": {key: field.default for key, field in case.parameters.model_fields.items()},
        }
        for case in found
    ]
    if json_:
        print_json(rows)
        return
    for row in rows:
        parameters = ",".join(f"{key}={value}" for key, value in row["parameters"].items())
        console.line(f"{row['name']}[{parameters}]  {row['title']}")
        console.line(f"  presets: {', '.join(row['presets'])}")
        console.line(f"  source: {row['source']}")


def doctor(json_: Json = False) -> None:
    """Shows the machine, the engines, the compute devices and the cache."""
    import warp

    with console.bar(quiet=True):
        devices = [str(device) for device in warp.get_devices()]
    found: dict[str, Any] = {
        "machine": {key: value for key, value in machine().items() if key != "packages"},
        "devices": devices,
        "cache": str(cache_directory()),
        "kernel_cache": str(warp.config.kernel_cache_dir),
        "engines": {name: _probe(name).model_dump(mode="json") for name in registry.names()},
    }
    if json_:
        print_json(found)
        return
    shown = {**found["machine"], **{key: found[key] for key in ("devices", "cache", "kernel_cache")}}
    shown["memory"] = f"{shown['memory'] / 1e9:.1f} GB"
    for key, value in shown.items():
        console.line(f"{key}: {', '.join(value) or 'none' if isinstance(value, list) else value}")
    engines(json_=False)


def schema() -> None:
    """Prints the JSON schema of scene files."""
    print_json(Scene.model_json_schema())


def _probe(name: str) -> Probe:
    try:
        return registry.engine(name).probe()
    except ImportError as error:
        return Probe(available=False, reason=f"cannot be loaded: {error}")

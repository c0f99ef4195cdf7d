"""Closed forms of one contact and of free flight, for every engine that is installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from launching import installed, run

from dembench.engines import registry
from dembench.scene import Scene, scene_from

IMPULSE = {"peclet"}
"""Engines with implicit contacts: a symplectic step of first order, and a restitution with a tolerance of its own."""
FIRST_ORDER = {*IMPULSE, "musen", "peclet-dem"}
"""Engines whose free fall is off by g t dt at most."""
THORNTON = {"yade", "kratos"}
"""Engines that clip the tension and take their damping from Thornton's fit, which is off by up to 3e-4, instead."""
SINGLE = {"peclet-dem"}
"""Engines with positions in single precision, where the law in double precision is off by up to 3.4e-3 (E = 1e9)."""


def rigid(overrides: dict[str, str]) -> bool:
    """Whether contacts are rigid by a setting."""
    return overrides.get("rows") == "rigid" or overrides.get("solver") == "impulse"


def restitution_error(name: str, overrides: dict[str, str], otherwise: float) -> float:
    """Rigid contacts give the restitution itself; compliant rows take about three substeps for a contact."""
    if rigid(overrides):
        return 1e-2
    return 0.03 if name in IMPULSE else 4e-3 if name in SINGLE else otherwise


def configurations() -> list[Any]:
    """Every engine as it is, and in full double precision where that is a choice."""
    found = []
    for name in registry.names():
        found.append(pytest.param(name, {}, id=name))
        try:
            choice = "precision" in registry.engine(name).settings_type.model_fields
        except ImportError:
            choice = False
        if name in IMPULSE:
            found.append(pytest.param(name, {"rows": "rigid"}, id=f"{name}-rigid"))
        if name == "peclet-dem":
            found.append(pytest.param(name, {"solver": "impulse"}, id=f"{name}-impulse"))
        if choice:
            found.append(pytest.param(name, {"precision": "float64"}, id=f"{name}-float64"))
    return found


every_engine = pytest.mark.parametrize(("name", "overrides"), configurations())


def scene(**changes: Any) -> Scene:
    """Grains of 1 mm radius, density 2500, E = 1e7, nu = 0.2, e = 0.5, without gravity; step 1 us."""
    fields: dict[str, Any] = {
        "name": "contact",
        "materials": ({"name": "grain", "density": 2500, "young": 1e7, "poisson": 0.2},),
        "pair_laws": ({"a": "grain", "b": "grain", "restitution": 0.5, "friction": 0.3},),
        "species": ({"name": "grain", "material": "grain", "radius": 1e-3},),
        "domain": {"lower": (-0.01,) * 3, "upper": (0.01,) * 3},
        "gravity": (0, 0, 0),
        "duration": 5e-3,
        "time_step": 1e-6,
        "observables": ({"kind": "energy", "name": "energy", "interval": 1e-3},),
    }
    return scene_from({**fields, **changes})


def available(name: str) -> Any:
    """The engine, or a skipped test where its module or its program is missing."""
    try:
        return installed(name)
    except ImportError as error:
        pytest.skip(f"{name}: {error}")


@every_engine
@pytest.mark.parametrize(("young", "restitution"), [(1e7, 0.49986195), (1e9, 0.50256668)])
def test_two_spheres_rebound(
    name: str, overrides: dict[str, str], young: float, restitution: float, tmp_path: Path
) -> None:
    """The reference law at this step gives these values in every double-precision code that has it."""
    engine = available(name)
    made = scene(
        materials=({"name": "grain", "density": 2500, "young": young, "poisson": 0.2},),
        bodies={"position": [[-1.5e-3, 0, 0], [1.5e-3, 0, 0]], "velocity": [[0.5, 0, 0], [-0.5, 0, 0]]},
    )
    precision = engine.settings(made, "closed", overrides).precision()
    tolerance = restitution_error(name, overrides, 1e-6 if precision == "float64" else 1e-4)
    tolerance = 6e-4 if name in THORNTON else tolerance
    last = run(engine, made, tmp_path, **overrides).frames[-1]
    measured = (last.velocity[1, 0] - last.velocity[0, 0]) / 1.0
    assert measured == pytest.approx(restitution, abs=tolerance)
    assert last.velocity.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)
    assert np.abs(last.velocity[:, 1:]).max() < 1e-6


@every_engine
def test_two_spheres_rebound_across_a_periodic_face(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    """Each touches the image of the other beyond the face, and both come back into the domain."""
    engine = available(name)
    domain = {"lower": (-0.01,) * 3, "upper": (0.01,) * 3, "periodic": (True, False, False)}
    ends = []
    for offset in (0.0, 0.01):
        made = scene(
            bodies={
                "position": [[offset - 1.5e-3, 0, 0], [1.5e-3 - offset, 0, 0]],
                "velocity": [[0.5, 0.1, 0], [-0.5, 0, 0]],
            },
            domain=domain,
        )
        if engine.unsupported(made):
            pytest.skip(f"{name}: {engine.unsupported(made)[0]}")
        (directory := tmp_path / f"{offset}").mkdir()
        last = run(engine, made, directory, **overrides).frames[-1]
        assert (np.abs(last.position) <= 0.01).all()
        ends.append(last.velocity)
    assert ends[0][0, 0] < -0.1
    assert ends[1] == pytest.approx(ends[0], abs=1e-6)


@every_engine
def test_free_fall(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    """z = v t - g t^2 / 2, which velocity Verlet meets to rounding; a symplectic step is first order, below g t dt."""
    engine = available(name)
    made = scene(
        bodies={"position": [[0, 0, 0]], "velocity": [[0.1, 0, 0.2]], "angular_velocity": [[0, 30, 0]]},
        gravity=(1.0, 0, -9.81),
        observables=({"kind": "trajectory", "name": "fall", "body": 0, "interval": 1e-3, "track_interval": 5e-4},),
    )
    settings = engine.settings(made, "closed", overrides)
    series = run(engine, made, tmp_path, **overrides)
    allowed = 9.81 * made.duration * settings.dt if name in FIRST_ORDER else 1e-9
    time = series.tracks.time[:, None]
    assert series.tracks.time == pytest.approx(made.track_times())
    exact = np.array([0.1, 0, 0.2]) * time + 0.5 * np.array([1.0, 0, -9.81]) * time**2
    assert np.abs(series.tracks.position[:, 0] - exact).max() < allowed
    assert series.frames[-1].angular_velocity[0] == pytest.approx([0, 30, 0], abs=1e-5)


@every_engine
def test_a_sphere_rebounds_from_a_plane(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    """The restitution of the law does not depend on mass or speed: a wall gives what two spheres give."""
    engine = available(name)
    made = scene(
        bodies={"position": [[0, 0, 1.5e-3]], "velocity": [[0, 0, -0.5]]},
        walls=({"kind": "plane", "name": "floor", "material": "grain", "point": (0, 0, 0), "normal": (0, 0, 1)},),
    )
    last = run(engine, made, tmp_path, **overrides).frames[-1]
    tolerance = restitution_error(name, overrides, 2e-4)
    assert last.velocity[0, 2] / 0.5 == pytest.approx(0.49986, abs=tolerance)


@every_engine
def test_a_sphere_comes_to_rest_on_a_plane(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    """Hertz: overlap at rest = (m g / (4/3 E* sqrt(r)))^(2/3), 1/E* = 2 (1 - nu^2) / E; rigid rows: at most that."""
    engine = available(name)
    made = scene(
        bodies={"position": [[0, 0, 1e-3]]},
        walls=({"kind": "plane", "name": "floor", "material": "grain", "point": (0, 0, 0), "normal": (0, 0, 1)},),
        gravity=(0, 0, -9.81),
        duration=0.02,
    )
    last = run(engine, made, tmp_path, **overrides).frames[-1]
    weight = float(made.masses()[0]) * 9.81
    overlap = (weight / (4 / 3 * 1e7 / (2 * (1 - 0.2**2)) * np.sqrt(1e-3))) ** (2 / 3)
    measured = 1e-3 - last.position[0, 2]
    if rigid(overrides):
        assert -1e-6 < measured < 2 * overlap
    else:
        assert measured == pytest.approx(overlap, rel=1e-3)
    assert abs(last.velocity[0, 2]) < (1e-4 if name in SINGLE else 1e-5)  # its position does not move below 6e-5


@every_engine
def test_progress_is_known_without_reading_the_output(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    engine, made = available(name), scene(bodies={"position": [[0, 0, 0], [5e-3, 0, 0]]})
    settings = engine.settings(made, "closed", overrides)
    assert engine.reached(settings, tmp_path) is None
    if run(engine, made, tmp_path, **overrides).failure is None and name != "musen":
        assert engine.reached(settings, tmp_path) == pytest.approx(made.duration, abs=settings.dt / 2)

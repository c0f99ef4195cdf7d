"""The deck of peclet-dem, its refusals and its law. `python tests/engines/test_peclet_dem.py` writes the golden decks
anew."""

from __future__ import annotations

import ast
import math
import shutil
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, FLOOR, PERIODIC, SINKS, VOID, box, chute, drum, layer, scene, two_spheres
from parts import DRUM

from dembench.engines.base import SettingsError
from dembench.engines.peclet_dem import PecletDem
from dembench.engines.peclet_dem_walls import Grid, default_fine, grids, surfaces
from dembench.scene import Scene

GOLDEN = Path(__file__).parent / "golden"
RIGID = {"kind": "rigid"}


def alike(restitution: float, friction: float, **more: Any) -> tuple[dict[str, Any], ...]:
    """The same for both pairs."""
    own = {"restitution": restitution, "friction": friction, **more}
    return ({"a": "glass", "b": "glass", **own}, {"a": "steel", "b": "glass", **own})


CASES: dict[str, tuple[Any, dict[str, str]]] = {
    "peclet_dem_two_spheres": (two_spheres, {}),
    "peclet_dem_box": (box, {"threads": "2"}),
    "peclet_dem_drum": (drum, {"grid": "0.001"}),
    "peclet_dem_chute": (chute, {"sink_interval": "0.001"}),
    "peclet_dem_layer": (
        partial(layer, RIGID, pair_laws=alike(0.5, 0.3, tangential_restitution=0.25)),
        {"velocity_iterations": "8"},
    ),
}


def write(made: Scene, directory: Path, **overrides: str) -> str:
    """The script of a scene; all files of the deck are in the directory."""
    engine = PecletDem()
    engine.write(made, engine.settings(made, "closed", overrides), directory)
    return (directory / "simulate.py").read_text()


@pytest.fixture(autouse=True)
def on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decks name a program on PATH, wherever one is installed."""
    monkeypatch.setenv("DEMBENCH_PECLET_DEM", "python")


# ---- decks


@pytest.mark.parametrize("name", CASES)
def test_decks_are_those_on_record(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    ast.parse(write(build(), tmp_path, **overrides))
    written = {path.name: path.read_text() for path in tmp_path.iterdir() if path.suffix in (".py", ".txt")}
    assert written == {path.name: path.read_text() for path in (GOLDEN / name).iterdir()}


@pytest.mark.parametrize(
    ("absent", "command"),
    [
        ("walls", "add_sdf_wall"),
        ("surfaces that move", "set_wall_velocity"),
        ("fixed bodies", "inverse_mass["),
        ("constraints", "inverse_inertia["),
        ("tracked bodies", "tracks"),
        ("periodic axes", "% (upper"),
        ("sinks", "def remove"),
        ("impulses", "set_solver_iterations"),
    ],
)
def test_a_deck_has_only_what_the_scene_needs(absent: str, command: str, tmp_path: Path) -> None:
    assert command not in write(two_spheres(), tmp_path), f"no {absent}, yet the command is there"
    assert command in "".join(write(build(), tmp_path, **overrides) for build, overrides in CASES.values())


@pytest.mark.parametrize("name", CASES)
def test_no_body_ever_sleeps(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    assert "sim.set_sleeping(False)" in write(build(), tmp_path, **overrides)


def test_impulses_never_see_no_gravity_at_all(tmp_path: Path) -> None:
    made = scene(gravity=(0, 0, 0))
    assert "set_gravity((0.0, 0.0, 0.0))" in write(made, tmp_path)
    assert "set_gravity((0.0, 0.0, -1e-12))" in write(made, tmp_path, solver="impulse")


def test_threads_are_those_of_the_environment(tmp_path: Path) -> None:
    made = two_spheres()
    (phase,) = PecletDem().write(made, PecletDem().settings(made, "closed", {"threads": "2"}), tmp_path)
    assert phase.environment["OMP_NUM_THREADS"] == "2"
    assert phase.command[1:] == ("simulate.py",)


# ---- grids of walls


def interpolated(grid: Grid, points: np.ndarray) -> np.ndarray:
    """Distances as the program reads them: linear between nodes, less the way to the grid beyond it."""
    last = np.array(grid.values.shape) - 1
    place = (points - grid.origin) / grid.spacing
    inside = np.clip(place, 0, last)
    cell = np.minimum(inside.astype(int), last - 1)
    t = inside - cell
    found = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, t, 1 - t), axis=1)
        found += weight * grid.values[tuple((cell + corner).T)]
    return found - np.linalg.norm((place - inside) * grid.spacing, axis=1)


def normals(grid: Grid, points: np.ndarray) -> np.ndarray:
    """Normals as the program takes them, from differences over half the distance of the nodes along x to each side."""
    half = 0.5 * grid.spacing[0] * np.eye(3)
    found = np.stack([interpolated(grid, points + e) - interpolated(grid, points - e) for e in half], axis=1)
    return found / np.linalg.norm(found, axis=1)[:, None]


def test_planes_are_exact_in_the_domain() -> None:
    """Also normals, and distances beyond the wall: planes across each axis on both sides, and a tilted one."""
    points = np.random.default_rng(1).uniform(-0.03, 0.03, (200, 3))
    for normal in (*np.eye(3), *-np.eye(3), np.array([0.36, 0.48, 0.8])):
        made = scene(walls=({**FLOOR, "point": (0.01, -0.005, 0.002), "normal": tuple(normal)},))
        (grid,) = grids(made, 1e-3)
        assert interpolated(grid, points) == pytest.approx(made.walls[0].signed_distance(points), abs=1e-12)
        assert normals(grid, points) == pytest.approx(np.tile(normal, (200, 1)), abs=1e-9)


def test_a_box_is_a_grid_for_each_axis() -> None:
    """Of both faces, halfway between which the nearer one changes; a body as thick as the gap would need two."""
    made = scene(walls=({**BOX, "lower": (-0.02, -0.01, -0.004), "open_faces": ("z+",)},))
    found = grids(made, 1e-3)
    assert len(found) == surfaces(made) == 3
    points = np.random.default_rng(1).uniform(-0.03, 0.03, (200, 3))
    nearest = np.min([interpolated(grid, points) for grid in found], axis=0)
    assert nearest == pytest.approx(made.walls[0].signed_distance(points), abs=1e-12)
    near = np.array([[-0.0195, 0, 0], [0.0115, 0.01, 0.02]])
    assert normals(found[0], near) == pytest.approx(np.array([[1, 0, 0], [-1, 0, 0]]), abs=1e-9)
    narrow = scene(walls=({**BOX, "lower": (0.0095, -0.02, -0.02)},))
    assert surfaces(narrow) == 4


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_drum_is_a_mantle_and_caps(axis: int) -> None:
    """Between nodes 0.5 mm apart the distance to a mantle of 18 mm is off by up to h^2/(8 R) along each direction."""
    start, end = np.roll([-0.012, 0, 0], axis), np.roll([0.012, 0, 0], axis)
    made = scene(walls=({**DRUM, "start": tuple(start), "end": tuple(end)},))
    caps, mantle = grids(made, 5e-4)
    assert (mantle.values.shape[axis] < 5) == (axis > 0), "few nodes along the axis, unless it is x"
    points = np.random.default_rng(1).uniform(-0.025, 0.025, (2000, 3))
    radial = np.linalg.norm(np.delete(points, axis, axis=1), axis=1)
    points, radial = points[radial > 0.01], radial[radial > 0.01]
    assert interpolated(mantle, points) == pytest.approx(0.018 - radial, abs=2 * 5e-4**2 / (8 * 0.01))
    inward = -points * (1 - np.eye(3)[axis]) / radial[:, None]
    assert normals(mantle, points) == pytest.approx(inward, abs=2e-3)
    assert interpolated(caps, points) == pytest.approx(0.012 - np.abs(points[:, axis]), abs=1e-12)


def test_the_cone_of_a_hopper_ends_at_its_rim() -> None:
    """An open end has an edge; a closed one goes on behind its cap, at most to the tip of the cone.

    At the axis, where the distance has a ridge, it is off by up to a quarter of the distance of the nodes."""
    cone = {"kind": "frustum", "name": "cone", "material": "steel", "start": (0, 0, -0.01), "end": (0, 0, 0.01)}
    made = scene(walls=({**cone, "radius_start": 0.005, "radius_end": 0.02, "closed_end": True},))
    caps, mantle = grids(made, 5e-4)
    bare = made.walls[0].model_copy(update={"closed_end": False})
    points = np.random.default_rng(1).uniform((-0.004, -0.004, -0.015), (0.004, 0.004, 0.005), (500, 3))
    assert interpolated(mantle, points) == pytest.approx(bare.signed_distance(points), abs=1.3e-4)
    assert interpolated(caps, points) == pytest.approx(0.01 - points[:, 2], abs=1e-12)
    beyond = np.array([[0.0, 0.0, 0.02]])
    slope = 0.015 / 0.02
    wide = (0.005 + slope * 0.03) / math.hypot(1, slope)
    assert interpolated(mantle, beyond) == pytest.approx([wide], rel=0.02), "as if there were no cap"


def test_a_wall_on_grids_is_taken_as_it_is() -> None:
    """Beyond its nodes with the distance at the nearest of them, over all of the domain."""
    made = scene(walls=(VOID,))
    (grid,) = grids(made, 1e-3)
    points = np.random.default_rng(1).uniform(-0.03, 0.03, (500, 3))
    assert interpolated(grid, points) == pytest.approx(made.walls[0].signed_distance(points), abs=1e-12)


def test_round_walls_have_nodes_as_the_smallest_body_asks() -> None:
    assert default_fine(scene(walls=(DRUM,))) == pytest.approx(0.25 * 0.0015)
    wide = {"lower": (-10,) * 3, "upper": (10,) * 3}
    assert default_fine(scene(walls=(DRUM,), domain=wide)) == pytest.approx((20**2 / 4e6) ** (1 / 2), rel=1e-5)
    along_x = {**DRUM, "start": (-0.012, 0, 0), "end": (0.012, 0, 0)}
    assert default_fine(scene(walls=(along_x,), domain=wide)) == pytest.approx((20**3 / 4e6) ** (1 / 3), rel=1e-5)


# ---- refusals, law, settings


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "linear", "normal_stiffness": 1e4, "tangential_stiffness": 1e3}}, "contact law linear"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0, "friction": 0},)}, "restitution 0"),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 1, "friction": 1, "rolling_friction": 0.1},)},
            "rolling friction",
        ),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"domain": PERIODIC}, "a periodic domain with soft spheres"),
        ({"walls": (BOX, DRUM)}, "5 walls: accepted are 4"),
        ({"walls": ({**FLOOR, "motion": {"velocity": (0, 0, 1)}},)}, "motion of wall floor: a wall that does not stay"),
        (
            {"walls": ({**FLOOR, "motion": {"amplitude": (1, 0, 0), "frequency": 1, "surface": True}},)},
            "motion of wall floor: a surface that oscillates",
        ),
        ({"constraints": ({"kind": "kinematic", "bodies": (0,)},)}, "kinematic bodies"),
        (
            {
                "walls": (FLOOR,),
                "observables": ({"kind": "wall-force", "name": "force", "wall": "floor", "interval": 0.01},),
            },
            "the force on a wall",
        ),
        ({"law": RIGID, "domain": PERIODIC, "sinks": SINKS}, "a sink in a periodic domain"),
        (
            {"law": RIGID, "walls": (FLOOR,), "pair_laws": (alike(1, 1)[0], alike(1, 1, tangential_restitution=1)[1])},
            "different tangential restitutions",
        ),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_named(changes: dict[str, Any], named: str) -> None:
    faults = PecletDem().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_a_mesh_is_refused() -> None:
    sheet = {"kind": "mesh", "name": "sheet", "material": "steel", "triangles": [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]}
    (fault,) = PecletDem().unsupported(scene(walls=(sheet,)))
    assert "wall sheet: a mesh" in fault


def test_its_law_is_told() -> None:
    engine = PecletDem()

    def law(overrides: dict[str, str] | None = None, **changes: Any) -> str:
        made = scene(**changes)
        return engine.law(made, engine.settings(made, "closed", overrides))

    clipped, rescaled = ({"kind": "hertz-mindlin", "variant": variant} for variant in ("no-tension", "rescaled"))
    assert law() == "friction, dashpot included, bound by the normal spring's force"
    assert law(pair_laws=alike(0.5, 0)) == "" and law(law=clipped, pair_laws=alike(1, 0)) == ""
    assert law(pair_laws=alike(1, 0.5)) == "", "without dashpots the spring is all there is"
    assert law(law=clipped, pair_laws=alike(0.5, 0)) == "tension kept"
    assert "arm of friction" in law(law=rescaled)
    assert law({"solver": "impulse"}) == "rigid contacts with restitution and Coulomb friction"
    assert law(law=RIGID) == ""


def test_settings_are_checked() -> None:
    def settings(made: Scene, **given: str) -> Any:
        return PecletDem().settings(made, "closed", given)

    with pytest.raises(SettingsError, match="Did you mean 'threads'"):
        settings(scene(), thread="2")
    with pytest.raises(SettingsError, match="threads"):
        settings(scene(), threads="0")
    with pytest.raises(SettingsError, match="accepted is impulse, not hertz"):
        settings(scene(law=RIGID), solver="hertz")
    with pytest.raises(SettingsError, match="write solver=impulse,velocity_iterations=9"):
        settings(scene(), velocity_iterations="9")
    mixed = (alike(1, 1)[0], alike(1, 1, tangential_restitution=1)[1])
    with pytest.raises(SettingsError, match="impulse cannot do this scene: different tangential restitutions"):
        settings(scene(walls=(FLOOR,), pair_laws=mixed), solver="impulse")
    one, two = (settings(scene(), threads=n) for n in "12")
    assert (one.cores(), two.cores(), one.precision()) == (1, 2, "float32")
    assert PecletDem().estimate(scene(), one) > PecletDem().estimate(scene(), two)


def test_the_solver_follows_the_law_and_brings_its_step() -> None:
    """0.004 sqrt(d/g) with d = 3 mm; at 4 m/s a fiftieth of a diameter, 15 us, fitted into samples of 1 ms."""
    engine = PecletDem()
    assert engine.settings(scene(), "closed").solver == "hertz"
    assert engine.settings(scene(), "closed").dt == pytest.approx(5e-6)
    for made in (
        engine.settings(scene(law=RIGID), "open"),
        engine.settings(scene(), "closed", {"solver": "impulse"}),
    ):
        assert made.solver == "impulse"
        assert made.dt == pytest.approx(1e-3 / math.ceil(1e-3 / (0.004 * math.sqrt(0.003 / 9.81))))
    fast = scene(law=RIGID, bodies={"position": [[0, 0, 0]], "velocity": [[4, 0, 0]]})
    assert engine.settings(fast, "closed").dt == pytest.approx(1e-3 / 67)
    assert engine.settings(scene(), "closed", {"solver": "impulse", "dt": "1e-5"}).dt == pytest.approx(1e-5)


# ---- the program


def test_a_missing_program_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_PECLET_DEM", "no-such-program")
    probe = PecletDem().probe()
    assert not probe.available
    assert "no-such-program" in probe.reason
    assert "pip install 'dembench[peclet-dem]'" in probe.install


def test_without_a_name_this_interpreter_is_meant_if_it_has_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DEMBENCH_PECLET_DEM")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    probe = PecletDem().probe()
    assert not probe.available and "no package peclet-dem" in probe.reason
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name == "peclet.dem")
    made = PecletDem().probe()
    assert made.path == sys.executable


@pytest.mark.parametrize(
    ("said", "version", "told"),
    [
        ("peclet-dem 1.1.0 OpenMP abc", "1.1.0", ""),
        ("Hello", "", "no peclet-dem"),
        ("peclet-dem 1.1.0 Cuda abc", "1.1.0", "built for Cuda"),
    ],
)
def test_an_interpreter_is_asked_for_the_package(
    said: str, version: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\necho '{said}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("DEMBENCH_PECLET_DEM", str(program))
    probe = PecletDem().probe()
    assert (probe.available, probe.version) == (not told, version)
    assert told in probe.reason


def regenerate() -> None:
    """Writes the golden decks."""
    for name, (build, overrides) in CASES.items():
        with tempfile.TemporaryDirectory() as directory:
            write(build(), Path(directory), **overrides)
            shutil.rmtree(GOLDEN / name, ignore_errors=True)
            (GOLDEN / name).mkdir(parents=True)
            for path in Path(directory).iterdir():
                if path.suffix in (".py", ".txt"):
                    (GOLDEN / name / path.name).write_text(path.read_text())


if __name__ == "__main__":
    regenerate()

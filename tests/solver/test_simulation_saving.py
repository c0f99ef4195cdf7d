"""Save and load: a resumed run gives the bits of one that was never interrupted; a file that is no state is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grains import RADIUS, gas, grains
from shaped import shaped

import dembench
from dembench.scene import Clump, Cylinder, Motion, Scene, Sdf
from dembench.solver import Simulation, SolverError


def shaken(n: int = 200) -> Scene:
    """Fast grains of two sizes and a ball in a closed drum that turns and shakes."""
    position, velocity, spin = gas(n, speed=1.0, spacing=2.6)
    low, high = position.min(axis=0), position.max(axis=0)
    middle = (low + high) / 2
    ball = [middle[0], middle[1], high[2] + 7.2 * RADIUS]
    drum = Cylinder(
        name="drum",
        material="grain",
        start=(middle[0], low[1] - 1.3 * RADIUS, middle[2]),
        end=(middle[0], high[1] + 1.3 * RADIUS, middle[2]),
        radius=ball[2] - middle[2] + 6.1 * RADIUS,
        motion=Motion(
            angular_velocity=(0, 100.0, 0), centre=tuple(middle), amplitude=(0, 0, 0.05 * RADIUS), frequency=500.0
        ),
    )
    return grains(
        [*position, ball],
        [*velocity, [0, 0, -2.0]],
        [*spin, [0, 0, 0]],
        radius=(RADIUS, 1.1 * RADIUS, 6 * RADIUS),
        species=[*(np.arange(n) % 2), 2],
        young=1e8,
        walls=(drum,),
        gravity=(0, 0, -9.81),
    )


def bits(simulation: Simulation) -> list[bytes]:
    arrays = simulation.position, simulation.velocity, simulation.angular_velocity
    return [a.tobytes() for a in arrays]


@pytest.mark.parametrize(
    "settings",
    [
        {"method": "soft-sphere", "dt": 1e-6},
        {"method": "soft-sphere", "dt": 1e-6, "threads": 2},
        {"method": "soft-sphere", "dt": 1e-6, "lists": "full"},
        {"method": "impulse", "rows": "rigid", "dt": 1e-5},
        {"method": "impulse", "rows": "rigid", "dt": 1e-5, "threads": 2},
        {"method": "impulse", "rows": "compliant", "dt": 5e-5},
        {"method": "impulse", "rows": "compliant", "dt": 5e-5, "threads": 2},
    ],
    ids=["soft", "two-threads", "full", "rigid", "rigid-two-threads", "compliant", "compliant-two-threads"],
)
def test_a_resumed_run_gives_the_same_bits(settings: dict[str, Any], tmp_path: Path) -> None:
    simulation = Simulation(shaken(), **settings)
    simulation.step(777)
    simulation.save(tmp_path / "state.npz")
    resumed = Simulation.load(tmp_path / "state.npz")
    assert bits(resumed) == bits(simulation) and resumed.time == simulation.time
    for other in (simulation, resumed):
        other.step(500)
    assert bits(resumed) == bits(simulation)
    assert resumed.counters() == simulation.counters()
    assert simulation.counters()["list rebuilds"] > 3
    straight = Simulation(shaken(), **settings)
    straight.step(1277)
    assert bits(straight) == bits(simulation)


def shaking_bed() -> Scene:
    """Grains that meet a bed given by its signed distance, which shakes."""
    bed = Sdf.from_function(
        name="bed",
        material="grain",
        function=lambda x: x[:, 2],
        lower=(-0.02, -0.02, -0.004),
        upper=(0.02, 0.02, 0.02),
        spacing=0.002,
        motion=Motion(amplitude=(0, 0, 1e-4), frequency=100.0),
    )
    position, velocity, spin = gas(20, speed=1.0, spacing=2.3)
    position += [0, 0, 1.2 * RADIUS - position[:, 2].min()]
    return grains(position, velocity, spin, walls=(bed,), gravity=(0, 0, -9.81), young=1e8)


def clumps() -> Scene:
    """Two clumps that fall onto a floor and each other."""
    clump = Clump(spheres=((0, 0, 0, 4e-3), (5e-3, 0, 0, 3e-3)))
    spin = [(40, 20, 0), (0, 0, 0)]
    return shaped([clump], [(0, 0, 0.0042), (0.002, 0, 0.0125)], spin=spin, species=[0, 0])


@pytest.mark.parametrize(("build", "dt"), [(shaking_bed, 1e-6), (clumps, 1e-5)], ids=["signed distance", "clumps"])
def test_scenes_of_every_kind_resume(build: Callable[[], Scene], dt: float, tmp_path: Path) -> None:
    simulation = Simulation(build(), dt)
    simulation.step(400)
    simulation.save(tmp_path / "state.npz")
    resumed = Simulation.load(tmp_path / "state.npz")
    for other in (simulation, resumed):
        other.step(600)
    assert bits(resumed) == bits(simulation)
    free = simulation.scene.bodies.velocity[:, 2] - 9.81 * simulation.time
    assert np.abs(simulation.velocity[:, 2] - free).max() > 5e-3, "some have met the floor"


def saved(path: Path) -> Path:
    simulation = Simulation(grains([[0, 0, 0], [0, 0, 3e-3]]))
    simulation.step(3)
    simulation.save(path)
    return path


def test_a_file_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "state.npz")
    monkeypatch.setattr(dembench, "__version__", "99.0")
    with pytest.raises(SolverError, match=r"written by version .*; accepted is 99.0"):
        Simulation.load(path)


@pytest.mark.parametrize("where", [0.1, 0.5, 0.9])
def test_a_damaged_file_is_refused(where: float, tmp_path: Path) -> None:
    path = saved(tmp_path / "state.npz")
    content = bytearray(path.read_bytes())
    path.write_bytes(content[: int(where * len(content))])
    with pytest.raises(SolverError, match="damaged, or no state of a simulation"):
        Simulation.load(path)
    with np.load(saved(path)) as stored:
        place = bytes(content).index(stored["state/state/bodies/kin"].tobytes())
    content[place + 3] ^= 1
    path.write_bytes(content)
    with pytest.raises(SolverError, match="damaged, or no state of a simulation: Bad CRC"):
        Simulation.load(path)


def test_what_is_no_state_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SolverError, match="no such file"):
        Simulation.load(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", header=np.array("{}"))
    with pytest.raises(SolverError, match="no state of a simulation"):
        Simulation.load(tmp_path / "other.npz")
    path = saved(tmp_path / "state.npz")
    with np.load(path) as stored:
        kept = {key: stored[key] for key in stored.files if key != "state/steps"}
    np.savez(path, **kept)
    with pytest.raises(SolverError, match="written by another solver: state/steps is not in both"):
        Simulation.load(path)


def test_a_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "state.npz")
    before = path.read_bytes()

    def full(*_args: Any, **_arrays: Any) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match="no space left"):
        saved(path)
    assert path.read_bytes() == before

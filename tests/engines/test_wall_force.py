"""The force on a wall, from the in-tree solvers through their files to the observable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hopper import hopper

from dembench.engines import registry
from dembench.engines.in_tree_program import simulate
from dembench.results import observe
from dembench.scene import Bodies, Count, Region, WallForce, scene_from

RADIUS, DENSITY, GRAINS = 1e-3, 2500.0, 200


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz"])
def test_the_floor_carries_the_weight_of_a_grain_at_rest(name: str, tmp_path: Path) -> None:
    """At the end, after the little bounce of a grain that starts without overlap; the lid carries nothing."""
    planes = [{"kind": "plane", "name": n, "material": "glass", "point": (0, 0, z), "normal": (0, 0, s)} for n, z, s in
              (("floor", 0, 1), ("lid", 0.02, -1))]  # fmt: skip
    scene = scene_from(
        {
            "name": "weight",
            "materials": [{"name": "glass", "density": DENSITY, "young": 1e7, "poisson": 0.2}],
            "pair_laws": [{"a": "glass", "b": "glass", "restitution": 0.3, "friction": 0.3}],
            "species": [{"name": "grain", "material": "glass", "radius": RADIUS}],
            "walls": planes,
            "bodies": {"position": [[0, 0, RADIUS]]},
            "domain": {"lower": (-0.03,) * 3, "upper": (0.03,) * 3},
            "gravity": (0, 0, -9.81),
            "duration": 0.02,
            "time_step": 5e-6,
            "observables": [
                {"kind": "wall-force", "name": n, "wall": n, "interval": 5e-3} for n in ("floor", "lid")
            ],
        }
    )  # fmt: skip
    engine = registry.engine(name)
    settings = engine.settings(scene, "closed", {})
    engine.write(scene, settings, tmp_path)
    simulate(tmp_path, engine.simulation, settings.model_dump())
    found = observe(scene, engine.read(scene, settings, tmp_path).frames)
    weight = DENSITY * 4 / 3 * np.pi * RADIUS**3 * 9.81
    assert found["floor"].value.shape == (5, 3)
    assert found["floor"].value[-1] == pytest.approx([0, 0, -weight], rel=1e-3, abs=1e-6 * weight)
    assert not found["lid"].value.any()


@pytest.mark.parametrize(("name", "overrides"), [("peclet-hertz", {}), ("peclet", {"dt": "5e-5"})])
def test_barrel_and_cone_carry_what_is_left_in_them(name: str, overrides: dict[str, str], tmp_path: Path) -> None:
    """Grains come to rest on a cone too narrow to leave it, while one outside falls into the sink.

    At the end the vertical forces on barrel and cone, friction included, add up to the weight of the 200 grains inside;
    the barrel carries no more of it than fully mobilised friction would under Janssen's column of height H and width D:
    1 - (1 - exp(-x)) / x with x = 4 mu K H / D, of either sign, friction being as it was when the last grain stopped.
    """
    flowing = hopper(GRAINS)
    narrow = flowing.walls[1].model_copy(update={"radius_start": 0.5 * RADIUS})
    position = np.vstack([flowing.bodies.position, [0.015, 0, 0]])
    forces = tuple(o.model_copy(update={"interval": 1e-2}) for o in flowing.observables if isinstance(o, WallForce))
    count = Count(name="all", region=Region(), interval=1e-2)
    scene = flowing.model_copy(
        update={
            "walls": (flowing.walls[0], narrow),
            "bodies": Bodies(position=position),
            "duration": 0.2,
            "observables": (*forces, count),
        }
    )
    engine = registry.engine(name)
    settings = engine.settings(scene, "closed", overrides)
    engine.write(scene, settings, tmp_path)
    simulate(tmp_path, engine.simulation, settings.model_dump())
    found = observe(scene, engine.read(scene, settings, tmp_path).frames)
    assert found["all"].value[0] == GRAINS + 1 and found["all"].value[-1] == GRAINS
    weight = GRAINS * DENSITY * 4 / 3 * np.pi * RADIUS**3 * 9.81
    barrel, cone = (found[f"{wall}_force"].value[-5:].mean(axis=0) for wall in ("barrel", "cone"))
    assert (barrel + cone)[2] == pytest.approx(-weight, rel=0.01)
    assert np.abs(barrel + cone)[:2].max() < 0.05 * weight
    x = 4 * 0.3 * 0.5 * 5e-3 / 16e-3
    assert 0 < abs(barrel[2]) < (1 - (1 - np.exp(-x)) / x) * weight

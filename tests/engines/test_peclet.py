"""Settings of the impulse engine: the rows follow the scene's law, and the sweeps follow the rows."""

from __future__ import annotations

from typing import Any

import pytest

from dembench.engines.base import SettingsError
from dembench.engines.registry import engine
from dembench.scene import Clump, Scene, scene_from


def scene(**changes: Any) -> Scene:
    """One grain in free fall."""
    fields: dict[str, Any] = {
        "name": "grain",
        "materials": ({"name": "grain", "density": 2500, "young": 1e7, "poisson": 0.2},),
        "pair_laws": ({"a": "grain", "b": "grain", "restitution": 0.5, "friction": 0.3},),
        "species": ({"name": "grain", "material": "grain", "radius": 1e-3},),
        "bodies": {"position": [[0, 0, 0]]},
        "domain": {"lower": (-1,) * 3, "upper": (1,) * 3},
        "duration": 1e-2,
        "time_step": 1e-6,
    }
    return scene_from({**fields, **changes})


RIGID = scene(law={"kind": "rigid"})
SOFT = scene()


def test_rows_and_sweeps_follow_the_law() -> None:
    peclet = engine("peclet")
    rigid, soft = peclet.settings(RIGID, "closed"), peclet.settings(SOFT, "open")
    assert (rigid.rows, rigid.velocity_sweeps, rigid.position_sweeps) == ("rigid", 8, 12)
    assert (soft.rows, soft.velocity_sweeps, soft.substeps) == ("compliant", 1, None)
    assert peclet.law(RIGID, rigid) == peclet.law(SOFT, soft) == ""
    assert peclet.unsupported(RIGID) == peclet.unsupported(SOFT) == []


def test_other_rows_than_those_of_the_law_can_be_asked_for() -> None:
    peclet = engine("peclet")
    chosen = peclet.settings(SOFT, "closed", {"rows": "rigid", "velocity_sweeps": "20"})
    assert (chosen.velocity_sweeps, chosen.position_sweeps) == (20, 12)
    assert "rigid contacts" in peclet.law(SOFT, chosen)
    assert peclet.settings(SOFT, "closed", {"substeps": "8"}).substeps == 8


def test_rows_bring_their_step() -> None:
    """Compliant rows divide theirs."""
    peclet = engine("peclet")
    falling = scene(gravity=(0, 0, -9.81), duration=1.0)
    own, rigid = peclet.settings(falling, "open"), peclet.settings(falling, "open", {"rows": "rigid"})
    assert own.dt == pytest.approx(2 * rigid.dt, rel=0.01)
    assert peclet.settings(falling, "open", {"rows": "rigid", "dt": "1e-5"}).dt == pytest.approx(1e-5)


def test_stiff_grains_take_longer() -> None:
    """Substeps go with the frequency of contacts: E^(2/5) at a speed."""
    peclet = engine("peclet")
    times = []
    for young in (1e8, 1e9):
        materials = ({"name": "grain", "density": 2500, "young": young, "poisson": 0.2},)
        bodies = {"position": [[0, 0, 0], [0, 0, 0.01]]}
        falling = scene(gravity=(0, 0, -9.81), duration=1.0, materials=materials, bodies=bodies)
        times.append(peclet.estimate(falling, peclet.settings(falling, "open")) - 10)
    assert times[1] == pytest.approx(10**0.4 * times[0], rel=1e-6)


def test_only_rigid_rows_can_do_without_the_stabilization() -> None:
    """Compliant rows would compute the same with and without it, under another name."""
    peclet = engine("peclet")
    assert not peclet.settings(SOFT, "closed", {"rows": "rigid", "stabilization": "off"}).stabilization
    with pytest.raises(SettingsError, match=r"compliant rows have none.*rows=rigid,stabilization=off"):
        peclet.settings(SOFT, "closed", {"stabilization": "off"})


def test_only_rigid_rows_make_position_sweeps() -> None:
    """Compliant rows would compute the same whatever their number, under other names."""
    peclet = engine("peclet")
    assert peclet.settings(RIGID, "closed", {"position_sweeps": "5"}).position_sweeps == 5
    assert peclet.settings(SOFT, "closed", {"rows": "rigid", "position_sweeps": "5"}).position_sweeps == 5
    assert peclet.settings(SOFT, "closed", {"position_sweeps": "0"}).position_sweeps == 0
    with pytest.raises(SettingsError, match=r"compliant rows make none.*rows=rigid,position_sweeps=5"):
        peclet.settings(SOFT, "closed", {"position_sweeps": "5"})


@pytest.mark.parametrize(
    "given", [{"rows": "rigid", "substeps": "8"}, {"substeps": "0"}, {"rows": "soft"}, {"velocity_sweeps": "0"}]
)
def test_settings_that_contradict_are_refused(given: dict[str, str]) -> None:
    with pytest.raises(SettingsError, match="peclet"):
        engine("peclet").settings(SOFT, "closed", given)


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz"])
def test_bodies_that_are_no_spheres_have_one_thread(name: str) -> None:
    rods = scene(species=({"name": "grain", "material": "grain", "shape": Clump.dumbbell(1e-3, 1e-3)},))
    assert engine(name).settings(rods, "closed").threads == 1
    assert engine(name).settings(SOFT, "closed", {"threads": "2"}).threads == 2
    with pytest.raises(SettingsError, match=r"\[threads\]: bodies that are no spheres have one \(given: 2\)"):
        engine(name).settings(rods, "closed", {"threads": "2"})

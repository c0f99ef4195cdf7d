"""Contacts of bodies that are no spheres, from outside; overlapping starts; the engines."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shaped import GRAVITY, run, shaped

from dembench.engines import peclet, peclet_hertz
from dembench.engines.liggghts import Liggghts
from dembench.results.schema import not_recorded
from dembench.scene import Clump, Energy, Grain, Rigid
from dembench.solver import Simulation

BOX = Grain.box((1.2e-2, 1e-2, 6e-3), 6e-4, 6e-4)
STEP = {"soft-sphere": 4e-6, "impulse": 1e-4}


@pytest.mark.parametrize("method", list(STEP))
def test_contacts_of_a_box_on_a_box(method):
    """The forces of the points on either box sum to what it carries; they act on its face without slip."""
    scene = shaped([BOX], [(0, 0, 3e-3), (1e-3, 0, 9e-3)], species=[0, 0], friction=0.5, restitution=0.2)
    sim = run(scene, 0.1, method, STEP[method])
    found = sim.contacts()
    weight = float(scene.masses()[0]) * GRAVITY
    assert found.sum_by_body(sim.ids) == pytest.approx(np.array([(0, 0, weight)] * 2), abs=1e-3 * weight)
    on_floor = found.j < 0
    assert found.normal_force[on_floor].sum() == pytest.approx(2 * weight, rel=1e-3)
    assert found.normal_force[~on_floor].sum() == pytest.approx(weight, rel=1e-3)
    assert found.point[on_floor, 2] == pytest.approx(0, abs=5e-5)
    assert found.point[~on_floor, 2] == pytest.approx(6e-3, abs=1e-4)
    between = found.normal_force[~on_floor] @ found.normal[~on_floor]
    assert between == pytest.approx([0, 0, -weight], abs=0.02 * weight)
    assert np.abs(found.slip).max() < 1e-4
    assert (found.energy > 0).all() == (method == "soft-sphere")
    assert sim.coordination_number() == 1
    assert sim.overlap() < 1e-4


def test_overlapping_clumps_are_let_apart():
    """Two crossed dumbbells that overlap by a quarter of a radius part under the limit of speed."""
    turned = Rotation.from_rotvec([np.pi / 2, 0, 0]).as_quat()
    scene = shaped(
        [Clump.dumbbell(2e-3, 2e-3)],
        [(0, 0, 0), (3.5e-3, 0, 0)],
        orientation=[(0, 0, 0, 1), turned],
        species=[0, 0],
        floor=None,
    )
    sim = Simulation(scene, 4e-6, method="soft-sphere")
    assert sim.overlap() == pytest.approx(4e-3 - np.sqrt(3.5**2 + 2) * 1e-3, rel=1e-3)
    sim.relax(speed_limit=0.1, until=1e-3)
    assert sim.overlap() < 1e-3 * scene.radii().min()
    assert np.abs(sim.velocity).max() == 0


def test_engines_say_whether_they_have_shapes():
    """The in-tree engines run them, impulses with rigid rows; LIGGGHTS names them."""
    scene = shaped([BOX], [(0, 0, 0.01)])
    rigid = scene.model_copy(update={"law": Rigid()})
    assert peclet.Peclet().unsupported(scene) == peclet.Peclet().unsupported(rigid) == []
    assert peclet.Peclet().defaults(scene, "closed")["rows"] == "rigid"
    assert peclet_hertz.PecletHertz().unsupported(scene) == []
    assert "particles that are no spheres" in Liggghts().unsupported(scene)
    energy = scene.model_copy(update={"observables": (Energy(name="energy", interval=0.1),)})
    assert not_recorded(energy) == ["observable energy: frames have no orientations of bodies that are no spheres"]
    for adapter in (peclet.Peclet(), peclet_hertz.PecletHertz()):
        settings = adapter.settings_type(**adapter.defaults(scene, "closed"))
        sim = adapter.simulation(scene, settings.model_dump())
        sim.step(3)
        assert sim.orientation.shape == (1, 4)

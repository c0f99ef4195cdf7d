"""Features are computed from what the scene holds."""

import pytest

from dembench.scene import (
    Bodies,
    Box,
    Constraint,
    Cylinder,
    Domain,
    LinearSpring,
    Material,
    Mesh,
    Motion,
    PairLaw,
    Region,
    Rigid,
    Sink,
    features,
)

PLAIN = {
    "pair_laws": (PairLaw(a="glass", b="glass", restitution=0.8, friction=0),),
    "bodies": Bodies(position=[[0, 0, 0.05]]),
    "observables": (),
    "walls": (),
    "gravity": (0.0, 0.0, 0.0),
}


def test_a_frictionless_grain_in_space_has_none(small_scene):
    assert features(small_scene(**PLAIN)).names() == []


ROUGH = PairLaw(a="glass", b="glass", restitution=0.8, friction=0.3)
LINING = PairLaw(a="glass", b="lining", restitution=0.8, friction=0.5, rolling_friction=0.1)
MATERIALS = tuple(Material(name=name, density=2500, young=1e7, poisson=0.25) for name in ("glass", "lining"))
BOX = Box(name="box", material="glass", lower=(-1, -1, -1), upper=(1, 1, 1))
DRUM = Cylinder(name="drum", material="glass", start=(0, -1, 0), end=(0, 1, 0), radius=1)
PLATE = Mesh(name="plate", material="glass", triangles=[[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])


@pytest.mark.parametrize(
    "change,expected",
    [
        ({"pair_laws": (ROUGH,)}, {"friction", "tangential_history", "rotation"}),
        ({"pair_laws": (ROUGH,), "law": Rigid()}, {"friction", "rotation"}),
        (
            {"pair_laws": (ROUGH,), "law": LinearSpring(normal_stiffness=1e3, tangential_stiffness=0)},
            {"friction", "rotation"},
        ),
        (
            {"pair_laws": (ROUGH,), "law": LinearSpring(normal_stiffness=1e3, tangential_stiffness=10)},
            {"friction", "tangential_history", "rotation"},
        ),
        ({"bodies": Bodies(position=[[0, 0, 0]], angular_velocity=[[0, 0, 1]])}, {"rotation"}),
        ({"bodies": Bodies(position=[[0, 0, 0], [1, 0, 0]], radius=[0.1, 0.2])}, {"polydisperse"}),
        ({"bodies": Bodies(position=[[0, 0, 0], [1, 0, 0]], species=[0, 1])}, {"polydisperse"}),
        ({"walls": (BOX,)}, {"walls"}),
        ({"walls": (DRUM,)}, {"walls", "curved_walls"}),
        ({"walls": (PLATE,)}, {"walls", "mesh_walls"}),
        ({"walls": (DRUM.model_copy(update={"motion": Motion()}),)}, {"walls", "curved_walls", "moving_walls"}),
        (
            {"walls": (BOX.model_copy(update={"motion": Motion(velocity=(1, 0, 0))}),)},
            {"walls", "moving_walls", "moving_geometry"},
        ),
        ({"gravity": (0, 0, -9.81)}, {"gravity"}),
        ({"sinks": (Sink(name="out", region=Region()),)}, {"sinks"}),
        ({"constraints": (Constraint(kind="fixed", bodies=(0,)),)}, {"constraints"}),
        ({"domain": Domain(lower=(-1,) * 3, upper=(1,) * 3, periodic=(True, False, False))}, {"periodic"}),
    ],
)
def test_each_feature_alone(small_scene, change, expected):
    assert set(features(small_scene(**{**PLAIN, **change})).names()) == expected


def test_laws_of_pairs_that_cannot_touch_do_not_count(small_scene):
    smooth = PLAIN["pair_laws"][0]
    scene = small_scene(**{**PLAIN, "materials": MATERIALS, "pair_laws": (smooth, LINING)})
    assert features(scene).names() == []
    lined = small_scene(
        **{
            **PLAIN,
            "materials": MATERIALS,
            "pair_laws": (smooth, LINING),
            "walls": (BOX.model_copy(update={"material": "lining"}),),
        }
    )
    assert set(features(lined).names()) == {"walls", "friction", "tangential_history", "rotation", "rolling_friction"}

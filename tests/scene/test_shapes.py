"""Clumps and grains: mass properties against closed forms, probes that touch from inside, files and faults."""

import numpy as np
import pytest
import trimesh

from dembench.scene import (
    Bodies,
    Clump,
    Domain,
    Grain,
    Material,
    PairLaw,
    Plane,
    Scene,
    Species,
    check_scene,
    features,
    load_scene,
    save_scene,
    scene_from,
)
from dembench.scene.files import SceneError


def scene(*shapes, orientation=None, **changes):
    fields = {
        "name": "shapes",
        "materials": (Material(name="stone", density=2000, young=1e7, poisson=0.2),),
        "pair_laws": (PairLaw(a="stone", b="stone", restitution=0.5, friction=0.5),),
        "species": tuple(Species(name=f"s{k}", material="stone", shape=shape) for k, shape in enumerate(shapes)),
        "bodies": Bodies(
            position=[(3.0 * k, 0, 0) for k in range(len(shapes))],
            species=list(range(len(shapes))),
            orientation=orientation,
        ),
        "domain": Domain(lower=(-100,) * 3, upper=(100,) * 3),
        "duration": 1,
        "time_step": 1e-4,
    }
    return Scene(**{**fields, **changes})


def ball(x):
    return np.linalg.norm(x, axis=-1) - 1


def test_one_sphere_and_separate_spheres_are_exact():
    """Steiner's theorem for two balls of mass m: I = 4/5 m r^2 + 2 m (a/2)^2 across, 4/5 m r^2 along."""
    solid = Clump(spheres=((1, 2, 3, 0.5),)).solid
    assert solid.volume == pytest.approx(4 / 3 * np.pi * 0.125)
    assert solid.centre == pytest.approx([1, 2, 3])
    assert solid.moments == pytest.approx(0.4 * solid.volume * 0.25)
    solid = Clump.dumbbell(1, 3).solid
    ball_volume = 4 / 3 * np.pi
    assert solid.moments == pytest.approx(ball_volume * np.array([0.8, 0.8 + 4.5, 0.8 + 4.5]))


@pytest.mark.parametrize("distance", [0.4, 1.0, 1.6])
@pytest.mark.parametrize("axis", [0, 2])
def test_overlapping_dumbbell_counts_the_lens_once(distance, axis):
    """Volume and moment along the axis of two balls cut in the middle: integrals of pi s^2 and pi s^4/2 over z."""
    ends = np.zeros((2, 4))
    ends[:, axis], ends[:, 3] = (-distance / 2, distance / 2), 1
    solid = Clump(spheres=ends).solid
    z = np.polynomial.legendre.leggauss(40)
    half, low = (distance / 2 + 1) / 2, -distance / 2
    s2 = 1 - (low + half * (z[0] + 1)) ** 2
    volume, along = (2 * half * z[1] @ f for f in (np.pi * s2, np.pi * s2**2 / 2))
    assert solid.volume == pytest.approx(volume, rel=2e-5)
    assert solid.moments[0] == pytest.approx(along, rel=5e-5)
    assert abs(solid.axes[axis, 0]) == pytest.approx(1, abs=1e-6)


def test_ball_on_a_grid_converges_with_second_order():
    """The chords of the surface lie inside the ball, by O(spacing^2)."""
    errors = []
    for spacing in (0.2, 0.1, 0.05):
        solid = Grain.from_function(ball, (-1.33,) * 3, (1.31,) * 3, spacing, np.zeros((1, 3))).solid
        errors.append(1 - solid.volume / (4 / 3 * np.pi))
        assert solid.moments == pytest.approx(8 / 15 * np.pi, rel=2 * errors[-1])
        assert solid.centre == pytest.approx(0, abs=spacing**2 / 20)
    assert errors[2] < 1.3e-3
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2, abs=0.15)


def test_rounded_box_has_steiners_volume():
    """V = abc + 2 (ab + bc + ca) r + pi (a + b + c) r^2 + 4/3 pi r^3 for the inner box a, b, c; axes by symmetry."""
    shape = Grain.box((2, 1, 0.5), rounding=0.1, spacing=0.025)
    a, b, c, r = 1.8, 0.8, 0.3, 0.1
    volume = a * b * c + 2 * (a * b + b * c + c * a) * r + np.pi * (a + b + c) * r**2 + 4 / 3 * np.pi * r**3
    assert shape.solid.volume == pytest.approx(volume, rel=2e-3)
    assert np.abs(shape.solid.axes) == pytest.approx(np.eye(3), abs=1e-9)
    assert shape.solid.centre == pytest.approx(0, abs=1e-9)


def test_probes_touch_from_inside_and_sharp_corners_stay_points():
    whole = Grain.from_function(ball, (-1.3,) * 3, (1.3,) * 3, 0.2)
    assert len(whole.points) == 1
    assert whole.points[0] == pytest.approx([0, 0, 0, 1], abs=1e-6)
    shell = Grain.from_function(ball, (-1.3,) * 3, (1.3,) * 3, 0.2, probe=0.5)
    assert np.linalg.norm(shell.points[:, :3], axis=1) + shell.points[:, 3] == pytest.approx(1, abs=1e-6)
    assert shell.points[:, 3] == pytest.approx(0.5, abs=1e-6)


def test_cube_from_stl(tmp_path):
    """The mass of a cube, less about spacing^2/4 per length of its sharp edges; its corners are probes of radius 0."""
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "cube.stl")
    shape = Grain.from_stl(tmp_path / "cube.stl", 0.05, probe=0.1, distance=0.3)
    assert shape.solid.volume == pytest.approx(1 - 12 * 0.05**2 / 4, abs=2e-3)
    assert shape.solid.moments == pytest.approx(1 / 6, rel=0.02)
    corners = shape.points[(np.abs(np.abs(shape.points[:, :3]) - 0.5) < 1e-9).all(axis=1)]
    assert len(corners) == 8
    assert (corners[:, 3] == 0).all()
    trimesh.Trimesh(np.eye(3), [[0, 1, 2]]).export(tmp_path / "open.stl")
    with pytest.raises(ValueError, match="closed"):
        Grain.from_stl(tmp_path / "open.stl", 0.05)


def test_scene_takes_mass_and_bound_from_the_shape(tmp_path):
    shapes = Clump.dumbbell(0.5, 0.6), Grain.box((1, 0.5, 0.5), 0.05, 0.05), None
    known = scene(*shapes[:2])
    assert known.species[0].radius == pytest.approx(0.8)
    assert known.masses() == pytest.approx([2000 * s.solid.volume for s in shapes[:2]])
    assert known.moments()[1] == pytest.approx(2000 * shapes[1].solid.moments)
    assert features(known).shapes
    turn = [(0, 0, 0, 1), (0, 0.6, 0, 0.8)]
    turned = scene(*shapes[:2], orientation=turn)
    save_scene(turned, tmp_path / "turned.json")
    assert (tmp_path / "turned.npz").exists()
    again = load_scene(tmp_path / "turned.json")
    assert again == turned
    assert again.digest() == turned.digest() != known.digest()
    assert scene_from(turned.model_dump(mode="json")) == turned
    text = (tmp_path / "turned.json").read_text()
    (tmp_path / "turned.json").write_text(text.replace('"sha256": "', '"sha256": "0'))
    with pytest.raises(SceneError, match="is not the file"):
        load_scene(tmp_path / "turned.json")


def test_faults_are_named():
    with pytest.raises(ValueError, match="bounding radius"):
        Species(name="s", material="stone", radius=1, shape=Clump.dumbbell(0.5, 0.6))
    with pytest.raises(ValueError, match="norm 2"):
        scene(Clump.dumbbell(1, 1), orientation=[(0, 0, 0, 2)])
    with pytest.raises(ValueError, match="inside it"):
        Grain(values=-np.ones((5, 5, 5)), origin=(0, 0, 0), spacing=1, points=[(0, 0, 0)])
    with pytest.raises(ValueError, match="no node inside"):
        Grain(values=np.ones((5, 5, 5)), origin=(0, 0, 0), spacing=1, points=[(0, 0, 0)])
    with pytest.raises(ValueError, match="leave the radii out"):
        scene(Clump.dumbbell(1, 1), bodies=Bodies(position=[(0, 0, 0)], radius=[1]))


def test_bodies_touch_with_their_surfaces():
    """Lying dumbbells and boxes that stand face to face do not overlap, though the spheres that hold them do."""
    dumbbell, box = Clump.dumbbell(0.5, 2), Grain.box((1, 1, 1), 0.1, 0.1, reach=0.5)
    floor = Plane(name="floor", material="stone", point=(0, 0, -0.5), normal=(0, 0, 1))

    def placed(*position, **changes):
        return scene(
            dumbbell,
            box,
            bodies=Bodies(position=position, species=[0, 1, 1], orientation=[(s, 0, 0, s), *[(0, 0, 0, 1)] * 2]),
            walls=(floor,),
            **changes,
        )

    s = np.sqrt(0.5)
    check_scene(placed((-1, 0, 0), (0, 0, 0), (0.999, 0, 0)))
    with pytest.raises(SceneError, match=r"particles 1 and 2 with 6.3\d%"):
        check_scene(placed((-1, 0, 0), (0, 0, 0), (0.95, 0, 0)))
    with pytest.raises(SceneError, match=r"particles 0 and 1 with"):
        check_scene(placed((-0.9, 1, 0), (0, 0, 0), (0.999, 0, 0)))
    with pytest.raises(SceneError, match=r"overlap wall floor .* worst is particle 0 .* with 13"):
        check_scene(placed((-1, 0, -0.2), (0, 0, 0), (0.999, 0, 0)))

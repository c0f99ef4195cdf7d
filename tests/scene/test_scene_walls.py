"""Signed distances against brute force over triangles, and triangles that face the void."""

import numpy as np
import pytest

from dembench.scene import Box, Cylinder, Frustum, Mesh, Plane, Sdf
from dembench.scene.mesh import closest_points

SEGMENTS = 200
BOTH = {"closed_start": True, "closed_end": True}
CURVED = {
    "pipe": Cylinder(name="w", material="m", start=(0, 0, 0), end=(0, 0, 2), radius=1),
    "drum": Cylinder(name="w", material="m", start=(0.3, -1, 0.2), end=(0.3, 1, 0.2), radius=0.7, **BOTH),
    "oblique can": Cylinder(name="w", material="m", start=(0, 0, 0), end=(1, 1, 1), radius=0.5, closed_start=True),
    "rod": Cylinder(name="w", material="m", start=(0, 0, -1), end=(0, 0, 1), radius=0.5, outside=True),
    "hopper": Frustum(name="w", material="m", start=(0, 0, 0), end=(0, 0, 0.7), radius_start=0.3, radius_end=1.0),
    "cup": Frustum(
        name="w", material="m", start=(0, 0, 0), end=(0, 0.5, 1), radius_start=1, radius_end=0.4, closed_start=True
    ),
    "cone": Frustum(name="w", material="m", start=(0, 0, 1), end=(0, 0, -1), radius_start=1, radius_end=0),
    "cone from outside": Frustum(
        name="w", material="m", start=(0, 0, 1), end=(0, 0, -1), radius_start=1, radius_end=0, outside=True
    ),
}


def brute_force(triangles, points):
    """Distance to the nearest triangle [m], shape (n,)."""
    return np.min([np.linalg.norm(points - closest_points(points, t), axis=1) for t in triangles], axis=0)


def local(wall, points):
    """Coordinates along the axis and away from it [m], and the length of the axis [m]."""
    start, axis = np.array(wall.start), np.array(wall.end) - np.array(wall.start)
    length = np.linalg.norm(axis)
    along = (points - start) @ (axis / length)
    radial = np.linalg.norm(points - start - along[:, None] * axis / length, axis=1)
    return along, radial, length


def mantle_radius(wall, along, length):
    r0, r1 = (wall.radius, wall.radius) if isinstance(wall, Cylinder) else (wall.radius_start, wall.radius_end)
    return r0 + (r1 - r0) * along / length


@pytest.mark.parametrize("wall", CURVED.values(), ids=CURVED.keys())
def test_distance_in_the_void_is_that_of_the_triangles(wall):
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (600, 3))
    along, radial, length = local(wall, points)
    between = (along > 0) & (along < length)
    inside = between & (radial < mantle_radius(wall, along, length))
    void = between & ~inside if wall.outside else inside
    points = points[void]
    assert len(points) > 15
    flat = 1.0 * (1 - np.cos(np.pi / SEGMENTS))
    expected = brute_force(wall.triangulate(SEGMENTS), points)
    np.testing.assert_allclose(wall.signed_distance(points), expected, atol=2 * flat)


@pytest.mark.parametrize("wall", CURVED.values(), ids=CURVED.keys())
def test_points_behind_the_mantle_are_negative(wall):
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3))
    along, radial, length = local(wall, points)
    between = (along > 0) & (along < length)
    inside = radial < mantle_radius(wall, along, length)
    behind = between & (inside if wall.outside else ~inside)
    assert np.count_nonzero(behind) > 10
    assert (wall.signed_distance(points[behind]) < 0).all()


@pytest.mark.parametrize("wall", CURVED.values(), ids=CURVED.keys())
def test_beyond_an_open_end_is_void_and_beyond_a_closed_one_is_outside(wall):
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (300, 3))
    along, radial, length = local(wall, points)
    within = radial < mantle_radius(wall, along, length)
    for beyond, closed in ((within & (along < 0), wall.closed_start), (within & (along > length), wall.closed_end)):
        found = wall.signed_distance(points[beyond])
        if closed:
            assert (found < 0).all()
        else:
            expected = brute_force(wall.triangulate(SEGMENTS), points[beyond])
            np.testing.assert_allclose(found, expected, atol=1e-3)


def test_under_a_hopper_is_void_even_beside_its_outlet():
    assert CURVED["hopper"].signed_distance(np.array([[0.8, 0, -0.1], [0, 0, -0.1]])) == pytest.approx(
        [0.6 / np.sqrt(2), np.hypot(0.3, 0.1)]
    )


@pytest.mark.parametrize("wall", CURVED.values(), ids=CURVED.keys())
def test_triangles_face_the_void(wall):
    for triangle in wall.triangulate(40):
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        normal /= np.linalg.norm(normal)
        probe = triangle.mean(axis=0) + 0.03 * normal
        assert wall.signed_distance(probe[None])[0] > 0


def test_area_of_a_triangulated_drum():
    triangles = CURVED["drum"].triangulate(SEGMENTS)
    area = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    assert area.sum() == pytest.approx(2 * np.pi * 0.7 * 2 + 2 * np.pi * 0.7**2, rel=1e-3)


def test_box_is_the_nearest_closed_face():
    box = Box(name="w", material="m", lower=(-1, -2, 0), upper=(1, 2, 3), open_faces=("z+",))
    points = np.array([[0.9, 0, 1], [0, 0, 0.25], [0, 1.7, 2], [0, 0, 10], [1.5, 0, 1], [0, 0, -0.5]])
    np.testing.assert_allclose(box.signed_distance(points), [0.1, 0.25, 0.3, 1.0, -0.5, -0.5])
    assert len(box.triangulate()) == 10
    assert [p.normal for p in box.planes()] == [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]


def test_box_triangles_match_its_distance_and_face_inward():
    box = Box(name="w", material="m", lower=(-1, -2, 0), upper=(1, 2, 3))
    points = np.random.default_rng(2).uniform([-1, -2, 0], [1, 2, 3], (200, 3))
    np.testing.assert_allclose(box.signed_distance(points), brute_force(box.triangulate(), points))
    mesh = Mesh(name="w", material="m", triangles=box.triangulate())
    np.testing.assert_allclose(mesh.signed_distance(points), box.signed_distance(points))


def test_mesh_knows_the_side_at_its_edges():
    box = Box(name="w", material="m", lower=(-1, -1, -1), upper=(1, 1, 1))
    hollow = Mesh(name="w", material="m", triangles=box.triangulate())
    around = np.array([[1.3, 1.4, 0.1], [1.2, 1.2, 1.2], [-1.5, 0.2, -1.1], [0.2, -1.4, 0.3]])
    assert (hollow.signed_distance(around) < 0).all()
    solid = Mesh(name="w", material="m", triangles=box.triangulate()[:, ::-1])
    np.testing.assert_allclose(solid.signed_distance(around), -hollow.signed_distance(around))


def test_plane_distance_and_normalised_normal():
    plane = Plane(name="w", material="m", point=(0, 0, 1), normal=(0, 3, 4))
    assert plane.normal == pytest.approx((0, 0.6, 0.8))
    np.testing.assert_allclose(plane.signed_distance(np.array([[0, 0, 2], [5, -5, 1]])), [0.8, -3.0])
    square = plane.triangulate(2.0)
    np.testing.assert_allclose(plane.signed_distance(square.reshape(-1, 3)), 0, atol=1e-15)
    normal = np.cross(square[0, 1] - square[0, 0], square[0, 2] - square[0, 0])
    np.testing.assert_allclose(normal / np.linalg.norm(normal), plane.normal)


@pytest.mark.parametrize("normal", [(0, 0, 0), (float("nan"), 0, 1)])
def test_a_direction_is_a_finite_vector(normal):
    with pytest.raises(ValueError):
        Plane(name="w", material="m", point=(0, 0, 0), normal=normal)


def test_shapes_that_are_none():
    with pytest.raises(ValueError, match="same point"):
        Cylinder(name="w", material="m", start=(1, 1, 1), end=(1, 1, 1), radius=1)
    with pytest.raises(ValueError, match="cannot have closed ends"):
        Cylinder(name="w", material="m", start=(0, 0, 0), end=(1, 1, 1), radius=1, outside=True, closed_end=True)
    with pytest.raises(ValueError, match="both 0"):
        Frustum(name="w", material="m", start=(0, 0, 0), end=(1, 1, 1), radius_start=0, radius_end=0)
    with pytest.raises(ValueError, match="axis z"):
        Box(name="w", material="m", lower=(0, 0, 1), upper=(1, 1, 1))
    with pytest.raises(ValueError, match="n > 0"):
        Mesh(name="w", material="m", triangles=[])
    with pytest.raises(ValueError, match="triangle 0"):
        Mesh(name="w", material="m", triangles=[[[0, 0, 0], [1, 0, 0], [0, float("nan"), 0]]])


def ball_void(points):
    """Signed distance from inside a sphere of radius 1 about the origin."""
    return 1 - np.linalg.norm(points, axis=1)


def grid(function=ball_void, **fields):
    fields = {"name": "void", "material": "glass", "lower": (-1.2,) * 3, "upper": (1.2,) * 3, "spacing": 0.1, **fields}
    return Sdf.from_function(function=function, **fields)


def test_a_grid_knows_the_distances_that_it_was_made_from():
    """Linear interpolation of a surface of curvature 1/R errs by at most h^2/(4 R): here R > 0.4."""
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (500, 3))
    points = points[np.linalg.norm(points, axis=1) > 0.6]
    assert grid().signed_distance(points) == pytest.approx(ball_void(points), abs=0.1**2 / (4 * 0.4))


def test_parts_of_a_grid_leave_the_void_of_all_of_them_with_a_sharp_corner():
    floor, side = (lambda x: x[:, 2], lambda x: x[:, 0])
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (500, 3))
    expected = np.minimum(points[:, 2], points[:, 0])
    assert grid((floor, side)).signed_distance(points) == pytest.approx(expected, abs=1e-12)


def test_beyond_a_grid_the_distance_at_its_nearest_point_counts():
    wall = grid(lambda x: x[:, 2])
    assert wall.signed_distance(np.array([[50, -50, 0.3], [0, 0, 50], [0, 0, -50]])) == pytest.approx([0.3, 1.2, -1.2])


def test_the_surface_of_a_grid_is_closed_and_faces_the_void():
    triangles = grid().triangulate()
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    assert np.abs(normal.sum(axis=0)).max() < 1e-12
    assert (normal * triangles.mean(axis=1)).sum(axis=1).max() < 0
    assert np.linalg.norm(normal, axis=1).sum() == pytest.approx(4 * np.pi, rel=5e-3)


def test_a_function_that_is_no_distance_is_refused():
    with pytest.raises(ValueError, match=r"void are no distances: they change by 0\.2 m between two nodes"):
        grid(lambda x: 2 * x[:, 0])


@pytest.mark.parametrize("shape", [(5, 5), (2, 5, 5), (0, 3, 3, 3)])
def test_a_grid_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"values must have shape \(nx, ny, nz\)"):
        Sdf(name="void", material="glass", values=np.zeros(shape), origin=(0, 0, 0), spacing=0.1)

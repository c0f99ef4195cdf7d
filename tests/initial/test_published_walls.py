"""Published wall meshes are read as they are; bad meshes and those of another case are refused."""

from pathlib import Path

import numpy as np
import pytest

from dembench.initial.published import find_file
from dembench.initial.published_walls import HEADER, MESHES, read_walls
from dembench.initial.rows import CoordinatesError

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"
TRIANGLE = "0 0 0 1 0 0 0 1 0"
COUNTS = {"large silo walls": 7632, "small silo walls": 8636, "drum walls": 1200, "impact walls": 56}
published = pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published meshes are not beside the checkout")


def written(folder, rows, header=" ".join(HEADER), end="\r\n"):
    path = folder / "walls.txt"
    path.write_bytes(end.join([header, *rows]).encode())
    return path


@pytest.mark.parametrize("end", ["\r\n", "\n"])
def test_a_mesh(tmp_path, end):
    rows = [TRIANGLE.replace(" ", "\t"), "0 0 0\t0 1 0\t0 0 0.25"]
    found = read_walls(written(tmp_path, rows, end=end))
    np.testing.assert_array_equal(found, [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 0.25]]])


@pytest.mark.parametrize(
    "rows,message",
    [
        ([], "no triangles"),
        ([TRIANGLE, "0 0 0 1 0 0 0 1"], ":3: 8 fields; a row has the nine numbers of three vertices"),
        ([TRIANGLE, TRIANGLE + " 1"], ":3: 10 fields"),
        (["0 0 0 1 0 0 0 one 0"], ":2: .* is not all numbers"),
        ([TRIANGLE, "0 0 0 1 0 0 0 nan 0"], ":3: .* is not all finite"),
        ([TRIANGLE, "0 0 0 1 1 1 2 2 2"], r":3: the three vertices lie on a line.*1 such rows"),
        ([TRIANGLE, "0 0 0 0 0 0 2 2 2"], ":3: the three vertices lie on a line"),
    ],
)
def test_a_bad_mesh(tmp_path, rows, message):
    with pytest.raises(CoordinatesError, match=message):
        read_walls(written(tmp_path, rows))


@pytest.mark.parametrize("header", ["", TRIANGLE, "Radius[m] PosX[m] PosY[m] PosZ[m]"])
def test_another_header(tmp_path, header):
    with pytest.raises(CoordinatesError, match=r":1: expected the header 'vertex1_X\[m\]"):
        read_walls(written(tmp_path, [TRIANGLE], header=header))


def test_no_file(tmp_path):
    with pytest.raises(CoordinatesError, match="No such file"):
        read_walls(tmp_path / "walls.txt")


def test_a_mesh_of_none_of_the_cases(tmp_path):
    with pytest.raises(
        CoordinatesError, match=r"reaches from \(0.0, 0.0, 0.0\) .*the drum walls reach from \(-0.101951"
    ):
        read_walls(written(tmp_path, [TRIANGLE]), "drum walls")


@published
@pytest.mark.parametrize("name", COUNTS)
def test_the_published_meshes(name):
    path = find_file(PUBLISHED, name)
    assert read_walls(path, name).shape == (COUNTS[name], 3, 3)
    for other in MESHES:
        if other != name:
            with pytest.raises(CoordinatesError, match=f"as the {name} do; the {other} reach"):
                read_walls(path, other)


def _without_the_middle(lines):
    return [*lines[:500], *lines[701:]]


def _with_a_cut_number(lines):
    return [*lines[:-1], lines[-1][:-3]]


def _with_a_turned_triangle(lines):
    fields = lines[600].split()
    return [*lines[:600], " ".join(fields[3:6] + fields[:3] + fields[6:]), *lines[601:]]


@published
@pytest.mark.parametrize(
    "damage,message",
    [
        (_without_the_middle, "999 triangles; the drum walls have 1200"),
        (_with_a_cut_number, ":1201: the surface is open at edges of this triangle; accepted is a closed surface"),
        (_with_a_turned_triangle, ":602: the surface is open at edges of this triangle"),
    ],
)
def test_damage_inside_the_volume(tmp_path, damage, message):
    """The volume is that of the published drum all the same: its triangles are counted and fit together."""
    lines = find_file(PUBLISHED, "drum walls").read_text().splitlines()
    assert lines[-1].endswith("-0.101988")
    path = written(tmp_path, damage(lines[1:]))
    with pytest.raises(CoordinatesError, match=message):
        read_walls(path, "drum walls")


@published
def test_the_published_drum_is_a_polygon():
    """100 facets 5e-5 m inside R = 0.1 m: the apothem is R cos(pi/100) (measured independently: 0.0999505)."""
    triangles = read_walls(find_file(PUBLISHED, "drum walls"), "drum walls")
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    distance = np.abs((normal * triangles[:, 0]).sum(axis=1))[np.abs(normal[:, 1]) < 1e-6]
    inner = distance[distance < 0.101]
    assert len(inner) == 200
    assert inner == pytest.approx(0.0999505, abs=2e-7)

"""Published coordinate files are read as they are; anything else is refused with file and line."""

from pathlib import Path

import numpy as np
import pytest

from dembench.initial.published import find_file, read_centres, read_coordinates
from dembench.initial.rows import CoordinatesError

HEADER = "Radius[m]\tPosX[m] PosY[m] PosZ[m]"
ROWS = [" 0.001 -0.03943927123 0.008236898253 -0.08041593914", " 0.001 0.01815755118 0.007231909595 -0.08382616396"]
ODD_ROW = " 5 0.01 0.01 0 0 0.06"
BALL_ROW = " 0.01 0 0 0.06"
GRAIN = [0.001]
PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"


def written(folder, rows, header=HEADER, end="\r\n"):
    path = folder / "beds_25KParticles.txt"
    path.write_bytes((end.join([header, *rows, "", ""])).encode())
    return path


@pytest.mark.parametrize("last", [[], [ODD_ROW], [BALL_ROW]], ids=["none", "six fields", "ball"])
@pytest.mark.parametrize("end", ["\r\n", "\n"])
def test_known_forms_of_the_last_row(tmp_path, last, end):
    found = read_coordinates(written(tmp_path, [*ROWS, *last], end=end), GRAIN, ball=0.01)
    np.testing.assert_array_equal(
        found.position,
        [[-0.03943927123, 0.008236898253, -0.08041593914], [0.01815755118, 0.007231909595, -0.08382616396]],
    )
    np.testing.assert_array_equal(found.radius, [0.001, 0.001])


@pytest.mark.parametrize(
    "rows,line",
    [
        ([ODD_ROW, *ROWS], 2),
        ([ROWS[0], ODD_ROW, ODD_ROW], 3),
        ([*ROWS, " 0.001 1 2"], 4),
        ([*ROWS, " 0.001 1 2 3 4"], 4),
        ([ROWS[0], "", ROWS[1]], 3),
        ([ROWS[0], " 0.001 a b c", ROWS[1]], 3),
        ([ROWS[0], " 0.001 nan 0 0"], 3),
        ([ROWS[0], " 0.001 0 inf 0", ROWS[1]], 3),
        ([ROWS[0], " -0.001 0 0 0"], 3),
        ([ROWS[0], " 0 0 0 0", ROWS[1]], 3),
    ],
)
def test_other_rows_are_refused_with_their_line(tmp_path, rows, line):
    path = written(tmp_path, rows)
    with pytest.raises(CoordinatesError, match=rf"beds_25KParticles\.txt:{line}: "):
        read_coordinates(path, GRAIN, ball=0.01)


def test_the_message_says_what_is_accepted(tmp_path):
    with pytest.raises(CoordinatesError, match="four numbers radius, x, y, z; the last may have six"):
        read_coordinates(written(tmp_path, [*ROWS, " 1 2"]), GRAIN, ball=0.01)


@pytest.mark.parametrize("header", ["", "x y z", "PosX[m] PosY[m] PosZ[m]", ROWS[0]])
def test_another_header(tmp_path, header):
    with pytest.raises(CoordinatesError, match=":1: expected the header"):
        read_coordinates(written(tmp_path, ROWS, header=header), GRAIN, ball=0.01)


@pytest.mark.parametrize("rows", [[], [ODD_ROW], [BALL_ROW]])
def test_a_file_without_grains(tmp_path, rows):
    with pytest.raises(CoordinatesError, match="no particles"):
        read_coordinates(written(tmp_path, rows), GRAIN, ball=0.01)


def test_files_that_are_no_text(tmp_path):
    path = tmp_path / "bed.txt"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CoordinatesError, match="plain text"):
        read_coordinates(path, GRAIN, ball=0.01)
    with pytest.raises(CoordinatesError, match="No such file"):
        read_coordinates(tmp_path / "none.txt", GRAIN, ball=0.01)


@pytest.mark.parametrize(
    "name,path",
    [
        ("impact 25k", "penetration_25KParticles.txt"),
        ("impact 100k", "InitialCoordinates/Case 3 - Impact/100KParticles.txt"),
        ("drum", "drum_PartCoordinates.txt"),
        ("drum", "InitialCoordinates/Case 2 - Mixer/PartCoordinates.txt"),
        ("silo large M1", "InitialCoordinates/Case 1 - SiloFlow/PartCoordinates M1 (large orifice).txt"),
        ("silo small M2", "PartCoordinates M2 (small orifice).txt"),
        ("large silo walls", "silo_walls_large.txt"),
        ("small silo walls", "Silo/walls (small orifice).txt"),
        ("drum walls", "drum_walls.txt"),
        ("drum walls", "Case 2 - Mixer/walls.txt"),
        ("impact walls", "Penetration/walls.txt"),
    ],
)
def test_every_name_of_a_published_file(tmp_path, name, path):
    """The names of the data record and of the repository that holds copies, among all others."""
    for other in (
        "x_50KParticles.txt",
        "s/PartCoordinates M1 (small orifice).txt",
        "s/walls (large orifice) old.txt",
        "t/walls.txt",
    ):
        (tmp_path / other).parent.mkdir(exist_ok=True)
        (tmp_path / other).touch()
    wanted = tmp_path / path
    wanted.parent.mkdir(parents=True, exist_ok=True)
    wanted.touch()
    assert find_file(tmp_path, name) == wanted
    assert find_file(wanted, "impact 50k") == wanted


def test_no_file_or_several_in_the_directory(tmp_path):
    with pytest.raises(CoordinatesError, match=r"no file of the impact 25k there; accepted are \*25kparticles\.txt"):
        find_file(tmp_path, "impact 25k")
    written(tmp_path, ROWS)
    (tmp_path / "other_25KParticles.txt").touch()
    with pytest.raises(CoordinatesError, match="can all be the impact 25k; give one of them"):
        find_file(tmp_path, "impact 25k")
    with pytest.raises(CoordinatesError, match="no such file or directory"):
        find_file(tmp_path / "absent", "impact 25k")


def test_a_file_of_two_species(tmp_path):
    path = written(tmp_path, [" 0.002 1 2 3", " 0.001 4 5 6"])
    assert read_coordinates(path, [0.002, 0.001]).radius.tolist() == [0.002, 0.001]
    with pytest.raises(CoordinatesError, match=r":2: radius 0\.002 m; accepted are 0\.001 m"):
        read_coordinates(path, GRAIN, ball=0.01)


def test_a_file_without_header(tmp_path):
    path = tmp_path / "PartCoordinates M1 (large orifice).txt"
    path.write_bytes(b"0.01 -0.02 0.1\r\n1e-3\t2e-3 3e-3\r\n\r\n")
    found = read_centres(path, 0.002)
    np.testing.assert_array_equal(found.position, [[0.01, -0.02, 0.1], [1e-3, 2e-3, 3e-3]])
    assert found.radius.tolist() == [0.002, 0.002]
    with pytest.raises(CoordinatesError, match=":1: expected the header"):
        read_coordinates(path, GRAIN)


@pytest.mark.parametrize(
    "text,message",
    [
        ("", "no particles"),
        ("1 2 3\n1 2\n", ":2: 2 fields; a row of a silo file has the three numbers"),
        ("1 2 3\n1 2 z\n", ":2: '1 2 z' is not all numbers"),
        ("1 2 3\n\n1 2 3\n", ":2: 0 fields"),
        ("0.001 1 2 3\n", ":1: 4 fields"),
        ("Radius[m] PosX[m] PosY[m] PosZ[m]\n 0.001 1 2 3\n", ":1: has the header of another case"),
    ],
)
def test_bad_rows_without_header(tmp_path, text, message):
    path = tmp_path / "silo.txt"
    path.write_text(text)
    with pytest.raises(CoordinatesError, match=message):
        read_centres(path, 0.002)


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published coordinate files are not beside the checkout")
@pytest.mark.parametrize("bed,count", [("25k", 25000), ("50k", 50000)])
def test_the_published_beds(bed, count):
    found = read_coordinates(find_file(PUBLISHED, f"impact {bed}"), GRAIN, ball=0.01)
    assert len(found.position) == count
    assert set(found.radius) == {0.001}
    assert np.abs(found.position[:, 0]).max() <= 0.0480006


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published coordinate files are not beside the checkout")
def test_the_published_drum():
    """8 000 grains of 4 mm first, then 30 000 of 2 mm; the centres stand as measured independently."""
    found = read_coordinates(find_file(PUBLISHED, "drum"), [0.001, 0.002])
    assert found.radius.tolist() == [0.002] * 8000 + [0.001] * 30000
    assert found.position[:8000, 2].mean() == pytest.approx(-0.06372, abs=5e-6)
    assert found.position[8000:, 2].mean() == pytest.approx(-0.02886, abs=5e-6)
    assert np.hypot(found.position[:, 0], found.position[:, 2]).max() < 0.1

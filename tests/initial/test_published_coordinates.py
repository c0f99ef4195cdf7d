"""Published coordinate files are read as they are; anything else is refused with file and line."""

from pathlib import Path

import numpy as np
import pytest

from dembench.initial.published import CoordinatesError, find_coordinates, read_coordinates

HEADER = "Radius[m]\tPosX[m] PosY[m] PosZ[m]"
ROWS = [" 0.001 -0.03943927123 0.008236898253 -0.08041593914", " 0.001 0.01815755118 0.007231909595 -0.08382616396"]
ODD_ROW = " 5 0.01 0.01 0 0 0.06"
BALL_ROW = " 0.01 0 0 0.06"
PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"


def written(folder, rows, header=HEADER, end="\r\n"):
    path = folder / "beds_25KParticles.txt"
    path.write_bytes((end.join([header, *rows, "", ""])).encode())
    return path


@pytest.mark.parametrize("last", [[], [ODD_ROW], [BALL_ROW]], ids=["none", "six fields", "ball"])
@pytest.mark.parametrize("end", ["\r\n", "\n"])
def test_known_forms_of_the_last_row(tmp_path, last, end):
    found = read_coordinates(written(tmp_path, [*ROWS, *last], end=end), ball_radius=0.01)
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
        read_coordinates(path, ball_radius=0.01)


def test_the_message_says_what_is_accepted(tmp_path):
    with pytest.raises(CoordinatesError, match="four numbers radius, x, y, z; the last may have six"):
        read_coordinates(written(tmp_path, [*ROWS, " 1 2"]), ball_radius=0.01)


@pytest.mark.parametrize("header", ["", "x y z", "PosX[m] PosY[m] PosZ[m]", ROWS[0]])
def test_another_header(tmp_path, header):
    with pytest.raises(CoordinatesError, match=":1: expected the header"):
        read_coordinates(written(tmp_path, ROWS, header=header), ball_radius=0.01)


@pytest.mark.parametrize("rows", [[], [ODD_ROW], [BALL_ROW]])
def test_a_file_without_grains(tmp_path, rows):
    with pytest.raises(CoordinatesError, match="no particles"):
        read_coordinates(written(tmp_path, rows), ball_radius=0.01)


def test_files_that_are_no_text(tmp_path):
    path = tmp_path / "bed.txt"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CoordinatesError, match="plain text"):
        read_coordinates(path, ball_radius=0.01)
    with pytest.raises(CoordinatesError, match="No such file"):
        read_coordinates(tmp_path / "none.txt", ball_radius=0.01)


def test_a_directory_or_a_file_may_be_given(tmp_path):
    path = written(tmp_path, ROWS)
    (tmp_path / "beds_50KParticles.txt").touch()
    assert find_coordinates(tmp_path, "25KParticles.txt") == path
    assert find_coordinates(path, "50KParticles.txt") == path


def test_no_file_or_several_in_the_directory(tmp_path):
    with pytest.raises(CoordinatesError, match=r"no file there is called '\.\.\.25KParticles\.txt'"):
        find_coordinates(tmp_path, "25KParticles.txt")
    written(tmp_path, ROWS)
    (tmp_path / "other_25KParticles.txt").touch()
    with pytest.raises(CoordinatesError, match="name one of them"):
        find_coordinates(tmp_path, "25KParticles.txt")
    with pytest.raises(CoordinatesError, match="no such file or directory"):
        find_coordinates(tmp_path / "absent", "25KParticles.txt")


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published coordinate files are not beside the checkout")
@pytest.mark.parametrize("count", [25, 50])
def test_the_published_files(count):
    found = read_coordinates(find_coordinates(PUBLISHED, f"{count}KParticles.txt"), ball_radius=0.01)
    assert len(found.position) == count * 1000
    assert set(found.radius) == {0.001}
    assert np.abs(found.position[:, 0]).max() <= 0.0480006

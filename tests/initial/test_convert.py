"""The verb that converts initial states."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from dembench.cli import app
from dembench.initial import formats

BED = "Radius[m]\tPosX[m] PosY[m] PosZ[m]\r\n 0.001 0.1 0.2 -0.3\r\n 0.001 0.5 0.25 0\r\n 5 0.01 0.01 0 0 0.06\r\n\r\n"


@pytest.fixture
def bed(tmp_path):
    path = tmp_path / "25KParticles.txt"
    path.write_bytes(BED.encode())
    return path


def convert(*words):
    return CliRunner().invoke(app, ["initial", "convert", *map(str, words)])


def test_a_published_bed_for_another_program_and_back(bed, tmp_path):
    """The odd last row is no grain; the file that comes back has the same rows, with blanks in its header."""
    data, back = tmp_path / "bed.data", tmp_path / "back.txt"
    assert convert(bed, data, "--density", "2500").exit_code == 0
    assert formats.read(data).density.tolist() == [2500, 2500]
    assert convert(data, back, "--to", "published", "--drop", "density").exit_code == 0
    assert (
        back.read_bytes()
        == BED.replace("\t", " ").replace(" 5 0.01 0.01 0 0 0.06\r\n", "").replace(" 0\r", " 0.0\r").encode()
    )


def test_it_says_what_was_written(bed, tmp_path):
    done = convert(bed, tmp_path / "bed.vtp", "--json")
    assert json.loads(done.stdout) == {
        "file": str(tmp_path / "bed.vtp"),
        "format": "vtp",
        "spheres": 2,
        "fields": ["radius"],
    }
    assert "2 spheres, arrays of this program; position, radius" in convert(bed, tmp_path / "bed.npz").stdout.replace(
        "\n", " "
    )


@pytest.mark.parametrize(
    "words,message",
    [
        (("bed.data",), "needs density, which is not known; give --density"),
        (("bed.data", "--density", "-1"), "density of sphere 1 is -1 kg/m3"),
        (("bed.csv", "--radius", "0.002"), "--radius 0.002 m: the file has a radius of its own"),
        (("bed.csv", "--drop", "colour"), "--drop colour: accepted are radius"),
        (("bed.txt",), "name one of musen, published, published-silo"),
        (("bed.txt", "--to", "published-silo"), "has no place for radius, only for positions; --drop radius"),
        (("bed.csv", "--from", "csv"), ":2: Radius[m] PosX[m] PosY[m] PosZ[m] is"),
        (("25KParticles.txt", "--to", "published"), "is there; give another name, or --overwrite"),
        (("none/bed.csv",), "cannot be written: No such file"),
    ],
)
def test_what_is_refused_leaves_nothing_behind(bed, tmp_path, words, message):
    done = convert(bed, tmp_path / words[0], *words[1:])
    assert done.exit_code == 2
    assert message in " ".join(done.output.split())
    assert [path.name for path in tmp_path.iterdir()] == [bed.name] and bed.read_bytes() == BED.encode()


def test_a_file_is_replaced_when_asked_for(bed):
    state = formats.read(bed)
    assert convert(bed, bed, "--to", "published", "--overwrite").exit_code == 0
    assert np.array_equal(formats.read(bed).position, state.position)

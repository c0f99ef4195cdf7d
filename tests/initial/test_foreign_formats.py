"""Files as other programs write them: what is read of them, and what is said of those that are broken."""

import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from dembench.initial import formats
from dembench.initial.formats.state import FIELDS, state_of
from dembench.initial.rows import CoordinatesError

MUSEN = Path(__file__).parents[3] / "shared" / "data" / "musen"


def text(folder, content, name="file"):
    path = folder / name
    path.write_text(content)
    return path


DATA = """a comment that counts 7 atoms

2 atoms
2 atom types

0 1 xlo xhi
0 1 ylo yhi
0 1 zlo zhi

Atoms # granular

2 1 0.004 2000 0.1 0.2 0.3 0 0 1
1 2 0.002 2500 0.4 0.5 0.6 0 0 0

Velocities

1 1 2 3 4 5 6
2 0 0 0 0 0 -1
"""


def test_a_liggghts_data_file(tmp_path):
    found = formats.read(text(tmp_path, DATA))
    assert found.id.tolist() == [1, 2] and found.species.tolist() == [1, 0]
    assert found.radius.tolist() == [0.001, 0.002] and found.density.tolist() == [2500, 2000]
    assert found.position.tolist() == [[0.4, 0.5, 0.6], [0.1, 0.2, 0.3]]
    assert found.velocity.tolist() == [[1, 2, 3], [0, 0, 0]]
    assert found.angular_velocity.tolist() == [[4, 5, 6], [0, 0, -1]]


@pytest.mark.parametrize(
    "old,new,message",
    [
        ("2 atoms", "3 atoms", "2 rows of Atoms; the header says 3"),
        ("Atoms #", "Bonds #", "no section Atoms; there are Bonds, Velocities"),
        ("0.004 2000", "0.004", ":12: 9 fields; a row of Atoms has number, type, diameter, density"),
        ("0.004", "wide", ":12: .* is not all numbers; a row of Atoms"),
        ("\n1 1 2 3 4 5 6", "", "the numbers of Velocities are not those of Atoms"),
        ("0.004", "-0.004", "radius of sphere 2 is -0.002 m"),
        ("\n2 1 0.004", "\n2 0 0.004", "species of sphere 1 in the file is -1"),
    ],
)
def test_a_bad_liggghts_data_file(tmp_path, old, new, message):
    with pytest.raises(CoordinatesError, match=message):
        formats.read(text(tmp_path, DATA.replace(old, new, 1)), formats.format_named("liggghts-data"))


DUMP = """ITEM: TIMESTEP
0
ITEM: NUMBER OF ATOMS
1
ITEM: BOX BOUNDS ff ff ff
0 1
0 1
0 1
ITEM: ATOMS id x y z
1 0 0 0
ITEM: TIMESTEP
100
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS ff ff ff
0 1
0 1
0 1
ITEM: ATOMS id type mass radius x y z vx vy vz fx
7 1 4.1887902047863905 1 0.5 0.6 0.7 1 2 3 9
3 2 8.377580409572781 1 0.1 0.2 0.3 4 5 6 9
"""


def test_frames_of_a_dump(tmp_path):
    """The last frame unless another is asked for; a mass 4/3 pi r^3 rho gives the density; rows come in any order."""
    path = text(tmp_path, DUMP)
    last = formats.read(path)
    assert last.id.tolist() == [3, 7] and last.species.tolist() == [1, 0]
    assert last.density == pytest.approx([2, 1], rel=1e-15)
    assert last.velocity.tolist() == [[4, 5, 6], [1, 2, 3]] and last.angular_velocity is None
    assert len(formats.read(path, frame=0)) == 1
    with pytest.raises(CoordinatesError, match="frame 2 of 2; accepted are 0 to 1, or -1"):
        formats.read(path, frame=2)


@pytest.mark.parametrize(
    "old,new,message",
    [
        ("vx vy vz", "vx vy xx", "velocity has no z; accepted are all of x, y, z, or none"),
        ("x y z vx", "xs ys zs vx", "no positions; accepted are columns x, y, z"),
        ("\n3 2 8", "\n3 2", ":21: 10 fields|:21: .*not all numbers"),
        ("NUMBER OF ATOMS\n2", "NUMBER OF ATOMS\n3", ":19: 2 rows follow; the frame says 3"),
        ("NUMBER OF ATOMS\n2", "NUMBER\n2", ":11: the frame does not say its number of atoms"),
        ("ITEM: ATOMS id type", "ITEM: ENTRIES id type", ":11: the frame has no line 'ITEM: ATOMS ...'"),
        ("radius x", "radius r x", ":20: 11 fields; a row has 12 numbers"),
    ],
)
def test_a_bad_dump(tmp_path, old, new, message):
    head, tail = DUMP.split("ITEM: TIMESTEP\n100")
    with pytest.raises(CoordinatesError, match=message):
        formats.read(text(tmp_path, head + "ITEM: TIMESTEP\n100" + tail.replace(old, new, 1)))


@pytest.mark.parametrize(
    "content,message",
    [
        ("x [mm],y [mm],z [mm]\n1,2,3\n", r"column 'x \[mm\]': the unit is mm; accepted is m"),
        ("x,y,r\n1,2,3\n", "position has no z"),
        ("x,y,z\n1,2\n", ":2: 2 fields; the header has 3"),
        ("x,y,z\n1,2,3\n1,2,three\n", ":3: z is 'three'; accepted is a number"),
        ("x,y,z,radius,r\n1,2,3,4,5\n", "columns 'radius' and 'r' are both radius"),
        ("x,y,z\n", "no spheres"),
        ("x,y,z,radius\n1,2,3,inf\n", "radius of sphere 1 in the file is inf"),
    ],
)
def test_a_bad_table(tmp_path, content, message):
    with pytest.raises(CoordinatesError, match=message):
        formats.read(text(tmp_path, content))


def test_names_of_columns(tmp_path):
    """Names and units as several programs write them, a diameter, and columns that are of no use."""
    content = (
        "ParticleID,PosX [m],Pos_Y[m], z ,diameter [m],rho,vel_x,vel_y,vel_z,temperature\n4,1,2,3,0.5,7,8,9,10,300\n"
    )
    found = formats.read(text(tmp_path, content))
    assert found.id.tolist() == [4] and found.position.tolist() == [[1, 2, 3]]
    assert found.radius.tolist() == [0.25] and found.density.tolist() == [7]
    assert found.velocity.tolist() == [[8, 9, 10]] and found.species is None


VTK_51 = """# vtk DataFile Version 5.1
vtk output
ASCII
DATASET POLYDATA
FIELD FieldData 1
TIME 1 1 double
0.5
POINTS 2 double
0.5 0.25 0.125 1
2 3
VERTICES 3 2
OFFSETS vtktypeint64
0 1 2
CONNECTIVITY vtktypeint64
0 1
POINT_DATA 2
SCALARS radius double
LOOKUP_TABLE default
0.75 0.5
METADATA
INFORMATION 1
NAME L2_NORM_RANGE LOCATION vtkDataArray
DATA 2 0.5 0.75

VECTORS v double
1 2 3 4 5 6
FIELD FieldData 2
id 1 2 vtktypeint64
12 11
METADATA
INFORMATION 0

type 1 2 int
1 2
CELL_DATA 2
SCALARS density double
LOOKUP_TABLE default
1 1
"""
VTK_42 = VTK_51.replace(
    "VERTICES 3 2\nOFFSETS vtktypeint64\n0 1 2\nCONNECTIVITY vtktypeint64\n0 1\n", "VERTICES 2 4\n1 0\n1 1\n"
)


@pytest.mark.parametrize("content", [VTK_51, VTK_42], ids=["5.1", "4.2"])
def test_a_legacy_vtk_file(tmp_path, content):
    """As VTK writes it: cells, metadata and data of cells are passed over."""
    found = formats.read(text(tmp_path, content))
    assert found.id.tolist() == [11, 12] and found.species.tolist() == [1, 0]
    assert found.position.tolist() == [[1, 2, 3], [0.5, 0.25, 0.125]]
    assert found.radius.tolist() == [0.5, 0.75] and found.velocity.tolist() == [[4, 5, 6], [1, 2, 3]]
    assert found.density is None


@pytest.mark.parametrize(
    "old,new,message",
    [
        ("ASCII", "TEXT", ":3: 'TEXT'; accepted are ASCII and BINARY"),
        ("POLYDATA", "STRUCTURED_GRID", ":4: data set STRUCTURED_GRID; accepted are"),
        ("POINTS 2 double", "POINTS 2 complex", ":8: values of type 'complex'"),
        ("0.75 0.5", "0.75 x", ":19: could not convert string to float"),
        ("POINTS 2 double", "POINTS two double", ":8: 'POINTS two double' is no line of this format"),
    ],
)
def test_a_bad_legacy_vtk_file(tmp_path, old, new, message):
    with pytest.raises(CoordinatesError, match=message):
        formats.read(text(tmp_path, VTK_51.replace(old, new, 1)))


def test_a_legacy_vtk_file_that_was_cut_off(tmp_path):
    state = state_of(np.ones((3, 3)), radius=[1, 2, 3])
    formats.write(state, tmp_path / "a.vtk")
    data = (tmp_path / "a.vtk").read_bytes()
    (tmp_path / "a.vtk").write_bytes(data[: len(data) - 9])
    with pytest.raises(CoordinatesError, match="the file ends within 3 values of type"):
        formats.read(tmp_path / "a.vtk")


VTP = """<?xml version="1.0"?>
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32"{}>
<PolyData><Piece NumberOfPoints="4" NumberOfVerts="0">
<PointData><DataArray type="Float64" Name="radius" format="{}">{}</DataArray></PointData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 2 0 0 3 0 0</DataArray></Points>
</Piece></PolyData></VTKFile>
"""
ZLIB = ' compressor="vtkZLibDataCompressor"'


def test_compressed_vtk_xml(tmp_path):
    """Two blocks as the specification lays them out: counts, sizes of blocks, then each packed with zlib."""
    import base64

    values = np.array([0.5, 0.25, 0.125, 1.0])
    packed = [zlib.compress(part.tobytes()) for part in (values[:3], values[3:])]
    header = np.array([2, 24, 8, len(packed[0]), len(packed[1])], "<u4").tobytes()
    encoded = (base64.b64encode(header) + base64.b64encode(b"".join(packed))).decode()
    found = formats.read(text(tmp_path, VTP.format(ZLIB, "binary", encoded)))
    assert found.radius.tolist() == values.tolist() and found.position[:, 0].tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    "parts,message",
    [
        ((' compressor="vtkLZ4DataCompressor"', "ascii", "1 1 1 1"), "compressor vtkLZ4DataCompressor; accepted are"),
        (("", "binary", "IAAAAAAAAAAA"), "an array ends after 9 of 36 bytes"),
        (("", "ascii", "1 1 1"), r"radius has the shape \(3,\); accepted is \(4,\)"),
        (("", "ascii", "1 1 1 <"), "no readable VTK XML file: not well-formed"),
    ],
)
def test_bad_vtk_xml(tmp_path, parts, message):
    with pytest.raises(CoordinatesError, match=message):
        formats.read(text(tmp_path, VTP.format(*parts)))


# ---- with the programs themselves, where they are


@pytest.mark.skipif(not MUSEN.is_dir(), reason="the recorded runs are not beside the checkout")
def test_exports_of_musen():
    """Grains that left are gone, whichever flags the export was made with; tags are known from the recorded runs."""
    counts = {
        name: len(formats.read(MUSEN / "mini-silo" / f"{name}.txt")) for name in ("scene", "export", "export_last")
    }
    assert counts == {"scene": 294, "export": 204, "export_last": 204}
    everything = formats.read(MUSEN / "mini-silo" / "export_last_all.txt")
    assert len(everything) == 204 and everything.angular_velocity.any()
    drum = formats.read(MUSEN / "mini-drum" / "export.txt")
    assert [int((drum.species == k).sum()) for k in (0, 1)] == [192, 96]
    assert set(drum.density[drum.species == 0]) == {2500}
    mass = drum.density * drum.radius**3
    assert mass @ drum.position[:, 0] / mass.sum() == pytest.approx(4.53e-3, abs=1e-5)


@pytest.mark.skipif(not MUSEN.is_dir(), reason="the recorded runs are not beside the checkout")
@pytest.mark.parametrize(
    "fault,message",
    [
        ("garbage-value", ":1: no object of this format: could not convert string to float: '-0.0O15'"),
        ("tag-order-wrong", ":1: no object of this format: tag 5 where the type"),
        ("missing-material", "object 0 is of material 'M1', which has no line"),
        ("duplicate-id", "two spheres have the number 1"),
    ],
)
def test_scenes_that_musen_takes_in_silence(fault, message):
    with pytest.raises(CoordinatesError, match=message):
        formats.read(MUSEN / "errors" / fault / "scene.txt", formats.format_named("musen"))


@pytest.mark.skipif(shutil.which("liggghts") is None, reason="LIGGGHTS is not installed")
def test_liggghts_reads_what_is_written_and_its_dump_is_read(tmp_path):
    """Every number but those that the dump prints with few digits comes back through the program."""
    rng = np.random.default_rng(5)
    state = state_of(
        rng.random((6, 3)),
        radius=rng.random(6) / 100,
        density=np.where(np.arange(6) < 3, 2500.0, 2000.0),
        velocity=rng.normal(size=(6, 3)),
        angular_velocity=rng.normal(size=(6, 3)),
        species=np.arange(6) // 3,
    )
    formats.write(state, tmp_path / "bodies.data")
    columns = "id type x y z vx vy vz omegax omegay omegaz radius mass"
    script = f"""units si
atom_style granular
boundary f f f
newton off
communicate single vel yes
read_data bodies.data
fix a all property/global youngsModulus peratomtype 1e7 1e7
fix b all property/global poissonsRatio peratomtype .2 .2
fix c all property/global coefficientRestitution peratomtypepair 2 .5 .5 .5 .5
fix d all property/global coefficientFriction peratomtypepair 2 .5 .5 .5 .5
neigh_modify delay 0
pair_style gran model hertz tangential history
pair_coeff * *
timestep 1e-9
dump d all custom 1 out.dump {columns}
dump_modify d format "%d %d{" %.17g" * 11}"
run 0
"""
    (tmp_path / "in.liggghts").write_text(script)
    command = ["liggghts", "-in", "in.liggghts"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout[-500:]
    found = formats.read(tmp_path / "out.dump")
    for name in FIELDS:
        tolerance = 1e-14 if name == "density" else 0
        np.testing.assert_allclose(getattr(found, name), getattr(state, name), rtol=tolerance, err_msg=name)
    np.testing.assert_array_equal(found.position, state.position)

"""States of spheres go through every format and come back with all their bits; what does not fit is refused."""

import itertools
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from dembench.initial import formats
from dembench.initial.formats.registry import FORMATS
from dembench.initial.formats.state import FIELDS, StateError, state_of
from dembench.initial.rows import CoordinatesError

MUSEN = Path(__file__).parents[3] / "shared" / "data" / "musen"
NAMES = [known.name for known in FORMATS]
finite = st.floats(-1e6, 1e6, allow_nan=False, allow_subnormal=False)
positive = st.floats(1e-9, 1e6)


@st.composite
def states(draw):
    """States that know everything: values over many magnitudes, numbers with gaps, one density per species."""
    n = draw(st.integers(1, 4))
    rows = nps.arrays(np.float64, (n, 3), elements=finite)
    species = draw(nps.arrays(np.int64, n, elements=st.integers(0, 3)))
    density = np.array(draw(st.lists(positive, min_size=4, max_size=4)))
    return state_of(
        draw(rows),
        id=np.array(draw(st.lists(st.integers(1, 2**40), min_size=n, max_size=n, unique=True))),
        radius=draw(nps.arrays(np.float64, n, elements=positive)),
        density=density[species],
        velocity=draw(rows),
        angular_velocity=draw(rows),
        species=species,
    )


def held(state, *through):
    """The state that is left after some formats: what one of them has no place for is dropped."""
    lost = [name for name in FIELDS if any(name not in formats.format_named(f).holds for f in through)]
    return state.with_fields(**dict.fromkeys(lost))


def same(one, other):
    """Equal to the last bit; what is not known is zero velocities, species 0."""
    zeros = {"velocity": np.zeros((len(one), 3)), "angular_velocity": np.zeros((len(one), 3))}
    zeros["species"] = np.zeros(len(one))
    for name in ("position", *FIELDS):
        a, b = (zeros.get(name) if getattr(s, name) is None else getattr(s, name) for s in (one, other))
        assert (a is None) == (b is None), name
        assert a is None or np.array_equal(a, b), (name, a, b)
    return True


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(state=states())
def test_every_bit_comes_back(tmp_path, name, state):
    path, wanted = tmp_path / "state", held(state, name)
    formats.write(wanted, path, formats.format_named(name))
    assert formats.format_of(path).name == name
    assert same(formats.read(path), wanted)


@pytest.mark.parametrize("first,second", list(itertools.permutations(NAMES, 2)))
def test_all_pairs(tmp_path, first, second):
    """What both formats hold survives both; a radius or density that the first cannot hold is given again."""
    rng = np.random.default_rng(3)
    species = np.array([1, 0, 1, 0, 2])
    state = state_of(
        rng.normal(size=(5, 3)) / 3,
        id=[9, 2, 4, 5, 7],
        radius=rng.random(5) / 700,
        density=np.array([2500.0, 2000.0, 7200.1])[species],
        velocity=rng.normal(size=(5, 3)),
        angular_velocity=rng.normal(size=(5, 3)) * 1e3,
        species=species,
    )
    formats.write(held(state, first), tmp_path / "one", formats.format_named(first))
    found = formats.read(tmp_path / "one")
    into = formats.format_named(second)
    lacking = {name: np.full(5, 0.1) for name in into.needs if getattr(found, name) is None}
    wanted = held(found.with_fields(**lacking), second)
    formats.write(wanted, tmp_path / "two", into)
    assert same(formats.read(tmp_path / "two"), wanted)
    kept = {name for name in FIELDS if name in into.holds and name in formats.format_named(first).holds}
    for name in kept:
        assert np.array_equal(getattr(formats.read(tmp_path / "two"), name), getattr(state, name)), name


# ---- what a format cannot hold


def test_what_has_no_place_is_refused(tmp_path):
    moving = state_of(np.zeros((1, 3)), radius=[1.0], velocity=[[0, 0, 1.0]])
    path = tmp_path / "bed.txt"
    with pytest.raises(CoordinatesError, match=r"has no place for velocity, only for radius; --drop velocity"):
        formats.write(moving, path, formats.format_named("published"))
    with pytest.raises(CoordinatesError, match="needs density, which is not known; give --density"):
        formats.write(moving, tmp_path / "bed.data")
    assert not list(tmp_path.iterdir())


def test_a_species_with_two_densities_is_no_material(tmp_path):
    state = state_of(np.zeros((2, 3)), radius=[1.0, 1.0], density=[1.0, 2.0])
    with pytest.raises(CoordinatesError, match=r"musen: species 0 has 2 densities, 1 and 2 kg/m3"):
        formats.write(state, tmp_path / "scene.txt", formats.format_named("musen"))
    assert not list(tmp_path.iterdir())


def test_silence_is_no_loss():
    """Spheres at rest, of one species, numbered without gaps, say no more than their positions."""
    quiet = state_of(np.zeros((2, 3)), velocity=np.zeros((2, 3)), species=[0, 0], id=[0, 1])
    assert quiet.said() == [] and quiet.id.tolist() == [1, 2]
    assert state_of(np.zeros((2, 3)), id=[2, 1]).said() == []
    assert state_of(np.zeros((2, 3)), id=[1, 3]).said() == ["id"]


@pytest.mark.parametrize(
    "fields,message",
    [
        ({"radius": [1.0, 0.0]}, r"radius of sphere 2 is 0 m; accepted is one above 0"),
        ({"density": [-1.0, 1.0]}, r"density of sphere 1 is -1 kg/m3"),
        ({"velocity": [[0, 0, 0], [0, np.nan, 0]]}, r"velocity of sphere 2 in the file is nan"),
        ({"radius": [1.0]}, r"radius has the shape \(1,\); accepted is \(2,\)"),
        ({"species": [0.5, 0]}, r"species of sphere 1 in the file is 0.5; accepted are whole numbers"),
        ({"id": [3, 3]}, r"two spheres have the number 3"),
        ({"id": [-1, 3]}, r"id of sphere 1 in the file is -1"),
    ],
)
def test_bad_values(fields, message):
    with pytest.raises(StateError, match=message):
        state_of(np.zeros((2, 3)), **fields)


def test_no_spheres():
    with pytest.raises(StateError, match="no spheres"):
        state_of(np.zeros((0, 3)))


# ---- files of other programs


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
    import zlib

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


def test_files_of_no_format(tmp_path):
    with pytest.raises(CoordinatesError, match="of no known format; known are liggghts-data"):
        formats.read(text(tmp_path, "hello\n"))
    with pytest.raises(CoordinatesError, match="No such file"):
        formats.read(tmp_path / "none")
    with pytest.raises(CoordinatesError, match="several formats end like this; name one of musen, published"):
        formats.format_for(tmp_path / "a.txt")
    with pytest.raises(CoordinatesError, match=r"no format has the ending '\.foo'"):
        formats.format_for(tmp_path / "a.foo")
    with pytest.raises(CoordinatesError, match="Did you mean 'musen'"):
        formats.format_named("musn")
    np.savez(tmp_path / "a.npz", centres=np.zeros(3))
    with pytest.raises(CoordinatesError, match="has the arrays centres; accepted are position"):
        formats.read(tmp_path / "a.npz")


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

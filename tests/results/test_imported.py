"""Time series of other programs on the times of a scene: what is repaired, interpolated, left out and refused."""

import h5py
import numpy as np
import pytest

from dembench.results.foreign import ForeignError, read_foreign
from dembench.results.imported import imported
from dembench.scene import (
    Bodies,
    Count,
    Domain,
    Material,
    PairLaw,
    Region,
    Scene,
    Species,
    Trajectory,
    ZoneCount,
)

GRAVITY, SPEED = 9.81, 5.0


def scene(*observables, duration=0.1, height=0.0, drop=0.5):
    """A fast ball at a height above a hundred grains that stand still below it; half of them have x < 0."""
    grains = np.stack([np.linspace(-0.45, 0.45, 100), np.zeros(100), np.full(100, height - drop)], axis=1)
    return Scene(
        name="fall",
        materials=(Material(name="glass", density=2500, young=1e7, poisson=0.25),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=0.8, friction=0.3),),
        species=(
            Species(name="M1", material="glass", radius=0.002),
            Species(name="M2", material="glass", radius=0.001),
        ),
        bodies=Bodies(
            position=np.vstack([grains, [0, 0, height]]),
            species=np.append(np.arange(100) % 2, 0),
            velocity=np.vstack([np.zeros((100, 3)), [0, 0, -SPEED]]),
        ),
        domain=Domain(lower=(-1, -1, -1), upper=(1, 1, 1)),
        duration=duration,
        time_step=1e-5,
        observables=observables,
    )


BALL = Trajectory(name="ball", body=100, interval=1e-2, track_interval=1e-2)
INSIDE = Count(name="inside", interval=0.1, region=Region(lower=(None, None, -0.6)))
ZONES = ZoneCount(
    name="zones",
    interval=0.1,
    zones={"zone1": Region(lower=(0, None, None)), "zone2": Region(upper=(0, None, None))},
)


def fall(time):
    return -SPEED * time - 0.5 * GRAVITY * time**2


def taken(folder, wanted, **columns):
    path = folder / "series.npz"
    np.savez(path, **columns)
    return imported(wanted, "the case", read_foreign(path))


# ---- series


def test_samples_at_the_times_of_the_scene_are_taken_as_they_are(tmp_path):
    time = np.arange(11) * 1e-2
    found = taken(tmp_path, scene(BALL), t=time, z=fall(time))
    series = found.observables["ball_displacement"]
    np.testing.assert_array_equal(series.value, fall(time))
    np.testing.assert_allclose(series.time, time, rtol=1e-12)
    assert found.notes == () and set(found.observables) == {"ball_displacement"}
    assert (series.unit, series.components, series.title) == ("m", (), "Vertical displacement of ball")


def test_other_times_are_interpolated_in_straight_lines(tmp_path):
    """Rows halfway between two samples are their mean; the first is that of the start, the last is not reached."""
    time = np.arange(10) * 1e-2 + 5e-3
    found = taken(tmp_path, scene(BALL), t=time, z=fall(time))
    value = found.observables["ball_displacement"].value
    assert len(value) == 10 and value[0] == 0
    np.testing.assert_allclose(value[1:], 0.5 * (fall(time[1:]) + fall(time[:-1])), rtol=1e-12)
    assert found.notes == (
        "the row at t = 0 is that of the scene's initial state; the file has none",
        "9 of 10 rows are linear between two samples",
        "the record ends at 0.095 of 0.1 s",
    )


def test_gaps_are_not_filled(tmp_path):
    time = np.array([0, 1, 2, 5, 6, 7, 8, 9, 10]) * 1e-2
    found = taken(tmp_path, scene(BALL), t=time, z=fall(time))
    np.testing.assert_allclose(found.observables["ball_displacement"].time, time, rtol=1e-12)
    assert found.notes == ("2 rows are left out: samples are more than 1.5 sampling intervals apart",)


def test_fine_samples_give_the_lowest_value_between(tmp_path):
    """A dip of 1 m between two sampling times is in the minimum, not in the displacement."""
    time = np.arange(101) * 1e-3
    z = fall(time)
    z[87] -= 1
    found = taken(tmp_path, scene(BALL), t=time, z=z).observables
    np.testing.assert_array_equal(found["ball_minimum"].value[[8, 9, 10]], [z[80], z[87], z[100]])
    np.testing.assert_array_equal(found["ball_displacement"].value, z[::10])


def test_the_free_fall_proves_late_times(tmp_path):
    """Every sample of the fall says its own time; all are 5e-5 s late, so the first row stands for that time."""
    time = np.arange(2000) * 5e-5
    found = taken(tmp_path, scene(BALL), t=time, z=fall(time + 5e-5))
    assert found.notes[0].startswith("t was set 5e-05 s later: ")
    assert len(found.observables["ball_displacement"].time) == 11
    np.testing.assert_allclose(found.observables["ball_displacement"].value, fall(np.arange(11) * 1e-2), rtol=1e-9)


SHALLOW = scene(BALL.model_copy(update={"interval": 1e-3, "track_interval": 1e-3}), height=0.06, drop=0.10725 + 0.004)
"""Start and free fall of the ball above the published bed of 25 000 grains: it touches the first one after 21 ms."""


def test_heights_that_begin_at_the_start_are_displacements(tmp_path):
    time = np.arange(101) * 1e-3
    z = np.maximum(fall(time), -0.1387)
    found = taken(tmp_path, SHALLOW, t=time, z=0.06 + z)
    assert found.notes == ("z was the height of ball: the 0.06 m at which it starts were taken off",)
    np.testing.assert_allclose(found.observables["ball_displacement"].value, z, rtol=0, atol=1e-15)


@pytest.mark.parametrize("offset", [0.1502, 0.059, 0.01, -0.01])
def test_heights_above_another_origin_are_refused(tmp_path, offset):
    """At 5 m/s an offset looks like a delay that is constant to 2 %: what is longer than a sample is none."""
    time = np.arange(101) * 1e-3
    z = np.maximum(fall(time), -0.1387)
    with pytest.raises(ForeignError, match=rf"z is {offset} m at t = 0 s, the free fall of ball gives 0 m"):
        taken(tmp_path, SHALLOW, t=time, z=offset + z)


def test_another_gravity_is_no_delay(tmp_path):
    """A program with g = 9.80 m/s2 falls too late by ever more, and is taken as it is."""
    time = np.arange(2000) * 5e-5
    z = -SPEED * time - 0.5 * 9.80 * time**2
    assert not any("later" in note for note in taken(tmp_path, scene(BALL), t=time, z=z).notes)


def test_counts_of_zones(tmp_path):
    time = np.arange(11) * 0.1
    rising, still = np.arange(11), np.full(11, 25)
    counts = {"z1_m1": 25 - rising, "z1_m2": still, "z2_m1": 26 + rising, "z2_m2": still}
    found = taken(tmp_path, scene(ZONES, duration=1.0), t=time, **counts)
    series = found.observables["zones"]
    assert series.components == ("zone1.M1", "zone1.M2", "zone2.M1", "zone2.M2")
    np.testing.assert_array_equal(series.value, np.stack(list(counts.values()), axis=1))
    assert found.notes == ()


def test_a_last_row_that_counts_two_frames_is_halved(tmp_path):
    time = np.arange(11) * 0.1
    counts = {name: np.full(11, 20.0) for name in ("z1_m1", "z1_m2", "z2_m1", "z2_m2")}
    counts["z2_m1"][-2:] = 22, 42
    for name in ("z1_m1", "z1_m2", "z2_m2"):
        counts[name][-1] = 38
    found = taken(tmp_path, scene(ZONES, duration=1.0), t=time, **counts)
    assert found.observables["zones"].value[-1].tolist() == [19, 19, 21, 19]
    assert "the last row, t = 1 s, counts two frames" in found.notes[0]
    assert "another initial state: 20, 20, 20, 20 at t = 0, the scene has 25, 25, 26, 25" in found.notes[1]


@pytest.mark.parametrize("last", [39, 30])
def test_a_last_row_without_proof_stays(tmp_path, last):
    """An odd count, or a jump by half: the file says nothing for sure."""
    time = np.arange(11) * 0.1
    counts = {name: np.append(np.full(10, 20.0), last) for name in ("z1_m1", "z1_m2", "z2_m1", "z2_m2")}
    found = taken(tmp_path, scene(ZONES, duration=1.0), t=time, **counts)
    assert found.observables["zones"].value[-1].tolist() == [last] * 4


def test_repeated_rows_are_taken_once(tmp_path):
    """Odd first rows as a dump writes them, and no row at 0.3 s that two samples near it do not give."""
    time = np.array([0, 1.5e-6, 1.5e-6, 0.1, 0.2, 0.25, 0.35, 0.4])
    found = taken(tmp_path, scene(INSIDE, duration=0.4), t=time, count=[101, 101, 101, 91, 81, 76, 66, 61])
    np.testing.assert_allclose(found.observables["inside"].value, [101, 91, 81, 71, 61])
    assert found.notes[0] == "1 rows that repeat the one before were left out"


# ---- what is refused


def test_files_that_do_not_fit(tmp_path):
    t = np.arange(11) * 1e-2
    ball, silo = scene(BALL), scene(INSIDE, duration=1.0)

    def refused(message, wanted=ball, **columns):
        with pytest.raises(ForeignError, match=message):
            taken(tmp_path, wanted, **columns)

    refused("no column 'z'; the case needs t, z, the file has t, count", t=t, count=t)
    refused("no column 'count'; the case needs t, count, the file has t, z", silo, t=t, z=t)
    refused("no column 't'; the case needs t, z", z=t)
    refused("11 times and 10 values", t=t, z=t[1:])
    refused("z is nan in row 2", t=t, z=np.where(t == 0.01, np.nan, 0))
    refused(r"t is 0\.01 s in row 3, after 0\.02 s", t=[0, 0.02, 0.01], z=[0, -0.1, -0.05])
    refused("rows 2 and 3 are both t = 0.01 s and differ", t=[0, 0.01, 0.01], z=[0, -0.1, -0.05])
    refused("t begins at -0.01 s", t=t - 0.01, z=fall(t))
    refused(r"t ends at 100 s; the scene lasts 0\.1 s", t=1e3 * t, z=fall(t))
    refused("1 rows; a series has two at least", t=[0.1], z=[0.0])
    refused("z is -50.*free fall of ball gives -0.05.*accepted are displacements", t=t, z=1e3 * fall(t))
    refused("z is 0.06 m at t = 0 s, the free fall of ball gives", t=t, z=0.06 + fall(t))
    refused("z is 0.05.* m at t = 0.01 s", t=t, z=-fall(t))
    tenth = np.arange(11) * 0.1
    refused("50 bodies at t = 0; the scene has 101: this is another case", silo, t=tenth, count=np.full(11, 50))
    refused("2000 bodies in row 1; accepted are 0 to 101", silo, t=tenth, count=np.full(11, 2000))
    refused("-1 bodies in row 11", silo, t=tenth, count=np.append(np.full(10, 101), -1))


@pytest.mark.parametrize("name", ["series.csv", "series.txt"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_tables(tmp_path, name, delimiter):
    rows = [["t", "z"], ["0", "0"], ["0.01", "-0.05"]]
    (tmp_path / name).write_text("\n".join(delimiter.join(row) for row in rows) + "\n\n")
    found = read_foreign(tmp_path / name)
    assert found.format == "csv" and found.columns["z"].tolist() == [0, -0.05]


def test_units_of_titles_and_attributes(tmp_path):
    (tmp_path / "a.csv").write_text("# Time [s], z (mm)\n0,0\n0.01,-50\n")
    found = read_foreign(tmp_path / "a.csv")
    assert found.units == {"time": "s", "z": "mm"}
    with pytest.raises(ForeignError, match="column 'z' is in mm; accepted is m"):
        imported(scene(BALL), "case3", found)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/t"], file["run/z"], file["run/wall_s"] = np.arange(11) * 1e-2, fall(np.arange(11) * 1e-2), 12.5
        file["run/t"].attrs["unit"], file["run/z"].attrs["units"] = "s", "m"
    found = read_foreign(tmp_path / "a.h5")
    assert found.scalars == {"wall_s": 12.5}
    assert len(imported(scene(BALL), "case3", found).observables["ball_displacement"].time) == 11


@pytest.mark.parametrize(
    "name,content,message",
    [
        ("a.csv", "", "empty; accepted is a header line"),
        ("a.csv", "t,z\n1\n", r"a\.csv:2: 1 fields; the header has 2"),
        ("a.csv", "t,z\n1,x\n", r"a\.csv:2: could not convert string to float: 'x'"),
        ("a.csv", "t,t\n1,2\n", "two columns are called 't'; accepted is one"),
        ("a.npz", "no archive", "no readable npz file"),
        ("a.h5", "no file", "no readable HDF5 file"),
        ("a.xlsx", "", r"the ending is '\.xlsx'; accepted are \.csv"),
    ],
)
def test_files_that_cannot_be_read(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(ForeignError, match=message):
        imported(scene(BALL), "case3", read_foreign(tmp_path / name))


def test_no_file(tmp_path):
    with pytest.raises(ForeignError, match="No such file"):
        read_foreign(tmp_path / "none.npz")

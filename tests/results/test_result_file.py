"""The result file: round trip, validation of planted faults, the same layout for all engines."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pandas as pd
import pytest
from conftest import falling_frames, falling_tracks

from dembench.results import (
    Observer,
    Result,
    ResultError,
    export_csv,
    export_vtkhdf,
    read,
    read_records,
    validate,
    write,
)


def make(scene, dt=1e-5, state="ok", frames=None, engine="stub"):
    observer = Observer(scene)
    observer.update(falling_frames(scene, dt)[:frames], falling_tracks(scene, dt))
    return Result(
        scene=scene,
        engine=engine,
        division="closed",
        settings={"dt": dt},
        environment={"cpu": "some"},
        timing={"loop": 1.5, "source": "engine"},
        resources={"peak_rss": 12345},
        counters={"builds": 3},
        status={"state": state},
        provenance={"engine_version": "1"},
        observables=observer.observed(),
        snapshots=observer.snapshots(),
    )


@pytest.fixture
def written(small_scene, tmp_path):
    path = tmp_path / "result.h5"
    write(make(small_scene()), path)
    return path


def test_round_trip(small_scene, tmp_path):
    result = make(small_scene())
    path = tmp_path / "result.h5"
    write(result, path)
    again = read(path)
    assert again.scene == result.scene and again.scene.digest() == result.scene.digest()
    for name in ("engine", "division", "settings", "environment", "timing", "resources", "counters", "status"):
        assert getattr(again, name) == getattr(result, name)
    assert set(again.observables) == set(result.observables)
    for name, o in result.observables.items():
        stored = again.observables[name]
        np.testing.assert_array_equal(stored.value, o.value)
        np.testing.assert_array_equal(stored.time, o.time)
        np.testing.assert_array_equal(stored.step, o.step)
        assert (stored.unit, stored.components, stored.title) == (o.unit, o.components, o.title)
    np.testing.assert_array_equal(again.snapshots["ends"].position, result.snapshots["ends"].position)
    assert validate(path) == []
    assert [p.name for p in tmp_path.iterdir()] == ["result.h5"], "no temporary file is left"


def test_tables_have_named_columns(written):
    result = read(written)
    assert list(result.frame("ball_displacement")) == ["step", "time", "ball_displacement"]
    assert list(result.frame("energy")) == ["step", "time", "translational", "rotational", "potential"]
    with pytest.raises(KeyError, match="ball_displacement"):
        result.frame("ball")


def test_csv_export_has_units(written, tmp_path):
    paths = export_csv(read(written), tmp_path / "csv")
    table = pd.read_csv(next(p for p in paths if p.name == "energy.csv"))
    assert "rotational [J]" in table and "time [s]" in table
    assert table["time [s]"].iloc[0] == 0


def test_vtkhdf_export_leaves_absent_bodies_out(written, tmp_path):
    result = read(written)
    result.snapshots["ends"].position[1, 2] = np.nan
    (path,) = export_vtkhdf(result, tmp_path)
    with h5py.File(path) as file:
        assert list(file["VTKHDF/NumberOfPoints"]) == [4, 3]
        assert list(file["VTKHDF/PointData/id"][4:]) == [0, 1, 3]
        assert list(file["VTKHDF/Steps/Values"]) == list(result.snapshots["ends"].time)


def test_the_file_is_h5md(written):
    with h5py.File(written) as file:
        assert list(file["h5md"].attrs["version"]) == [1, 1]
        assert {"author", "creator"} <= set(file["h5md"])
        assert file["particles/ends/box"].attrs["dimension"] == 3
        assert set(file["particles/ends/position"]) == {"step", "time", "value"}
        assert file["observables/ball_displacement/value"].attrs["unit"] == "m"


def _layout(path):
    found = {}
    with h5py.File(path) as file:
        for root in ("observables", "particles"):

            def note(name, item, root=root):
                if isinstance(item, h5py.Dataset):
                    found[f"{root}/{name}"] = (item.shape, item.attrs.get("unit"))
                    if name.endswith("/time"):
                        found[f"{root}/{name}"] += (tuple(item[()]),)

            file[root].visititems(note)
    return found


def test_two_engines_of_different_step_give_the_same_layout(small_scene, tmp_path):
    scene = small_scene()
    write(make(scene, 1e-5, engine="fine"), tmp_path / "a.h5")
    write(make(scene, 5e-5, engine="coarse"), tmp_path / "b.h5")
    assert _layout(tmp_path / "a.h5") == _layout(tmp_path / "b.h5")
    assert len(_layout(tmp_path / "a.h5")) > 30


def test_a_partial_result_is_valid_where_the_run_did_not_end_well(small_scene, tmp_path):
    write(make(small_scene(), state="interrupted", frames=4), tmp_path / "part.h5")
    assert validate(tmp_path / "part.h5") == []
    write(make(small_scene(), state="interrupted", frames=0), tmp_path / "none.h5")
    assert validate(tmp_path / "none.h5") == []
    assert read(tmp_path / "none.h5").observables["energy"].value.shape == (0, 3)
    write(make(small_scene(), state="ok", frames=4), tmp_path / "claims.h5")
    assert any("4 rows; the scene asks for 11" in f for f in validate(tmp_path / "claims.h5"))


def _drop(name):
    def damage(file):
        del file[name]

    return damage


def _replace(name, change):
    def damage(file):
        attributes = dict(file[name].attrs)
        data = change(file[name][()])
        del file[name]
        file[name] = data
        for key, value in attributes.items():
            file[name].attrs[key] = value

    return damage


def _attribute(name, key, value=None):
    def damage(file):
        if value is None:
            del file[name].attrs[key]
        else:
            file[name].attrs[key] = value

    return damage


def _nan(data):
    data[2] = np.nan
    return data


FAULTS = {
    "no group": (_drop("particles"), "/particles: the group is missing"),
    "no observable": (_drop("observables/energy"), "/observables/energy: the group is missing"),
    "no values": (_drop("observables/energy/value"), "/observables/energy/value: is missing"),
    "no snapshot": (_drop("particles/ends/velocity"), "/particles/ends/velocity: the group is missing"),
    "no radii": (_drop("particles/ends/radius"), "/particles/ends/radius: must be an array"),
    "no scene": (_drop("dembench/scene"), "/dembench/scene: no scene"),
    "no status": (_drop("dembench/status"), "/dembench/status: is missing"),
    "no json": (_replace("dembench/timing", lambda _: b"{loop"), "/dembench/timing: no JSON"),
    "no unit": (_attribute("observables/low/value", "unit"), "the unit is None; it must be '1'"),
    "wrong unit": (_attribute("observables/low/time", "unit", "ms"), "the unit is 'ms'; it must be 's'"),
    "no version": (_attribute("h5md", "version"), "/h5md: the attribute 'version'"),
    "next version": (_attribute("dembench", "version", [7, 0]), "accepted is 1.x"),
    "wrong shape": (_replace("observables/energy/value", lambda v: v[:, :2]), "it must be (6, 3)"),
    "unequal": (_replace("observables/energy/time", lambda t: t[:-1]), "both must be the same"),
    "backwards": (_replace("observables/low/time", lambda t: t[::-1]), "not ascending at row 1"),
    "no zero": (_replace("observables/low/time", lambda t: t + 1e-3), "there is no row at t = 0"),
    "other times": (_replace("observables/low/time", lambda t: t * 1.01), "is no sampling time of the scene"),
    "nan": (_replace("observables/overlap/value", _nan), "1 values are not finite, the first at row 2"),
    "stranger": (lambda file: file.create_group("observables/extra"), "the scene has no such observable"),
    "text": (_replace("observables/low/value", lambda v: np.array([b"x"] * len(v))), "must be numbers"),
    "components": (_attribute("observables/energy/value", "components", ["a", "b", "c"]), "'components'"),
    "digest": (_attribute("dembench/scene", "sha256", "0"), "not the digest"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_validate_finds_a_planted_fault(written, fault):
    damage, message = FAULTS[fault]
    with h5py.File(written, "r+") as file:
        damage(file)
    assert any(message in line for line in validate(written)), validate(written)


def test_validate_takes_any_file(tmp_path):
    path = tmp_path / "x.h5"
    path.write_text(json.dumps({}))
    assert "not an HDF5 file" in validate(path)[0]
    assert validate(tmp_path / "absent.h5") == ["no such file"]
    with h5py.File(path, "w") as file:
        file["observables"] = 1
    assert len(validate(path)) == 4
    with pytest.raises(ResultError, match=r"x\.h5"):
        read(path)


def test_a_result_that_was_cut_off_says_what_to_do(written, tmp_path):
    """A whole file, its first half and a file of another kind: the path and the remedy, none of the library's words."""
    data = written.read_bytes()
    for content in (data[: len(data) // 2], data[:100], b"time,value", b""):
        written.write_bytes(content)
        for attempt in (read, read_records):
            with pytest.raises(ResultError) as error:
                attempt(written)
            assert str(error.value).startswith(f"{written}: no readable result: the file is damaged, cut off")
            assert "--fresh" in str(error.value)
        assert validate(written) == ["not an HDF5 file that can be read: it is damaged, cut off or of another format"]
    with pytest.raises(ResultError, match=r"absent\.h5: no such file"):
        read(tmp_path / "absent.h5")


def test_a_result_that_is_cut_off_after_it_was_opened(written):
    result = read(written)
    written.write_bytes(written.read_bytes()[:1000])
    with pytest.raises(ResultError, match="no readable snapshots 'ends': the file is damaged, cut off"):
        _ = result.snapshots["ends"]


def test_snapshots_are_loaded_when_they_are_asked_for(written):
    """A file whose snapshots are damaged still tells everything else."""
    with h5py.File(written, "a") as file:
        del file["particles/ends/velocity"]
    result = read(written)
    assert len(result.observables["energy"].time) > 0 and list(result.snapshots) == ["ends"]
    with pytest.raises(ResultError, match="no readable snapshots 'ends'"):
        _ = result.snapshots["ends"]
    with pytest.raises(KeyError):
        _ = result.snapshots["middle"]

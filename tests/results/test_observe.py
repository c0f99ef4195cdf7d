"""Observables against values known by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import falling_frames, falling_tracks

from dembench.results import Observer, observe
from dembench.scene import Domain, ElasticEnergy, Region, Rigid, Sink, Trajectory, WallForce
from dembench.scene.overlap import largest_overlap

DT = 1e-5


def test_a_thrown_ball_has_the_displacement_of_the_formula(small_scene):
    scene = small_scene()
    seen = observe(scene, falling_frames(scene, DT), falling_tracks(scene, DT))
    t = np.arange(11) * 1e-3
    np.testing.assert_allclose(seen["ball_displacement"].time, t, rtol=1e-12)
    np.testing.assert_allclose(seen["ball_displacement"].value, -t - 0.5 * 9.81 * t**2, atol=1e-15)
    assert seen["ball_displacement"].unit == "m"
    np.testing.assert_array_equal(seen["ball_displacement"].step, np.round(t / DT))
    assert seen["ball_position"].value.shape == (11, 3)
    np.testing.assert_allclose(seen["ball_velocity"].value[-1], [0, 0, -1 - 0.0981])


def test_the_minimum_lies_between_samples(small_scene):
    scene = small_scene(gravity=(0, 0, 9.81))
    tracks = falling_tracks(scene, DT)
    dip = np.zeros(len(tracks.time))
    dip[13] = -0.5
    tracks = dataclasses.replace(tracks, position=tracks.position + dip[:, None, None] * [0, 0, 1])
    seen = observe(scene, falling_frames(scene, DT), tracks)
    lowest = seen["ball_minimum"].value
    assert lowest[0] == 0
    assert int(np.argmin(lowest)) == 3, "the dip at 2.6 ms belongs to the sample at 3 ms, (2, 3] ms"
    assert lowest[3] == pytest.approx(-0.5 - 2.6e-3 + 0.5 * 9.81 * 2.6e-3**2)
    assert seen["ball_displacement"].value[3] > -0.01
    quiet = np.delete(np.arange(11), 3)
    np.testing.assert_allclose(lowest[quiet], np.minimum(seen["ball_displacement"].value, 0)[quiet], atol=1e-15)


def test_the_minimum_window_is_that_of_its_body_where_another_track_is_finer(small_scene):
    scene = small_scene()
    finer = Trajectory(name="grain", body=2, interval=1e-3, track_interval=5e-5)
    scene = small_scene(observables=(*scene.observables, finer))
    seen = observe(scene, falling_frames(scene, DT), falling_tracks(scene, DT))
    np.testing.assert_allclose(seen["ball_minimum"].value, seen["ball_displacement"].value, atol=1e-15)
    np.testing.assert_allclose(seen["grain_minimum"].value, seen["grain_displacement"].value, atol=1e-15)


def test_energy_is_conserved_in_free_flight_and_has_the_spin_of_a_solid_sphere(small_scene):
    scene = small_scene()
    energy = observe(scene, falling_frames(scene, DT))["energy"]
    mass = 2500 * 4 / 3 * np.pi * 0.02**3
    assert energy.components == ("translational", "rotational", "potential")
    assert energy.value[0, 1] == pytest.approx(0.5 * 0.4 * mass * 0.02**2 * 20**2)
    grain = mass / 1000
    assert energy.value[0, 0] == pytest.approx(0.5 * mass + 0.5 * grain * 0.01)
    assert energy.value[0, 2] == pytest.approx(9.81 * (mass * 0.1 + grain * 0.16))
    np.testing.assert_allclose(energy.value.sum(axis=1), energy.value[0].sum(), rtol=1e-12)


def test_counts_zones_and_centres(small_scene):
    scene = small_scene()
    seen = observe(scene, falling_frames(scene, DT))
    assert seen["low"].value[0] == 2
    assert seen["sides"].components == ("left.grain", "left.ball", "right.grain", "right.ball")
    np.testing.assert_array_equal(seen["sides"].value[0], [2, 1, 1, 0])
    np.testing.assert_allclose(seen["centre"].value[0], [0, 0, 0.16 / 3, 0, 0, 0.1], atol=1e-15)


def test_snapshots_hold_all_bodies(small_scene):
    scene = small_scene()
    observer = Observer(scene)
    observer.update(falling_frames(scene, DT))
    ends = observer.snapshots()["ends"]
    np.testing.assert_allclose(ends.time, [0, 0.01])
    np.testing.assert_array_equal(ends.position[0], scene.bodies.position)
    np.testing.assert_allclose(ends.velocity[1], scene.bodies.velocity + np.array([0, 0, -0.0981]))


def test_growing_sequences_give_the_same_as_one_pass(small_scene):
    scene = small_scene()
    frames, tracks = falling_frames(scene, DT), falling_tracks(scene, DT)
    observer = Observer(scene)
    loaded = []

    class Counting(list):
        def __getitem__(self, k):
            loaded.append(k)
            return super().__getitem__(k)

    for n in range(0, len(frames) + 1, 3):
        part = dataclasses.replace(
            tracks, **{f.name: getattr(tracks, f.name)[: 5 * n] for f in dataclasses.fields(tracks)}
        )
        observer.update(Counting(frames[:n]), part)
    assert len(observer.missing()) == len(frames) % 3
    observer.update(Counting(frames), tracks)
    assert loaded == list(range(len(frames))), "every frame is loaded once"
    assert not len(observer.missing())
    whole = observe(scene, frames, tracks)
    for name, part in observer.observed().items():
        np.testing.assert_array_equal(part.value, whole[name].value)
        np.testing.assert_array_equal(part.time, whole[name].time)


def test_a_partial_run_has_fewer_rows(small_scene):
    scene = small_scene()
    tracks = falling_tracks(scene, DT)
    tracks = dataclasses.replace(tracks, **{f.name: getattr(tracks, f.name)[:22] for f in dataclasses.fields(tracks)})
    seen = observe(scene, falling_frames(scene, DT)[:5], tracks)
    assert [len(seen[n].time) for n in ("ball_displacement", "ball_minimum", "energy", "sides")] == [5, 5, 3, 1]


def test_times_are_those_of_the_scene_though_the_engine_rounds(small_scene):
    scene = small_scene()
    frames = [dataclasses.replace(f, time=f.time + 0.4 * DT * (f.step > 0)) for f in falling_frames(scene, DT)]
    assert np.array_equal(observe(scene, frames)["low"].time, scene.frame_times())
    late = [dataclasses.replace(f, time=f.time + 0.7 * DT * (f.step > 0)) for f in falling_frames(scene, DT)]
    assert len(observe(scene, late)["low"].time) == 1, "more than half a step away is another time"


@pytest.mark.parametrize("field", ["position", "velocity", "angular_velocity"])
def test_a_nan_ends_the_record_with_body_and_time(small_scene, field):
    scene = small_scene()
    frames = falling_frames(scene, DT)
    getattr(frames[4], field)[2, 1] = np.nan
    observer = Observer(scene)
    observer.update(frames)
    assert observer.fault.reason == "nan"
    assert "body 2" in observer.fault.detail and "0.004" in observer.fault.detail
    assert len(observer.observed()["low"].time) == 4


def _without(frame, body):
    keep = np.delete(np.arange(len(frame.present)), body)
    return dataclasses.replace(
        frame, **{n: getattr(frame, n)[keep] for n in ("present", "position", "velocity", "angular_velocity")}
    )


def test_a_lost_particle_is_a_fault_unless_there_is_a_sink(small_scene):
    scene = small_scene()
    frames = falling_frames(scene, DT)
    frames[3:] = [_without(f, 1) for f in frames[3:]]
    observer = Observer(scene)
    observer.update(frames)
    assert observer.fault.reason == "lost particles" and "1 of 4" in observer.fault.detail

    drained = small_scene(sinks=(Sink(name="hole", region=Region(upper=(None, None, 0.01))),))
    observer = Observer(drained)
    observer.update(frames)
    assert observer.fault is None
    assert observer.observed()["low"].value[-1] == 1
    assert np.isnan(observer.snapshots()["ends"].position[1, 1]).all()
    np.testing.assert_allclose(observer.observed()["ball_displacement"].value[-1], -0.01 - 0.5 * 9.81e-4)


def test_wall_forces_are_those_of_the_frames(small_scene):
    scene = small_scene(observables=(WallForce(name="push", wall="box", interval=1e-3),))
    observer = Observer(scene)
    frames = falling_frames(scene, 1e-5)
    observer.update([dataclasses.replace(f, wall_forces={"box": np.array([f.time, 0, 1])}) for f in frames])
    found = observer.observed()["push"]
    assert found.unit == "N" and found.components == ("x", "y", "z")
    np.testing.assert_allclose(found.value, [[f.time, 0, 1] for f in frames])


def _slow_overlap(position, radius, period=None):
    offset = position[:, None] - position[None]
    if period is not None:
        offset -= period * np.round(offset / period)
    overlap = radius[:, None] + radius[None] - np.linalg.norm(offset, axis=2)
    np.fill_diagonal(overlap, 0)
    return max(overlap.max(), 0)


@pytest.mark.parametrize("large", [0, 1, 3])
def test_the_largest_overlap_is_that_of_all_pairs(large):
    random = np.random.default_rng(large)
    position = random.uniform(0, 1, (400, 3))
    radius = random.uniform(0.02, 0.03, 400)
    radius[:large] = random.uniform(0.2, 0.4, large)
    assert largest_overlap(position, radius) == pytest.approx(_slow_overlap(position, radius), rel=1e-12)


def test_the_largest_overlap_may_be_that_of_a_grain_with_the_ball():
    position = np.array([[0, 0, 0], [0.0218, 0, 0], [0.05, 0, 0], [0.0539, 0, 0]])
    radius = np.array([0.02, 0.002, 0.002, 0.002])
    assert largest_overlap(position, radius) == pytest.approx(2e-4)


def test_no_contact_has_no_overlap():
    assert largest_overlap(np.array([[0, 0, 0], [1.0, 0, 0]]), np.array([0.1, 0.1])) == 0
    assert largest_overlap(np.zeros((1, 3)), np.ones(1)) == 0


def test_the_largest_overlap_sees_through_periodic_faces():
    domain = Domain(lower=(0, 0, 0), upper=(1, 2, 3), periodic=(True, False, False))
    radius = np.array([0.1, 0.1, 0.02])
    position = np.array([[0.05, 1, 1], [0.98, 1, 1], [0.5, 1, 1]])
    assert largest_overlap(position, radius, domain) == pytest.approx(0.13)
    apart = np.array([[0.5, 0.05, 1], [0.5, 1.98, 1], [0.2, 1, 1]])
    assert largest_overlap(apart, radius, domain) == 0
    outside = np.array([[-3.95, 1, 1], [0.98, 1, 1], [0.5, 1, 1]])
    assert largest_overlap(outside, radius, domain) == pytest.approx(0.13)


def test_springs_of_pairs_and_walls_store_what_hertz_says(small_scene) -> None:
    """8/15 E* sqrt(R*) d^(5/2) for two grains, a grain and the ball, and a grain on the floor; 0 where nothing touches.

    E* = E/(2 (1 - nu^2)) for two bodies of one material; R* is 1 mm, 20/11 mm and, on the floor, 2 mm.
    """
    scene = small_scene(observables=(ElasticEnergy(name="springs", interval=0.01),))
    position = np.array([[0, 0, 0.0019], [0.0038, 0, 0.05], [0.0, 0, 0.05], [0, 0, 0.0717]])
    frame = dataclasses.replace(falling_frames(scene, 1e-5)[0], position=position)
    (stored,) = observe(scene, [frame])["springs"].value
    stiffness = 8 / 15 * 1e7 / (2 * (1 - 0.25**2))
    parts = [np.sqrt(r) * d**2.5 for r, d in ((0.001, 2e-4), (0.04 / 22, 3e-4), (0.002, 1e-4))]
    assert stored == pytest.approx(stiffness * sum(parts), rel=1e-9)
    assert observe(scene, falling_frames(scene, 1e-5))["springs"].value == pytest.approx([0, 0])


def test_springs_of_a_rigid_law_are_refused(small_scene) -> None:
    scene = small_scene(law=Rigid(), observables=(ElasticEnergy(name="springs", interval=0.01),))
    with pytest.raises(ValueError, match="springs: the energy of springs is not known where the law is rigid"):
        observe(scene, [])

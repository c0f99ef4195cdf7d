"""Time steps and sampling times."""

import numpy as np
import pytest

from dembench.scene import Energy, Overlap, Snapshot, Trajectory


def test_the_step_divides_the_sampling_interval(small_scene):
    seen = (Energy(name="energy", interval=1e-3),)
    scene = small_scene(duration=0.1, observables=seen)
    assert scene.fitted_step(3e-4) == pytest.approx(2.5e-4)
    assert scene.fitted_step(2.5e-4) == pytest.approx(2.5e-4)
    assert scene.fitted_step(1.0) == pytest.approx(1e-3)


@pytest.mark.parametrize("step", [5e-7, 1.5e-6, 8e-7, 7.3e-6])
def test_every_sample_falls_on_a_step(small_scene, step):
    scene = small_scene()
    dt = scene.fitted_step(step)
    assert dt <= step * (1 + 1e-9)
    for times in (scene.frame_times(), scene.track_times(), [scene.duration]):
        steps = np.array(times) / dt
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_rayleigh_time_of_the_published_grains(small_scene):
    """Grain of 1 mm radius: 8.46 us; pi r sqrt(rho/G)/(0.1631 nu + 0.8766) with G = E/2.4."""
    from dembench.scene import Bodies, Material, PairLaw, Species

    scene = small_scene(
        materials=(Material(name="glass", density=2500, young=1e9, poisson=0.2),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=0.5, friction=0.3),),
        species=(Species(name="grain", material="glass", radius=0.001),),
        bodies=Bodies(position=[[0, 0, 0.1]]),
        observables=(),
        time_step=None,
        rayleigh_fraction=0.1,
    )
    assert scene.rayleigh_time() == pytest.approx(8.46e-6, rel=1e-3)
    assert scene.closed_step() == pytest.approx(8.46e-7, rel=1e-3)


def test_frames_are_taken_at_zero_and_at_every_interval(small_scene):
    seen = (
        Energy(name="energy", interval=2e-3),
        Overlap(name="overlap", interval=3e-3),
        Snapshot(name="s", times=(5e-3,)),
    )
    scene = small_scene(duration=0.01, observables=seen)
    np.testing.assert_allclose(scene.frame_times(), [0, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3, 9e-3, 0.01], rtol=1e-12)


def test_a_scene_without_observables_has_a_frame_at_the_start(small_scene):
    np.testing.assert_array_equal(small_scene(observables=()).frame_times(), [0.0])


def test_tracks_have_their_own_finer_times(small_scene):
    scene = small_scene()
    np.testing.assert_allclose(scene.track_times(), np.arange(51) * 2e-4, rtol=1e-12)
    assert scene.tracked_bodies() == (3,)


def test_two_tracks_share_the_finest_common_times(small_scene):
    seen = tuple(Trajectory(name=f"t{k}", body=k, interval=1e-3, track_interval=dt) for k, dt in ((2, 5e-4), (0, 2e-4)))
    scene = small_scene(duration=1e-3, observables=seen)
    np.testing.assert_allclose(scene.track_times(), np.arange(11) * 1e-4)
    assert scene.tracked_bodies() == (0, 2)


def test_a_cut_scene_is_shorter_and_keeps_its_step(small_scene):
    scene = small_scene()
    cut = scene.cut(0.0041)
    assert cut.duration == pytest.approx(0.004, rel=0.05)
    assert cut.frame_times()[-1] <= cut.duration * (1 + 1e-9)
    snapshots = [o for o in cut.observables if isinstance(o, Snapshot)]
    assert snapshots[0].times == (0.0,)
    assert cut.closed_step() == scene.closed_step()


def test_a_scene_cannot_be_cut_longer(small_scene):
    with pytest.raises(ValueError, match=r"0\.02 s is longer"):
        small_scene().cut(0.02)


def test_times_without_a_common_divisor(small_scene):
    seen = (Energy(name="energy", interval=1e-3), Overlap(name="overlap", interval=np.sqrt(2) * 1e-3))
    with pytest.raises(ValueError, match="no common divisor"):
        small_scene(observables=seen).sampling_interval()

"""Case 2: its scene is the published drum, and its quantities and references tell right from wrong."""

from pathlib import Path

import numpy as np
import pytest
from records import Record, Seen, Shots

from dembench.cases import drum, drum_bed
from dembench.cases.base import CaseError
from dembench.cases.registry import parse_case
from dembench.scene import Mesh, check_scene
from dembench.scoring.score import score, verdict

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"
needs_files = pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published files are not beside the checkout")
COMPONENTS = ("zone1.M2", "zone1.M1", "zone2.M2", "zone2.M1")


def layers(counts, radii):
    """Layers of grains on a lattice in the lower part of the drum, one species upon the other, shape (n, 3)."""
    z, found = -0.09, []
    for count, radius in zip(counts, radii, strict=True):
        pitch, left = 2.05 * radius, count
        while left:
            half = np.sqrt((0.1 - 1.1 * radius) ** 2 - z**2) - radius
            x, y = np.arange(-half, half, pitch), np.arange(-0.03 + 1.05 * radius, 0.03 - radius, pitch)
            points = np.stack([a.ravel() for a in np.meshgrid(x, y, [z])], axis=1)[:left]
            found.append(points)
            left -= len(points)
            z += pitch
    return np.vstack(found)


@pytest.fixture
def quick(monkeypatch):
    """The quick scene with grains on a lattice."""

    def made(name, plan, progress, seed=0):
        return layers([layer.count for layer in plan.layers], [s.radius for s in plan.species])

    monkeypatch.setattr(drum, "bed", made)
    case, parameters = parse_case("case2")
    return case.scene(parameters, "quick")


def zones(scene, m1):
    """A result with that number of M1 in zone 2 over time, m1(t), 0.1 s apart."""
    time = np.arange(0, scene.duration + 1e-9, 0.1)
    value = np.zeros((len(time), 4))
    value[:, 3] = m1(time)
    return Record({"zones": Seen(time, value, COMPONENTS)})


def like_the_reference(time):
    """Half cosines between the extrema of the LIGGGHTS curve."""
    at = [-0.295, 0.295, 0.637, 1.57, 2.480, 3.386, 4.394, 5.4]
    value = [17500, 12607, 23250, 0, 17044, 932, 12609, 2000]
    k = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
    t0, t1 = np.array(at)[k], np.array(at)[k + 1]
    v0, v1 = np.array(value)[k], np.array(value)[k + 1]
    return v0 + (v1 - v0) * 0.5 * (1 - np.cos(np.pi * (time - t0) / (t1 - t0)))


@needs_files
def test_the_published_set_up():
    case, parameters = parse_case("case2")
    scene = case.scene(parameters, "published", PUBLISHED)
    assert (len(scene.bodies), scene.time_step, scene.duration) == (38_000, 8e-7, 5.0)
    assert scene.name == "case2_published"
    names = [scene.species[k].name for k in scene.bodies.species]
    assert (names.count("M2"), names.count("M1"), names[0]) == (8_000, 30_000, "M2")
    assert (set(scene.radii()[:8000]), set(scene.radii()[8000:])) == ({0.002}, {0.001})
    mass = [scene.masses()[scene.bodies.species == k].sum() for k in (0, 1)]
    assert mass == pytest.approx([0.53617, 0.31416], rel=1e-4)
    (wall,) = scene.walls
    assert (wall.radius, wall.start, wall.end) == (0.1, (0, -0.03, 0), (0, 0.03, 0))
    assert wall.closed_start and wall.closed_end and wall.motion.angular_velocity == (0, -2, 0)
    law = scene.pair_law("M1", "M2")
    assert (law.restitution, law.friction) == (0.45, 0.2)
    check_scene(scene)


@needs_files
def test_the_published_state_has_the_published_counts():
    """Zone 2 holds 15 047 M1 and 3 963 M2 at the start, zone 1 none."""
    case, parameters = parse_case("case2")
    scene = case.scene(parameters, "published", PUBLISHED)
    counts = {
        zone: [int(region.contains(scene.bodies.position[scene.bodies.species == k]).sum()) for k in (1, 0)]
        for zone, region in scene.observables[0].zones.items()
    }
    assert counts == {"zone1": [0, 0], "zone2": [15_047, 3_963]}


@needs_files
def test_the_mesh_is_the_published_one_and_turns():
    case, parameters = parse_case("case2[walls=mesh]")
    (wall,) = case.scene(parameters, "published", PUBLISHED).walls
    assert isinstance(wall, Mesh) and len(wall.triangles) == 1200
    assert wall.motion.angular_velocity == (0, -2, 0)


def test_a_fill_for_the_published_triangles_clears_the_middles_of_facets():
    """A regular polygon of 100 sides about the drum comes as near to its axis as 0.1 m cos(pi/100)."""
    case, parameters = parse_case("case2[walls=mesh]")
    (wall,) = case.filling(parameters, "published").walls
    assert 0.0998 < wall.radius < 0.1 * np.cos(np.pi / 100)
    (wall,) = case.filling(parameters, "quick").walls
    assert wall.radius == 0.1  # the bed that ships with the package


def test_the_quick_set_up(quick):
    assert quick.material("M1").young == pytest.approx(1e7) and quick.material("M2").young == pytest.approx(5e6)
    volume = quick.radii() ** 3
    # half the number of grains per volume of each: the same volume of both species as published
    assert volume[quick.bodies.species == 0].sum() == pytest.approx(8000 * 0.002**3)
    assert volume[quick.bodies.species == 1].sum() == pytest.approx(30000 * 0.001**3)
    case, parameters = parse_case("case2")
    assert "1e7 Pa instead of 1e9 Pa" in case.softening(parameters, "quick")


def test_a_curve_like_the_reference_is_ok(quick):
    case, _ = parse_case("case2")
    scene = quick.model_copy(update={"duration": 5.0})
    shares = 30_000 / 3_750
    result = zones(scene, lambda t: like_the_reference(t) / shares)
    found = {q.name: q.value for q in case.quantities(scene, result)}
    # parabolas through samples 0.1 s apart miss the tip of these lopsided half cosines by up to 2 % and 0.02 s
    assert found["first_peak"] * shares == pytest.approx(23_250, rel=0.02)
    assert found["second_peak"] * shares == pytest.approx(17_044, rel=0.005)
    assert found["first_peak_time"] == pytest.approx(0.637, abs=0.02)
    assert found["first_period"] == pytest.approx(1.843, abs=0.02)
    assert found["second_period"] == pytest.approx(1.914, abs=0.02)
    assert found["first_decay"] == pytest.approx(17_044 / 23_250, rel=0.02)
    assert found["first_trough"] * shares == pytest.approx(12_607, rel=0.05)


def test_a_run_of_the_first_seven_tenths_has_the_first_peak(quick):
    """One sample beyond the tip, 5 % of the last swing below it."""
    case, _ = parse_case("case2")
    scene = quick.model_copy(update={"duration": 0.7, "bodies": _many(quick)})
    result = zones(scene, lambda t: np.where(t < 0.295, 17_500 - 16_600 * t, _wave(t)))
    found = {q.name: q.value for q in case.quantities(scene, result)}
    assert found["first_peak"] == pytest.approx(23_250, rel=0.02)
    assert found["first_peak_time"] == pytest.approx(0.637, abs=0.005)


def _wave(time):
    """Half a cosine from the first trough of the LIGGGHTS curve to its first peak, and on."""
    return 12_607 + (23_250 - 12_607) * 0.5 * (1 - np.cos(np.pi * (time - 0.295) / 0.342))


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        (like_the_reference, set()),
        (lambda t: 0.7 * like_the_reference(t), {"first_peak", "second_peak", "third_peak", "first_trough"}),
        (
            lambda t: like_the_reference(t * 0.93),
            {"second_peak_time", "third_peak_time", "first_period", "first_peak_time"},
        ),
    ],
)
def test_a_low_or_a_late_curve_is_inaccurate(quick, change, wrong):
    case, parameters = parse_case("case2")
    scene = quick.model_copy(update={"duration": 5.0, "bodies": _many(quick), "name": "case2_published"})
    scores = score(case, scene, zones(scene, change), parameters, "published")
    assert {s.quantity.name for s in scores if s.within is False} >= wrong
    assert verdict(scores) == ("inaccurate" if wrong else "ok")


def test_a_bed_of_ones_own_stands_beside_the_published_numbers_unjudged(quick):
    case, parameters = parse_case("case2")
    scene = quick.model_copy(update={"duration": 5.0, "bodies": _many(quick), "name": "case2_filled"})
    scores = score(case, scene, zones(scene, lambda t: 0.7 * like_the_reference(t)), parameters, "published")
    peak = next(s for s in scores if s.quantity.name == "first_peak")
    assert peak.reference is not None and peak.error < -5_000 and peak.within is None
    assert verdict(scores) == "unscored"


def _many(scene):
    """As many bodies as published: the size of a swing is measured in them."""
    species = np.repeat([0, 1], [8_000, 30_000]).astype(np.int32)
    return scene.bodies.model_copy(update={"position": np.zeros((38_000, 3)), "species": species})


def test_lacey_index_of_layers_and_of_a_random_mixture(quick):
    position = quick.bodies.position
    apart = drum_bed.lacey_index(quick, position)
    rng = np.random.default_rng(5)
    # equal places for all grains: exchanging them at random leaves the places and mixes the species
    mixed = np.mean([drum_bed.lacey_index(quick, rng.permutation(position)) for _ in range(8)])
    assert apart < 0.35
    assert mixed == pytest.approx(1.0, abs=0.03)


def test_lacey_index_of_two_sizes_in_samples_that_a_wall_cuts(monkeypatch):
    """The variance of a random mixture of the published grains, 0.8 % of that of separate ones, is met to a tenth."""
    monkeypatch.setattr(drum, "bed", lambda name, plan, progress: layers([8_000, 30_000], [0.002, 0.001]))
    case, parameters = parse_case("case2")
    scene = case.scene(parameters, "published")
    rng = np.random.default_rng(7)
    mixed = np.mean([drum_bed.lacey_index(scene, rng.permutation(scene.bodies.position)) for _ in range(20)])
    assert mixed == pytest.approx(1.0, abs=0.0008)


def test_surface_angle_of_a_plane_bed(quick):
    rng = np.random.default_rng(2)
    n = len(quick.bodies)
    x = rng.uniform(-0.06, 0.06, n)
    depth = rng.uniform(0, 0.03, n)
    position = np.stack([x, rng.uniform(-0.02, 0.02, n), 0.4 * x - depth - 0.03], axis=1)
    position[rng.random(n) < 0.05] = np.nan
    assert drum_bed.surface_angle(quick, position) == pytest.approx(np.degrees(np.arctan(0.4)), abs=1.0)


def test_wall_layer_that_turns_with_the_drum_does_not_slip(quick):
    radii = quick.radii()
    angle = np.linspace(np.pi, 2 * np.pi, len(radii))
    away = 0.1 - radii
    position = np.stack([away * np.cos(angle), 0 * angle, away * np.sin(angle)], axis=1)
    spin = np.array([0.0, -2.0, 0.0])
    rigid = np.cross(spin, position)
    turning = np.tile(spin, (len(radii), 1))
    corotation, slip = drum_bed.wall_layer(quick, position, rigid, turning)
    assert (corotation, slip) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-12))
    corotation, slip = drum_bed.wall_layer(quick, position, 0 * rigid, 0 * turning)
    assert (corotation, slip) == (pytest.approx(0.0), pytest.approx(1.0))
    # a layer that rolls on the wall moves its centres, and its surface goes with the wall
    rolling = np.cross(spin, position) * (0.5 * 0.1 / away)[:, None]
    backwards = spin * (0.5 * 0.1 / radii)[:, None]
    corotation, slip = drum_bed.wall_layer(quick, position, rolling, backwards)
    assert corotation < 0.6 and slip == pytest.approx(0.0, abs=1e-12)


def test_snapshots_give_the_mixture_at_both_ends(quick):
    case, _ = parse_case("case2")
    time = np.array([0.0, 1.0, 3.0])
    state = np.repeat(quick.bodies.position[None], 3, axis=0)
    shots = Shots(time, state, np.zeros_like(state), np.zeros_like(state))
    found = {q.name: q.value for q in case.quantities(quick, Record({}, {"mixing": shots}))}
    assert found["lacey_start"] == found["lacey_end"] < 0.35
    assert "surface_angle" in found
    assert "corotation" not in found  # no grain of this lattice is at the wall


def test_what_does_not_fit_is_refused(tmp_path):
    case, parameters = parse_case("case2[walls=mesh]")
    with pytest.raises(CaseError, match=r"case2\[walls=mesh\] needs the published triangles"):
        case.scene(parameters, "published")
    case, parameters = parse_case("case2")
    with pytest.raises(CaseError, match="no file of the drum"):
        case.scene(parameters, "published", tmp_path)
    header = "Radius[m] PosX[m] PosY[m] PosZ[m]\n"
    (tmp_path / "drum_PartCoordinates.txt").write_text(header + " 0.002 0 0 -0.05\n 0.001 0 0 0\n")
    with pytest.raises(CaseError, match=r"these are not the grains of case2; accepted are 8000 of 0\.002 m"):
        case.scene(parameters, "published", tmp_path)
    (tmp_path / "drum_PartCoordinates.txt").write_text(header + " 0.005 0 0 -0.05\n")
    with pytest.raises(CaseError, match=r":2: radius 0\.005 m; accepted are 0\.002 m and 0\.001 m"):
        case.scene(parameters, "published", tmp_path)

"""Case 3: its scene is the published one, and its quantities and references tell right from wrong."""

from pathlib import Path

import numpy as np
import pytest
from records import Record, Seen

from dembench.cases import impact
from dembench.cases.base import CaseError
from dembench.cases.impact_scores import first_contact, free_fall_end
from dembench.cases.initial_states import positions_digest
from dembench.cases.registry import case, parse_case
from dembench.initial.filling import Filling
from dembench.scene import check_scene, features
from dembench.scoring.score import score, verdict

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"
LOWER, UPPER = np.array([-0.049, -0.03, -0.0902431]), np.array([0.049, 0.03, 0.107757])
needs_files = pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published files are not beside the checkout")


def loose_bed(count, radius):
    """Grains on a cubic lattice in the box, from the floor up, 1 % apart, shape (n, 3)."""
    pitch = 2.02 * radius
    nx, ny = (int((UPPER - LOWER)[k] / pitch) for k in (0, 1))
    k = np.arange(count)
    return LOWER + pitch * (0.5 + np.stack([k % nx, k // nx % ny, k // (nx * ny)], axis=1))


def bed_file(folder, count=25000, radius=0.001, name="25KParticles.txt"):
    rows = [f" {radius} {x!r} {y!r} {z!r}" for x, y, z in loose_bed(count, 0.001).tolist()]
    (folder / name).write_text("\r\n".join(["Radius[m] PosX[m] PosY[m] PosZ[m]", *rows, " 0.01 0 0 0.06", "", ""]))
    return folder


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """The folder of a 25k bed that is not the published one."""
    return bed_file(tmp_path_factory.mktemp("beds"))


@pytest.fixture
def quick(monkeypatch):
    """The quick scene on a bed that takes no time to make."""
    monkeypatch.setattr(impact, "bed", lambda name, plan, progress, seed: loose_bed(plan.count, plan.species[0].radius))
    found, parameters = parse_case("case3")
    return found.scene(parameters, "quick")


def record(scene, depth, until=None):
    """A result whose ball is at the displacement depth(t) [m] below its start."""
    until = until or scene.duration
    time, fine = np.arange(0, until + 1e-9, 1e-3), np.arange(0, until + 1e-9, 5e-5)
    z = depth(time)
    velocity = np.zeros((len(time), 3))
    velocity[:, 2] = np.gradient(depth(fine), fine)[np.round(time / 5e-5).astype(int)]
    lowest = [depth(fine[(fine > t - 1e-3 + 1e-9) & (fine < t + 1e-9)]).min() if t else 0.0 for t in time]
    energy = np.zeros((len(time), 3))
    energy[:, 0] = 0.377 * np.exp(-time / 0.05)
    return Record(
        {
            "ball_displacement": Seen(time, z),
            "ball_velocity": Seen(time, velocity),
            "ball_minimum": Seen(time, np.array(lowest)),
            "energy": Seen(time, energy),
        }
    )


def like_the_references(time):
    """Free fall, the published descent, deepest point -0.1389 m at 30.4 ms, rebound at 2 m/s."""
    points = [0.0, 0.0205, 0.025, 0.027, 0.029, 0.0304, 0.0312, 0.035, 0.05, 0.1]
    depth = [0.0, np.nan, -0.124, -0.130, -0.136, -0.1389, -0.138, -0.1304, -0.105, -0.0174]
    fall = -5 * time - 0.5 * 9.81 * time**2
    depth[1] = -5 * 0.0205 - 0.5 * 9.81 * 0.0205**2
    return np.where(time <= 0.0205, fall, np.interp(time, points, depth))


def like_the_quick_bed(time):
    return np.maximum(-5 * time - 0.5 * 9.81 * time**2, -0.12)


def scored(scene, result, preset="published", text="case3"):
    found, parameters = parse_case(text)
    return {s.quantity.name: s for s in score(found, scene, result, parameters, preset)}


@pytest.fixture
def published_scene(given, monkeypatch):
    """The published scene on a bed that passes for the published one."""
    digest = positions_digest(loose_bed(25000, 0.001))
    numbers = {**impact.published("impact")}
    numbers["beds"] = {**numbers["beds"], "25k": {**numbers["beds"]["25k"], "positions_sha256": digest}}
    monkeypatch.setattr(impact, "published", lambda name: numbers)
    found, parameters = parse_case("case3")
    return found.scene(parameters, "published", given)


# ---- the scene


def test_the_published_set_up(published_scene):
    scene = published_scene
    assert len(scene.bodies) == 25001
    assert scene.closed_step() == pytest.approx(5e-7, rel=1e-9)
    assert scene.duration == 0.1 and scene.gravity == (0, 0, -9.81)
    (box,) = scene.walls
    assert (box.lower, box.upper, box.open_faces) == (tuple(LOWER), tuple(UPPER), ("z+",))
    np.testing.assert_array_equal(scene.bodies.position[-1], [0, 0, 0.06])
    np.testing.assert_array_equal(scene.bodies.velocity[-1], [0, 0, -5])
    assert not scene.bodies.velocity[:-1].any()
    assert set(scene.radii()[:-1]) == {0.001} and scene.radii()[-1] == 0.01
    assert scene.masses()[-1] == pytest.approx(7200 * 4 / 3 * np.pi * 1e-6)
    law = scene.pair_law("M1", "M1")
    assert (law.restitution, law.friction) == (0.5, 0.3)
    assert (scene.pair_law("steel", "M1").restitution, scene.pair_law("steel", "steel").friction) == (0.4, 0.5)
    assert scene.material("M1").young == 1e9 and scene.material("steel").young == 210e9
    assert len(scene.frame_times()) == 101 and len(scene.track_times()) == 2001
    assert set(features(scene).names()) == {
        *("friction", "tangential_history", "rotation", "polydisperse", "pair_table", "walls", "gravity")
    }
    check_scene(scene)


@needs_files
@pytest.mark.parametrize("bed,count", [("25k", 25000), ("50k", 50000)])
def test_the_published_files_make_the_published_scene(bed, count):
    found, parameters = parse_case(f"case3[bed={bed}]")
    scene = found.scene(parameters, "published", PUBLISHED)
    assert len(scene.bodies) == count + 1
    assert scene.name == f"case3_{bed}_published"
    check_scene(scene)


@needs_files
def test_first_contact_in_the_published_bed():
    """Found independently: 0.02102 s, displacement -0.10725 m."""
    found, parameters = parse_case("case3")
    scene = found.scene(parameters, "published", PUBLISHED)
    assert first_contact(scene) == pytest.approx(0.02102, abs=5e-6)
    assert free_fall_end(scene) == pytest.approx(0.018)


def test_seeds_displace_a_given_bed_by_the_jitter_and_seed_zero_leaves_it(given):
    found, parameters = parse_case("case3[jitter=2e-6]")
    scenes = [found.scene(parameters, "published", given, seed) for seed in (0, 1, 1, 2)]
    np.testing.assert_allclose(scenes[0].bodies.position[:-1], loose_bed(25000, 0.001), atol=0)
    moved = np.abs(scenes[1].bodies.position - scenes[0].bodies.position)
    assert 1.9e-6 < moved.max() <= 2e-6 * (1 + 1e-6) and not moved[-1].any()
    assert scenes[1].digest() == scenes[2].digest() != scenes[3].digest()


def test_the_quick_set_up(quick):
    assert len(quick.bodies) == 3126
    volume = 4 / 3 * np.pi * np.sum(quick.radii()[:-1] ** 3)
    assert volume == pytest.approx(25000 * 4 / 3 * np.pi * 1e-9)
    assert quick.closed_step() <= 0.1 * quick.rayleigh_time() * (1 + 1e-9)
    assert quick.walls[0].lower == tuple(LOWER)
    assert quick.pair_law("M1", "M1").friction == 0.3
    check_scene(quick)


def test_the_bed_is_made_with_the_seed_and_the_published_targets(monkeypatch):
    asked = []

    def bed(plan: Filling, seed, progress, start):
        asked.append((plan, seed))
        return loose_bed(plan.count, plan.species[0].radius)

    monkeypatch.setattr("dembench.cases.initial_states.filled", bed)
    found, parameters = parse_case("case3[bed=25k]")
    scene = found.scene(parameters, "published", seed=7)
    plan, seed = asked[0]
    assert (plan.count, plan.radii().max(), plan.height, plan.bulk_fraction, seed) == (25000, 0.001, 0.0320, 0.581, 7)
    assert scene.name == "case3_25k_generated"


def test_the_100k_bed_is_the_given_50k_bed_twice_where_it_is_not_given_itself(tmp_path, monkeypatch):
    started = []

    def settled(plan, seed, progress, start):
        started.append(start)
        return start

    monkeypatch.setattr("dembench.cases.initial_states.filled", settled)
    found, parameters = parse_case("case3[bed=100k]")
    with pytest.raises(CaseError, match="no file of the impact 100k"):
        found.scene(parameters, "published", tmp_path)
    bed_file(tmp_path, 50000, name="50KParticles.txt")
    scene = found.scene(parameters, "published", tmp_path)
    assert scene.name == "case3_100k_stacked" and started[0].shape == (100000, 3)
    np.testing.assert_array_equal(scene.bodies.position[:50000], loose_bed(50000, 0.001))
    assert scene.bodies.position[50000:-1, 2].min() >= loose_bed(50000, 0.001)[:, 2].max()
    moved = found.scene(parameters, "published", tmp_path, seed=1)
    assert 0 < np.abs(moved.bodies.position - scene.bodies.position).max() <= parameters.jitter


@pytest.mark.parametrize("text", ["case3[bed=25k]", "case3[bed=50k]", "case3[jitter=1e-5]"])
def test_published_parameters_do_not_go_with_the_quick_preset(text):
    found, parameters = parse_case(text)
    with pytest.raises(CaseError, match="needs the preset published"):
        found.scene(parameters, "quick")


def test_an_initial_state_does_not_go_with_the_quick_preset(given):
    with pytest.raises(CaseError, match="an initial state needs the preset published"):
        case("case3").check(case("case3").parameters(), "quick", given)


def test_an_unknown_preset():
    with pytest.raises(CaseError, match="accepted are quick, published"):
        case("case3").check(case("case3").parameters(), "fast")


def test_a_bed_of_another_size_or_radius(given, tmp_path):
    found, parameters = parse_case("case3[bed=50k]")
    with pytest.raises(CaseError, match=r"25KParticles\.txt: 25000 grains; case3\[bed=50k\] has 50000"):
        found.scene(parameters, "published", given / "25KParticles.txt")
    with pytest.raises(CaseError, match="no file of the impact 50k there"):
        found.scene(parameters, "published", given)
    with pytest.raises(CaseError, match=r":2: radius 0\.0011 m; accepted are 0\.001 m"):
        found.scene(parse_case("case3")[1], "published", bed_file(tmp_path, radius=0.0011))


# ---- quantities and references


def test_a_run_like_the_published_ones_is_ok(published_scene):
    scores = scored(published_scene, record(published_scene, like_the_references))
    assert {name: s.within for name, s in scores.items() if s.reference} == dict.fromkeys(
        [
            "deepest_time",
            "deepest",
            "deepest_between",
            "descent_25ms",
            "descent_27ms",
            "end_point",
            "free_fall",
            "floor_clearance",
            "speed_35ms",
            "energy_excess",
        ],
        True,
    )
    assert verdict(scores.values()) == "ok"
    assert scores["deepest_between"].quantity.value == pytest.approx(-0.1389, abs=1e-5)
    assert scores["deepest"].quantity.value > scores["deepest_between"].quantity.value + 1e-4
    assert scores["speed_35ms"].quantity.value == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(
    "depth,wrong",
    [
        (lambda t: like_the_references(t) * 1.02, {"free_fall", "deepest", "floor_clearance"}),
        (lambda t: np.where(t > 0.0304, -0.1389, like_the_references(t)), {"speed_35ms", "end_point"}),
        (lambda t: np.maximum(like_the_references(t), -0.127), {"deepest", "descent_27ms"}),
        (lambda t: -5 * t - 0.5 * 9.81 * t**2, {"floor_clearance", "descent_25ms"}),
        (lambda t: -5 * t - 0.5 * 9.80 * 1.2 * t**2, {"free_fall"}),
    ],
    ids=["too deep", "no rebound", "too shallow", "through the floor", "wrong gravity"],
)
def test_a_wrong_run_is_inaccurate(published_scene, depth, wrong):
    scores = scored(published_scene, record(published_scene, depth))
    assert wrong <= {name for name, s in scores.items() if s.within is False}
    assert verdict(scores.values()) == "inaccurate"


def test_a_gain_of_energy_is_inaccurate(quick):
    result = record(quick, like_the_quick_bed)
    result.observables["energy"].value[30] = [0.3, 0.1, 0.0]
    scores = scored(quick, result, "quick")
    assert scores["energy_excess"].quantity.value == pytest.approx(0.023)
    assert scores["energy_excess"].within is False


def test_a_rebound_on_springs_is_no_rise_of_the_energy(quick):
    """Springs take 50 mJ in 10 ms and give 45 of them back in 5 ms; then 3 mJ come from nowhere."""
    result = record(quick, like_the_quick_bed)
    time = result.observables["energy"].time
    stored = np.interp(time, [0, 0.020, 0.030, 0.035, 0.1], [0, 0, 0.05, 0.005, 0.005])
    result.observables["springs"] = Seen(time, stored)
    result.observables["energy"].value[:, 0] = 0.4 - stored
    assert scored(quick, result, "quick")["energy_rise"].quantity.value == pytest.approx(0, abs=1e-12)
    result.observables["energy"].value[33:, 0] += 0.003
    assert scored(quick, result, "quick")["energy_rise"].quantity.value == pytest.approx(0.003)


def test_what_can_be_zero_has_a_margin_of_its_own(quick):
    """The ball has 0.377 J and 0.14 m to the floor. Energy that appears is for the worse, a wider gap is a change."""
    found = {q.name: q for q in case("case3").quantities(quick, record(quick, like_the_quick_bed))}
    assert (
        found["energy_excess"].margin == pytest.approx(3.77e-6, rel=1e-3) and found["energy_excess"].worse == "higher"
    )
    assert found["floor_clearance"].margin == pytest.approx(1.402e-3, rel=1e-3)
    assert found["floor_clearance"].worse == "either" and found["descent_25ms"].margin is None


def test_a_bed_of_ones_own_is_compared_with_the_ensemble(given):
    found, parameters = parse_case("case3")
    scene = found.scene(parameters, "published", given)
    references = {r.quantity: r for r in found.references(scene, parameters, "published")}
    assert scene.name == "case3_25k_given"
    assert references["end_point"].value == -0.0492
    assert "speed_35ms" not in references and "descent_25ms" not in references
    assert references["deepest"].value == pytest.approx(-0.13844, abs=1e-5)
    assert references["deepest"].low < -0.1386 and references["deepest"].high > -0.1384


def test_the_quick_bed_has_ensembles_of_its_own(quick):
    """A path through their means is ok; one that stops at a depth before 25 ms is not, and only they see it."""
    means = {r.quantity: r.value for r in references_of_quick(quick)}

    def like_the_ensembles(time):
        depths = [fall(0.02), means["descent_25ms"], means["descent_27ms"], means["deepest"]]
        path = np.interp(time, [0.02, 0.025, 0.027, 0.034], depths)
        return np.where(time < 0.02, fall(time), path)

    def fall(time):
        return -5 * time - 0.5 * 9.81 * np.asarray(time) ** 2

    scores = scored(quick, record(quick, like_the_ensembles), "quick")
    necessary = {"free_fall", "floor_clearance", "energy_excess"}
    ensembles = {"descent_25ms", "descent_27ms", "deepest"}
    assert {name for name, s in scores.items() if s.within} == necessary | ensembles
    assert verdict(scores.values()) == "ok"
    stopped = scored(quick, record(quick, like_the_quick_bed), "quick")
    assert {name for name, s in stopped.items() if s.within is False} <= ensembles
    assert verdict(stopped.values()) == "inaccurate"


def references_of_quick(scene):
    found, parameters = parse_case("case3")
    return found.references(scene, parameters, "quick")


def test_changed_contacts_have_no_ensembles(quick):
    found, parameters = parse_case("case3[friction=0.1]")
    known = {r.quantity for r in found.references(quick, parameters, "quick")}
    assert known == {"free_fall", "floor_clearance", "energy_excess"}


def test_a_run_that_was_cut_has_no_end_point(published_scene):
    scene = published_scene.cut(0.04)
    scores = scored(scene, record(scene, like_the_references))
    assert "deepest" in scores and "speed_35ms" in scores
    assert scores["end_point"].reference is None
    early = scored(published_scene, record(published_scene, like_the_references, until=0.026))
    assert not {"deepest", "deepest_time", "deepest_between", "speed_35ms", "end_point", "descent_27ms"} & set(early)
    assert early["descent_25ms"].within
    short = published_scene.cut(0.01)
    assert "deepest" not in scored(short, record(short, like_the_references))


def test_an_empty_record_has_no_quantities(quick):
    assert case("case3").quantities(quick, Record({})) == []
    empty = Seen(np.empty(0), np.empty(0))
    result = Record({"ball_displacement": empty, "ball_velocity": Seen(np.empty(0), np.empty((0, 3)))})
    assert case("case3").quantities(quick, result) == []


def test_every_reference_names_its_source_and_a_known_quantity(published_scene):
    found, parameters = parse_case("case3")
    known = {q.name for q in found.quantities(published_scene, record(published_scene, like_the_references))}
    for reference in found.references(published_scene, parameters, "published"):
        assert reference.source and reference.quantity in known
        if reference.value is not None and reference.low is not None:
            assert reference.low <= reference.value <= reference.high


def test_curves_for_figures(published_scene, quick):
    found, parameters = parse_case("case3")
    labels = {c.label: c for c in found.reference_curves(published_scene, parameters, "published")}
    np.testing.assert_allclose(labels["reference codes, published file"].value, [-0.124, -0.130, -0.136])
    fall = labels["free fall"]
    np.testing.assert_allclose(fall.value, -5 * fall.time - 4.905 * fall.time**2)
    assert fall.time[-1] == pytest.approx(first_contact(published_scene))
    assert labels["published end point"].time == pytest.approx(0.1)
    assert [c.label for c in found.reference_curves(quick, parameters, "quick")] == ["free fall"]

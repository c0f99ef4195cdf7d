"""Case 1: its scene is the published silo, and its quantities and references tell right from wrong."""

from pathlib import Path

import numpy as np
import pytest
from records import Record, Seen

from dembench.cases import silo
from dembench.cases.base import CaseError, Reference
from dembench.cases.registry import parse_case
from dembench.cases.silo_scores import beverloo_rate
from dembench.initial.filling import PackingError
from dembench.scene import Mesh, Region, Scene, check_scene
from dembench.scoring.score import score, verdict

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"
needs_files = pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published files are not beside the checkout")


def column(count, radius, lip):
    """Grains on a cubic lattice in the barrel, above the cone, 5 % apart, shape (n, 3)."""
    pitch = 2.1 * radius
    k = np.arange(-40, 41)
    x, y = (a.ravel() * pitch for a in np.meshgrid(k, k))
    inside = np.hypot(x, y) < 0.1 - 1.1 * radius
    x, y = x[inside], y[inside]
    layers = -(-count // len(x))
    z = lip + 0.08 + radius + pitch * np.repeat(np.arange(layers), len(x))
    return np.stack([np.tile(x, layers), np.tile(y, layers), z], axis=1)[:count]


@pytest.fixture
def unsettled(monkeypatch):
    """Fillings that take no time: a lattice above the cone."""

    def made(name, plan, progress, seed=0):
        outlet = next(w for w in plan.walls if w.name == "outlet")
        return column(plan.count, plan.species[0].radius, outlet.point[2])

    monkeypatch.setattr(silo, "bed", made)


def scene_of(text, preset, **given) -> Scene:
    case, parameters = parse_case(text)
    return case.scene(parameters, preset, **given)


def draining(scene, rate, onset=0.0, until=None):
    """A result whose count falls by `rate` [1/s] from the onset [s] on."""
    time = np.arange(0, (until or scene.duration) + 1e-9, 0.1)
    total = len(scene.bodies)
    count = np.clip(total - rate * np.clip(time - onset, 0, None), 0, total).round()
    return Record({"inside": Seen(time, count), "overlap": Seen(time, np.full(len(time), 1e-6))})


@pytest.mark.parametrize(
    ("orifice", "radius", "lip", "edge"),
    [("large", 0.03, -0.0554222, 0.0145778), ("small", 0.02, -0.0593008, 0.0206992)],
)
def test_the_walls_are_those_of_the_publication(unsettled, orifice, radius, lip, edge):
    scene = scene_of(f"case1[orifice={orifice}]", "published")
    barrel, cone = scene.walls
    assert (barrel.start[2], barrel.radius) == (pytest.approx(edge), 0.1)
    assert barrel.end[2] == pytest.approx(edge + 0.3)
    assert (cone.start[2], cone.radius_start) == (lip, radius)
    # the cone has a slope of 45 degrees
    assert cone.radius_end - cone.radius_start == pytest.approx(cone.end[2] - cone.start[2])
    assert len(scene.bodies) == 100_000
    assert scene.observables[0].region == Region(lower=(None, None, lip))
    assert scene.sinks[0].region.upper[2] == pytest.approx(lip - 0.02)


@needs_files
@pytest.mark.parametrize("orifice", ["large", "small"])
def test_exact_walls_lie_in_the_published_triangles(unsettled, orifice):
    """The published mantle is a polygon of 100 sides, 5e-5 m inside the round one."""
    scene = scene_of(f"case1[orifice={orifice},walls=mesh]", "published", initial=PUBLISHED)
    (mesh,) = scene.walls
    assert isinstance(mesh, Mesh)
    exact = silo.exact_walls(orifice)
    vertices = mesh.triangles.reshape(-1, 3)
    away = np.min([np.abs(wall.signed_distance(vertices)) for wall in exact], axis=0)
    inner = np.hypot(vertices[:, 0], vertices[:, 1]) < 0.1005
    assert np.count_nonzero(away < 6e-5) >= 300
    assert away[inner & (vertices[:, 2] > exact[1].start[2] + 0.001)].min() < 1e-6


def test_a_given_fill_is_not_called_published(tmp_path):
    """Nothing tells the published fill from another one with as many grains."""
    fill = column(100_000, 0.002, -0.0554222)
    np.savetxt(tmp_path / "PartCoordinates M1 (large orifice).txt", fill, fmt="%.6f")
    scene = scene_of("case1", "published", initial=tmp_path)
    assert scene.name == "case1_large_M1_given"
    np.testing.assert_allclose(scene.bodies.position, fill, rtol=0, atol=5.1e-7)


def against_the_walls(name, plan, progress, seed=0):
    """Rings of grains that touch barrel and cone and not one another, shape (n, 3)."""
    barrel, cone, _ = plan.walls
    radius, lip, edge = plan.species[0].radius, cone.start[2], cone.end[2]
    z = np.append(np.arange(lip + 0.003, edge - 0.003, 0.0043), np.arange(edge + 0.003, edge + 0.03, 0.0043))
    away = np.where(z < edge, cone.radius_start + z - lip - np.sqrt(2) * radius, barrel.radius - radius)
    rings = []
    for height, r in zip(z, away, strict=True):
        angle = np.arange(0, 2 * np.pi - 2.05 * radius / r, 2.05 * radius / r)
        rings.append(np.stack([r * np.cos(angle), r * np.sin(angle), np.full(len(angle), height)], axis=1))
    return np.vstack(rings)


@needs_files
@pytest.mark.parametrize("orifice", ["large", "small"])
def test_a_fill_for_the_published_triangles_fits_between_them(monkeypatch, orifice):
    """The data set beside the checkout lacks the grains of the silo, so that they are filled in."""
    monkeypatch.setattr(silo, "bed", against_the_walls)
    check_scene(scene_of(f"case1[orifice={orifice},walls=mesh]", "published", initial=PUBLISHED))


def test_materials_time_steps_and_softening(unsettled):
    m1, m2 = (scene_of(f"case1[material={m}]", "published") for m in ("M1", "M2"))
    assert (m1.time_step, m2.time_step) == (1.5e-6, 2e-6)
    assert (m1.material("M1").young, m2.material("M2").young, m2.material("M2").density) == (1e9, 0.5e9, 2000)
    assert (m2.pair_law("M2", "M2").restitution, m2.pair_law("M2", "M2").friction) == (0.4, 0.4)
    case, parameters = parse_case("case1")
    quick = case.scene(parameters, "quick")
    assert quick.material("M1").young == pytest.approx(1e7)
    assert quick.material("steel").young == pytest.approx(2.1e9)
    assert "1e7" in case.softening(parameters, "quick")
    assert case.softening(parameters, "published") == ""
    # the small orifice is at least six diameters of the coarse grains wide
    assert 0.04 / (2 * quick.radii()[0]) >= 6


def test_seeds_move_the_grains_by_at_most_the_jitter(unsettled):
    case, parameters = parse_case("case1[jitter=2e-6]")
    first, again, other = (case.scene(parameters, "quick", seed=s).bodies.position for s in (0, 0, 3))
    assert np.array_equal(first, again)
    assert 1e-6 < np.abs(other - first).max() <= 2e-6


def test_changed_contacts_change_the_laws_and_lose_the_published_references(unsettled):
    case, parameters = parse_case("case1[friction=0.7,wall_friction=0.1,restitution=0.8]")
    scene = case.scene(parameters, "published")
    assert (scene.pair_law("M1", "M1").friction, scene.pair_law("M1", "steel").friction) == (0.7, 0.1)
    assert {p.restitution for p in scene.pair_laws} == {0.8}
    assert {r.quantity for r in case.references(scene, parameters, "published")} == {"overlap", "beverloo_ratio"}
    assert not any("guide" in c.label for c in case.reference_curves(scene, parameters, "published"))
    case, parameters = parse_case("case1[pairs=global]")
    laws = case.scene(parameters, "published").pair_laws
    assert {(p.restitution, p.friction) for p in laws} == {(0.5, 0.3)}


@pytest.mark.parametrize(("orifice", "diameters"), [("large", 9.375), ("small", 6.25)])
@pytest.mark.parametrize("material", ["M1", "M2"])
def test_each_quick_silo_has_a_rate_of_its_own(orifice: str, material: str, diameters: float) -> None:
    """Each band is narrower than an eighth of the rate, and the orifices differ by about the power 5/2."""

    def rate(text: str) -> Reference:
        case, parameters = parse_case(text)
        scene = case.scene(parameters, "quick")
        (found,) = [r for r in case.references(scene, parameters, "quick") if r.quantity == "discharge_rate"]
        return found

    own = rate(f"case1[orifice={orifice},material={material}]")
    assert own.low is not None and own.high is not None
    assert own.low < own.value < own.high < own.low + own.value / 8
    # Beverloo's law with the usual k = 1.4 (Beverloo, Leniger, van de Velde 1961)
    other = rate(f"case1[orifice=large,material={material}]")
    assert own.value / other.value == pytest.approx(((diameters - 1.4) / (9.375 - 1.4)) ** 2.5, rel=0.15)


@pytest.mark.parametrize(
    ("rate", "expected"), [(23200, "ok"), (24300, "ok"), (24500, "inaccurate"), (19442, "inaccurate")]
)
def test_the_rate_decides(unsettled, rate, expected):
    case, parameters = parse_case("case1")
    scene = case.scene(parameters, "published")
    scores = score(case, scene, draining(scene, rate, 0.02), parameters, "published")
    found = {s.quantity.name: s.quantity.value for s in scores}
    assert found["discharge_rate"] == pytest.approx(rate, rel=1e-3)
    assert found["onset"] == pytest.approx(0.02, abs=2e-3)
    assert abs(found["rate_change"]) < 1e-3
    if (emptied := 0.02 + 98_000 / rate) < scene.duration:
        assert found["emptying_time"] == pytest.approx(emptied, abs=1e-3)
    assert verdict(scores) == expected


def test_the_change_of_the_rate_is_that_of_the_record(unsettled):
    case, parameters = parse_case("case1")
    scene = case.scene(parameters, "published")
    result = draining(scene, 20_000)
    time = result.observables["inside"].time
    count = 100_000 - 20_000 * time + 0.5 * 400 * time**2
    result.observables["inside"] = Seen(time, count)
    found = {q.name: q.value for q in case.quantities(scene, result)}
    mean = 20_000 - 400 * 2
    assert found["rate_change"] == pytest.approx(-400 / mean, rel=1e-6)


def test_a_record_that_ends_early_has_no_rate(unsettled):
    case, parameters = parse_case("case1")
    scene = case.scene(parameters, "published")
    names = {q.name for q in case.quantities(scene, draining(scene, 20_000, until=1.0))}
    assert "discharge_rate" not in names
    assert "emptying_time" not in names


def test_what_can_be_zero_has_a_margin_of_its_own(unsettled):
    """1 % of a rate that is fitted between 0.3 and 1.7 s: over 1.4 s, and 1 s from the onset."""
    scene = scene_of("case1", "quick")
    case, _ = parse_case("case1")
    found = {q.name: q.margin for q in case.quantities(scene, draining(scene, 5000.0))}
    assert found["rate_change"] == pytest.approx(0.01 / 1.4) and found["onset"] == pytest.approx(0.01)
    assert found["left"] == pytest.approx(240) and found["discharge_rate"] is None


def test_beverloo_by_hand(unsettled):
    """Large orifice, 4 mm grains: 0.58 * 1500 kg/m3 * sqrt(9.81) * (0.06 - 1.4 * 0.004)^2.5 over 8.378e-5 kg."""
    scene = scene_of("case1", "published")
    assert beverloo_rate(scene) == pytest.approx(0.58 * 1500 * 9.81**0.5 * 0.0544**2.5 / 8.3776e-5, rel=1e-4)


def test_the_load_on_the_walls_is_a_share_of_the_weight(unsettled):
    case, parameters = parse_case("case1")
    scene = case.scene(parameters, "published")
    result = draining(scene, 20_000)
    seen = result.observables["inside"]
    weight = scene.masses()[0] * 9.81 * seen.value
    force = np.zeros((len(seen.time), 3))
    force[:, 2] = -0.25 * weight
    result.observables |= {"barrel_force": Seen(seen.time, force), "cone_force": Seen(seen.time, 2 * force)}
    found = {q.name: q.value for q in case.quantities(scene, result)}
    assert found["wall_load"] == pytest.approx(0.75)


def test_a_scene_that_ends_before_the_snapshot_shows_what_is_recorded():
    case, parameters = parse_case("case1")
    whole = case.scene(parameters, "quick")
    cut = whole.cut(0.1)
    assert [f.name for f in case.figures(whole)] == ["discharge", "wall-force", "velocities", "profile"]
    assert [f.name for f in case.figures(cut)] == ["discharge", "wall-force"]
    assert case.pictures(whole) and not case.pictures(cut)


@pytest.mark.parametrize("value", ["0", "2"])
def test_a_restitution_outside_its_range_is_refused(value):
    with pytest.raises(CaseError, match=rf"case1\[restitution\]: .*given: '{value}'"):
        parse_case(f"case1[restitution={value}]")


def test_what_does_not_fit_is_refused(unsettled, tmp_path, monkeypatch):
    with pytest.raises(CaseError, match=r"case1\[walls=mesh\] needs the published triangles"):
        scene_of("case1[walls=mesh]", "published")
    with pytest.raises(CaseError, match="the quick preset has an initial state of its own; leave it out"):
        scene_of("case1", "quick", initial=tmp_path)
    with pytest.raises(CaseError, match="no file of the large silo walls"):
        scene_of("case1[walls=mesh]", "quick", initial=tmp_path)
    with pytest.raises(
        CaseError, match=r"no file of the silo large M1 there.*without --initial generates the initial state"
    ):
        scene_of("case1", "published", initial=tmp_path)
    (tmp_path / "PartCoordinates M1 (large orifice).txt").write_text("0 0 0.1\n0 0 0.11\n")
    with pytest.raises(CaseError, match="2 grains; case1 has 100000"):
        scene_of("case1", "published", initial=tmp_path)
    (tmp_path / "silo_walls_large.txt").write_text("rubbish\n")
    with pytest.raises(CaseError, match="expected the header"):
        scene_of("case1[walls=mesh]", "quick", initial=tmp_path)
    monkeypatch.undo()
    monkeypatch.setattr("dembench.cases.initial_states.filled", _no_packing)
    with pytest.raises(CaseError, match=r"do not rest.*another seed"):
        scene_of("case1[orifice=small]", "published")


def _no_packing(plan, seed, progress, start):
    raise PackingError("100000 particles do not rest after 1 s")

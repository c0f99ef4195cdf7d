"""Sweeps: problems with closed forms, values of knobs, the order of runs, errors of points."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dembench.engines.registry import engine
from dembench.runs.plan import EngineChoice, RequestError
from dembench.scoring.ensembles import Ensemble
from dembench.verification.precision import bulk, knobs, paths, planning, problems
from dembench.verification.precision.knobs import Value
from dembench.verification.precision.levels import BAND, cheapest_settings
from dembench.verification.precision.store import Error, Loop, Measure, Point, Problem, Sweep

# ---- problems


def test_a_collision_without_damping_is_that_of_hertz():
    """Contact time 2.943 d/v with d = (15 m* v^2/(16 E* sqrt R*))^(2/5); with damping the pair law's restitution.

    The damped one is integrated to 1e-10 and ends where the overlap does, as D. Antypov & J. A. Elliott 2011 have it.
    """
    mass = 0.5 * 2500 * 4 / 3 * math.pi * 5e-3**3
    deepest = (15 * mass * 4 / (16 * 1e8 / (2 * 0.91) * math.sqrt(2.5e-3))) ** 0.4
    assert problems.collision(1.0).duration == pytest.approx(2.9433 * deepest / 2, rel=1e-4)
    assert problems.collision(0.5).restitution == pytest.approx(0.5, abs=1e-8)
    assert problems.collision(0.5).duration > problems.collision(1.0).duration


def test_restitution_and_contact_time_are_read_off_the_end():
    """Pairs that fly apart after a contact of 0.4 ms at 0.8 of the speed give just that."""
    scene = problems.bounce(1.0, "hertz_bounce")
    speed, contact = 0.8 * problems.SPEED, 4e-4
    apart = speed * (scene.duration - problems.gaps() / problems.SPEED - contact)
    x = np.stack([-0.5, 0.5]) * (2 * problems.RADIUS + apart)[:, None]
    v = np.tile([-0.5 * speed, 0.5 * speed], (problems.PAIRS, 1))
    end = SimpleNamespace(position=np.zeros((1, 512, 3)), velocity=np.zeros((1, 512, 3)))
    end.position[0, :, 0], end.velocity[0, :, 0] = x.ravel(), v.ravel()
    restitution, duration = problems.rebounds(SimpleNamespace(scene=scene, snapshots={"end": end}))  # type: ignore[arg-type]
    np.testing.assert_allclose(restitution, 0.8)
    np.testing.assert_allclose(duration, contact, rtol=1e-9)


def test_all_pairs_touch_and_part_before_the_end():
    """The last pair touches late enough to meet another phase of the steps, and early enough to part."""
    scene, last = problems.bounce(0.5, "damped_bounce"), problems.gaps().max() / problems.SPEED
    assert last + problems.collision(0.5).duration < 0.8 * scene.duration
    assert np.ptp(problems.gaps()) > 0.4 * problems.SPEED * problems.collision(1.0).duration


def test_a_ball_that_slides_rolls_at_five_sevenths_of_its_speed():
    """The lever of a soft ball is R - overlap/2, with an overlap of 0.2 % of R: 5/7 less 2/7 of that, and the way.

    The way is that of the integrated motion: friction until the slip v - w l has gone.
    """
    speed, way = problems.rolled()
    assert speed / problems.SPEEDS == pytest.approx(5 / 7 * (1 - 2 / 7 * problems.SUNK / problems.RADIUS), rel=1e-5)
    lever, dt = problems.RADIUS - 0.5 * problems.SUNK, 1e-6
    x = v = w = 0.0
    v = float(problems.SPEEDS[0])
    for _ in range(round(problems.SLIDING / dt)):
        pull = problems.FRICTION * problems.GRAVITY if v > w * lever else 0.0
        v, w = v - pull * dt, w + pull * lever / (0.4 * problems.RADIUS**2) * dt
        x += v * dt
    assert (way[0], speed[0]) == pytest.approx((x, v), rel=1e-4)


# ---- knobs and runs


def test_each_kind_of_setting_has_its_values():
    """Factors of a step, powers of two, words, and a single point where an engine has no such setting."""
    both = [EngineChoice("peclet"), EngineChoice("peclet-hertz")]
    steps = knobs.values("dt", both, 3, span=(4, 0.25))
    assert [v.factor for v in steps[0]] == pytest.approx([4, 1, 0.25])
    sweeps = knobs.values("velocity_sweeps", both, 4)
    assert [v.text for v in sweeps[0]] == ["1", "2", "4", "8"]
    assert [v.text for v in sweeps[1]] == [""]
    assert [v.text for v in knobs.values("substeps", both, 2)[0]] == ["1", "2"]
    assert [v.text for v in knobs.values("arithmetic", both, 9)[1]] == ["float32", "float64"]
    assert [v.text for v in knobs.values("softening", both, 9)[1]] == ["false", "true"]
    assert [v.text for v in knobs.values("substeps", both, 9, ["3", "9"])[0]] == ["3", "9"]


@pytest.mark.parametrize(
    ("knob", "overrides", "typed", "message"),
    [
        ("dtt", {}, [], "Did you mean 'dt'"),
        ("dt", {"dt": "1e-6"}, [], "the sweep sets dt itself"),
        ("dt", {}, ["a"], "no factors"),
        ("dt", {}, ["-1"], "above 0"),
    ],
)
def test_a_knob_that_cannot_be_turned_is_refused(knob, overrides, typed, message):
    """The message names the field, the value and what would be accepted."""
    with pytest.raises(RequestError, match=message):
        knobs.values(knob, [EngineChoice("peclet-hertz", overrides)], 3, typed)


def test_a_factor_is_one_of_the_scenes_step_and_an_engines_own_step_is_a_point():
    """Half a closed step is that of all engines; the impulse solver's own, a whole flight, comes beside the series."""
    scene = problems.bounce(1.0, "hertz_bounce")
    for name in ("peclet", "peclet-hertz"):
        choice = knobs.chosen(EngineChoice(name), "dt", Value("0.5", 0, 0.5), scene, {"midpoint": "true"})
        assert float(choice.overrides["dt"]) == pytest.approx(0.5 * scene.closed_step(), rel=1e-6)
        assert ("midpoint" in choice.given) == (name == "peclet-hertz")
    series = knobs.values("dt", [EngineChoice("peclet")], 2, span=(2, 0.5))[0]
    factors = [v.factor for v in knobs.with_own_step(series, EngineChoice("peclet"), scene, {})]
    own = engine("peclet").settings(scene, "closed").dt / scene.closed_step()
    assert factors == pytest.approx([own, 2, 0.5])
    assert len(knobs.with_own_step(series, EngineChoice("peclet-hertz"), scene, {})) == 2


def test_the_ends_of_the_range_come_first_then_its_middle():
    """Of nine values: 0 and 8, then 4, then 2 and 6, then the rest."""
    assert [planning._turn(rank, 8) for rank in range(9)] == [0, 3, 2, 3, 1, 3, 2, 3, 0]
    assert planning._turn(0, 0) == 0


# ---- errors of paths and ensembles


def group(variant: str, rank: int) -> Any:
    """A stand-in for the runs of a point."""
    name, value = variant.partition("[")[0], SimpleNamespace(rank=rank)
    return SimpleNamespace(variant=variant, value=value, choice=SimpleNamespace(engine=name), shifted=[])


def line(offset: float) -> paths.Paths:
    """A body that flies 10 mm along x, off by so many diameters throughout."""
    time = np.linspace(0, 1, 11)
    position = np.zeros((11, 1, 3))
    position[:, 0, 0] = 0.01 * time + 2e-3 * offset
    return paths.Paths(time, position, np.array([2e-3]))


def test_the_own_limit_and_the_law_are_two_errors_of_a_path(monkeypatch):
    """An engine that converges to a path of its own, 0.1 d off: the own error falls, the total one stays."""
    seen = {("a", 0): 0.30, ("a", 1): 0.1005, ("a", 2): 0.1, ("b", 0): 0.01, ("b", 1): 0.0, ("a[x=1]", 0): 0.5}
    made = {key: group(*key) for key in seen}
    monkeypatch.setattr(paths, "_paths", lambda g: line(seen[g.variant, g.value.rank]))
    known = paths.limits(list(made.values()))
    assert known.horizon == math.inf
    assert known.converged == {"a": True, "b": False, "a[x=1]": None}
    found = dict(zip(seen, paths.errors(list(made.values()), known, ["a", "b"]), strict=True))
    assert (found["a", 1][0].total, found["a", 1][0].own) == pytest.approx((0.1005, 0.0005))
    assert found["a", 2][0].own is None, "the limit has no distance to itself"
    assert found["b", 0][0].band == pytest.approx(0.0005), "what its reference still moves"
    assert found["a", 2][0].band == pytest.approx(0.01)
    assert found["b", 1][0].total == pytest.approx(0.1), "measured against the other engine, not against itself"
    assert found["a[x=1]", 0][0].total == pytest.approx(0.5), "another setting of the same engine is no reference"


class Bounded:
    """A case with one curve and one quantity."""

    def statistics(self) -> Any:
        return SimpleNamespace(curve="n", cycles=False, numbers={"rate": "rate"})


def bulk_sample(mean: float, seeds: int, spread: float = 1.0) -> bulk.Sample:
    """Seeds about a falling curve and about a rate, whose spread is planted."""
    offsets = spread * np.linspace(-1, 1, seeds) if seeds > 1 else np.zeros(1)
    time = np.linspace(0, 1, 21)
    curve = Ensemble([mean * (1 - time) + offset for offset in offsets])
    return bulk.Sample(tuple(range(seeds)), time, curve, {"rate": Ensemble(mean + offsets)})


def test_ensembles_have_a_band_an_own_limit_and_another_engine_as_reference(monkeypatch):
    """Rates of 102 and 100 with a spread of 1 % in five seeds: 2 % off, against a band of 2 s sqrt(2/5) = 1 %."""
    seen = {("a", 0): 110.0, ("a", 1): 102.0, ("b", 0): 100.0}
    made = [group(*key) for key in seen]
    monkeypatch.setattr(bulk, "sample", lambda case, g: bulk_sample(seen[g.variant, g.value.rank], 5))
    samples, known = bulk.limits(Bounded(), made)  # type: ignore[arg-type]
    assert known.converged == {"a": False, "b": None}
    found = dict(zip(seen, bulk.errors(Bounded(), made, samples, known, ["a", "b"]), strict=True))  # type: ignore[arg-type]
    total = {e.measure: e for e in found["a", 1]}
    assert total["rate"].total == pytest.approx(0.02)
    deviation = np.std(np.linspace(-1, 1, 5), ddof=1) / 100
    assert total["rate"].band == pytest.approx(2 * math.sqrt(2 / 5) * deviation)
    assert total["rate"].low is not None and 0 < total["rate"].low < 0.02 < (total["rate"].high or 0)
    assert total["rate"].verdict == "undecided"
    assert total["curve"].band == pytest.approx(2 * math.sqrt(2 / 5))
    coarse = {e.measure: e for e in found["a", 0]}
    assert coarse["rate"].own == pytest.approx(8 / 102)
    assert coarse["rate"].verdict == "different"
    only = bulk.errors(Bounded(), made[:2], samples[:2], known, ["a"])  # type: ignore[arg-type]
    assert all(e.total is None for e in only[0]), "an engine's own fine run is never its only reference"


def test_references_are_pooled_with_the_spread_between_codes():
    """Two codes 10 % apart: the pooled deviation is about that, not the 1 % of the seeds of each."""
    both = bulk.pooled([bulk_sample(95.0, 5), bulk_sample(105.0, 5)])
    assert len(both.seeds) == 10
    assert float(both.numbers["rate"].deviation) == pytest.approx(5.3, abs=0.1)


# ---- the cheapest setting


def swept(points: dict[str, tuple[float, float]], band: float = 0.0, kind: Any = "closed form") -> Sweep:
    """A sweep with one measure of points that are given by value: time and error."""
    made = [
        Point(
            engine="peclet-hertz",
            variant="peclet-hertz",
            label=f"peclet-hertz[dt={k}]",
            value=value,
            rank=k,
            dt=1e-6,
            state="ok",
            loop=Loop(median=time, low=time, high=time, count=1),
            errors=(Error(measure="m", total=error, band=band),),
        )
        for k, (value, (time, error)) in enumerate(points.items())
    ]
    problem = Problem(
        title="Fall", law="hertz-mindlin", features=("gravity",), bodies=3, young=1e7, softness=1e-3, restitution=0.5
    )
    words = {"title": "error", "unit": "relative", "scale": "1", "source": "closed form"}
    return Sweep(
        target="fall",
        kind="ensemble" if kind != "closed form" else "closed form",
        knob="dt",
        problem=problem,
        command="dembench sweep fall",
        made="",
        machine="",
        measures=(Measure(name="m", kind=kind, **words),),
        points=tuple(made),
    )


def test_the_cheapest_setting_is_the_shortest_time_that_reaches_the_level():
    """5 % is reached at 4 steps for 1 s, 1 % at one step for 3 s."""
    found = {
        one.level: one for one in cheapest_settings(swept({"4": (1.0, 0.04), "1": (3.0, 0.008), "2": (4.0, 0.02)}))
    }
    assert (found["5 %"].value, found["1 %"].value) == ("4", "1")
    none = cheapest_settings(swept({"4": (1.0, 0.4)}))
    assert [one.label for one in none] == ["", ""]
    assert none[0].limit == "error"


def test_nothing_below_the_band_of_the_seeds_is_ranked():
    """An error of 0.5 % in a band of 3 % does not count as 1 %: it reaches 5 % and the band."""
    found = {one.level: one for one in cheapest_settings(swept({"1": (2.0, 0.005)}, band=0.03, kind="number"))}
    assert not found["1 %"].label
    assert found["5 %"].label and found[BAND].label


def test_paths_are_compared_up_to_where_a_shifted_run_parts(monkeypatch):
    """A companion that leaves as 1e-12 d exp(30 t) is 1e-2 d away at 0.77 s: what happens later does not count."""
    companion = line(0.0)
    companion.position[:, 0, 1] = 2e-3 * 1e-12 * np.exp(30 * companion.time)
    record = SimpleNamespace(status=SimpleNamespace(state="ok"), result="companion")
    monkeypatch.setattr(paths, "RunRecord", lambda path: record)
    monkeypatch.setattr(paths, "paths", lambda result: companion)
    late = line(0.0)
    late.position[late.time > 0.75, 0, 2] = 1.0
    seen = {"a": line(0.0), "b": late}
    monkeypatch.setattr(paths, "_paths", lambda g: seen[g.variant])
    made = [group("a", 0), group("b", 0)]
    made[0].shifted = [SimpleNamespace(directory=SimpleNamespace(status=lambda: "ok", path="x"))]
    known = paths.limits(made)
    assert known.horizon == pytest.approx(0.8)
    assert paths.errors(made, known, ["a", "b"])[1][0].total == pytest.approx(1 / 2e-3 / math.sqrt(9)), "0.8 s is in"
    late.position[late.time < 0.85, 0, 2] = 0.0
    assert paths.errors(made, known, ["a", "b"])[1][0].total == 0

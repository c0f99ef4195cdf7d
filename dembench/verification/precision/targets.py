"""What a sweep is about: scenes with a closed form, one scene whose paths are followed, or a case over its seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from dembench import campaign, plugins
from dembench.campaign import Request
from dembench.cases import registry as cases
from dembench.cases.base import Case
from dembench.engines.base import Division
from dembench.initial.progress import Progress
from dembench.runs.plan import RequestError, SceneChoice
from dembench.scene import Rigid, Scene, features
from dembench.scene.checks import check_scene
from dembench.verification import suites
from dembench.verification.checks import Check, Experiment, Suite
from dembench.verification.precision import problems
from dembench.verification.precision.store import Problem

Kind = Literal["closed form", "path", "ensemble"]
SHIFTED = 1
"""Seed of the second one of a pair of runs that tells when paths diverge."""


@dataclass(frozen=True)
class Target:
    """What a sweep is about.

    Attributes:
        name: As typed.
        title: One line.
        kind: Kind of its errors.
        scenes: One for each trial of an experiment, or for each seed.
        given: Settings that come with a scene, by its name; what was typed replaces them.
        divisions: Divisions of the scenes that are not of the closed one, by their names.
        experiment: The experiment; None where there is no closed form.
        case, preset: The case; None for others.
    """

    name: str
    title: str
    kind: Kind
    scenes: tuple[SceneChoice, ...]
    given: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    divisions: Mapping[str, Division] = field(default_factory=dict)
    experiment: Experiment | None = None
    case: Case | None = None
    preset: str | None = None

    @property
    def problem_name(self) -> str:
        """The problem in words, with the preset of a case."""
        return cases.problem_title(self.name, self.preset)

    def checks(self) -> list[Check]:
        """Checks with a relative error: exact values, no bounds, on a scale that is fixed."""
        if self.experiment is None:
            return []
        return [check for check in self.experiment.checks if check.sense == "within" and scale_of(check) > 0]

    def problem(self) -> Problem:
        """What kind of problem it is."""
        title = self.title if self.preset is None else f"{self.title} ({self.problem_name})"
        return problem_of(self.scenes[0].scene, title)


def scale_of(check: Check) -> float:
    """What a relative error of one is of a check, in its unit; 0 where none is fixed beforehand."""
    return check.scale if check.scale is not None else abs(check.expected)


def problem_of(scene: Scene, title: str) -> Problem:
    """What kind of problem a scene is."""
    young = max(scene.material(s.material).young for s in scene.species)
    speeds = np.linalg.norm(scene.bodies.velocity, axis=1)
    fall = math.sqrt(2 * math.hypot(*scene.gravity) * 2 * float(scene.radii().max(initial=0)))
    speed = max(float(speeds.max(initial=0.0)), fall)
    density = max(float(scene.densities().max(initial=0.0)), 1e-12)
    rigid = isinstance(scene.law, Rigid)
    return Problem(
        title=title,
        law=scene.law.kind,
        features=tuple(features(scene).names()),
        bodies=len(scene.bodies),
        young=0.0 if rigid else young,
        softness=0.0 if rigid else (density * speed**2 / young) ** 0.4,
        restitution=min((pair.restitution for pair in scene.pair_laws), default=1.0),
    )


def target(text: str, request: Request, progress: Progress) -> Target:
    """The target of that name: a scene file `*.json`, a case, or an experiment of a suite.

    Args:
        text: What was typed.
        request: Options of cases: preset, initial state, seeds, time.
        progress: Called while an initial state is generated.

    Raises:
        RequestError: Nothing has that name, or it has no error that could be measured.
        CaseError, SceneError: See `dembench.campaign.build_scenes`.
    """
    if campaign.is_file(text):
        return _paths(text, campaign.build_scenes(request, progress))
    name = text.partition("[")[0]
    if name in cases.names():
        case, _ = cases.parse_case(text)
        chosen = tuple(campaign.build_scenes(request, progress))
        return Target(text, case.title, "ensemble", chosen, case=case, preset=request.preset or "quick")
    return _experiment(*_known(text))


def posed(text: str, request: Request, progress: Progress) -> tuple[str, Scene]:
    """The problem in words and the first scene of what a sweep can be about, whether its errors can be measured or not.

    See `target` for the arguments and errors.
    """
    if campaign.is_file(text) or text.partition("[")[0] in cases.names():
        first = campaign.build_scenes(request, progress)[0]
        return cases.problem_title(text, first.preset), first.scene
    _, experiment = _known(text)
    return experiment.name, experiment.trials[0].scene()


def _known(text: str) -> tuple[Suite, Experiment]:
    found = {e.name: (suite, e) for suite in known_suites() for e in suite.experiments}
    if text not in found:
        everything = [*cases.names(), *found]
        raise RequestError(
            f"'{text}' is no case, scene file or experiment.{plugins.nearest(text, everything)} Experiments are "
            f"{', '.join(found)}."
        )
    return found[text]


def known_suites() -> list[Suite]:
    """The problems made for sweeps, and all suites."""
    return [problems.suite(), *(suites.suite(name) for name in suites.names())]


def _experiment(suite: Suite, experiment: Experiment) -> Target:
    chosen = tuple(SceneChoice(t.name, None, 0, t.scene()) for t in experiment.trials)
    given = {trial.name: {**suite.settings, **trial.settings} for trial in experiment.trials}
    divisions = {trial.name: trial.division for trial in experiment.trials}
    made = Target(experiment.name, experiment.title, "closed form", chosen, given, divisions, experiment)
    if not made.checks():
        raise RequestError(f"experiment '{experiment.name}' has only bounds; a sweep needs exact values")
    return made


def _paths(text: str, chosen: list[SceneChoice]) -> Target:
    """A scene whose paths are followed, with its shifted companion."""
    from dembench.scoring.errors import shifted

    scene = chosen[0].scene
    if not _records_positions(scene):
        raise RequestError(f"{text} records no positions; add an observable 'snapshot' or 'trajectory'")
    other = shifted(scene)
    check_scene(other)
    companion = SceneChoice(chosen[0].case, None, SHIFTED, other)
    return Target(text, f"Paths of {scene.name}", "path", (chosen[0], companion))


def _records_positions(scene: Scene) -> bool:
    return any(o.kind in ("snapshot", "trajectory") for o in scene.observables)

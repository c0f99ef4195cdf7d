"""Sound in a crystal: every grain has twelve contacts, and a wave along a cube's edge has the frequency of the lattice.

Spheres on a face-centred cubic lattice with the edge a, pressed together by the overlap d, are masses m between springs
of the tangent stiffness k = (3/2) kn sqrt(d). A longitudinal wave of wave number q along an edge has

    m omega^2 = 8 k sin^2(q a/4)

where eight of the twelve neighbours are in the planes ahead and behind, at 45 degrees (A. A. Maradudin et al. 1971,
Theory of lattice dynamics in the harmonic approximation). The force in the springs adds a part d/D, which is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dembench.cases.quantities import crossings
from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.scenes import MOTION, Kind

RADIUS = 1e-3
GRAIN = Kind(1e8, 2500.0, RADIUS)
STRAIN = 1e-3
"""Overlap over the diameter."""
CELLS = (12, 3, 3)
"""Cubic cells along the periodic axes; the wave is as long as the first."""
LOUDNESS = 0.02
"""Strain in the wave over that of the crystal; its frequency is that of small waves within the square of it."""
STEP, RECORDS = 1e-6, 400
EDGE = math.sqrt(2) * 2 * RADIUS * (1 - STRAIN)
BASIS = np.array([(0, 0, 0), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0)])


def wave_number() -> float:
    """Of a wave as long as the crystal [1/m]."""
    return 2 * math.pi / (CELLS[0] * EDGE)


def frequency() -> float:
    """Angular frequency of the wave [rad/s]."""
    stiffness = 1.5 * Contact.between(GRAIN, GRAIN).stiffness * math.sqrt(2 * RADIUS * STRAIN)
    return math.sqrt(8 * stiffness / GRAIN.mass) * math.sin(wave_number() * EDGE / 4)


def scene() -> Scene:
    """The lattice with the velocities of a standing wave."""
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in CELLS), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    position = EDGE * ((corners + BASIS).reshape(-1, 3) + 0.25)
    velocity = np.zeros_like(position)
    loudest = LOUDNESS * STRAIN * frequency() / wave_number()
    velocity[:, 0] = loudest * np.sin(wave_number() * position[:, 0])
    interval = math.ceil(2.2 * math.pi / frequency() / RECORDS / STEP) * STEP
    return Scene(
        name="crystal",
        materials=(Material(name="solid", density=GRAIN.density, young=GRAIN.young, poisson=GRAIN.poisson),),
        pair_laws=(PairLaw(a="solid", b="solid", restitution=1, friction=0),),
        species=(Species(name="grain", material="solid", radius=RADIUS),),
        bodies=Bodies(position=position, velocity=velocity),
        domain=Domain(lower=(0, 0, 0), upper=tuple(EDGE * n for n in CELLS), periodic=(True, True, True)),
        gravity=(0, 0, 0),
        duration=RECORDS * interval,
        time_step=STEP,
        observables=(Snapshot(name=MOTION, times=tuple(k * interval for k in range(RECORDS + 1))),),
    )


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    shape = np.sin(wave_number() * result.scene.bodies.position[:, 0])
    loud = seen.velocity[:, :, 0] @ shape / (shape @ shape)
    passed = crossings(seen.time, loud)
    half = float(passed[1] - passed[0]) if len(passed) > 1 else math.nan
    rest = seen.velocity - loud[:, None, None] * np.stack([shape, 0 * shape, 0 * shape], axis=1)
    return {"CR1a": math.pi / half, "CR1b": float(np.linalg.norm(rest, axis=2).max() / np.abs(loud).max())}


def experiment() -> Experiment:
    """The frequency, and what moves beside the wave."""
    expected, source = frequency(), "m omega^2 = 8 k sin^2(q a/4)"
    checks = (
        Check("CR1a", "frequency of the wave", "rad/s", expected, 0.005 * expected, source, scene_law=True),
        deviation("CR1b", "motion beside the wave, over it", 0.02, "a lattice without defects"),
    )
    return on_one_scene("crystal", "Sound in a crystal of spheres", scene, _measure, checks)

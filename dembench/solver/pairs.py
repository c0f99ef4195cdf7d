"""Constants of every pair that can touch, and how a kernel looks them up."""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import LinearSpring, Scene
from dembench.solver.laws import pair_constants
from dembench.solver.needs import Needs
from dembench.solver.types import types, vec8d
from dembench.solver.units import Units
from dembench.solver.walls.features import wall_materials

ONE, TABLE, RADII, LINEAR_RADII = "one", "table", "radii", "linear radii"
"""How pair constants are found: one for all pairs; a table over species; a table over materials scaled by the radii
and masses of the two bodies, of which the stiffness of a linear law does not depend."""


def lookup_mode(scene: Scene, needs: Needs) -> str:
    """The cheapest lookup that is exact for the scene; forced features take what a scene that has them would."""
    by_body = scene.bodies.radius is not None or "polydisperse" in needs.force
    if scene.constraints or by_body or any(s.shape for s in scene.species):
        return LINEAR_RADII if isinstance(scene.law, LinearSpring) else RADII
    alike = len(np.unique(scene.bodies.species)) <= 1 and "pair_table" not in needs.force
    return ONE if alike else TABLE


def kinds(scene: Scene, mode: str) -> np.ndarray:
    """Index of each body into the pair tables, shape (n,): 0 where one kind serves all."""
    return np.zeros(len(scene.bodies), np.int32) if mode == ONE else scene.bodies.species


class PairTables:
    """The tables that kernels take.

    Args:
        scene: Gives law, materials, pair laws and species.
        units: Scene units.
        precision: "float32" or "float64".
        mode: How constants are looked up.

    Attributes:
        pairs, pair_columns: Constants of the pairs of species, and the length of a row.
        walls, wall_columns: Constants of species against wall materials, and the length of a row.
    """

    def __init__(self, scene: Scene, units: Units, precision: str, mode: str):
        self.pairs = pair_table(scene, units, precision, mode)
        self.pair_columns = len(_species(scene, mode))
        self.walls = wall_table(scene, units, precision, mode)
        self.wall_columns = max(1, len(wall_materials(scene)))


def pair_table(scene: Scene, units: Units, precision: str, mode: str) -> wp.array:
    """Constants of the pairs of species as an array of PairClass, row-major over kinds."""
    table = _species(scene, mode)
    records = []
    for a in table:
        for b in table:
            ra, rb, ma, mb = a.radius, b.radius, _mass(scene, a), _mass(scene, b)
            radius, mass = ra * rb / (ra + rb), ma * mb / (ma + mb)
            records.append((a.material, b.material, radius, mass))
    return _table(scene, units, precision, mode, records)


def wall_table(scene: Scene, units: Units, precision: str, mode: str) -> wp.array:
    """Constants of species against wall materials as an array of PairClass, row-major over kinds, then materials."""
    walls = wall_materials(scene) or [scene.species[0].material]
    records = [(s.material, w, s.radius, _mass(scene, s)) for s in _species(scene, mode) for w in walls]
    return _table(scene, units, precision, mode, records)


def _species(scene: Scene, mode: str) -> list[Any]:
    if mode == ONE and len(scene.bodies):
        return [scene.species[int(scene.bodies.species[0])]]
    return list(scene.species)


def _mass(scene: Scene, species: Any) -> float:
    return scene.material(species.material).density * species.volume()


def _table(
    scene: Scene, units: Units, precision: str, mode: str, rows: list[tuple[str, str, float, float]]
) -> wp.array:
    PairClass = types(precision).PairClass
    unscaled = mode in (RADII, LINEAR_RADII)
    records = []
    for a, b, radius, mass in rows:
        record = PairClass()
        records.append(record)
        scales = (units.length, units.mass) if unscaled else (radius, mass)
        try:
            constants = pair_constants(scene, a, b, *scales, units)
        except KeyError:
            continue
        for name, value in constants.items():
            setattr(record, name, value)
    return wp.array(records, dtype=PairClass, device="cpu")


@cache
def scaling(precision: str, linear: bool) -> Any:
    """A Warp function (constants for unit radius and mass, reduced radius, sum of inverse masses) -> constants."""
    t = types(precision)
    real, PairClass = t.real, t.PairClass

    @wp.func
    def scaled(c: PairClass, radius: real, inverse_mass: real):
        root = real(1.0)
        if wp.static(not linear):
            root = wp.sqrt(radius)
        m = real(1.0) / wp.max(inverse_mass, real(1.0e-30))
        dashpot = wp.sqrt(root * m)
        c.kn = c.kn * root
        c.kt = c.kt * root
        c.dn = c.dn * dashpot
        c.dt = c.dt * dashpot
        c.roll = c.roll * radius
        c.m = m
        return c

    return scaled


@cache
def radius_function(precision: str, radii: bool) -> Any:
    """Radius of a body with the row k of `kin`, as a Warp function (bodies, k); without `radii` that of all bodies."""
    Bodies = types(precision).Bodies

    @wp.func
    def radius(b: Bodies, k: vec8d):
        r = b.radius
        if wp.static(radii):
            r = k[6]
        return r

    return radius


@cache
def pair_lookup(precision: str, mode: str, radii: bool) -> tuple[Any, Any]:
    """Warp functions (bodies, i, j, table, columns) -> PairClass and (bodies, i, k, table, columns) -> PairClass.

    The first is for two bodies, the second for a body and wall material k. `radii`: see `radius_function`.
    """
    t = types(precision)
    real, Bodies, PairClass = t.real, t.Bodies, t.PairClass
    radius = radius_function(precision, radii)
    by_radii = mode in (RADII, LINEAR_RADII)
    scaled = scaling(precision, mode == LINEAR_RADII)

    @wp.func
    def of_pair(b: Bodies, i: int, j: int, table: wp.array(dtype=PairClass), columns: int):
        if wp.static(mode == ONE):
            c = table[0]
        else:
            c = table[b.kind[i] * columns + b.kind[j]]
            if wp.static(by_radii):
                ri, rj = real(radius(b, b.kin[i])), real(radius(b, b.kin[j]))
                c = scaled(c, ri * rj / (ri + rj), b.inv_m[i] + b.inv_m[j])
        return c

    @wp.func
    def of_wall(b: Bodies, i: int, k: int, table: wp.array(dtype=PairClass), columns: int):
        if wp.static(mode == ONE):
            c = table[k]
        else:
            c = table[b.kind[i] * columns + k]
            if wp.static(by_radii):
                c = scaled(c, real(radius(b, b.kin[i])), b.inv_m[i])
        return c

    return of_pair, of_wall

"""Contact laws: constants of a pair, and the force of a touching pair as a Warp function.

Hertz-Mindlin with overlap d, reduced radius R*, reduced mass m*, E* and G* of the pair:

    normal      Fn = (4/3) E* sqrt(R*) d^(3/2) - 2 sqrt(5/6) b sqrt(Sn m*) vn,     Sn = 2 E* sqrt(R* d)
    tangential  Ft = -St xi - 2 sqrt(5/6) b sqrt(St m*) vt,                         St = 8 G* sqrt(R* d)
    limit       |St xi| <= mu |Fn|; where it is exceeded Ft = mu |Fn| along the spring, xi rescaled, no dashpot
    b = -ln e / sqrt(ln^2 e + pi^2)

Sources: Hertz; Mindlin 1949; Tsuji et al. 1992 for the dashpot; the forms compared in Dosta et al. 2024,
doi 10.1016/j.cpc.2023.109066. vn is the separation speed, xi the tangential spring, all of body i against body j.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from dembench.scene import Material, PairLaw
from dembench.solver.types import types
from dembench.solver.units import Units


@dataclass(frozen=True)
class LawOptions:
    """What of the law is compiled in.

    Attributes:
        precision: "float32" or "float64".
        friction: Tangential force, history, torque.
        rescaled: History rescaled to its length after projection, lever = full radius; else projected only, lever =
            radius - overlap/2.
        midpoint: Dashpots use the mean of the velocities before and after the step.
    """

    precision: str = "float32"
    friction: bool = True
    rescaled: bool = False
    midpoint: bool = False


@dataclass(frozen=True)
class Elastic:
    """Moduli of a pair: 1/E* = sum (1 - nu^2)/E, 1/G* = sum (2 - nu)/G, both [Pa], and the damping ratio b [-]."""

    young: float
    shear: float
    damping: float

    @classmethod
    def of(cls, a: Material, b: Material, law: PairLaw) -> "Elastic":
        """Moduli of two materials under a pair law."""
        compliance = shear = 0.0
        for m in (a, b):
            compliance += (1 - m.poisson**2) / m.young
            shear += (2 - m.poisson) * 2 * (1 + m.poisson) / m.young
        e = law.restitution
        damping = math.log(1 / e) / math.hypot(math.log(e), math.pi) if e else 1.0
        return cls(1 / compliance, 1 / shear, damping)


def pair_constants(elastic: Elastic, law: PairLaw, radius: float, mass: float, units: Units) -> dict[str, float]:
    """Fields of a PairClass in scene units for reduced radius [m] and reduced mass [kg]."""
    dashpot = 2 * math.sqrt(5 / 6) * elastic.damping
    root = math.sqrt(radius / units.length)
    m = mass / units.mass
    young, shear = elastic.young / units.pressure, elastic.shear / units.pressure
    return {
        "kn": 4 / 3 * young * root,
        "kt": 8 * shear * root,
        "dn": dashpot * math.sqrt(2 * young * root * m),
        "dt": dashpot * math.sqrt(8 * shear * root * m),
        "mu": law.friction,
        "m": m,
        "e": law.restitution,
        "beta": law.tangential_restitution or 0.0,
    }


@cache
def contact_force(options: LawOptions) -> Any:
    """The force of a touching pair as a Warp function.

    (n, overlap, v, s, memory, c, dt) -> (f, ft, memory): n unit vector from j to i; overlap > 0; v relative velocity
    v_i - v_j; s sum of lever arm times angular velocity of both; memory (tangential spring, touching flag); c constants
    of the pair; dt step for the spring's growth. f is the total force on i, ft its tangential part.
    """
    t = types(options.precision)
    real, vec3, vec4, PairClass = t.real, t.vec3, t.vec4, t.PairClass
    friction, rescaled, midpoint = options.friction, options.rescaled, options.midpoint

    @wp.func
    def force(n: vec3, overlap: real, v: vec3, s: vec3, memory: vec4, c: PairClass, dt: real):
        root = wp.sqrt(overlap)
        quarter = wp.sqrt(root)
        vn = wp.dot(v, n)
        eta = c.dn * quarter
        fn = c.kn * overlap * root - eta * vn
        if wp.static(midpoint):
            fn = fn / (real(1.0) + eta * dt / (real(2.0) * c.m))
        f = fn * n
        ft = vec3()
        after = vec4(real(0.0), real(0.0), real(0.0), real(1.0))
        if wp.static(friction):
            vt = v - vn * n + wp.cross(n, s)
            xi = vec3(memory[0], memory[1], memory[2])
            if wp.static(rescaled):
                turned = xi - wp.dot(xi, n) * n
                length = wp.length(turned)
                if length > real(0.0):
                    turned = turned * (wp.length(xi) / length)
                xi = turned + vt * dt
            else:
                xi = xi + vt * dt
                xi = xi - wp.dot(xi, n) * n
            k = c.kt * root
            spring2 = k * k * wp.dot(xi, xi)
            bound = c.mu * wp.abs(fn)
            if spring2 > bound * bound:
                xi = xi * (bound / wp.sqrt(spring2))
                ft = -k * xi
            else:
                eta_t = c.dt * quarter
                ft = -k * xi - eta_t * vt
                if wp.static(midpoint):
                    ft = -(k * xi + eta_t * vt) / (real(1.0) + real(7.0) * eta_t * dt / (real(4.0) * c.m))
            f = f + ft
            after = vec4(xi[0], xi[1], xi[2], real(1.0))
        return f, ft, after

    return force

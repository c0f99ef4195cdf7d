"""Contact laws: constants of a pair, and the force of a touching pair as a Warp function.

Hertz-Mindlin with overlap d, reduced radius R*, reduced mass m*, E* and G* of the pair:

    normal      Fn = (4/3) E* sqrt(R*) d^(3/2) - 2 sqrt(5/6) b sqrt(Sn m*) vn,     Sn = 2 E* sqrt(R* d)
    tangential  Ft = -St xi - 2 sqrt(5/6) b sqrt(St m*) vt,                         St = 8 G* sqrt(R* d)

Linear spring-dashpot with the scene's kn and kt:

    normal      Fn = kn d - 2 b sqrt(kn m*) vn
    tangential  Ft = -kt xi - 2 b sqrt(kt m*) vt

Both:

    limit       spring <= mu |Fn|; where it is exceeded Ft = mu |Fn| along the spring, xi rescaled, no dashpot
    rolling     torque against the relative rolling, at most mu_r R* |Fn|
    b = -ln e / sqrt(ln^2 e + pi^2)

Sources: Hertz; Mindlin 1949; Cundall & Strack 1979; Tsuji et al. 1992 for the dashpot; the forms compared in Dosta et
al. 2024, doi 10.1016/j.cpc.2023.109066. vn is the separation speed, xi the tangential spring, all of body i against
body j.
"""

import math
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.scene import LinearSpring, Material, PairLaw, Scene
from dembench.solver.needs import Needs
from dembench.solver.types import types
from dembench.solver.units import Units

ROLLING_SHARE = wp.constant(0.125)
"""Part of the relative rolling that one contact may stop in a step: a body with eight contacts is not turned back."""


@dataclass(frozen=True)
class LawOptions:
    """What of the law is compiled in.

    Attributes:
        precision: "float32" or "float64".
        friction: Tangential force, history, torque.
        rolling: Rolling friction; with it `friction` is set.
        linear: Linear spring-dashpot in place of Hertz-Mindlin.
        rescaled: History rescaled to its length after projection, lever = full radius; else projected only, lever =
            radius - overlap/2.
        no_tension: The normal force is never below 0.
        midpoint: Dashpots use the mean of the velocities before and after the step.
    """

    precision: str = "float32"
    friction: bool = True
    rolling: bool = False
    linear: bool = False
    rescaled: bool = False
    no_tension: bool = False
    midpoint: bool = False

    @classmethod
    def of(cls, scene: Scene, needs: Needs, precision: str, midpoint: bool) -> "LawOptions":
        """What of the law a scene needs."""
        variant = getattr(scene.law, "variant", "")
        return cls(
            precision=precision,
            friction=needs.friction,
            rolling=needs.present.rolling_friction,
            linear=isinstance(scene.law, LinearSpring),
            rescaled=variant == "rescaled",
            no_tension=variant == "no-tension",
            midpoint=midpoint,
        )


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
        return cls(1 / compliance, 1 / shear, law.damping_ratio())


def pair_constants(scene: Scene, a: str, b: str, radius: float, mass: float, units: Units) -> dict[str, float]:
    """Fields of a PairClass in scene units.

    Args:
        scene: Gives law, materials and pair laws.
        a, b: Names of the two materials.
        radius, mass: Reduced radius [m] and mass [kg].
        units: Scene units.
    """
    pair = scene.pair_law(a, b)
    elastic = Elastic.of(scene.material(a), scene.material(b), pair)
    m, r = mass / units.mass, radius / units.length
    if isinstance(scene.law, LinearSpring):
        dashpot = 2 * elastic.damping
        stiffness = units.force / units.length
        kn, kt = scene.law.normal_stiffness / stiffness, scene.law.tangential_stiffness / stiffness
        sn, st = kn, kt
    else:
        dashpot = 2 * math.sqrt(5 / 6) * elastic.damping
        young, shear = elastic.young / units.pressure, elastic.shear / units.pressure
        kn, kt = 4 / 3 * young * math.sqrt(r), 8 * shear * math.sqrt(r)
        sn, st = 1.5 * kn, kt
    return {
        "kn": kn,
        "kt": kt,
        "dn": dashpot * math.sqrt(sn * m),
        "dt": dashpot * math.sqrt(st * m),
        "mu": pair.friction,
        "roll": pair.rolling_friction * r,
        "m": m,
        "e": pair.restitution,
        "beta": pair.tangential_restitution or 0.0,
    }


@cache
def surface_functions(options: LawOptions) -> Any:
    """Where the tangential force acts and what its spring is, as Warp functions `arm` and `spring`.

    arm(radius, overlap): lever of the tangential force. spring(memory, n, slip, time): the tangential spring of a
    contact in the tangent plane of today, after it has grown by a slip for a time.
    """
    t = types(options.precision)
    real, vec3, vec4 = t.real, t.vec3, t.vec4
    rescaled = options.rescaled

    @wp.func
    def arm(radius: wp.float64, overlap: real):
        lever = real(radius)
        if wp.static(not rescaled):
            lever = lever - real(0.5) * overlap
        return lever

    @wp.func
    def spring(memory: vec4, n: vec3, slip: vec3, time: real):
        xi = vec3(memory[0], memory[1], memory[2])
        if wp.static(rescaled):
            turned = xi - wp.dot(xi, n) * n
            length = wp.length(turned)
            if length > real(0.0):
                turned = turned * (wp.length(xi) / length)
            xi = turned + slip * time
        else:
            xi = xi + slip * time
            xi = xi - wp.dot(xi, n) * n
        return xi

    return SimpleNamespace(arm=arm, spring=spring)


@cache
def contact_force(options: LawOptions) -> Any:
    """The force of a touching pair as a Warp function.

    (n, overlap, v, s, memory, c, dt) -> (f, ft, memory): n unit vector from j to i; overlap > 0; v relative velocity
    v_i - v_j; s sum of lever arm times angular velocity of both; memory (tangential spring, touching flag); c constants
    of the pair; dt step for the spring's growth. f is the total force on i, ft its tangential part.
    """
    t = types(options.precision)
    real, vec3, vec4, PairClass = t.real, t.vec3, t.vec4, t.PairClass
    friction, midpoint, spring = options.friction, options.midpoint, surface_functions(options).spring
    linear, no_tension = options.linear, options.no_tension

    @wp.func
    def force(n: vec3, overlap: real, v: vec3, s: vec3, memory: vec4, c: PairClass, dt: real):
        root, quarter = real(1.0), real(1.0)
        if wp.static(not linear):
            root = wp.sqrt(overlap)
            quarter = wp.sqrt(root)
        kt, eta, eta_t = c.kt * root, c.dn * quarter, c.dt * quarter
        vn = wp.dot(v, n)
        fn = c.kn * overlap * root - eta * vn
        if wp.static(midpoint):
            fn = fn / (real(1.0) + eta * dt / (real(2.0) * c.m))
        if wp.static(no_tension):
            fn = wp.max(fn, real(0.0))
        f = fn * n
        ft = vec3()
        after = vec4(real(0.0), real(0.0), real(0.0), real(1.0))
        if wp.static(friction):
            vt = v - vn * n + wp.cross(n, s)
            xi = spring(memory, n, vt, dt)
            spring2 = kt * kt * wp.dot(xi, xi)
            bound = c.mu * wp.abs(fn)
            if spring2 > bound * bound:
                xi = xi * (bound / wp.sqrt(spring2))
                ft = -kt * xi
            elif bound > real(0.0):
                ft = -kt * xi - eta_t * vt
                if wp.static(midpoint):
                    ft = -(kt * xi + eta_t * vt) / (real(1.0) + real(7.0) * eta_t * dt / (real(4.0) * c.m))
            f = f + ft
            after = vec4(xi[0], xi[1], xi[2], real(1.0))
        return f, ft, after

    return force


@cache
def rolling_torque(precision: str) -> Any:
    """Torque of rolling friction as a Warp function (n, f, w, gain, inverse, c, dt) -> torque on i, the negative on j.

    Constant directional torque (Ai, Chen, Rotter & Ooi 2011, doi 10.1016/j.powtec.2010.09.030, model A): mu_r R* |Fn|
    against the relative rolling, the part of the relative spin in the tangent plane. It is at most ROLLING_SHARE of
    what stops the rolling in the step and, where the contact's own friction leaves or drives it, what takes that up,
    too: it never turns the rolling back, and a sphere on an incline comes to rest. Piles that it alone holds up keep
    moving a little, as Ai et al. report for this kind of model.

    n, f: as in `contact_force`; w: relative spin w_i - w_j; gain: its change by the contact's friction per time;
    inverse: sum of the inverse moments of inertia; c: constants of the pair; dt: step.
    """
    t = types(precision)
    real, vec3, PairClass = t.real, t.vec3, t.PairClass

    @wp.func
    def rolling(n: vec3, f: vec3, w: vec3, gain: vec3, inverse: real, c: PairClass, dt: real):
        torque = vec3()
        if inverse > real(0.0) and dt > real(0.0):
            roll = w - wp.dot(w, n) * n
            stop = roll * (real(ROLLING_SHARE) / dt)
            if wp.dot(gain, roll + dt * gain) >= real(0.0):
                stop = stop + gain
            torque = stop * (real(-1.0) / inverse)
            bound = c.roll * wp.abs(wp.dot(f, n))
            size = wp.length(torque)
            if size > bound:
                torque = torque * (bound / size)
        return torque

    return rolling


@cache
def contact_energy(options: LawOptions) -> Any:
    """Elastic energy of a contact as a Warp function (overlap, memory, c) -> energy.

    Hertz-Mindlin: (2/5) kn d^(5/2) + (1/2) kt d^(1/2) xi^2; linear: (1/2) kn d^2 + (1/2) kt xi^2, the integrals of the
    springs' forces. The stiffness of Mindlin's spring depends on the overlap, so its energy is that of the spring as it
    is, not the work that loaded it.
    """
    t = types(options.precision)
    real, vec4, PairClass = t.real, t.vec4, t.PairClass
    linear = options.linear

    @wp.func
    def energy(overlap: real, memory: vec4, c: PairClass):
        spring = memory[0] * memory[0] + memory[1] * memory[1] + memory[2] * memory[2]
        if wp.static(linear):
            return real(0.5) * (c.kn * overlap * overlap + c.kt * spring)
        root = wp.sqrt(overlap)
        return real(0.4) * c.kn * overlap * overlap * root + real(0.5) * c.kt * root * spring

    return energy

"""Kicks and drifts of velocity Verlet, sixteen bodies at a time."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.contacts import StepOptions
from dembench.solver.lanes import compiled_apart, prelude
from dembench.solver.types import types

_MOVE = """
double* kin = (double*)bodies.kin.data;
real *spin = (real*)bodies.spin.data, *load = width == 8 ? (real*)bodies.load.data : (real*)bodies.force.data;
D zero = {}, fastest = zero, sum = zero;
for (int begin = first; begin < last; begin += W) {
    const int rest = last - begin < W ? last - begin : W;
    int n[W], own[W];
    F m, counted;
    for (int k = 0; k < W; ++k) {
        n[k] = begin + (k < rest ? k : rest - 1);
        own[k] = k < rest ? n[k] : -1;
        counted[k] = k < rest ? 1 : 0;
        m[k] = bodies.inv_m.data[n[k]];
    }
    D k[8];
    F f[8];
    doubles8(kin, n, k);
    if constexpr (width == 8) rows8(load, n, f); else rows4(load, n, f);
    D free = __builtin_convertvector(m > 0 ? full(1) : full(0), D);
    D a0 = free * half * (__builtin_convertvector(f[0] * m, D) + gravity[0]);
    D a1 = free * half * (__builtin_convertvector(f[1] * m, D) + gravity[1]);
    D a2 = free * half * (__builtin_convertvector(f[2] * m, D) + gravity[2]);
    for (int t = 0; t < times; ++t) { k[3] += a0; k[4] += a1; k[5] += a2; }
    k[0] += dt * k[3]; k[1] += dt * k[4]; k[2] += dt * k[5];
    D speed = __builtin_convertvector(counted, D) * (k[3] * k[3] + k[4] * k[4] + k[5] * k[5]);
    fastest = larger(fastest, speed);
    sum += speed;
    put_doubles8(kin, own, k);
    if constexpr (width == 8) {
        F w[4], g;
        rows4(spin, n, w);
        for (int q = 0; q < W; ++q) g[q] = bodies.inv_i.data[n[q]];
        g *= real(half);
        for (int t = 0; t < times; ++t) { w[0] += g * f[4]; w[1] += g * f[5]; w[2] += g * f[6]; }
        put4(spin, own, w);
    }
    if (dt > 0) __builtin_memset(load + width * begin, 0, rest * width * sizeof(real));
}
wp::vec_t<2, double> out;
for (int k = 0; k < W; ++k) {
    out.c[0] = fastest[k] > out.c[0] ? fastest[k] : out.c[0];
    out.c[1] += sum[k];
}
return out;
"""


@cache
def move_function(o: StepOptions) -> Any:
    """A Warp function that kicks the bodies first..last and lets them drift by `dt`; returns speeds^2: largest, sum.

    Half a step of acceleration, `times` times, rounded after each, so that blocks may end anywhere. With a drift the
    loads are cleared.
    """
    Bodies = types(o.law.precision).Bodies

    @wp.func_native(compiled_apart(prelude(o.law.precision, width=8 if o.rotation else 4) + _MOVE))
    def move(
        bodies: Bodies, first: int, last: int, times: int, half: wp.float64, dt: wp.float64, gravity: wp.vec3d
    ) -> wp.vec2d: ...

    return move

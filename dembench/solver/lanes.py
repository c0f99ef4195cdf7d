"""Vector lanes on the CPU: what native code of the solver needs to treat many contacts at a time.

Warp's own vector operations stay scalar loops in the compiled code, so hot loops are written on the compiler's vector
types: `F` and `D` are LANES numbers of the solver's precision and of double precision, `M` a mask of F.
"""

from dembench.solver.types import types

LANES = 16
"""Contacts of a block: one register of AVX-512, two of AVX2, four of SSE."""


def prelude(precision: str, **constants: bool | int | float) -> str:
    """C++ that declares the vector types, access to arrays by lanes, and compile-time constants by name.

    at(p), to(p, x): lanes that stand side by side. of(p, n, size, f): entry f of the rows n[lane] of an array, whose
    rows have `size` entries; into(p, n, size, f, x) writes them. larger, smaller, root: by lanes.
    """
    real = {"float32": "float", "float64": "double"}[types(precision).precision]
    lanes = range(LANES)
    kinds = {bool: "bool", int: "int", float: "real"}
    declared = "\n".join(f"constexpr {kinds[type(v)]} {name} = {str(v).lower()};" for name, v in constants.items())
    gathered = ", ".join(f"p[size * n[{k}] + f]" for k in lanes)
    scattered = " ".join(f"p[size * n[{k}] + f] = x[{k}];" for k in lanes)
    return f"""
typedef {real} real;
constexpr int W = {LANES};
typedef real F __attribute__((vector_size(W * sizeof(real)), aligned(sizeof(real))));
typedef double D __attribute__((vector_size(W * sizeof(double)), aligned(sizeof(double))));
{declared}
auto full = [](real x) {{ return F{{}} + x; }};
auto at = [](const real* p) {{ F x; __builtin_memcpy(&x, p, sizeof(F)); return x; }};
auto to = [](real* p, F x) {{ __builtin_memcpy(p, &x, sizeof(F)); }};
auto of = [](const real* p, const int* n, int size, int f) {{ return F{{{gathered}}}; }};
auto of_double = [](const double* p, const int* n, int size, int f) {{ return D{{{gathered}}}; }};
auto into = [](real* p, const int* n, int size, int f, F x) {{ {scattered} }};
auto larger = [](auto a, auto b) {{ return a > b ? a : b; }};
auto smaller = [](auto a, auto b) {{ return a < b ? a : b; }};
auto root = [](auto a) {{ return __builtin_elementwise_sqrt(a); }};
"""

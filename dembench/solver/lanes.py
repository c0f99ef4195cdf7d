"""Vector lanes on the CPU: what native code of the solver needs to treat many contacts at a time.

Warp's own vector operations stay scalar loops in the compiled code, so hot loops are written on the compiler's vector
types: `F` and `D` are LANES numbers of the solver's precision and of double precision, `M` a mask of F.
"""

from dembench.solver.types import types

LANES = 16
"""Contacts of a block: one register of AVX-512, two of AVX2, four of SSE."""


def prelude(precision: str, **constants: bool | int | float) -> str:
    """C++ that declares the vector types, access to arrays by lanes, and compile-time constants by name.

    at(p), to(p, x): lanes that stand side by side. rows4, rows8, doubles8(p, n, f): the rows n[lane] of an array whose
    rows have 4 or 8 entries, entry k of all of them in f[k]; put4, put8, put_doubles8(p, n, f) write
    them where n[lane] is not negative, add4, add8 add all of them one after the other; both leave f turned. larger,
    smaller, root: by lanes.
    """
    real = {"float32": "float", "float64": "double"}[types(precision).precision]
    kinds = {bool: "bool", int: "int", float: "real"}
    declared = "\n".join(f"constexpr {kinds[type(v)]} {name} = {str(v).lower()};" for name, v in constants.items())
    return f"""
typedef {real} real;
constexpr int W = {LANES};
typedef real F __attribute__((vector_size(W * sizeof(real)), aligned(sizeof(real))));
typedef double D __attribute__((vector_size(W * sizeof(double)), aligned(sizeof(double))));
{declared}
auto full = [](real x) {{ return F{{}} + x; }};
auto at = [](const real* p) {{ F x; __builtin_memcpy(&x, p, sizeof(F)); return x; }};
auto to = [](real* p, F x) {{ __builtin_memcpy(p, &x, sizeof(F)); }};
auto larger = [](auto a, auto b) {{ return a > b ? a : b; }};
auto smaller = [](auto a, auto b) {{ return a < b ? a : b; }};
auto root = [](auto a) {{ return __builtin_elementwise_sqrt(a); }};
{_gather("rows4", "real", "F", 4)}
{_gather("rows8", "real", "F", 8)}
{_gather("doubles8", "double", "D", 8)}
{_scatter("put4", "real", "F", 4)}
{_scatter("put8", "real", "F", 8)}
{_scatter("put_doubles8", "double", "D", 8)}
{_add("add4", 4)}
{_add("add8", 8)}
"""


def separation(i: str = "i", j: str = "j") -> str:
    """C++ that declares what two bodies of each lane have: rows ki and kj of `kin`, d = x_i - x_j, and radii.

    d is that to the nearest image where `periodic`, and radii are those of all `bodies` without `radii`.
    """
    return f"""
    D ki[8], kj[8];
    doubles8(kin, {i}, ki);
    doubles8(kin, {j}, kj);
    D d0 = ki[0] - kj[0], d1 = ki[1] - kj[1], d2 = ki[2] - kj[2];
    if constexpr (periodic) {{
        d0 -= bodies.box[0] * __builtin_elementwise_rint(d0 * bodies.inverse_box[0]);
        d1 -= bodies.box[1] * __builtin_elementwise_rint(d1 * bodies.inverse_box[1]);
        d2 -= bodies.box[2] * __builtin_elementwise_rint(d2 * bodies.inverse_box[2]);
    }}
    D ri = D{{}} + bodies.radius, rj = ri;
    if constexpr (radii) {{ ri = ki[6]; rj = kj[6]; }}
"""


def compiled_apart(code: str) -> str:
    """The body of a native function that runs `code` as a function of its own, wherever it is called.

    Within a kernel of thousands of instructions the compiler keeps what a loop needs in memory instead of registers,
    scattered over so wide a stack that the loop over near pairs took twice as long there as by itself.
    """
    return f"auto apart = [&]() __attribute__((noinline)) {{\n{code}\n}};\nreturn apart();"


def _gather(name: str, real: str, vector: str, size: int) -> str:
    """A function that loads rows of `size` entries, as many side by side as fit, and turns them."""
    return f"""auto {name} = [](const {real}* p, const int* n, {vector}* f) {{
    for (int k = 0; k < {size}; ++k)
        for (int g = 0; g < W / {size}; ++g)
            __builtin_memcpy(({real}*)&f[k] + g * {size}, p + {size} * n[k + {size} * g], {size} * sizeof({real}));
    {_turned(size)}
}};"""


def _scatter(name: str, real: str, vector: str, size: int) -> str:
    """A function that turns entries back into rows and stores those with an index that is not negative."""
    return f"""auto {name} = []({real}* p, const int* n, {vector}* f) {{
    {_turned(size)}
    for (int k = 0; k < {size}; ++k)
        for (int g = 0; g < W / {size}; ++g)
            if (n[k + {size} * g] >= 0)
                __builtin_memcpy(p + {size} * n[k + {size} * g], ({real}*)&f[k] + g * {size}, {size} * sizeof({real}));
}};"""


def _add(name: str, size: int) -> str:
    """A function that turns entries back into rows and adds them."""
    return f"""auto {name} = [](real* p, const int* n, F* f) {{
    typedef real Row __attribute__((vector_size({size} * sizeof(real)), aligned(sizeof(real))));
    {_turned(size)}
    for (int g = 0; g < W / {size}; ++g)
        for (int k = 0; k < {size}; ++k)
        {{
            Row row, sum;
            __builtin_memcpy(&row, (real*)&f[k] + g * {size}, sizeof(Row));
            __builtin_memcpy(&sum, p + {size} * n[k + {size} * g], sizeof(Row));
            sum += row;
            __builtin_memcpy(p + {size} * n[k + {size} * g], &sum, sizeof(Row));
        }}
}};"""


def _turned(size: int) -> str:
    """Turns squares of `size` x `size` numbers that stand side by side in f[0] to f[size - 1]: entries become lanes.

    Two vectors whose numbers differ in one bit exchange what stands in the places that have the bit, and those without.
    """
    lines = []
    bit = 1
    while bit < size:
        low = ", ".join(str(q if not q & bit else LANES + q - bit) for q in range(LANES))
        high = ", ".join(str(q + bit if not q & bit else LANES + q) for q in range(LANES))
        for k in range(size):
            if not k & bit:
                a, b = f"f[{k}]", f"f[{k | bit}]"
                lines.append(
                    f"{{ auto x = __builtin_shufflevector({a}, {b}, {low}); "
                    f"{b} = __builtin_shufflevector({a}, {b}, {high}); {a} = x; }}"
                )
        bit *= 2
    return "\n    ".join(lines)

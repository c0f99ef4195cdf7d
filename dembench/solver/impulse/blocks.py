"""Blocks of rows that share no body: the lanes of a block are solved at the same time.

Each row goes into the first of the next WINDOW blocks that is not full and has neither of its bodies. The window
moves on when its first block is full, or where all of its blocks are full or have one of the bodies.
"""

from dembench.solver.lanes import LANES

WINDOW = 64

PUT = f"""
constexpr int W = {LANES}, window = {WINDOW};
unsigned long long full = 0;
int base = 0, used = 0, filled[window] = {{0}};
auto blocks_of = [&](int i) -> unsigned long long {{
    int gone = base - rows.stamp.data[i];
    return gone < window ? rows.mask.data[i] >> gone : 0;
}};
auto move_on = [&](int blocks) {{
    for (int k = 0; k < window; ++k) filled[k] = k + blocks < window ? filled[k + blocks] : 0;
    full = blocks < window ? full >> blocks : 0;
    base += blocks;
}};
auto put = [&](int i, int j, bool still, auto fill) {{
    while (true) {{
        unsigned long long taken = full | blocks_of(i) | (still ? 0 : blocks_of(j));
        if (taken + 1 == 0) {{ move_on(1); continue; }}
        int k = __builtin_ctzll(taken ^ ~0ull);
        fill(base + k, filled[k]);
        rows.mask.data[i] = blocks_of(i) | 1ull << k;
        rows.stamp.data[i] = base;
        if (!still) {{
            rows.mask.data[j] = blocks_of(j) | 1ull << k;
            rows.stamp.data[j] = base;
        }}
        if (base + k + 1 > used) used = base + k + 1;
        if (++filled[k] == W) full |= 1ull << k;
        int whole = full + 1 == 0 ? window : __builtin_ctzll(~full);
        if (whole) move_on(whole);
        return;
    }}
}};
"""
"""C++ that puts rows into blocks: `put(i, j, still, fill)` calls `fill(block, lane)` with the place of a row.

`still`: j may occur in all lanes. `used` is the number of blocks so far. `rows` has two arrays by bodies, both 0 at the
start: `mask` has the blocks of the window that began at `stamp` in which a body is."""

FORGET = "for (int i = begin; i < end; ++i) { rows.mask.data[i] = 0; rows.stamp.data[i] = 0; }"
"""C++ that makes `mask` and `stamp` of the bodies begin..end 0."""

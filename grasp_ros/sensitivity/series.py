"""Sums over series, eight columns at once: eight sums, written out, become vector instructions.

A table holds rows of series: coefficient k of a column stands at stride k + column. Unsigned indices spare the test for
negative ones.
"""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.compilation.fma import fma
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.contact.series import put
from grasp_ros.exact.records import Array, Lanes

WIDTH = 8  # columns that are summed at once
NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def padded(columns: int) -> int:
    """Columns up to the next multiple of WIDTH."""
    return WIDTH * ((columns + WIDTH - 1) // WIDTH)


@kernel
def combine(f: Array, stride: int, column: int, factors: Array, k: int, total: Lanes) -> Lanes:
    """Add coefficient k of the products of eight columns with one series to a total.

    Even and odd terms have sums of their own: one alone would wait for each addition before the next.
    """
    s0, s1, s2, s3, s4, s5, s6, s7 = total
    r0 = r1 = r2 = r3 = r4 = r5 = r6 = r7 = 0.0
    wide, i, last = np.uint64(stride), np.uint64(column), np.uint64(k)
    for _ in range((k + 1) // 2):
        even, odd, m = factors[last], factors[last - np.uint64(1)], i + wide
        s0 = fma(f[i], even, s0)
        s1 = fma(f[i + np.uint64(1)], even, s1)
        s2 = fma(f[i + np.uint64(2)], even, s2)
        s3 = fma(f[i + np.uint64(3)], even, s3)
        s4 = fma(f[i + np.uint64(4)], even, s4)
        s5 = fma(f[i + np.uint64(5)], even, s5)
        s6 = fma(f[i + np.uint64(6)], even, s6)
        s7 = fma(f[i + np.uint64(7)], even, s7)
        r0 = fma(f[m], odd, r0)
        r1 = fma(f[m + np.uint64(1)], odd, r1)
        r2 = fma(f[m + np.uint64(2)], odd, r2)
        r3 = fma(f[m + np.uint64(3)], odd, r3)
        r4 = fma(f[m + np.uint64(4)], odd, r4)
        r5 = fma(f[m + np.uint64(5)], odd, r5)
        r6 = fma(f[m + np.uint64(6)], odd, r6)
        r7 = fma(f[m + np.uint64(7)], odd, r7)
        i, last = m + wide, last - np.uint64(2)
    if k % 2 == 0:
        even = factors[0]
        s0 = fma(f[i], even, s0)
        s1 = fma(f[i + np.uint64(1)], even, s1)
        s2 = fma(f[i + np.uint64(2)], even, s2)
        s3 = fma(f[i + np.uint64(3)], even, s3)
        s4 = fma(f[i + np.uint64(4)], even, s4)
        s5 = fma(f[i + np.uint64(5)], even, s5)
        s6 = fma(f[i + np.uint64(6)], even, s6)
        s7 = fma(f[i + np.uint64(7)], even, s7)
    return s0 + r0, s1 + r1, s2 + r2, s3 + r3, s4 + r4, s5 + r5, s6 + r6, s7 + r7


@kernel
def multiply(f: Array, g: Array, out: Array, n: int) -> None:
    """Write the products of eight columns with eight others up to the order n; tables of the stride WIDTH."""
    for k in range(n + 1):
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
        end = np.uint64(WIDTH * k)
        for j in range(np.uint64(0), np.uint64(k + 1)):
            i = np.uint64(WIDTH) * j
            m = end - i
            s0 = fma(f[i], g[m], s0)
            s1 = fma(f[i + np.uint64(1)], g[m + np.uint64(1)], s1)
            s2 = fma(f[i + np.uint64(2)], g[m + np.uint64(2)], s2)
            s3 = fma(f[i + np.uint64(3)], g[m + np.uint64(3)], s3)
            s4 = fma(f[i + np.uint64(4)], g[m + np.uint64(4)], s4)
            s5 = fma(f[i + np.uint64(5)], g[m + np.uint64(5)], s5)
            s6 = fma(f[i + np.uint64(6)], g[m + np.uint64(6)], s6)
            s7 = fma(f[i + np.uint64(7)], g[m + np.uint64(7)], s7)
        put(out, WIDTH * k, (s0, s1, s2, s3, s4, s5, s6, s7))


@kernel
def evaluate(f: Array, stride: int, column: int, n: int, s: float) -> Lanes:
    """Values of eight columns of degree n at s."""
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(n, -1, -1):
        i = stride * k + column
        total = (
            fma(total[0], s, f[i]), fma(total[1], s, f[i + 1]), fma(total[2], s, f[i + 2]), fma(total[3], s, f[i + 3]),
            fma(total[4], s, f[i + 4]), fma(total[5], s, f[i + 5]), fma(total[6], s, f[i + 6]),
            fma(total[7], s, f[i + 7]),
        )
    return total

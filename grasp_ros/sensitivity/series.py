"""Sums over series, eight columns at once: eight sums, written out, become vector instructions.

A table holds rows of series: coefficient k of a column stands at stride k + column. Unsigned indices spare the test for
negative ones.
"""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.compilation.fma import fma
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.contact.series import put
from grasp_ros.exact.records import Array, Lanes

WIDTH = 8  # columns that are summed at once
NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def padded(columns: int) -> int:
    """Columns up to the next multiple of WIDTH."""
    return WIDTH * ((columns + WIDTH - 1) // WIDTH)


@inlined
def add_products(f: Array, i: np.uint64, factor: float, total: Lanes) -> Lanes:
    """Add the products of eight entries, from i on, with one factor to a total."""
    return (
        fma(f[i], factor, total[0]), fma(f[i + np.uint64(1)], factor, total[1]),
        fma(f[i + np.uint64(2)], factor, total[2]), fma(f[i + np.uint64(3)], factor, total[3]),
        fma(f[i + np.uint64(4)], factor, total[4]), fma(f[i + np.uint64(5)], factor, total[5]),
        fma(f[i + np.uint64(6)], factor, total[6]), fma(f[i + np.uint64(7)], factor, total[7]),
    )


@kernel
def combine(f: Array, stride: int, column: int, factors: Array, k: int, total: Lanes) -> Lanes:
    """Add coefficient k of the products of eight columns with one series to a total.

    Even and odd terms have sums of their own: one alone would wait for each addition before the next.
    """
    even, odd = total, NOTHING
    wide, i, last = np.uint64(stride), np.uint64(column), np.uint64(k)
    for _ in range((k + 1) // 2):
        even = add_products(f, i, factors[last], even)
        odd = add_products(f, i + wide, factors[last - np.uint64(1)], odd)
        i, last = i + wide + wide, last - np.uint64(2)
    if k % 2 == 0:
        even = add_products(f, i, factors[0], even)
    return (
        even[0] + odd[0], even[1] + odd[1], even[2] + odd[2], even[3] + odd[3], even[4] + odd[4], even[5] + odd[5],
        even[6] + odd[6], even[7] + odd[7],
    )


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

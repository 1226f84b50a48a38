"""Gaussian elimination in place, of the equations of one side or of the object in an implicit step."""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.radau import STAGES
from grasp_ros.exact.records import Array


@inlined
def subtract(f: Array, to: int, what: int, factor: float, count: int) -> None:
    """Take a multiple of neighbouring numbers from others; unsigned indices make it vector instructions."""
    a, b = np.uint64(to), np.uint64(what)
    for i in range(np.uint64(count)):
        f[a + i] -= factor * f[b + i]


@kernel
def eliminate(f: Array, at: int, width: int) -> bool:
    """Solve STAGES equations in place by Gauss with row pivots; the solutions stand behind the matrix."""
    for k in range(STAGES):
        top, pivot = at + k * width, k
        for j in range(k + 1, STAGES):
            if abs(f[at + j * width + k]) > abs(f[at + pivot * width + k]):
                pivot = j
        other = at + pivot * width
        if not abs(f[other + k]) > 0.0:
            return False
        for i in range(k, width):
            f[top + i], f[other + i] = f[other + i], f[top + i]
        for j in range(k + 1, STAGES):
            row = at + j * width
            subtract(f, row + k + 1, top + k + 1, f[row + k] / f[top + k], width - k - 1)
    for k in range(STAGES - 1, -1, -1):
        top = at + k * width
        for i in range(STAGES, width):
            f[top + i] /= f[top + k]
        for j in range(k):
            row = at + j * width
            subtract(f, row + STAGES, top + STAGES, f[row + k], width - STAGES)
    return True

"""Tables of the collocation at the nodes of Radau IIA: integrals, derivatives, and coefficients of the polynomial.

They are made in long double, so that their last digits are right in double precision.

Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (1996), section IV.5.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from grasp_ros.exact.jit import kernel
from grasp_ros.exact.records import Array

# Typed, or numba compiles what these are handed to once more for each literal.
STAGES = np.int64(16)  # even, see `polynomial.values`; 12 and 20 cost as much for the same length
FIRST = np.int64(0)


def _tables() -> tuple[Array, Array, Array, Array, Array]:
    """Nodes in (0, 1], integrals from 0 to them, the inverse, coefficients of Legendre polynomials, those in powers."""
    n = int(STAGES)
    radau = np.zeros(n + 1, dtype=np.longdouble)
    radau[n - 1], radau[n] = -1.0, 1.0  # P_n - P_(n-1) vanishes at the nodes
    slope = legendre.legder(radau)
    x = np.sort(legendre.legroots(radau.astype(float)).real).astype(np.longdouble)
    for _ in range(3):
        x -= legendre.legval(x, radau) / legendre.legval(x, slope)
    x[-1] = 1.0
    unit = np.eye(n, dtype=np.longdouble)
    values = np.stack([legendre.legval(x, row) for row in unit], axis=1)
    integrals = np.stack([legendre.legval(x, legendre.legint(row, lbnd=-1)) / 2 for row in unit], axis=1)
    to_legendre = _inverse(values)
    integral = integrals @ to_legendre
    powers = np.array([[(-1.0) ** (k + j) * math.comb(k, j) * math.comb(k + j, j) for k in range(n)] for j in range(n)])
    x, derivative = (x + 1) / 2, _inverse(integral)
    return _double(x), _double(integral), _double(derivative), _double(to_legendre), _double(powers)


def _double(table: NDArray[Any]) -> Array:
    """A table in double precision."""
    return np.ascontiguousarray(table, dtype=np.float64)


def _inverse(matrix: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
    """Inverse of a matrix of long doubles: Newton's iteration from the one in double precision."""
    x = np.linalg.inv(matrix.astype(float)).astype(matrix.dtype)
    for _ in range(2):
        x = x @ (2 * np.eye(len(x)) - matrix @ x)
    return x


NODES, INTEGRAL, DERIVATIVE, TO_LEGENDRE, TO_POWERS = _tables()


@kernel
def times(table: Array, j: int, f: Array, at: int, less: float) -> float:
    """Row j of a table times the values at the nodes, from `at` on, less a constant."""
    value = 0.0
    for k in range(STAGES):
        value += table[j, k] * (f[at + k] - less)
    return value

"""A motion as pieces on which it is smooth, and on each a polynomial of every quantity that is wanted.

Between events and changes of the inputs a motion is smooth, but for the ends of contacts, where a force rises like
(t - t_0)^(3/2). With t = a + (b - a) (1 - cos(pi (1 + x) / 2)) / 2 it is smooth in x in [-1, 1] there as well. So each
piece has NODES Gauss points in x, whose Legendre series is the polynomial and whose weights integrate. A piece whose
last coefficients are not small yet is halved.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from grasp_ros.physics.layout import EPS
from grasp_ros.physics.model import Array

NODES = 24
RESOLVED = 1e-13  # last coefficients of a piece, of the largest value of its group: what follows them may be larger
LAST = 3  # coefficients that must be small
ROUNDINGS, TINY = 4.0 * EPS, np.finfo(float).tiny  # of a time; what no two times are nearer than
HALVINGS = 12  # of a piece; what is not resolved then is no smooth function, or rounding,
MOST_HALVINGS, MOST = 40, 4096  # or of what is known to be smooth; then so many pieces at a time are rounding
States = Callable[[Array], Array]
Quantity = Callable[[Array, Array], tuple[Array, Array]]  # t (n,), state (n, 6) to values and their rounding (n, m)

_X, _WEIGHT = legendre.leggauss(NODES)
_ANGLE = 0.25 * math.pi * (1.0 + _X)
PART = np.sin(_ANGLE) ** 2  # of a piece, at the nodes
RATE = 0.25 * math.pi * np.sin(2.0 * _ANGLE)  # d part / d x
TO_SERIES = (legendre.legvander(_X, NODES - 1) * _WEIGHT[:, None] * (np.arange(NODES) + 0.5)).T


class Pieces(NamedTuple):
    """k pieces of m quantities, in the order of time."""

    begin: Array  # (k,) s
    length: Array  # (k,) s
    group: NDArray[np.int64]  # (k,) which of the given spans a piece is a part of
    values: Array  # (k, NODES, m) at the nodes
    series: Array  # (k, NODES, m) Legendre coefficients in x
    resolved: NDArray[np.bool_]  # (k,)

    def integral(self, column: int, groups: int) -> Array:
        """Integral over time of one quantity, by group."""
        own = self.length * (self.values[..., column] @ (_WEIGHT * RATE))
        return np.asarray(np.bincount(self.group, own, groups), dtype=float)

    def largest(self, column: int, groups: int) -> Array:
        """Largest value of one quantity, by group: at the nodes, at ends, or where the derivative of a series is 0."""
        found = np.full(groups, -np.inf)
        np.maximum.at(found, self.group, self.values[..., column].max(axis=1))
        beyond = np.abs(np.diff(self.values[..., column], axis=1)).max(axis=1)  # what may hide between two nodes
        near = self.values[..., column].max(axis=1) + beyond >= found[self.group]
        for k in np.flatnonzero(near).tolist():
            series = self.series[k, :, column]
            turns = [-1.0, *real_roots(np.asarray(legendre.legder(series), dtype=float)), 1.0]
            found[self.group[k]] = max(found[self.group[k]], float(legendre.legval(turns, series).max()))
        return found

    def times(self, k: int, x: Array) -> Array:
        """Times in s of points x of a piece."""
        return np.asarray(self.begin[k] + self.length[k] * np.sin(0.25 * math.pi * (1.0 + x)) ** 2)


def real_roots(series: Array) -> Array:
    """Ascending roots (n,) of a Legendre series in [-1, 1]; none if its first term outweighs all others."""
    size = np.abs(series)
    if size[0] > size[1:].sum() or not size.any():
        return np.zeros(0)
    kept = series[: int(np.flatnonzero(size > 1e-15 * size.max())[-1]) + 1]
    roots = legendre.legroots(kept)
    near = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) <= 1.0 + 1e-9)]
    return np.sort(np.clip(near, -1.0, 1.0))


def expand(states: States, quantity: Quantity, begins: Array, ends: Array, group: NDArray[np.int64],
           halvings: int = HALVINGS) -> Pieces:
    """Pieces of a motion, halved until they are resolved relative to the largest value of their group.

    They begin and end (k,) in s, without an event or a change of an input within, and belong to a group (k,), 0, 1, ...
    """
    done: list[Pieces] = []
    begin, length = begins, ends - begins
    scale = np.zeros((int(group.max(initial=-1)) + 1, 1))
    for halving in range(halvings + 1):
        if not len(begin):
            break
        t = begin[:, None] + length[:, None] * PART
        found, noise = (rows.reshape(len(begin), NODES, -1) for rows in quantity(t.ravel(), states(t.ravel())))
        if scale.shape[1] != found.shape[2]:
            scale = np.zeros((len(scale), found.shape[2]))
        np.maximum.at(scale, group, np.abs(found).max(axis=1))
        series = np.einsum("xj,kjm->kxm", TO_SERIES, found)
        tail = np.abs(series[:, -LAST:]).max(axis=1)
        steepest = np.abs(np.diff(found, axis=1) / np.maximum(np.diff(t), TINY)[..., None]).max(axis=1)
        rounding = noise.max(axis=1) + ROUNDINGS * t[:, -1:] * steepest  # of values, and of times late in a run
        good = (tail <= RESOLVED * scale[group] + rounding).all(axis=1)
        last = halving == halvings or (halving >= HALVINGS and len(begin) > MOST)
        kept = np.ones(len(begin), dtype=bool) if last else good
        done.append(Pieces(begin[kept], length[kept], group[kept], found[kept], series[kept], good[kept]))
        half, left = 0.5 * length[~kept], begin[~kept]
        begin, length = np.stack([left, left + half], axis=1).ravel(), np.repeat(half, 2)
        group = np.repeat(group[~kept], 2)
    if not done:
        empty = np.zeros((0, NODES, 1))
        return Pieces(begins, begins, group, empty, empty, np.zeros(0, dtype=bool))
    order = np.argsort(np.concatenate([part.begin for part in done]), kind="stable")
    columns: list[Any] = [np.concatenate(parts)[order] for parts in zip(*done, strict=True)]
    return Pieces(*columns)

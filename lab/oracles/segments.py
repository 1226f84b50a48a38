"""A run seen closely: states at the nodes of a quadrature in every segment between its events and input changes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation import Trajectory
from grasp_ros.simulation.sampled_plant import tick_of, tick_times

NODES = 15  # of Gauss and Legendre in each part of a piece
MOST_SEGMENTS = 1000  # beyond: those at both ends of the run, and every n-th between them
PIECES = 150  # of all segments together, about
LEVELS = 1, 8  # of ever shorter pieces at both ends of a segment
MIDDLE = 3, 12  # equal pieces between them
GRADING = 0.2  # length of one level by that of the next
CUTS, CUT, PARTS = 12, 0.1, 8  # levels, their grading, and equal parts of a piece that is looked at more closely
SHORTEST = 64.0 * EPS  # of a piece, relative to its time: nodes must differ
INNER, FIRST, LAST, WHOLE = range(4)  # which ends of a piece are ends of its segment
Part = tuple[float, float, int, int]  # begin, end, kind and segment of a piece
COLUMNS = [COLUMN[body] for body in (LEFT, RIGHT, OBJECT)]


class Rule(NamedTuple):
    """A quadrature over [0, 1] by the part of a piece in its segment; u^(3/2) is analytic in s at the ends."""

    nodes: Array  # (4, n)
    weights: Array  # (4, n)
    coarse: Array  # (2, 4, n): of two rules of half the order, each on every other node


class Pieces(NamedTuple):
    """Parts of segments between events."""

    begin: Array  # (k,) s
    end: Array  # (k,) s
    kind: NDArray[np.int64]  # (k,) INNER, FIRST, LAST or WHOLE
    segment: NDArray[np.int64]  # (k,) number of the segment, ascending

    @property
    def first(self) -> NDArray[np.int64]:
        """The first piece (k,) of the segment of each."""
        return np.asarray(np.searchsorted(self.segment, self.segment))


class Detail(NamedTuple):
    """A run with its states in pieces; bodies are LEFT, RIGHT, OBJECT, each index 0 and -1 of x and v an end."""

    run: Trajectory
    pieces: Pieces
    weights: Array  # (3, k, n) s: of the rule in each piece, and of the two coarse ones
    t: Array  # (k, n + 2) s
    x: Array  # (k, n + 2, 3) m
    v: Array  # (k, n + 2, 3) m/s
    bodies: Array  # (k, 3, 4): m, K, C, f as they act in a piece, see `layout`

    def integral(self, values: Array) -> tuple[Array, Array]:
        """Integrals (k, ...) over the pieces of values (k, n + 2, ...), and the error's estimate.

        That is the larger of two differences: where the nodes are too few for a motion one may vanish by chance.
        """
        fine, *coarse = (_sums(table, values[:, 1:-1]) for table in self.weights)
        return fine, np.maximum(*(np.abs(fine - other) for other in coarse))

    def total(self, values: Array) -> Array:
        """Integrals (k, ...) of the size of values (k, n + 2, ...)."""
        return _sums(self.weights[0], np.abs(values[:, 1:-1]))


def _sums(weights: Array, values: Array) -> Array:
    """Sums (k, ...) of values (k, n, ...) by weights (k, n)."""
    return np.asarray(np.einsum("kn,kn...->k...", weights, values))


@cache
def rule() -> Rule:
    """Gauss and Legendre in s, t = s at inner ends and ~ s^2 at the ends of a segment."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    half = np.zeros((2, NODES))
    for which, nodes in zip(half, (x[::2], x[1::2]), strict=True):
        moments = 2.0 * np.eye(1, len(nodes))[0]
        which[np.isin(x, nodes)] = np.linalg.solve(np.polynomial.legendre.legvander(nodes, len(nodes) - 1).T, moments)
    s = 0.5 * (x + 1.0)
    maps = np.array([s, s * s, s * (2.0 - s), s * s * (3.0 - 2.0 * s)])
    slopes = np.array([np.ones_like(s), 2.0 * s, 2.0 - 2.0 * s, 6.0 * s * (1.0 - s)])
    return Rule(maps, slopes * (0.5 * weight), slopes * (0.5 * half[:, None]))


def pieces_of(run: Trajectory) -> Pieces:
    """Cut a run at its events, where its inputs change and where it comes to rest.

    Each of these segments is cut into pieces, short ones at its ends.
    """
    scene, rest = run.scene, [] if run.at_rest is None else [run.at_rest]
    edges = np.unique(np.concatenate([[0.0, scene.duration], run.event_table[:, 0], _changes(scene), rest]))
    edges = edges[(edges >= 0.0) & (edges <= scene.duration)]
    spans = [(a, b) for a, b in pairwise(edges.tolist()) if b - a > SHORTEST * b]
    if len(spans) > MOST_SEGMENTS:
        third = MOST_SEGMENTS // 3
        inner = spans[third:-third]
        spans = [*spans[:third], *inner[:: -(-len(inner) // third)], *spans[-third:]]
    each = PIECES // max(len(spans), 1)
    levels = min(max((each - MIDDLE[0]) // 2, LEVELS[0]), LEVELS[1])
    near = GRADING ** np.arange(levels, 0.0, -1.0)
    middle = np.linspace(near[-1], 1.0 - near[-1], min(max(each - 2 * levels, MIDDLE[0]), MIDDLE[1]) + 1)[1:-1]
    cuts = np.concatenate([[0.0], near, middle, 1.0 - near[::-1], [1.0]])
    rows: list[Part] = []
    for number, (a, b) in enumerate(spans):
        rows += _parts(a, b, cuts, WHOLE, number)
    return _table(rows)


def cut(pieces: Pieces, where: NDArray[np.bool_]) -> tuple[Pieces, NDArray[np.int64]]:
    """Some pieces cut into parts, ever shorter ones at both ends, where a layer may hide; also the first of each."""
    near = CUT ** np.arange(CUTS, 1.0, -1.0)
    share = np.concatenate([[0.0], near, np.linspace(CUT, 1.0 - CUT, PARTS + 1), 1.0 - near[::-1], [1.0]])
    first: list[int] = []
    rows: list[Part] = []
    for begin, end, kind, number, cuts in zip(*pieces, where, strict=True):
        first.append(len(rows))
        rows += _parts(begin, end, share if cuts else share[[0, -1]], kind, number)
    return _table(rows), np.array(first)


def _parts(begin: float, end: float, share: Array, kind: int, segment: int) -> Iterator[Part]:
    """Parts of a piece, cut at ascending shares of it from 0 to 1, but none that is too short."""
    at = begin + (end - begin) * share[:-1]
    keep = np.minimum(np.diff(at, prepend=-np.inf), end - at) > SHORTEST * end
    keep[0] = True
    at = np.append(at[keep], end)
    last = len(at) - 2
    for k, (a, b) in enumerate(pairwise(at.tolist())):
        yield a, b, kind & (FIRST * (k == 0) | LAST * (k == last)), segment


def _table(rows: list[Part]) -> Pieces:
    table = np.array(rows).reshape(-1, 4)
    return Pieces(table[:, 0], table[:, 1], table[:, 2].astype(np.int64), table[:, 3].astype(np.int64))


def _changes(scene: Scene) -> Array:
    """Times at which the inputs of a run can change."""
    if scene.sampled:
        return tick_times(scene)
    ticks = {tick for force in scene.system.external for tick in force.changes(scene.ticks)}
    return np.array(sorted(ticks)) * scene.period_ns / NANOSECONDS


def grid_of(pieces: Pieces) -> Array:
    """Times (k, n + 2) of the ends and the nodes of all pieces."""
    length = pieces.end - pieces.begin
    inner = pieces.begin[:, None] + length[:, None] * rule().nodes[pieces.kind]
    grid = np.column_stack([pieces.begin, inner, pieces.end])
    return np.minimum(np.maximum.accumulate(grid, axis=1), pieces.end[:, None])


def detail(run: Trajectory, pieces: Pieces, grid: Array) -> Detail:
    """The states of a run whose output times are those of `grid_of`, and after them any others."""
    states = np.nan_to_num(run.state[: grid.size]).reshape(*grid.shape, 6)
    system = run.scene.system
    bodies = system.bodies if run.sampled else system.closed_loop
    acting: Array = np.repeat(bodies[None], len(pieces.begin), axis=0)
    if run.sampled:
        acting[..., Of.FORCE] += run.inputs[: grid.size : grid.shape[1]]
    elif system.external:
        ticks = tick_of(run.scene, 0.5 * (pieces.begin + pieces.end)).tolist()
        acting[..., Of.FORCE] += np.array([system.external_at(tick) for tick in ticks]).reshape(-1, 3)
    columns = np.array(COLUMNS)
    weights = np.array([rule().weights, *rule().coarse])[:, pieces.kind] * (pieces.end - pieces.begin)[:, None]
    return Detail(run, pieces, weights, grid, states[..., columns], states[..., columns + 1], acting)

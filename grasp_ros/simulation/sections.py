"""Crossings of a user's own function of the motion: Poincaré sections, switching surfaces, levels."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import column
from grasp_ros.physics.layout import EPS
from grasp_ros.physics.model import Array
from grasp_ros.simulation.smooth import Pieces, States, expand, real_roots

Function = Callable[[Array, Array], Array]  # t (n,), state (n, 6) to (n,)
APART = 1e-9  # of a piece: roots that are closer are one
NEAR = 1e-6  # of a piece: most roots of polynomials are nearer to the function's
MOST = 100  # iterations for a root


class Section(NamedTuple):
    """Crossings in the order of time."""

    t: Array  # (n,) s
    state: Array  # (n, 6), of the run at these times, bit for bit
    direction: NDArray[np.int64]  # (n,) +1: rises, -1: falls
    resolution: float  # s; 0: every piece is resolved. Otherwise crossings this close to each other may be missing


def as_function(section: Function | ArrayLike, level: float) -> Function:
    """A function whose zeros are wanted, of weights (6,) of the state or of a callable."""
    if not np.isfinite(level):
        raise Refused(f"level: {level!r} is not allowed; allowed: a finite number")
    if callable(section):
        return lambda t, state: _checked(section(t, state), t) - level
    try:
        weights = column("function", section)
    except Refused:
        weights = np.zeros(0)
    if weights.shape != (6,) or not np.isfinite(weights).all() or not weights.any():
        raise Refused(f"section: {section!r} is not allowed; allowed: six weights of the state, not all 0, or a"
                      " callable of times (n,) and states (n, 6)")
    used = np.flatnonzero(weights)
    return lambda t, state: _checked(state[:, used] @ weights[used], t) - level


def crossings(function: Function, direction: int, breaks: Array, states: States) -> Section:
    """Where a function of time and state changes its sign, see `trajectory.Trajectory.section`.

    `breaks` (k,) in s are begin and end of the run, and between them all times at which the motion is not smooth.
    """
    if direction not in (-1, 0, 1):
        raise Refused(f"direction: {direction!r} is not allowed; allowed: -1, 0 or 1")

    def quantity(t: Array, state: Array) -> tuple[Array, Array]:
        values = function(t, state)[:, None]
        return values, np.zeros_like(values)

    pieces = expand(states, quantity, breaks[:-1], breaks[1:], np.zeros(len(breaks) - 1, dtype=np.int64))
    t, reach = _candidates(pieces)
    ends = np.concatenate([breaks[:1], t, breaks[-1:]])
    middles = 0.5 * (ends[1:] + ends[:-1])
    values = function(middles, states(middles))
    signs = np.sign(values).astype(np.int64)
    signs = signs[np.maximum.accumulate(np.where(signs != 0, np.arange(len(signs)), 0))]  # 0 counts as the one before
    turn = np.where(signs[:-1] != 0, np.sign(np.diff(signs)), 0)
    kept = (turn != 0) & ((turn == direction) | (direction == 0))
    t = t[kept]
    if len(t):
        sides, at_sides = (np.stack([row[:-1][kept], row[1:][kept]], axis=1) for row in (middles, values))
        t = _polished(function, states, t, NEAR * reach[kept], sides, at_sides, signs[:-1][kept])
    lost = pieces.length[~pieces.resolved]
    return Section(t, states(t), turn[kept], float(lost.max(initial=0.0)))


def _checked(values: ArrayLike, t: Array) -> Array:
    if np.iscomplexobj(values):  # numpy would drop the imaginary parts
        raise Refused("section: gives complex numbers; allowed: a finite number for each")
    found = np.asarray(values, dtype=float)
    if found.shape != t.shape or not np.isfinite(found).all():
        raise Refused(f"section: gives numbers of shape {found.shape} for times of shape {t.shape}, or some that are"
                      " not finite, as the state of a body that is not there; allowed: a finite number for each")
    return found


def _candidates(pieces: Pieces) -> tuple[Array, Array]:
    """Times (n,) of all roots of the polynomials, and how far each may be off, in s; ascending and apart."""
    found, reach = [np.zeros(0)], [np.zeros(0)]
    size = np.abs(pieces.series[..., 0])
    near = ~pieces.resolved | (size[:, 0] <= size[:, 1:].sum(axis=1) * (1.0 + 1e-9))
    for k in np.flatnonzero(near).tolist():
        roots = pieces.times(k, real_roots(pieces.series[k, :, 0]))
        found.append(roots)
        reach.append(np.full(len(roots), pieces.length[k]))
    begins, values = pieces.begin[1:], pieces.values[..., 0]
    jumps = np.flatnonzero(values[1:, 0] * values[:-1, -1] <= 0.0)  # between the last node and the next piece's first
    found.append(begins[jumps])
    reach.append(np.minimum(pieces.length[1:], pieces.length[:-1])[jumps])
    t, wide = np.concatenate(found), np.concatenate(reach)
    order = np.argsort(t, kind="stable")
    t, wide = t[order], wide[order]
    apart = np.diff(t, prepend=-np.inf) > APART * wide + 4.0 * EPS * t
    return t[apart], wide[apart]


def _polished(
    function: Function, states: States, t: Array, span: Array, sides: Array, at_sides: Array, before: Array,
) -> Array:
    """Roots (n,) on the dense output itself, within `span` of t or farther off, by the Illinois method with bisections.

    Between its `sides` (n, 2), where it has the values `at_sides`, the sign of the function changes from `before`.
    """
    near = np.clip(np.stack([t - span, t + span], axis=1), sides[:, :1], sides[:, 1:])
    at_near = function(near.ravel(), states(near.ravel())).reshape(near.shape)
    x, f = np.insert(sides, [1], near, axis=1), np.insert(at_sides, [1], at_near, axis=1)
    begin = np.argmax(np.sign(f[:, 1:]) != before[:, None], axis=1)  # of the first interval at whose end it is another
    rows = np.arange(len(t))
    low, high, at_low, at_high = x[rows, begin], x[rows, begin + 1], f[rows, begin], f[rows, begin + 1]
    done, stayed = np.zeros(len(t), dtype=bool), np.zeros(len(t))  # end of the interval that stayed last: -1, 1
    for k in range(MOST):
        with np.errstate(divide="ignore", invalid="ignore"):
            middle = high - at_high * (high - low) / (at_high - at_low)
        middle = np.where((low < middle) & (middle < high) & (k % 4 != 3), middle, 0.5 * (low + high))
        value = function(middle, states(middle))
        done |= (np.abs(middle - t) <= 2.0 * EPS * middle) | (high - low <= 4.0 * EPS * high)
        t = np.where(done, t, middle)
        done |= value == 0.0
        if done.all():
            break
        left = np.sign(value) == before
        at_low, at_high = (np.where(left, value, np.where(stayed == -1, 0.5 * at_low, at_low)),
                           np.where(left, np.where(stayed == 1, 0.5 * at_high, at_high), value))
        low, high, stayed = np.where(left, middle, low), np.where(left, high, middle), np.where(left, 1.0, -1.0)
    return t

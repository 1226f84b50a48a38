"""Sums of short ways: what a rounding leaves out of a place is added with the next one, as in the clock.

Steps of one length go equal ways, and then the roundings of their sums are equal, too: some hundred of them, each of
which goes some hundred roundings of a place far, may leave it wrong by half as many roundings as there are steps. An
arm that touches nothing is placed by the object and its gap: if only one of these kept what was left out, it would
drift. Velocities are rounded as they are: their errors die out with them, and where a pair keeps u' = -1/p but for
rounding, a sum that follows what is below it would cross that again and again.

Source: N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. (2002), section 4.3.
"""

from __future__ import annotations

from grasp_ros.exact.jit import inlined
from grasp_ros.exact.records import Array, State
from grasp_ros.physics.layout import LANES, LEFT, RIGHT, U_L, X_L, X_O, X_R, Body

SHORT = 0.125  # of a place: a longer way has roundings like those of the sum


@inlined
def forget(state: State) -> None:
    """Begin sums anew: the state has come here in another way."""
    for lane in range(len(state.carry)):
        state.carry[lane] = 0.0


@inlined
def add(state: State, lane: int, way: float, end: float) -> None:
    """Move a place of the state on by a way, nan if it is not known, to about `end`."""
    y, carry = state.y, state.carry
    way += carry[lane]
    if abs(way) <= SHORT * abs(y[lane]):
        end = y[lane] + way
        carry[lane] = way - (end - y[lane])  # exact, because the way is shorter
    else:
        carry[lane] = 0.0
    y[lane] = end


@inlined
def put(state: State, lane: int, end: float) -> None:
    """Put a place of the state where something else tells that it is."""
    state.y[lane], state.carry[lane] = end, 0.0


@inlined
def meet(state: State, side: Body) -> None:
    """Put an arm at u = 0: where the object is, with what is left out of that."""
    x = X_L if side == LEFT else X_R
    put(state, U_L + side, 0.0)
    state.y[x], state.carry[x] = state.y[X_O], state.carry[X_O]


@inlined
def add_depth(state: State, at: Array, side: Body, touching: bool) -> None:
    """Move u of a pair on, whose lane is w = sqrt(u) in contact."""
    u = U_L + side
    end, way = at[u], at[LANES + u]
    if touching:
        add(state, u, way * (2.0 * end - way), end * end)
    else:
        add(state, u, way, end)


@inlined
def add_ways(state: State, at: Array, left: bool, right: bool) -> None:
    """Move x_o and u on to the end of a step, from the lanes and their ways; `left` and `right`: who touches."""
    add(state, X_O, at[LANES + X_O], at[X_O])
    add_depth(state, at, LEFT, left)
    add_depth(state, at, RIGHT, right)

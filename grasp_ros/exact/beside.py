"""Arms that touch nothing while the object is in contact: where they are after a step."""

from __future__ import annotations

from grasp_ros.exact.flight import fly, launch
from grasp_ros.exact.jit import inlined
from grasp_ros.exact.kinematics import arm_of, velocity_lane
from grasp_ros.exact.records import Array, Flight, Placing, Plant, Regime, State, Tables
from grasp_ros.exact.sums import add, put
from grasp_ros.physics.layout import (
    DAMPING,
    EPS,
    LANES,
    LEFT,
    MASS,
    RIGHT,
    STIFFNESS,
    U_L,
    U_R,
    V_L,
    V_R,
    X_L,
    X_O,
    X_R,
    Z_L,
    Z_R,
    Body,
)

STRAYED = 16.0  # roundings of places
FAR = 4.0  # times as far from 0 as the arm: there u is no better known than the place of the arm


@inlined
def placing(tables: Tables, plant: Plant, y: Array, side: Body, touches: bool, s: float, t: float) -> Placing:
    """How an arm is placed after a step to s of t s.

    With the gap the roundings of the object would show in the place of an arm that is much nearer to 0, which moves on
    by the ways of object and gap instead, if those are short. It flies where they are not, where roundings of the
    object would drive it by its spring, or where its damper stops it: it leaves less than the roundings of a series.
    """
    if touches:
        return Placing.BY_GAP
    x, v, _ = arm_of(y, side)
    row, x_o = plant.bodies[side], abs(y[X_O])
    if row[STIFFNESS] * t * x_o > row[MASS] * abs(v) or row[DAMPING] * t > row[MASS]:
        return Placing.BY_FLIGHT
    if x_o <= FAR * abs(x):
        return Placing.BY_GAP
    way = way_bound(tables, X_O, s) + way_bound(tables, Z_L + side, s)
    return Placing.BY_WAY if way <= abs(x) else Placing.BY_FLIGHT


@inlined
def way_bound(tables: Tables, lane: int, s: float) -> float:
    """Bound on the way of a lane until s."""
    return float(abs(tables.c[LANES + lane]) * s + tables.size[lane])


@inlined
def free_flight(plant: Plant, y: Array, side: Body, how: Placing) -> Flight:
    """Flight of an arm; no more than its begin if it does not fly, because a launch has its price."""
    x, v, _ = arm_of(y, side)
    if how == Placing.BY_FLIGHT:
        flight: Flight = launch(plant.bodies[side], x, v)
        return flight
    return Flight(Regime.DRIFT, x, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def ways_beside(at: Array) -> tuple[float, float]:
    """Ways of the arms by those of the object and of the gaps."""
    return at[LANES + X_O] + at[LANES + Z_L], at[LANES + X_O] - at[LANES + Z_R]


@inlined
def arm_beside(how: Placing, free: Flight, way: float, t: float, x: float, v: float) -> tuple[float, float, float]:
    """x and v of an arm after t s, and the way there; x and v are those of object and gap, `way` is theirs, too."""
    if how == Placing.BY_FLIGHT:
        flown: tuple[float, float, float] = fly(free, t)
        return flown
    return free.x + way if how == Placing.BY_WAY else x, v, way


@inlined
def place_beside(at: Array, how: tuple[Placing, Placing], free: tuple[Flight, Flight], t: float, y: Array) -> None:
    """Put arms where they are after t s, if that is not where object and gap are."""
    way_l, way_r = ways_beside(at)
    y[X_L], y[V_L], _ = arm_beside(how[0], free[0], way_l, t, y[X_L], y[V_L])
    y[X_R], y[V_R], _ = arm_beside(how[1], free[1], way_r, t, y[X_R], y[V_R])


@inlined
def end_beside(state: State, at: Array, how: tuple[Placing, Placing], free: tuple[Flight, Flight], t: float) -> None:
    """Put arms where they are at the end of a segment of t s, as `place_beside`, with what roundings leave out."""
    way_l, way_r = ways_beside(at)
    end_arm(state, LEFT, how[0], free[0], way_l, t)
    end_arm(state, RIGHT, how[1], free[1], way_r, t)


@inlined
def end_arm(state: State, side: Body, how: Placing, free: Flight, way: float, t: float) -> None:
    """Put an arm where it is at the end of a segment."""
    y, v = state.y, velocity_lane(side)
    x = v - 1
    y[x], y[v], way = arm_beside(how, free, way, t, y[x], y[v])
    if how == Placing.BY_GAP:
        state.carry[x] = 0.0  # object and gap have their own
        return
    end, y[x] = y[x], free.x
    add(state, x, way, end)


@inlined
def gap_shows(row: Array, how: Placing, t: float, x_before: float, x: float, x_o: float, u: float) -> bool:
    """Whether places tell u of an arm better than a series, or no worse.

    They do where a damper has made the series coarse, and it is far from the object, has come far, or what many steps
    have left in u shows in the places.
    """
    if how != Placing.BY_FLIGHT:
        return how == Placing.BY_WAY
    gap, size = abs(x - x_o), max(abs(x), abs(x_o))
    told = 2.0 * max(gap, abs(x - x_before)) >= size or abs(gap - abs(u)) > STRAYED * EPS * size
    return bool(row[DAMPING] * t > row[MASS] and told)


@inlined
def part_beside(plant: Plant, how: tuple[Placing, Placing], free: tuple[Flight, Flight], t: float, state: State
                ) -> None:
    """Let u of arms follow their places after t s where these show it, or roundings of the series add up in it."""
    y = state.y
    if gap_shows(plant.bodies[LEFT], how[0], t, free[0].x, y[X_L], y[X_O], y[U_L]):
        put(state, U_L, y[X_L] - y[X_O])
    if gap_shows(plant.bodies[RIGHT], how[1], t, free[1].x, y[X_R], y[X_O], y[U_R]):
        put(state, U_R, y[X_O] - y[X_R])

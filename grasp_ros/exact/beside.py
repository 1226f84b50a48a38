"""Arms that touch nothing while the object is in contact: where they are after a step."""

from __future__ import annotations

from grasp_ros.exact.flight import fly, launch
from grasp_ros.exact.jit import inlined
from grasp_ros.exact.kinematics import arm_of
from grasp_ros.exact.records import Array, Flight, Plant, Regime, Step, Tables
from grasp_ros.physics.layout import (
    DAMPING,
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


@inlined
def flies_free(tables: Tables, plant: Plant, y: Array, side: Body, s: float, t: float) -> bool:
    """Whether an arm that touches nothing is better put where it flies than where the ways of object and gap tell.

    The roundings of these ways would show in its place, or those of the object drive it by its spring within t s; a
    damper that stops it within t leaves less than the roundings of a series.
    """
    x, v, _ = arm_of(y, side)
    row = plant.bodies[side]
    coarse = way_bound(tables, X_O, s) + way_bound(tables, Z_L + side, s) > abs(x)
    driven = row[STIFFNESS] * t * abs(y[X_O]) > row[MASS] * abs(v)
    return bool(coarse or driven or row[DAMPING] * t > row[MASS])


@inlined
def way_bound(tables: Tables, lane: int, s: float) -> float:
    """Bound on the way of a lane until s."""
    return float(abs(tables.c[LANES + lane]) * s + tables.size[lane])


@inlined
def free_flight(plant: Plant, y: Array, side: Body, flies: bool) -> Flight:
    """Flight of an arm; what nobody reads if it does not, because a launch has its price."""
    x, v, _ = arm_of(y, side)
    return launch(plant.bodies[side], x, v) if flies else Flight(Regime.DRIFT, x, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def place_beside(at: Array, step: Step, free: tuple[Flight, Flight], y: Array) -> None:
    """Put the arms that touch nothing where the ways of object and gap take them, whose roundings are small."""
    if not step.left:
        y[X_L] = free[0].x + (at[LANES + X_O] + at[LANES + Z_L])
    if not step.right:
        y[X_R] = free[1].x + (at[LANES + X_O] - at[LANES + Z_R])


@inlined
def place_free(flies_l: bool, flies_r: bool, free: tuple[Flight, Flight], t: float, y: Array) -> None:
    """Put the arms that fly where they are after t s."""
    if flies_l:
        y[X_L], y[V_L], _ = fly(free[0], t)
    if flies_r:
        y[X_R], y[V_R], _ = fly(free[1], t)


@inlined
def gap_shows(row: Array, t: float, x_before: float, x: float, x_o: float) -> bool:
    """Whether places tell u of an arm better than a series that its damper has made coarse in t s.

    They do where it is far from the object, or has come far.
    """
    return row[DAMPING] * t > row[MASS] and 2.0 * max(abs(x - x_o), abs(x - x_before)) >= max(abs(x), abs(x_o))


@inlined
def part_free(plant: Plant, flies_l: bool, flies_r: bool, free: tuple[Flight, Flight], t: float, y: Array) -> None:
    """Let u of damped arms that have flown for t s follow their places, or roundings of the series add up in it."""
    if flies_l and gap_shows(plant.bodies[LEFT], t, free[0].x, y[X_L], y[X_O]):
        y[U_L] = y[X_L] - y[X_O]
    if flies_r and gap_shows(plant.bodies[RIGHT], t, free[1].x, y[X_R], y[X_O]):
        y[U_R] = y[X_O] - y[X_R]

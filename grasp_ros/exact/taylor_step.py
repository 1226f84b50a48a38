"""One Taylor step in regularised time: its series, its unit, and the length for which it neglects nothing."""

from __future__ import annotations

import math

from grasp_ros.exact.jit import inlined
from grasp_ros.exact.kinematics import rate_lanes, velocity_lane
from grasp_ros.exact.polynomial import curvatures, larger, products, sizes, values
from grasp_ros.exact.records import Array, Integers, Plant, Settings, State, Step, Tables
from grasp_ros.exact.scales import orders_to_one
from grasp_ros.exact.series import ONE, expand_both, expand_one
from grasp_ros.physics.layout import (
    CHECK,
    DAMPING,
    EPS,
    FORCE,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    TIME,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_O,
    Z_L,
    Z_R,
    Pair,
    Work,
)

HEAD = TAIL = 5  # at a touch with p = 0 only every fifth coefficient differs from zero
SMALLEST = 1e-290  # of what moves
STILL = 2.0**-300  # part of the fastest motion that is none
BELOW, ABOVE = 0.25, 4.0  # steps beyond which what moves is not what moves within a unit
FAR_BELOW, FAR_ABOVE = 2.0**-10, 2.0**10  # steps whose unit does not fit
MOST = 16  # binary orders by which a unit is changed at once
MAX_UNITS = 200
LN_2 = math.log(2.0)


@inlined
def motion_sizes(c: Array, reach: float, size: Array) -> None:
    """Write to `size` the sizes (LANES,) of what moves in each lane within `reach`: the largest of a few terms."""
    power = reach
    largest = products(sizes(c, ONE), power)
    for k in range(2, HEAD + 1):
        power *= reach
        largest = larger(largest, products(sizes(c, k), power))
    for lane in range(LANES):
        size[lane] = largest[lane]


@inlined
def step_size(c: Array, size: Array, n: int, first: float) -> float:
    """Step in s / unit at which the first neglected term of a lane is a part of its size; `first`: the part's root.

    The radius of convergence is estimated from the last TAIL coefficients. Where they have vanished it is inf. The
    logarithms are those of a broken line through the powers of two, which is near enough.
    """
    last = sizes(c, n)
    if not last[0] + last[1] + last[2] + last[3] + last[5] + last[6] + last[7] < math.inf:
        return 0.0  # the coefficients have left the range of numbers
    growth = -math.inf  # binary logarithm of the inverse radius
    for k in range(n - TAIL + 1, n + 1):
        x = sizes(c, k)
        largest = 0.0
        for lane in range(LANES):
            largest = max(largest, x[lane] * size[lane])
        if largest > 0.0:
            m, e = math.frexp(largest)
            growth = max(growth, (e + 2.0 * (m - 1.0)) / k)
    return first * math.exp(-LN_2 * growth) if growth > -math.inf else math.inf


@inlined
def begin_series(tables: Tables, state: State) -> None:
    """Write order 0 of the series."""
    c, y, mode = tables.c, state.y, state.mode
    for lane in range(LANES):
        c[lane] = y[lane]
    c[TIME] = 0.0
    if mode[LEFT] == Pair.CONTACT:
        c[Z_L] = math.sqrt(y[U_L])
    if mode[RIGHT] == Pair.CONTACT:
        c[Z_R] = math.sqrt(y[U_R])


@inlined
def expand(tables: Tables, plant: Plant, step: Step) -> None:
    """The series of a step from its order 0."""
    if step.left and step.right:
        expand_both(tables.c, tables.f, plant.bodies, plant.pairs, step.unit, step.order)
    else:
        expand_one(tables.c, tables.f, plant.bodies, plant.pairs, LEFT if step.left else RIGHT, step.unit, step.order)


@inlined
def length(tables: Tables, plant: Plant, y: Array, step: Step, settings: Settings, reach: float) -> float:
    """Step in s / unit at which what is neglected is `tolerance` times what moves within `reach`.

    Velocities move by the step's own motion, and no less than by the rounding of the terms of their equation;
    positions with them.
    The product has a test of its own.
    """
    c, size = tables.c, tables.size
    motion_sizes(c, reach, size)
    t, doubt = size[TIME], EPS / settings.tolerance
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = plant.bodies[body], velocity_lane(body)
        terms = abs(row[FORCE]) + abs(row[STIFFNESS] * y[lane - 1]) + abs(row[DAMPING] * y[lane])
        size[lane] = max(size[lane], t * doubt * terms / row[MASS])
    fastest = max(size[V_L], size[V_O], size[V_R])
    for body in (LEFT, OBJECT, RIGHT):
        size[velocity_lane(body)] = max(size[velocity_lane(body)], STILL * fastest)
    size[X_O] = max(size[X_O], t * size[V_O])
    for side in (LEFT, RIGHT):
        front, back = rate_lanes(side)
        lane = Z_L + side
        moved = t * (size[front] + size[back])
        touching = step.left if side == LEFT else step.right
        if not touching or c[lane] > 0.0:
            size[lane] = max(size[lane], moved / (2.0 * c[lane]) if touching else moved)
    size[CHECK] = 0.0
    for lane in range(LANES):
        size[lane] = 1.0 / size[lane] if size[lane] > SMALLEST else 0.0
    return step_size(c, size, step.order, step.first)


@inlined
def fitted_step(tables: Tables, plant: Plant, state: State, settings: Settings, step: Step, span: float
                ) -> tuple[Step, float]:
    """A step with its series, in its unit or in one that fits them, and its length in that unit, or nan.

    Most units do at once. Coefficients of a wrong one leave the range of numbers, so the next follows from the length;
    where they vanish, the end of the span or a release ends the step.
    """
    for _ in range(MAX_UNITS):
        begin_series(tables, state)
        expand(tables, plant, step)
        h = 1.0
        for _ in range(2):
            h = length(tables, plant, state.y, step, settings, h)
            if BELOW < h < ABOVE or not 0.0 < h < math.inf:
                break
        if FAR_BELOW < h < FAR_ABOVE:
            return step, h
        if h == math.inf:
            values(tables.c, step.order, 1.0, tables.at)
            apart = (step.left and tables.at[Z_L] <= 0.0) or (step.right and tables.at[Z_R] <= 0.0)
            if apart or tables.at[TIME] >= span:
                return step, 1.0
        unit = step.unit * math.ldexp(1.0, orders_to_one(h, MOST))
        step = Step(step.order, step.first, unit, step.left, step.right)
    return step, math.nan


@inlined
def is_exact(tables: Tables, step: Step, h: float, tolerance: float) -> bool:
    """Whether a step of length h neglects nothing: the values at its end, and the sizes on the way, are known.

    G = w_l w_r, or u = w^2 with one side in contact, is expanded beside w: its defect at the end of the step consists
    of neglected terms only.
    """
    c, at, size = tables.c, tables.at, tables.size
    defect = abs(at[CHECK] - (at[Z_L] if step.left else at[Z_R]) * (at[Z_R] if step.right else at[Z_L]))
    return defect <= (100.0 * tolerance + 100.0 * EPS) * (abs(c[CHECK]) + h * abs(c[LANES + CHECK]) + size[CHECK])


@inlined
def accepted_length(tables: Tables, step: Step, h: float, settings: Settings, work: Integers) -> float:
    """Length in units of a step that is exact enough, or nan; the values at its end are left in `tables.at`.

    Shortening it costs no new expansion.
    """
    for _ in range(60):
        values(tables.c, step.order, h, tables.at)
        curvatures(tables.c, step.order, h, tables.size)
        if is_exact(tables, step, h, settings.tolerance):
            return h
        work[Work.REJECTED_STEPS] += 1
        h *= 0.7
    return math.nan



"""One Taylor step in regularised time: its series, its unit, and the length that the accuracy allows.

Source of the length: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order
Taylor methods, Experimental Mathematics 14 (2005), section 3.2.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined
from grasp_ros.exact.compilation.vectors import highest, larger, load, numbers_of, sizes
from grasp_ros.exact.contact.series import FIRST, expand_both, expand_one, scale_of, store_eight
from grasp_ros.exact.contact.step_unit import new_step
from grasp_ros.exact.flight.closed_form import flights_of
from grasp_ros.exact.kinematics import own_size
from grasp_ros.exact.numerics.polynomial import INVERSE, curvatures, values
from grasp_ros.exact.numerics.powers_of_two import near_exp2, near_inverse, near_log2, orders_to_one, power_of_two
from grasp_ros.exact.records import Array, Integers, Lanes, Order, Plant, Segment, Settings, State, Step, Tables
from grasp_ros.exact.tolerances import DEFECT, SMALLEST_CHANGE, STILL
from grasp_ros.physics.impact_law import STORED_ROOT
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Kind, Lane, Pair, U, V, Work, X, Z

TAIL = STORED_ROOT  # at a touch with p = 0 all coefficients between multiples of it are zero
BELOW, ABOVE = 0.5, 2.0  # length / reach, between which the changes within the reach hold for the step
FAR_BELOW, FAR_ABOVE = 2.0**-10, 2.0**5  # steps whose unit does not fit; a small unit lets terms underflow
MOST = 16  # binary orders by which a unit is changed at once
MAX_UNITS, MOST_FITS = 200, 4


@inlined
def motion_sizes(c: Array, reach: float) -> Lanes:
    """Sizes of what moves in each lane within `reach`: the largest of the first TAIL terms, which are five."""
    square = reach * reach
    cube, fourth = square * reach, square * square
    low = larger(load(c, LANES) * reach, load(c, 2 * LANES) * square)
    high = larger(load(c, 3 * LANES) * cube, load(c, 4 * LANES) * fourth)
    return numbers_of(larger(larger(low, high), load(c, 5 * LANES) * (fourth * reach)))


@inlined
def growth_up_to(c: Array, inverse: Array, n: int) -> float:
    """Binary logarithm of the inverse radius of convergence as TAIL coefficients up to n tell; -inf: they vanish."""
    growth = -math.inf
    for k in range(n - TAIL + 1, n + 1):
        largest = highest(sizes(load(c, LANES * k)) * inverse)
        if largest > 0.0:
            growth = max(growth, near_log2(largest) * INVERSE[k])
    return growth


@inlined
def step_size(c: Array, inverse: Array, order: Order) -> float:
    """Step in s / unit at which the first neglected term of a lane is the tolerated part of its size, or inf.

    With a high order earlier terms must be small, too: 52 terms of an exponential function suffice for ten time
    constants, but some of them are thousands of times as large as the change.
    """
    n = order.number
    last = numbers_of(sizes(load(c, LANES * n)))
    if not last[0] + last[1] + last[2] + last[3] + last[5] + last[6] + last[7] < math.inf:
        return 0.0  # the coefficients have left the range of numbers
    growth = growth_up_to(c, inverse, n)
    if order.early < n:
        growth = max(growth, growth_up_to(c, inverse, order.early))
    return order.first * near_exp2(-growth) if growth > -math.inf else math.inf


@inlined
def begin_series(tables: Tables, state: State) -> None:
    """Write order 0 of the series."""
    c, y, mode = tables.c, state.y, state.mode
    for lane in range(LANES):
        c[lane] = y[lane]
    c[Lane.TIME] = 0.0
    for side in (LEFT, RIGHT):
        if mode[side] == Pair.CONTACT:
            c[Z.L + side] = math.sqrt(max(y[U.L + side], 0.0))


@inlined
def expand(tables: Tables, plant: Plant, step: Step) -> None:
    """The series of a step from its order 0."""
    n = step.order.number
    if step.left and step.right:
        expand_both(tables.c, tables.f, plant.bodies, plant.pairs, step.unit, n)
    else:
        expand_one(tables.c, tables.f, plant.bodies, plant.pairs, LEFT if step.left else RIGHT, step.unit, n)


@inlined
def pulls(plant: Plant, y: Array) -> tuple[float, float, float]:
    """Sizes of the terms of the equations of the left arm, the object and the right arm, m/s^2."""
    bodies = plant.bodies
    return (own_size(bodies[LEFT], y[X.L], y[V.L]), own_size(bodies[OBJECT], y[X.O], y[V.O]),
            own_size(bodies[RIGHT], y[X.R], y[V.R]))


@inlined
def depth_size(z: float, touches: bool, size: float, moved: float) -> float:
    """Size of the lane of a pair whose u moves by `moved`."""
    if touches:
        return max(size, moved * near_inverse(2.0 * z)) if z > SMALLEST_CHANGE else size
    return max(size, moved)


@inlined
def inverse(size: float) -> float:
    """1 / size; 0 for what does not move."""
    return near_inverse(size) if size > SMALLEST_CHANGE else 0.0


@inlined
def length(tables: Tables, pulled: tuple[float, float, float], step: Step, settings: Settings, reach: float) -> float:
    """Step in s / unit at which the neglected term is `tolerance` times the change within `reach`; `pulled`: `pulls`.

    The change of a velocity is the largest of three: that in the step, the rounding of the terms of its equation, and
    a part of the rounding of the fastest velocity. A position changes with its velocity. `is_exact` tests the lane
    CHECK.
    """
    c = tables.c
    t, v_l, x_o, v_o, _, v_r, z_l, z_r = motion_sizes(c, reach)
    rounding = EPS / settings.tolerance
    still, least = STILL * rounding * max(abs(c[V.L]), abs(c[V.O]), abs(c[V.R])), rounding * t
    pull_l, pull_o, pull_r = pulled
    v_l, v_o, v_r = max(v_l, least * pull_l, still), max(v_o, least * pull_o, still), max(v_r, least * pull_r, still)
    x_o = max(x_o, t * v_o)
    z_l = depth_size(c[Z.L], step.left, z_l, t * (v_l + v_o))
    z_r = depth_size(c[Z.R], step.right, z_r, t * (v_o + v_r))
    parts = (inverse(t), inverse(v_l), inverse(x_o), inverse(v_o), 0.0, inverse(v_r), inverse(z_l), inverse(z_r))
    store_eight(tables.size, FIRST, parts)
    return step_size(c, load(tables.size, FIRST), step.order)


@inlined
def fitted_step(tables: Tables, plant: Plant, state: State, settings: Settings, step: Step, span: float
                ) -> tuple[Step, float]:
    """A step with its series, in its unit or in one that fits them, and its length in that unit, or nan.

    Most units fit at once. Coefficients of a wrong one over- or underflow, so the next unit follows from the length;
    if they vanish, the end of the span or a release ends the step. A changed unit is changed until the step is about
    1, so that the result does not depend on the first unit.
    """
    pulled = pulls(plant, state.y)  # before the series: quotients after it would be waited for
    fits = 0
    for turn in range(MAX_UNITS):
        begin_series(tables, state)
        expand(tables, plant, step)
        h = step.order.first  # where the unit is the radius of convergence
        for _ in range(2):
            reach, h = h, length(tables, pulled, step, settings, h)
            if BELOW * reach < h < ABOVE * reach or not 0.0 < h < math.inf:
                break
        fits += FAR_BELOW < h < FAR_ABOVE
        if fits > 0 and (turn == 0 or fits > MOST_FITS or orders_to_one(h, MOST) == 0):
            return step, h
        if h == math.inf:
            values(tables.c, step.order.number, 1.0, tables.at)
            apart = (step.left and tables.at[Z.L] <= 0.0) or (step.right and tables.at[Z.R] <= 0.0)
            if apart or tables.at[Lane.TIME] >= span:
                return step, 1.0
        unit = step.unit * power_of_two(orders_to_one(h, MOST))
        step = Step(step.order, unit, step.left, step.right)
    return step, math.nan


@inlined
def is_exact(tables: Tables, step: Step, h: float, tolerance: float) -> bool:
    """Whether a step of length h passes the defect test; `tables.at` and `tables.size` are those at h.

    G = w_l w_r, times the power of two of the unit, or u = w^2 with one side in contact is the lane CHECK: at the end
    of the step it differs from the product of w by neglected terms.
    """
    c, at, size = tables.c, tables.at, tables.size
    scale = scale_of(step.unit) if step.left and step.right else 1.0
    expected = (at[Z.L] if step.left else at[Z.R]) * (scale * (at[Z.R] if step.right else at[Z.L]))
    allowed = DEFECT * (tolerance + EPS) * (abs(c[Lane.CHECK]) + h * abs(c[LANES + Lane.CHECK]) + size[Lane.CHECK])
    return abs(at[Lane.CHECK] - expected) <= allowed


@inlined
def accepted_length(tables: Tables, step: Step, h: float, settings: Settings, work: Integers) -> float:
    """Length in units of a step that is exact enough, or nan; the values at its end are left in `tables.at`.

    Shortening it costs no new expansion.
    """
    for _ in range(60):
        values(tables.c, step.order.number, h, tables.at)
        curvatures(tables.c, step.order.number, h, tables.size)
        if is_exact(tables, step, h, settings.tolerance):
            return h
        work[Work.REJECTED_STEPS] += 1
        h *= 0.7
    return math.nan


@inlined
def take_step(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, work: Integers) -> Segment:
    """One Taylor step as far as it is exact; its series and the values at its end stand in the tables."""
    work[Work.CONTACT_STEPS] += 1
    step, h = fitted_step(tables, plant, state, settings, new_step(plant, state, settings, span), span)
    h = accepted_length(tables, step, h, settings, work)
    return Segment(Kind.CONTACT, tables.at[Lane.TIME], h, step, flights_of(plant, state.y, step.left, step.right))

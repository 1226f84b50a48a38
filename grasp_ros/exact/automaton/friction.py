"""Dry friction of the object: it slides against a constant force, or sticks and is a wall.

A sliding object has the friction in its constant force. A stuck one gets an infinite mass: whatever pushes it moves it
as little as a wall, in the same equations. Both are the row OBJECT of `Plant.bodies`; `Plant.given` keeps what the
scene says. This file finds when an object stops or slips; `modes.initial_slide` decides whether it then sticks.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.contact.series import expand_force
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import approach, rate_lanes
from grasp_ros.exact.numerics.polynomial import lane_bounds, values
from grasp_ros.exact.numerics.roots import first_rise, value_and_rate
from grasp_ros.exact.records import Array, Candidate, Integers, Plant, Push, State, Tables
from grasp_ros.exact.tolerances import AT_ONCE, FRICTION, SLIDES
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Of, Pair, Slide, U, V, Z


@kernel
def lift_friction(plant: Plant) -> None:
    """Reset `bodies` to `given`: no friction acts."""
    for body in range(3):
        for column in range(4):
            plant.bodies[body, column] = plant.given[body, column]


@kernel
def apply_friction(plant: Plant, mode: Integers) -> None:
    """Put the mode of the object into its row of the bodies."""
    slide, row, given = mode[OBJECT], plant.bodies[OBJECT], plant.given[OBJECT]
    row[Of.MASS] = math.inf if slide == Slide.STUCK else given[Of.MASS]
    against = -plant.coulomb if slide == Slide.RIGHTWARD else plant.coulomb  # of a FREE object: 0
    row[Of.FORCE] = 0.0 if slide == Slide.STUCK else given[Of.FORCE] + against


@kernel
def impact_noise(plant: Plant, side: Body, elastic: float, y: Array) -> float:
    """Rounding of an impact force, from its own terms; those of 1 + p u' count by their sizes, as they may cancel."""
    front, back = rate_lanes(side)
    return 0.5 * FRICTION * (elastic * (1.0 + plant.pairs[side, Law.DISSIPATION] * (abs(y[front]) + abs(y[back]))))


@kernel
def still_noise(plant: Plant) -> float:
    """Rounding of what else pushes an object at rest, and of its friction."""
    return FRICTION * (abs(plant.given[OBJECT, Of.FORCE]) + plant.coulomb)


@kernel
def impact_on_object(plant: Plant, state: State, side: Body) -> Push:
    """The impact of a pair on an object at rest."""
    elastic = elastic_force(plant.pairs[side, Law.HERTZIAN], state.y[U.L + side])
    factor = damping_factor(plant.pairs[side, Law.DISSIPATION], approach(state.y, side))
    return Push(elastic * factor, impact_noise(plant, side, elastic, state.y))


@kernel
def push_on_object(plant: Plant, state: State) -> Push:
    """The force on the object without its dry friction, by (3), and the rounding of this force and of the friction.

    An object at rest slides if the force exceeds the limit of the friction by more than the rounding.
    """
    value, rounding = 0.0, 0.0  # of both sides first, for mirror images
    for side in (LEFT, RIGHT):
        if state.mode[side] == Pair.CONTACT:
            impact = impact_on_object(plant, state, side)
            value += impact.value if side == LEFT else -impact.value
            rounding += impact.rounding
    return Push(value + plant.given[OBJECT, Of.FORCE], rounding + still_noise(plant))


@inlined
def slide_in_flight(plant: Plant, state: State) -> Candidate:
    """When a sliding object stops in flight: v' = a - c v is solved exactly."""
    slide, v = state.mode[OBJECT], state.y[V.O]
    none = Candidate(math.inf, Slide.STUCK)
    if slide == Slide.FREE:
        return none
    body = plant.bodies[OBJECT]
    a, c = body[Of.FORCE] / body[Of.MASS], body[Of.DAMPING] / body[Of.MASS]
    if v == 0.0 or a == 0.0 or (a > 0.0) == (v > 0.0):
        return none
    return Candidate(-v / a if c == 0.0 else math.log1p(-c * v / a) / c, Slide.STUCK)


@kernel
def impact_series(tables: Tables, plant: Plant, mode: Integers, n: int) -> None:
    """Write the series of the impact forces on the object up to the order n to `tables.row`.

    `tables.f`, free after the expansion of the step, is scratch.
    """
    f, row = tables.f, tables.row
    for k in range(n + 1):
        row[k] = 0.0
    for side in (LEFT, RIGHT):
        if mode[side] == Pair.CONTACT:
            expand_force(tables.c, plant.pairs, side, n, f)
            for k in range(n + 1):
                row[k] += f[k] if side == LEFT else -f[k]


@kernel
def noise_at(tables: Tables, plant: Plant, mode: Integers, n: int, s: float) -> float:
    """Rounding of the force on an object at rest, at s in a Taylor step; leaves the state there in `tables.at`."""
    at = tables.at
    values(tables.c, n, s, at)
    noise = 0.0  # of both sides first, for mirror images
    for side in (LEFT, RIGHT):
        if mode[side] == Pair.CONTACT:
            root = max(at[Z.L + side], 0.0)
            noise += impact_noise(plant, side, elastic_force(plant.pairs[side, Law.HERTZIAN], root * root), at)
    return noise + still_noise(plant)


@inlined
def impact_range(tables: Tables, plant: Plant, side: Body, h: float) -> tuple[float, float, float]:
    """Bounds (low, high) on the impact of a pair in contact on a stuck object within a step of length h, N; its size.

    The ranges of the lanes give them, and `size` is what their roundings are a part of.
    """
    c, size, at, (front, back), z = tables.c, tables.size, tables.at, rate_lanes(side), Z.L + side
    (low, high), (slow, fast) = lane_bounds(c, size, z, h, at[z]), lane_bounds(c, size, front, h, at[front])
    still, moving = lane_bounds(c, size, back, h, at[back])
    slow, fast, root = slow - moving, fast - still, max(low, 0.0)
    hertzian, loss = plant.pairs[side, Law.HERTZIAN], plant.pairs[side, Law.DISSIPATION]
    weak, strong = elastic_force(hertzian, root * root), elastic_force(hertzian, high * high)
    return (weak * max(damping_factor(loss, slow), 0.0), strong * max(damping_factor(loss, fast), 0.0),
            strong * damping_factor(loss, max(abs(slow), abs(fast))))


@inlined
def stays_stuck(tables: Tables, plant: Plant, mode: Integers, h: float) -> bool:
    """Whether bounds on the impacts, far cheaper than their series, prove that a stuck object does not slip in a step.

    `tables.at` holds the values at its end h.
    """
    push = plant.given[OBJECT, Of.FORCE]
    least, most, rounding = push, push, still_noise(plant)
    for side in (LEFT, RIGHT):
        if mode[side] == Pair.CONTACT:
            low, high, size = impact_range(tables, plant, side, h)
            least += low if side == LEFT else -high
            most += high if side == LEFT else -low
            rounding += FRICTION * size
    return max(-least, most) + rounding < plant.coulomb


@inlined
def excess(tables: Tables, plant: Plant, n: int, s: float) -> float:
    """By how much the force on the object at s, with the impacts `tables.row`, exceeds its friction, N."""
    return abs(value_and_rate(tables.row, n, s)[0] + plant.given[OBJECT, Of.FORCE]) - plant.coulomb


@kernel
def since_certain(tables: Tables, plant: Plant, mode: Integers, n: int, h: float) -> Candidate:
    """From which s on the force exceeds the friction by more than the rounding, as it does at h; by bisection."""
    low, high = 0.0, h
    while high - low > 4.0 * EPS * high and high > AT_ONCE * h:
        middle = 0.5 * (low + high)
        if excess(tables, plant, n, middle) > noise_at(tables, plant, mode, n, middle):
            high = middle
        else:
            low = middle
    push = value_and_rate(tables.row, n, high)[0] + plant.given[OBJECT, Of.FORCE]
    return Candidate(high, Slide.RIGHTWARD if push > 0.0 else Slide.LEFTWARD)


@kernel
def overcome(f: Array, n: int, h: float, noise: tuple[float, float], work: Integers) -> float:
    """First s in (0, h] at which f, the force less the friction, exceeds the rounding of f.

    `noise` is the rounding at 0 and at h. If |f(0)| is within the one at 0, that one counts, otherwise the smaller one.
    """
    if f[0] > noise[0]:
        return AT_ONCE * h
    f[0] -= noise[0] if f[0] >= -noise[0] else min(noise[0], noise[1])
    return first_rise(f, n, h, 0.0, work)


@kernel
def slip_candidate(tables: Tables, plant: Plant, n: int, h: float, noise: tuple[float, float], work: Integers
                   ) -> Candidate:
    """First s in (0, h] at which an impact on a stuck object, `tables.row` in N, overcomes the friction.

    `noise` is the rounding of the force on it, at 0 and at h. `tables.f` is scratch.
    """
    row, against = tables.row, tables.f
    push = row[0] + plant.given[OBJECT, Of.FORCE]
    for k in range(n + 1):
        against[k] = -row[k]
    row[0], against[0] = push - plant.coulomb, -push - plant.coulomb
    to_right, to_left = overcome(row, n, h, noise, work), overcome(against, n, h, noise, work)
    if to_right <= to_left or math.isnan(to_right):  # each of them may be nan: not found
        return Candidate(to_right, Slide.RIGHTWARD)
    return Candidate(to_left, Slide.LEFTWARD)


@kernel
def slide_in_contact(tables: Tables, plant: Plant, state: State, n: int, h: float, work: Integers) -> Candidate:
    """First s in a Taylor step of length h at which an object under dry friction stops or slips.

    Afterwards `tables.at` may hold the state at another s than h. An object that has just slipped is still at rest: if
    its acceleration is below half of its rounding it counts as 0, so that the next order decides. The rounding of the
    force is computed at 0 and at h, because it may be far smaller at h: then a slip that it hides at 0 is certain at h.
    """
    slide, row, c = state.mode[OBJECT], tables.row, tables.c
    if slide != Slide.STUCK:
        low, high = lane_bounds(c, tables.size, V.O, h, tables.at[V.O])
        if low > 0.0 if slide == Slide.RIGHTWARD else high < 0.0:
            return Candidate(math.inf, Slide.STUCK)
        factor = -1.0 if slide == Slide.RIGHTWARD else 1.0
        for k in range(n + 1):
            row[k] = factor * c[LANES * k + V.O]
        if row[0] == 0.0:
            accelerating = c[LANES + Lane.TIME] * push_on_object(plant, state).rounding / plant.bodies[OBJECT, Of.MASS]
            if abs(row[1]) <= SLIDES * accelerating:
                row[1] = 0.0
        return Candidate(first_rise(row, n, h, 0.0, work), Slide.STUCK)
    if stays_stuck(tables, plant, state.mode, h):
        return Candidate(math.inf, Slide.STUCK)
    impact_series(tables, plant, state.mode, n)
    noise = push_on_object(plant, state).rounding
    begin, end = excess(tables, plant, n, 0.0), excess(tables, plant, n, h)
    if begin < -noise:
        found = slip_candidate(tables, plant, n, h, (0.0, 0.0), work)
        if not found.when <= h:  # most steps
            return found
    later = noise_at(tables, plant, state.mode, n, h)
    if begin < -noise:
        if end > later:
            return found
        impact_series(tables, plant, state.mode, n)  # near the friction, not for certain above it
    found = slip_candidate(tables, plant, n, h, (noise, later), work)
    if end > later:
        impact_series(tables, plant, state.mode, n)
        return since_certain(tables, plant, state.mode, n, min(found.when, h))
    return found

"""One implicit step: how long it may be, its error, and the polynomials in t that stand for it.

The last Legendre coefficients of the polynomials tell their error. A relaxation that is not over spoils them at any
length; then that of the slower pair, a swing and a creep are resolved, if that is it, or some Taylor steps come first.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.arm_motion import accelerate
from grasp_ros.exact.collocation import (
    E_NODES,
    SUMS,
    V_NODES,
    Approach,
    Begin,
    collocate,
    motion_of,
)
from grasp_ros.exact.creeping import LENGTH, brake, least_step, longest_step, resolved_rate, slow_relaxation
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import other, reduced_mass, velocity_lane
from grasp_ros.exact.outputs import wait
from grasp_ros.exact.radau import DERIVATIVE, FIRST, STAGES, TO_LEGENDRE, TO_POWERS, times
from grasp_ros.exact.records import Array, Output, Plant, Settings, State, Tables
from grasp_ros.physics.layout import (
    CHECK,
    DAMPING,
    DISSIPATION,
    EPS,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    TIME,
    U_L,
    V_L,
    V_O,
    V_R,
    X_O,
    Body,
    Pair,
    Work,
)

FINEST = 64.0 * EPS  # part of the velocities that the last coefficients of a step may have
ROUNDINGS = 32.0  # times what is allowed: so much error may be rounding of what a step gains, and go with its length
BRIEF = 0.25  # of the least length: a step that rounding limits spares positions the roundings of many others
JUMP = 8.0  # times as much as the last coefficients weighs what is left of a relaxation at the begin


@kernel
def expand_row(tables: Tables) -> tuple[float, float]:
    """Replace values at the nodes, in `tables.row`, by coefficients of powers.

    What is below rounding is left out: powers would amplify it. Returns the size of the last two Legendre coefficients,
    and the sum of the sizes of all but the first.
    """
    f, row, n, size = tables.f, tables.row, STAGES, 0.0
    for k in range(STAGES):
        f[SUMS + k] = times(TO_LEGENDRE, k, row, FIRST, 0.0)
        size += abs(f[SUMS + k])
    last, first = max(abs(f[SUMS + STAGES - 1]), abs(f[SUMS + STAGES - 2])), abs(f[SUMS])
    while n > 1 and abs(f[SUMS + n - 1]) <= 2.0 * EPS * size:
        n -= 1
        f[SUMS + n] = 0.0
    for k in range(STAGES):
        row[k] = times(TO_POWERS, k, f, SUMS, 0.0)
    return last, size - first


@kernel
def write_lane(tables: Tables, lane: int, begin: float, h: float, rate: float) -> float:
    """Write the polynomial of a lane from its derivatives at the nodes, in `tables.row`; returns their error.

    It is that of the last coefficients, and of the first one beside the rate that the step begins with: a relaxation
    so fast that no node sees it.
    """
    c = tables.c
    last, _ = expand_row(tables)
    c[lane] = begin
    for k in range(STAGES):
        c[LANES * (k + 1) + lane] = h / (k + 1) * tables.row[k]
    return max(last, abs(tables.row[0] - rate))


@inlined
def handed_on(plant: Plant, state: State, side: Body, beside: Approach) -> float:
    """Velocity in m/s of which the object has roundings: its part of the other arm, if that pair relaxes here.

    Held by the pair on this side as well, it goes with the one that brakes it more.
    """
    if not beside.stiff:
        return 0.0
    arm = other(side)
    there, share = brake(plant, state, arm), reduced_mass(plant.bodies, arm) / plant.bodies[OBJECT, MASS]
    return there / (brake(plant, state, side) + there) * share * abs(state.y[velocity_lane(arm)])


@kernel
def write_side(tables: Tables, plant: Plant, state: State, side: Body, pair: Approach, beside: Approach, start: Begin
               ) -> float:
    """Write the lanes of an arm from the nodes; returns the error of u', relative to what is allowed of 1."""
    f, row, h = tables.f, tables.row, start.h
    nodes, largest = E_NODES + side * STAGES, 0.0
    v = V_L if side == LEFT else V_R
    accelerate(tables, plant.bodies, side, pair, beside, start, state.y[v])
    write_lane(tables, v, state.y[v], h, 0.0)
    for j in range(STAGES):
        row[j] = pair.rate * (f[nodes + j] - pair.offset)
        largest = max(largest, abs(f[nodes + j]))
    if pair.hertzian > 0.0 and not pair.rest + pair.share * f[nodes] > 0.0:  # it clamps before the first node
        return math.inf
    begin = pair.rate * (pair.e - pair.offset)
    last = write_lane(tables, U_L + side, pair.u, h, begin)
    if pair.hertzian == 0.0 or not pair.u > 0.0:
        return last / max(start.scale, abs(pair.e))
    v_end = start.v + f[V_NODES + STAGES - 1]
    d_end = pair.rate * (f[nodes + STAGES - 1] - pair.offset)
    creeping = 1024.0 * pair.rate * largest if pair.stiff else 0.0
    moving = max(abs(start.v), abs(state.y[v]), handed_on(plant, state, side, beside))
    first = max(moving, creeping)
    moving = max(moving, abs(v_end), abs(v_end + pair.sign * d_end))
    scale = max(min(max(moving, creeping), pair.u / h), 0.25 * moving)
    if pair.stiff:  # between the nodes the velocities swing about such a jump, which is seen while they are small
        last = max(last, JUMP * abs(row[0] - begin) * max(1.0, scale / first))
    return last / scale


@kernel
def write_lanes(tables: Tables, plant: Plant, state: State, left: Approach, right: Approach, start: Begin) -> float:
    """Write the polynomials of a step, in t / h, from its nodes; returns their largest error, relative."""
    c, f, row, h = tables.c, tables.f, tables.row, start.h
    for k in range(STAGES + 1):
        c[LANES * k + TIME] = c[LANES * k + CHECK] = 0.0
    for j in range(STAGES):
        row[j] = times(DERIVATIVE, j, f, V_NODES, 0.0) / h
    write_lane(tables, np.int64(V_O), start.v, h, 0.0)
    for j in range(STAGES):
        row[j] = start.v + f[V_NODES + j]
    error = write_lane(tables, np.int64(X_O), start.x, h, start.v) / start.scale
    error = max(error, write_side(tables, plant, state, LEFT, left, right, start))
    return max(error, write_side(tables, plant, state, RIGHT, right, left, start))


@inlined
def own_speed(body: Array, x: float, v: float) -> float:
    """The larger of a body's speed and the one that its spring can give it: it swings, or creeps against its damper."""
    swing = math.sqrt(body[STIFFNESS] / body[MASS])
    rate = body[STIFFNESS] / body[DAMPING] if body[DAMPING] * swing > body[STIFFNESS] else swing
    return max(abs(v), rate * abs(x))


@kernel
def velocity_scale(plant: Plant, state: State) -> float:
    """What errors of velocities are relative to, m/s: the object and the arms that push it; others fly as they like."""
    y, slowest, scale = state.y, math.inf, own_speed(plant.bodies[OBJECT], state.y[X_O], state.y[V_O])
    for side in (LEFT, RIGHT):
        if state.mode[side] == Pair.CONTACT:
            scale = max(scale, own_speed(plant.bodies[side], y[velocity_lane(side) - 1], y[velocity_lane(side)]))
            if plant.pairs[side, DISSIPATION] > 0.0:
                slowest = min(slowest, 1.0 / plant.pairs[side, DISSIPATION])
    return max(scale, slowest)


@kernel
def implicit_step(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """Length in s of an implicit step, whose polynomials it writes; 0 where Taylor steps are cheaper."""
    slower = max(slow_relaxation(plant, state), resolved_rate(plant, state, settings.rate, False))
    least, brief = least_step(plant, state), 1.0
    h, scale = longest_step(plant, state, settings.rate, span), velocity_scale(plant, state)
    allowed = FINEST + 100.0 * settings.tolerance
    longest = h
    error = before = math.inf
    while h > brief * least:
        start = Begin(h, state.y[X_O], state.y[V_O], scale)
        left, right = motion_of(plant, state, LEFT, h), motion_of(plant, state, RIGHT, h)
        error = math.inf
        if collocate(tables.f, plant.bodies, left, right, start):
            error = write_lanes(tables, plant, state, left, right, start) / allowed
        if error <= 1.0:
            return h
        out.work[Work.REJECTED_STEPS] += 1
        shorter = h * min(max(0.7 * error ** (-1.0 / (STAGES - 1)), 0.1), 0.7)
        if error > 0.03 * before or (error == math.inf and h < longest):  # not what the polynomials neglect
            if error < ROUNDINGS * max(1.0, EPS * abs(tables.f[V_NODES + STAGES - 1]) / (allowed * scale)):
                shorter, brief = 0.5 * h / error, BRIEF
            elif slower * shorter > LENGTH:
                shorter = LENGTH / slower
            else:
                break
        before, h = min(before, error), shorter
    wait(out, 0.5 * math.log(min(max(error, 1.0), 1e20)))
    return 0.0

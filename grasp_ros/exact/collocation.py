"""One implicit step of grasp and contacts by collocation at the nodes of Radau IIA, which is L-stable.

The unknowns at the nodes are v_o and, of each pair, e with u' = rate (e - offset): e = 1 + p u' in contact, u' itself
otherwise. Positions and penetrations are their integrals. So the impact force H u^1.5 e is linear in what is stiff, and
p may be as large as it likes.

Newton's matrix is an arrow: an arm depends on its own pair and on the object only. Both sides are eliminated alike and
enter the object's equation as one sum, so a mirrored grasp has mirrored roundings. Where a pair is stiff, its arm's
equation is added to the object's: the impact force, whose rounding would push both as one, drops out.

Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (1996), sections IV.5 and IV.8.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from grasp_ros.exact.elimination import eliminate, subtract
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach
from grasp_ros.exact.radau import DERIVATIVE, FIRST, INTEGRAL, NODES, STAGES, times
from grasp_ros.exact.records import Array, Plant, State
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    Body,
    Pair,
)

WIDTH = 2 * STAGES + 1  # columns of a side: its e, v_o, right-hand side
MATRIX = 2 * STAGES * WIDTH  # of the object: v_o, right-hand side
E_NODES = MATRIX + STAGES * (STAGES + 1)  # then rows of values at the nodes, by side
U_NODES, BY_E, BY_U = (E_NODES + 2 * STAGES * i for i in range(1, 4))  # of the impact force: its derivatives
OWN_NODES, IMPACT_NODES = (E_NODES + 2 * STAGES * i for i in range(4, 6))  # forces on the arms
V_NODES = E_NODES + 12 * STAGES  # of the object, less v_o at the begin
X_NODES = V_NODES + STAGES
SUMS = X_NODES + STAGES  # of each side, a row of the object's matrix
WORKSPACE = int(SUMS + 2 * (STAGES + 1))
ROW = int(STAGES) + 1  # one polynomial
CLOSE = 1e-7  # correction after which Newton's next one is below rounding
SHRINKS = 0.1  # part of a correction that the next one of Newton's has, unless both are rounding
NEAR, TINY = 0.01, 1e-12  # where both exceed these, what is not linear and the correction, it is no rounding
MAX_CORRECTIONS = 10


class Approach(NamedTuple):
    """One pair in an implicit step: u' = rate (e - offset), and its impact force H u^1.5 (rest + share e)."""

    sign: float  # +1 left, -1 right: u = sign (x - x_o)
    rate: float  # 1 / p, or 1; m/s
    offset: float  # 1, or 0
    e: float  # at the begin of the step
    u: float
    hertzian: float
    rest: float
    share: float
    stiff: bool  # whether it relaxes within the step


class Begin(NamedTuple):
    """Where an implicit step of h s begins."""

    h: float
    x: float  # of the object, m
    v: float
    scale: float  # of velocities, m/s


@inlined
def motion_of(plant: Plant, state: State, side: Body, h: float) -> Approach:
    """One pair in the unknowns of an implicit step of h s."""
    pair, d, u = plant.pairs[side], approach(state.y, side), state.y[U_L + side]
    sign, loss = 1.0 if side == LEFT else -1.0, pair[DISSIPATION]
    hertzian = pair[HERTZIAN] if state.mode[side] == Pair.CONTACT else 0.0
    if h * loss * elastic_force(hertzian, max(u, 0.0)) > plant.bodies[side, MASS]:
        return Approach(sign, 1.0 / loss, 1.0, damping_factor(loss, d), u, hertzian, 0.0, 1.0, True)
    return Approach(sign, 1.0, 0.0, d, u, hertzian, 1.0, loss, False)


@inlined
def penetration_at(f: Array, side: Body, pair: Approach, h: float, j: int) -> float:
    """u of a pair at a node of a step of h s, m."""
    return pair.u + h * pair.rate * times(INTEGRAL, j, f, E_NODES + side * STAGES, pair.offset)


@inlined
def impact_at(f: Array, side: Body, pair: Approach, h: float, j: int) -> float:
    """Impact force of a pair at a node, N."""
    u = max(penetration_at(f, side, pair, h, j), 0.0)
    return elastic_force(pair.hertzian, u) * (pair.rest + pair.share * f[E_NODES + side * STAGES + j])


@kernel
def linearise_object(f: Array, body: Array, start: Begin) -> None:
    """The object's equation at the nodes without impacts: positions, matrix and right-hand side."""
    m, k, c, h = body[MASS], body[STIFFNESS], body[DAMPING], start.h
    for j in range(STAGES):
        row = MATRIX + j * (STAGES + 1)
        x = start.x + h * (NODES[j] * start.v + times(INTEGRAL, j, f, V_NODES, 0.0))
        f[X_NODES + j] = x
        inertia = m / h * times(DERIVATIVE, j, f, V_NODES, 0.0)
        for i in range(STAGES):
            f[row + i] = m / h * DERIVATIVE[j, i] + k * h * INTEGRAL[j, i]
        f[row + j] += c
        f[row + STAGES] = body[FORCE] - ((inertia + c * (start.v + f[V_NODES + j])) + k * x)


@kernel
def linearise_side(f: Array, side: Body, pair: Approach, body: Array, start: Begin) -> None:
    """An arm's equation at the nodes, and what the object needs of it: forces and derivatives of the impact."""
    m, k, c, h = body[MASS] / start.h, body[STIFFNESS], body[DAMPING], start.h
    e_nodes = E_NODES + side * STAGES
    for j in range(STAGES):
        at, row = side * STAGES + j, (side * STAGES + j) * WIDTH
        e, v, x = f[E_NODES + at], f[V_NODES + j], f[X_NODES + j]
        u = penetration_at(f, side, pair, h, j)
        root = math.sqrt(max(u, 0.0))
        elastic, factor = pair.hertzian * (max(u, 0.0) * root), pair.rest + pair.share * e
        by_e, by_u = elastic * pair.share, 1.5 * pair.hertzian * root * factor
        inertia = m * (pair.sign * times(DERIVATIVE, j, f, V_NODES, 0.0)
                       + pair.rate * times(DERIVATIVE, j, f, e_nodes, pair.e))
        own = (pair.sign * body[FORCE] - inertia) - (
            c * (pair.sign * (start.v + v) + pair.rate * (e - pair.offset)) + k * (pair.sign * x + u))
        f[U_NODES + at], f[BY_E + at], f[BY_U + at] = u, by_e, by_u
        f[OWN_NODES + at], f[IMPACT_NODES + at] = own, elastic * factor
        for i in range(STAGES):
            f[row + i] = pair.rate * (m * DERIVATIVE[j, i] + (k + by_u) * h * INTEGRAL[j, i])
            f[row + STAGES + i] = pair.sign * (m * DERIVATIVE[j, i] + k * h * INTEGRAL[j, i])
        f[row + j] += c * pair.rate + by_e
        f[row + STAGES + j] += pair.sign * c
        f[row + 2 * STAGES] = own - elastic * factor


@kernel
def sum_side(f: Array, side: Body, pair: Approach, body: Array, h: float, j: int) -> None:
    """What a side, after its elimination, adds to row j of the object's equation."""
    out, at = SUMS + side * (STAGES + 1), side * STAGES + j
    m, k, c = body[MASS] / h, body[STIFFNESS], body[DAMPING]
    for i in range(STAGES):
        f[out + i] = m * DERIVATIVE[j, i] + k * h * INTEGRAL[j, i] if pair.stiff else 0.0
    if pair.stiff:
        f[out + j] += c
    f[out + STAGES] = pair.sign * (f[OWN_NODES + at] if pair.stiff else f[IMPACT_NODES + at])
    for n in range(STAGES):
        if pair.stiff:
            by_e = pair.rate * (m * DERIVATIVE[j, n] + k * h * INTEGRAL[j, n] + (c if n == j else 0.0))
        else:
            by_e = -(f[BY_U + at] * h * pair.rate * INTEGRAL[j, n] + (f[BY_E + at] if n == j else 0.0))
        by_e *= pair.sign
        row = (side * STAGES + n) * WIDTH + STAGES
        subtract(f, out, row, by_e, STAGES + 1)


@kernel
def correct_side(f: Array, side: Body, pair: Approach, start: Begin) -> tuple[float, float]:
    """Move the nodes of a side by Newton's correction; returns its size, relative, and that of what is not linear."""
    largest, size, bent = 0.0, 0.0, 0.0
    for j in range(STAGES):
        at, row = side * STAGES + j, (side * STAGES + j) * WIDTH + STAGES
        step = f[row + STAGES]
        for i in range(STAGES):
            step -= f[row + i] * f[MATRIX + i * (STAGES + 1) + STAGES]
        f[E_NODES + at] += step
        largest, size = max(largest, abs(f[E_NODES + at])), size + abs(step)  # a sum keeps nan
        bent = max(bent, 1.0 / f[U_NODES + at])
    if pair.hertzian == 0.0:
        return size / max(start.scale, abs(pair.e)), 0.0
    size_of_force = pair.rest + pair.share * largest
    bent = size * max(start.h * pair.rate * bent, pair.share / size_of_force)
    return size / (largest + CLOSE * (start.scale / pair.rate) if pair.stiff else start.scale), bent


@kernel
def first_guess(pair: Approach, h: float) -> float:
    """A value of e for Newton to start from: the one at the begin, as far as it leaves u positive."""
    if not pair.stiff:
        return pair.e
    room = 0.3 * pair.u / (h * pair.rate)
    return pair.offset + min(max(pair.e - pair.offset, -room), room)


@kernel
def sum_sides(f: Array, bodies: Array, left: Approach, right: Approach, h: float) -> bool:
    """Add both sides, after their elimination, to the object's equation, and solve it."""
    for j in range(STAGES):
        row = MATRIX + j * (STAGES + 1)
        sum_side(f, LEFT, left, bodies[LEFT], h, j)
        sum_side(f, RIGHT, right, bodies[RIGHT], h, j)
        for i in range(STAGES + 1):
            f[row + i] += f[SUMS + i] + f[SUMS + STAGES + 1 + i]
    return eliminate(f, MATRIX, STAGES + 1)


@kernel
def collocate(f: Array, bodies: Array, left: Approach, right: Approach, start: Begin) -> bool:
    """Solve the equations of one implicit step for the values at its nodes, by Newton; whether that succeeded."""
    for j in range(STAGES):
        f[V_NODES + j] = 0.0
        f[E_NODES + j], f[E_NODES + STAGES + j] = first_guess(left, start.h), first_guess(right, start.h)
    before = math.inf
    for _ in range(MAX_CORRECTIONS):
        linearise_object(f, bodies[OBJECT], start)
        linearise_side(f, LEFT, left, bodies[LEFT], start)
        linearise_side(f, RIGHT, right, bodies[RIGHT], start)
        if not (eliminate(f, FIRST, WIDTH) and eliminate(f, STAGES * WIDTH, WIDTH)):
            return False
        size = 0.0
        if bodies[OBJECT, MASS] < math.inf:
            if not sum_sides(f, bodies, left, right, start.h):
                return False
        else:
            for j in range(STAGES):
                f[MATRIX + j * (STAGES + 1) + STAGES] = 0.0
        for j in range(STAGES):
            step = f[MATRIX + j * (STAGES + 1) + STAGES]
            f[V_NODES + j] += step
            size += abs(step) / start.scale
        size_l, bent_l = correct_side(f, LEFT, left, start)
        size_r, bent_r = correct_side(f, RIGHT, right, start)
        size, bent = size + (size_l + size_r), bent_l + bent_r
        rounding = bent >= SHRINKS * before and (bent <= NEAR or size <= TINY)
        if size <= CLOSE and (bent <= CLOSE or rounding):
            return True
        before = bent
        if not size < math.inf:
            return False
    return False

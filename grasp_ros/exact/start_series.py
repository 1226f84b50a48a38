"""The power series of a contact that begins at u = 0, in the fourth root of the time.

While u grows with t^n, n = 1 from an approach, 2 to 6 from rest, 7/2 where the other pair has just touched, the force
grows with t^(3n/2). All of these are powers of t^(1/4): with t = T s^4 everything is a power series in s, u = s^a U
with a = 4 n and U(0) > 0, w = sqrt(u) = s^(a/2) W. The coefficients follow from each other, order by order; the only
products are those of W^2 = U and of the force H U W (1 + p u'), and they need coefficients that are known long before.
"""

from __future__ import annotations

import math

from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import rate_lanes
from grasp_ros.exact.records import Array, Plant, Settings, Start
from grasp_ros.exact.rest import DOUBT
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Body,
)

NONE = -1  # power of a pair that does not begin
ALIKE = -1000  # of one whose arm and object move alike, beyond all orders
POWERS = 4  # s^4 = t / T
ROWS = 4  # of each pair in the table of factors: W, U W, 1 + p u', and the product of the last two
DECIDES = 0.5  # of the leading term: what all others together may come to
SETTLED = 0.95  # part of a reach that the next one has: what moves grows with up to its 25th power
MAX_PASSES = 100


@kernel
def own_factors(f: Array, c: Array, n: int, k: int, side: Body, a: int, loss: float, stride: int) -> None:
    """Coefficients k of W, U W, 1 + p u' and their product; only every `stride`-th coefficient is not 0."""
    root, cube, damped = rows_of(n, side)
    front, back = rate_lanes(side)
    forces = damped + n + 1
    f[damped + k] = (1.0 if k == 0 else 0.0) + loss * (c[LANES * k + front] - c[LANES * k + back])
    lane = U_L + side
    total = c[LANES * (k + a) + lane]
    if k == 0:
        f[root] = math.sqrt(total)
    else:
        for j in range(stride, k, stride):
            total -= f[root + j] * f[root + k - j]
        f[root + k] = total / (2.0 * f[root]) if f[root] > 0.0 else 0.0  # what has underflowed pushes nothing
    cubed = 0.0
    for j in range(0, k + 1, stride):
        cubed += c[LANES * (j + a) + lane] * f[root + k - j]
    f[cube + k] = cubed
    force = 0.0
    for j in range(0, k + 1, stride):
        force += f[cube + j] * f[damped + k - j]
    f[forces + k] = force


@inlined
def rows_of(n: int, side: Body) -> tuple[int, int, int]:
    """Where the first three rows of a pair begin in the table of factors."""
    first = ROWS * (n + 1) * side
    return first, first + n + 1, first + 2 * (n + 1)


@kernel
def force_of(f: Array, n: int, k: int, side: Body, a: int) -> float:
    """Coefficient k of the force over H: those of s^(3a/2) U W (1 + p u')."""
    own = k - 3 * a // 2
    return f[rows_of(n, side)[2] + n + 1 + own] if a >= 0 and own >= 0 else 0.0


@kernel
def expand_start(start: Start, plant: Plant, y: Array, n: int, left: int, right: int, scale: float, doubt: float
                 ) -> None:
    """Write the coefficients of all quantities of the state up to the order n.

    `left`, `right`: a of the pairs; -a for one that parts from rest, or moves as if without force; ALIKE or NONE for
    one that does neither. `doubt`: rounding of what pushes the object, N.
    """
    c, f, pairs = start.c, start.f, plant.pairs
    c[:] = 0.0
    f[:] = 0.0
    for lane in range(LANES):
        c[lane] = y[lane]
    begin_l, begin_r = abs(left), abs(right)  # what stands before the first power is rounding
    # With whole powers of t in u all forces are powers of its square root: s^(3a/2), a = 4, 8 ...
    stride = 2 if max(left, 0) % POWERS == 0 and max(right, 0) % POWERS == 0 else 1
    for k in range(0, n + 1 - POWERS, stride):
        for side in (LEFT, RIGHT):
            a = left if side == LEFT else right
            own = k - 3 * a // 2
            if a >= 0 and own >= 0:
                own_factors(f, c, n, own, side, a, pairs[side, DISSIPATION], stride)
        force_l = pairs[LEFT, HERTZIAN] * force_of(f, n, k, LEFT, left)
        force_r = pairs[RIGHT, HERTZIAN] * force_of(f, n, k, RIGHT, right)
        share = POWERS * scale / (k + POWERS)
        i, following = LANES * k, LANES * (k + POWERS)
        one = 1.0 if k == 0 else 0.0
        c[following + V_L] = share * pushed(plant.bodies[LEFT], one, c[i + X_L], c[i + V_L], -force_l)
        c[following + V_R] = share * pushed(plant.bodies[RIGHT], one, c[i + X_R], c[i + V_R], force_r)
        a_o = pushed(plant.bodies[OBJECT], one, c[i + X_O], c[i + V_O], force_l - force_r)
        slips = k == 0 and plant.coulomb > 0.0 and y[V_O] == 0.0  # within rounding the next order decides
        if slips and abs(a_o) * plant.bodies[OBJECT, MASS] <= doubt:
            a_o = 0.0
        c[following + V_O] = share * a_o
        force = abs(force_l) + abs(force_r)
        wait_alike(c, plant, k, share, k + 2 * POWERS < begin_l, k + 2 * POWERS < begin_r, force)
        c[following + X_L], c[following + X_R] = share * c[i + V_L], share * c[i + V_R]
        c[following + X_O] = share * c[i + V_O]
        if k + POWERS >= begin_l:
            c[following + U_L] = share * (c[i + V_L] - c[i + V_O])
        if k + POWERS >= begin_r:
            c[following + U_R] = share * (c[i + V_O] - c[i + V_R])


@inlined
def wait_alike(c: Array, plant: Plant, k: int, share: float, left: bool, right: bool, force: float) -> None:
    """Both bodies of a pair move alike until its u begins, if what tells them apart is rounding.

    A strong damper would enlarge it. What they have in common is known best from the body whose terms are smaller; if
    all three move alike, from the object. If it is no rounding, the force of the other pair has overtaken it.
    """
    if not (left or right):
        return
    i, following = LANES * k, LANES * (k + POWERS)
    one = 1.0 if k == 0 else 0.0
    size_o = sizes(plant.bodies[OBJECT], one, c[i + X_O], c[i + V_O], force)
    size_l = sizes(plant.bodies[LEFT], one, c[i + X_L], c[i + V_L], 0.0)
    size_r = sizes(plant.bodies[RIGHT], one, c[i + X_R], c[i + V_R], 0.0)
    per = DOUBT * abs(share)
    left = left and abs(c[following + V_L] - c[following + V_O]) <= per * (size_l + size_o)
    right = right and abs(c[following + V_R] - c[following + V_O]) <= per * (size_r + size_o)
    if left and not right and size_l < size_o:
        c[following + V_O] = c[following + V_L]
    if right and not left and size_r < size_o:
        c[following + V_O] = c[following + V_R]
    if left:
        c[following + V_L] = c[following + V_O]
    if right:
        c[following + V_R] = c[following + V_O]


@inlined
def sizes(body: Array, one: float, x: float, v: float, force: float) -> float:
    """The sum of the sizes of the terms of `pushed`."""
    return (abs(one * body[FORCE]) + abs(body[STIFFNESS] * x) + abs(body[DAMPING] * v) + abs(force)) / body[MASS]


@kernel
def pushed(body: Array, one: float, x: float, v: float, force: float) -> float:
    """A coefficient of x'' of a body, (1) to (3); `one` is 1 in order 0, then 0."""
    return ((one * body[FORCE] - body[STIFFNESS] * x) - body[DAMPING] * v + force) / body[MASS]


@kernel
def reach_beside(c: Array, n: int, settings: Settings, tail: int, within: float) -> float:
    """s at which what the series neglect is a part `tolerance` of what moves `within` s; from the last coefficients."""
    growth = 0.0
    for lane in range(LANES):
        largest, power = 0.0, 1.0
        for k in range(1, n + 1 - tail):
            power *= within
            largest = max(largest, abs(c[LANES * k + lane]) * power)
        for k in range(n + 1 - tail, n + 1):
            if not math.isfinite(c[LANES * k + lane]):
                return 0.0
            if largest > 0.0:
                growth = max(growth, (abs(c[LANES * k + lane]) / largest) ** (1.0 / k))
    return settings.tolerance ** (1.0 / (n + 1)) / growth if growth > 0.0 else math.inf


@kernel
def reach_of(c: Array, n: int, settings: Settings, tail: int) -> float:
    """How far the series reach in s: what they neglect there is small beside what moves until there."""
    reach = reach_beside(c, n, settings, tail, 1.0)
    for _ in range(MAX_PASSES):
        again = reach_beside(c, n, settings, tail, reach) if reach < math.inf else reach
        if again >= SETTLED * reach:
            return min(again, reach)
        reach = again
    return reach


@kernel
def leads(c: Array, n: int, lane: int, first: int, h: float, weighted: bool) -> bool:
    """Whether the term `first` of a lane outweighs all that oppose it in (0, h].

    Weighted: all others, also in its derivative, because the root of a force is expanded about it.
    """
    rest, sign = 0.0, math.copysign(1.0, c[LANES * first + lane])
    for k in range(n, first, -1):
        term = c[LANES * k + lane]
        rest = rest * h + (k * abs(term) if weighted else max(-sign * term, 0.0))
    return rest * h <= DECIDES * abs(c[LANES * first + lane]) * (first if weighted else 1)


@kernel
def first_of(c: Array, n: int, lane: int) -> int:
    """The first order at which a lane has a coefficient."""
    for k in range(n):
        if c[LANES * k + lane] != 0.0:
            return k
    return n


@kernel
def damped_leads(c: Array, plant: Plant, n: int, side: Body, h: float) -> bool:
    """Whether 1 + p u' keeps its sign in (0, h]."""
    front, back = rate_lanes(side)
    loss = plant.pairs[side, DISSIPATION]
    rest = 0.0
    for k in range(n, 0, -1):
        rest = rest * h + abs(c[LANES * k + front] - c[LANES * k + back])
    return loss * rest * h <= DECIDES * abs(1.0 + loss * (c[front] - c[back]))



"""The motion of an arm in an implicit step: its accelerations at the nodes, from what tells them best.

From forces a slow arm keeps digits that v_o and u' do not have. But H u^1.5 (1 + p u') has lost its own where 1 + p u'
nearly vanishes. Then v_o and u' tell the arm, or, of one that is heavier than the object, what moves the object.
"""

from __future__ import annotations

from grasp_ros.exact.collocation import E_NODES, MATRIX, V_NODES, Approach, Begin, impact_at, penetration_at
from grasp_ros.exact.elimination import eliminate
from grasp_ros.exact.impact import elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.radau import DERIVATIVE, INTEGRAL, NODES, STAGES, times
from grasp_ros.exact.records import Array, Tables
from grasp_ros.physics.layout import DAMPING, FORCE, LEFT, MASS, OBJECT, RIGHT, STIFFNESS, Body


@inlined
def drives(pair: Approach, h: float, body: Array) -> bool:
    """Whether an impact moves a body as u' asks, so that its force has lost its digits."""
    return bool(h * pair.share * elastic_force(pair.hertzian, max(pair.u, 0.0)) > pair.rate * body[MASS])


@inlined
def by_object(bodies: Array, side: Body, pair: Approach, other: Approach, h: float) -> bool:
    """Whether the motion of the object tells the impact on a heavier arm best; the other one has its digits then."""
    middle = bodies[OBJECT]
    return bool(bodies[side, MASS] > middle[MASS]) and drives(pair, h, middle) and not drives(other, h, middle)


@inlined
def place_at(f: Array, start: Begin, j: int) -> float:
    """x_o at a node, m."""
    return float(start.x + start.h * (NODES[j] * start.v + times(INTEGRAL, j, f, V_NODES, 0.0)))


@inlined
def push_at(f: Array, bodies: Array, side: Body, pair: Approach, other: Approach, start: Begin, j: int) -> float:
    """Force of a side on the object at a node, N."""
    if not by_object(bodies, side, pair, other, start.h):
        return float(pair.sign * impact_at(f, side, pair, start.h, j))
    middle = bodies[OBJECT]
    inertia = middle[MASS] / start.h * times(DERIVATIVE, j, f, V_NODES, 0.0)
    own = middle[FORCE] - middle[DAMPING] * (start.v + f[V_NODES + j]) - middle[STIFFNESS] * place_at(f, start, j)
    return float((inertia - own) - other.sign * impact_at(f, RIGHT if side == LEFT else LEFT, other, start.h, j))


@inlined
def by_forces(bodies: Array, side: Body, pair: Approach, other: Approach, h: float) -> bool:
    """Whether forces tell the acceleration of an arm better than v_o and u'."""
    return not pair.stiff or by_object(bodies, side, pair, other, h)


@inlined
def acceleration(f: Array, bodies: Array, side: Body, pair: Approach, other: Approach, start: Begin, j: int) -> float:
    """Acceleration of an arm at a node, m/s^2; from forces it is without that of its damper."""
    h, nodes, body = start.h, E_NODES + side * STAGES, bodies[side]
    if not by_forces(bodies, side, pair, other, h):
        faster = pair.sign * (pair.rate * times(DERIVATIVE, j, f, nodes, pair.e))
        return float((times(DERIVATIVE, j, f, V_NODES, 0.0) + faster) / h)
    x = place_at(f, start, j) + pair.sign * penetration_at(f, side, pair, h, j)
    push = push_at(f, bodies, side, pair, other, start, j)
    return float((body[FORCE] - body[STIFFNESS] * x - push) / body[MASS])


@kernel
def damp(tables: Tables, rate: float, v: float, h: float) -> None:
    """Add -rate v to the accelerations at the nodes, in `tables.row`; v begins at `v` and is their integral.

    The equations are never singular: the matrix of an even number of stages has no real eigenvalues.
    """
    f, row = tables.f, tables.row
    for j in range(STAGES):
        at = MATRIX + j * (STAGES + 1)
        for i in range(STAGES):
            f[at + i] = rate * h * INTEGRAL[j, i]
        f[at + j] += 1.0
        f[at + STAGES] = row[j] - rate * v
    eliminate(f, MATRIX, STAGES + 1)
    for j in range(STAGES):
        row[j] = f[MATRIX + j * (STAGES + 1) + STAGES]

"""The motion of an arm in an implicit step: its accelerations at the nodes, from what tells them best.

From forces a slow arm keeps digits that v_o and u' do not have. But H u^1.5 (1 + p u') has lost its own where 1 + p u'
nearly vanishes. Then v_o and u' tell the arm, or, of one that is heavier than all beside it, what moves the others.
"""

from __future__ import annotations

from grasp_ros.exact.collocation import E_NODES, MATRIX, V_NODES, Approach, Begin, impact_at, penetration_at
from grasp_ros.exact.elimination import eliminate
from grasp_ros.exact.impact import elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.radau import DERIVATIVE, INTEGRAL, NODES, STAGES, times
from grasp_ros.exact.records import Array, Tables
from grasp_ros.physics.layout import DAMPING, FORCE, MASS, OBJECT, STIFFNESS, Body


@inlined
def speed(pair: Approach, start: Begin) -> float:
    """What roundings of u' are relative to, m/s."""
    return max(pair.rate * max(abs(pair.e - pair.offset), pair.offset), abs(start.v))


@inlined
def doubt(bodies: Array, side: Body, pair: Approach, start: Begin) -> float:
    """Impulse in N s, by EPS, that roundings of u' leave open: of an arm, or of what moves as u' asks if less."""
    grip = start.h * pair.share * elastic_force(pair.hertzian, max(pair.u, 0.0)) / pair.rate
    return float(min(bodies[side, MASS], grip) * speed(pair, start))


@inlined
def by_object(bodies: Array, side: Body, pair: Approach, beside: Approach, start: Begin) -> bool:
    """Whether the motions of the object and of the pair beside tell an impact better than its own u'."""
    others = max(bodies[OBJECT, MASS] * speed(pair, start), doubt(bodies, other(side), beside, start))
    return bool(others < doubt(bodies, side, pair, start))


@inlined
def place_at(f: Array, start: Begin, j: int) -> float:
    """x_o at a node, m."""
    return float(start.x + start.h * (NODES[j] * start.v + times(INTEGRAL, j, f, V_NODES, 0.0)))


@inlined
def by_pair(f: Array, side: Body, pair: Approach, start: Begin, j: int) -> float:
    """Acceleration of an arm at a node, m/s^2, from v_o and u'."""
    faster = pair.sign * (pair.rate * times(DERIVATIVE, j, f, E_NODES + side * STAGES, pair.e))
    return float((times(DERIVATIVE, j, f, V_NODES, 0.0) + faster) / start.h)


@inlined
def own_force(f: Array, body: Array, side: Body, pair: Approach, start: Begin, j: int) -> float:
    """Force on an arm at a node, N, without those of its damper and of the impact."""
    x = place_at(f, start, j) + pair.sign * penetration_at(f, side, pair, start.h, j)
    return float(body[FORCE] - body[STIFFNESS] * x)


@inlined
def push_of_pair(f: Array, bodies: Array, side: Body, pair: Approach, start: Begin, j: int) -> float:
    """Force of a pair on the object at a node, N; of one that relaxes within the step, from the motion of its arm."""
    if not pair.stiff:
        return float(pair.sign * impact_at(f, side, pair, start.h, j))
    faster = pair.rate * (f[E_NODES + side * STAGES + j] - pair.offset)
    v, body = start.v + f[V_NODES + j] + pair.sign * faster, bodies[side]
    own = own_force(f, body, side, pair, start, j) - body[DAMPING] * v
    return float(own - body[MASS] * by_pair(f, side, pair, start, j))


@inlined
def push_of_object(f: Array, bodies: Array, side: Body, beside: Approach, start: Begin, j: int) -> float:
    """Force of a side on the object at a node, N, from the motion of the object and the pair beside."""
    middle = bodies[OBJECT]
    inertia = middle[MASS] / start.h * times(DERIVATIVE, j, f, V_NODES, 0.0)
    own = middle[FORCE] - middle[DAMPING] * (start.v + f[V_NODES + j]) - middle[STIFFNESS] * place_at(f, start, j)
    return float((inertia - own) - push_of_pair(f, bodies, other(side), beside, start, j))


@inlined
def by_forces(f: Array, bodies: Array, side: Body, pair: Approach, beside: Approach, start: Begin, told: bool, j: int
              ) -> float:
    """Acceleration of an arm at a node, m/s^2, without that of its damper; `told` by the others, or by the impact."""
    push = push_of_object(f, bodies, side, beside, start, j) if told else push_of_pair(f, bodies, side, pair, start, j)
    return float((own_force(f, bodies[side], side, pair, start, j) - push) / bodies[side, MASS])


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


@kernel
def accelerate(tables: Tables, bodies: Array, side: Body, pair: Approach, beside: Approach, start: Begin, v: float
               ) -> None:
    """Write the accelerations of an arm that begins with v to `tables.row`, m/s^2."""
    f, row, body = tables.f, tables.row, bodies[side]
    told = by_object(bodies, side, pair, beside, start)
    if pair.stiff and not told:
        for j in range(STAGES):
            row[j] = by_pair(f, side, pair, start, j)
        return
    for j in range(STAGES):
        row[j] = by_forces(f, bodies, side, pair, beside, start, told, j)
    if body[DAMPING] != 0.0:
        damp(tables, body[DAMPING] / body[MASS], v, start.h)

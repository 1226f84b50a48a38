"""A motion that has come to rest: it moves by less than REST of the scale of the scene, and will not start again.

Positions and velocities are relative to the largest position and the largest energy with which an interval has begun,
or to those that springs hold now.
"""

from __future__ import annotations

from grasp_ros.exact.automaton.friction import impact_on_object
from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.impact import elastic_slope
from grasp_ros.exact.kinematics import own_acceleration, own_size
from grasp_ros.exact.records import Level, Plant, State
from grasp_ros.exact.tolerances import DERIVATIVE, REST
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, Slide, U, V, X

ENERGY, LENGTH, SINCE = range(3)  # columns of `State.rest`: J of V and m, so far, and the time of rest in s


@inlined
def keep_scale(state: State, begin: Level) -> None:
    """Remember the largest energy and position with which an interval has begun."""
    y, rest = state.y, state.rest
    rest[ENERGY] = max(rest[ENERGY], begin.size)
    rest[LENGTH] = max(rest[LENGTH], abs(y[X.L]), abs(y[X.O]), abs(y[X.R]))


@kernel
def stays(plant: Plant, state: State, body: Body) -> bool:
    """Whether a body stays where it is, but for a part REST of the largest position.

    A spring or a contact holds what is near its balance; a body without either rests if nothing moves it at all.
    Dry friction holds an object that sticks, whatever pushes it, as long as all others stay.
    """
    if body == OBJECT and state.mode[OBJECT] == Slide.STUCK:
        return True
    row, lane = plant.bodies[body], velocity_lane(body)
    x, v, push, held = state.y[lane - 1], state.y[lane], 0.0, 0.0
    if row[Of.DAMPING] < 0.0:
        return False
    for side in (LEFT, RIGHT):
        if state.mode[side] == Pair.CONTACT and body in (side, OBJECT):
            force = impact_on_object(plant, state, side).value
            push += force if (side == LEFT) == (body == OBJECT) else -force
            held += elastic_slope(plant.pairs[side, Law.HERTZIAN], max(state.y[U.L + side], 0.0))
    stiffness = row[Of.STIFFNESS] + held
    a = own_acceleration(row, x, 0.0) + push / row[Of.MASS]  # a damper holds nothing
    if stiffness > 0.0:
        return bool(abs(a) * row[Of.MASS] <= stiffness * REST * max(state.rest[LENGTH], abs(x)))
    return bool(v == 0.0 and abs(a) <= DERIVATIVE * own_size(row, x, v))


@inlined
def rests(plant: Plant, state: State) -> bool:
    """Whether everything is at rest for as long as the inputs stay the same.

    That no body moves any more comes first: most segments need to know no more. A motion may begin without energy; then
    the energy that a spring holds is the scale.
    """
    y, given = state.y, plant.given
    held = max(given[LEFT, Of.STIFFNESS] * y[X.L] * y[X.L], given[RIGHT, Of.STIFFNESS] * y[X.R] * y[X.R])
    most = REST * REST * max(state.rest[ENERGY], held)
    return (given[LEFT, Of.MASS] * y[V.L] * y[V.L] <= most and given[RIGHT, Of.MASS] * y[V.R] * y[V.R] <= most
            and given[OBJECT, Of.MASS] * y[V.O] * y[V.O] <= most
            and stays(plant, state, LEFT) and stays(plant, state, OBJECT) and stays(plant, state, RIGHT))

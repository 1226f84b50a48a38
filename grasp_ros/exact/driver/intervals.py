"""The intervals of a run: what acts in each of them, and the controllers that answer at its begin.

Inputs are constant within an interval. In a sampled loop it is a control period: each controller measures its arm,
answers, and the command waits for the periods of the delay. Under continuous feedback an interval lasts until an
external force changes; without one it is the whole run.
"""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.modes import begin_interval
from grasp_ros.exact.compensated import put
from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.driver.rest import SINCE
from grasp_ros.exact.driver.user_controller import call
from grasp_ros.exact.kinematics import arm_of
from grasp_ros.exact.records import Array, Loop, Output, Plant, State
from grasp_ros.physics import control
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Answer, Cursor, Of, Outcome, V

FIRST = whole(0)  # interval
is_due, measured = kernel(control.is_due), kernel(control.measured)
feedback, limited = kernel(control.feedback), kernel(control.limited)


@inlined
def answer(state: State, loop: Loop, k: int) -> bool:
    """Write what the controllers answer to the state at the begin of interval k; whether all of it is a number.

    A scene's own law may answer inf or nan to a state that overflows: the run then ends with a status.
    """
    for side in (LEFT, RIGHT):
        callee, row = loop.callee[side], loop.laws[side]
        if callee == Answer.GIVEN:
            continue
        if not is_due(row, loop.cursor[Cursor.TICK] + k):
            loop.answers[k, side] = loop.held[side]
            continue
        x, v, _ = arm_of(state.y, side)
        x, v = measured(row, loop.normals[side, min(k, loop.normals.shape[1] - 1)], x, v)
        if callee == Answer.LAW:
            force = feedback(row, x, v)
        else:
            force = call(callee, loop.cursor[Cursor.TICK] + k, state.clock[2], x, v)
            if not math.isfinite(force):
                loop.cursor[Cursor.FAILED] = side
                return False
        loop.held[side] = loop.answers[k, side] = limited(row, force)
    return True


@inlined
def set_inputs(plant: Plant, loop: Loop, k: int) -> None:
    """Let the commands that arrive at the begin of interval k act, and the external forces."""
    held, pushed, delay = loop.answers.shape[0] > 0, loop.external.shape[0] > 0, loop.waiting.shape[0]
    slot = (loop.cursor[Cursor.TICK] + k) % delay if delay > 0 else 0
    for body in (LEFT, RIGHT, OBJECT):
        force = loop.answers[k, body] if held else 0.0
        if delay > 0:
            force, loop.waiting[slot, body] = loop.waiting[slot, body], force
        if pushed:  # -0.0 + 0.0 is another bit pattern
            force = force + loop.external[k, body] if held else loop.external[k, body]
        loop.inputs[k, body] = force
        plant.given[body, Of.FORCE] = plant.own[body] + force


@inlined
def open_interval(plant: Plant, state: State, loop: Loop) -> bool:
    """Begin the next interval, unless it has begun; False if a controller gives no number."""
    if loop.cursor[Cursor.BEGUN]:
        return True
    k = loop.cursor[Cursor.INTERVAL]
    state.clock[0], state.clock[1], state.clock[2] = 0.0, 0.0, loop.begins[k]
    if loop.inputs.shape[0] > 0:
        if loop.answers.shape[0] > 0 and not answer(state, loop, k):
            return False
        set_inputs(plant, loop, k)
    loop.cursor[Cursor.BEGUN] = 1
    return True


@inlined
def enter_interval(plant: Plant, state: State, loop: Loop, out: Output, grid: Array) -> Output:
    """Set the modes of an interval that begins or resumes; returns `out` with the output times up to its end."""
    end = loop.bounds[loop.cursor[Cursor.INTERVAL] + 1]
    out = Output(grid[:end], out.rows, out.events, out.filled, out.work, out.observer)
    begin_interval(plant, state, out)
    return out


@inlined
def rest(state: State, loop: Loop) -> None:
    """Skip what is left of an interval at rest, and keep the time since when nothing moves."""
    put(state, V.L, 0.0)
    put(state, V.O, 0.0)
    put(state, V.R, 0.0)
    if state.rest[SINCE] == math.inf:
        state.rest[SINCE] = (state.clock[0] + state.clock[1]) + state.clock[2]
    state.clock[0], state.clock[1] = loop.lengths[loop.cursor[Cursor.INTERVAL]], 0.0


@inlined
def close_interval(loop: Loop) -> bool:
    """End an interval; whether another one follows."""
    loop.cursor[Cursor.INTERVAL] += 1
    loop.cursor[Cursor.BEGUN] = 0
    following: bool = loop.cursor[Cursor.INTERVAL] < loop.lengths.shape[0]
    return following


@inlined
def answer_end(state: State, loop: Loop) -> Outcome:
    """Answers to the last state of a run, which nothing follows: what a loop without intervals is for."""
    state.clock[0], state.clock[1], state.clock[2] = 0.0, 0.0, loop.begins[0]
    return Outcome.DONE if answer(state, loop, FIRST) else Outcome.NO_COMMAND

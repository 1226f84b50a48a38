"""The sampled loop: its ticks, and its plant, the one place where a command waits, is held over a period, and acts."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.driver.user_controller import UserController
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Loop, new_cursor
from grasp_ros.physics import given
from grasp_ros.physics.control import ControlLaw, normals_of
from grasp_ros.physics.layout import Answer, Cursor
from grasp_ros.physics.model import Array
from grasp_ros.physics.observation import Observation
from grasp_ros.physics.system import A_SYSTEM, COLUMN, System
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS

NO_TIMES = np.zeros(0)


def tick_times(scene: Scene) -> Array:
    """Times in s of all control periods of a scene, shape (ticks + 1,)."""
    return np.asarray(scene.time_of(np.arange(scene.ticks + 1)))


def tick_of(scene: Scene, t: Array) -> NDArray[np.int64]:
    """The last tick at or before each time in s, shape (n,)."""
    ticks = np.floor(np.asarray(t) * (NANOSECONDS / scene.period_ns)).astype(np.int64)  # rounding may miss it by one
    ticks -= scene.time_of(ticks) > t
    ticks += scene.time_of(ticks + 1) <= t
    return np.minimum(ticks, scene.ticks)


class LoopRecord(NamedTuple):
    """What went through a sampled loop, at n output times; see `Trajectory.command` and `Trajectory.inputs`."""

    command: Array  # (n, 2), N
    inputs: Array  # (n, 3), N by body


class Outputs(NamedTuple):
    """Output times within consecutive intervals."""

    offsets: Array  # (m,) s, ascending within each interval, from its beginning
    bounds: NDArray[np.int64]  # (n + 1,) how many of them come before each interval, and in all

    @property
    def interval(self) -> NDArray[np.int64]:
        """The interval of each output time, (m,)."""
        return np.arange(len(self.bounds) - 1).repeat(self.bounds[1:] - self.bounds[:-1])


BARE = Loop(NO_TIMES, NO_TIMES, np.zeros(1, dtype=np.int64), new_cursor())  # answers are given


class Record(NamedTuple):
    """What a sampled run was over k control periods."""

    states: Array  # (m, 6) at the output times
    answers: Array  # (k, 3) commands of the controllers, N by body
    inputs: Array  # (k, 3) forces that acted, N by body
    failed: int | None = None  # side whose controller gave no finite number


class SampledPlant:
    """Bodies and contacts under commands that are held over control periods, with delay and external forces.

    `step` takes the commands from outside, for one period, `follow` for many; `run` lets the controllers of a system
    answer.

    Parameters
    ----------
    system : System
        Its delay and its external forces act here.
    period_ns : int, ns
        Control period. Time is a whole number of periods, rounded once for each tick.
    integrator : Integrator, optional
        Integrates the system from its initial state, with `continuous=False`. Default: a new one.

    Attributes
    ----------
    tick : int
        Control periods done.
    effort : array (3,), N by body
        Forces of the controllers that acted over the last period: the commands that arrived. 0 before the first one.
    inputs : array (3,), N by body
        `effort` and the external forces together. 0 before the first period.
    """

    def __init__(self, system: System, period_ns: int, integrator: Integrator | None = None) -> None:
        self.tick = 0
        self.effort: Array = np.zeros(3)
        self.inputs: Array = np.zeros(3)
        given.instance("system", system, System, A_SYSTEM)
        period_ns = given.whole("period_ns", period_ns, 1)
        self._system, self._period_ns, self._period = system, period_ns, float(period_ns / NANOSECONDS)
        self._integrator = Integrator(system, continuous=False) if integrator is None else integrator
        self._held = np.zeros(2)
        self._waiting = np.zeros((system.delay, 3))  # until the first command arrives nothing acts

    @property
    def time(self) -> float:
        """Time of the current tick in s."""
        return self.tick * self._period_ns / NANOSECONDS

    @property
    def state(self) -> Array:
        """State (6,) at the current tick, m and m/s: x_l, v_l, x_o, v_o, x_r, v_r."""
        return self._integrator.state

    @property
    def status(self) -> Status:
        """DONE, or why the integration stopped within a period."""
        return self._integrator.status

    @property
    def stop(self) -> str:
        """Why and where it stopped, with time, contact mode and state; empty if it did not."""
        return self._integrator.stop

    def step(self, commands: Array, offsets: Array | None = None) -> Array:
        """Advance by one control period.

        Parameters
        ----------
        commands : array (3,), N by body
            What the controllers answer to the state of the current tick.
        offsets : array (n,), s, optional
            Ascending output times within the period, from its beginning.

        Returns
        -------
        array (n, 6)
            States at the offsets; only the rows reached, and the tick stays, if `status` is not DONE afterwards.

        Raises
        ------
        Refused
            If the commands are not three finite numbers, or the offsets do not ascend within the period.
        """
        commands = given.forces("commands", commands)
        times = NO_TIMES if offsets is None else given.ascending("offsets", offsets, self._period)
        waits, loop = len(self._waiting), self._one
        self.effort = self._waiting[self.tick % waits].copy() if waits else commands
        loop.begins[0], loop.bounds[1], loop.answers[0] = self.time, len(times), commands
        loop.cursor[:] = new_cursor(self.tick)
        if self._system.external:
            loop.external[:] = self._system.external_over(np.array([self.tick]))
        states = self._integrator.run(loop, times)
        self.tick += int(loop.cursor[Cursor.INTERVAL])
        self.inputs = loop.inputs[0].copy()
        return states

    @cached_property
    def _one(self) -> Loop:
        """A period under commands from outside: a graph makes each of its steps with it."""
        external = np.zeros((1, 3)) if self._system.external else BARE.external
        return Loop(
            np.array([self._period]), np.zeros(1), np.zeros(2, dtype=np.int64), new_cursor(),
            np.zeros((1, 3)), external, np.zeros((1, 3)), waiting=self._waiting,
        )

    def follow(self, answers: Array, outputs: Outputs | None = None) -> Array:
        """Advance by one control period for each row of answers that are known beforehand.

        Parameters
        ----------
        answers : array (k, 3), N by body
        outputs : Outputs, optional
            Default: the begin of each period.

        Returns
        -------
        array (m, 6)
            States at the output times; only those reached, if `status` is not DONE afterwards.
        """
        answers = given.rows("answers", answers, 3)
        count = len(answers)
        outputs = outputs or Outputs(np.zeros(count), np.arange(count + 1))
        return self._go(outputs, np.array(answers, order="C")).states

    def run(
        self, laws: Mapping[int, ControlLaw], outputs: Outputs, by_user: Mapping[int, UserController] | None = None,
        rows: Array | None = None,
    ) -> Record:
        """Advance by one control period for each interval of the outputs.

        Without intervals the controllers answer the state of the current tick, and nothing acts.

        Parameters
        ----------
        laws : mapping of int to ControlLaw
            What answers at every tick, by side; also the sensor and the actuator of a side with another controller.
        outputs : Outputs
        by_user : mapping of int to UserController, optional
            Controllers from outside that answer in place of the feedback of a law.
        rows : array (m, 6), optional
            Where to write the states. Default: a new array.

        Raises
        ------
        Refused
            If a controller from outside answers what is no finite number. What it raises itself passes through.
        """
        count = max(len(outputs.bounds) - 1, 1)
        law = BARE._replace(laws=BARE.laws.copy(), callee=BARE.callee.copy())
        for side, own in laws.items():
            law.laws[side], law.callee[side] = own.row, Answer.LAW
        if any(own.seed for own in laws.values()):
            law = law._replace(normals=normals_of(laws, self.tick, count))
        for side, other in (by_user or {}).items():
            law.callee[side] = other.address
            other.observe = partial(self._observation, laws, side)
        record = self._go(outputs, np.zeros((count, 3)), law, rows)
        if by_user and record.failed is not None:
            x, v = self.state[COLUMN[record.failed] :][:2].tolist()
            x, v = laws[record.failed].measured(self.tick, x, v)
            raise by_user[record.failed].failure(self.tick, self.time, x, v)
        return record

    def _observation(self, laws: Mapping[int, ControlLaw], side: int, tick: int) -> Observation:
        """What the controller of an arm can see; the kernels have the state of the tick in place when they ask it."""
        return Observation(self._system, laws, side, tick, self.state.tolist())

    def _go(self, outputs: Outputs, answers: Array, law: Loop = BARE, rows: Array | None = None) -> Record:
        """Advance under answers that are given, or those of a law."""
        count = len(outputs.bounds) - 1
        ticks = np.arange(self.tick, self.tick + len(answers))
        external = self._system.external_over(ticks) if self._system.external else BARE.external
        loop = Loop(
            np.full(count, self._period), ticks * self._period_ns / NANOSECONDS, outputs.bounds, new_cursor(self.tick),
            np.empty((count, 3)), external, answers, law.callee, law.laws, law.normals, self._held, self._waiting,
        )
        states = self._integrator.run(loop, outputs.offsets, rows)
        done = int(loop.cursor[Cursor.INTERVAL])
        self.tick += done
        begun = done + int(loop.cursor[Cursor.BEGUN])
        failed = int(loop.cursor[Cursor.FAILED])
        return Record(states, answers[: begun if count else 1], loop.inputs[:begun], failed if failed >= 0 else None)

"""One running simulation: the compiled kernels with their memory, events and counters."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from functools import cached_property

import numpy as np

from grasp_ros.exact.compilation.jit import compiling
from grasp_ros.exact.driver.advance import advance
from grasp_ros.exact.driver.callback import Observer
from grasp_ros.exact.driver.outputs import SPARE
from grasp_ros.exact.driver.workspace import workspace
from grasp_ros.exact.events import Event, to_events
from grasp_ros.exact.records import BODY_NUMBERS, Loop, Plant, State, new_state, one_interval, plant_of, state_of
from grasp_ros.physics import given
from grasp_ros.physics.accuracy import ACCURACY, check_accuracy
from grasp_ros.physics.energy import energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import number, whole
from grasp_ros.physics.layout import Filled, Law, Of, Outcome, U, Work, X
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import A_SYSTEM, System

MAX_EVENTS, MAX_WORK = 10**7, 10**8  # budgets; the second lasts for a minute or a few
BREATH = 10**6  # units of work, less than a second, after which a kernel lets Python see a Ctrl-C


class Status(Enum):
    """How a simulation ended; the value is the sentence shown to the user."""

    DONE = "reached the end of the horizon"
    EVENT_BUDGET = "stopped: the event budget is used up before the end of the horizon"
    NOT_FINITE = "stopped: a state is no longer finite"
    OUTSIDE = "stopped: a body is farther away or faster than the domain allows"
    WORK_BUDGET = "stopped: the budget of work is used up before the end of the horizon"
    ENERGY_RISES = "stopped: the energy rose by more than rounding explains"
    ENERGY_FALLS = "stopped: the energy fell by more than its losses explain"
    PENETRATES = "stopped: a touch was missed, a pair that is open penetrates by more than rounding explains"
    STALLED = "stopped: a search for the next event does not end, or the time does not advance"


_OUTPUTS, _EVENTS, _FILLED, _WORK = int(Filled.OUTPUTS), int(Filled.EVENTS), len(Filled), len(Work)
_NO_TIMES, _NOBODY = np.zeros(0), np.zeros(2, dtype=np.int64)
_DONE, _NO_COMMAND = int(Outcome.DONE), int(Outcome.NO_COMMAND)
_BODIES_THAT_ACT = [0.0] * BODY_NUMBERS  # `Plant.bodies`, which the kernels write


class Integrator:
    """Integrates one system from its initial state, over intervals of any length.

    Parameters
    ----------
    system : System
    continuous : bool
        True: the feedback acts all the time, (4), (5). False: the arms get the forces of `set_input` only.
    accuracy : float
        Size of the first neglected Taylor term of a contact relative to the impact, in [1e-16, 1e-3].
    max_events : int
        Budget of events; the integration stops with `Status.EVENT_BUDGET` beyond it.
    max_work : int
        Budget of flights, Taylor steps and evaluations of event functions together; the integration stops with
        `Status.WORK_BUDGET` when it is used up.

    Attributes
    ----------
    status : Status
    progress : callable or None
        Called with the time reached, in s, now and then in a call that takes longer than about a second.
    observer : Observer or None
    system, continuous : System and bool
        As given.

    Raises
    ------
    Refused
        If `system` is not a System, the accuracy is outside its range, a budget is not a whole number, or the state is
        not finite.
    """

    def __init__(
        self, system: System, *, continuous: bool, accuracy: float = ACCURACY, max_events: int = MAX_EVENTS,
        max_work: int = MAX_WORK,
    ) -> None:
        self._accuracy = check_accuracy(accuracy)
        begin = np.asarray(given.instance("system", system, System, A_SYSTEM).state, dtype=float)
        state = begin.tolist()  # of few numbers lists are faster than arrays
        if begin.shape != (6,) or not all(map(math.isfinite, state)):
            raise Refused(f"state: {begin!r} is not an array of six finite numbers")
        self.status = Status.DONE
        self.progress: Callable[[float], object] | None = None  # gets the time in s every BREATH units of work
        self.work = np.zeros(_WORK, dtype=np.int64)
        # Kernels are compiled once: for floats, and for arrays in C order that may be written to.
        self.system, self.continuous = system, continuous
        self._max_events, self._max_work = whole("max_events", max_events, 0), whole("max_work", max_work, 0)
        self._plant_block = _block_of(system, continuous)
        self._state_block, self._mode = new_state(*state, state[X.L] - state[X.O], state[X.O] - state[X.R])
        self._events: list[Array] = []
        self._event_count = 0
        self.observer: Observer | None = None

    @cached_property
    def plant(self) -> Plant:
        """What the kernels simulate."""
        return plant_of(self._plant_block)

    @cached_property
    def records(self) -> State:
        """Where it stands, as the kernels see it."""
        return state_of(self._state_block, self._mode)

    @property
    def state(self) -> Array:
        """Copy of the state (6,): x_l, v_l, x_o, v_o, x_r, v_r."""
        return self.records.y[:6].copy()

    @property
    def penetration(self) -> Array:
        """Copy of (u_l, u_r) in m, exact where the difference of the positions is not."""
        return self.records.y[[U.L, U.R]]

    @property
    def time(self) -> float:
        """Time reached on the clock of the recorded events, s."""
        time, rest, begin = self.records.clock.tolist()
        return float(begin + (time + rest))

    @property
    def at_rest(self) -> float | None:
        """Time in s since when everything is at rest, see `driver.rest`; None if it is not."""
        since = float(self._state_block[-1])  # `State.rest[SINCE]`
        return since if math.isfinite(since) else None

    @property
    def _spent(self) -> int:
        flights, steps, _, iterations = self.work.tolist()  # enums cost a sampled tick more than the list
        return int(flights + steps + iterations)

    @property
    def stop(self) -> str:
        """Why and where the integration stopped, with time, contact mode and state; empty if it did not."""
        if self.status is Status.DONE:
            return ""
        with np.errstate(over="ignore", invalid="ignore"):  # of states that are not finite any more
            mode = int(energy(self.system, self.state).mode)
        return f"{self.status.value}: t = {self.time!r} s, mode {mode}, state {self.state.tolist()}"

    @property
    def event_table(self) -> Array:
        """All events so far, shape (m, 5): time, side, kind, u, u'."""
        return np.concatenate(self._events) if self._events else np.empty((0, 5))

    @property
    def events(self) -> list[Event]:
        """The rows of `event_table` as records."""
        return to_events(self.event_table)

    def set_input(self, forces: Array) -> None:
        """Set the forces (3,) in N, by body, that act until the next call: held commands and external forces.

        Raises
        ------
        Refused
            If they are not three finite numbers.
        """
        self.plant.given[:, Of.FORCE] = self.plant.own + given.forces("forces", forces)

    def advance(self, duration: float, grid: Array | None = None, start: float = 0.0) -> Array:
        """Integrate for `duration` seconds.

        Parameters
        ----------
        duration : float, s
        grid : array (n,), s
            Ascending output times in [0, duration], counted from the beginning of this call.
        start : float, s
            Time of the beginning of this call on the clock of the recorded events.

        Returns
        -------
        array (n, 6)
            States at the grid; only the rows reached, if `status` is not DONE afterwards.

        Raises
        ------
        Refused
            If the duration is negative or not finite.
        """
        duration, start = number("duration", duration), number("start", start)
        if not (math.isfinite(duration) and duration >= 0.0):
            raise Refused(f"duration: {duration!r} is not a finite number of seconds >= 0")
        times = _NO_TIMES if grid is None else given.times("grid", grid)
        return self.run(one_interval(duration, start, len(times)), times)

    def run(self, loop: Loop, grid: Array, rows: Array | None = None) -> Array:
        """Integrate over the intervals of a loop.

        Parameters
        ----------
        loop : Loop
            What drives the run; `Cursor.INTERVAL` in its `cursor` counts the intervals done.
        grid : array (n,), s
            Output times, ascending within each interval and counted from its beginning.
        rows : array (n, 6), optional
            Where to write the states. Default: a new array.

        Returns
        -------
        array (n, 6)
            States at the grid; only the rows reached, if `status` is not DONE afterwards or a controller has failed.
        """
        out = np.empty((len(grid), 6)) if rows is None else rows
        filled = np.zeros(_FILLED, dtype=np.int64)
        with workspace(self._accuracy) as (block, order, tables, event_rows):
            observer = _NOBODY if self.observer is None else self.observer.attach(tables)
            while self.status is Status.DONE:
                allowed = event_rows[: self._max_events - self._event_count + SPARE]
                most = min(self._spent + BREATH, self._max_work)
                outcome = advance(
                    block, order, self._plant_block, self._state_block, self._mode, self._accuracy, most, grid,
                    out, allowed, filled, self.work, observer, tuple(loop))
                if count := int(filled[_EVENTS]):
                    self._events.append(event_rows[:count].copy())
                    self._event_count += count
                    filled[_EVENTS] = 0
                if outcome in (_DONE, _NO_COMMAND) or self._ends(outcome):
                    break
                if self.progress is not None:
                    self.progress(self.time)
        return out[: filled[_OUTPUTS]]

    def _ends(self, outcome: int) -> bool:
        """Whether a run is over, and its status."""
        if outcome == Outcome.EVENTS_FULL:
            if self._event_count > self._max_events:
                self.status = Status.EVENT_BUDGET
            return False
        if outcome == Outcome.WORK_BUDGET and self._spent < self._max_work:
            return False
        self.status = Status[Outcome(outcome).name]
        return True


def _block_of(system: System, continuous: bool) -> Array:
    """Numbers of a plant, see `plant_of`; a body that is not there has a mass, and rests at 0 without any force."""
    (m_l, k_l, c_l, f_l), (m_r, k_r, c_r, f_r), (m_o, k_o, c_o, f_o) = system.rows(continuous)
    pair_l, pair_r = system.pairs.tolist()
    return np.array([
        m_l or 1.0, k_l, c_l, f_l, m_r or 1.0, k_r, c_r, f_r, m_o or 1.0, k_o, c_o, f_o, *_BODIES_THAT_ACT,
        *pair_l, *pair_r, system.coulomb, f_l, f_r, f_o,
    ])


@compiling
def compile_kernels() -> None:
    """Compile the kernels, or load them from disk, by integrating over no time at all."""
    system = System()
    system.bodies[:, Of.MASS], system.pairs[:, Law.HERTZIAN] = 1.0, 1.0
    Integrator(system, continuous=False).advance(0.0)

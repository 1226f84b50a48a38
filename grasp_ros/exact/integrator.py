"""One running simulation: the compiled kernels with their memory, events and counters."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum

import numpy as np

from grasp_ros.exact.events import Event, to_events
from grasp_ros.exact.hybrid import advance
from grasp_ros.exact.jit import compiling
from grasp_ros.exact.outputs import SPARE
from grasp_ros.exact.records import Loop, Plant, State, new_place
from grasp_ros.exact.sight import Wanted
from grasp_ros.exact.squeezed import creep
from grasp_ros.exact.watcher import Watcher
from grasp_ros.exact.workspace import workspace
from grasp_ros.physics.accuracy import ACCURACY, check_accuracy
from grasp_ros.physics.energy import energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import FORCE, MASS, U_L, U_R, Filled, Outcome, Pair, Place, Work
from grasp_ros.physics.model import Arm, Array, Contact, Grasp
from grasp_ros.physics.system import System

MAX_EVENTS, MAX_WORK = 10**7, 10**8  # budgets; the second lasts for a minute or a few
BREATH = 10**6  # units of work, less than a second, after which a kernel lets Python see a Ctrl-C
IMPLICIT = 100  # units of work that an implicit step takes the time of, beside its own


class Status(Enum):
    """How a simulation ended; the value is the sentence shown to the user."""

    DONE = "reached the end of the horizon"
    EVENT_BUDGET = "stopped: the event budget is used up before the end of the horizon"
    NOT_FINITE = "stopped: a state is no longer finite, or too large for an impact"
    WORK_BUDGET = "stopped: the budget of work is used up before the end of the horizon"
    ENERGY_RISES = "stopped: the energy rose by more than rounding explains"
    ENERGY_FALLS = "stopped: the energy fell by more than its losses explain"
    PENETRATES = "stopped: a touch was missed, a pair that is open penetrates by more than rounding explains"
    STALLED = "stopped: a search for the next event does not end, or the time does not advance"


_OUTPUTS, _EVENTS, _FILLED = int(Filled.OUTPUTS), int(Filled.EVENTS), len(Filled)
_GOES_ON = (Outcome.GO_ON, Outcome.SQUEEZED)
_NO_TIMES = np.zeros(0)
_STATUS: dict[int, Status] = {
    Outcome.DONE: Status.DONE,
    Outcome.NOT_FINITE: Status.NOT_FINITE,
    Outcome.STALLED: Status.STALLED,
    Outcome.ENERGY_RISES: Status.ENERGY_RISES,
    Outcome.ENERGY_FALLS: Status.ENERGY_FALLS,
    Outcome.PENETRATES: Status.PENETRATES,
    Outcome.WORK_USED: Status.WORK_BUDGET,
}


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
        Budget of flights, Taylor steps and evaluations of event functions together, an implicit step as IMPLICIT of
        them; the integration stops with `Status.WORK_BUDGET` when it is used up.

    Raises
    ------
    Refused
        If the accuracy is outside its range or the state is not finite.
    """

    def __init__(
        self, system: System, *, continuous: bool, accuracy: float = ACCURACY, max_events: int = MAX_EVENTS,
        max_work: int = MAX_WORK,
    ) -> None:
        check_accuracy(accuracy)
        state = np.asarray(system.state, dtype=float)
        if state.shape != (6,) or not np.isfinite(state).all():
            raise Refused(f"state: {state!r} is not an array of six finite numbers")
        self.status = Status.DONE
        self.progress: Callable[[float], object] | None = None  # told the time in s every BREATH units of work
        self.work = np.zeros(len(Work), dtype=np.int64)
        # Kernels are compiled once: for floats, and for arrays in C order that may be written to.
        self._system, self._continuous, self._accuracy = system, continuous, float(accuracy)
        self._max_events, self._max_work = int(max_events), int(max_work)
        self._clock, self._carry = np.zeros(3), np.zeros(8)
        self._given = np.array(system.closed_loop if continuous else system.bodies, dtype=float, order="C")
        self._given[self._given[:, MASS] == 0.0, MASS] = 1.0  # what is not there rests at 0 without any force
        self._own_forces = self._given[:, FORCE].copy()
        self._bodies = self._given.copy()
        self._plant = self._given, self._bodies, np.array(system.pairs, dtype=float, order="C"), float(system.coulomb)
        self._y = np.array([*state, state[0] - state[2], state[2] - state[4]])
        self._mode = np.full(3, Pair.UNKNOWN, dtype=np.int64)
        self._events: list[Array] = []
        self._event_count = self._implicit = 0  # the second in units of work
        self._watcher: Watcher | None = None

    def watch(self, wanted: Wanted, bound: float) -> Watcher:
        """Watch the run from here on; `bound` is the part of the largest displacement that counts as settled."""
        plant = Plant(*self._plant)
        self._watcher = Watcher(plant, State(self._y, self._mode, self._carry, self._clock), wanted)
        self._watcher.set_system(self._system, self._continuous)
        self._watcher.begin(float(bound))
        return self._watcher

    @property
    def state(self) -> Array:
        """Copy of the state (6,): x_l, v_l, x_o, v_o, x_r, v_r."""
        return self._y[:6].copy()

    @property
    def penetration(self) -> Array:
        """Copy of (u_l, u_r) in m, exact where the difference of the positions is not."""
        return self._y[[U_L, U_R]]

    @property
    def time(self) -> float:
        """Time reached on the clock of the recorded events, s."""
        time, rest, begin = self._clock.tolist()
        return float(begin + (time + rest))

    @property
    def _spent(self) -> int:
        flights, steps, _, iterations = self.work.tolist()  # enums cost a sampled tick more than the list
        return int(flights + steps + iterations) + self._implicit

    @property
    def stop(self) -> str:
        """Why and where the integration stopped, with time, contact mode and state; empty if it did not."""
        if self.status is Status.DONE:
            return ""
        with np.errstate(over="ignore", invalid="ignore"):  # of states that are not finite any more
            mode = int(energy(self._system, self.state).mode)
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
        """Set the forces (3,) in N, by body, that act until the next call: held commands and external forces."""
        self._given[:, FORCE] = self._own_forces + forces

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
        if not (math.isfinite(duration) and duration >= 0.0):
            raise Refused(f"duration: {duration!r} is not a finite number of seconds >= 0")
        times = _NO_TIMES if grid is None else np.array(grid, dtype=float)
        loop = Loop(np.array([float(duration)]), np.array([float(start)]), np.array([0, len(times)]), new_place())
        return self.run(loop, times)

    def run(self, loop: Loop, grid: Array, rows: Array | None = None) -> Array:
        """Integrate over the intervals of a loop.

        Parameters
        ----------
        loop : Loop
            What drives the run; `Place.INTERVAL` in its `place` counts the intervals done.
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
        outcome = int(Outcome.GO_ON)
        with workspace(self._accuracy) as (tables, event_rows):
            if self._watcher is not None:
                self._watcher.attach(filled, tables)
            while self.status is Status.DONE:
                allowed = event_rows[: self._max_events - self._event_count + SPARE]
                most = min(self._spent + BREATH, self._max_work) - self._implicit
                own = (*tables[:-1], *tables.start, *self._plant, self._y, self._mode, self._carry, self._clock)
                if outcome == Outcome.SQUEEZED:
                    k, self._implicit = int(loop.place[Place.INTERVAL]), self._implicit + IMPLICIT
                    outcome = creep(*own, loop.lengths[k], self._accuracy, most, grid[: loop.bounds[k + 1]], out,
                                    allowed, filled, self.work)
                else:
                    outcome = advance(*own, self._accuracy, most, grid, out, allowed, filled, self.work,
                                      self._own_forces, *loop)
                if count := int(filled[_EVENTS]):
                    self._events.append(event_rows[:count].copy())
                    self._event_count += count
                    filled[_EVENTS] = 0
                if outcome == Outcome.NO_COMMAND or self._ends(outcome):
                    break
                if self.progress is not None:
                    self.progress(self.time)
        return out[: filled[_OUTPUTS]]

    def _ends(self, outcome: int) -> bool:
        """Whether a run is over, and its status."""
        if outcome in _GOES_ON:
            return False
        if outcome == Outcome.EVENTS_FULL:
            if self._event_count > self._max_events:
                self.status = Status.EVENT_BUDGET
            return False
        if outcome == Outcome.WORK_USED and self._spent < self._max_work:
            return False
        self.status = _STATUS[outcome]
        return True


@compiling
def compile_kernels() -> None:
    """Compile the kernels, or load them from disk, by integrating over no time at all."""
    arm = Arm(1.0, 1.0, 0.0, 0.0, 0.0)
    contact = Contact(1.0, 0.0)
    Integrator(System.of(Grasp(arm, arm, contact, contact, 1.0), np.zeros(6)), continuous=False).advance(0.0)

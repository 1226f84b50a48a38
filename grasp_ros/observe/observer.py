"""An observer with its memory: what a run is handed so that it is watched."""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.driver.callback import FINISH, address_of, block_of
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Integers, Plant, State, Tables
from grasp_ros.observe.observe import BEGIN, observe, observe_losses
from grasp_ros.observe.record import UNDECIDED, Seen, Switch, Wanted, memory_of


class RunObserver:
    """Watches the runs that use the arrays of one plant and one state, one run after the other.

    Parameters
    ----------
    plant, state : Plant and State
        Of the runs; their arrays stay where they are.
    wanted : Wanted

    Attributes
    ----------
    memory : Memory
        `loop`, `own`, `base`, `gains` and the switch CERTAIN are to be filled before a run.
    seen : array, see `record.Seen`
        What is remembered.
    """

    def __init__(self, plant: Plant, state: State, wanted: Wanted) -> None:
        self.memory = memory_of(plant, state)
        self.seen, switches = self.memory.seen, self.memory.switches
        switches[Switch.WANTED] = wanted
        switches[Switch.LOSSES] = address_of(observe_losses) if wanted & Wanted.LOSSES else 0
        self._address = address_of(observe)  # before a call: of other types on disk it would be compiled twice
        self._tables, self._block = self.memory.c, block_of(self.memory)

    def attach(self, tables: Tables) -> Integers:
        """What a run with this workspace calls after each segment."""
        if tables.c is not self._tables:  # a run in many pieces brings the same ones
            self._tables, self._block = tables.c, block_of(self.memory._replace(c=tables.c, size=tables.size))
        return np.array([self._address, self._block.ctypes.data])

    def begin(self, bound: float) -> None:
        """Before a run; `bound` is the part of the largest displacement that counts as settled."""
        observe(self._block.ctypes.data, BEGIN, float(bound), 0.0, 0)

    def finish(self) -> None:
        """After a run."""
        observe(self._block.ctypes.data, FINISH, 0.0, 0.0, 0)


def settle(integrator: Integrator, run_observer: RunObserver, stretch: float, horizons: int) -> None:
    """Go on with a watched run that is over, in stretches of s, until V_c decides whether it has settled."""
    run_observer.memory.switches[: Switch.CERTAIN] = Wanted.SETTLING, 0
    seen, done = run_observer.seen, 1
    while seen[Seen.SETTLED] == UNDECIDED and done < horizons:
        integrator.advance(stretch, start=done * stretch)
        if integrator.status is not Status.DONE:
            break
        run_observer.finish()
        done += 1
    if seen[Seen.SETTLED] == UNDECIDED:
        seen[Seen.SETTLED] = np.inf


def watch(integrator: Integrator, wanted: Wanted, bound: float) -> RunObserver:
    """Watch a run from here on; `bound` is the part of the largest displacement that counts as settled."""
    run_observer, system = RunObserver(integrator.plant, integrator.records, wanted), integrator.system
    memory = run_observer.memory
    memory.loop[:], memory.own[:], memory.base[:] = system.closed_loop, system.bodies, system.bodies
    if integrator.continuous:
        memory.base[:], memory.switches[Switch.CERTAIN] = memory.loop, not system.caveats
        for side, law in system.laws.items():
            memory.gains[side] = law.position_gain, law.velocity_gain
    run_observer.begin(bound)
    integrator.observer = run_observer
    return run_observer

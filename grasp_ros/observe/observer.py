"""An observer with its memory: what a run is handed so that it is watched."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from grasp_ros.exact.compilation.jit import compiled_address
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Array, Integers, Plant, State, Tables
from grasp_ros.observe.observe import BEGIN, FINISH, observe, observe_losses
from grasp_ros.observe.settling import takes_energy
from grasp_ros.observe.sight import COUNTS, KEPT, LONGEST, LOOKS, MODES, SEEN, UNDECIDED, Context, Seen, Wanted

SIGNATURE = "int64(int64, int64, float64, float64, int64)"


class Watcher:
    """Watches the runs that use the arrays of one plant and one state, one run after the other.

    Parameters
    ----------
    plant, state : Plant and State
        Of the runs; their arrays stay where they are.
    wanted : Wanted

    Attributes
    ----------
    loop, own, base : arrays (3, 4)
        To be filled before a run: bodies with the continuous feedback, whose energy is V_c; bodies by themselves; and
        what the motion has without held commands and external forces, one of the two.
    gains : array (2, 2)
        Kp and Kv of the feedback that acts all the time; 0 where commands are held.
    seen : array, see `sight.Seen`
        What is remembered.
    """

    def __init__(self, plant: Plant, state: State, wanted: Wanted) -> None:
        self.loop, self.own, self.base = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 4))
        self.gains, self.seen = np.zeros((2, 2)), np.zeros(SEEN)
        self._kept, self._rows = np.zeros((3, KEPT)), np.zeros((LOOKS, LONGEST))
        self._counts = np.zeros(COUNTS + MODES, dtype=np.int64)
        self._run = plant, state  # kept alive
        self.context: Integers = np.zeros(len(Context), dtype=np.int64)
        places: dict[Context, Array | Integers] = {
            Context.Y: state.y, Context.MODE: state.mode, Context.CLOCK: state.clock, Context.BODIES: plant.bodies,
            Context.GIVEN: plant.given, Context.PAIRS: plant.pairs, Context.LOOP: self.loop, Context.OWN: self.own,
            Context.BASE: self.base, Context.GAINS: self.gains, Context.SEEN: self.seen, Context.KEPT: self._kept,
            Context.ROWS: self._rows, Context.COUNTS: self._counts, Context.REST: state.rest,
        }
        for place, array in places.items():
            self.context[place] = array.ctypes.data
        self.context[Context.WANTED] = wanted
        self.context[Context.LOSSES] = address_of(observe_losses) if wanted & Wanted.LOSSES else 0

    def attach(self, tables: Tables) -> Integers:
        """What a run with this workspace calls after each segment."""
        for place, table in ((Context.C, tables.c), (Context.SIZE, tables.size)):
            self.context[place] = table.ctypes.data
        return np.array([address_of(observe), self.context.ctypes.data])

    def finish(self) -> None:
        """After a run."""
        observe(self.context.ctypes.data, FINISH, 0.0, 0.0, 0)


def settle(integrator: Integrator, watcher: Watcher, stretch: float, horizons: int) -> Array:
    """Go on with a watched run, in stretches of s, until V_c decides whether it has settled.

    Returns
    -------
    array (3,)
        Last times outside the bound of left arm, right arm and object in s, if nothing leaves it any more; infinite: it
        has not settled for good within so many horizons; nan: V_c proves nothing here.
    """
    watcher.finish()
    watcher.context[Context.WANTED], watcher.context[Context.LOSSES] = Wanted.SETTLING, 0
    system, seen = integrator.system, watcher.seen
    losing, done = takes_energy(watcher.loop, system.pairs, system.coulomb), 1
    while seen[Seen.SETTLED] == UNDECIDED and losing and done < horizons:
        integrator.advance(stretch, start=done * stretch)
        if integrator.status is not Status.DONE:
            break
        watcher.finish()
        done += 1
    if seen[Seen.SETTLED] == UNDECIDED:
        return np.full(3, np.inf)
    return np.where(np.isnan(seen[Seen.SETTLED]), np.nan, seen[Seen.OUTSIDE : Seen.OUTSIDE + 3])


def watch(integrator: Integrator, wanted: Wanted, bound: float) -> Watcher:
    """Watch a run from here on; `bound` is the part of the largest displacement that counts as settled."""
    watcher, system = Watcher(integrator.plant, integrator.records, wanted), integrator.system
    watcher.loop[:], watcher.own[:], watcher.base[:] = system.closed_loop, system.bodies, system.bodies
    if integrator.continuous:
        watcher.base[:] = watcher.loop
        watcher.context[Context.CERTAIN] = not system.caveats
        for side, law in system.laws.items():
            watcher.gains[side] = law.position_gain, law.velocity_gain
    observe(watcher.context.ctypes.data, BEGIN, float(bound), 0.0, 0)
    integrator.observer = watcher
    return watcher


@cache
def address_of(function: Any) -> int:
    """Address of an observer, which is compiled where it has not been."""
    return compiled_address(function, SIGNATURE)

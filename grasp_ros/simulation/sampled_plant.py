"""The plant of a sampled loop: the one place where a command waits, is held over a control period, and acts."""

from __future__ import annotations

from collections import deque

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import NANOSECONDS


class SampledPlant:
    """Bodies and contacts under commands that are held over control periods, with delay and external forces.

    The controllers are not in it: whoever steps it computes the commands. Their numbers may change from tick to tick;
    the plant does not.

    Parameters
    ----------
    system : System
        Its delay and its external forces act here.
    period_ns : float, ns
        Control period, whole in a scene. Time is a whole number of periods, rounded once for each tick.
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

    def __init__(self, system: System, period_ns: float, integrator: Integrator | None = None) -> None:
        self.tick = 0
        self.effort: Array = np.zeros(3)
        self.inputs: Array = np.zeros(3)
        self._system, self._period_ns, self._period = system, period_ns, period_ns / NANOSECONDS
        self._integrator = Integrator(system, continuous=False) if integrator is None else integrator
        self._waiting = deque([np.zeros(3)] * system.delay)  # until the first command arrives nothing acts

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
            What the controllers answer to the state of the current tick. It is kept: pass a new array each time.
        offsets : array (n,), s, optional
            Ascending output times within the period, from its beginning.

        Returns
        -------
        array (n, 6)
            States at the offsets; only the rows reached, and the tick stays, if `status` is not DONE afterwards.
        """
        integrator, system = self._integrator, self._system
        self._waiting.append(commands)
        self.effort = inputs = self._waiting.popleft()
        if system.external:
            inputs = inputs + system.external_at(self.tick)
        self.inputs = inputs
        integrator.set_input(inputs)
        states = integrator.advance(self._period, offsets, self.time)
        if integrator.status is Status.DONE:
            self.tick += 1
        return states

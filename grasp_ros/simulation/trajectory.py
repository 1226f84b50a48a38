"""What a simulation delivers: the motion at its output times and at any other, its events, its file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from grasp_ros.exact.events import Event, to_events
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.energy import PLANT_ALONE, PLANT_AND_FEEDBACK, Energy, energy, pairs_of
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.given import instance, number, times
from grasp_ros.physics.layout import LEFT, RIGHT, Body, Entry, Transition
from grasp_ros.physics.lyapunov import Parts, largest_deformation, parts
from grasp_ros.physics.model import Array, impact_force
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.files import opened, signed
from grasp_ros.simulation.contacts import check_located, contact_table, side_of
from grasp_ros.simulation.repeat import breaks_of, states_at
from grasp_ros.simulation.sampled_plant import LoopRecord, tick_of
from grasp_ros.simulation.sections import Function, Section, as_function, crossings
from grasp_ros.simulation.tables import Motion

if TYPE_CHECKING:
    from grasp_ros.simulation.differentiate import Sensitivity


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Motion, Frozen):
    """A simulated or recorded motion.

    Attributes
    ----------
    scene : Scene
    t : array (n,), s
    state : array (n, 6), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r; NaN for a body that is not there.
    loop : LoopRecord or None
        Commands and inputs of sampled controllers at the output times; None under continuous feedback.
    event_table : array (m, 5)
        Time in s, side, kind, u in m and u' in m/s of every event, in the order of time; see `events`.
    work : array of int
        Counters, named by `counters`.
    status : Status
    method : str
        A key of `methods.registry.METHODS`.
    setting : float
        Its accuracy, step in s, or tolerance.
    stop : str
        Why and where a run of `exact` stopped, with time, contact mode and state; empty if it did not.
    controllers : mapping of str to str
        Names of the controllers that acted in place of the scene's feedback, by side.
    at_rest : float or None
        Time in s from which everything stays at rest, see `exact.driver.rest`. None: never, by another method, or
        under held commands that may change: with noise, by a user's controller, or while older ones are delayed.
    sensitivity : Sensitivity or None
        Derivatives of the motion, where `simulate` was asked for them; see `differentiate.Sensitivity`. They are
        not saved.
    """

    scene: Scene
    t: Array
    state: Array
    loop: LoopRecord | None
    event_table: Array
    work: np.ndarray
    status: Status
    method: str = EXACT
    setting: float = ACCURACY
    stop: str = ""
    controllers: Mapping[str, str] = field(default_factory=dict)
    at_rest: float | None = None
    sensitivity: Sensitivity | None = None

    @property
    def sampled(self) -> bool:
        """Whether the commands were held over control periods."""
        return self.loop is not None

    @property
    def counters(self) -> dict[str, int]:
        """The work by its names."""
        return {entry.name.lower().replace("_", " "): int(self.work[entry]) for entry in METHODS[self.method].counters}

    @property
    def command(self) -> Array:
        """Commands of the controllers: f_l, f_r (n, 2) in N; 0 without a controller.

        In a sampled loop the command of the last tick at or before the output time, limited but not yet delayed. Under
        continuous feedback the command for the state itself, (4), (5).
        """
        if self.loop is not None:
            return self.loop.command
        return self.scene.system.feedback(self.state)

    @property
    def inputs(self) -> Array:
        """Forces on the bodies from each output time on, (n, 3) in N by body, LEFT, RIGHT, OBJECT.

        In a sampled loop the commands that had arrived, limited and delayed, and the external forces, all of which stay
        the same up to the next tick. Under continuous feedback `command` and the external forces. NaN at the end of the
        horizon, from where on nothing has acted. A bag has the same, `graph.bag.Recording.inputs`.
        """
        if self.loop is not None:
            return self.loop.inputs
        inputs = self.external
        inputs[:, [LEFT, RIGHT]] += self.command
        inputs[tick_of(self.scene, self.t) == self.scene.ticks] = np.nan
        return inputs

    @property
    def external(self) -> Array:
        """External forces (n, 3) in N, by body, from each output time to the next tick."""
        return self.scene.system.external_over(tick_of(self.scene, self.t))

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the output times; see `energy_of`."""
        return energy(self.scene.system, self.state, self.external, feedback=not self.controllers)

    @property
    def energy_of(self) -> str:
        """What `energy` is the energy of: the plant with its feedback, or the plant alone.

        The energy of a user's controller is unknown: with one, V and V_c have no feedback term on either side, and
        V' is the rate without commands.
        """
        return PLANT_ALONE if self.controllers else PLANT_AND_FEEDBACK

    @property
    def origin(self) -> dict[str, Any]:
        """How the motion was integrated, and how the run ended."""
        return {"method": self.method, "setting": self.setting, "status": self.status.name}

    @property
    def parts(self) -> Parts:
        """V by parts at the output times: V_l, V_o, V_r of (29), and the contacts."""
        return parts(self.scene.system, self.state, feedback=not self.controllers)

    @property
    def epsilon(self) -> Array:
        """Epsilon of (35), (36) as the output times show it: the largest deformation of each pair so far, (n, 2) in m.

        Between output times it may be larger: `contacts` has the `deepest` u of each contact.
        """
        return largest_deformation(self.scene.system, self.state)

    @property
    def impacts(self) -> Array:
        """Impact forces fw_l, fw_r (n, 2) at the output times in N; 0 where there is no contact, or none at all."""
        forces = np.zeros((len(self.t), 2))
        for side, contact, u, d in pairs_of(self.scene.system, self.state):
            forces[:, side] = impact_force(contact, u, d)
        return forces

    def at(self, t: ArrayLike) -> Array:
        """States (..., 6) at any times (...) in s: the dense output.

        They are the states of the run with these output times, bit for bit, because it is integrated again with them,
        see `repeat`.

        Raises
        ------
        Refused
            If a time is NaN or outside the run, or the run cannot be repeated.
        """
        return states_at(self, times("t", t, several=True))

    @cached_property
    def events(self) -> list[Event]:
        """The events as records, each with the state at its time.

        Raises
        ------
        Refused
            If the run cannot be repeated, see `at`; `event_table` needs no repetition. Or if its method does not look
            for contacts.
        """
        check_located(self)
        return to_events(self.event_table, self.at(self.event_table[:, Entry.TIME]))

    def contacts(self, side: str) -> np.ndarray:
        """The contacts of the "left" or "right" arm: a structured array, a row for each stretch with u > 0.

        Columns, with the units of `contacts.UNITS`: `begin` and `end` in s; `speed_in` and `speed_out`, u' at the touch
        and -u' at the release in m/s, and `restitution`, their quotient; `peak_force` in N, `impulse` in N s, `loss`,
        the energy that the contact took, in J, and `deepest`, the largest u in m. A contact that goes on at the end of
        the run ends there, and has NaN for speed_out and restitution; so has one that was there at the begin for
        speed_in. Peaks and integrals come from polynomials that follow the states to 1e-12 and to rounding, which
        matters where u is much smaller than the positions.

        Raises
        ------
        Refused
            If there is no such side, the method does not look for contacts, or the run cannot be repeated, see `at`.
        """
        return contact_table(self, side_of(side))

    def section(self, function: Function | ArrayLike, level: float = 0.0, direction: int = 0) -> Section:
        """Where a function of the motion crosses a level: times, states and directions.

        Between its events a motion is smooth. There the function is replaced by polynomials that follow it to 1e-12 of
        its largest value in the run, and all roots of these are found. Each is a crossing if the function changes
        sign there; its time is then refined on the function itself, to rounding. A crossing is missed only where
        the function passes the level by less than that 1e-12. Where the function, or the motion at a
        reversal under dry friction, is not smooth, the pieces are halved; `Section.resolution` is the length of the
        longest that stays unresolved, within which pairs of crossings may be missed: 0
        for a linear function of a motion without friction.

        Parameters
        ----------
        function : array (6,) or callable
            Weights of the state, for a function that is linear in it; or any function of times (n,) in s and states
            (n, 6) that returns (n,) numbers.
        level : float
        direction : int
            +1: only where it rises, -1: falls, 0: both.

        Raises
        ------
        Refused
            If the function or direction is invalid, or the run cannot be repeated, see `at`.
        """
        return crossings(as_function(function, number("level", level)), direction, breaks_of(self), self.at)

    def _repr_html_(self) -> str:
        """What a notebook shows: how the run ended, and its figure."""
        from grasp_ros.simulation.plots import html_of  # it imports this file

        return html_of(self)

    def times(self, kind: Transition, side: int) -> Array:
        """Times in s of one side's events of a kind, LEFT, RIGHT or, of friction, OBJECT.

        Raises
        ------
        Refused
            If there is no such kind or side, or the method does not look for contacts.
        """
        check_located(self)
        for name, value, known in (("kind", kind, Transition), ("side", side, Body)):
            if value not in [*known]:
                allowed = ", ".join(f"{known.__name__}.{one.name}" for one in known)
                raise Refused(f"{name}: {value!r} is not allowed; allowed: {allowed}")
        table = self.event_table
        return np.asarray(table[(table[:, Entry.BODY] == side) & (table[:, Entry.KIND] == kind), Entry.TIME])

    def save(self, path: str | os.PathLike[str] | BinaryIO) -> None:
        """Write everything to a .npz file, by its path or open.

        Raises
        ------
        Refused
            If the file cannot be written.
        """
        with opened(path) as file:
            np.savez_compressed(file, **signed(self.contents()))

    def contents(self) -> dict[str, Any]:
        """What a file holds, by the names of its arrays."""
        level = self.energy
        return dict(
            t=self.t, state=self.state, command=self.command, inputs=self.inputs,
            V=level.V, V_c=level.V_c, V_rate=level.V_rate, mode=level.mode, **self.parts._asdict(),
            epsilon=self.epsilon, impacts=self.impacts,
            **{f"{kind.name.lower()}_{name}": self.times(kind, side) for kind in (Transition.TOUCH, Transition.RELEASE)
               for name, side in SIDES.items() if METHODS[self.method].events},
            events=self.event_table, work=self.work,
            work_names=np.array([name.replace(" ", "_") for name in self.counters]), status=self.status.name,
            method=self.method, setting=float(self.setting), sampled=self.sampled, stop=self.stop,
            scene_name=self.scene.name, scene=self.scene.to_yaml(), energy_of=self.energy_of,
            controllers=np.array([self.controllers.get(side, "") for side in SIDES]),
            at_rest=np.inf if self.at_rest is None else self.at_rest,
        )


def check_run(run: object) -> Trajectory:
    """Refuse what is no run."""
    return instance("run", run, Trajectory, "a Trajectory")  # type: ignore[no-any-return]

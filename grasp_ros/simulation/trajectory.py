"""What a simulation delivers, its file, and the ticks of its output times."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros import scene as scenes
from grasp_ros.exact.events import Event, to_events
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT, METHODS, find
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.energy import PLANT_ALONE, PLANT_AND_FEEDBACK, Energy, energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.lyapunov import Parts, largest_deformation, parts
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS, SIDES
from grasp_ros.scene.files import decoding, replacing
from grasp_ros.scene.npz import TEXT, Field, read_npz, signed


def tick_times(scene: Scene) -> Array:
    """Times in s of all control periods of a scene, shape (ticks + 1,)."""
    return np.arange(scene.ticks + 1) * scene.period_ns / NANOSECONDS


def tick_of(scene: Scene, t: Array) -> NDArray[np.int64]:
    """The last tick at or before each time in s, shape (n,)."""
    ticks = np.floor(np.asarray(t) * (NANOSECONDS / scene.period_ns)).astype(np.int64)  # rounding may miss it by one
    ticks -= ticks * scene.period_ns / NANOSECONDS > t
    ticks += (ticks + 1) * scene.period_ns / NANOSECONDS <= t
    return np.minimum(ticks, scene.ticks)


class Loop(NamedTuple):
    """What went through a sampled loop, at n output times; see `Trajectory.command` and `Trajectory.inputs`."""

    command: Array  # (n, 2), N
    inputs: Array  # (n, 3), N by body


@dataclass(frozen=True)
class Trajectory(Frozen):
    """A simulated or recorded motion.

    Attributes
    ----------
    scene : Scene
    t : array (n,), s
    state : array (n, 6), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r; NaN for a body that is not there.
    loop : Loop or None
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
        Time in s since when everything is at rest for good, see `exact.driver.rest`; only `exact` tells.
    """

    scene: Scene
    t: Array
    state: Array
    loop: Loop | None
    event_table: Array
    work: np.ndarray
    status: Status
    method: str = EXACT
    setting: float = ACCURACY
    stop: str = ""
    controllers: Mapping[str, str] = field(default_factory=dict)
    at_rest: float | None = None

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
        """What the controllers answered: f_l, f_r (n, 2) in N; 0 without a controller.

        In a sampled loop the answer to the last tick at or before the output time, as it left the controller: limited,
        and not yet delayed. Under continuous feedback the answer to the state itself, (4), (5).
        """
        if self.loop is not None:
            return self.loop.command
        return self.scene.system.feedback(self.state)

    @property
    def inputs(self) -> Array:
        """What acted on the bodies from each output time on: forces (n, 3) in N by body, LEFT, RIGHT, OBJECT.

        In a sampled loop the commands that had arrived, limited and delayed, and the external forces, all of which stay
        the same up to the next tick. Under continuous feedback `command` and the external forces. NaN at the end of the
        horizon, from where on nothing has acted. A bag has the same, `graph.bag.Recording.inputs`.
        """
        if self.loop is not None:
            return self.loop.inputs
        system, ticks = self.scene.system, tick_of(self.scene, self.t)
        inputs: Array = np.zeros((len(self.t), 3))
        inputs[:, [LEFT, RIGHT]] = self.command
        if system.external:
            several, place = np.unique(ticks, return_inverse=True)
            inputs += np.reshape([system.external_at(tick) for tick in several.tolist()], (-1, 3))[place]
        inputs[ticks == self.scene.ticks] = np.nan
        return inputs

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the output times; see `energy_of`."""
        return energy(self.scene.system, self.state, feedback=not self.controllers)

    @property
    def energy_of(self) -> str:
        """What `energy` is the energy of: the plant with its feedback, or the plant alone.

        Nobody knows the energy of a controller that is any function: then V and V_c have no term of feedback, of
        neither side, and V' is the rate without any command.
        """
        return PLANT_ALONE if self.controllers else PLANT_AND_FEEDBACK

    @property
    def parts(self) -> Parts:
        """V by parts at the output times: V_l, V_o, V_r of (29), and the contacts."""
        return parts(self.scene.system, self.state, feedback=not self.controllers)

    @property
    def epsilon(self) -> Array:
        """Epsilon of (35), (36): the largest deformation of each pair up to an output time, (n, 2) in m."""
        return largest_deformation(self.scene.system, self.state)

    @property
    def events(self) -> list[Event]:
        """The events as records."""
        return to_events(self.event_table)

    def times(self, kind: Transition, side: int) -> Array:
        """Times in s of one side's events of a kind."""
        chosen: Array = self.event_table[(self.event_table[:, 1] == side) & (self.event_table[:, 2] == kind), 0]
        return chosen

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to a .npz file.

        Raises
        ------
        Refused
            If the file cannot be written.
        """
        level, parts = self.energy, self.parts
        with replacing(path) as file:
            np.savez_compressed(file, **signed(dict(
                t=self.t, state=self.state, command=self.command, inputs=self.inputs,
                V=level.V, V_c=level.V_c, V_rate=level.V_rate, mode=level.mode, **parts._asdict(),
                epsilon=self.epsilon,
                touch_left=self.times(Transition.TOUCH, LEFT), touch_right=self.times(Transition.TOUCH, RIGHT),
                release_left=self.times(Transition.RELEASE, LEFT), release_right=self.times(Transition.RELEASE, RIGHT),
                events=self.event_table, work=self.work,
                work_names=np.array([name.replace(" ", "_") for name in self.counters]), status=self.status.name,
                method=self.method, setting=float(self.setting), sampled=self.sampled, stop=self.stop,
                scene_name=self.scene.name, scene=self.scene.to_yaml(), energy_of=self.energy_of,
                controllers=np.array([self.controllers.get(side, "") for side in SIDES]),
                at_rest=np.inf if self.at_rest is None else self.at_rest,
            )))


_ROW = {name: Field("<f8", ("n",)) for name in ("t", "V", "V_c", "V_rate")}
_TIMES = {
    f"{kind}_{side}": Field("<f8", (f"{kind} {side}",)) for kind in ("touch", "release") for side in ("left", "right")
}
_WORDS = {name: Field(TEXT) for name in ("status", "method", "stop", "scene_name", "scene", "energy_of")}
FIELDS = {
    **_ROW, **dict.fromkeys(Parts._fields, Field("<f8", ("n",))), "epsilon": Field("<f8", ("n", 2)),
    "state": Field("<f8", ("n", 6)), "command": Field("<f8", ("n", 2)), "inputs": Field("<f8", ("n", 3)),
    "mode": Field("<i8", ("n",)), **_TIMES, "events": Field("<f8", ("events", 5)), "work": Field("<i8", ("work",)),
    "work_names": Field(TEXT, ("work",)), **_WORDS, "setting": Field("<f8"), "sampled": Field("|b1"),
    "at_rest": Field("<f8"),
    "controllers": Field(TEXT, (2,)),
}


def load(path: str | os.PathLike[str]) -> Trajectory:
    """Read what `Trajectory.save` wrote.

    Raises
    ------
    Refused
        If the file is not such a file.
    """
    path = Path(path)
    with decoding(path, "a file of `grasp simulate`"):
        data = read_npz(path, FIELDS)
        words = {name: str(data[name]) for name in _WORDS}
        scene, method = scenes.parse(words["scene"], words["scene_name"], str(path)), find(words["method"])
        if data["work_names"].tolist() != [counter.name.lower() for counter in method.counters]:
            raise Refused(f"work_names: {data['work_names'].tolist()}; allowed: the counters of {method.name}")
        loop = Loop(data["command"], data["inputs"]) if data["sampled"] else None
        found = Trajectory(
            scene, data["t"], data["state"], loop, data["events"], data["work"], Status[words["status"]], method.name,
            float(data["setting"]), words["stop"],
            {side: name for side, name in zip(SIDES, data["controllers"].tolist(), strict=True) if name},
            float(data["at_rest"]) if np.isfinite(data["at_rest"]) else None,
        )
        if found.energy_of != words["energy_of"]:
            raise Refused(f"energy_of: {words['energy_of']}; allowed with these controllers: {found.energy_of}")
        _check(found)
        for side, name in ((LEFT, "left"), (RIGHT, "right")):
            for kind in (Transition.TOUCH, Transition.RELEASE):
                key = f"{kind.name.lower()}_{name}"
                if data[key].tolist() != found.times(kind, side).tolist():
                    raise Refused(f"{key}: not those of the events")
        return found


def _check(found: Trajectory) -> None:
    """Refuse numbers that no run has."""
    events, end, done = found.event_table, found.scene.duration, found.status is Status.DONE
    there = [body for body in COLUMN if body not in found.scene.system.absent]
    columns = [COLUMN[body] + k for body in there for k in (0, 1)]
    absent = np.delete(found.state, columns, axis=1)
    acted = found.scene.ticks if found.sampled else 0
    for name, good, allowed in (
        ("t", _ascending(found.t, end), "ascending times within the horizon"),
        ("state", not done or np.isfinite(found.state[:, columns]).all(), "finite numbers"),
        ("state", np.isnan(absent).all(), "NaN for a body that is not there"),
        ("command", not done or np.isfinite(found.command).all(), "finite numbers"),
        ("inputs", not acted or np.isnan(found.inputs[tick_of(found.scene, found.t) == acted]).all(), "NaN at the end"),
        ("events", _ascending(events[:, 0], end), "ascending times within the horizon"),
        ("events", np.isfinite(events).all() and np.isin(events[:, 1], list(COLUMN)).all(), "events of this scene"),
        ("events", np.isin(events[:, 2], list(Transition)).all(), "events of this scene"),
        ("work", (found.work >= 0).all(), "numbers >= 0"),
        ("setting", np.isfinite(found.setting) and found.setting > 0.0, "a number > 0"),
    ):
        if not good:
            raise Refused(f"{name}: not allowed; allowed: {allowed}")


def _ascending(times: Array, end: float) -> bool:
    """Whether times ascend within [0, end]."""
    return bool((times[1:] >= times[:-1]).all() and (times >= 0.0).all() and (times <= end).all())

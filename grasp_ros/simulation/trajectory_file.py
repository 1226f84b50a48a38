"""Reading what `Trajectory.save` wrote: nothing is believed that no run has."""

from __future__ import annotations

import os

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import find
from grasp_ros.physics import given
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Entry, Transition
from grasp_ros.physics.lyapunov import Parts
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.files import decoding, reading
from grasp_ros.scene.npz import TEXT, Field, read_npz
from grasp_ros.simulation.ticks import Loop, tick_of
from grasp_ros.simulation.trajectory import MOMENTS, Trajectory

_ROW = {name: Field("<f8", ("n",)) for name in ("t", "V", "V_c", "V_rate", *Parts._fields)}
_WORDS = {name: Field(TEXT) for name in ("status", "method", "stop", "scene_name", "scene", "energy_of")}
FIELDS = {
    **_ROW, "epsilon": Field("<f8", ("n", 2)), "impacts": Field("<f8", ("n", 2)), "state": Field("<f8", ("n", 6)),
    "command": Field("<f8", ("n", 2)), "inputs": Field("<f8", ("n", 3)), "mode": Field("<i8", ("n",)),
    "events": Field("<f8", ("events", 5)),
    **{name: Field("<f8", (name,)) for name in MOMENTS}, "work": Field("<i8", ("work",)),
    "work_names": Field(TEXT, ("work",)), **_WORDS, "setting": Field("<f8"), "sampled": Field("|b1"),
    "at_rest": Field("<f8"), "controllers": Field(TEXT, (2,)),
}


def load(path: str | os.PathLike[str]) -> Trajectory:
    """Read what `Trajectory.save` wrote.

    Raises
    ------
    Refused
        If the file is not such a file.
    """
    path = given.path("path", path)
    with decoding(path, "a file of `grasp simulate`"), reading(path):
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
        for name, which in MOMENTS.items():
            if data[name].tolist() != found.times(*which).tolist():
                raise Refused(f"{name}: not those of the events")
        return found


def _check(found: Trajectory) -> None:
    """Refuse numbers that no run has."""
    events, end, done = found.event_table, found.scene.duration, found.status is Status.DONE
    gone = found.scene.system.absent_columns
    there, absent = np.delete(found.state, gone, axis=1), found.state[:, gone]
    acted = found.scene.ticks if found.sampled else 0
    given.ascending("t", found.t, end)
    given.ascending("events", events[:, Entry.TIME], end)
    for name, good, allowed in (
        ("state", not done or np.isfinite(there).all(), "finite numbers"),
        ("state", np.isnan(absent).all(), "NaN for a body that is not there"),
        ("command", not done or np.isfinite(found.command).all(), "finite numbers"),
        ("inputs", not acted or np.isnan(found.inputs[tick_of(found.scene, found.t) == acted]).all(), "NaN at the end"),
        ("events", np.isfinite(events).all() and np.isin(events[:, 1], list(COLUMN)).all(), "events of this scene"),
        ("events", np.isin(events[:, 2], list(Transition)).all(), "events of this scene"),
        ("work", (found.work >= 0).all(), "numbers >= 0"),
        ("setting", np.isfinite(found.setting) and found.setting > 0.0, "a number > 0"),
    ):
        if not good:
            raise Refused(f"{name}: not allowed; allowed: {allowed}")

"""Reading what `Trajectory.save` wrote."""

from __future__ import annotations

import os

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import find
from grasp_ros.physics import given
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.files import TEXT, decoding, read_npz, reading
from grasp_ros.simulation.sampled_plant import LoopRecord
from grasp_ros.simulation.trajectory import Trajectory


def load(path: str | os.PathLike[str]) -> Trajectory:
    """Read what `Trajectory.save` wrote.

    Raises
    ------
    Refused
        If the file is not such a file.
    """
    path = given.path("path", path)
    with decoding(path, "a file of `grasp simulate`"), reading(path):
        data = read_npz(path)
        words = {name: str(data[name]) for name in ("status", "method", "stop", "scene_name", "scene")}
        scene = scenes.parse(words["scene"], words["scene_name"], str(path))
        t, state, command, inputs, events = (data[name].astype(float, casting="same_kind") for name in (
            "t", "state", "command", "inputs", "events"))
        found = Trajectory(
            scene, t, state, LoopRecord(command, inputs) if data["sampled"] else None, events,
            data["work"].astype(np.int64, casting="same_kind"), Status[words["status"]], find(words["method"]).name,
            float(data["setting"]), words["stop"],
            {side: name for side, name in zip(SIDES, data["controllers"].tolist(), strict=True) if name},
            float(data["at_rest"]) if np.isfinite(data["at_rest"]) else None,
        )
        own = {name: np.asarray(values) for name, values in found.contents().items()}
        if data.keys() != own.keys():
            raise Refused(f"arrays {', '.join(sorted(data))}; allowed: {', '.join(sorted(own))}")
        for name, values in own.items():
            said, allowed = _described(data[name]), _described(values)
            if said != allowed:
                raise Refused(f"{name}: {said} is not allowed; allowed for this run: {allowed}")
        return found


def _described(values: np.ndarray) -> str:
    """What two arrays share if one can stand for the other: texts, or the type and shape of numbers."""
    return str(values.tolist()) if values.dtype.kind == TEXT else f"{values.dtype} of shape {values.shape}"

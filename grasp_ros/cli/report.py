"""Short tables in plain text: what a simulation or a bag contains."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from grasp_ros.graph.bag import Recording
from grasp_ros.methods.contract import UNITS
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.model import Array, Mode
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory, simulate

Row = tuple[str, str]


def table(rows: Iterable[Row]) -> str:
    """Two aligned columns."""
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def describe_trajectory(trajectory: Trajectory) -> list[Row]:
    """What happened in a simulation."""
    level = trajectory.energy
    method = METHODS[trajectory.method]
    foreign = [(f"{side} controller", name) for side, name in trajectory.controllers.items()]
    rows = [
        ("scene", trajectory.scene.title),
        ("feedback", trajectory.scene.feedback_in_words(trajectory.sampled, bool(foreign))),
        *foreign,
        ("status", trajectory.stop or trajectory.status.value),
        ("simulated", f"{trajectory.scene.duration:g} s, {len(trajectory.t)} output times"),
        ("touches left, right", _touches(trajectory) if method.events else "not looked for"),
        ("method", f"{method.name}, {method.knob} {trajectory.setting:g}{UNITS[method.knob]}"),
        ("work", ", ".join(f"{number} {name}" for name, number in trajectory.counters.items())),
    ]
    if len(trajectory.t):
        rows.append((f"energy of {PLANT_ALONE}" if foreign else "V_c at both ends", _ends(level.V_c)))
    known = trajectory.scene.certificate_in_words(trajectory.sampled)
    rows.append(("certificate", "none: V_c needs the energy of every controller" if foreign else known))
    if not method.energy_check and len(trajectory.t):
        rise = float((level.V_c - np.minimum.accumulate(level.V_c)).max())
        rows.append(("risen by the method", f"{rise:.3g} J of V_c"))
    return _with_words(trajectory.scene, rows)


def _touches(trajectory: Trajectory) -> str:
    """Touches of both sides; what is rare only where it happens."""
    text = ", ".join(str(len(trajectory.times(Transition.TOUCH, side))) for side in (LEFT, RIGHT))
    clamps = sum(len(trajectory.times(Transition.CLAMP, side)) for side in (LEFT, RIGHT))
    sticks = len(trajectory.times(Transition.STICK, OBJECT))
    return text + (f"; {clamps} times u' < -1/p" if clamps else "") + (f"; {sticks} times stuck" if sticks else "")


def describe_recording(recording: Recording) -> list[Row]:
    """What is in a bag."""
    scene = recording.scene
    per_topic = ", ".join(f"{name} {count}" for name, count in recording.counts.items())
    missing = {name: count for name, count in recording.missing.items() if count}
    rows = [
        ("bag", str(recording.path)),
        ("scene", scene.title),
        ("feedback", scene.feedback_in_words(sampled=True)),
        ("recorded", f"{recording.t[-1] if len(recording.t) else 0.0:g} s of {scene.duration:g} s"),
        ("messages", per_topic),
        ("lost", ", ".join(f"{name} {count}" for name, count in missing.items()) or "nothing"),
        ("end", recording.lost["end"]),
        ("recorded with", ", ".join(f"{name} {version}" for name, version in recording.versions.items())),
    ]
    for tick, numbers in recording.changes.items():
        rows.append((f"set at {scene.time_of(tick):g} s", ", ".join(f"{name} {n:g}" for name, n in numbers.items())))
    if len(recording.tick):
        mode = recording.lyapunov[:, 3]
        begun = [_beginnings(mode, flag) for flag in (Mode.LEFT, Mode.RIGHT)]
        rows.insert(5, ("contacts left, right", f"{begun[0]}, {begun[1]} seen at the ticks"))
        rows.insert(6, ("V at both ends", _ends(recording.lyapunov[:, 0])))
        rows.insert(7, ("V_c at both ends", _ends(recording.lyapunov[:, 1])))
        rows.insert(8, ("certificate", scene.certificate_in_words(sampled=True)))
        rows.insert(9, ("energy balance", f"{recording.alarms} alarms" if recording.alarms else "closes at every tick"))
    return _with_words(scene, rows)


def _with_words(scene: Scene, rows: list[Row]) -> list[Row]:
    """What to watch for, and what the scene can hardly mean."""
    watch = [("watch for", scene.watch)] if scene.watch else []
    return [*rows, *watch, *(("warning", warning) for warning in scene.warnings)]


class Comparison(NamedTuple):
    """A recorded motion beside the same scene without ROS."""

    equal: bool  # to the sampled simulation, bit for bit
    offset: Array | None  # (6,), largest distance from continuous feedback, m and m/s; None if it has none of its own

    @property
    def rows(self) -> list[Row]:
        """For `table`."""
        rows = [("same without ROS", "equal, bit for bit" if self.equal else "NOT EQUAL")]
        if self.offset is not None:
            far = ", ".join(
                f"{name} {distance:.3g}"
                for name, distance in zip(("x_l", "x_o", "x_r"), self.offset[0::2], strict=True)
                if not np.isnan(distance)
            )
            rows.append(("from continuous feedback", f"at most {far} m"))
        return rows


def compare_recording(recording: Recording, accuracy: float) -> Comparison:
    """Simulate a recorded scene without ROS, with commands that are held and with the paper's continuous feedback."""
    times, scene = recording.t, recording.scene
    same = simulate(scene, sampled=True, grid=times, accuracy=accuracy, changes=recording.changes)
    equal = _equal(same, recording)
    if scene.sampled or recording.changes:
        return Comparison(equal, None)
    ideal = simulate(scene, grid=times, accuracy=accuracy)
    return Comparison(equal, np.abs(ideal.state - recording.state).max(axis=0))


def _equal(same: Trajectory, recording: Recording) -> bool:
    """Whether states, commands and the inputs that the bag knows have the same bits."""
    if len(same.t) != len(recording.t):
        return False
    known = ~np.isnan(recording.inputs).any(axis=1)  # not at the last tick
    pairs = (
        (same.state, recording.state), (same.command, recording.command),
        (same.inputs[known], recording.inputs[known]),
    )
    return all(simulated.tobytes() == recorded.tobytes() for simulated, recorded in pairs)


def _ends(values: Array) -> str:
    return f"{values[0]:.6g} J, {values[-1]:.6g} J"


def _beginnings(mode: Array, flag: Mode) -> int:
    touching = (np.nan_to_num(mode).astype(int) & int(flag)) != 0
    return int(np.count_nonzero(touching[1:] & ~touching[:-1]) + touching[0])

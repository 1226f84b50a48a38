"""Short tables in plain text: what a simulation or a bag contains."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from grasp_ros.graph.recording import Recording
from grasp_ros.graph.verify import Verification, laws_of, verify
from grasp_ros.methods.contract import UNITS
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.model import Array, Mode
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import LYAPUNOV_NAMES
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
    resets = len(recording.starts) - 1
    missing = {name: count for name, count in recording.missing.items() if count}
    rows = [
        ("bag", str(recording.path)),
        ("scene", scene.title),
        ("feedback", scene.feedback_in_words(sampled=True)),
        ("run", recording.running.words + (f", {resets} resets" if resets > 0 else "")),
        ("recorded", f"{recording.t[-1] if len(recording.t) else 0.0:g} s of {scene.duration:g} s"),
        ("messages", per_topic),
        ("lost", ", ".join(f"{name} {count}" for name, count in missing.items()) or "nothing"),
        ("end", recording.lost["end"]),
        ("recorded with", ", ".join(f"{name} {version}" for name, version in recording.versions.items())),
    ]
    for tick, numbers in recording.changes.items():
        rows.append((f"set at {scene.time_of(tick):g} s", ", ".join(f"{name} {n:g}" for name, n in numbers.items())))
    if len(recording.tick):
        named = dict(zip(LYAPUNOV_NAMES, recording.lyapunov.T, strict=True))
        mode, level = named["mode"], recording.energy
        of = "" if recording.closed else " of the plant alone"
        begun = [_beginnings(mode, flag) for flag in (Mode.LEFT, Mode.RIGHT)]
        rows.insert(6, ("contacts left, right", f"{begun[0]}, {begun[1]} seen at the ticks"))
        rows.insert(7, (f"V{of}", _ends(level.V)))
        rows.insert(8, (f"V_c{of}", _ends(level.V_c)))
        rows.insert(9, ("certificate", scene.certificate_in_words(sampled=True) if recording.closed else
                        "none: the law of a controller is not known"))
        rows.insert(10, ("work of the held forces", f"{0.5 * float(np.nansum(named['work'])):.6g} J"))
        alarms = f"{recording.alarms} alarms" if recording.alarms else "closes at every tick"
        rows.insert(11, ("energy balance", alarms))
    return _with_words(scene, rows)


def _with_words(scene: Scene, rows: list[Row]) -> list[Row]:
    """What to watch for, and what the scene can hardly mean."""
    watch = [("watch for", scene.watch)] if scene.watch else []
    return [*rows, *watch, *(("warning", warning) for warning in scene.warnings)]


class Comparison(NamedTuple):
    """A recorded motion beside the same scene without ROS."""

    equal: bool  # every bit is as it should be
    own: bool  # whether all commands are those of the scene's laws, in lockstep and without a reset
    offset: Array | None  # (6,), largest distance from continuous feedback, m and m/s; None if it has none of its own
    verification: Verification
    laws: dict[str, str]  # whose commands these are, by side

    @property
    def rows(self) -> list[Row]:
        """For `table`."""
        rows = [(f"{side} controller", law) for side, law in self.laws.items()]
        rows.append(("verified", self.verification.words))
        if self.own:
            rows.append(("same without ROS", "equal, bit for bit" if self.equal else "NOT EQUAL"))
        if self.offset is not None:
            far = ", ".join(
                f"{name} {distance:.3g}"
                for name, distance in zip(("x_l", "x_o", "x_r"), self.offset[0::2], strict=True)
                if not np.isnan(distance)
            )
            rows.append(("from continuous feedback", f"at most {far} m"))
        return rows


def compare_recording(recording: Recording) -> Comparison:
    """Simulate a recorded scene again: with its recorded inputs, and with the scene's laws if it was these that ran.

    With the scene's laws also under the paper's continuous feedback, to say how far from it the held commands lead.
    """
    times, scene, accuracy = recording.t, recording.scene, recording.running.accuracy
    verification, laws = verify(recording), laws_of(recording)
    own = recording.running.lockstep and len(recording.starts) <= 1 and not any(map(_foreign, laws.values()))
    if not own:
        return Comparison(verification.holds, own, None, verification, laws)
    same = simulate(scene, sampled=True, grid=times, accuracy=accuracy, changes=recording.changes)
    equal = verification.difference is None and _equal(same, recording)
    if scene.sampled or recording.changes:
        return Comparison(equal, own, None, verification, laws)
    ideal = simulate(scene, grid=times, accuracy=accuracy)
    return Comparison(equal, own, np.abs(ideal.state - recording.state).max(axis=0), verification, laws)


def _foreign(law: str) -> bool:
    return law.startswith("foreign")


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

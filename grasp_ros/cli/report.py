"""Short tables in plain text: what a simulation or a bag contains."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.graph.recording import Recording
from grasp_ros.methods.contract import UNITS
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.errors import printable
from grasp_ros.physics.model import Array, Mode
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from grasp_ros.simulation import Trajectory
from grasp_ros.simulation.quantities import SETTLED
from grasp_ros.simulation.summary import MOTION, OUTPUTS

Row = tuple[str, str]


def table(rows: Iterable[Row]) -> str:
    """Two aligned columns."""
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    return printable("\n".join(f"{name:<{width}}  {value}" for name, value in rows))


def data_of(rows: Iterable[Row]) -> dict[str, str]:
    """The same as data, by names without blanks."""
    return {name.replace(",", "").replace(" ", "_"): value for name, value in rows}


def describe_trajectory(trajectory: Trajectory, found: dict[str, Any]) -> list[Row]:
    """What happened in a simulation, in words, with its `summary`; inf and nan are shown as they are."""
    method, own = METHODS[trajectory.method], found["controllers"]
    rows = [
        ("scene", found["title"]), ("feedback", found["feedback"]),
        *((f"{side} controller", name) for side, name in own.items()),
        ("status", trajectory.stop or trajectory.status.value), ("simulated", _simulated(found)),
        *([("at rest", f"from {found['at_rest_s']:.6g} s on")] if "at_rest_s" in found else []),
        ("touches left, right", _touches(found) if method.events else "not looked for"),
        ("method", f"{method.name}, {method.knob} {trajectory.setting:g}{UNITS[method.knob]}"),
        ("work", ", ".join(f"{number} {name}" for name, number in found["work"].items())),
    ]
    if "V_c_J" in found:
        ends = "both ends" if trajectory.status is Status.DONE else "first and last output"
        rows.append((f"V_c of {PLANT_ALONE}" if own else f"V_c at {ends}", _ends(found["V_c_J"])))
        rows += _amounts(found)
    known = trajectory.scene.certificate_in_words(trajectory.sampled)
    rows.append(("certificate", "none: V_c needs the energy of every controller" if own else known))
    if "V_c_rise_J" in found:
        rows.append(("risen by the method", f"{found['V_c_rise_J']:.3g} J of V_c"))
    return _with_words(trajectory.scene, rows)


def _simulated(found: dict[str, Any]) -> str:
    """How far the output times go, and how far they should."""
    of = "" if found["status"] == Status.DONE.name else f" of {found['duration_s']:g} s"
    return f"{found['reached_s']:g} s{of}, {found['output_times']} output times"


def _amounts(found: dict[str, Any]) -> list[Row]:
    """Settling times, largest forces, and the energy lost by cause, as far as the scene has them."""
    rows = []
    if "settled_s" in found:
        times, never = found["settled_s"], f"not within {found['settled_within_s']:g} s"
        settled = ", ".join(f"{name} {time:.2f} s" for name, time in times.items())
        rows.append((f"settled to {SETTLED:.0%}", settled if np.isfinite([*times.values()]).all() else never))
    largest = [f"{name} {value:.5g} N" for name, value in found["largest_N"].items() if value > 0.0]
    if largest:
        exact = found["largest_of"] == MOTION
        rows.append(("largest forces" if exact else "largest at outputs", ", ".join(largest)))
    if "lost_J" in found:
        parts = [f"{name} {value:.4g}" for name, value in found["lost_J"].items() if value != 0.0]
        how = "; trapezoidal rule at the output times" if parts and found["lost_by"] == OUTPUTS else ""
        rows.append(("energy lost, J", (", ".join(parts) or "none") + how))
    return rows


def _touches(found: dict[str, Any]) -> str:
    """Touches of both sides; what is rare only where it happens."""
    clamps, sticks = sum(found["clamped"].values()), found["sticks"]
    text = ", ".join(map(str, found["touches"].values()))
    return text + (f"; {clamps} times u' < -1/p" if clamps else "") + (f"; {sticks} times stuck" if sticks else "")


def describe_recording(recording: Recording) -> list[Row]:
    """What is in a bag."""
    scene = recording.scene
    per_topic = ", ".join(f"{name} {count}" for name, count in recording.counts.items())
    resets = len(recording.starts) - 1
    missing = {name: count for name, count in recording.missing.items() if count}
    lost = ", ".join(f"{name} {count}" for name, count in missing.items()) or "nothing"
    rows = [
        ("bag", str(recording.path)),
        ("scene", scene.title),
        ("feedback", scene.feedback_in_words(sampled=True)),
        ("run", recording.running.words + (f", {resets} resets" if resets > 0 else "")),
        *_timing(recording),
        ("recorded", f"{recording.t[-1] if len(recording.t) else 0.0:g} s of {scene.duration:g} s"),
        ("messages", per_topic),
        ("lost", lost),
        ("end", recording.lost["end"]),
        ("recorded with", ", ".join(f"{name} {version}" for name, version in recording.versions.items()) or "not said"),
    ]
    for tick, numbers in recording.changes.items():
        rows.append((f"set at {scene.time_of(tick):g} s", ", ".join(f"{name} {n:g}" for name, n in numbers.items())))
    if len(recording.tick):
        named = dict(zip(LYAPUNOV_NAMES, recording.lyapunov.T, strict=True))
        mode, level = named["mode"], recording.energy
        of = "" if recording.closed else " of the plant alone"
        begun = [_beginnings(mode, flag) for flag in (Mode.LEFT, Mode.RIGHT)]
        at = rows.index(("lost", lost))
        rows[at:at] = [
            ("contacts left, right", f"{begun[0]}, {begun[1]} seen at the ticks"),
            (f"V{of}", _ends(level.V)), (f"V_c{of}", _ends(level.V_c)),
            ("certificate", scene.certificate_in_words(sampled=True) if recording.closed else
             "none: the law of a controller is not known"),
            ("work of the held forces", f"{0.5 * float(np.nansum(named['work'])):.6g} J"),
            ("energy balance", f"{recording.alarms} alarms" if recording.alarms else "closes at every tick"),
        ]
    return _with_words(scene, rows)


def _timing(recording: Recording) -> list[Row]:
    """What a free run came to."""
    if not recording.timing:
        return []
    ages = "; ".join(f"{side} {most:.0f}, 99 % {usual:.0f}" for side, (usual, most) in recording.ages.items())
    given_up = float(recording.timing["lost_s"][-1])
    return [
        ("reached", f"{recording.reached:.3g} s in a second, {recording.overruns} overruns, {given_up:.2g} s given up"),
        ("oldest commands", f"{ages or 'none'}, periods"),
    ]


def _with_words(scene: Scene, rows: list[Row]) -> list[Row]:
    """What to watch for, and suspicious settings."""
    watch = [("watch for", scene.watch)] if scene.watch else []
    return [*rows, *watch, *(("warning", warning) for warning in scene.warnings)]


def _ends(values: Array | Sequence[float]) -> str:
    return f"{values[0]:.6g} J, {values[-1]:.6g} J (twice the energy)"


def _beginnings(mode: Array, flag: Mode) -> int:
    touching = (np.nan_to_num(mode).astype(int) & int(flag)) != 0
    return int(np.count_nonzero(touching[1:] & ~touching[:-1]) + touching[0])

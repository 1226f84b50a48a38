"""Short tables in plain text: what a simulation or a bag contains."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.contract import UNITS
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.errors import printable
from grasp_ros.physics.layout import Body, Entry, Transition
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory
from grasp_ros.simulation.chunk import SETTLED
from grasp_ros.simulation.quantities import MOTION, OUTPUTS, TICKS

if TYPE_CHECKING:  # types of bags take long to import, and a simulation has none
    from grasp_ros.graph.bag.recording import Recording
    from grasp_ros.graph.bag.verify import Verification
    from grasp_ros.simulation.differentiate import Sensitivity

Row = tuple[str, str]
LAST_EVENTS = 4  # whose derivatives are shown


def table(rows: Iterable[Row]) -> str:
    """Two aligned columns, a line for each row, also where a value has several lines."""
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    return printable("\n".join(f"{name:<{width}}  {' '.join(value.splitlines())}" for name, value in rows))


def describe_trajectory(trajectory: Trajectory, found: dict[str, Any]) -> list[Row]:
    """What happened in a simulation, in words, with its `summary`; inf and nan are shown as they are."""
    method, own = METHODS[trajectory.method], found["controllers"]
    of = "" if trajectory.status is Status.DONE else f" of {found['duration_s']:g} s"
    touches = "not looked for"
    if method.events:
        clamps, sticks = sum(found["clamped"].values()), found["sticks"]  # which are rare
        touches = ", ".join(map(str, found["touches"].values()))
        touches += (f"; u' < -1/p: {clamps}" if clamps else "") + (f"; stuck: {sticks}" if sticks else "")
    rows = [
        ("scene", found["title"]), ("feedback", found["feedback"]),
        *((f"{side} controller", name) for side, name in own.items()),
        ("status", trajectory.stop or trajectory.status.value),
        ("simulated", f"{found['reached_s']:g} s{of}, {found['output_times']} output times"),
        *([("at rest", f"from {found['at_rest_s']:.6g} s on")] if "at_rest_s" in found else []),
        ("touches left, right", touches),
        ("method", f"{method.name}, {method.knob} {trajectory.setting:g}{UNITS[method.knob]}"),
        ("work", ", ".join(f"{number} {name}" for name, number in found["work"].items())),
    ]
    if "V_c_J" in found:
        ends = "both ends" if found["V_c_at_s"] == [0.0, found["duration_s"]] else "first and last output"
        rows.append((f"V_c of {PLANT_ALONE}" if own else f"V_c at {ends}", _ends(found["V_c_J"])))
        rows += _amounts(found)
    rows.append(("certificate", found["certificate"]))
    if "V_c_rise_J" in found:
        rows.append(("V_c rise", f"{found['V_c_rise_J']:.3g} J, numerical error"))
    return _with_words(trajectory.scene, rows, other=bool(own))


def _amounts(found: dict[str, Any]) -> list[Row]:
    """Settling times, largest forces, and the energy lost by cause, as far as the scene has them."""
    rows = []
    if "settled_s" in found:
        times, never = found["settled_s"], f"not proved within {found['settled_within_s']:g} s"
        settled = ", ".join(f"{name} {time:.2f} s" for name, time in times.items())
        rows.append((f"settled to {SETTLED:.0%}", settled if np.isfinite([*times.values()]).all() else never))
    if "last_outside_s" in found:
        times = found["last_outside_s"].items()
        outside = ", ".join(f"{name} {f'{time:.2f} s' if np.isfinite(time) else 'at the end'}" for name, time in times)
        rows.append((f"last outside {SETTLED:.0%}", f"{outside}; not a proof of settling: V_c may rise"))
    largest = [f"{name.replace('_', ' ')} {value:.5g} N" for name, value in found["largest_N"].items() if value > 0.0]
    if largest:
        names = {MOTION: "largest forces", TICKS: "largest at ticks", OUTPUTS: "largest at outputs"}
        rows.append((names[found["largest_of"]], ", ".join(largest)))
    if "lost_J" in found:
        parts = [f"{name} {value:.4g}" for name, value in found["lost_J"].items() if value != 0.0]
        how = "; trapezoidal rule at the control periods" if parts and found["lost_by"] == TICKS else ""
        rows.append(("energy lost, J", (", ".join(parts) or "none") + how))
    if "work_external_J" in found:
        rows.append(("external work, J", f"{found['work_external_J']:.4g}"))
    return rows


def describe_sensitivity(found: Sensitivity) -> Iterable[Row]:
    """Derivatives of the last state, of V_c there, and of the times of the last events, number by number."""
    for key, own in last_rates(found).items():
        yield f"d / d {key}", f"at t = {own['t']:.6g} s, per unit"
        for body in found.scene.system.present:
            x, v = own["state"][COLUMN[body] : COLUMN[body] + 2]
            yield f"  {NAMES[body]} position, velocity", f"{x:.12g} m, {v:.12g} m/s"
        yield "  V_c", f"{own['V_c']:.12g} J"
        for event in own["events"][-LAST_EVENTS:]:
            what = f"{event['kind'].lower()} {event['body'].lower()}"
            yield f"  {what} at {event['time_s']:.6g} s", f"{event['rate']:.12g} s"
    if found.corner is not None:
        yield "one-sided derivatives differ", f"from t = {found.corner:.6g} s on: {found.corner_reason}"


def last_rates(found: Sensitivity) -> dict[str, dict[str, Any]]:
    """Derivatives as data, number by number: at the last time of the state (6,) and V_c, and of the times of events."""
    level_rates = found.V_c_rates[-1]
    return {
        key: {"t": found.t[-1], "state": found.state_rates[-1, :, j], "V_c": level_rates[j],
              "corner": found.corner, "corner_reason": found.corner_reason, "events": [
                  {"time_s": event[Entry.TIME], "kind": Transition(int(event[Entry.KIND])).name,
                   "body": Body(int(event[Entry.BODY])).name, "rate": rate}
                  for event, rate in zip(found.event_table, found.event_rates[:, j], strict=True)]}
        for j, key in enumerate(found.keys)
    }


def describe_recording(recording: Recording, found: dict[str, Any]) -> list[Row]:
    """What is in a bag, with its `summary`."""
    resets, missing = found["resets"], [f"{name} {count}" for name, count in found["missing"].items()]
    of = "" if recording.closed else f" of {PLANT_ALONE}"
    left, right = found["contacts"].values()
    balanced, known = found["balanced_ticks"], not np.isnan(found["work_J"])
    lacks = np.isnan(recording.lyapunov).all(axis=1).any()  # numbers of the monitor
    unknown = np.count_nonzero(~recording.law_known)
    none = "unknown: lyapunov missing" if lacks else (
        f"none: at {unknown} of {found['ticks']} ticks the monitor did not know the law of the commands")
    closes = "closes at every tick" if known else (
        f"closes at {balanced} of {recording.tick[-1] + 1} ticks, the others are not known")
    topics: dict[tuple[float, float], list[str]] = {}  # by how many messages they have, and how often
    for name, numbers in found["topics"].items():
        rate = 0.0 if np.isnan(numbers["rate_Hz"]) else numbers["rate_Hz"]
        topics.setdefault((numbers["messages"], rate), []).append(name)
    rows = [
        ("bag", found["bag"]),
        ("size", f"{found['size_bytes'] / 1e6:.3g} MB"),
        ("scene", found["title"]),
        ("feedback", found["feedback"]),
        ("run", recording.running.words + (f", resets: {resets}" if resets else "")),
        *_timing(found),
        ("recorded", recorded_span(recording)),
        ("messages", "; ".join(f"{count}{f' at {rate:.4g} Hz' if rate else ''}: {', '.join(names)}"
                               for (count, rate), names in sorted(topics.items(), reverse=True))),
        ("contacts left, right", f"{left}, {right} seen at the ticks"),
        (f"V{of}", _ends(found["V_J"])), (f"V_c{of}", _ends(found["V_c_J"])),
        ("certificate", recording.scene.certificate_in_words(sampled=True) if recording.closed else none),
        ("work of the held forces", f"{found['work_J']:.6g} J" if known else "not known"),
        ("energy balance", f"{found['alarms']} alarms" if found["alarms"] else closes),
        ("lost", ", ".join(missing) or "nothing"),
        ("end", found["end"]),
        *((name.replace("_", " "), found[name]) for name in ("recovered_from", "what_was_left_out") if name in found),
        ("recorded with", ", ".join(f"{name} {version}" for name, version in found["recorded_with"].items())
         or "not said"),
    ]
    for tick, numbers in recording.changes.items():
        values = ", ".join(f"{name} {number:g}" for name, number in numbers.items())
        rows.append((f"set at {recording.scene.time_of(tick):g} s", values))
    return _with_words(recording.scene, rows, other=not recording.closed or bool(recording.changes))


def recorded_span(recording: Recording) -> str:
    """Which part of a scene a bag has, and in how many runs of it."""
    begin, end, runs = recording.t[0], recording.t[-1], recording.resets + 1
    return (f"{begin:g} to " if begin else "") + f"{end:g} s of {recording.scene.duration:g} s" + (
        f", in {runs} runs of the scene" if runs > 1 else "")


def describe_verification(verification: Verification) -> list[Row]:
    """Whose commands a bag has, and whether its numbers follow from them."""
    rows = [(f"{side} controller", str(found)) for side, found in verification.answers.items()]
    rows.append(("verified", verification.words))
    if verification.same is not None:
        rows.append(("same without ROS", "equal, bit for bit: the states and commands of every recorded tick"
                     if verification.same else "NOT EQUAL"))
    return rows


def _timing(found: dict[str, Any]) -> list[Row]:
    """What a free run came to."""
    if "overruns" not in found:
        return []
    ages = "; ".join(f"{side} at most {age['max']:.0f} periods, 99 % at most {age['p99']:.0f}"
                     for side, age in found["command_age_periods"].items())
    late = [f"{side} for {count} periods" for side, count in found["timed_out_periods"].items() if count]
    return [
        ("reached", f"{found['reached_s_per_s']:.3g} s per second, {found['overruns']} overruns,"
                    f" {found['given_up_s']:.2g} s given up"),
        ("age of commands", ages or "none came"),
        *([("timed out", f"{', '.join(late)}, in which its last command was older than the timeout")] if late else []),
    ]


def _with_words(scene: Scene, rows: list[Row], other: bool) -> list[Row]:
    """What to watch for, unless other laws or gains acted than the scene has, and suspicious settings."""
    watch = [("watch for", scene.watch)] if scene.watch and not other else []
    return [*rows, *watch, *(("warning", warning) for warning in scene.warnings)]


def _ends(values: Array | Sequence[float]) -> str:
    return f"{values[0]:.6g} J, {values[-1]:.6g} J (twice the energy)"

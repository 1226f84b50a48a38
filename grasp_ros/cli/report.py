"""Short tables in plain text: what a simulation or a bag contains."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.graph.recording import Recording
from grasp_ros.methods.contract import UNITS
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.errors import printable
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.model import Array, Mode
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from grasp_ros.simulation import Trajectory
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.losses import losses
from grasp_ros.simulation.quantities import HORIZONS, SETTLED, by_output_times, impact_forces_of, settling_times

Row = tuple[str, str]


def table(rows: Iterable[Row]) -> str:
    """Two aligned columns."""
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    return printable("\n".join(f"{name:<{width}}  {value}" for name, value in rows))


@np.errstate(over="ignore", invalid="ignore")
def describe_trajectory(trajectory: Trajectory) -> list[Row]:
    """What happened in a simulation; inf and nan are shown as they are."""
    level = trajectory.energy
    method = METHODS[trajectory.method]
    foreign = [(f"{side} controller", name) for side, name in trajectory.controllers.items()]
    rows = [
        ("scene", trajectory.scene.title),
        ("feedback", trajectory.scene.feedback_in_words(trajectory.sampled, bool(foreign))),
        *foreign,
        ("status", trajectory.stop or trajectory.status.value),
        ("simulated", _simulated(trajectory)),
        *([("at rest", f"from {trajectory.at_rest:.6g} s on")] if trajectory.at_rest is not None else []),
        ("touches left, right", _touches(trajectory) if method.events else "not looked for"),
        ("method", f"{method.name}, {method.knob} {trajectory.setting:g}{UNITS[method.knob]}"),
        ("work", ", ".join(f"{number} {name}" for name, number in trajectory.counters.items())),
    ]
    if len(trajectory.t):
        ends = "both ends" if trajectory.status is Status.DONE else "first and last output"
        rows.append((f"V_c of {PLANT_ALONE}" if foreign else f"V_c at {ends}", _ends(level.V_c)))
        rows += _amounts(trajectory)
    known = trajectory.scene.certificate_in_words(trajectory.sampled)
    rows.append(("certificate", "none: V_c needs the energy of every controller" if foreign else known))
    if not method.energy_check and len(trajectory.t):
        rise = float((level.V_c - np.minimum.accumulate(level.V_c)).max())
        rows.append(("risen by the method", f"{rise:.3g} J of V_c"))
    return _with_words(trajectory.scene, rows)


def _simulated(trajectory: Trajectory) -> str:
    """How far the output times go, and how far they should."""
    end, times = trajectory.scene.duration, f"{len(trajectory.t)} output times"
    if trajectory.status is Status.DONE:
        return f"{end:g} s, {times}"
    return f"{trajectory.t[-1] if len(trajectory.t) else 0.0:g} s of {end:g} s, {times}"


def _amounts(trajectory: Trajectory) -> list[Row]:
    """Settling times, largest forces, and the energy lost by cause, as far as the scene has them."""
    system = trajectory.scene.system
    rows = []
    if settled := _settled(trajectory):
        rows.append((f"settled to {SETTLED:.0%}", settled))
    exact, largest = _largest(trajectory)
    shown = [f"{name} {value:.5g} N" for name, value in largest.items() if value > 0.0]
    if shown:
        rows.append(("largest forces" if exact else "largest at outputs", ", ".join(shown)))
    if len(trajectory.t) > 1 and not system.external:
        lost = losses(trajectory)
        parts = [f"{name} {float(value):.4g}" for name, value in lost._asdict().items() if float(value) != 0.0]
        how = "; trapezoidal rule at the output times" if parts and by_output_times(trajectory) else ""
        rows.append(("energy lost, J", (", ".join(parts) or "none") + how))
    return rows


def _settled(trajectory: Trajectory) -> str:
    """When each mass settled for good; nothing where V_c does not prove it, because it can rise or bounds no place."""
    times, scene = settling_times(trajectory), trajectory.scene
    if np.isnan(times).any():
        return ""
    if np.isinf(times).any():
        looked = trajectory.t[-1] if by_output_times(trajectory) else HORIZONS * scene.duration
        return f"not within {looked:g} s"
    return ", ".join(f"{NAMES[body]} {times[COLUMN[body] // 2]:.2f} s" for body in scene.system.present)


def _largest(trajectory: Trajectory) -> tuple[bool, dict[str, float]]:
    """Largest inputs and impact forces in N: of the motion itself if it can be watched once more, or at the outputs."""
    names = ("f_l", "f_r", "fw_l", "fw_r")
    exact = trajectory.method == EXACT and trajectory.status is Status.DONE and not trajectory.controllers
    if exact:
        setup = Setup(accuracy=trajectory.setting, sampled=trajectory.sampled)
        columns = ensemble(trajectory.scene, {}, ("peak_input", "peak_impact"), setup=setup, threads=1).columns
        return True, dict(zip(names, (float(column[0]) for column in columns.values()), strict=True))
    inputs, impacts = np.abs(trajectory.command).max(axis=0), impact_forces_of(trajectory).max(axis=0)
    return False, dict(zip(names, [*inputs.tolist(), *impacts.tolist()], strict=True))


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
    """What to watch for, and what the scene can hardly mean."""
    watch = [("watch for", scene.watch)] if scene.watch else []
    return [*rows, *watch, *(("warning", warning) for warning in scene.warnings)]


def _ends(values: Array) -> str:
    return f"{values[0]:.6g} J, {values[-1]:.6g} J (twice the energy)"


def _beginnings(mode: Array, flag: Mode) -> int:
    touching = (np.nan_to_num(mode).astype(int) & int(flag)) != 0
    return int(np.count_nonzero(touching[1:] & ~touching[:-1]) + touching[0])

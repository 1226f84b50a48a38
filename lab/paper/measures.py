"""What a scene is measured by when two scenes are compared, from one start and from many."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import energy
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.chunk import HORIZONS, SETTLED, Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.quantities import settled_distance
from lab.paper.cases import OFFSETS, POSITIONS, Start, start_of, started, text_of, value_of

STRETCH = 20.0  # s, the paper's time axis
SAMPLE = 4e-3  # s, of means and of changes of a sign
LIMIT = HORIZONS * STRETCH  # s; what has not settled by then counts as never
BOUNDS: Mapping[str, float] = {"settling": SETTLED, "settling_1": 0.01, "settling_5": 0.05}
MARGIN = 1.05  # a measure is higher or lower if it is so by more than 5 %
ALIKE = 0.005  # times that differ by less are one


class Motion(NamedTuple):
    """What one run over the paper's 20 s tells."""

    rest: float  # V_c at 20 s, in V_c(0)
    size: float  # root of the mean square of the arms' displacements, in the larger initial displacement
    frequency: float  # Hz: half the changes of the sign of x_l' and x_r' per second and arm
    lopsided: float  # largest |x_l + x_r|, in the larger initial displacement


class Measure(NamedTuple):
    """What a number is called."""

    name: str
    short: str = ""  # where there is little room; the others are in no figure
    unit: str = ""  # times have words of their own, the others none


MEASURES: Mapping[str, Measure] = {
    "settling": Measure("settling time, 2 %", "settling time"),
    "settling_1": Measure("settling time, 1 %"),
    "settling_5": Measure("settling time, 5 %"),
    "swings": Measure("settling time, 2 %, in swings of a free arm"),
    "rest": Measure("V_c at 20 s in V_c(0)", "$V_c$ at 20 s"),
    "size": Measure("root mean square displacement of the arms over 20 s", "rms displacement"),
    "frequency": Measure("frequency of the arms over 20 s", "frequency", " Hz"),
    "input": Measure("largest input force", "largest input", " N"),
    "lopsided": Measure("largest |x_l + x_r| over 20 s", "largest $|x_l + x_r|$"),
}
_MOTION = "motion"
_KNOWN: dict[tuple[str, str], dict[Start, Any]] = {}  # by a scene but for its start, and what one run measures


def over(scene: Scene, starts: Sequence[Start], name: str) -> list[float]:
    """A measure of a scene from many starts, or what is remembered of it; a time behind LIMIT is infinite."""
    kind = "settling" if name == "swings" else _MOTION if name in Motion._fields else name
    known = _KNOWN.setdefault((text_of(scene, start=False), kind), {})
    missing = [start for start in dict.fromkeys(starts) if start not in known]
    if missing:
        known.update(zip(missing, _measured(scene, missing, kind), strict=True))
    found = [known[start] for start in starts]
    if name == "swings":
        return [time / _period(scene) for time in found]
    return [getattr(each, name) for each in found] if name in Motion._fields else found


def measure(scene: Scene, name: str) -> float:
    """The same of a scene from its own start."""
    return over(scene, [start_of(scene)], name)[0]


def _measured(scene: Scene, starts: Sequence[Start], kind: str) -> Sequence[Any]:
    if kind == _MOTION:
        return [_motion(started(scene, start)) for start in starts]
    outcome, bound = ("settling_time", BOUNDS[kind]) if kind in BOUNDS else ("peak_input", SETTLED)
    rows = {key: values for key, *values in zip(POSITIONS, *starts, strict=True) if key.split(".")[0] in scene.values}
    found = ensemble(scene, rows, (outcome,), setup=Setup(horizons=HORIZONS, settled=bound))
    if not found.done.all():
        raise RuntimeError(f"{scene.name}: {next(iter(found.stops.values()))}")
    return [float(value) for value in np.max([*found.columns.values()], axis=0)]


def _motion(scene: Scene) -> Motion:
    run = simulate(scene, grid=np.linspace(0.0, STRETCH, round(STRETCH / SAMPLE) + 1))
    if run.status is not Status.DONE:
        raise RuntimeError(f"{scene.name}: {run.stop}")
    states, V_c = run.state, energy(scene.system, run.state[[0, -1]]).V_c
    farthest = settled_distance(scene, 1.0)
    turns = sum(np.count_nonzero(np.diff(np.sign(states[1:, column]))) for column in (1, 5))
    return Motion(
        rest=float(V_c[-1] / V_c[0]),
        size=float(np.sqrt(np.mean(states[:, [0, 4]] ** 2))) / farthest,
        frequency=turns / 4.0 / STRETCH,
        lopsided=float(np.abs(states[:, 0] + states[:, 4]).max()) / farthest,
    )


def _period(scene: Scene) -> float:
    """Of the left arm where nothing touches and nothing damps it, in s."""
    stiffness = value_of(scene, "k") + value_of(scene, "Kp")
    return 2.0 * math.pi * math.sqrt(value_of(scene, "m_l") / stiffness) if stiffness else np.inf


def ratio(changed: float, other: float) -> float:
    """A measure over another; 1 if both are infinite, as neither is then the larger one; nan over 0: there is none."""
    if np.isinf(changed) and np.isinf(other):
        return 1.0
    return changed / other if other else np.nan


def near(start: Start) -> tuple[Start, ...]:
    """Starts that cannot be told apart from one: digits of a settling time that differ among them mean nothing."""
    return tuple(start._replace(x_l=start.x_l + offset) for offset in OFFSETS)


def settlings(scene: Scene) -> list[float]:
    """Settling times from `near`, in s."""
    return over(scene, near(start_of(scene)), "settling")


def seconds(times: Sequence[float]) -> str:
    """Times in s as text: their range where they differ by more than half a percent, and no digits that differ."""
    if all(map(np.isinf, times)):
        return "never"
    low, high = min(times), max(times)
    if np.isinf(high):
        return f"{low:.3g} s to never"
    if high - low <= ALIKE * high:
        return f"{low:.3g} s"
    return f"{low:.3g} to {high:.3g} s"

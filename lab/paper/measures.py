"""What a scene is measured by when two scenes are compared, and its settling times from many starts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.observe.sight import Wanted
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import Transition
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.outcomes import find, of_one
from grasp_ros.simulation.quantities import HORIZONS, SETTLED, settled_distance, settling_times, watch_again
from grasp_ros.simulation.trajectory import Trajectory
from lab.paper.cases import OFFSETS, Start, columns_of, start_of, started, text_of, value_of

STRETCH = 20.0  # s, the paper's time axis
SAMPLE = 4e-3  # s, of means and of changes of a sign
LIMIT = HORIZONS * STRETCH  # s; what has not settled by then counts as never
BOUNDS = (0.01, SETTLED, 0.05)
MARGIN = 1.05  # a measure is higher or lower if it is so by more than 5 %
ALIKE = 0.005  # times that differ by less are one


class Measures(NamedTuple):
    """Numbers of one scene; a time that lies behind LIMIT is infinite."""

    settling: float  # s, the last of the three masses, 2 %
    settling_1: float  # s, 1 %
    settling_5: float  # s, 5 %
    swings: float  # settling, 2 %, in periods of a free arm
    rest: float  # V_c at 20 s, in V_c(0)
    size: float  # root of the mean square of the arms' displacements over 20 s, in the larger initial displacement
    frequency: float  # Hz: half the changes of the sign of x_l' and x_r' per second and arm, up to 20 s
    input: float  # N, largest input force
    contacts: int  # touches of both sides up to 20 s
    lopsided: float  # largest |x_l + x_r| over 20 s, in the larger initial displacement


NAMES: Mapping[str, str] = {
    "settling": "settling time, 2 %",
    "settling_1": "settling time, 1 %",
    "settling_5": "settling time, 5 %",
    "swings": "settling time, 2 %, in swings of a free arm",
    "rest": "V_c at 20 s in V_c(0)",
    "size": "root mean square displacement of the arms over 20 s",
    "frequency": "frequency of the arms over 20 s",
    "input": "largest input force",
    "lopsided": "largest |x_l + x_r| over 20 s",
}
UNITS: Mapping[str, str] = {
    "settling": " s",
    "settling_1": " s",
    "settling_5": " s",
    "swings": "",
    "rest": "",
    "size": "",
    "frequency": " Hz",
    "input": " N",
    "lopsided": "",
}
SHORT: Mapping[str, str] = {  # ratios, where there is little room
    "settling": "settling time, ratio",
    "rest": "$V_c$ at 20 s, ratio",
    "size": "rms displacement, ratio",
    "frequency": "frequency, ratio",
    "input": "largest input, ratio",
    "lopsided": "largest $|x_l + x_r|$, ratio",
}


_KNOWN: dict[tuple[str, bool], Measures] = {}
_OVER: dict[tuple[str, tuple[Start, ...], str], list[float]] = {}


def measure(scene: Scene, settle: bool = True) -> Measures:
    """Measure a scene, or remember it; without `settle` over 20 s only, and the settling times may be NaN.

    Raises
    ------
    RuntimeError
        If a run does not reach its end.
    """
    text = text_of(scene)
    if (text, True) in _KNOWN:
        return _KNOWN[text, True]
    if (text, settle) not in _KNOWN:
        _KNOWN[text, settle] = _measure(scene, settle)
    return _KNOWN[text, settle]


def remember(known: Mapping[tuple[str, bool], Measures]) -> None:
    """Take measures of another process, by the text of their scenes and `settle`."""
    _KNOWN.update(known)


def _measure(scene: Scene, settle: bool) -> Measures:
    run = simulate(scene, grid=np.linspace(0.0, STRETCH, round(STRETCH / SAMPLE) + 1))
    if run.status is not Status.DONE:
        raise RuntimeError(f"{scene.name}: {run.stop}")
    one, two, five = (
        float(settling_times(run, part, HORIZONS).max()) if settle else np.nan for part in BOUNDS)
    states, V_c = run.state, energy(scene.system, run.state[[0, -1]]).V_c
    farthest = settled_distance(scene, 1.0)
    turns = sum(np.count_nonzero(np.diff(np.sign(states[1:, column]))) for column in (1, 5))
    return Measures(
        settling=two, settling_1=one, settling_5=five, swings=two / _period(scene), rest=float(V_c[-1] / V_c[0]),
        size=float(np.sqrt(np.mean(states[:, [0, 4]] ** 2))) / farthest, frequency=turns / 4.0 / STRETCH,
        input=_largest_input(run),
        contacts=int(np.count_nonzero(run.event_table[:, 2] == Transition.TOUCH)),
        lopsided=float(np.abs(states[:, 0] + states[:, 4]).max()) / farthest,
    )


def _largest_input(run: Trajectory) -> float:
    integrator, watcher = watch_again(run, Wanted.INPUTS)
    integrator.advance(run.scene.duration)
    watcher.finish()
    return max(of_one(find(["peak_input"]), watcher.seen, run.state))


def _period(scene: Scene) -> float:
    """Of the left arm where nothing touches and nothing damps it, in s."""
    stiffness = value_of(scene, "k") + value_of(scene, "Kp")
    return 2.0 * math.pi * math.sqrt(value_of(scene, "m_l") / stiffness) if stiffness else np.inf


def settles(name: str) -> bool:
    """Whether a measure needs longer runs than the paper's 20 s."""
    return name == "swings" or name.startswith("settling")


def ratio(changed: float, other: float) -> float:
    """A measure over another; 1 if both are infinite, as neither is then the larger one; nan over 0: there is none."""
    if np.isinf(changed) and np.isinf(other):
        return 1.0
    return changed / other if other else np.nan


def settlings(scene: Scene) -> list[float]:
    """Settling times from a start that is moved by OFFSETS, in s: digits that differ among them mean nothing."""
    x_l, x_r, x_o = start_of(scene)
    return over(scene, [Start(x_l + offset, x_r, x_o) for offset in OFFSETS], "settling")


def over(scene: Scene, starts: Sequence[Start], name: str) -> list[float]:
    """A measure of a scene from many starts: where an observer tells it, all of them in one call."""
    text = text_of(scene), tuple(starts), name
    if text not in _OVER:
        _OVER[text] = _over(scene, starts, name)
    return _OVER[text]


def _over(scene: Scene, starts: Sequence[Start], name: str) -> list[float]:
    if name == "settling":
        setup = Setup(horizons=HORIZONS)
        found = ensemble(scene, columns_of(starts), ("settling_time",), setup=setup, threads=1)
        if not found.done.all():
            raise RuntimeError(f"{scene.name}: {next(iter(found.stops.values()))}")
        return [float(time) for time in found.columns["settling_time"]]
    if name == "input":
        found = ensemble(scene, columns_of(starts), ("peak_input",), threads=1)
        return [float(force) for force in np.max([*found.columns.values()], axis=0)]
    return [float(getattr(measure(started(scene, start), settles(name)), name)) for start in starts]


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

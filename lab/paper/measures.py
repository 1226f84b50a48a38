"""What a scene is measured by when two scenes are compared: each number from one run with dense output.

A run goes on until the motion is settled for certain. V_c never rises, and at a level V_c no displacement exceeds the
bound of `physics.lyapunov.displacement_bound`; once that bound is inside the distance, nothing leaves it any more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import Law, Of, Transition
from grasp_ros.physics.lyapunov import displacement_bound
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.quantities import SETTLED, last_outside, settled_distance
from lab.paper.cases import OFFSETS, moved, text_of

STRETCH = 20.0  # s, the paper's time axis; a run is a whole number of them
SAMPLE, LATER = 4e-3, 1e-2  # s, how closely |x| is looked at, and after the first stretch; between it is linear
LIMIT = 2400.0  # s; what has not settled by then counts as never
BOUNDS = (0.01, SETTLED, 0.05)
MARGIN = 1.05  # a measure is higher or lower if it is so by more than 5 %
ALIKE = 0.005  # times that differ by less are one


class Measures(NamedTuple):
    """Numbers of one scene; a time that lies behind LIMIT is infinite."""

    settling: float  # s, the last of the three masses, 2 %
    settling_1: float  # s, 1 %
    settling_5: float  # s, 5 %
    settling_l: float  # s, 2 %, mass by mass
    settling_o: float
    settling_r: float
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
    system = scene.system
    distances = [settled_distance(scene, part) for part in BOUNDS]
    integrator = Integrator(system, continuous=True)
    last = np.zeros((len(BOUNDS), 3))
    first: Array = np.empty((0, 6))
    reached, certain = 0.0, False
    while not certain and reached < LIMIT:
        local = np.linspace(0.0, STRETCH, round(STRETCH / (LATER if reached else SAMPLE)) + 1)
        states = integrator.advance(STRETCH, local, start=reached)
        if integrator.status is not Status.DONE:
            raise RuntimeError(f"{scene.name}: {integrator.stop}")
        first = states if reached == 0.0 else first
        for row, distance in enumerate(distances):
            found = last_outside(reached + local, states[:, 0::2], distance)
            last[row] = np.where(found > 0.0, found, last[row])
        reached += STRETCH
        if not settle:
            last[:] = np.nan
        if not (settle and lossy(scene)):
            break
        ahead = displacement_bound(system, float(energy(system, states[-1:]).V_c[0]))
        certain = bool((ahead <= distances[0]).all()) and bool(np.isfinite(last).all())
    if not certain:
        last[last > reached - STRETCH] = np.inf
    return _of(scene, first, integrator, last)


def lossy(scene: Scene) -> bool:
    """Whether anything takes energy; what loses none comes back to near its start (Poincare) and never settles."""
    system = scene.system
    return bool(system.closed_loop[:, Of.DAMPING].any() or system.pairs[:, Law.DISSIPATION].any())


def _of(scene: Scene, states: Array, integrator: Integrator, last: Array) -> Measures:
    """The numbers of a run: its states over the first 20 s, its events, and the last times outside."""
    V_c = energy(scene.system, states[[0, -1]]).V_c
    farthest = settled_distance(scene, 1.0)
    turns = sum(np.count_nonzero(np.diff(np.sign(states[1:, column]))) for column in (1, 5))
    inputs = scene.system.feedback(states)
    table = integrator.event_table
    touches = np.count_nonzero((table[:, 2] == Transition.TOUCH) & (table[:, 0] <= STRETCH))
    one, two, five = last.max(axis=1).tolist()
    left, middle, right = last[1].tolist()
    return Measures(
        settling=two, settling_1=one, settling_5=five, settling_l=left, settling_o=middle, settling_r=right,
        rest=float(V_c[1] / V_c[0]), size=float(np.sqrt(np.mean(states[:, [0, 4]] ** 2))) / farthest,
        frequency=turns / 4.0 / STRETCH, input=float(np.abs(inputs).max()), contacts=int(touches),
        lopsided=float(np.abs(states[:, 0] + states[:, 4]).max()) / farthest,
    )


def ratio(changed: float, other: float) -> float:
    """A measure over another; 1 if both are infinite, as neither is then the larger one."""
    if np.isinf(changed) and np.isinf(other):
        return 1.0
    return changed / other if other else np.inf


def settlings(scene: Scene) -> list[float]:
    """Settling times from a start that is moved by OFFSETS, in s: digits that differ among them mean nothing."""
    return [measure(moved(scene, offset)).settling for offset in OFFSETS]


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

"""What the paper could not show: why stiff arms settle sooner, and that collisions slow arms that are damped."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.losses import losses
from lab.paper.cases import STANDARD, Cases, Start, started, with_values
from lab.paper.measures import over
from lab.paper.motion import first_contact_error, none_missed, without_object
from lab.paper.scatter import Median, median

STIFFNESSES = (5.0, 10.0, 20.0, 40.0, 100.0, 200.0, 400.0, 700.0, 1000.0, 1500.0)  # N/m
DAMPINGS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.7, 1.2, 2.0, 3.5, 5.0)  # C = c + Kv, N s/m
MANY = 30  # random starts whose touches are looked at one by one
STEPS = (1e-3, 1e-2)  # s, plausible for 1990


class Stiffer(NamedTuple):
    """One stiffness: medians over random starts."""

    k: float  # N/m
    settling: Median  # s
    alone: Median  # s, arms without an object
    rate: float  # touches per s, up to the settling time or 20 s; of the first MANY starts, as what follows
    speed: float  # m/s, root mean square speed of approach at a touch
    share: float  # of the energy lost within 20 s: by impacts
    starts: int


def stiffer(cases: Cases, starts: Sequence[Start]) -> list[Stiffer]:
    """Settling time and what makes it, over the stiffness of the arms."""
    found = []
    for k in STIFFNESSES:
        scene = with_values(cases[STANDARD], {"k": k})
        times = over(scene, starts, "settling")
        few = zip(starts[:MANY], times, strict=False)
        rate, speed, share = np.median([_causes(started(scene, start), time) for start, time in few], axis=0).tolist()
        alone = over(without_object(scene), starts, "settling")
        found.append(Stiffer(k, median(times), median(alone), rate, speed, share, len(starts)))
    return found


def _causes(scene: Scene, settling: float) -> tuple[float, float, float]:
    """Touches per s, speed of approach, and the part of the lost energy that impacts took."""
    run = simulate(scene, grid=np.zeros(0))
    span = min(settling, scene.duration)
    touches = run.event_table[(run.event_table[:, 2] == 0) & (run.event_table[:, 0] <= span)]
    lost = losses(run)
    speed = float(np.sqrt(np.mean(touches[:, 4] ** 2))) if len(touches) else 0.0
    return len(touches) / span, speed, float(lost.impacts / lost.total)


class Damped(NamedTuple):
    """One damping of the arms: medians over random starts."""

    C: float  # c + Kv, N s/m
    together: Median  # settling time with the object, s
    alone: Median  # without, s
    later: float  # share of the starts in which the object makes it later
    starts: int

    @property
    def error(self) -> float:
        """Standard error of that share."""
        return float((self.later * (1.0 - self.later) / self.starts) ** 0.5)

    @property
    def slower(self) -> bool:
        """Whether damped arms settle later with the object in most starts, by two standard errors."""
        return self.C > 0.0 and self.later - 2.0 * self.error > 0.5


def damped(cases: Cases, starts: Sequence[Start]) -> list[Damped]:
    """Settling time with and without the object, over the damping of the arms."""
    found = []
    for C in DAMPINGS:
        scene = with_values(cases[STANDARD], {"c": min(C, 0.2), "Kv": C - min(C, 0.2)})
        together, alone = (over(each, starts, "settling") for each in (scene, without_object(scene)))
        later = float(np.mean(np.greater(together, alone)))
        found.append(Damped(C, median(together), median(alone), later, len(starts)))
    return found


class Stepped(NamedTuple):
    """The paper's own method on one case with one step."""

    case: int
    step: float  # s
    error: float  # largest error of a position within 20 s, m
    drift: float  # of V_c in case 2 relative; elsewhere of V_c at 20 s against the exact one, in V_c(0)
    touches: float  # found over those that there are
    first: float  # error of the first time of contact, s


def stepped(cases: Cases) -> list[Stepped]:
    """The paper's method beside the exact motion, at steps of 1 and 10 ms."""
    return [row for number in cases for row in map(partial(_stepped, number, cases[number]), STEPS)]


def _stepped(number: int, scene: Scene, step: float) -> Stepped:
    exact, theirs = simulate(scene), simulate(scene, method="paper", setting=step)
    error = float(np.abs(theirs.state[:, 0::2] - exact.state[:, 0::2]).max())
    level, own = theirs.energy.V_c, exact.energy.V_c
    drift = float((level[-1] - own[-1]) / own[0])
    return Stepped(
        number, step, error, drift, none_missed(step, scene).value, first_contact_error(step, scene).value)

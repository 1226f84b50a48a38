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
from lab.paper.measures import measure
from lab.paper.motion import alone_settling, contacts_found, first_contact_error, run_of

STIFFNESSES = (5.0, 10.0, 20.0, 40.0, 70.0, 100.0, 200.0, 400.0)  # N/m
DAMPINGS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.7, 1.2, 2.0, 3.5, 5.0)  # C = c + Kv, N s/m
FEW = 15  # random starts of each damping
MANY = 30  # of each stiffness, whose effect is smaller
STEPS = (1e-3, 1e-2)  # s, plausible for 1990


class Stiffer(NamedTuple):
    """One stiffness: medians over some random starts."""

    k: float  # N/m
    settling: float  # s
    alone: float  # s, arms without an object
    rate: float  # touches per s, up to the settling time or 20 s
    speed: float  # m/s, root mean square speed of approach at a touch
    share: float  # of the energy lost within 20 s: by impacts
    starts: int


def stiffer(cases: Cases, starts: Sequence[Start]) -> list[Stiffer]:
    """Settling time and what makes it, over the stiffness of the arms."""
    found = []
    for k in STIFFNESSES:
        scenes = [started(with_values(cases[STANDARD], {"k": k}), start) for start in starts[:MANY]]
        rows = [_row(scene) for scene in scenes]
        settling, alone, rate, speed, share = np.median(rows, axis=0).tolist()
        found.append(Stiffer(k, settling, alone, rate, speed, share, len(rows)))
    return found


def _row(scene: Scene) -> tuple[float, float, float, float, float]:
    run = run_of(scene)
    settling = measure(scene).settling
    touches = run.event_table[(run.event_table[:, 2] == 0) & (run.event_table[:, 0] <= min(settling, scene.duration))]
    span = min(settling, scene.duration)
    lost = losses(run)
    speed = float(np.sqrt(np.mean(touches[:, 4] ** 2))) if len(touches) else 0.0
    return settling, alone_settling(scene), len(touches) / span, speed, float(lost.impacts / lost.total)


class Damped(NamedTuple):
    """One damping of the arms: medians over some random starts."""

    C: float  # c + Kv, N s/m
    together: float  # settling time with the object, s
    alone: float  # without, s
    later: float  # share of the starts in which the object makes it later
    starts: int


def damped(cases: Cases, starts: Sequence[Start]) -> list[Damped]:
    """Settling time with and without the object, over the damping of the arms."""
    found = []
    for C in DAMPINGS:
        numbers = {"c": min(C, 0.2), "Kv": C - min(C, 0.2)}
        scenes = [started(with_values(cases[STANDARD], numbers), start) for start in starts[:FEW]]
        together = np.array([measure(scene).settling for scene in scenes])
        alone = np.array([alone_settling(scene) if C > 0.0 else np.inf for scene in scenes])
        medians = float(np.median(together)), float(np.median(alone))
        found.append(Damped(C, *medians, float(np.mean(together > alone)), len(scenes)))
    return found


class Stepped(NamedTuple):
    """The paper's own method on one case with one step."""

    case: int
    step: float  # s
    error: float  # largest error of a position within 20 s, m
    drift: float  # of V_c in case 2 relative; elsewhere of V_c at 20 s against the exact one, in V_c(0)
    rise: float  # largest rise of V_c, in V_c(0)
    touches: float  # found over those that there are
    first: float  # error of the first time of contact, s


def stepped(cases: Cases) -> list[Stepped]:
    """The paper's method beside the exact motion, at steps of 1 and 10 ms."""
    return [row for number in cases for row in map(partial(_stepped, number, cases[number]), STEPS)]


def _stepped(number: int, scene: Scene, step: float) -> Stepped:
    exact = simulate(scene)
    theirs = simulate(scene, method="paper", setting=step)
    level, own = theirs.energy.V_c, exact.energy.V_c
    error = float(np.abs(theirs.state[:, 0::2] - exact.state[:, 0::2]).max())
    rise = float((level - np.minimum.accumulate(level)).max() / level[0])
    return Stepped(
        number,
        step,
        error,
        float((level[-1] - own[-1]) / own[0]),
        rise,
        contacts_found(step, scene),
        first_contact_error(step, scene).value,
    )

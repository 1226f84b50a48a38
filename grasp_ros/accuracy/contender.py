"""What a solver must look like to be measured, and the methods of `grasp simulate` in that shape."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import METHODS, check
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.simulate import simulate

DONE = "done"
OURS = "grasp_ros"


class Answer(NamedTuple):
    """What a solver delivers."""

    state: Array  # (n, 6), m and m/s; fewer rows than asked for if it failed
    touches: tuple[int, int] | None  # left and right; None: it does not look for them
    status: str  # DONE, or why it stopped
    steps: int | None = None  # None: the solver does not say
    right_hand_sides: int | None = None


Solve = Callable[[Array], Answer]  # from the output times, of which the last is the horizon


class Contender(NamedTuple):
    """A solver with the settings to try."""

    family: str  # the package that it comes from
    name: str
    knob: str
    ladder: tuple[float, ...]  # loose to tight
    build: Callable[[Scene, float], Solve]  # raises ImportError if the solver is not installed


def own_contenders(scene: Scene) -> tuple[list[Contender], dict[str, str]]:
    """The methods of `grasp simulate` that can treat a scene, and why the others cannot, by name."""
    found, others = [], {}
    for name in METHODS:
        try:
            check(name, scene, None, sampled=scene.sampled)
        except Refused as refusal:
            others[name] = str(refusal)
            continue
        own = contender_of(name)
        found.append(own._replace(ladder=tuple(setting for setting in own.ladder if setting <= scene.duration)))
    return found, others


def contender_of(name: str) -> Contender:
    """A method of `grasp simulate`."""
    method = METHODS[name]
    return Contender(method.package or OURS, name, method.knob, method.ladder, partial(simulated, name))


def simulated(name: str, scene: Scene, setting: float) -> Solve:
    """A method of `grasp simulate` as a contender builds it."""
    def solve(grid: Array) -> Answer:
        run = simulate(scene, grid=grid, method=name, setting=setting)
        touches = None
        if METHODS[name].events:
            touches = len(run.times(Transition.TOUCH, LEFT)), len(run.times(Transition.TOUCH, RIGHT))
        counts = run.counters
        steps = sum(counts.get(counter, 0) for counter in ("steps", "flights", "contact steps"))
        return Answer(run.state, touches,
                      DONE if run.status is Status.DONE else run.status.value, steps, counts.get("right hand sides"))

    return solve

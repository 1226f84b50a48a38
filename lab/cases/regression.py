"""Regression scenes: each failed a check once; what is right by the reference, and how far the product is from it.

`lab/cases/regression` holds the scenes and the answers: the motion of those that can be compared, and by which rule of
the domain others are refused.
`python -m lab.cases.regression NAME ...` writes the answers to some of them.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gmpy2 import mpfr

from grasp_ros import scene as scenes
from grasp_ros.cli.parser import Parser
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.domain import LARGEST_POSITION, RULES
from grasp_ros.physics.layout import EPS
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene, SceneError
from grasp_ros.simulation import simulate
from lab.cases.case import Verdict
from lab.oracles.rounding_bounds import largest, rates
from lab.reference import integrate

SCENES = Path(__file__).with_name("regression")
ANSWERS = SCENES / "answers.json"
DIGITS = 25
STEPS = 2_500  # of the reference; where it needs more the answer ends earlier
HALVINGS, PARTS = 16, 16  # of the horizon, where it may end
FORGOTTEN = 1e6  # amplification beyond which a comparison tells little
LARGE = LARGEST_POSITION  # m or m/s: where a run ends
DRAWS, TRIES, DRAWN_DIGITS = 2, 50, 20  # of the amplification
TIMES = {"start_s", "length_s", "time_s"}  # must stay whole control periods
EXACT = ("time", "left_sensor", "right_sensor")  # sections whose numbers stay


class Answer(NamedTuple):
    """What is right, at ascending times."""

    t: list[float]  # s
    state: list[list[str]]  # x_l, v_l, x_o, v_o, x_r, v_r in m and m/s with DIGITS digits; 0 of what is not there
    amplification: list[float]  # what one rounding of each number of the scene has become, in roundings of the state
    events: int
    status: str = Status.DONE.name  # OUTSIDE: the motion leaves the domain, and the times end before


def names() -> list[str]:
    """Names of all scenes inside the domain."""
    return sorted({path.stem for path in SCENES.glob("*.yaml")} - refused().keys())


def load(name: str) -> Scene:
    """A scene by its name."""
    return scenes.load(str(SCENES / f"{name}.yaml"))


def refused() -> dict[str, str]:
    """Scenes outside the domain, and how they are refused: what the key ends with, and the rule or what is allowed."""
    return {name: fields["refused"] for name, fields in _known().items() if "refused" in fields}


def refusals() -> Counter[tuple[str, str]]:
    """How many scenes each rule of the domain refuses, by its ratio or its key, and what is allowed."""
    found: Counter[tuple[str, str]] = Counter()
    for name in refused():
        try:
            load(name)
        except SceneError as refusal:
            _, key, sentence = str(refusal).split(": ", 2)
            rule = next((rule.text for rule in RULES if rule.text in sentence), f"`{key.partition('.')[2]}`")
            found[rule, sentence.partition("; allowed: ")[2]] += 1
    return found


def answers() -> dict[str, Answer]:
    """The motions that can be compared, by the name of their scene."""
    return {name: Answer(**fields) for name, fields in _known().items() if "t" in fields}


def _known() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = json.loads(ANSWERS.read_text(encoding="utf-8"))
    return found


def answer(scene: Scene) -> Answer:
    """Integrate a scene with DIGITS digits, at the end of the horizon and not after half of that.

    Or of the part of the horizon that STEPS allow and whose start is not forgotten.
    """
    halves = {scene.duration / 2**k for k in range(HALVINGS + 1)}
    times = sorted(halves | {scene.duration * k / PARTS for k in range(1, PARTS)})
    right = integrate(scene, times, DIGITS, budget=STEPS)
    small = [row for row in right.state if max(map(abs, row)) < LARGE]
    drawn = [integrate(moved, times[: len(small)], DRAWN_DIGITS, budget=STEPS).state for moved in nearby(scene, DRAWS)]
    amplification = []
    for row, *changed in zip(small, *drawn, strict=False):
        changes = np.array([[float(a - b) for a, b in zip(draw, row, strict=True)] for draw in changed])
        amplification.append(float(_relative(changes, _size(scene, row)).max() / EPS))
    last = max((k for k, value in enumerate(amplification) if value <= FORGOTTEN), default=0)
    middle = max((k for k in range(last) if times[k] <= times[last] / 2), default=last)
    kept = sorted({middle, last})
    status = Status.DONE if len(small) == len(right.state) else Status.OUTSIDE
    rows = [[f"{a:.{DIGITS - 1}e}" for a in small[k]] for k in kept]
    return Answer([times[k] for k in kept], rows, [amplification[k] for k in kept], len(right.events), status.name)


def _size(scene: Scene, row: Sequence[Any]) -> Array:
    """What errors of a state are relative to, (6,): the largest position, or speed, of the start and of that state.

    A rounding of its position also drives a body on a spring, which gives it a speed of `roundings.rates` times that.
    """
    states = np.array([scene.initial_state, [float(number) for number in row]])
    size = largest(states)
    positions = np.abs(states).max(axis=0)
    for body, rate in enumerate(rates(scene.system.closed_loop)):
        column = COLUMN[body]
        size[column + 1] = max(size[column + 1], rate * positions[column])
    return size


def _relative(changes: Array, size: Array) -> Array:
    """Changes relative to the size; what has no size must not change."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(changes == 0.0, 0.0, np.abs(changes) / size)


def nearby(scene: Scene, draws: int, part: float = EPS) -> list[Scene]:
    """The scene with some of its numbers smaller by a part, one rounding, drawn so often, where scenes may be so."""
    found: list[Scene] = []
    for seed in range(TRIES):
        with suppress(SceneError):  # k + Kp = 0 must not become negative
            found.append(scene.changed(_changes(scene, np.random.default_rng(seed), part)))
        if len(found) == draws:
            break
    return found


def _changes(scene: Scene, draw: np.random.Generator, part: float) -> dict[str, Any]:
    """The numbers of the scene, some of them smaller by a part."""
    changes: dict[str, Any] = {}
    for section, numbers in scene.values.items():
        for key, value in numbers.items():
            if section in EXACT or key in TIMES or isinstance(value, int):
                continue
            factors = 1.0 - part * draw.integers(0, 2, np.size(value))
            moved = (np.atleast_1d(value) * factors).tolist()
            changes[f"{section}.{key}"] = tuple(moved) if isinstance(value, tuple) else moved[0]
    return changes


def verdict(scene: Scene, right: Answer) -> Verdict:
    """Run a scene and compare it with its answer; the error of a run that stopped is infinite.

    The error is relative to what one rounding explains: one of the state, and one of each number of the scene,
    amplified by the motion. So it is |x - right| / (EPS size (1 + amplification)), the largest over bodies, positions
    and velocities, and times, relative to `_size`.
    """
    try:
        run = simulate(scene, grid=np.array([*right.t, scene.duration]), sampled=scene.sampled)
    except ArithmeticError as error:
        return Verdict(np.inf, type(error).__name__)
    if run.status.name != right.status:
        return Verdict(np.inf, run.status.name)
    there = [COLUMN[body] + k for body in scene.system.present for k in (0, 1)]
    worst = 0.0
    for state, row, amplification in zip(run.state, right.state, right.amplification, strict=False):
        size = _size(scene, row)
        errors = np.array([float(mpfr(row[i], 120) - float(state[i])) for i in there])
        worst = max(worst, float(_relative(errors, size[there]).max() / (EPS * (1.0 + amplification))))
    return Verdict(worst if np.isfinite(worst) else np.inf, run.status.name)


def main(chosen: Sequence[str]) -> int:
    """Write the answers to some scenes; the others stay."""
    for name in chosen:
        right = answer(load(name))
        found = {**_known(), name: right._asdict()}
        text = {known: found[known] for known in sorted(found)}
        ANSWERS.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")
        sys.stderr.write(f"{name}: until {right.t[-1]:g} s\n")
    return 0


if __name__ == "__main__":
    parser = Parser(prog="python -m lab.cases.regression")
    parser.add_argument("names", nargs="+", choices=names(), metavar="NAME")
    sys.exit(main(parser.parse_args().names))

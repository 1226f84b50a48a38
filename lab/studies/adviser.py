"""Which method, with which setting: an answer from measurements of this scene on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from grasp_ros.accuracy.compare import by_method
from grasp_ros.accuracy.measure import Record
from grasp_ros.methods.contract import UNITS
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from lab.studies import accuracy
from lab.studies.contenders import own_contenders
from lab.studies.measure import FULL, QUICK

HASTE = FULL._replace(patience=0.3)  # an adviser is asked for a minute
OTHERS = 3


class Advice(NamedTuple):
    """The best choice, what comes after it, and what was possible at all."""

    choice: Record | None
    others: list[Record]  # the best of other methods, in their order
    limit: Record  # the most accurate for an error, the fastest for a budget


def advise(records: list[Record], error: float | None = None, budget: float | None = None) -> Advice:
    """Choose from measurements; runs that miss touches or stop early are no choice.

    Parameters
    ----------
    records : list of Record
        Of one scene.
    error : float, m or m/s
        The fastest that reaches it is chosen.
    budget : float, s
        The most accurate within it is chosen.

    Raises
    ------
    Refused
        If not exactly one of error and budget is given and positive, or nothing has a result.
    """
    wish = _wish(error, budget)
    sound = [record for record in records if record.good and not record.missed and record.status == "done"]
    if not sound:
        raise Refused("no method has a result on this scene")

    def cost(record: Record) -> tuple[float, float]:
        pair = (record.seconds or 0.0, record.error or 0.0)
        return pair if budget is None else (pair[1], pair[0])

    def limited(record: Record) -> float:
        return cost(record)[1]

    fits = sorted((record for record in sound if limited(record) <= wish), key=cost)
    best = {name: group[0] for name, group in by_method(fits).items()}
    ranked = list(best.values())
    return Advice(ranked[0] if ranked else None, ranked[1 : 1 + OTHERS], min(sound, key=limited))


def _wish(error: float | None, budget: float | None) -> float:
    """The one number that is asked for."""
    wish = error if budget is None else budget
    if (error is None) == (budget is None) or wish is None or not wish > 0.0:
        raise Refused("--error, --budget: allowed: exactly one of them, a number > 0")
    return wish


def run(scene: Scene, directory: Path, error: float | None, budget: float | None, quick: bool) -> tuple[Advice, str]:
    """Measure what is not in the journal yet, and answer in words.

    Raises
    ------
    Refused
        See `advise`.
    """
    _wish(error, budget)
    effort = QUICK if quick else HASTE
    advice = advise(accuracy.run([scene], directory, effort, own_contenders()), error, budget)
    wish = f"an error of {error:g}" if budget is None else f"{budget:g} s"
    lines = [f"{scene.name}, {wish}; error: {accuracy.METRIC}"]
    if advice.choice is None:
        lines.append(f"no method reaches it; closest: {_in_words(advice.limit)}")
        return advice, "\n".join(lines)
    lines.append(f"use: {_in_words(advice.choice)}")
    lines += [f"or:  {_in_words(record)}" for record in advice.others]
    choice = advice.choice
    lines.append(f"that is: grasp simulate {scene.name} --method {choice.method} --{choice.knob} {choice.setting:g}")
    return advice, "\n".join(lines)


def _in_words(record: Record) -> str:
    setting = f"{record.knob} {record.setting:g}{UNITS[record.knob]}"
    return f"{record.method}, {setting}: error {record.error:.1e} in {1e3 * (record.seconds or 0.0):.3g} ms"

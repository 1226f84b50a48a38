"""Observations (9) to (11): the feedback gains."""

from __future__ import annotations

import math
from functools import partial

from grasp_ros.scene import Scene
from lab.paper.cases import STANDARD, Cases, Start, started, value_of
from lab.paper.compare import Comparison, Variant
from lab.paper.measures import MARGIN, measure, ratio
from lab.paper.properties import SETTLING, tenfold, wide
from lab.paper.universal import Found, Share

CHANGED = ("settling", "frequency")


def _damping_ratio(scene: Scene) -> float:
    C, K, m = (
        value_of(scene, "c") + value_of(scene, "Kv"),
        value_of(scene, "k") + value_of(scene, "Kp"),
        value_of(scene, "m_l"),
    )
    return C / (2.0 * math.sqrt(K * m))


def _more_damped(number: int, more: bool, cases: Cases, start: Start) -> Found:
    del start  # the damping ratio does not depend on it
    share = _damping_ratio(cases[number]) / _damping_ratio(cases[1])
    return Found(share, share > MARGIN if more else share < 1.0 / MARGIN)


def _gain_matters(number: int, cases: Cases, start: Start) -> Found:
    """Largest change of settling time or frequency, as a ratio above 1."""
    a, b = started(cases[number], start), started(cases[STANDARD], start)
    changes = [ratio(measure(a, name), measure(b, name)) for name in CHANGED]
    change = max(max(each, 1.0 / each) if each else math.inf for each in changes)
    return Found(change, change > MARGIN)


def any_gain() -> tuple[Share, ...]:
    """Observation (9)."""
    return tuple(
        Share(
            f"No. {number} differs from No. 1 in settling time or frequency.",
            f"the ratio, above or below 1, exceeds {MARGIN:g}",
            partial(_gain_matters, number),
            "Kp adds to the stiffness of an arm, Kv to its damping.",
            (number, STANDARD),
            letter=letter,
            values=tenfold(standard),
        )
        for number, letter, standard in ((9, "Kp", 5.0), (10, "Kv", 0.5))
    )


def position_gain() -> tuple[Comparison | Share, ...]:
    """Observation (10)."""
    return (
        Comparison(
            "The largest input force of No. 9 is above that of No. 1.",
            "input",
            Variant(9),
            True,
            "From rest the largest input is Kp x(0), unless Kv v exceeds it later.",
            "Kp",
            tenfold(5.0),
        ),
        Comparison(
            "No. 9 needs longer to settle than No. 1.",
            "settling",
            Variant(9),
            True,
            "The envelope of an arm, exp(-C t / 2m), does not know Kp; more and faster impacts take more.",
            "Kp",
            tenfold(5.0),
            (*SETTLING, "swings"),
        ),
        Share(
            "The damping ratio of an arm falls.",
            f"C / (2 sqrt(K m)) of No. 9 over No. 1 below {1.0 / MARGIN:.3g}",
            partial(_more_damped, 9, False),
            "K grows and C does not.",
            (9, STANDARD),
            letter="Kp",
            values=tenfold(5.0),
        ),
    )


def velocity_gain() -> tuple[Comparison | Share, ...]:
    """Observation (11)."""
    return (
        Comparison(
            "No. 10 settles sooner than No. 1.",
            "settling",
            Variant(10),
            False,
            "Kv adds to c: the envelope of an arm is exp(-C t / 2m) up to critical damping; beyond it the arm creeps"
            " back, as exp(-K t / C).",
            "Kv",
            (*wide(0.5), 100.0),
            SETTLING,
        ),
        Share(
            "The damping ratio of an arm grows.",
            f"C / (2 sqrt(K m)) of No. 10 over No. 1 above {MARGIN:g}",
            partial(_more_damped, 10, True),
            "C grows and K does not.",
            (10, STANDARD),
            letter="Kv",
            values=tenfold(0.5),
        ),
    )

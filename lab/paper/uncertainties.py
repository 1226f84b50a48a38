"""Numbers behind what is uncertain in the source."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.energy import energy
from grasp_ros.physics.model import hertzian_force
from lab.paper.cases import LITERAL, NEARLY, PRINTED, READ_P, STANDARD, SYMMETRIC, Cases, started, with_values
from lab.paper.measures import measure, seconds, settlings
from lab.reference.grasp import grasp_of


class Uncertainties(NamedTuple):
    """What follows from readings of the source."""

    input: float  # N, the largest of No. 9
    force: float  # N, on the left arm at x_l(0) without the minus
    literal: float  # J, V_c(0) there
    standard: float  # J, V_c(0) of No. 1
    times: dict[float, str]  # settling time by p, for readings of No. 4
    settled: str  # settling time of No. 1
    even: list[float]  # s, settling times of Nos. 1 and 11 from a symmetric start
    near: list[float]  # from beside it
    odd: list[float]  # from the printed one


def uncertainties(cases: Cases) -> Uncertainties:
    """All of them."""
    standard = cases[STANDARD]
    literal = started(standard, LITERAL)
    levels = [float(energy(scene.system, scene.initial_state).V_c) for scene in (literal, standard)]
    force = float(hertzian_force(grasp_of(standard).left_contact, np.array([LITERAL[0]]))[0])
    times = {p: seconds(settlings(with_values(standard, {"p": p}))) for p in sorted({*READ_P, 1.0})}
    even, near, odd = (
        [measure(started(cases[number], start), "settling") for number in (STANDARD, 11)]
        for start in (SYMMETRIC, NEARLY, PRINTED)
    )
    return Uncertainties(measure(cases[9], "input"), force, levels[0], levels[1], times, seconds(settlings(standard)),
                         even, near, odd)

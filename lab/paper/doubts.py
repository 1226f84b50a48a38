"""What is doubtful in the source, in sentences whose numbers are computed."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.energy import energy
from grasp_ros.physics.model import hertzian_force
from lab.paper.cases import LITERAL, NEARLY, PRINTED, READ_P, STANDARD, SYMMETRIC, Cases, started, with_values
from lab.paper.measures import measure, seconds, settlings
from lab.reference.grasp import grasp_of


def doubts(cases: Cases) -> dict[str, str]:
    """What is doubtful in the source, and what follows, with numbers."""
    standard = cases[STANDARD]
    inputs = measure(cases[9], "input")
    literal = started(standard, LITERAL)
    force = float(hertzian_force(grasp_of(standard).left_contact, np.array([LITERAL[0]]))[0])
    levels = [float(energy(scene.system, scene.initial_state).V_c) for scene in (standard, literal)]
    ps = sorted({*READ_P, 1.0})
    times = [seconds(settlings(with_values(standard, {"p": p}))) for p in ps]
    even, near, odd = (
        [measure(started(cases[number], start), "settling") for number in (STANDARD, 11)]
        for start in (SYMMETRIC, NEARLY, PRINTED)
    )
    return {
        "Number of figures":
            'The text announces results "from Fig. 2 to Fig. 15"; the last figure is Fig. 12. Its list of cases ends'
            " there, too, so only three figures that are described nowhere seem to be missing.",
        "Axis of Fig. 10":
            f"It ends at -10 N. From rest the first input of No. 9 is -Kp x_r(0) = {-inputs:g} N on the right. Either"
            " the curve leaves the figure or the initial state was different.",
        "Sign of x_l(0)":
            f"Table 1 prints +{LITERAL.x_l:g}. The left arm would start {LITERAL.x_l:g} m inside the object, pressed"
            f" with {force:.0f} N, and with V_c(0) = {levels[1]:.0f} J in place of {levels[0]:.2g} J. Read as"
            f" {PRINTED.x_l:g}.",
        "p of No. 4":
            'Only "larger" is said. Read as 1 s/m; settling times for '
            + ", ".join(f"p = {p:g}: {time}" for p, time in zip(ps, times, strict=True))
            + f" (p = 0.1: {seconds(settlings(standard))}).",
        "Symmetric starts":
            f"Nos. 5 to 8 start symmetrically, without numbers; read as {SYMMETRIC.x_l:g} and {SYMMETRIC.x_r:g} m."
            " Where the arms are equal, and the start is symmetric to the last bit, the object never moves and its mass"
            f" does not matter: No. 1 and No. 11 settle after {even[0]:.2f} and {even[1]:.2f} s. It is a knife-edge"
            f" (above): from {NEARLY.x_l:g} and {NEARLY.x_r:g} m they need {near[0]:.1f} and {near[1]:.1f} s, from the"
            f" printed start {odd[0]:.1f} and {odd[1]:.0f} s. Comparing Fig. 2 with Figs. 6 to 9 compares starts as"
            " well.",
        "x_o(0)": "Not printed. Read as 0, in the middle of the axes of Figs. 2 to 12.",
        "Step of the integration":
            "Not printed; for its effect on the figures see above, under the paper's own method.",
        "Lyapunov's method in noncontact (p. 245)":
            "The text says that the method does not apply there, since V_o of (33) does not contain x_o, and continues"
            " part by part, (29) to (37). It does apply. If both pairs are apart, x_l < x_o < x_r, so V of (28) is 0"
            " only if x_l = x_r = 0 encloses x_o = 0 and all bodies are at rest. If a pair separates faster than 1/p,"
            " a body moves, so V > 0. (28) is positive definite as printed, and (29) to (37) are not needed.",
        '"In Fig. 1"':
            "The sentence on where x_l is larger than x_o (p. 246) can only mean Fig. 2: Fig. 1 is the model.",
    }

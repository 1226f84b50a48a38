"""The three conclusions of the paper."""

from __future__ import annotations

from grasp_ros import scene as scenes
from lab.paper import motion
from lab.paper.observations import LOSSY_IMPACTS
from lab.paper.properties import unequal_pairs
from lab.paper.statement import Statement
from lab.paper.universal import Universal


def conclusions() -> list[Statement]:
    """Conclusions (1) to (3), page 248."""
    return [
        Statement(
            "C1",
            "p. 248, conclusion (1)",
            "Lyapunov's direct method proves that a grasp with collisions can be stable.",
            (
                Universal(
                    "In the paper's cases the printed V never rises.",
                    "rise of V between output times <= 1e-12 V(0)",
                    motion.paper_V_falls,
                    "V jumps only where a pair that separates at 1/p takes its Hertz term up again (next part).",
                    letter="H",
                    values=(1e2, 1e3, 1e5),
                ),
                Universal(
                    "In the paper's cases no pair separates faster than 1/p while it penetrates.",
                    "smallest p u' while u > 0: above -1",
                    motion.separates_slowly,
                    "Where p is below sqrt(mu / V_c(0)) none can (theorem 2 of docs/certificate.md); No. 4 is beyond"
                    " that, touches faster than 1/p, and still leaves more slowly, since impacts take speed.",
                    letter="p",
                    values=(0.01, 0.3, 1.0),
                    least=True,
                ),
                Universal(
                    "The printed V never rises, whatever p.",
                    "rise of V between output times <= 1e-12 V(0)",
                    motion.paper_V_falls,
                    "A pair that separates faster than 1/p leaves V with its Hertz term and brings it back: V"
                    " jumps up.",
                    (1, 4),
                    "p",
                    (0.1, 0.3, 1.0, 3.0, 10.0, 30.0),
                    extra=(
                        ("scene v_jump_symmetric, p = 10", lambda _: scenes.load("v_jump_symmetric")),
                        ("scene v_jump_one_sided, p = 15", lambda _: scenes.load("v_jump_one_sided")),
                    ),
                ),
                Universal(
                    "V_c, which keeps the Hertz term whenever u > 0, never rises, whatever p.",
                    "rise of V_c between output times <= 1e-12 V(0)",
                    motion.repaired_V_falls,
                    "It is continuous, and all terms of its rate are losses (theorem 1 of docs/certificate.md).",
                    (1, 4),
                    "p",
                    (0.1, 0.3, 1.0, 3.0, 10.0, 30.0),
                    extra=(
                        ("scene v_jump_symmetric, p = 10", lambda _: scenes.load("v_jump_symmetric")),
                        ("scene v_jump_one_sided, p = 15", lambda _: scenes.load("v_jump_one_sided")),
                    ),
                ),
            ),
        ),
        Statement(
            "C2",
            "p. 248, conclusion (2)",
            "Collision stabilises under some conditions, such as marginal stability.",
            (LOSSY_IMPACTS,),
        ),
        Statement(
            "C3",
            "p. 248, conclusion (3)",
            "Unequal arms under the same control are less controllable than equal ones.",
            unequal_pairs(),
        ),
    ]

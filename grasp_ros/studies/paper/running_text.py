"""What the paper says in its running text, restated as parts that can be measured."""

from __future__ import annotations

from functools import partial

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene
from grasp_ros.studies.paper import motion
from grasp_ros.studies.paper.cases import NUMBERS, PRINTED, Cases, Start
from grasp_ros.studies.paper.observations import DAMPED, LOSSY_IMPACTS
from grasp_ros.studies.paper.statement import Statement
from grasp_ros.studies.paper.universal import Found, Share, Universal

ANY_P = ("p", (0.1, 1.0, 10.0))
NO_RISE = "<= 1e-12 V(0) a second"


def _helped(number: int, cases: Cases, start: Start) -> Found:
    return motion.collisions_help(cases, number, start)


def _help(number: int, what: str) -> Share:
    return Share(
        f"{what}: with the object between them the arms settle sooner than alone.",
        f"settling time of No. {number} over that of its arms without an object below 0.952",
        partial(_helped, number),
        "Impacts move energy into the object, which has no damper, and give it back to the arms later.",
        PRINTED,
    )


def running_text() -> list[Statement]:
    """Statements of pages 245 to 247 that are neither an observation nor a conclusion."""
    return [*_proof(), *_effect(), _grip(), *_simulation()]


def _proof() -> list[Statement]:
    return [
        Statement(
            "T1",
            "p. 244 to 245, (18), (20), (23), (25), (27)",
            "V never grows within a condition of contact.",
            (
                Universal(
                    "V' <= 0 at every instant.",
                    f"largest V' {NO_RISE}",
                    motion.rate_is_never_positive,
                    "With a = b = 4/5 the elastic terms cancel; what is left are losses.",
                    letter=ANY_P[0],
                    values=ANY_P[1],
                ),
            ),
        ),
        Statement(
            "T2",
            "p. 245, after (34)",
            "An object that rests off its origin stays there unless a force from outside acts.",
            (
                Universal(
                    "It rests until an arm touches it.",
                    "moved before the first touch: 0",
                    motion.object_rests_until_touched,
                    "Without contact nothing pushes the object, (3).",
                ),
            ),
        ),
        Statement(
            "T3",
            "p. 245, after (34)",
            "The object may stay at a place off its origin.",
            (
                Universal(
                    "It rests for good.",
                    "moved within 20 s: at most 1e-9 of its displacement",
                    motion.object_stays,
                    "The arms swing to 0 and meet the object on their way; the only common rest is the origin.",
                ),
            ),
        ),
        Statement(
            "T4",
            "p. 245, (35) to (37)",
            "The arms enclose the object but for the largest deformation.",
            (
                Universal(
                    "x_l - eps_l <= x_o <= x_r + eps_r at all times.",
                    "clearance above -0.001 eps, with eps the largest deformation of the run",
                    motion.enclosed,
                    "It is the definition of eps; that eps is bounded follows from V_c: eps <= (5 V_c(0) / 4H)^(2/5).",
                    least=True,
                    letter=ANY_P[0],
                    values=ANY_P[1],
                ),
            ),
        ),
        Statement(
            "T5",
            "p. 245, after (37)",
            "x_l and x_r converge to zero in any condition, and x_o with them.",
            (
                Universal(
                    "All masses settle, with or without losses.",
                    "all within 2 % before the limit of time",
                    motion.converges,
                    "Without any loss V_c keeps its value, and the motion returns.",
                    NUMBERS,
                    unit=" s",
                ),
                Universal(
                    "All masses settle where the arms have dampers.",
                    "all within 2 % before the limit of time",
                    motion.converges,
                    "Every swing and every impact takes energy until none is left.",
                    DAMPED,
                    "p",
                    (0.0, 0.1, 1.0, 10.0),
                    unit=" s",
                ),
            ),
        ),
    ]


def _effect() -> list[Statement]:
    return [
        Statement(
            "T6",
            "p. 245, after (27)",
            "The collision term makes V fall faster than without it.",
            (
                Universal(
                    "The collision terms of (18) are never negative.",
                    "smallest term >= 0 W",
                    motion.collision_term_lowers,
                    "p H u^(3/2) u'^2 is a product of squares and positive numbers.",
                    least=True,
                    unit=" W",
                    letter=ANY_P[0],
                    values=ANY_P[1],
                ),
            ),
        ),
        Statement(
            "T7",
            "p. 245, after (27)",
            "Therefore collision stabilises, with dampers too.",
            (_help(1, "Table 1"), _help(8, "More damping"), _help(10, "More velocity feedback")),
        ),
        Statement(
            "T8",
            "p. 245, after (27)",
            "Without dampers V is constant without contact and falls in contact, so that the whole is stable.",
            (
                Universal(
                    "V' is 0 in flight, and V has fallen after 20 s.",
                    "V' = 0 in flight; lost more than 1 % of V(0)",
                    motion.falls_only_in_contact,
                    "With C = 0 the collision terms alone are left of (18).",
                    (3,),
                ),
                LOSSY_IMPACTS,
            ),
        ),
    ]


def _grip() -> Statement:
    return Statement(
        "T9",
        "p. 248, conclusion (1), and the title",
        "What is controlled is a grasp, position and force.",
        (
            Universal(
                "Both arms press the object in the end.",
                "impact forces at 20 s above 0 N",
                motion.holds_on,
                "Both arms are regulated to the same point: no deformation is left to press with.",
                least=True,
                unit=" N",
                extra=(("set-points that overlap by 50 mm, scene preload", _preload),),
            ),
        ),
    )


def _preload(_: Cases) -> Scene:
    return scenes.load("preload")


def _simulation() -> list[Statement]:
    steps = ((1e-3, "1 ms"), (1e-2, "10 ms"))
    return [
        Statement(
            "T10",
            "p. 246, method",
            "Linear interpolation gives the exact time of a contact.",
            tuple(
                Universal(
                    f"With a step of {text}.",
                    "error of the first time of contact at most 1e-9 s",
                    partial(motion.first_contact_error, step),
                    "Interpolation between the ends of a step leaves an error of the order of its square.",
                    unit=" s",
                )
                for step, text in steps
            ),
        ),
        Statement(
            "T11",
            "p. 246, method",
            "The method can follow any number of collisions.",
            tuple(
                Universal(
                    f"With a step of {text} it finds every touch within 20 s.",
                    "touches found over those that are there: 1",
                    partial(motion.contacts_found, step),
                    "Contact is decided at the ends of a step; what opens and closes in between is not seen.",
                    least=True,
                )
                for step, text in steps
            ),
        ),
        Statement(
            "T12",
            "p. 246, No. 2",
            "No. 2 goes on periodically and neither diverges nor converges.",
            (
                Universal(
                    "It neither diverges nor converges.",
                    "V_c changes by at most 1e-9",
                    motion.keeps_V,
                    "There is no term left in V_c'.",
                    (2,),
                ),
                Universal(
                    "It is periodic.",
                    "it comes back to its start within 20 s, to 0.001 of sqrt(V(0))",
                    motion.returns,
                    "Three masses with impacts have no common period, but for a symmetric start, where the object"
                    " rests.",
                    (2,),
                    least=True,
                ),
            ),
        ),
    ]

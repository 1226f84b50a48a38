"""What the paper says in its running text, restated as parts that can be measured."""

from __future__ import annotations

from functools import partial

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene
from lab.paper import motion
from lab.paper.cases import NUMBERS, Cases, Start
from lab.paper.compare import Comparison, Variant
from lab.paper.measures import MARGIN
from lab.paper.method_text import method_text
from lab.paper.observations import DAMPED, LOSSY_IMPACTS
from lab.paper.statement import Statement
from lab.paper.universal import Found, Share, Universal

EVERY = 10**6  # of the random starts
ANY_P = ("p", (0.1, 1.0, 10.0))
NO_RISE = "<= 1e-12 V(0) a second"


def _helped(number: int, cases: Cases, start: Start) -> Found:
    return motion.collisions_help(cases, number, start)


def _alone(number: int) -> Share:
    return Share(
        f"Read as: collisions at all. No. {number} settles sooner than its arms would without an object.",
        f"settling time of No. {number} over that of its arms without an object below {1.0 / MARGIN:.3g}",
        partial(_helped, number),
        "Impacts move energy into the object, which has no damper, and give it back to the arms later.",
        (number,),
        starts=EVERY,
        letter="p",
        values=(0.0, 1.0, 10.0),
        reading=True,
    )


def _with_loss() -> Comparison:
    """The collision term against none, in the cases whose arms have dampers."""
    return Comparison(
        "A motion with the collision term settles sooner than without it.",
        "settling",
        Variant(1),
        False,
        "The term takes energy in impacts; where dampers take it sooner, little is left for it.",
        "p",
        (0.1, 0.2, 0.5, 1.0, 2.0, 5.0),
        ("settling_5", "rest"),
        others=(Variant(1, (("p", 0.0),)),),
        pairs=tuple((Variant(number), Variant(number, (("p", 0.0),))) for number in (4, 8, 10)),
    )


def running_text() -> list[Statement]:
    """Statements of pages 245 to 247 that are neither an observation nor a conclusion."""
    return [*_proof(), *_effect(), _grip(), *method_text()]


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
                    "With a = b = 4/5 the elastic terms cancel; what is left are losses, whose sign is algebra:"
                    " no motion can break it.",
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
                    letter="m_o",
                    values=(0.05, 0.5, 50.0),
                ),
            ),
        ),
        Statement(
            "T3",
            "p. 245, after (34)",
            "The same sentence (T2), read as for good: an object off its origin stays there.",
            (
                Universal(
                    "It rests for good.",
                    f"moved within 20 s: at most {motion.DRIFT:g} of its displacement",
                    motion.object_stays,
                    "The arms swing to 0 and meet the object on their way; the only common rest is the origin, as T5"
                    " says.",
                    letter="m_o",
                    values=(0.05, 0.5, 50.0),
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
                    "It takes one loss, of dampers (C > 0) or of impacts (p > 0); No. 2 has none, keeps its V_c, and is"
                    " the counterexample to any condition.",
                    NUMBERS,
                    "p",
                    (0.0, 1.0, 10.0),
                    base=2,
                ),
                Universal(
                    "All masses settle where the arms have dampers.",
                    "all within 2 % before the limit of time",
                    motion.converges,
                    "Every swing and every impact takes energy until none is left.",
                    DAMPED,
                    "p",
                    (0.0, 0.1, 1.0, 10.0),
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
                    "p H u^(3/2) u'^2 is a product of squares and positive numbers: algebra; no motion can break it.",
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
            "The term makes V' smaller than without it, which implies that collision stabilises.",
            (_with_loss(), *map(_alone, (1, 8, 10))),
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
                    "p",
                    (0.01, 0.1, 1.0),
                    base=3,
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
                f"both impact forces above 0 N through the last {motion.LAST:g} s",
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

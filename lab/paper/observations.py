"""The twelve observations of the paper, each restated as parts that can be measured; here (1) to (4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene
from lab.paper import gains, motion, properties
from lab.paper.cases import PRINTED, READ_STARTS, Cases, Start, started, with_values
from lab.paper.claims import Check, Kind, Part
from lab.paper.compare import Comparison, Variant
from lab.paper.properties import SETTLING
from lab.paper.statement import Judged, Statement
from lab.paper.universal import Found, Share, Universal

DAMPED = (1, 4, 5, 6, 7, 8, 9, 10, 11)
LARGER_P = (0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0)
LOSSY_IMPACTS = Comparison(
    "Without dampers, impacts that lose energy make the motion decay.",
    "rest",
    Variant(3),
    False,
    "Every impact takes the part 1 - e^2 of its energy, with e = 1 - (2/3) p v to first order; nothing else takes any.",
    "p",
    (0.01, 0.03, 0.1, 0.3, 1.0),
    ("size",),
    others=(Variant(2),),
)


def _without_own_springs(cases: Cases) -> Scene:
    return with_values(cases[1], {"k": 0.0, "c": 0.0})


def _marginal_settles(cases: Cases, start: Start) -> Found:
    named = start == PRINTED or start in READ_STARTS.values()
    return (motion.converges_wherever if named else motion.converges)(started(cases[3], start))


def observations() -> list[Statement]:
    """Observations (1) to (12), pages 247 and 248."""
    where = "p. 247, observation"
    text = (
        "Collisions that lose energy stabilise a grasp whose arms have no damping.",
        "More energy loss in collisions makes the manipulators converge better.",
        "Linear feedback makes a stable grasp possible.",
        "The grasp stays stable when masses, stiffnesses and damping change.",
        "Heavier manipulators vibrate at a higher frequency and are less controllable.",
        "Stiffer manipulators converge better to a degree, but need longer.",
        "More damping of the manipulators makes them converge better.",
        "Unequal manipulators converge unequally and are less controllable in total.",
        "The feedback gains change the behaviour.",
        "Higher position gains need more force and converge worse, as the relative damping is less.",
        "Higher velocity gains converge better, as the relative damping is more.",
        "A heavier object makes the grasp less controllable and slower to converge.",
    )
    parts: tuple[Sequence[Judged], ...] = (
        _one(), _two(), _three(), _four(),
        properties.heavier_arms(), properties.stiffer_arms(), properties.damped_arms(), properties.unequal_arms(),
        gains.any_gain(), gains.position_gain(), gains.velocity_gain(), properties.heavier_object(),
    )
    return [
        Statement(f"O{number}", f"{where} ({number})", words, several)
        for number, (words, several) in enumerate(zip(text, parts, strict=True), start=1)
    ]


def _one() -> tuple[Comparison | Universal | Share, ...]:
    return (
        LOSSY_IMPACTS,
        Share(
            "The motion of No. 3 settles.",
            "all masses stay within 2 % before the limit of time",
            _marginal_settles,
            "The loss falls with the speed of the impacts, so that displacements decay like 1/t, not exponentially.",
            (3,),
            " s",
            letter="p",
            values=(0.3, 1.0, 3.0),
        ),
        Universal(
            "Lyapunov's function agrees: V never rises in No. 3.",
            "rise of V between output times <= 1e-12 V(0)",
            motion.paper_V_falls,
            "V' is 0 in flight and -2 p H u^(3/2) u'^2 in contact.",
            (3,),
            "p",
            (0.01, 0.1, 1.0),
            base=3,
        ),
    )


def _two() -> tuple[Comparison, ...]:
    return (
        Comparison(
            "No. 4 settles sooner than No. 1.",
            "settling",
            Variant(4),
            False,
            "More of the energy of relative motion is lost in each impact, beside what the dampers take.",
            "p",
            LARGER_P,
            SETTLING,
        ),
    )


class Gripped(NamedTuple):
    """That a grasp is possible: whether the arms press the object in the paper's cases, and with another set-point."""

    values: tuple[float, ...] = ()  # nothing is swept

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """In the cases that settle, as T9, and where the set-points overlap."""
        own = [motion.holds_on(cases[number]) for number in DAMPED]
        share = sum(found.holds for found in own) / len(own)
        held = motion.holds_on(scenes.load("preload"))
        return Part(
            "With set-points that allow it both arms press the object in the end.",
            f"both impact forces above 0 N through the last {motion.LAST:g} s",
            "Both arms are regulated to the same point, so that no deformation is left to press with; set-points that"
            " overlap leave one.",
            (Check(Kind.PRINTED, "the cases with dampers", f"{share:.0%} of {len(own)}", share, share == 1.0),
             Check(Kind.PRINTED, "set-points that overlap by 50 mm, scene preload", f"{held.value:.3g} N",
                   float(held.holds), held.holds)),
        )


def _three() -> tuple[Judged, ...]:
    return (
        Universal(
            "V_c never rises under the feedback.",
            "rise of V_c between output times <= 1e-12 V(0)",
            motion.repaired_V_falls,
            "All terms of V_c' are losses (theorem 1 of docs/certificate.md).",
            letter="Kp",
            values=(0.0, 5.0, 50.0, 500.0),
            extra=(("k = c = 0: the feedback alone holds the arms", _without_own_springs),),
        ),
        Universal(
            "Arms and object settle.",
            "all masses stay within 2 % before the limit of time",
            motion.converges,
            "The arms are driven to 0 and enclose the object.",
            DAMPED,
            "Kv",
            (0.05, 0.2, 2.0, 20.0),
            extra=(("k = c = 0: the feedback alone holds the arms", _without_own_springs),),
        ),
        Gripped(),
    )


def _four() -> tuple[Universal, ...]:
    return tuple(
        Universal(
            f"V_c never rises, whatever {letter}.",
            "rise of V_c between output times <= 1e-12 V(0)",
            motion.repaired_V_falls,
            "V_c' has no term whose sign depends on a mass or a stiffness.",
            cases,
            letter,
            tuple(round(value * factor, 12) for factor in (0.01, 0.1, 10.0, 100.0)),
        )
        for letter, value, cases in (("m", 1.0, (5, 6)), ("k", 10.0, (7,)), ("c", 0.2, (8,)), ("m_o", 5.0, (11,)))
    )

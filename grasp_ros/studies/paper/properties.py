"""Observations (5) to (8) and (12): masses, stiffness and damping of the arms, unequal arms, the object."""

from __future__ import annotations

from grasp_ros.studies.paper.compare import Comparison

SETTLING = ("settling_1", "settling_5", "rest", "size")
TENFOLD = (2.0, 3.0, 5.0, 10.0, 20.0)


def tenfold(standard: float) -> tuple[float, ...]:
    """Values of a sweep: from twice to twenty times the standard."""
    return tuple(round(standard * factor, 12) for factor in TENFOLD)


HEAVY_LEFT = Comparison(
    "Unequal arms need longer to settle than equal ones.",
    "settling",
    6,
    True,
    "Unequal arms meet the object at different times and push it about, and the envelope exp(-C t / 2m) of the heavier"
    " one is slower; of two heavy arms both are.",
    "m_l",
    (0.1, 0.2, 0.5, *tenfold(1.0)),
    ("settling_1", "settling_5", "rest"),
    others=(("both arms with 10 kg", (("m", 10.0),)), ("both arms with 5.5 kg, the same mass in all", (("m", 5.5),))),
)


def heavier_arms() -> tuple[Comparison, ...]:
    """Observation (5)."""
    return (
        Comparison(
            "The arms swing faster in No. 5 than in No. 1.",
            "frequency",
            5,
            True,
            "An arm swings at sqrt(K/m): ten times the mass lowers it by sqrt(10).",
            "m",
            tenfold(1.0),
        ),
        Comparison(
            "No. 5 needs longer to settle than No. 1.",
            "settling",
            5,
            True,
            "The envelope of an arm is exp(-C t / 2m): ten times the mass, ten times the time.",
            "m",
            tenfold(1.0),
            SETTLING,
        ),
    )


def stiffer_arms() -> tuple[Comparison, ...]:
    """Observation (6)."""
    return (
        Comparison(
            "Displacements are smaller in No. 7 than in No. 1.",
            "size",
            7,
            False,
            "More swings and harder impacts in the same time take the energy sooner.",
            "k",
            tenfold(10.0),
            ("rest",),
        ),
        Comparison(
            "No. 7 needs longer to settle than No. 1.",
            "settling",
            7,
            True,
            "Stiffer arms come back sooner and hit faster: more impacts a second, and each loses more (1 - e = 2 p v"
            " / 3).",
            "k",
            tenfold(10.0),
            ("settling_1", "settling_5"),
        ),
    )


def damped_arms() -> tuple[Comparison, ...]:
    """Observation (7)."""
    return (
        Comparison(
            "No. 8 settles sooner than No. 1.",
            "settling",
            8,
            False,
            "c adds to Kv: the envelope of an arm is exp(-C t / 2m).",
            "c",
            tenfold(0.2),
            SETTLING,
        ),
    )


def unequal_arms() -> tuple[Comparison, ...]:
    """Observation (8)."""
    return (
        Comparison(
            "The arms move less alike in No. 6 than in No. 1.",
            "lopsided",
            6,
            True,
            "A light and a heavy arm reach the object at different times and push it aside.",
            "m_l",
            tenfold(1.0),
        ),
        HEAVY_LEFT,
    )


def heavier_object() -> tuple[Comparison, ...]:
    """Observation (12)."""
    why = (
        "The object has no damper: its energy leaves through the arms, in impacts that move it the less the heavier"
        " it is."
    )
    return (
        Comparison(
            "More of V_c is left at 20 s in No. 11 than in No. 1.",
            "rest",
            11,
            True,
            why,
            "m_o",
            tenfold(5.0),
            ("size",),
        ),
        Comparison(
            "No. 11 needs longer to settle than No. 1.",
            "settling",
            11,
            True,
            "From a symmetric start the object never moves, and its mass does not enter.",
            "m_o",
            tenfold(5.0),
            ("settling_1", "settling_5"),
        ),
    )

"""Observations (5) to (8) and (12): masses, stiffness and damping of the arms, unequal arms, the object."""

from __future__ import annotations

from lab.paper.cases import STANDARD
from lab.paper.compare import FIRST, Comparison, Variant

SETTLING = ("settling_1", "settling_5", "rest", "size")
TENFOLD = (2.0, 3.0, 5.0, 10.0, 20.0)


def tenfold(standard: float) -> tuple[float, ...]:
    """Values of a sweep: from twice to twenty times the standard."""
    return tuple(round(standard * factor, 12) for factor in TENFOLD)


WIDE = (*TENFOLD, 50.0, 100.0)


def wide(standard: float) -> tuple[float, ...]:
    """The same, up to a hundred times the standard."""
    return tuple(round(standard * factor, 12) for factor in WIDE)


def _unequal(letter: str, value: float, case: int, why: str, read_as: str = "") -> Comparison:
    """A left arm that differs in one number, against the pair of which both have the one value, and the other.

    With `read_as` it is another reading of the sentence.
    """
    left = f"{letter}_l"
    numbers = ((left, value),)
    changed = Variant(case) if case != STANDARD else Variant(STANDARD, numbers, f"No. 1 with {left} = {value:g} alone")
    tenfold_pair = letter in BOTH and value == 10.0 * BASE[letter]
    both = Variant(BOTH[letter]) if tenfold_pair else Variant(STANDARD, ((letter, value),))
    return Comparison(
        f"{read_as}With {left} = {value:g} alone the arms settle later than either equal pair.",
        "settling",
        changed,
        True,
        why,
        left,
        tuple(round(factor * BASE[letter], 12) for factor in (0.1, 0.3, 3.0, 10.0, 30.0)),
        ("settling_1", "settling_5", "rest"),
        others=(FIRST, both),
        reading=bool(read_as),
    )


CONTACTS = "Read as: unequal contacts, too. "
BASE = {"m": 1.0, "k": 10.0, "c": 0.2, "Kv": 0.5, "Kp": 5.0, "p": 0.1, "H": 1e4}
BOTH = {"m": 5, "k": 7, "c": 8, "Kv": 10, "Kp": 9, "p": 4}  # the cases in which both arms have ten times that


def unequal_pairs() -> tuple[Comparison, ...]:
    """Conclusion (3), and the second half of observation (8)."""
    between = "An unequal pair lies between the equal ones: "
    return (
        _unequal(
            "m", 10.0, 6, between + "the envelope exp(-C t / 2m) is slow in one arm, and in two of two heavy arms.",
        ),
        _unequal(
            "m", 0.1, STANDARD, "The lighter arm stops sooner, and then hardly hinders the object on its way to the"
            " other.",
        ),
        _unequal(
            "k", 100.0, STANDARD, "Arms of different periods meet the object at different times and keep it moving,"
            " and a stiff arm, which hardly gives way, takes little from it.",
        ),
        _unequal("c", 2.0, STANDARD, between + "one damper more is better than none more, and worse than two."),
        _unequal("Kv", 5.0, STANDARD, between + "one arm with more feedback takes energy for both."),
        _unequal("Kp", 50.0, STANDARD, "To the motion Kp_l is a stiffness, as k_l is: arms of"
            " different periods meet the object at different times and keep it moving."),
        _unequal("p", 1.0, STANDARD, between + "one contact that loses more takes energy for both.", CONTACTS),
        _unequal("H", 1e5, STANDARD, "A harder contact is a shorter one, but what an impact takes, 1 - e = 2 p v / 3"
            " to first order, does not depend on H.", CONTACTS),
        _same_mass(),
    )


def _same_mass() -> Comparison:
    """Unequal masses against equal ones with the same sum."""
    changed, light = Variant(6), Variant(STANDARD, (("m_l", 1.8), ("m_r", 0.2)), "masses 1.8 and 0.2 kg")
    return Comparison(
        "Read as: with the sum of the masses kept. Unequal arms settle later than equal ones.",
        "settling",
        changed,
        True,
        "The heavier arm has a slower envelope, exp(-C t / 2m), than two of the mean mass; but only one has it.",
        words=("settling_1", "settling_5", "rest"),
        others=(Variant(STANDARD, (("m", 5.5),), "both arms with 5.5 kg"),),
        pairs=((light, FIRST),),
        reading=True,
    )


def heavier_arms() -> tuple[Comparison, ...]:
    """Observation (5)."""
    return (
        Comparison(
            "The arms swing faster in No. 5 than in No. 1.",
            "frequency",
            Variant(5),
            True,
            "An arm swings at sqrt(K/m): ten times the mass lowers it by sqrt(10).",
            "m",
            tenfold(1.0),
        ),
        Comparison(
            "No. 5 needs longer to settle than No. 1.",
            "settling",
            Variant(5),
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
            Variant(7),
            False,
            "More swings and harder impacts in the same time take the energy sooner.",
            "k",
            tenfold(10.0),
            ("rest",),
        ),
        Comparison(
            "No. 7 needs longer to settle than No. 1.",
            "settling",
            Variant(7),
            True,
            "Stiffer arms come back sooner and hit faster: more impacts a second, and each loses more (1 - e = 2 p v"
            " / 3). Far beyond No. 7 an arm hardly gives way and takes little from the object.",
            "k",
            (*tenfold(10.0), 400.0, 1000.0),
            ("settling_1", "settling_5", "swings"),
        ),
    )


def damped_arms() -> tuple[Comparison, ...]:
    """Observation (7)."""
    return (
        Comparison(
            "No. 8 settles sooner than No. 1.",
            "settling",
            Variant(8),
            False,
            "c adds to Kv: the envelope of an arm is exp(-C t / 2m) up to critical damping; beyond it the arm creeps"
            " back, as exp(-K t / C).",
            "c",
            (*wide(0.2), 50.0, 100.0),
            SETTLING,
        ),
    )


def unequal_arms() -> tuple[Comparison, ...]:
    """Observation (8): each in its own way, and the whole later."""
    return (
        Comparison(
            "The arms move less alike in No. 6 than in No. 1.",
            "lopsided",
            Variant(6),
            True,
            "A light and a heavy arm reach the object at different times and push it aside.",
            "m_l",
            tenfold(1.0),
            others=(FIRST, Variant(5)),
        ),
        *unequal_pairs(),
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
            Variant(11),
            True,
            why,
            "m_o",
            tenfold(5.0),
            ("size",),
        ),
        Comparison(
            "No. 11 needs longer to settle than No. 1.",
            "settling",
            Variant(11),
            True,
            why + " Near a symmetric start the object hardly moves, and a light one that does is the slower one.",
            "m_o",
            tenfold(5.0),
            ("settling_1", "settling_5"),
        ),
    )

"""The twelve observations and three conclusions of the paper, each restated as parts that can be measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene
from lab.paper import motion
from lab.paper.cases import PRINTED, READ_STARTS, STANDARD, Cases, Start, started, value_of, with_values
from lab.paper.claims import Check, Kind, Part, numbered
from lab.paper.compare import FIRST, HIGHER, LOWER, Comparison, Variant
from lab.paper.measures import MARGIN, measure, ratio
from lab.paper.universal import Found, Share, Universal, threshold

DAMPED = (1, 4, 5, 6, 7, 8, 9, 10, 11)
TABLE_1 = {"m": 1.0, "m_l": 1.0, "k": 10.0, "c": 0.2, "Kv": 0.5, "Kp": 5.0, "p": 0.1, "H": 1e4, "m_o": 5.0}
SETTLING = ("settling_1", "settling_5", "rest", "size")  # other measures that "converges" may mean


def times(letter: str, *factors: float) -> tuple[str, tuple[float, ...]]:
    """A sweep: a letter, and multiples of its value in Table 1."""
    return letter, tuple(round(TABLE_1[letter] * factor, 12) for factor in factors)


def tenfold(letter: str, *more: float) -> tuple[str, tuple[float, ...]]:
    """A sweep from twice to twenty times the value of Table 1, and by more factors."""
    return times(letter, 2.0, 3.0, 5.0, 10.0, 20.0, *more)


ALONE = (("k = c = 0: the feedback alone holds the arms", lambda cases: with_values(cases[1], {"k": 0.0, "c": 0.0})),)
JUMPING = (
    ("scene v_jump_symmetric, p = 10", lambda _: scenes.load("v_jump_symmetric")),
    ("scene v_jump_one_sided, p = 15", lambda _: scenes.load("v_jump_one_sided")),
)
ANY_P = "p", (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
LOSSY_IMPACTS = Comparison(
    "Without dampers, impacts that lose energy make the motion decay.", "rest", Variant(3), LOWER,
    "Every impact takes the part 1 - e^2 of its energy, with e = 1 - (2/3) p v to first order; nothing else takes any.",
    *times("p", 0.1, 0.3, 1.0, 3.0, 10.0), ("size",), others=(Variant(2),),
)


@threshold("all masses stay within 2 % before the limit of time", " s")
def marginal_settles(cases: Cases, start: Start) -> Found:
    """No. 3 settles; from a start that has a name its time is a range."""
    named = start == PRINTED or start in READ_STARTS.values()
    return (motion.converges_wherever if named else motion.converges)(started(cases[3], start))


@threshold(f"the ratio, above or below 1, exceeds {MARGIN:g}")
def gain_matters(number: int, cases: Cases, start: Start) -> Found:
    """Largest change of settling time or frequency, as a ratio above 1."""
    a, b = started(cases[number], start), started(cases[STANDARD], start)
    changes = [ratio(measure(a, name), measure(b, name)) for name in ("settling", "frequency")]
    change = max(max(each, 1.0 / each) if each else math.inf for each in changes)
    return Found(change, change > MARGIN)


@threshold(f"C / (2 sqrt(K m)) of No. 9 over No. 1 below {1.0 / MARGIN:.3g}")
def less_damped(cases: Cases, _: Start) -> Found:
    """The damping ratio falls; it does not depend on the start."""
    share = _damping_ratio(cases[9]) / _damping_ratio(cases[1])
    return Found(share, share < 1.0 / MARGIN)


@threshold(f"C / (2 sqrt(K m)) of No. 10 over No. 1 above {MARGIN:g}")
def more_damped(cases: Cases, _: Start) -> Found:
    """It grows."""
    share = _damping_ratio(cases[10]) / _damping_ratio(cases[1])
    return Found(share, share > MARGIN)


def _damping_ratio(scene: Scene) -> float:
    C, K = (value_of(scene, own) + value_of(scene, gain) for own, gain in (("c", "Kv"), ("k", "Kp")))
    return C / (2.0 * math.sqrt(K * value_of(scene, "m_l")))


class Gripped(NamedTuple):
    """That a grasp is possible: whether the arms press the object in the paper's cases, and with another set-point."""

    values: tuple[float, ...] = ()  # nothing is swept

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """In the cases that settle, as T9, and where the set-points overlap."""
        own = [motion.holds_on(cases[number]) for number in DAMPED]
        share = sum(found.holds for found in own) / len(own)
        held = motion.holds_on(scenes.load("preload"))
        return Part(
            "With set-points that allow it both arms press the object in the end.", motion.holds_on.threshold,
            "Both arms are regulated to the same point, so that in the end there is no deformation and no force;"
            " overlapping set-points produce both.",
            (Check(Kind.PRINTED, "the cases with dampers", f"{share:.0%} of {len(own)}", share, share == 1.0),
             Check(Kind.PRINTED, "set-points that overlap by 50 mm, scene preload", f"{held.value:.3g} N",
                   float(held.holds), held.holds)),
        )


def _unequal(letter: str, factor: float, case: int, why: str, read_as: str = "") -> Comparison:
    """A left arm that differs in one number, against the pair of which both have the one value, and the other.

    With `read_as` it is another reading of the sentence.
    """
    left, value = f"{letter}_l", TABLE_1[letter] * factor
    both = {"m": 5, "k": 7, "c": 8, "Kv": 10, "Kp": 9, "p": 4}  # the cases in which both arms have ten times that
    tenfold_pair = letter in both and factor == 10.0
    return Comparison(
        f"{read_as}With {left} = {value:g} alone the arms settle later than either equal pair.", "settling",
        Variant(case) if case != STANDARD else Variant(case, ((left, value),), f"No. 1 with {left} = {value:g} alone"),
        HIGHER, why, left, times(letter, 0.1, 0.3, 3.0, 10.0, 30.0)[1], ("settling_1", "settling_5", "rest"),
        others=(FIRST, Variant(both[letter]) if tenfold_pair else Variant(STANDARD, ((letter, value),))),
        reading=bool(read_as),
    )


BETWEEN = "An unequal pair lies between the equal ones: "
CONTACTS = "Read as: unequal contacts, too. "
UNEQUAL_PAIRS = (  # conclusion (3), and the second half of observation (8)
    _unequal("m", 10.0, 6, f"{BETWEEN}the envelope exp(-C t / 2m) is slow in one arm, and in two of two heavy arms."),
    _unequal("m", 0.1, 1, "The lighter arm stops sooner, and then hardly slows the object down."),
    _unequal("k", 10.0, 1, "Arms of different periods meet the object at different times and keep it moving, and a"
             " stiff arm, which hardly gives way, takes little from it."),
    _unequal("c", 10.0, 1, f"{BETWEEN}one damper more is better than none more, and worse than two."),
    _unequal("Kv", 10.0, 1, f"{BETWEEN}one arm with more feedback takes energy for both."),
    _unequal("Kp", 10.0, 1, "To the motion Kp_l is a stiffness, as k_l is: arms of different periods meet the object at"
             " different times and keep it moving."),
    _unequal("p", 10.0, 1, f"{BETWEEN}one contact that loses more takes energy for both.", CONTACTS),
    _unequal("H", 10.0, 1, "A harder contact is a shorter one, but what an impact takes, 1 - e = 2 p v / 3 to first"
             " order, does not depend on H.", CONTACTS),
    Comparison(
        "Read as: with the sum of the masses kept. Unequal arms settle later than equal ones.", "settling", Variant(6),
        HIGHER,
        "The heavier arm has a slower envelope, exp(-C t / 2m), than two of the mean mass; but only one has it.",
        words=("settling_1", "settling_5", "rest"),
        others=(Variant(STANDARD, (("m", 5.5),), "both arms with 5.5 kg"),),
        pairs=((Variant(STANDARD, (("m_l", 1.8), ("m_r", 0.2)), "masses 1.8 and 0.2 kg"), FIRST),),
        reading=True,
    ),
)
HEAVY_OBJECT = (
    "The object has no damper: its energy leaves through the arms, in impacts that move it the less the heavier it is."
)

OBSERVATIONS = numbered("P", "p. 247, observation", {
    "Collisions that lose energy stabilise a grasp whose arms have no damping.": [
        LOSSY_IMPACTS,
        Share("The motion of No. 3 settles.", marginal_settles,
              "The loss falls with the speed of the impacts, so that displacements decay like 1/t, not exponentially.",
              (3,), *times("p", 3.0, 10.0, 30.0)),
        Universal("Lyapunov's function agrees: V never rises in No. 3.", motion.paper_V_falls,
                  "V' is 0 in flight and -2 p H u^(3/2) u'^2 in contact.", (3,), *times("p", 0.1, 1.0, 10.0), base=3)],
    "More energy loss in collisions makes the manipulators converge better.": [
        Comparison("No. 4 settles sooner than No. 1.", "settling", Variant(4), LOWER,
                   "More of the energy of relative motion is lost in each impact, on top of what the dampers take.",
                   *tenfold("p", 50.0, 100.0), SETTLING)],
    "Linear feedback makes a stable grasp possible.": [
        Universal("V_c never rises under the feedback.", motion.repaired_V_falls,
                  "All terms of V_c' are losses (theorem 1 of docs/certificate.md).",
                  letter="Kp", values=(0.0, 5.0, 50.0, 500.0), extra=ALONE),
        Universal("Arms and object settle.", motion.converges, "The arms are driven to 0 and enclose the object.",
                  DAMPED, "Kv", (0.05, 0.2, 2.0, 20.0), extra=ALONE),
        Gripped()],
    "The grasp stays stable when masses, stiffnesses and damping change.": [
        *(Universal(f"V_c never rises, whatever {letter}.", motion.repaired_V_falls,
                    "V_c' has no term whose sign depends on a mass or a stiffness.",
                    cases, *times(letter, 0.01, 0.1, 10.0, 100.0))
          for letter, cases in (("m", (5, 6)), ("k", (7,)), ("c", (8,)), ("m_o", (11,))))],
    "Heavier manipulators vibrate at a higher frequency and are less controllable.": [
        Comparison("The arms swing faster in No. 5 than in No. 1.", "frequency", Variant(5), HIGHER,
                   "An arm swings at sqrt(K/m): ten times the mass lowers it by sqrt(10).", *tenfold("m")),
        Comparison("No. 5 needs longer to settle than No. 1.", "settling", Variant(5), HIGHER,
                   "The envelope of an arm is exp(-C t / 2m): ten times the mass, ten times the time.",
                   *tenfold("m"), SETTLING)],
    "Stiffer manipulators converge better to a degree, but need longer.": [
        Comparison("Displacements are smaller in No. 7 than in No. 1.", "size", Variant(7), LOWER,
                   "More swings and harder impacts in the same time take the energy sooner.",
                   *tenfold("k"), ("rest",)),
        Comparison("No. 7 needs longer to settle than No. 1.", "settling", Variant(7), HIGHER,
                   "Stiffer arms come back sooner and hit faster: more impacts a second, and each loses more (1 - e ="
                   " 2 p v / 3). Far beyond No. 7 an arm hardly gives way and takes little from the object.",
                   *tenfold("k", 40.0, 100.0), ("settling_1", "settling_5", "swings"))],
    "More damping of the manipulators makes them converge better.": [
        Comparison("No. 8 settles sooner than No. 1.", "settling", Variant(8), LOWER,
                   "c adds to Kv: the envelope of an arm is exp(-C t / 2m) up to critical damping; beyond it the arm"
                   " creeps back, as exp(-K t / C).", *tenfold("c", 50.0, 100.0, 250.0, 500.0), SETTLING)],
    "Unequal manipulators converge unequally and are less controllable in total.": [
        Comparison("The arms move less alike in No. 6 than in No. 1.", "lopsided", Variant(6), HIGHER,
                   "A light and a heavy arm reach the object at different times and push it aside.",
                   *tenfold("m_l"), others=(FIRST, Variant(5))),
        *UNEQUAL_PAIRS],
    "The feedback gains change the behaviour.": [
        *(Share(f"No. {number} differs from No. 1 in settling time or frequency.", gain_matters.of(number),
                "Kp adds to the stiffness of an arm, Kv to its damping.", (number, STANDARD), *tenfold(letter))
          for number, letter in ((9, "Kp"), (10, "Kv")))],
    "Higher position gains need more force and converge worse, as the relative damping is less.": [
        Comparison("The largest input force of No. 9 is above that of No. 1.", "input", Variant(9), HIGHER,
                   "From rest the largest input is Kp x(0), unless Kv v exceeds it later.", *tenfold("Kp")),
        Comparison("No. 9 needs longer to settle than No. 1.", "settling", Variant(9), HIGHER,
                   "The envelope of an arm, exp(-C t / 2m), does not depend on Kp; more and faster impacts dissipate"
                   " more.",
                   *tenfold("Kp"), (*SETTLING, "swings")),
        Share("The damping ratio of an arm falls.", less_damped, "K grows and C does not.",
              (9, STANDARD), *tenfold("Kp"))],
    "Higher velocity gains converge better, as the relative damping is more.": [
        Comparison("No. 10 settles sooner than No. 1.", "settling", Variant(10), LOWER,
                   "Kv adds to c: the envelope of an arm is exp(-C t / 2m) up to critical damping; beyond it the arm"
                   " creeps back, as exp(-K t / C).", *tenfold("Kv", 50.0, 100.0, 200.0), SETTLING),
        Share("The damping ratio of an arm grows.", more_damped, "C grows and K does not.",
              (10, STANDARD), *tenfold("Kv"))],
    "A heavier object makes the grasp less controllable and slower to converge.": [
        Comparison("More of V_c is left at 20 s in No. 11 than in No. 1.", "rest", Variant(11), HIGHER, HEAVY_OBJECT,
                   *tenfold("m_o"), ("size",)),
        Comparison("No. 11 needs longer to settle than No. 1.", "settling", Variant(11), HIGHER,
                   f"{HEAVY_OBJECT} Near a symmetric start the object hardly moves, and a light one that does is the"
                   " slower one.", *tenfold("m_o"), ("settling_1", "settling_5"))],
})

CONCLUSIONS = numbered("C", "p. 248, conclusion", {
    "Lyapunov's direct method proves that a grasp with collisions can be stable.": [
        Universal("In the paper's cases the printed V never rises.", motion.paper_V_falls,
                  "V jumps only where the Hertz term of a pair that separates at 1/p returns (next part).",
                  letter="H", values=(1e2, 1e3, 1e5)),
        Universal("In the paper's cases no pair separates faster than 1/p while it penetrates.",
                  motion.separates_slowly,
                  "Where p is below sqrt(mu / V_c(0)) none can (theorem 2 of docs/certificate.md); No. 4 is beyond"
                  " that, approaches faster than 1/p, but separates more slowly, since impacts dissipate energy.",
                  letter="p", values=(0.01, 0.3, 1.0)),
        Universal("The printed V never rises, whatever p.", motion.paper_V_falls,
                  "The Hertz term of a pair that separates faster than 1/p is removed from V and returns: V jumps up.",
                  (1, 4), *ANY_P, extra=JUMPING),
        Universal("V_c, which keeps the Hertz term whenever u > 0, never rises, whatever p.", motion.repaired_V_falls,
                  "It is continuous, and all terms of its rate are losses (theorem 1 of docs/certificate.md).",
                  (1, 4), *ANY_P, extra=JUMPING)],
    "Collision stabilises under some conditions, such as marginal stability.": [LOSSY_IMPACTS],
    "Unequal arms under the same control are less controllable than equal ones.": UNEQUAL_PAIRS,
})

"""All statements of the paper: those of its running text, pages 244 to 248, here as parts that can be measured."""

from __future__ import annotations

from grasp_ros import scene as scenes
from lab.paper import motion
from lab.paper.arms import STEPS
from lab.paper.cases import NUMBERS, Cases, Start, started
from lab.paper.claims import Statement
from lab.paper.compare import LOWER, Comparison, Variant
from lab.paper.measures import MARGIN, measure, ratio
from lab.paper.observations import CONCLUSIONS, DAMPED, LOSSY_IMPACTS, OBSERVATIONS
from lab.paper.universal import Found, Share, Universal, threshold

EVERY = 10**6  # of the random starts
LONG = 500.0  # s
LONGER = ((f"No. 2 over {LONG:g} s", lambda cases: cases[2].changed({"time.duration_s": LONG})),)
AFTER_27, AFTER_34 = "p. 245, after (27)", "p. 245, after (34)"
ANY_P = "p", (0.1, 1.0, 10.0)
ANY_H = "H", (1e2, 1e3, 1e5)
ANY_MASS = "m_o", (0.05, 0.5, 50.0)


def _alone(number: int) -> Share:
    """Settling time with the object over that of the arms alone."""
    @threshold(f"settling time of No. {number} over that of its arms without an object below {1.0 / MARGIN:.3g}")
    def sooner(cases: Cases, start: Start) -> Found:
        scene = started(cases[number], start)
        share = ratio(measure(scene, "settling"), measure(motion.without_object(scene), "settling"))
        return Found(share, share < 1.0 / MARGIN)

    return Share(
        f"Read as: collisions at all. No. {number} settles sooner than its arms would without an object.", sooner,
        "Impacts move energy into the object, which has no damper, and give it back to the arms later.",
        (number,), "p", (0.0, 1.0, 10.0), EVERY, reading=True,
    )


def _with_loss(*numbers: int) -> Comparison:
    """The collision term against none, in cases whose arms have dampers."""
    (changed, other), *pairs = ((Variant(number), Variant(number, (("p", 0.0),))) for number in numbers)
    return Comparison(
        "A motion with the collision term settles sooner than without it.", "settling", changed, LOWER,
        "The term takes energy in impacts; where dampers take it sooner, little is left for it.",
        "p", (0.1, 0.2, 0.5, 1.0, 2.0, 5.0), ("settling_5", "rest"), others=(other,), pairs=tuple(pairs),
    )


RUNNING_TEXT = (
    Statement("T1", "p. 244 to 245, (18), (20), (23), (25), (27)", "V never grows within a condition of contact.", [
        Universal("V' <= 0 at every instant.", motion.rate_is_never_positive,
                  "With a = b = 4/5 the elastic terms cancel; the remaining terms are <= 0 for every state.", NUMBERS,
                  *ANY_P)]),
    Statement("T2", AFTER_34, "An object that rests off its origin stays there unless a force from outside acts.", [
        Universal("It rests until an arm touches it.", motion.object_rests_until_touched,
                  "Without contact nothing pushes the object, (3).", NUMBERS, *ANY_MASS)]),
    Statement("T3", AFTER_34, "The same sentence (T2), read as for good: an object off its origin stays there.", [
        Universal("It rests for good.", motion.object_stays,
                  "The arms swing to 0 and meet the object on their way; the only common equilibrium is the origin"
                  " (T5).", NUMBERS, *ANY_MASS)]),
    Statement("T4", "p. 245, (35) to (37)", "The arms enclose the object but for the largest deformation.", [
        Universal("x_l - eps_l <= x_o <= x_r + eps_r at all times.", motion.enclosed,
                  "It is the definition of eps; that eps is bounded follows from V_c: eps <= (5 V_c(0) / 4H)^(2/5).",
                  NUMBERS, *ANY_P)]),
    Statement("T5", "p. 245, after (37)", "x_l and x_r converge to zero in any condition, and x_o with them.", [
        Universal("All masses settle, with or without losses.", motion.converges,
                  "One kind of dissipation is needed, by dampers (C > 0) or by impacts (p > 0); No. 2 has none, its"
                  " V_c is constant, and it is the counterexample.", NUMBERS, "p", (0.0, 1.0, 10.0), base=2),
        Universal("All masses settle where the arms have dampers.", motion.converges,
                  "Every swing and every impact takes energy until none is left.",
                  DAMPED, "p", (0.0, 0.1, 1.0, 10.0))]),
    Statement("T6", AFTER_27, "The collision term makes V fall faster than without it.", [
        Universal("The collision terms of (18) are never negative.", motion.collision_term_lowers,
                  "p H u^(3/2) u'^2 is a product of non-negative factors, for every state.",
                  NUMBERS, *ANY_P)]),
    Statement("T7", AFTER_27, "The term makes V' smaller than without it, which implies that collision stabilises.", [
        _with_loss(1, 4, 8, 10), *map(_alone, (1, 8, 10))]),
    Statement("T8", AFTER_27, "Without dampers V is constant without contact and falls in contact, so that the whole is"
              " stable.", [
        Universal("V' is 0 in flight, and V has fallen after 20 s.", motion.falls_only_in_contact,
                  "With C = 0 the collision terms alone are left of (18).", (3,), "p", (0.01, 0.1, 1.0), base=3),
        LOSSY_IMPACTS]),
    Statement("T9", "p. 248, conclusion (1), and the title", "What is controlled is a grasp, position and force.", [
        Universal("Both arms press the object in the end.", motion.holds_on,
                  "Both arms are regulated to the same point: in the end there is no deformation and no force.", extra=(
                      ("set-points that overlap by 50 mm, scene preload", lambda _: scenes.load("preload")),))]),
    Statement("T10", "p. 246, method", "Linear interpolation gives the exact time of a contact.", [
        *(Universal(f"With a step of {1e3 * step:g} ms it is exact.", motion.first_contact_error.of(step),
                    "Linear interpolation over a step h has the error h^2 |u'' / u'| / 8; u'' = 0 at the touch only"
                    " without damping, from x_o = 0.", NUMBERS, "Kv", (0.0, 5.0)) for step in STEPS),
        *(Universal(f"Read as: exact to the second order of a step of {1e3 * step:g} ms.", motion.second_order.of(step),
                    "That is what linear interpolation can do.", NUMBERS, "Kv", (0.0, 5.0), reading=True)
          for step in STEPS)]),
    Statement("T11", "p. 246, method", "The method can follow any number of collisions: nothing limits it.", [
        *(Universal(f"With a step of {1e3 * step:g} ms it goes on to the end, however many touches come.",
                    motion.goes_on.of(step), "Every step determines the contacts anew; their number is not limited.",
                    NUMBERS, "H", (1e2, 1e5), extra=LONGER) for step in STEPS),
        *(Universal(f"Read as: it finds every touch, with a step of {1e3 * step:g} ms.", motion.none_missed.of(step),
                    "Contact is detected at the ends of a step; contacts in between are missed. Above 1 the motion has"
                    " already diverged.", NUMBERS, "H", (1e2, 1e5), reading=True)
          for step in STEPS)]),
    Statement("T12", "p. 246, No. 2", "No. 2 goes on periodically and neither diverges nor converges.", [
        Universal("It neither diverges nor converges.", motion.keeps_V, "All terms of V_c' are 0.",
                  (2,), *ANY_H, base=2),
        Universal("It is periodic.", motion.returns,
                  "Three masses with impacts have no common period, but for a start that is symmetric to the last bit,"
                  " where the object rests; that motion is unstable.", (2,), *ANY_H, base=2)]),
)
STATEMENTS = {each.key: each for each in (*OBSERVATIONS, *CONCLUSIONS, *RUNNING_TEXT)}

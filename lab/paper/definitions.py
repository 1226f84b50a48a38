"""Words of the study, each defined once; the page prints them."""

from __future__ import annotations

from grasp_ros.simulation.chunk import SETTLED
from lab.paper.cases import FARTHEST, NEAREST, OFFSETS, READ_P, SEED
from lab.paper.claims import ALMOST_ALL, HALF
from lab.paper.measures import BOUNDS, LIMIT, MARGIN
from lab.paper.scatter import CONFIDENCE
from lab.paper.universal import FEW, FEWER

TITLE = "The paper, reproduced and judged"
SUBTITLE = (
    "T. Fukuda, Y. Shoji, M. Inaba: Stable Position/Force Control of Robotic Manipulator with Consideration of"
    " Collision Phenomena. IFAC 11th World Congress, Tallinn 1990. Its statements are paraphrased, with page and"
    " number; T1 to T12 are statements from its running text."
)
SWEEPS = (
    "Ratio of the measure to that of No. 1 (O1: of No. 2), median over random starts with its 95 % interval. Grey:"
    " values that contradict the statement. Blue, filled: the whole interval agrees with it; orange, cross: the whole"
    " interval contradicts it; black, open: neither. Dotted: the value of the paper's case."
)
PRINTS = (  # how the figures of the paper are read
    "The available source is the text of a scan. It contains captions, labels of curves and numbers at axes, but no"
    " curves, and the upper ends of the displacement axes are lost. What can be read is compared: the caption with the"
    " parameters that change, and each axis with our curve, which may exceed its end by 1 % of the axis, the width of"
    " a line. What the paper says about its curves is judged under the statements in the last column."
)
RANDOM_STARTS = 200


def definitions(starts: int) -> dict[str, str]:
    """The text of each by its name."""
    bounds = " and ".join(f"{bound:.0%}" for bound in sorted(BOUNDS.values()) if bound != SETTLED)
    return {
        "settled":
            f"no mass leaves {SETTLED:.0%} of the larger initial displacement again. The settling time is the last"
            " time outside, computed from closed forms and polynomials. A run continues until V_c, which never rises,"
            f" proves that no mass leaves again, at most {LIMIT:g} s; later counts as never. {bounds} are computed as"
            " well.",
        "random starts":
            f"at rest, x_l in [-{FARTHEST:g}, -{NEAREST:g}], x_o = 0, x_r in [{NEAREST:g}, {FARTHEST:g}] m, uniform,"
            f" {starts} of them from seed {SEED}; the same for both cases of a comparison, and all of them for each"
            f" value of its sweep. Statements about every motion use the first {min(FEW, starts)} for each case, and"
            f" the first {min(FEWER, starts)} for each value of a sweep. A median is followed by the interval that"
            f" contains the median of all such starts with {CONFIDENCE:.0%} (order statistics), and a sweep is"
            " conclusive at a value only if the whole interval lies on one side.",
        "digits of a settling time":
            f"every settling time of one start is computed {len(OFFSETS)} times, with x_l(0) moved to both sides by"
            f" {min(map(abs, OFFSETS)):g} to {max(OFFSETS):g} m. If these differ by more than half a percent, their"
            " range is given instead of a number: collisions amplify differences, and no measurement or other"
            " arithmetic can show more digits. A comparison holds for a start if it holds for all of them.",
        "higher, lower, sooner, later":
            f"by more than a factor of {MARGIN:g}, case over case, unless another amount is given.",
        "controllability":
            "the paper does not define it: a grasp is less controllable if it settles later (other measures: 1 % and 5"
            " %, V_c left at 20 s, root mean square displacement).",
        "frequency": "half the number of sign changes of x_l' and x_r' within 20 s, per second and arm.",
        "asymmetry of a start": "|x_l(0) + x_r(0)| divided by the larger of both displacements.",
        "decay rate of V_c":
            "minus the slope of a straight line fitted to log V_c over the 20 s, by least squares.",
        "losses":
            "energy taken from the motion within 20 s: by the dampers c, by the velocity feedback Kv, by impacts; in"
            " the table of quantities in % of V_c(0), and in the bars of the figures in % of the energy lost.",
        "holds":
            f"in the paper's cases as printed, from the same start for both cases, in at least {ALMOST_ALL:.0%} of the"
            " random starts (statements about every motion: in all), and, along the sweep of the parameter, as"
            " stated at most of its values and reversed at none.",
        "does not hold":
            f"true in less than {HALF:.0%} of the random starts, in every case that the statement is about and in"
            " every comparison.",
        "holds within stated limits": "all other statements; the checks that fail are the limits.",
        "readings":
            "the sign of x_l(0), x_o(0), the starts of the symmetric cases (the mirror image of the printed start only"
            " where the arms differ; otherwise the motion is the same), p of No. 4"
            f" ({', '.join(f'{p:g}' for p in READ_P)} s/m), and other measures for the same word do not affect the"
            " verdict; those that would reverse it are named. A part that begins with"
            ' "Read as" interprets the whole sentence in another way, and does not affect the verdict either.',
        "V, V_c":
            "V is the paper's function (16), twice the energy; V_c keeps its Hertz term whenever u > 0, and is twice"
            " the energy, too. Losses are energies.",
    }

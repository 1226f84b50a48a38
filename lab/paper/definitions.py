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
    " Collision Phenomena. IFAC 11th World Congress, Tallinn 1990. Its statements are restated in our words, with page"
    " and number; T1 to T12 are statements of its running text."
)
SWEEPS = (
    "Ratio of the measure to that of No. 1 (O1: of No. 2), median over random starts with its 95 % interval. Grey:"
    " where the statement says that it is not. Blue, full: the whole interval is where it says; orange, a cross:"
    " the whole interval is on the other side; black, open: neither. Dotted: the value of the paper's case."
)
PRINTS = (  # how the figures of the paper are read
    "The source at hand is the text of a scan: captions, letters of curves and numbers at axes are in it, curves are"
    " not, and of the displacement axes the upper ends are lost. What can be read is compared: the caption with the"
    " numbers that change, and each axis with our curve, which may pass its end by 1 % of the axis, a line's width."
    " What the paper says of its curves is judged in its statements, named in the last column."
)
RANDOM_STARTS = 200


def definitions(starts: int) -> dict[str, str]:
    """The text of each by its name."""
    bounds = " and ".join(f"{bound:.0%}" for bound in sorted(BOUNDS.values()) if bound != SETTLED)
    return {
        "settled":
            f"no mass leaves {SETTLED:.0%} of the larger initial displacement any more. The settling time is the last"
            " time at which one does, from closed forms and polynomials. A run goes on until V_c, which never rises,"
            f" proves that nothing leaves any more, at most {LIMIT:g} s; later counts as never. {bounds} are looked at,"
            " too.",
        "random starts":
            f"at rest, x_l in [-{FARTHEST:g}, -{NEAREST:g}], x_o = 0, x_r in [{NEAREST:g}, {FARTHEST:g}] m, uniform,"
            f" {starts} of them from seed {SEED}; the same for both cases of a comparison, and all of them for each"
            f" value of its sweep. Statements about every motion use the first {min(FEW, starts)} for each case, and"
            f" the first {min(FEWER, starts)} for each value of a sweep. Behind a median stands the interval that holds"
            f" the median of all such starts with {CONFIDENCE:.0%} (order statistics), and a sweep says something of a"
            " value only where the whole interval lies on one side.",
        "digits of a settling time":
            f"every settling time of one start is computed {len(OFFSETS)} times, with x_l(0) moved to both sides by"
            f" {min(map(abs, OFFSETS)):g} to {max(OFFSETS):g} m. Where these differ by more than half a percent their"
            " range stands in place of a number: collisions magnify differences, and no measurement and no other"
            " arithmetic can show more digits. A comparison holds from a start if it does in all of them.",
        "higher, lower, sooner, later":
            f"by more than a factor of {MARGIN:g}, case over case; by whatever amount stands beside it.",
        "controllability":
            "the paper does not define it: a grasp is less controllable if it settles later (other measures: 1 % and 5"
            " %, V_c left at 20 s, root mean square displacement).",
        "frequency": "half the changes of the sign of x_l' and x_r' within 20 s, per second and arm.",
        "asymmetry of a start": "|x_l(0) + x_r(0)| in the larger of both displacements.",
        "decay rate of V_c":
            "minus the slope of a straight line fitted to log V_c over the 20 s, by least squares.",
        "losses":
            "energy taken from the motion within 20 s: by the dampers c, by the velocity feedback Kv, by impacts; in"
            " the table of quantities in % of V_c(0), which leaves out what has not been lost yet, and in the bars of"
            " the figures in % of what was lost.",
        "holds":
            f"in the paper's cases as printed, from the same start for both cases, in at least {ALMOST_ALL:.0%} of the"
            " random starts (statements about every motion: in all), and, along the sweep of the parameter, nowhere the"
            " other way round and mostly as stated.",
        "does not hold":
            f"true in less than {HALF:.0%} of the random starts, in every case that the statement is about and against"
            " everything that it is compared with.",
        "holds within stated limits": "all else; the checks that fail are the limits.",
        "readings":
            "the sign of x_l(0), x_o(0), the starts of the symmetric cases (the mirror image of the printed start only"
            " where the arms differ: it is no other motion elsewhere), p of No. 4"
            f" ({', '.join(f'{p:g}' for p in READ_P)} s/m), and other measures for the same word do not enter the"
            " verdict; those by which it would come out the other way are named beside it. A part that begins with"
            ' "Read as" restates the whole sentence in another way, and does not enter either.',
        "V, V_c":
            "V is the paper's function (16), twice the energy; V_c keeps its Hertz term whenever u > 0, and is twice"
            " the energy, too. Losses are energies.",
    }

"""What the paper says in its running text on its method and on No. 2, restated as parts that can be measured."""

from __future__ import annotations

from functools import partial

from grasp_ros.scene import Scene
from lab.paper import motion
from lab.paper.cases import Cases
from lab.paper.statement import Statement
from lab.paper.universal import Universal

STEPS = ((1e-3, "1 ms"), (1e-2, "10 ms"))


def _interpolation() -> Statement:
    exact = [
        Universal(
            f"With a step of {text} it is exact.",
            f"error of the first time of contact at most {motion.EXACT:g} s",
            partial(motion.first_contact_error, step),
            "Interpolation between the ends of a step leaves h^2 |u'' / u'| / 8; only without damping, from x_o = 0, is"
            " u'' = 0 at the touch.",
            letter="Kv",
            values=(0.0, 5.0),
            unit=" s",
        )
        for step, text in STEPS
    ]
    order = [
        Universal(
            f"Read as: exact to the second order of a step of {text}.",
            f"error over h^2 |u'' / u'| / 8: at most {1.0 + motion.ORDER:g}",
            partial(motion.second_order, step),
            "That is what linear interpolation can do.",
            letter="Kv",
            values=(0.0, 5.0),
            reading=True,
        )
        for step, text in STEPS
    ]
    words = "Linear interpolation gives the exact time of a contact."
    return Statement("T10", "p. 246, method", words, (*exact, *order))


LONG = 500.0  # s


def _long(cases: Cases) -> Scene:
    return cases[2].changed({"time.duration_s": LONG})


def _many_collisions() -> Statement:
    goes_on = [
        Universal(
            f"With a step of {text} it goes on to the end, however many touches come.",
            "it reaches the end, and has touched",
            partial(motion.goes_on, step),
            "Every step decides anew what is in contact; nothing counts.",
            letter="H",
            values=(1e2, 1e5),
            extra=((f"No. 2 over {LONG:g} s", _long),),
            unit=" touches",
        )
        for step, text in STEPS
    ]
    finds = [
        Universal(
            f"Read as: it finds every touch, with a step of {text}.",
            "touches found over those that are there: at least 1",
            partial(motion.none_missed, step),
            "Contact is decided at the ends of a step; what opens and closes in between is not seen. Above 1 the motion"
            " is on another path by then.",
            letter="H",
            values=(1e2, 1e5),
            least=True,
            reading=True,
        )
        for step, text in STEPS
    ]
    words = "The method can follow any number of collisions: nothing limits it."
    return Statement("T11", "p. 246, method", words, (*goes_on, *finds))


def method_text() -> list[Statement]:
    """T10 to T12."""
    return [
        _interpolation(),
        _many_collisions(),
        Statement(
            "T12",
            "p. 246, No. 2",
            "No. 2 goes on periodically and neither diverges nor converges.",
            (
                Universal(
                    "It neither diverges nor converges.",
                    f"V_c changes by at most {motion.DRIFT:g}",
                    motion.keeps_V,
                    "There is no term left in V_c'.",
                    (2,),
                    "H",
                    (1e2, 1e3, 1e5),
                    base=2,
                ),
                Universal(
                    "It is periodic.",
                    f"it comes back to its start within 20 s, to {motion.RETURN:g} of sqrt(V(0))",
                    motion.returns,
                    "Three masses with impacts have no common period, but for a start that is symmetric to the last"
                    " bit, where the object rests; it rests on a knife-edge.",
                    (2,),
                    "H",
                    (1e2, 1e3, 1e5),
                    least=True,
                    base=2,
                ),
            ),
        ),
    ]

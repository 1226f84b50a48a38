"""Outcomes of a run: numbers that say what came of it, computed from closed forms and polynomials, not from a grid.

Each `Outcome` is one column; a group of columns has a name of its own. A run that stops before its end has no outcomes
but its last state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce
from operator import or_
from typing import NamedTuple

import numpy as np

from grasp_ros.observe.record import SEEN, Quantity, Seen, Wanted
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.layout import U
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import NAMES
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation.tables import COLUMNS

NOTHING = Wanted(0)


class Runs(NamedTuple):
    """What is left of n runs when they are over."""

    seen: Array  # (n, k), see `observe.record.Seen`
    state: Array  # (n, 6)
    touches: Array  # (n, 2)
    growth: Array  # (n,) largest Lyapunov exponent, 1/s


class Outcome(NamedTuple):
    """One column."""

    name: str
    unit: str
    text: str
    wanted: Wanted
    read: Callable[[Runs], Array]


def _column(name: str, column: int) -> Callable[[Runs], Array]:
    """One column of an array of `Runs`."""
    return lambda runs: np.asarray(getattr(runs, name)[:, column])


def _settled(body: int) -> Callable[[Runs], Array]:
    """Of one body, where it is known that all have settled."""
    return lambda runs: np.where(np.isfinite(runs.seen[:, Seen.SETTLED]), runs.seen[:, Seen.OUTSIDE + body],
                                 runs.seen[:, Seen.SETTLED])


def _largest(q: int) -> Callable[[Runs], Array]:
    return lambda runs: np.maximum(np.abs(runs.seen[:, Seen.LOW + q]), np.abs(runs.seen[:, Seen.HIGH + q]))


def _peak(q: int) -> Callable[[Runs], Array]:
    return lambda runs: np.maximum(runs.seen[:, Seen.HIGH + q], 0.0)


_GROUPS: dict[str, tuple[Outcome, ...]] = {
    "settling_time": (Outcome(
        "settling_time", "s", "after it no mass leaves the bound, a fraction of the largest initial displacement: V_c"
        " proves it, for which the run continues; inf: not proved within the horizons; nan: no proof, because V_c can"
        " rise or a mass is not driven to 0", Wanted.SETTLING, _column("seen", Seen.SETTLED)),),
    "settling_times": tuple(
        Outcome(f"settling_time_{name}", "s", f"the same of the {name} mass alone, where all settle", Wanted.SETTLING,
                _settled(body)) for body, name in NAMES.items()),
    "last_outside": (Outcome(
        "last_outside", "s", "last time within the run at which a mass is outside the bound; known for every scene,"
        " but no proof of what follows; inf: outside at the end", Wanted.BOUND,
        lambda runs: np.asarray(np.fmax.reduce(runs.seen[:, Seen.LAST_OUTSIDE : SEEN], axis=1))),),
    "last_outside_times": tuple(
        Outcome(f"last_outside_{name}", "s", f"the same of the {name} mass alone", Wanted.BOUND,
                _column("seen", Seen.LAST_OUTSIDE + body)) for body, name in NAMES.items()),
    "touches": tuple(
        Outcome(f"touches_{name}", "1", f"touches of the {name} arm", NOTHING, _column("touches", side))
        for side, name in enumerate(SIDES)),
    "peak_input": tuple(
        Outcome(f"peak_input_{name}", "N", f"largest input of the {name} arm: command and external force",
                Wanted.INPUTS, _largest(Quantity.INPUT_L + side)) for side, name in enumerate(SIDES)),
    "peak_impact": tuple(
        Outcome(f"peak_impact_{name}", "N", f"largest impact force of the {name} arm", Wanted.IMPACTS,
                _peak(Quantity.IMPACT_L + side)) for side, name in enumerate(SIDES)),
    "peak_penetration": tuple(
        Outcome(f"peak_penetration_{name}", "m", f"largest penetration of the {name} arm", Wanted.IMPACTS,
                _peak(U.L + side)) for side, name in enumerate(SIDES)),
    "energy": tuple(
        Outcome(name, "J", text, Wanted.LOSSES, _column("seen", i)) for name, text, i in (
            ("lost_dampers", "energy that the dampers of the arms took", Seen.DAMPERS),
            ("lost_feedback", "energy that the velocity feedback took; 0 where commands are held", Seen.FEEDBACK),
            ("lost_friction", "energy that friction of the object took", Seen.FRICTION),
            ("lost_impacts", "energy that the impacts took", Seen.IMPACTS),
            ("work_inputs", "work of held commands and external forces", Seen.WORK),
        )),
    "V_c_rise": (Outcome(
        "V_c_rise", "J", "largest rise of V_c above what it was before, at events, steps and changes of inputs alone",
        Wanted.RISE, _column("seen", Seen.RISE)),),
    "extremes": tuple(
        Outcome(f"{column.name}_{which}", column.unit, f"{word} {column.text}", Wanted.MOTION,
                _column("seen", first + i))
        for i, column in enumerate(COLUMNS[:6])
        for which, word, first in (("min", "least", Seen.LOW), ("max", "largest", Seen.HIGH))),
    "last_state": tuple(
        Outcome(f"{column.name}_end", column.unit, f"{column.text} at the end", NOTHING, _column("state", i))
        for i, column in enumerate(COLUMNS[:6])),
    "lyapunov": (Outcome("lyapunov", "1/s", "largest Lyapunov exponent over the run", NOTHING,
                         lambda runs: runs.growth),),
}
GROUPS: dict[str, tuple[str, ...]] = {group: tuple(entry.name for entry in own) for group, own in _GROUPS.items()}
OUTCOMES: dict[str, Outcome] = {entry.name: entry for own in _GROUPS.values() for entry in own}
LYAPUNOV = "lyapunov"
LAST = frozenset(GROUPS["last_state"])  # also of a run that stopped
V_C_END, CORNER, BY = "V_c_end", "corner", " by "  # columns of derivatives, see `ensemble`: "x_left_end by KEY"
DIFFERENTIATED = (*GROUPS["last_state"], V_C_END)


def derivatives_by(keys: Iterable[str]) -> list[str]:
    """Columns of an ensemble with derivatives by some numbers of its scene."""
    return [V_C_END, *(f"{name}{BY}{key}" for key in keys for name in DIFFERENTIATED), CORNER]


def find(names: Iterable[str]) -> list[Outcome]:
    """Outcomes by the names of columns or groups, each once."""
    found: dict[str, Outcome] = {}
    for name in names:
        if name not in GROUPS and name not in OUTCOMES:
            raise Refused(f"outcome {name}: not known; {allowed(name, {**GROUPS, **OUTCOMES})}")
        found.update({column: OUTCOMES[column] for column in GROUPS.get(name, (name,))})
    if not found:
        raise Refused(f"outcomes: none; allowed: one or more of {', '.join(GROUPS)}")
    return list(found.values())


def wanted_by(columns: Iterable[Outcome]) -> Wanted:
    """What a run must be observed for."""
    return reduce(or_, (column.wanted for column in columns), NOTHING)

"""What is to be designed: free numbers of a scene within ranges, an outcome to make small, and bounds on others."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.observe.record import Wanted
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import names, read_number
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import Setup, check
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.outcomes import GROUPS, find, wanted_by


class Bound(NamedTuple):
    """A largest value of an outcome."""

    outcome: str
    most: float


class Found(NamedTuple):
    """Of n choices of the free numbers: outcomes by name, and what is wrong with them."""

    outcomes: dict[str, Array]  # (n,) each; inf where a run has none
    excess: Array  # (n,) by how much, relative, they break the bounds
    stops: list[str]  # why choices were refused or stopped


class DesignProblem:
    """A scene, its free numbers with their ranges, outcomes to make small, and bounds; what cannot be is refused.

    Keys of an axis that are joined have one value; the search takes logarithmic ranges as such. `minimise` names one
    outcome or two, see `simulation.outcomes`, of a group the largest of its columns; `units` has their units. `setup`
    says how rows are run; its outcomes are those that are needed.
    """

    def __init__(self, scene: Scene, axes: Sequence[Axis], minimise: Sequence[str], bounds: Sequence[Bound] = (),
                 setup: Setup | None = None) -> None:
        minimise = names("minimise", minimise)
        if not 1 <= len(minimise) <= 2 or len(set(minimise)) < len(minimise):
            raise Refused(f"minimise: {', '.join(minimise) or 'nothing'}; allowed: one outcome, or two different ones")
        self.scene, self.minimise, self.bounds = scene, minimise, tuple(bounds)
        for bound in self.bounds:
            if not math.isfinite(bound.most):
                raise Refused(f"{bound.outcome} <= {bound.most!r} is not allowed; allowed: a finite number")
        self.names = tuple(dict.fromkeys([*minimise, *(bound.outcome for bound in bounds)]))
        self._columns = {name: find([name]) for name in self.names}
        for name, columns in self._columns.items():
            if len({column.unit for column in columns}) > 1:
                raise Refused(f"outcome {name}: has several units; allowed: one of {', '.join(GROUPS[name])}")
        self.units = {name: columns[0].unit for name, columns in self._columns.items()}
        self.setup, _ = check(scene, setup, self.names)
        self.axes = Plan(scene, self.setup, tuple(axes), sample=1).axes

    def why_unsettled(self) -> str:
        """Why no run is known to settle, where that is asked for."""
        if not wanted_by(column for columns in self._columns.values() for column in columns) & Wanted.SETTLING:
            return ""
        return f"; {self.scene.why_unsettled(self.setup.sampled)}; last_outside needs no proof"

    def numbers(self, parts: Array) -> dict[str, Array]:
        """Free numbers (n,) by their keys, at parts (n, k) of the ranges in [0, 1]."""
        return {key: axis.at(parts[:, i]) for i, axis in enumerate(self.axes) for key in axis.keys}

    def found(self, numbers: Mapping[str, Array]) -> Found:
        """Simulate choices, given as free numbers (n,) by their keys."""
        table = ensemble(self.scene, numbers, self.names, setup=self.setup)
        outcomes: dict[str, Array] = {}
        for name, columns in self._columns.items():
            worst = np.fmax.reduce([table.columns[column.name] for column in columns])  # nan: an absent body
            outcomes[name] = np.where(np.isnan(worst), np.inf, worst)  # what no run tells is as bad as can be
        excess: Array = np.zeros(len(table.status))
        for bound in self.bounds:
            excess += np.maximum(outcomes[bound.outcome] - bound.most, 0.0) / (abs(bound.most) or 1.0)
        return Found(outcomes, excess, [*table.stops.values()])


def read_bound(text: str) -> Bound:
    """A bound from "OUTCOME<=NUMBER"; another text is refused."""
    name, _, most = re.sub(r"\s", "", text).partition("<=")
    try:
        return Bound(name, read_number(most))
    except ValueError:
        raise Refused(f"subject_to: {text}: not understood; allowed: OUTCOME<=NUMBER") from None

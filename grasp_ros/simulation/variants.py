"""Variants of a scene: rows of other numbers for some of its keys, validated by the rules of the scene.

Most keys are numbers of bodies, pairs or feedback, which go straight into arrays: a whole block of rows is checked
and built at once. Rows that such a check finds fault with, and rows of any other key, are made as a scene of their own,
so that the rules and the sentences are those of `scene.validation` alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from grasp_ros.physics import given
from grasp_ros.physics.control import Column
from grasp_ros.physics.domain import Systems, outside_rows
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, SceneError
from grasp_ros.scene.places import PLACES, parameter_of, place_of


@dataclass
class Block:
    """Systems of n rows as arrays, see `physics.system.System`."""

    bodies: Array  # (n, 3, 4)
    pairs: Array  # (n, 2, 2)
    state: Array  # (n, 6, 1)
    coulomb: Array  # (n, 1, 1)
    laws: Array  # (n, 2, k), see `physics.control.Column`

    @cached_property
    @np.errstate(all="ignore")  # a row that is refused may hold any number
    def closed_loop(self) -> Array:
        """`bodies` with the continuous feedback in them, as `System.closed_loop` has it."""
        bodies = self.bodies.copy()
        gains, offset = self.laws[..., : Column.SET_POINT], self.laws[..., Column.SET_POINT]
        bodies[:, : OBJECT, Of.STIFFNESS] += gains[..., Column.POSITION_GAIN]
        bodies[:, : OBJECT, Of.DAMPING] += gains[..., Column.VELOCITY_GAIN]
        bodies[:, : OBJECT, Of.FORCE] += gains[..., Column.POSITION_GAIN] * offset + self.laws[..., Column.FEED_FORWARD]
        return bodies


class Variants:
    """Rows of a scene: changes of its numbers by "section.key", arrays (n,) of one length."""

    def __init__(self, scene: Scene, changes: Mapping[str, ArrayLike]) -> None:
        self.scene = scene
        self.changes = {str(name): given.column(f"changes: {name}", values)
                        for name, values in given.mapping("changes", changes).items()}
        self._parameters = {name: parameter_of(scene, name) for name in self.changes}
        lengths = {name: len(values) for name, values in self.changes.items()}
        if len(set(lengths.values())) > 1:
            raise Refused(f"changes: lengths {lengths} are not allowed; allowed: arrays (n,) of one length")
        self.rows = next(iter(lengths.values()), 1)

    def part(self, first: int, last: int) -> Variants:
        """Rows from the first to before the last one."""
        return Variants(self.scene, {name: column[first:last] for name, column in self.changes.items()})

    def row(self, i: int) -> Scene:
        """One row as a scene."""
        return self.scene.changed({name: float(column[i]) for name, column in self.changes.items()})

    @cached_property
    def is_plain(self) -> bool:
        """Whether all rows follow from arrays: changed are numbers of bodies, pairs and feedback that have a place."""
        return all(place_of(self.scene, name) for name in self.changes)

    def faults(self) -> dict[int, str]:
        """Sentences for the rows that the scene's rules refuse."""
        uncertain = np.full(self.rows, not self.is_plain)
        if self.is_plain:  # outside a range, with a negative sum of an arm's own number and its feedback's, or outside
            for name, column in self.changes.items():
                uncertain |= ~self._parameters[name].holds(column)
            block = self.block
            uncertain |= (block.closed_loop[:, : OBJECT, Of.STIFFNESS : Of.FORCE] < 0.0).any(axis=(1, 2))
            with np.errstate(all="ignore"):  # an uncertain row may hold any number
                rows = Systems(block.closed_loop, block.pairs, block.state[..., 0], self.scene.duration)
                uncertain |= outside_rows(rows)
        found = {}
        for i in np.flatnonzero(uncertain).tolist():
            try:
                self.row(i)
            except SceneError as error:
                found[i] = str(error)
        return found

    @cached_property
    def block(self) -> Block:
        """The rows as arrays, where `is_plain`."""
        system, n = self.scene.system, self.rows
        block = Block(*(np.repeat(array[None], n, axis=0) for array in (
            system.bodies, system.pairs, system.state[:, None], np.full((1, 1), system.coulomb), system.law_rows,
        )))
        for name, column in self.changes.items():
            array, row, place = PLACES[name]
            getattr(block, array)[:, row, place] = column
        return block

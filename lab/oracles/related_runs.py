"""Other scenes whose runs must be related to the first, to the bit: the mirror image, and other units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.simulation import Trajectory
from lab.cases.case import Product
from lab.oracles.metamorphic import SWAPPED, mirrored, scaled

UNITS = 4.0, 2.0, 0.5  # of length, time and mass
SHALLOW = 1e-85  # m or m/s: below, what a touch moves, like u^3.5, may be denormal, and in other units other numbers


def mirror(run: Trajectory, product: Product) -> Iterator[tuple[str, float]]:
    """States and events seen from the other side, to the bit; noise and sines have no mirror image."""
    scene = run.scene
    if any(section.endswith(("_sensor", "_sine")) for section in scene.values):
        return
    image = product.run(mirrored(scene), run.t[[0, -1]])
    own, other = run.event_table, image.event_table.copy()
    other[:, 1] = np.array([RIGHT, LEFT, OBJECT], dtype=float)[other[:, 1].astype(int)]
    same = _sorted(own) == _sorted(other) and _equal(run.state[-1], -image.state[-1][SWAPPED])
    yield "mirror", float(not same)


def units(run: Trajectory, product: Product, smallest: float) -> Iterator[tuple[str, float]]:
    """States and events in other units, O7, to the bit."""
    if smallest < SHALLOW:
        return
    length, time, mass = UNITS
    try:
        image = scaled(run.scene, length, time, mass)
    except Refused:  # a number leaves its range
        return
    other = product.run(image, time * run.t[[0, -1]])
    own = run.event_table * np.array([time, 1.0, 1.0, length, length / time])
    state = run.state[-1] * np.array([length, length / time] * 3)
    yield "scaling", float(not (_sorted(own) == _sorted(other.event_table) and _equal(state, other.state[-1])))


def _sorted(table: Array) -> list[list[float]]:
    """Rows of events in an order that does not depend on which side is looked at first."""
    return sorted(row.tolist() for row in table)


def _equal(one: Array, other: Array) -> bool:
    return bool(np.array_equal(np.nan_to_num(one), np.nan_to_num(other)))

"""What the paper could not show: a symmetric start is a knife-edge, from which the smallest offset leads away."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.paper.cases import SYMMETRIC, Cases, moved, started
from lab.paper.measures import measure

EVEN_CASES = (1, 2, 5, 7, 8)  # both arms equal: what the paper starts symmetrically, and Nos. 1 and 2 from there
SMALLEST = 1e-9  # m, the offset of x_l(0) whose growth is followed
VISIBLE = 1e-3  # m
MOVED = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  # m, offsets behind which settling times are compared
SECONDS = 60.0
POINTS = 12_001


class Edge(NamedTuple):
    """One case from the symmetric start, and from starts beside it."""

    case: int
    t: Array  # (n,), s
    apart: Array  # (n,), m: how far from symmetric, the larger of |x_l + x_r| and |x_o|, after SMALLEST
    rest: float  # m, the same without an offset: the largest
    visible: float  # s, when it first exceeds VISIBLE; infinite: not within SECONDS
    settling: tuple[float, ...]  # s, for each of MOVED

    @property
    def rate(self) -> float:
        """Mean rate of growth up to VISIBLE in 1/s; nan where it does not grow so far."""
        return float(np.log(VISIBLE / SMALLEST) / self.visible) if np.isfinite(self.visible) else float("nan")


def knife_edge(cases: Cases) -> list[Edge]:
    """All symmetric cases."""
    return [_edge(number, started(cases[number], SYMMETRIC)) for number in EVEN_CASES]


def _edge(number: int, scene: Scene) -> Edge:
    t: Array = np.linspace(0.0, SECONDS, POINTS)
    apart = _asymmetry(moved(scene, -SMALLEST), t)
    above = np.flatnonzero(apart > VISIBLE)
    return Edge(
        number,
        t,
        apart,
        float(_asymmetry(scene, t).max()),
        float(t[above[0]]) if len(above) else float("inf"),
        tuple(measure(moved(scene, -offset), "settling") for offset in MOVED),
    )


def _asymmetry(scene: Scene, t: Array) -> Array:
    state = simulate(scene.changed({"time.duration_s": SECONDS}), grid=t).state
    return np.asarray(np.maximum(np.abs(state[:, 0] + state[:, 4]), np.abs(state[:, 2])))

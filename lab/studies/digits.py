"""Every scene of the package beside the reference, and beside what one rounding of its numbers becomes.

How a rounding grows is measured with a larger change, in which roundings on the way do not count.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.tolerances import REST
from grasp_ros.physics.layout import EPS
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.cases.regression import DIGITS, nearby
from lab.reference import integrate
from lab.studies import pages
from lab.studies.records import write_csv

OUTPUTS = 40
DRAWS = 32  # of scenes whose numbers are smaller by PUSH, or not
PUSH = 2.0**-36
MOST = 3.0  # times what one rounding becomes
WORST = 5  # rows of the page beside the exceptions
HEADS = ("scene", "loop", "t, s", "error", "one rounding becomes", "ratio", "reason")
OUTPUT_TIME, AT_REST, UNKNOWN = "output time", "rest", "unknown"  # why a ratio is above MOST


class Row(NamedTuple):
    """One scene, at the output time with the largest ratio."""

    scene: str
    loop: str  # continuous or sampled
    t: float  # s
    error: float  # largest of positions in m and velocities in m/s
    grown: float  # one rounding of the numbers of the scene, until then, m or m/s
    ratio: float
    reasons: list[str]  # why ratios are above MOST

    @property
    def cells(self) -> list[str]:
        """As text."""
        return [self.scene, self.loop, f"{self.t:g}", f"{self.error:.1e}", f"{self.grown:.1e}", f"{self.ratio:.2g}",
                ", ".join(self.reasons) or "-"]


def run(docs: Path | None) -> int:
    """Print a row for each scene; with a directory of pages, write the page. Returns 1 if one is not explained."""
    rows = [measure(scenes.load(name)) for name in tqdm(sorted(scenes.names()), desc="digits", file=sys.stderr)]
    for row in rows:
        print(*row.cells, sep="  ")
    if docs is not None:
        write_csv(HEADS, (row.cells for row in rows), docs / "digits.csv")
        rows.sort(key=lambda row: -row.ratio)
        wrong, kept = ([row.cells for row in rows if (row.ratio > MOST) == over] for over in (True, False))
        pages.write(docs, "digits", heads=HEADS, wrong=wrong, kept=len(kept), worst=kept[:WORST], count=len(rows),
                    outputs=OUTPUTS, draws=DRAWS, most=MOST, digits=DIGITS, rest=round(np.log2(REST)),
                    reasons={reason for row in rows for reason in row.reasons})
    return int(any(UNKNOWN in row.reasons for row in rows))


def measure(scene: Scene) -> Row:
    """Compare a scene, as it is written, with the reference."""
    times = scene.time_of(np.arange(1, OUTPUTS + 1) * scene.ticks // OUTPUTS)
    found, right = _states(scene, times), integrate(scene, times.tolist(), DIGITS).state
    error = _largest(np.array([[float(a - b) for a, b in zip(exact, state, strict=True)]
                               for exact, state in zip(right, found.tolist(), strict=True)]))
    moved = [_largest(_states(near, times) - found) for near in nearby(scene, DRAWS, PUSH)]
    grown = np.maximum.accumulate(np.max(moved, axis=0)) * (EPS / PUSH)
    late = _largest(_states(scene, times * (1.0 - PUSH)) - found) * (EPS / PUSH)
    ratios, worst = error / grown, int((error / grown).argmax())
    reasons = {_reason(scene, float(times[k]), float(error[k] / (grown[k] + late[k])))
               for k in np.flatnonzero(ratios > MOST)}
    return Row(scene.name, "sampled" if scene.sampled else "continuous", float(times[worst]), float(error[worst]),
               float(grown[worst]), float(ratios[worst]), sorted(reasons))


def _reason(scene: Scene, t: float, ratio: float) -> str:
    """Why an error is large at a time, from its ratio to a rounding that is also one of that time."""
    if ratio <= MOST:
        return OUTPUT_TIME
    return UNKNOWN if simulate(scene.changed({"time.duration_s": t})).at_rest is None else AT_REST


def _largest(changes: Array) -> Array:
    """Of each state, (n,); what is absent counts as 0."""
    return np.asarray(np.abs(np.nan_to_num(changes)).max(axis=1))


def _states(scene: Scene, times: Array) -> Array:
    return simulate(scene, grid=times).state

"""Pixels of the maps of docs/maps.md beside scipy's DOP853, restarted at every touch and release."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from grasp_ros import ensemble, load, simulate
from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import Setup
from lab.cases.draw import relative
from lab.studies import maps

pytestmark = [pytest.mark.slow, pytest.mark.thorough]  # a minute of an integrator in Python

PIXELS = 20  # of each map
TOLERANCES = (1e-11, 1e-13)
SAMPLES = 2000  # of a second
NEAR = 1e-3  # of a settling time


def last_outside(scene: Scene, bound: float, until: float, tolerance: float) -> float:
    """The last time in s at which a mass is farther from 0 than a bound."""
    times = np.linspace(0.0, until, int(until * SAMPLES) + 1)
    state = simulate(scene.changed({"time.duration_s": np.ceil(until)}), grid=times, method="dop853_events",
                     setting=tolerance).state
    outside = np.flatnonzero((np.abs(state[:, ::2]) > bound).any(axis=1))
    return float(times[outside[-1]]) if len(outside) else 0.0


class Compared(NamedTuple):
    """Settling times of pixels drawn at random beside those of DOP853."""

    coarse: int  # the map's accuracy has another time than the finest, with which the others are compared
    equal: int
    unknown: int  # DOP853 says another time with another tolerance
    wrong: list[tuple[float, float]]  # ours and its own, in s


def compared(plan: Plan, settled: float, pixels: int = PIXELS) -> Compared:
    rows = np.random.default_rng(7).choice(plan.rows, pixels, replace=False)
    changes = {key: values[rows] for key, values in plan.variants(0, plan.rows).changes.items()}
    setups = plan.setup, plan.setup._replace(accuracy=ACCURACY)
    drawn, times = (ensemble(plan.scene, changes, ("settling_time",), setup=own).columns["settling_time"]
                    for own in setups)
    coarse = int(np.count_nonzero(~np.isclose(drawn, times, rtol=NEAR, atol=0.0)))
    equal, unknown, wrong = 0, 0, []
    for place in np.flatnonzero(np.isfinite(times)):
        ours, scene = float(times[place]), plan.scene.changed({key: float(own[place]) for key, own in changes.items()})
        bound, until = settled * float(np.abs(scene.initial_state[::2]).max()), ours + 2.0
        theirs = last_outside(scene, bound, until, TOLERANCES[0])
        finer = theirs if abs(theirs - ours) <= NEAR * ours else last_outside(scene, bound, until, TOLERANCES[1])
        if abs(finer - ours) <= NEAR * ours:
            equal += 1
        elif abs(finer - theirs) > NEAR * ours:
            unknown += 1
        else:
            wrong.append((ours, finer))
    return Compared(coarse, equal, unknown, wrong)


def test_settling_times_of_case_3() -> None:
    """Without dampers a motion forgets where it came from: what settles late is beyond what DOP853 knows."""
    scene = load("case_03", ["time.duration_s=10.0"])
    setup = Setup(("settling_time",), settled=maps.SETTLED, horizons=maps.HORIZONS)
    axes = Axis(maps.LOSSES, 0.02, 20.0, 40, True), Axis(maps.GAINS, -9.0, 60.0, 40)
    found = compared(Plan(scene, setup, axes), maps.SETTLED)
    assert not found.wrong
    assert not found.coarse
    assert found.equal > 0.5 * PIXELS > 2 * found.unknown


def test_settling_times_of_case_1_with_all_numbers_off() -> None:
    scene = load("case_01")
    setup = Setup(("settling_time",), maps.MAP_ACCURACY)
    found = compared(Plan(scene, setup, relative(scene, maps.OFF), 1024, 1), setup.settled)
    assert not found.wrong
    assert found.coarse <= 1
    assert found.equal >= PIXELS - 1  # DOP853 itself takes one for another, by a peak that grazes the bound

"""Pixels of the maps of docs/maps.md beside DOP853 on equations that are written here once more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from grasp_ros import ensemble, load
from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import Setup
from lab.cases.draw import relative
from lab.studies import maps

pytestmark = [pytest.mark.slow, pytest.mark.thorough]  # minutes of an integrator in Python

PIXELS = 20  # of each map
TOLERANCES = (1e-11, 1e-13)
SAMPLES = 2000  # of a second
NEAR = 1e-3  # of a settling time

Slope = Callable[[float, Array], Array]


def slope_of(values: Mapping[str, Mapping[str, float]], held: Sequence[float] | None = None) -> Slope:
    """The equations (1) to (8) of a scene, under continuous feedback or held commands."""
    arms, contacts, gains = ([values.get(f"{side}_{name}", {}) for side in ("left", "right")]
                             for name in ("arm", "contact", "feedback"))

    def slope(_: float, y: Array) -> Array:
        x_l, v_l, x_o, v_o, x_r, v_r = y.tolist()
        forces, found = [], []
        for u, d, contact in ((x_l - x_o, v_l - v_o, contacts[0]), (x_o - x_r, v_o - v_r, contacts[1])):
            loss = max(0.0, 1.0 + contact["dissipation_s_per_m"] * d)
            forces.append(contact["hertz_N_per_m1_5"] * max(u, 0.0) ** 1.5 * loss)
        for place, (arm, x, v) in enumerate(zip(arms, (x_l, x_r), (v_l, v_r), strict=True)):
            command = held[place] if held is not None else -gains[place].get("position_gain_N_per_m", 0.0) * x \
                - gains[place].get("velocity_gain_Ns_per_m", 0.0) * v
            own = command - arm["stiffness_N_per_m"] * x - arm["damping_Ns_per_m"] * v
            found.append((own + (forces[1] if place else -forces[0])) / arm["mass_kg"])
        return np.array([v_l, found[0], v_o, (forces[0] - forces[1]) / values["object"]["mass_kg"], v_r, found[1]])

    return slope


def last_outside(scene: Scene, bound: float, until: float, tolerance: float) -> float:
    """The last time in s at which a mass is farther from 0 than a bound."""
    times = np.linspace(0.0, until, int(until * SAMPLES) + 1)
    found = solve_ivp(slope_of(scene.values), (0.0, until), scene.initial_state, "DOP853", times, max_step=0.01,
                      rtol=tolerance, atol=1e-2 * tolerance)
    outside = np.flatnonzero((np.abs(found.y[::2]) > bound).any(axis=0))
    return float(times[outside[-1]]) if len(outside) else 0.0


class Compared(NamedTuple):
    """Settling times of pixels drawn at random beside those of DOP853."""

    equal: int
    unknown: int  # DOP853 says another time with another tolerance
    wrong: list[tuple[float, float]]  # ours and its own, in s


def compared(plan: Plan, settled: float, pixels: int = PIXELS) -> Compared:
    rows = np.random.default_rng(7).choice(plan.rows, pixels, replace=False)
    changes = {key: values[rows] for key, values in plan.variants(0, plan.rows).changes.items()}
    times = ensemble(plan.scene, changes, ("settling_time",), setup=plan.setup).columns["settling_time"]
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
    return Compared(equal, unknown, wrong)


def test_settling_times_of_case_3() -> None:
    """Without dampers a motion forgets where it came from: what settles late is beyond what DOP853 knows."""
    scene = load("case_03", ["time.duration_s=10.0"])
    setup = Setup(("settling_time",), settled=maps.SETTLED, horizons=maps.HORIZONS)
    axes = Axis(maps.LOSSES, 0.02, 20.0, 40, True), Axis(maps.GAINS, -9.0, 60.0, 40)
    found = compared(Plan(scene, setup, axes), maps.SETTLED)
    assert not found.wrong
    assert found.equal > 0.5 * PIXELS > 2 * found.unknown


def test_settling_times_of_case_1_with_all_numbers_off() -> None:
    scene = load("case_01")
    setup = Setup(("settling_time",), maps.MAP_ACCURACY)
    found = compared(Plan(scene, setup, relative(scene, maps.OFF), 1024, 1), setup.settled)
    assert not found.wrong
    assert found.equal >= PIXELS - 1  # DOP853 itself takes one for another, by a peak that grazes the bound


@pytest.mark.parametrize("delay", [0, 1])
def test_unstable_loops(delay: int) -> None:
    """Each control period by itself; near the limit a motion is chaotic, and goes a little beyond it or not."""
    scene = maps._sampled(load("case_01"), delay, {})
    rng = np.random.default_rng(7)
    steps, gains = rng.integers(10, 400, PIXELS) / 1000.0, rng.uniform(1.0, 60.0, PIXELS)
    ours = [bool(maps._unstable(scene, steps[k : k + 1], gains[k : k + 1])[0, 0]) for k in range(PIXELS)]
    theirs = [grows(scene, float(step), float(gain), delay) for step, gain in zip(steps, gains, strict=True)]
    assert np.equal(ours, theirs).mean() >= 0.9
    assert len({*ours}) == 2


def grows(scene: Scene, period: float, gain: float, delay: int) -> bool:
    """Whether a mass goes further than the map allows within its control periods."""
    state, most, largest = scene.initial_state, 0.0, float(np.abs(scene.initial_state[::2]).max())
    damping = [scene.values[f"{side}_feedback"]["velocity_gain_Ns_per_m"] for side in ("left", "right")]
    waiting = [[0.0, 0.0]] * delay
    for _ in range(maps.TICKS):
        waiting.append([-gain * state[0] - damping[0] * state[1], -gain * state[4] - damping[1] * state[5]])
        found = solve_ivp(slope_of(scene.values, waiting.pop(0)), (0.0, period), state, max_step=0.01,
                          method="DOP853", rtol=1e-9, atol=1e-12)
        state, most = found.y[:, -1], max(most, float(np.abs(found.y[::2]).max()))
        if most > maps.GROWN * largest:
            return True
    return False

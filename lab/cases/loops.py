"""The sampled loop near and past its stability limit: reported as it is, neither hidden nor repaired."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import energy_balance
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.scene import Scene
from lab.cases.case import Case, Product
from lab.cases.families import GROWTH, LIMIT, LOOP
from lab.cases.scenes import STANDARD, reference

HALF = 200  # control periods
GROWN = 1e5  # by which each half of a run may grow, or decay
LEAST = 1e-300  # J, against 0/0 where nothing moves


def _case_01(period: float, ticks: int, added: Mapping[str, Mapping[str, Any]]) -> Scene:
    time = {"duration_s": round(period * ticks, 9), "control_period_s": period}
    return scenes.compose("case_01", {**scenes.load("case_01").values, "time": time, **added})


def _work(scene: Scene, product: Product) -> float:
    """Largest positive residual of the energy balance of a control period, in units of what rounding may add."""
    run = product.run(scene, sampled=True)
    states = np.nan_to_num(run.state)
    book = energy_balance(scene.system, states[:-1], states[1:], run.inputs[:-1])
    return float((np.maximum(book.residual, 0.0) / np.maximum(book.rounding, LEAST)).max())


def _alone(period: float, delay: int, ticks: int) -> Scene:
    """An arm that meets nobody, in a sampled loop."""
    scene = scenes.load("arm_alone").changed({
        "time.control_period_s": period, "time.duration_s": round(ticks * period, 9), "left_feedback.set_point_m": 0.0,
    })
    return scenes.compose("alone", {**scene.values, "loop": {"delay_ticks": delay}})


def _growth(period: float, delay: int, product: Product) -> float:
    """Growth per period beside the spectral radius of the loop, relative; from the recurrence that the positions obey.

    It ends before the motion leaves the domain, or comes to rest.
    """
    radius = float(spectral_radius(STANDARD, period, delay))
    half = min(HALF, int(math.log(GROWN) / abs(math.log(radius))))
    x = product.run(_alone(period, delay, 2 * half)).state[1:, 0]
    windows = np.lib.stride_tricks.sliding_window_view(x, 3 + delay)
    windows = windows / np.abs(windows).max(axis=1, keepdims=True)
    recurrence = np.linalg.lstsq(windows[:, :-1], windows[:, -1], rcond=None)[0]
    grown = float(np.abs(np.roots(np.append(1.0, -recurrence[::-1]))).max())
    return abs(grown / radius - 1.0)


def _one_period(product: Product) -> float:
    """One control period of 3 s with many contacts in it, beside the reference."""
    scene = _case_01(3.0, 1, {"loop": {}})
    expected = reference(scene, [0.0, 3.0])
    run = product.run(scene)
    return float(np.abs(run.state[1] - expected[1]).max()) if len(run.events) >= 4 else np.inf


def cases() -> Iterator[Case]:
    """All sampled loops."""
    sine = {"amplitude_N": 50.0, "frequency_Hz": 3.0}
    limit = {"left_actuator": {"limit_N": 0.5}, "right_actuator": {"limit_N": 0.5}}
    noise = {f"{side}_sensor": {"noise_seed": 1, "position_noise_m": 1e-3, "velocity_noise_m_per_s": 1e-2,
                                "position_step_m": 1e-4} for side in ("left", "right")}
    for text, scene in (
        ("1 ms", _case_01(0.001, 5000, {})), ("0.27 s, just stable", _case_01(0.27, 400, {})),
        ("0.28 s, just unstable", _case_01(0.28, 400, {})), ("1 s, grows a thousand times", _case_01(1.0, 6, {})),
        ("10 ms, 5 periods late", _case_01(0.01, 2000, {"loop": {"delay_ticks": 5}})),
        ("20 ms, 20 periods late, unstable", _case_01(0.02, 1000, {"loop": {"delay_ticks": 20}})),
        ("unstable, but limited to 0.5 N", _case_01(0.02, 1000, {"loop": {"delay_ticks": 20}, **limit})),
        ("limited, noisy, in steps", _case_01(0.01, 2000, {"loop": {}, **limit, **noise})),
        ("a force of 50 N at 3 Hz", _case_01(0.001, 3000, {"object_sine": sine})),
    ):
        yield Case(LOOP, text, partial(_work, scene), 1.0, product_only=True)
    for period, delay in ((0.27, 0), (0.28, 0), (1.0, 0), (2.0, 0), (0.088, 1), (0.09, 1), (0.06, 3)):
        yield Case(GROWTH, f"h = {period:g} s, {delay} periods late", partial(_growth, period, delay), 5e-3,
                   product_only=True)
    yield Case(LIMIT, "a loop that grows beyond the domain",  # with a spectral radius of 3.6, and nobody stops it
               lambda product: float(len(product.run(_alone(1.0, 0, 4000)).t)), 0.0, limit=Status.OUTSIDE,
               product_only=True)
    yield Case(LOOP, "3 s in one control period", _one_period, 1e-12,
               "all contacts lie between two ticks; reference with 25 digits, all states", product_only=True)

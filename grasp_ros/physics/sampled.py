"""The sampled loop of a free arm: its transition matrix from tick to tick, and the spectral radius that decides.

With a command that is held over a period h, and computed from the state `delay` periods before, the state of a free
arm and its waiting commands goes from tick to tick by a constant matrix. The loop is stable where its spectral
radius is below 1 (K. J. Astrom, B. Wittenmark: Computer-Controlled Systems, section 3.2). Contacts are not in it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from grasp_ros.physics.model import Arm, Array


def transition(arm: Arm, period: float | Array, delay: int) -> Array:
    """Matrices (..., 2 + delay, 2 + delay) from tick to tick of (x, v, commands that wait), for periods (...) in s.

    The delay is in periods between a state and the command that answers it.
    """
    flow = held_flow(arm, period)
    gain = np.array([-arm.position_gain, -arm.velocity_gain])
    if delay == 0:
        return np.asarray(flow[..., :2] + flow[..., 2:] * gain)
    matrix = np.zeros((*np.shape(period), 2 + delay, 2 + delay))
    matrix[..., :2, :3] = flow  # the oldest command acts
    matrix[..., 2:-1, 3:] = np.eye(delay - 1)
    matrix[..., -1, :2] = gain
    return matrix


def held_flow(arm: Arm, period: float | Array) -> Array:
    """(x, v) after a period from x, v and a command that is held: arrays (..., 2, 3), by the roots of the arm."""
    m, k, c = arm.mass, arm.stiffness, arm.damping
    s = c / (2.0 * m)
    r = np.sqrt(complex(s * s - k / m))
    fast, slow = np.exp((-s - r) * period), np.exp((-s + r) * period)
    even = (0.5 * (slow + fast)).real
    odd = ((slow - fast) / (2.0 * r)).real if r != 0.0 else period * np.exp(-s * period)
    x_x = even + s * odd
    without_spring = (period - odd) / c if c > 0.0 else 0.5 * period**2 / m
    pushed = (1.0 - x_x) / k if k > 0.0 else without_spring
    columns = [[x_x, odd, pushed], [-k / m * odd, even - s * odd, odd / m]]
    return np.moveaxis(np.array(columns), (0, 1), (-2, -1))


def spectral_radius(arm: Arm, period: float | Array, delay: int) -> Any:
    """Factor per period by which the slowest motion decays or grows, for periods (...) in s."""
    return np.abs(np.linalg.eigvals(transition(arm, period, delay))).max(axis=-1)

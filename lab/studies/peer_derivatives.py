"""Derivatives of one impact by differentiable peers, beside the exact ones: a table of docs/derivatives.md.

Two free bodies, approach speed v, Hunt-Crossley: w = p v_o of the exit speed v_o obeys ln(1 - w) + w = ln(1 + z) - z,
z = p v, whatever H and the masses are. All begin at the touch. diffrax and torchdiffeq end at the release, by their own
events, and are differentiated by their own means; "variational" is what a user can do instead: the tangents are more
states, so that the error control sees them. MJX has no such law: it is given the force of each of its steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any, NamedTuple

import mpmath
import numpy as np

from grasp_ros.physics.errors import need
from grasp_ros.physics.model import Array
from grasp_ros.scene import compose
from grasp_ros.simulation import simulate
from grasp_ros.simulation.differentiate import differentiate
from lab.oracles.closed_forms import impact
from lab.studies import pages

PACKAGES = "diffrax", "jax", "mujoco", "optimistix", "torch", "torchdiffeq"  # the extra `peers`
LOSS, SPEED, HERTZ = NUMBERS = 0.3, 1.0, 1e4  # p in s/m, v in m/s, H in N/m^1.5
REDUCED = 0.5  # kg, of two bodies of 1 kg
SPAN = 0.07  # s; the impact takes 0.0626 s
TOLERANCES = tuple(10.0**-k for k in range(8, 15))
STEPS = (1e-3, 1e-4, 1e-5)  # s, of MJX
REPEATS, ENOUGH = 20, 2.0  # runs of which the fastest counts, and s after which no more are made
MOST_STEPS = 8192
FINEST = 1e-3  # atol by rtol: depths are small
Solve = Callable[[], tuple[float, Array]]  # exit speed, and its derivatives by p, v, H


class Row(NamedTuple):
    """A peer at one setting."""

    peer: str
    setting: str
    value: float  # relative error of the exit speed
    by: tuple[float, float, float]  # errors of the derivatives by p, v, H, each times p, v, H by the exit speed
    seconds: float


@cache
def exact() -> tuple[float, Array]:
    """Exit speed, and its derivatives by p, v, H."""
    p, v, e = mpmath.mpf(LOSS), mpmath.mpf(SPEED), impact(REDUCED, HERTZ, LOSS, SPEED).restitution
    slope = (1 - p * v * e) / (e * (1 + p * v))
    return float(e * v), np.array([float((slope - e) * v / p), float(slope), 0.0])


def run() -> list[Row]:
    """Of each peer, which must be installed, the setting with the smallest errors of derivatives."""
    need("this", *PACKAGES)
    peers: tuple[Callable[[], Iterator[Row]], ...] = (_ours, *_DIFFRAX, _torchdiffeq, _mjx)
    return [min(peer(), key=lambda row: max(row.by)) for peer in peers]


def report(rows: list[Row]) -> str:
    """The rows as a table of Markdown."""
    heads = ("", "setting", "exit speed", "by p", "by v", "by H", "time, ms")
    return pages.table(heads, (
        (row.peer, row.setting, *(f"{error:.0e}" for error in (row.value, *row.by)), f"{1e3 * row.seconds:.1f}")
        for row in rows))


def _measure(peer: str, setting: str, solve: Solve) -> Row:
    value, rates = solve()
    best, begin = float("inf"), time.perf_counter()
    for _ in range(REPEATS):
        start = time.perf_counter()
        solve()
        best = min(best, time.perf_counter() - start)
        if time.perf_counter() - begin > ENOUGH:
            break
    expected, slopes = exact()
    by_p, by_v, by_h = (np.abs(rates - slopes) * NUMBERS / expected).tolist()
    return Row(peer, setting, abs(value / expected - 1.0), (by_p, by_v, by_h), best)


def _ours() -> Iterator[Row]:
    scene = compose("impact", {
        "time": {"duration_s": SPAN, "control_period_s": 0.001},
        "left_arm": {"mass_kg": 1.0, "position_m": 0.0, "velocity_m_per_s": SPEED},
        "object": {"mass_kg": 1.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
        "left_contact": {"hertz_N_per_m1_5": HERTZ, "dissipation_s_per_m": LOSS},
    })
    keys = ["left_contact.dissipation_s_per_m", "left_arm.velocity_m_per_s", "left_contact.hertz_N_per_m1_5"]

    def solve() -> tuple[float, Array]:
        found = differentiate(simulate(scene, grid=np.array([SPAN])), keys)
        return found.state[-1, 3] - found.state[-1, 1], found.state_rates[-1, 3] - found.state_rates[-1, 1]

    yield _measure("exact", "default", solve)


def _field(u: Any, d: Any, q: Any, where: Any, sqrt: Any) -> Any:
    """The acceleration of u, as a peer's `where` and `sqrt` compute it; the root of 0 has no derivative."""
    p, _, hertzian = q
    root = where(u > 0.0, sqrt(where(u > 0.0, u, 1.0 + 0.0 * u)), 0.0 * u)
    return -hertzian * u * root * (1.0 + p * d) / REDUCED


def _jax_field(t: Any, y: Any, q: Any) -> Any:
    import jax.numpy as jnp

    return jnp.stack([y[1], _field(y[0], y[1], q, jnp.where, jnp.sqrt)])


def _variational_field(t: Any, y: Any, q: Any) -> Any:
    """Of u, u', and their derivatives (2, 3)."""
    import jax
    import jax.numpy as jnp

    rate, by = _jax_field(t, y[0], q), jax.jacfwd(partial(_jax_field, t), argnums=(0, 1))(y[0], q)
    return jnp.concatenate([rate[None], (by[0] @ y[1:].T + by[1]).T])


def _diffrax(solver: str, variational: bool) -> Iterator[Row]:
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    jax.config.update("jax_enable_x64", True)
    q = jnp.array(NUMBERS)
    release = diffrax.Event(lambda t, y, args, **_: y.ravel()[0], optimistix.Newton(1e-13, 1e-15), direction=False)

    def end(start: Any, q: Any, tolerance: float) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(_variational_field if variational else _jax_field), getattr(diffrax, solver)(), 0.0, 1.0,
            None, start, q, max_steps=MOST_STEPS, event=release, adjoint=diffrax.ForwardMode(),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=FINEST * tolerance)).ys[-1]

    def exit_speed(q: Any, tolerance: float) -> Any:
        return -end(jnp.stack([0.0 * q[1], q[1]]), q, tolerance)[1]

    def both(q: Any, tolerance: float) -> Any:
        if variational:  # the force is 0 at the release: its time moves nothing
            start = jnp.array([[0.0, SPEED], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
            last = end(start, q, tolerance)
            return -last[0, 1], -last[1:, 1]
        return exit_speed(q, tolerance), jax.jacfwd(exit_speed)(q, tolerance)

    compiled = jax.jit(both)

    def solve(tolerance: float) -> tuple[float, Array]:
        value, rates = compiled(q, tolerance)
        return float(value), np.asarray(rates)

    for tolerance in TOLERANCES:
        name = f"diffrax, {solver}{', variational' if variational else ''}"
        yield _measure(name, f"rtol {tolerance:.0e}", partial(solve, tolerance))


_DIFFRAX = tuple(partial(_diffrax, *kind) for kind in (("Tsit5", False), ("Dopri8", False), ("Dopri8", True)))


def _torchdiffeq() -> Iterator[Row]:
    import torch
    from torchdiffeq import odeint, odeint_event

    torch.set_num_threads(1)  # of two numbers: a second thread would only wait

    def solve(tolerance: float) -> tuple[float, Array]:
        q = torch.tensor(NUMBERS, dtype=torch.float64, requires_grad=True)

        def rates(t: Any, y: Any) -> Any:
            return torch.stack([y[1], _field(y[0], y[1], q, torch.where, torch.sqrt)])

        def depth(t: Any, y: Any) -> Any:
            return torch.where(y[1] > 0.0, torch.ones_like(y[0]), y[0])  # it begins at 0

        _, path = odeint_event(
            rates, torch.stack([0.0 * q[1], q[1]]), torch.tensor(0.0, dtype=torch.float64), event_fn=depth,
            rtol=tolerance, atol=FINEST * tolerance, method="dopri8", odeint_interface=odeint)
        speed = -path[-1][1]
        (slopes,) = torch.autograd.grad(speed, q)
        return float(speed.detach()), slopes.numpy()

    for tolerance in TOLERANCES[::2]:
        yield _measure("torchdiffeq, dopri8", f"rtol {tolerance:.0e}", partial(solve, tolerance))


def _mjx() -> Iterator[Row]:
    import jax
    import jax.numpy as jnp
    import mujoco
    from mujoco import mjx

    jax.config.update("jax_enable_x64", True)
    body = '<body><joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    for step in STEPS:
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>{2 * body}</worldbody></mujoco>')
        device = mjx.put_model(model)
        start = mjx.make_data(model)

        def exit_speed(q: Any, device: Any = device, start: Any = start, steps: int = round(SPAN / step)) -> Any:
            def advance(_: int, data: Any) -> Any:
                u, d = data.qpos[0] - data.qpos[1], data.qvel[0] - data.qvel[1]
                push = REDUCED * _field(u, d, q, jnp.where, jnp.sqrt)
                return mjx.step(device, data.replace(qfrc_applied=jnp.stack([push, -push])))

            first = start.replace(qvel=jnp.stack([q[1], 0.0 * q[1]]))
            last = jax.lax.fori_loop(0, steps, advance, first)
            return last.qvel[1] - last.qvel[0]

        compiled = jax.jit(lambda q, speed=exit_speed: (speed(q), jax.jacfwd(speed)(q)))

        def solve(compiled: Any = compiled) -> tuple[float, Array]:
            value, rates = compiled(jnp.array(NUMBERS))
            return float(value), np.asarray(rates)

        yield _measure("MJX", f"step {step:.0e} s", solve)

"""Where the paper's V jumps up while V_c falls, from which p on, and the limits of the control period."""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.layout import Law, Transition
from grasp_ros.physics.model import Arm, Array, Contact
from grasp_ros.physics.system import NAMES, System
from grasp_ros.simulation import simulate
from lab.reference.grasp import Grasp, system_of
from lab.studies.loop import first_limit

SCENES = ("v_jump_symmetric", "v_jump_one_sided", "v_jump_smallest_p")
STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
HORIZON = 20.0  # s
AMPLITUDE = 1.0  # m, the axes of the paper's figures
DRAWS, STEPS, SEED = 8000, 4000, 1
SMALLEST_P, LARGEST_P = 0.3, 10.0


class Jump(NamedTuple):
    """The paper's V rises from one instant to the next because a clamped pair comes back."""

    time: float  # s
    side: int
    u: float  # m
    height: float  # J of V


class Family(NamedTuple):
    """A set of starts at rest with the arms of Table 1: a box of numbers in which the smallest p is looked for."""

    text: str
    low: tuple[float, ...]  # -x_l, x_r in m, position of the object between the arms in [0, 1], log10 m_o, log10 H
    high: tuple[float, ...]
    part: float  # least height of a jump that counts, in V(0)

    def start(self, point: Array) -> tuple[Array, float, float]:
        """State, object's mass and H of a point of the box; NaN for the object's position means x_o = 0."""
        x_l, x_r, between, mass, hertzian = point
        x_o = 0.0 if math.isnan(between) else -x_l + between * (x_l + x_r)
        return np.array([-x_l, 0.0, x_o, 0.0, x_r, 0.0]), 10.0**mass, 10.0**hertzian


def families() -> list[Family]:
    """Table 1 itself, with the object anywhere, and with any object and contact; each for two heights."""
    small = 0.01 * AMPLITUDE
    table = math.log10(5.0), 4.0
    boxes = (
        ("Table 1 with any x_l, x_r and x_o = 0", (small, small, math.nan, *table), (1.0, 1.0, math.nan, *table)),
        ("Table 1 with any x_l, x_r, the object between", (small, small, 0.0, *table), (1.0, 1.0, 1.0, *table)),
        ("and any m_o from 0.01 to 1000 kg, H from 1e2 to 1e7", (small, small, 0.0, -2.0, 2.0),
         (1.0, 1.0, 1.0, 3.0, 7.0)),
    )
    return [Family(text, low, high, part) for text, low, high in boxes for part in (1e-2, 1e-6)]


def jumps(system: System, duration: float) -> list[Jump]:
    """All jumps of the paper's V in a run with continuous feedback, from the events alone: (4/5) H u^(5/2) each."""
    integrator = Integrator(system, continuous=True)
    integrator.advance(duration)
    if integrator.status is not Status.DONE:
        raise RuntimeError(integrator.status.value)
    return [
        Jump(event.time, event.side, event.u, 0.8 * float(system.pairs[event.side, Law.HERTZIAN]) * event.u**2.5)
        for event in integrator.events
        if event.kind is Transition.REENTRY
    ]


def safe_p(grasp: Grasp, start: Array) -> float:
    """Theorem 2: below this p no pair can part as fast as 1/p, in s/m."""
    level = sum(
        (arm.stiffness + arm.position_gain) * start[column] ** 2 + arm.mass * start[column + 1] ** 2
        for arm, column in ((grasp.left, 0), (grasp.right, 4))
    ) + grasp.object_mass * start[3] ** 2
    reduced = min(arm.mass * grasp.object_mass / (arm.mass + grasp.object_mass) for arm in (grasp.left, grasp.right))
    return math.sqrt(reduced / level)


def table_one(p: float, object_mass: float, hertzian: float) -> Grasp:
    """The arms and gains of Table 1."""
    return Grasp(STANDARD, STANDARD, Contact(hertzian, p), Contact(hertzian, p), object_mass)


class Found(NamedTuple):
    """The smallest p that a search has found, and where."""

    p: float  # s/m
    point: Array
    jump: Jump


def highest_jump(family: Family, point: Array, p: float) -> Jump | None:
    """The highest jump of a start of the family, if it counts."""
    start, mass, hertzian = family.start(point)
    found = jumps(system_of(table_one(p, mass, hertzian), start), HORIZON)
    level = 15.0 * (start[0] ** 2 + start[4] ** 2)  # V(0) at rest
    best = max(found, key=lambda jump: jump.height, default=None)
    return best if best is not None and best.height >= family.part * level else None


def search(family: Family, draws: int, steps: int, seed: int) -> Found:
    """Random starts, then random steps around the best one that only accept a smaller p.

    It proves that a jump exists at the p that it returns. That none exists below is proved only up to `safe_p`.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array(family.low), np.array(family.high)
    best: Found | None = None
    for _ in tqdm(range(draws), desc="draws", file=sys.stderr, leave=False):
        point = low + rng.random(5) * (high - low)
        p = float(np.exp(rng.uniform(math.log(SMALLEST_P), math.log(LARGEST_P))))
        if (best is None or p < best.p) and (jump := highest_jump(family, point, p)):
            best = Found(p, point, jump)
    if best is None:
        raise ValueError(f"{family.text}: no jump found in {draws} draws")
    width = 0.3
    for _ in tqdm(range(steps), desc="steps", file=sys.stderr, leave=False):
        point = np.minimum(np.maximum(best.point + width * rng.standard_normal(5) * (high - low), low), high)
        p = best.p * (1.0 - 0.2 * width * float(rng.random()))
        jump = highest_jump(family, point, p)
        if jump is not None:
            best = Found(p, point, jump)
        width = max(0.995 * width, 1e-7) if jump is None else min(1.3 * width, 0.5)
    return best


def numbers() -> dict[str, object]:
    """What docs/jumps.md needs: jumps, the smallest p that have one, and limits of the control period."""
    return {"jumps": jump_rows(), "limits": limit_rows(), "smallest": smallest_rows(DRAWS, STEPS),
            "amplitude": AMPLITUDE, "horizon": HORIZON, "draws": DRAWS, "steps": STEPS, "seed": SEED}


def limit_rows() -> list[list[str]]:
    """The first limits of the arm of Table 1, as far as every LAPACK agrees."""
    rows = []
    for position_gain, velocity_gain in ((5.0, 0.5), (5.0, 0.0), (50.0, 5.0)):
        arm = STANDARD._replace(position_gain=position_gain, velocity_gain=velocity_gain)
        for delay in (0, 1, 2):
            rows.append([f"{position_gain:g}", f"{velocity_gain:g}", str(delay), f"{first_limit(arm, delay):.9g}"])
    return rows


def jump_rows() -> list[list[str]]:
    """All jumps of the scenes that show them."""
    rows = []
    for name in SCENES:
        scene = scenes.load(name)
        for jump in jumps(scene.system, scene.duration):
            level = float(simulate(scene, grid=np.array([jump.time])).energy.V_c[0])
            rows.append([f"`{name}`", f"{jump.time:.6f}", NAMES[jump.side], f"{1e3 * jump.u:.4f}", f"{jump.height:.6f}",
                         f"{level:.6f}"])
    return rows


def smallest_rows(draws: int, steps: int) -> list[list[str]]:
    """The smallest p that was found in each family."""
    rows = []
    for family in families():
        p, point, jump = search(family, draws, steps, SEED)
        start, mass, hertzian = family.start(point)
        widest = np.array([-AMPLITUDE, 0.0, 0.0, 0.0, AMPLITUDE, 0.0])
        safe = safe_p(table_one(p, 10.0 ** family.low[3], hertzian), widest)
        rows.append([family.text, f"{family.part:g}", f"{p:.4f}", ", ".join(f"{x:.5f}" for x in start[0::2]),
                     f"{mass:.4g}", f"{hertzian:.4g}", f"{jump.time:.4f}", f"{safe:.4f}"])
    return rows

"""What must hold for every scene there is."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.layout import DAMPING, DISSIPATION, FORCE, LEFT, OBJECT, RIGHT, Transition, Work
from grasp_ros.physics.model import Array, Contact, impact_force, penetration
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import PAPER, Scene
from grasp_ros.simulation import Trajectory
from grasp_ros.verification.cases.case import Product
from grasp_ros.verification.cases.loops import residual
from grasp_ros.verification.cases.scenes import reference
from grasp_ros.verification.deadline import Deadline, deadline
from grasp_ros.verification.oracles import balance
from grasp_ros.verification.relations import FLIP, SWAPPED, mirrored, scaled, started

POINTS = 201
MOST_EVENTS = 2000
RISE = 1e-12  # of the largest V_c so far: what rounding may add
BALANCED = 1e-12, 1e-10  # momentum and energy at the default accuracy
MOST_WORK = 300_000  # a squeezed contact relaxes p H u^(3/2) t / m times, and each time takes a few steps
FINEST = 128  # parts between two events
SPLIT = 1e-13  # per event
WORK_STEPS = 20_000  # contact steps beyond which the slow properties are left out
REFERENCE_STEPS = 100  # those beyond which the reference, which counts in 25 digits, takes too long
REFERENCE_SECONDS = 3.0
UNDERFLOW = 1e-200  # what has died out so far loses digits, in other units others


class Check(NamedTuple):
    """What became of a property."""

    name: str
    error: float
    bound: float

    @property
    def holds(self) -> bool:
        """Whether the error is within its bound; False for NaN."""
        return self.error <= self.bound


def checks(scene: Scene, compare: bool = False) -> list[Check]:
    """All properties that can be checked for a scene.

    Parameters
    ----------
    scene : Scene
    compare : bool
        Also compare it with the reference, if that takes no longer than some seconds.

    Raises
    ------
    Unfinished
        If the run ends with another status than DONE: that is an answer, not a failure.
    """
    product = _product()
    if scene.sampled:
        run = product.run(scene, sampled=True)
        return [*_states(run), Check("work", residual(run), 1.0)]
    run = product.run(scene, np.linspace(0.0, scene.duration, POINTS))
    found = [*_states(run), *_certificate(run)]
    if run.work[Work.CONTACT_STEPS] < WORK_STEPS:
        found += _relations(scene, run)
    if scene.values.keys() != PAPER or _pushed(scene):
        return found
    growth = cache(partial(sensitivity, scene, run))  # two more runs, for up to three properties
    if run.work[Work.CONTACT_STEPS] < WORK_STEPS:
        found += [*_splitting(scene, run, growth), *_backwards(scene, run, growth), *_balances(scene, run)]
    if compare and run.work[Work.CONTACT_STEPS] < REFERENCE_STEPS:
        found += _reference(scene, run, growth)
    return found


def _pushed(scene: Scene) -> bool:
    """Whether constant or external forces act."""
    return bool(scene.system.external) or bool(scene.system.closed_loop[:, FORCE].any())


def _product() -> Product:
    return Product(MOST_EVENTS, MOST_WORK)


def _states(run: Trajectory) -> list[Check]:
    """Finite, all there, forces never negative, events in order and alternating."""
    system = run.scene.system
    u_l, d_l, u_r, d_r = penetration(run.state)
    motion: dict[int, tuple[Array, Array]] = {LEFT: (u_l, d_l), RIGHT: (u_r, d_r)}
    forces = [impact_force(Contact(*system.pairs[side]), *motion[side]) for side in system.contacts]
    there = [COLUMN[body] + k for body in system.present for k in (0, 1)]
    broken = 0
    for side in (LEFT, RIGHT, OBJECT):
        kinds = [event.kind for event in run.events if event.side == side]
        broken += sum(not _may_follow(before, after) for before, after in pairwise(kinds))
    times = run.event_table[:, 0]
    return [
        Check("finite", float(np.count_nonzero(~np.isfinite(run.state[:, there]))), 0.0),
        Check("impact force", float(max((-force.min() for force in forces), default=0.0)), 0.0),
        Check("order of events", float(np.count_nonzero(np.diff(times) < 0.0) + broken), 0.0),
    ]


def _may_follow(before: Transition, after: Transition) -> bool:
    """Whether one pair can change like this."""
    allowed = {
        Transition.TOUCH: (Transition.RELEASE, Transition.CLAMP),
        Transition.REENTRY: (Transition.RELEASE, Transition.CLAMP),
        Transition.CLAMP: (Transition.REENTRY, Transition.RELEASE), Transition.RELEASE: (Transition.TOUCH,),
        Transition.STICK: (Transition.SLIP,), Transition.SLIP: (Transition.STICK,),
    }
    return after in allowed[before]


def _certificate(run: Trajectory) -> list[Check]:
    """V_c never rises; where constant forces shift its zero, or external ones work, the integrator checks."""
    if _pushed(run.scene):
        return []
    V_c = run.energy.V_c
    size = np.maximum.accumulate(V_c)[:-1]
    rise = np.diff(V_c) / np.where(size > 0.0, size, 1.0)
    return [Check("V_c", float(rise.max()), RISE)]


def sensitivity(scene: Scene, run: Trajectory) -> float:
    """How much a change of the start by 1e-10 of its size has become at the end, at least 1."""
    state = scene.initial_state
    size = _sizes(run.state)
    product = _product()
    worst = 1.0
    for sign in (1.0, -1.0):
        moved = started(scene, state + sign * 1e-10 * size * np.array([1.0, -0.7, 0.4, 0.9, -1.0, 0.6]))
        end = product.states(moved, [scene.duration])[0]
        worst = max(worst, float((np.abs(end - run.state[-1]) / size).max() / 1e-10))
    return worst


def _sizes(states: Array) -> Array:
    """Scale of each column: the largest position and the largest speed."""
    place, speed = np.abs(states[:, ::2]).max(), np.abs(states[:, 1::2]).max()
    return np.array([place or 1.0, speed or 1.0] * 3)


def _relations(scene: Scene, run: Trajectory) -> list[Check]:
    """Mirror and units, bit for bit."""
    product = _product()
    end = [scene.duration]
    last = np.nan_to_num(run.state[-1])
    image = np.nan_to_num(product.states(mirrored(scene), end)[0])
    units = np.nan_to_num(product.states(scaled(scene, 4.0, 2.0, 0.5), [2.0 * scene.duration])[0])
    found = [Check("mirror", float(np.abs(last + image[SWAPPED]).max()), 0.0)]
    moving = np.abs(run.state[run.state != 0.0])
    if not moving.min(initial=np.inf) < UNDERFLOW:
        found.append(Check("units", float(np.abs(last * np.array([4.0, 2.0] * 3) - units).max()), 0.0))
    return found


def _divergence(run: Trajectory) -> float:
    """What rounding at every event may come to before the scene amplifies it."""
    return SPLIT * (1 + len(run.event_table))


def _splitting(scene: Scene, run: Trajectory, growth: Callable[[], float]) -> list[Check]:
    """Two horizons like one, as far as neither the start nor the middle is forgotten."""
    half = round(scene.duration / 2.0, 9)
    if not 1e-8 < half < 500.0:
        return []
    product = _product()
    first, rest = (scene.changed({"time.duration_s": part, "time.control_period_s": part})
                   for part in (half, round(scene.duration - half, 9)))
    rest = started(rest, product.states(first, [half])[0])
    again = product.run(rest, [rest.duration])
    error = float((np.abs(again.state[-1] - run.state[-1]) / _sizes(run.state)).max())
    return [Check("splitting", error, _divergence(run) * max(growth(), sensitivity(rest, again)))]


def _backwards(scene: Scene, run: Trajectory, growth: Callable[[], float]) -> list[Check]:
    """A motion without losses, run backwards, ends where it began."""
    bodies, pairs = scene.system.closed_loop, scene.system.pairs
    if bodies[:, DAMPING].any() or pairs[:, DISSIPATION].any():
        return []
    back = started(scene, run.state[-1] * FLIP)
    way = _product().run(back, [back.duration])
    error = float((np.abs(way.state[-1] * FLIP - scene.initial_state) / _sizes(run.state)).max())
    return [Check("time reversal", error, _divergence(run) * max(growth(), sensitivity(back, way)))]


def _reference(scene: Scene, run: Trajectory, growth: Callable[[], float]) -> list[Check]:
    """The end by another method, in 25 digits."""
    try:
        with deadline(REFERENCE_SECONDS):
            expected = reference(scene, [0.0, scene.duration])[-1]
    except (Deadline, RuntimeError):
        return []
    error = float((np.abs(run.state[-1] - expected) / _sizes(run.state)).max())
    return [Check("reference", error, _divergence(run) * growth())]


def _balances(scene: Scene, run: Trajectory) -> list[Check]:
    """Momentum and energy, where the quadrature between the events converges: that of fast swings does not."""
    times = run.event_table[:, 0].tolist()
    before: Array | None = None
    for parts in (8, 32, FINEST):
        if len(times) * parts > 10_000:
            return []
        product = _product()
        book = balance(scene.system, scene.duration, times, partial(product.states, scene), parts)
        now = np.array([np.abs(book.momentum).max(), np.abs(book.energy).max()])
        agreed = before is not None and bool((np.abs(now - before) <= 0.1 * np.array(BALANCED)).all())
        if (now <= BALANCED).all() or (parts == FINEST and agreed):
            return [Check("momentum", float(now[0]), BALANCED[0]), Check("energy", float(now[1]), BALANCED[1])]
        before = now
    return []

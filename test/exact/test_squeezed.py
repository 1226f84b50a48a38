"""Squeezed contacts with large dissipation: implicit steps against references, their cost, and what they must keep."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from mpmath import mp, mpf

from grasp_ros.exact import integrator
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.radau import DERIVATIVE, INTEGRAL, NODES, STAGES, TO_LEGENDRE, TO_POWERS
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Filled, Outcome, Transition, Work
from grasp_ros.physics.model import Arm, Array, Contact, Grasp
from grasp_ros.physics.system import System
from grasp_ros.verification.reference import integrate

LENGTH, TIME, WEIGHT = 16.0, 4.0, 8.0  # units of another system: powers of 4, 2 and 2


class Squeeze(NamedTuple):
    """Two arms that push an object between them, in the order left, object, right."""

    p: tuple[float, float] = (1e6, 1e6)
    hertzian: float = 1e6
    force: tuple[float, float, float] = (5.0, 0.3, -4.0)
    x: tuple[float, float, float] = (-0.03, 0.02, 0.06)
    v: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass: tuple[float, float, float] = (1.0, 0.5, 2.0)
    stiffness: tuple[float, float] = (15.0, 10.0)
    coulomb: float = 0.0
    damping: float = 0.7

    @property
    def grasp(self) -> Grasp:
        """The grasp without its forces."""
        arms = [Arm(self.mass[i], k, self.damping, 0.0, 0.0) for i, k in zip((0, 2), self.stiffness, strict=True)]
        contacts = [Contact(self.hertzian, p) for p in self.p]
        return Grasp(arms[0], arms[1], contacts[0], contacts[1], self.mass[1])

    @property
    def state(self) -> Array:
        """State at the begin."""
        return np.array([self.x, self.v]).T.ravel()

    def mirrored(self) -> Squeeze:
        """Left and right exchanged."""
        force, x, v = (tuple(-number for number in reversed(row)) for row in (self.force, self.x, self.v))
        p, mass, stiffness = self.p[::-1], self.mass[::-1], self.stiffness[::-1]
        return self._replace(p=p, force=force, x=x, v=v, mass=mass, stiffness=stiffness)

    def start(self, unit: bool = False, **options: Any) -> Integrator:
        """An integrator; `unit`: in another system of units."""
        length, time, weight = (LENGTH, TIME, WEIGHT) if unit else (1.0, 1.0, 1.0)
        system = System.of(self.grasp, self.state * np.tile([length, length / time], 3))
        system.bodies[:, 0] *= weight
        system.bodies[:, 1] *= weight / time**2
        system.bodies[:, 2] *= weight / time
        system.pairs *= np.array([weight / (time**2 * np.sqrt(length)), time / length])
        system.coulomb = self.coulomb * weight * length / time**2
        result = Integrator(system, continuous=True, **options)
        force = np.array([self.force[0], self.force[2], self.force[1]])
        result.set_input(force * weight * length / time**2)
        return result


def kinds(result: Integrator) -> list[tuple[Body, Transition]]:
    """What happened, in order."""
    return [(event.side, event.kind) for event in result.events]


def taylor(scene: Squeeze, seconds: float, grid: Array, monkeypatch: pytest.MonkeyPatch) -> tuple[Integrator, Array]:
    """A run by Taylor steps alone."""

    def refuse(*arguments: Any) -> Outcome:
        arguments[-2][Filled.WAIT] = 2**40
        return Outcome.GO_ON

    result = scene.start()
    with monkeypatch.context() as patch:
        patch.setattr(integrator, "creep", refuse)
        return result, result.advance(seconds, grid)


def creeping_time(scene: Squeeze, u: float) -> float:
    """How long a symmetric squeeze without springs and dampers takes to a depth u.

    p is so large that inertia is nothing: H u^1.5 (1 + p u') = f, so dt = p H u^1.5 du / (f - H u^1.5).
    """
    h, f = mpf(scene.hertzian), mpf(scene.force[0])
    return float(scene.p[0] * mp.quad(lambda x: h * x**1.5 / (f - h * x**1.5), [scene.x[0] - scene.x[1], u]))


def test_tables_integrate_and_derive_polynomials() -> None:
    for power in range(int(STAGES)):
        assert INTEGRAL @ NODES**power == pytest.approx(NODES ** (power + 1) / (power + 1), rel=0, abs=2e-16)
    assert np.abs(DERIVATIVE @ INTEGRAL - np.eye(int(STAGES))).max() < 1e-13
    assert TO_POWERS.sum(axis=0) == pytest.approx(1.0)  # P_k(1) = 1
    assert (TO_LEGENDRE @ NODES)[:3] == pytest.approx([0.5, 0.5, 0.0], abs=1e-15)


@pytest.mark.parametrize("p", [1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e10])
@pytest.mark.parametrize("scene", [
    Squeeze(), Squeeze(force=(5.0, 0.0, -5.0), v=(1.0, 0.7, 0.0)), Squeeze(x=(0.02, 0.02, 0.06)),
    Squeeze(force=(5.0, 0.0, 0.0)),
], ids=["both", "fast", "touching", "one side"])
def test_cost_does_not_grow_with_the_dissipation(scene: Squeeze, p: float) -> None:
    result = scene._replace(p=(p, p / 3)).start()
    result.advance(3.0)
    assert result.status is Status.DONE
    assert result.work[Work.CONTACT_STEPS] + result.work[Work.REJECTED_STEPS] < 1200


@pytest.mark.parametrize("p", [1e10, 1e11, 1e12])
def test_quasi_static_creep_against_a_quadrature(p: float) -> None:
    begin, force, hertzian, seconds = 1e-6, 5.0, 1e8, 1e-6 * p
    rate = (force / (hertzian * begin**1.5) - 1.0) / p
    scene = Squeeze((p, p), hertzian, (force, 0.0, -force), (begin, 0.0, -begin), (rate, 0.0, -rate), (1.0, 0.5, 1.0),
                    (0.0, 0.0), damping=0.0)
    result = scene.start()
    result.advance(seconds)
    u, u_r = result.penetration
    assert u == u_r
    error = (creeping_time(scene, u) - seconds) * (force / (hertzian * u**1.5) - 1.0) / p
    assert abs(error) < 1e-12 * u
    assert result.work[Work.CONTACT_STEPS] < 200


MIXED = {
    "both": Squeeze((3e3, 1e3)),
    "one side": Squeeze((3e3, 1e3), force=(5.0, 0.0, 0.0), x=(-0.1, 0.0, 0.3)),
    "beside an ordinary contact": Squeeze((3e3, 0.5), 1e5, (3.0, 0.0, -3.0), (-0.1, 0.0, 0.3)),
    "clamped": Squeeze((3e3, 1e3), force=(-1.0, 0.0, -5.0), x=(-0.01, 0.0, 0.3), v=(1.0, 0.0, -3.0)),
    "light object": Squeeze((3.0, 2.0), 1e6, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (47.0, 3e-3, 450.0),
                            (0.0, 0.0), damping=0.0),
    "friction": Squeeze((1e3, 1e3), force=(5.0, 0.0, -2.0), x=(-0.1, 0.0, 0.3), coulomb=2.0),
}


@pytest.mark.parametrize("name", MIXED)
def test_states_and_events_against_taylor_steps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, grid = MIXED[name], np.linspace(0.0, 2.0, 33)
    result = scene.start()
    states = result.advance(2.0, grid)
    other, expected = taylor(scene, 2.0, grid, monkeypatch)
    assert result.work[Work.CONTACT_STEPS] < 0.6 * other.work[Work.CONTACT_STEPS]
    assert np.abs(states - expected).max() < 1e-13
    assert kinds(result) == kinds(other)
    assert result.event_table[:, 0] == pytest.approx(other.event_table[:, 0], rel=0, abs=1e-12)


def test_a_slow_touch_beside_a_deep_pair_keeps_its_energy() -> None:
    """An implicit step must not begin at a touch: the energy of an arm that hits what friction holds is known."""
    speed, hertzian = 1e-8, 1e7
    scene = Squeeze((0.0, 10.0), hertzian, (0.0, 0.0, -1e4), (-speed * 0.01, 0.0, -0.01), (speed, 0.0, 0.0),
                    (1.0, 1.0, 1.0), (0.0, 0.0), coulomb=1e6, damping=0.0)
    result = scene.start()
    states = result.advance(0.03, np.linspace(0.015, 0.03, 4))
    depth = states[:, 0] - states[:, 2]
    assert (depth > 0.0).all()
    level = 0.5 * states[:, 1] ** 2 + 0.4 * hertzian * depth**2.5
    assert np.abs(level / (0.5 * speed**2) - 1.0).max() < 1e-13


def test_a_light_object_that_swings_no_more_costs_few_steps() -> None:
    """Taylor steps follow its swing between two heavy arms for thousands of steps after it has died out."""
    result = MIXED["light object"]._replace(mass=(47.0, 1e-4, 450.0)).start()
    result.advance(2.0)
    assert sorted(kinds(result)) == [(side, Transition.RELEASE) for side in (LEFT, RIGHT)]
    assert result.work[Work.CONTACT_STEPS] < 400  # 233656 of Taylor


def test_a_light_arm_beside_one_that_creeps_costs_few_steps() -> None:
    """The object has roundings of the velocity of the arm that creeps beside it: they are no relaxation."""
    scene = Squeeze((1.5, 1.5), 1e9, (0.0, 0.0, 0.0), (-0.01, -0.01, -5.0), mass=(1e-3, 5.0, 1.0),
                    stiffness=(50.0, 0.0), damping=0.2)
    result = scene.start(max_work=10**6)
    result.advance(0.5)
    assert result.status is Status.DONE
    assert result.work[Work.CONTACT_STEPS] < 8000


def test_the_scenes_have_the_events() -> None:
    seen = set()
    for scene in MIXED.values():
        result = scene.start()
        result.advance(2.0)
        seen |= set(kinds(result))
    for side in (LEFT, RIGHT):
        assert (side, Transition.TOUCH) in seen
    assert {kind for _, kind in seen} >= set(Transition) - {Transition.REENTRY}
    assert (OBJECT, Transition.SLIP) in seen


@pytest.mark.slow
def test_states_against_the_reference() -> None:
    scene = Squeeze((300.0, 300.0), 1e6, (3.0, 0.0, -5.0))
    grid = np.linspace(0.0, 0.5, 11)
    result = scene.start()
    states = result.advance(0.5, grid)
    expected = integrate(scene.grasp, scene.state, grid, digits=20, force=(3.0, -5.0)).as_array()
    assert result.work[Work.CONTACT_STEPS] < 500
    assert np.abs(states - expected).max() < 1e-13


@pytest.mark.parametrize("p", [1e4, 1e8])
@pytest.mark.parametrize("name", MIXED)
def test_bits_of_mirror_units_and_outputs(name: str, p: float) -> None:
    scene = MIXED[name]._replace(p=(p, MIXED[name].p[1]))
    grid = np.linspace(0.0, 1.0, 9)
    states = scene.start().advance(1.0, grid)
    assert len(states) == len(grid)
    assert np.array_equal(-scene.mirrored().start().advance(1.0, grid)[:, [4, 5, 2, 3, 0, 1]], states)
    assert np.array_equal(
        scene.start(unit=True).advance(TIME, TIME * grid) / np.tile([LENGTH, LENGTH / TIME], 3), states)
    alone = scene.start()
    alone.advance(1.0)
    assert np.array_equal(alone.state, states[-1])


def test_momentum_of_a_squeezed_grasp() -> None:
    scene = Squeeze((1e8, 3e7), stiffness=(0.0, 0.0), force=(5.0, 0.3, -4.0))
    result, seconds = scene.start(), 2.0
    result.advance(seconds)

    def momentum(state: Array) -> float:
        return float(np.dot(scene.mass, state[1::2]) + 0.7 * (state[0] + state[4]))

    change = momentum(result.state) - momentum(scene.state)
    assert change == pytest.approx(sum(scene.force) * seconds, rel=1e-14, abs=0)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-10])
def test_coarse_accuracies(accuracy: float) -> None:
    scene = Squeeze()
    fine, coarse = scene.start(), scene.start(accuracy=accuracy)
    fine.advance(1.0)
    coarse.advance(1.0)
    assert coarse.status is Status.DONE
    assert np.abs(coarse.state - fine.state).max() < max(100.0 * accuracy, 1e-9)

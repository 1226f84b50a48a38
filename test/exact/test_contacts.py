"""Contacts: how often, when and how deep, by closed forms; and what is recorded of them."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import AT_REST, CASES, FREE, done, impact, kinds, make_grasp, run

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, Work
from grasp_ros.physics.model import Contact
from lab.cases.scenes import BEGIN
from lab.oracles.closed_forms import impact_numbers
from lab.reference.grasp import Grasp, grasp_of

IMPACTS = [
    (1.0, 1.0, 1e4, 0.0, 1.0),
    (1.0, 1.0, 1e4, 0.3, 1.0),
    (2.0, 3.0, 1e9, 0.5, 0.01),
    (1.0, 1e-3, 1e5, 10.0, 3.0),
    (1.0, 1.0, 1e4, 1e-8, 1.0),
    (1.0, 1.0, 1e4, 10.0, 1.0),
    (1.0, 1.0, 1e12, 0.1, 1.0),
    (1e-6, 1.0, 1e4, 0.1, 1.0),
    (1e6, 1.0, 1e4, 0.1, 1.0),
    (1.0, 1.0, 1e4, 1e-9, 1e8),
    (1.0, 1.0, 1e4, 0.3, 1e-8),
    (1.0, 1.0, 1e4, 0.3, 1e-20),
    (1.0, 1.0, 1e-3, 0.1, 1.0),
    *((1.0, 1.0, 1e4, 0.0, 10.0**k) for k in (8, -8, -12, -16, -18, -20, -22, -24, -30)),
]


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(("m1", "m2", "hertzian", "p", "speed"), IMPACTS)
def test_an_impact_is_one_touch_and_keeps_the_momentum(
    m1: float, m2: float, hertzian: float, p: float, speed: float, mirror: bool
) -> None:
    duration, _ = impact_numbers(m1, m2, hertzian, p, speed)
    arms = FREE._replace(mass=m1), FREE
    start = [-speed, speed, 0.0, 0.0, 1e3 * speed * (1 + duration), 1e3 * speed]  # touches after exactly 1 s
    if mirror:
        arms = arms[::-1]
        start = [-value for value in start[4:6] + start[2:4] + start[0:2]]
    contacts = Contact(hertzian, p), Contact(hertzian, p)
    result = run(Grasp(*arms, *contacts, m2), start, 1 + duration * 1.1, [1 + duration / 2])
    assert kinds(result) == [("TOUCH", RIGHT if mirror else LEFT), ("RELEASE", RIGHT if mirror else LEFT)]
    assert done(result).events[0].time == 1.0
    state = result.integrator.state * (-1 if mirror else 1)
    assert m1 * state[5 if mirror else 1] + m2 * state[3] == pytest.approx(m1 * speed, rel=1e-14)


@pytest.mark.parametrize("p", [0.0, 0.3, 10.0])
def test_depth_of_a_single_impact(p: float) -> None:
    """O1 and O2."""
    law = impact(0.5, 1e4, p, 1.0)
    times = np.linspace(1.0, 1.0 + float(law.duration), 2001)
    states = run(make_grasp(FREE, 1e4, p, 1.0), [-1.0, 1.0, 0.0, 0.0, 50.0, 0.0], 2.0, times).states
    depth = (states[:, 0] - states[:, 2]).max()
    assert depth == pytest.approx(float(law.depth), rel=1e-5)
    assert depth <= float(law.depth) * (1 + 1e-12)


@pytest.mark.parametrize("speed", [10.0**k for k in (8, 4, 0, -4, -8, -10, -12, -14, -16, -20)])
def test_simultaneous_impacts_of_any_speed(speed: float) -> None:
    law = impact(1, 1e4, 0, speed)  # each arm meets an object that does not move: its own mass counts
    duration = float(law.duration)
    result = run(make_grasp(FREE, 1e4, 0.0, 1.0), [-speed, speed, 0.0, 0.0, speed, -speed], 1 + 1.01 * duration)
    assert sorted(kinds(result)) == [("RELEASE", 0), ("RELEASE", 1), ("TOUCH", 0), ("TOUCH", 1)]
    assert done(result).state[1] / speed == pytest.approx(-1.0, rel=1e-12)
    assert result.integrator.events[-1].time == pytest.approx(1 + duration, rel=1e-12)


@pytest.mark.parametrize("p", [40.0, 1e3, 1e6])
def test_a_free_impact_is_never_clamped(p: float) -> None:
    """It ends at p u' = -1 + exp(-(1 + p v)) or so, O2, however little of that doubles can tell."""
    grasp = make_grasp(FREE, hertzian=1e5, p=p, object_mass=1.0)
    assert kinds(run(grasp, [0.0, 1.0, 0.0, 0.0, 1e6, 0.0], 100.0)) == [("TOUCH", LEFT), ("RELEASE", LEFT)]


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("p", [0.0, 0.1])
@pytest.mark.parametrize(("object_mass", "softer"), [(1.0, 1.0), (1e3, 1.0), (1.0, 1e6), (1e-3, 1e12), (1e3, 1e20)])
def test_a_touching_chain_takes_few_steps_a_contact(object_mass: float, softer: float, p: float, mirror: bool) -> None:
    """The second contact begins at rest, with t^3.5: some thirty steps take it to where its force shows."""
    contacts, start = (Contact(1e4, p), Contact(1e4 / softer, 0.1)), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    if mirror:
        contacts, start = contacts[::-1], [0.0, 0.0, 0.0, 0.0, 0.0, -1.0]
    result = run(Grasp(FREE, FREE, *contacts, object_mass), start, 10.0)
    assert kinds(result)[2] == ("RELEASE", RIGHT if mirror else LEFT)
    assert done(result).work[Work.CONTACT_STEPS] <= 45


def test_most_drawn_touching_chains_take_twenty_steps_a_swing() -> None:
    """A swing: a maximum of a penetration, or of the object's speed between two arms, of which there are more."""
    rng, steps = np.random.default_rng(5), []
    for _ in range(100):
        m_l, m_o, m_r = 10.0 ** rng.uniform(-1.0, 1.0, 3)
        contacts = [Contact(10.0 ** rng.uniform(3.0, 7.0), rng.uniform(0.0, 3.0)) for _ in range(2)]
        grasp = Grasp(FREE._replace(mass=m_l), FREE._replace(mass=m_r), *contacts, m_o)
        start = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
        result = run(grasp, start, 5.0)
        states = run(grasp, start, 5.0, np.linspace(0.0, result.integrator.events[-1].time, 4001)).states
        depths = states[:, 0:4:2] - states[:, 2:6:2]
        deepest = (depths[1:-1] > depths[:-2]) & (depths[1:-1] >= depths[2:]) & (depths[1:-1] > 0.0)
        change = np.diff(states[:, 3])
        turns = np.count_nonzero(np.diff(np.sign(change[np.abs(change) > 1e-13])))
        steps.append(done(result).work[Work.CONTACT_STEPS] / max(np.count_nonzero(deepest), turns + 1))
    assert np.median(steps) < 18.0
    assert np.quantile(steps, 0.9) <= 26.0


@pytest.mark.parametrize("exponent", range(3, 17))
def test_touches_that_are_nearly_simultaneous(exponent: int) -> None:
    """O15."""
    start = [-1.0, 1.0, 0.0, 0.0, 1.0 + 10.0**-exponent, -1.0]
    delay = start[4] - 1.0  # what double precision makes of it
    result = run(make_grasp(FREE, 1e4, 0.3, 1.0), start, 1.5)
    touches = [result.times(side, Transition.TOUCH) for side in (LEFT, RIGHT)]
    assert [len(times) for times in touches] == [1, 1]
    assert touches[1][0] - touches[0][0] == pytest.approx(delay, rel=1e-4, abs=3e-16)
    assert result.integrator.state[3] == pytest.approx(-5.65648 * delay, rel=1e-5 + 5 * delay, abs=2e-15)
    assert done(result).state[1] == pytest.approx(-float(impact(1, 1e4, 0.3, 1).restitution), abs=10 * delay + 1e-13)


def test_first_contacts_of_the_standard_case() -> None:
    result = run(grasp_of(scenes.load("case_01")), AT_REST, 0.6)
    events = {(event.kind, event.side): event for event in done(result).events}
    assert events[Transition.TOUCH, LEFT].time == events[Transition.TOUCH, RIGHT].time
    assert events[Transition.TOUCH, LEFT].u_rate == pytest.approx(0.99930564858067212555, rel=1e-15)
    assert events[Transition.RELEASE, LEFT].time == pytest.approx(0.513325334884, abs=6e-13)
    assert events[Transition.RELEASE, RIGHT].time == pytest.approx(0.503118325389, abs=6e-13)


@pytest.mark.parametrize("name", CASES)
def test_events_are_in_order_and_alternate(name: str) -> None:
    events = run(grasp_of(scenes.load(name)), scenes.load(name).initial_state, 20.0).integrator.events
    assert [e.time for e in events] == sorted(e.time for e in events)
    for side in (LEFT, RIGHT):
        own = [e for e in events if e.side == side]
        assert len(own) >= 3
        assert [e.kind in BEGIN for e in own] == [i % 2 == 0 for i in range(len(own))]
        assert all(e.u == 0.0 for e in own if e.kind in (Transition.TOUCH, Transition.RELEASE))
        assert all((e.u_rate > 0.0) == (e.kind is Transition.TOUCH) for e in own)

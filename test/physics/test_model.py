"""Tables, records and formulas of the model against hand numbers, and against each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from oracles import STANDARD, energy, make_grasp

from grasp_ros.physics.layout import LEFT
from grasp_ros.physics.model import Contact, Mode, hertzian_force, impact_force, in_contact, penetration
from grasp_ros.physics.system import System
from lab.reference.grasp import Grasp, acceleration, feedback, impact_forces

RNG = np.random.default_rng(1990)
GRASP = Grasp(
    STANDARD, STANDARD._replace(mass=2.0, stiffness=7.0, velocity_gain=0.9), Contact(1e4, 0.1), Contact(3e3, 2.0), 5.0
)
# x_l, v_l, x_o, v_o, x_r, v_r: all four contact conditions, then pairs that separate faster than 1/p
STATES = {
    "none": ([-0.3, 0.7, 0.1, -0.2, 0.5, 0.4], Mode.NONE),
    "left": ([0.11, 0.7, 0.1, -0.2, 0.5, 0.4], Mode.LEFT),
    "right": ([-0.3, 0.7, 0.52, -0.2, 0.5, 0.1], Mode.RIGHT),
    "both": ([0.12, 0.7, 0.1, 0.2, 0.08, 0.4], Mode.BOTH),
    "left clamped": ([0.11, -9.0, 0.1, 2.0, 0.5, 0.4], Mode.NONE),
    "right clamped": ([-0.3, 0.7, 0.52, -0.6, 0.5, 0.4], Mode.NONE),
    "left, right clamped": ([0.12, 0.7, 0.1, -0.6, 0.07, 0.4], Mode.LEFT),
    "both clamped": ([0.12, -10.5, 0.1, -0.3, 0.07, 0.4], Mode.NONE),
}


@given(*[st.floats(0.0, 1e15)] * 2, *[st.floats(-1e9, 1e9)] * 2)
@example(1e4, 1.0, 0.01, -1.0)
@example(1e4, 1.0, -0.0, -2.0)
def test_the_force_of_one_state_is_that_of_many(hertzian: float, dissipation: float, u: float, u_rate: float) -> None:
    many = impact_force(Contact(hertzian, dissipation), np.array([u]), np.array([u_rate]))
    one = System(pairs=np.array([(hertzian, dissipation), (0.0, 0.0)])).impact(LEFT, [u, u_rate, *[0.0] * 4])
    assert repr(one) == repr(float(many[0]))


def test_hand_numbers() -> None:
    assert feedback(STANDARD, 0.2, -2.0) == pytest.approx(-5.0 * 0.2 + 0.5 * 2.0)
    contact = Contact(1e4, 0.1)
    assert hertzian_force(contact, np.float64(0.01)) == pytest.approx(10.0)  # 1e4 0.01^1.5
    assert impact_force(contact, np.float64(0.01), np.float64(2.0)) == pytest.approx(12.0)
    assert impact_force(contact, np.float64(0.01), np.float64(-4.0)) == pytest.approx(6.0)
    assert impact_force(contact, np.float64(0.01), np.float64(-11.0)) == 0.0
    assert impact_force(contact, np.float64(-0.01), np.float64(2.0)) == 0.0
    level = energy(make_grasp(), np.array([-0.3, 0.0, 0.0, 0.0, 0.5, 0.0]))
    assert level.V == level.V_c == pytest.approx(15 * (0.09 + 0.25))
    assert level.V_rate == 0.0
    pressed = energy(make_grasp(), np.array([0.04, 0.0, 0.0, 0.0, 0.5, 0.0]))
    assert pytest.approx(15 * (0.0016 + 0.25) + 0.8 * 1e4 * 0.2**5) == pressed.V


def test_acceleration_by_hand() -> None:
    a_l, a_o, a_r = acceleration(make_grasp(), np.array([0.01, 1.0, 0.0, 0.0, 0.2, -2.0]))
    force = 11.0  # (1 + 0.1) 1e4 0.01^1.5
    assert (a_l, a_o, a_r) == pytest.approx((-0.15 - 0.7 - force, force / 5.0, -15 * 0.2 + 0.7 * 2.0))


@pytest.mark.parametrize("name", STATES)
def test_mode_and_forces_of_every_contact_condition(name: str) -> None:
    state, mode = STATES[name]
    level = energy(GRASP, np.array(state))
    assert level.mode == mode
    forces = impact_forces(GRASP, np.array(state))
    assert [force > 0.0 for force in forces] == [bool(mode & Mode.LEFT), bool(mode & Mode.RIGHT)]
    assert (level.V_c > level.V) == ("clamped" in name)


@pytest.mark.parametrize("name", STATES)
def test_rate_is_the_derivative_along_the_motion(name: str) -> None:
    state = np.array(STATES[name][0])
    a_l, a_o, a_r = acceleration(GRASP, state)
    flow = np.array([state[1], a_l, state[3], a_o, state[5], a_r], dtype=float)

    def slope(field: str, h: float) -> float:
        ahead, behind = (getattr(energy(GRASP, state + sign * h * flow), field) for sign in (1.0, -1.0))
        return float((ahead - behind) / (2.0 * h))

    level = energy(GRASP, state)
    for field in ("V_c",) if "clamped" in name else ("V", "V_c"):
        coarse, fine = slope(field, 2e-6), slope(field, 1e-6)
        assert (4.0 * fine - coarse) / 3.0 == pytest.approx(level.V_rate, rel=1e-7)
    assert level.V_rate < 0.0  # no state above is at rest


@pytest.mark.parametrize("p", [0.5, 4.0, 1.0 / 1024])
def test_the_edge_of_the_clamp_belongs_to_the_contact(p: float) -> None:
    contact, u = Contact(1e4, p), np.float64(0.01)
    edge = np.float64(-1.0 / p)
    assert in_contact(contact, u, edge)
    assert not in_contact(contact, u, np.nextafter(edge, -np.inf))
    assert impact_force(contact, u, edge) == 0.0
    assert impact_force(contact, u, edge * (1 - 1e-9)) > 0.0


def test_without_dissipation_no_speed_leaves_contact() -> None:
    assert in_contact(Contact(1e4, 0.0), np.float64(0.0), np.float64(-1e300))


def test_force_is_never_negative() -> None:
    u = RNG.normal(size=20000) * 10.0 ** RNG.uniform(-12, 2, 20000)
    d = RNG.normal(size=20000) * 10.0 ** RNG.uniform(-12, 4, 20000)
    for p in (0.0, 0.1, 3.0, 1e6):
        force = impact_force(Contact(1e4, p), u, d)
        assert (force >= 0.0).all()
        assert (force > 0.0).any()
        assert (force[u < 0.0] == 0.0).all()


def test_scalars_and_arrays_agree() -> None:
    states = np.array([state for state, _ in STATES.values()])
    level = energy(GRASP, states)
    for i, state in enumerate(states):
        one = energy(GRASP, state)
        assert [field[i] for field in level] == [float(field) for field in one[:3]] + [int(one.mode)]
    assert np.array_equal(np.stack(penetration(states))[0], states[:, 0] - states[:, 2])


def test_mirror_of_the_model_is_exact() -> None:
    mirrored = Grasp(GRASP.right, GRASP.left, GRASP.right_contact, GRASP.left_contact, GRASP.object_mass)
    for state, _ in STATES.values():
        image = -np.array(state)[[4, 5, 2, 3, 0, 1]]
        a_l, a_o, a_r = acceleration(GRASP, np.array(state))
        assert tuple(-a for a in acceleration(mirrored, image)) == (a_r, a_o, a_l)
        assert energy(mirrored, image).V_c == pytest.approx(float(energy(GRASP, np.array(state)).V_c), rel=1e-15)

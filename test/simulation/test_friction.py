"""Dry and viscous friction of the object."""

from __future__ import annotations

import numpy as np
import pytest
from documents import body, made, scene_of

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import LEFT, OBJECT, Entry, Transition
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate


def against_the_slope(gap: float, friction: float = 1.0) -> Scene:
    """An arm at rest beside an object that friction holds on a slope."""
    return made(
        3.0, 0.001, left_arm=body(stiffness_N_per_m=5.0), object=body(1.0, gap), left_contact={"hertz_N_per_m1_5": 1e4},
        left_feedback={"position_gain_N_per_m": 1.0, "velocity_gain_Ns_per_m": 0.0, "set_point_m": 0.001},
        object_friction={"coulomb_N": friction}, tilt={"angle_rad": 0.2, "gravity_m_per_s2": 9.81})


def test_a_pair_that_touches_at_rest_is_judged_with_the_friction() -> None:
    touching, apart = simulate(against_the_slope(0.0)), simulate(against_the_slope(1e-12))
    assert len(touching.times(Transition.TOUCH, LEFT)) == len(apart.times(Transition.TOUCH, LEFT)) > 3
    assert np.abs(touching.state - apart.state)[:, :4].max() < 1e-9
    assert np.diff(touching.energy.V_c).max() <= 1e-12


def test_impacts_die_out_against_a_stuck_object_without_a_stall() -> None:
    """The other arm leans on the object, so that the scales of both contacts drift apart by many decades."""
    scene = scenes.load("case_01", ["object_friction.coulomb_N=50", "time.duration_s=300"])
    motion = simulate(scene)
    assert motion.status is Status.DONE
    assert np.diff(motion.energy.V_c).max() <= 1e-12
    strong = ["left_feedback.velocity_gain_Ns_per_m=16", "left_feedback.position_gain_N_per_m=900",
              "right_feedback.set_point_m=-0.02", "object_friction.coulomb_N=10", "left_arm.position_m=-0.05",
              "right_arm.position_m=0.001", "object.mass_kg=0.1", "time.duration_s=5"]
    assert simulate(scenes.load("case_01", strong)).status is Status.DONE


def sliding(**friction: float) -> Scene:
    """An object of 2 kg alone with 1.5 m/s."""
    return made(10.0, 0.01, object=body(2.0, 0.25, 1.5), object_friction=friction)


def test_dry_friction_stops_the_object_where_and_when_it_must() -> None:
    motion = simulate(scenes.load("friction_slide"))
    (stop,) = motion.events
    assert stop.kind is Transition.STICK
    assert stop.time == pytest.approx(2.0 * 1.5 / 1.0, rel=1e-15)
    assert motion.state[-1, 2] == pytest.approx(2.0 * 1.5**2 / 2.0, rel=1e-15)
    assert motion.state[-1, 3] == 0.0
    assert np.unique(motion.state[motion.t > 3.0, 2]).size == 1


def test_both_frictions_together_stop_it_earlier() -> None:
    """m v' = -F - c v: v = 0 at (m / c) ln(1 + c v / F)."""
    motion = simulate(sliding(viscous_Ns_per_m=0.8, coulomb_N=0.5))
    (stop,) = motion.events
    time = 2.0 / 0.8 * np.log1p(0.8 * 1.5 / 0.5)
    assert stop.time == pytest.approx(time, rel=1e-14)
    way = (2.0 * 1.5 - 0.5 * time) / 0.8  # from the momentum: m v = F t + c x
    assert motion.state[-1, 2] == pytest.approx(0.25 + way, rel=1e-14)


def test_viscous_friction_alone_never_stops_it() -> None:
    motion = simulate(sliding(viscous_Ns_per_m=0.8))
    assert motion.events == []
    assert np.abs(motion.state[:, 3] - 1.5 * np.exp(-0.4 * motion.t)).max() < 1e-15


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stuck_object_gives_way_only_to_more_than_the_friction(sign: float) -> None:
    motion = simulate(made(
        4.0, 0.01, object=body(mass=2.0), object_friction={"coulomb_N": 1.0},
        object_table={"time_s": [0.0, 1.0, 2.0], "force_N": [sign, 1.5 * sign, 0.5 * sign]}))
    slip, stick = motion.events
    assert (slip.kind, stick.kind) == (Transition.SLIP, Transition.STICK)
    assert slip.time == 1.0
    assert stick.time == pytest.approx(3.0, rel=1e-15)  # 0.25 m/s^2 for a second, then as much against it
    assert motion.state[-1, 2] == pytest.approx(sign * 0.25, rel=1e-15)


def test_friction_holds_the_object_against_the_slope() -> None:
    """It slides if tan(angle) > F / (m g cos(angle)): here m g sin(angle) against F."""
    for angle, moves in ((0.05, False), (0.06, True)):
        end = simulate(made(2.0, 0.01, object=body(mass=2.0), object_friction={"coulomb_N": 1.1},
                            tilt={"angle_rad": angle, "gravity_m_per_s2": 9.81})).state[-1]
        pull = 9.81 * np.sin(angle) - 0.55
        assert end[2] == (pytest.approx(-0.5 * pull * 4.0, rel=1e-13) if moves else 0.0)


def test_the_energy_lost_is_force_times_way() -> None:
    scene = scene_of("friction", "left_arm.damping_Ns_per_m=0", "right_arm.damping_Ns_per_m=0",
                     "left_feedback.velocity_gain_Ns_per_m=0", "right_feedback.velocity_gain_Ns_per_m=0",
                     "left_contact.dissipation_s_per_m=0", "right_contact.dissipation_s_per_m=0",
                     "object_friction.viscous_Ns_per_m=0", "time.duration_s=10.0")
    motion = simulate(scene, grid=np.linspace(0.0, 10.0, 400_001))
    kinds = {event.kind for event in motion.events}
    assert {Transition.STICK, Transition.SLIP} <= kinds
    way = np.abs(np.diff(motion.state[:, 2])).sum()
    V_c = motion.energy.V_c
    assert V_c[0] - V_c[-1] == pytest.approx(2.0 * 1.0 * way, abs=1e-7)
    assert V_c[0] - V_c[-1] > 1.0


def test_the_object_sticks_exactly_while_the_arms_push_too_weakly() -> None:
    motion = simulate(scenes.load("friction"))
    stuck = False
    rest = []
    for event in motion.events:
        if event.kind in (Transition.STICK, Transition.SLIP):
            stuck = event.kind is Transition.STICK
            rest.append(event.time)
    assert stuck
    end = motion.t > rest[-1]
    assert np.unique(motion.state[end, 2]).size == 1
    assert not motion.state[end, 3].any()
    assert np.ptp(motion.state[end, 0]) > 1e-3  # the arm still swings
    lean = next(output.value(motion.scene.system, 0, motion.state[-1]) for output in motion.scene.outputs)
    assert lean == pytest.approx(-15.0 * motion.state[-1, 0], rel=1e-4)  # the arm rests against it
    assert 0.5 < lean < 1.0


@pytest.mark.parametrize("beside", [-1, 0, 1])
def test_an_object_pushed_by_exactly_its_friction_sticks(beside: int) -> None:
    """A finger rests on it with 10 N, a rounding more or less than the friction: noise must not make it slip."""
    force = 1e4 * 0.01**1.5
    limit = force * (1.0 + beside * 2.0**-52)
    scene = made(
        1.0, 0.001, left_arm=body(1.0, 0.01), object=body(), object_friction={"coulomb_N": limit},
        left_feedback={"position_gain_N_per_m": 0.0, "velocity_gain_Ns_per_m": 0.0, "feed_forward_N": force},
        left_contact={"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.5})
    assert simulate(scene).events == []
    more = scene.changed({"left_feedback.feed_forward_N": 1.01 * force})
    assert [event.kind for event in simulate(more).events] == [Transition.SLIP]


def test_no_accuracy_lets_the_object_slip_twice_for_once() -> None:
    """The force of the series and that of the state differ by the accuracy."""
    rng = np.random.default_rng(7)
    scene = scenes.load("friction", ["time.duration_s=5"])
    numbers = {f"{section}.{key}": value for section, keys in scene.values.items() if section != "time"
               for key, value in keys.items() if isinstance(value, float) and value}
    slips = 0
    for _ in range(20):
        drawn = [f"{name}={value * 10.0 ** rng.uniform(-0.5, 0.5)!r}" for name, value in numbers.items()]
        for accuracy in (1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 1e-16):
            table = simulate(scenes.load("friction", ["time.duration_s=5", *drawn]), setting=accuracy).event_table
            when = table[table[:, Entry.BODY] == OBJECT, Entry.TIME]
            slips += len(when)
            assert len(when) < 3 or (when[2:] - when[:-2]).min() > 1e-9, (drawn, accuracy)
    assert slips > 500

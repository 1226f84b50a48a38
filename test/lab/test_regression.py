"""Regression scenes against their answers in 25 digits, which `lab.cases.regression` writes."""

from __future__ import annotations

import numpy as np
import pytest

from grasp_ros.physics.layout import Work
from grasp_ros.scene import SceneError, compose
from grasp_ros.simulation import simulate
from lab.cases.regression import SCENES, answer, answers, load, names, refusals, refused, verdict

ANSWERS = answers()
FEW, MORE = 10.0, 100.0  # roundings
MANY_IMPACTS = (
    "chain_friction_pulse_1", "chain_loop_set_point_feed_forward_friction_table_1", "rest_then_pushed_alarm",
)
MANY_STEPS = ("light_arm_beside_one_that_creeps",)
CHEAP = ("through_the_finger", "together", "free_fall", "pressed_for_a_moment")


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.slow, pytest.mark.thorough] if name in MANY_STEPS else ())
    for name in ANSWERS])
def test_the_motion_is_right_within_roundings(name: str) -> None:
    found = verdict(load(name), ANSWERS[name])
    limit = MORE if name in MANY_IMPACTS else FEW
    assert found.error <= limit, f"{name}: {found.status}, error in roundings {found.error:.3g}"


@pytest.mark.parametrize(("name", "steps"), [("chain_1", 40), ("chain_set_point_friction_1", 180),
                                             ("chain_friction_4", 180)])
def test_a_pair_that_begins_beside_a_harder_one_takes_steps_of_a_part_of_its_age(name: str, steps: int) -> None:
    """Its u grows like t^3.5 over decades of time, by a factor in each step."""
    scene = load(name)
    assert simulate(scene, grid=[0.0, scene.duration]).work[Work.CONTACT_STEPS] <= steps


@pytest.mark.parametrize(("name", "events"), [
    ("side_by_side_on_a_slope", 4), ("slips_against_a_waiting_arm", 11), ("pressed_gently_on_a_slope", 4),
    ("pushed_while_its_force_dies_out", 10),
])
def test_roundings_beside_another_impact_make_no_events(name: str, events: int) -> None:
    """Those of u'' parted a pair that begins, for millions of steps, and those of u' clamped one at -1/p."""
    run = simulate(load(name))
    assert len(run.event_table) == events
    assert run.work[Work.CONTACT_STEPS] < 300


def test_what_moves_alike_is_told_by_what_a_step_adds() -> None:
    """Three bodies at 1000 m/s, one of them pressed: told by roundings of the speed, momentum was made."""
    body = {"position_m": 0.0, "velocity_m_per_s": 0.0}
    scene = compose("pressed", {
        "time": {"duration_s": 1.0, "control_period_s": 1.0}, "left_arm": {"mass_kg": 1.0, **body},
        "object": {"mass_kg": 1.0, **body}, "right_arm": {"mass_kg": 1e-3, **body},
        "left_contact": {"hertz_N_per_m1_5": 1e6}, "right_contact": {"hertz_N_per_m1_5": 1e9},
        "right_arm_pulse": {"force_N": -1e-11, "start_s": 0.0, "length_s": 1.0},
    })
    fast = scene.changed({f"{name}.velocity_m_per_s": 1000.0 for name in ("left_arm", "object", "right_arm")})
    masses = np.array([1.0, 1.0, 1e-3])
    for moving, speed in ((scene, 0.0), (fast, 1000.0)):
        gained = simulate(moving, grid=[1.0]).state[-1, 1::2] - speed
        assert masses @ gained == pytest.approx(-1e-11, rel=0.02, abs=0.0)  # roundings of the speed
        assert gained[:2] == pytest.approx([-2.316e-12, -7.653e-12], rel=0.03, abs=0.0)


@pytest.mark.parametrize(("name", "words"), refused().items())
def test_a_scene_outside_the_domain_is_refused_by_its_rule(name: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(name)
    sentence = str(caught.value)
    assert sentence.startswith(f"{SCENES / name}.yaml: ")
    assert all(part in sentence for part in [*words.split(": "), "allowed: "])


def test_each_refusal_is_counted_once() -> None:
    assert refusals().total() == len(refused())


def test_answers_belong_to_scenes() -> None:
    assert set(ANSWERS) <= set(names())
    assert all(len(row) == 6 for right in ANSWERS.values() for row in right.state)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEAP)
def test_answers_are_those_of_the_reference(name: str) -> None:
    found, right = answer(load(name)), ANSWERS[name]
    assert (found.t, found.state, found.status) == (right.t, right.state, right.status)
    assert found.amplification == pytest.approx(right.amplification, rel=0.1)


def test_a_wrong_answer_is_seen() -> None:
    right = ANSWERS["touching_chain"]
    moved = [[f"{float(value) * (1 + 1e-9):.20e}" for value in row] for row in right.state]
    assert verdict(load("touching_chain"), right._replace(state=moved)).error > 1e4


def test_a_pair_that_leaves_by_a_low_accuracy_is_pushed_back_by_a_new_force() -> None:
    """At the loosest accuracy both pairs are about to part before the tick at which their arms are pushed together."""
    loose = simulate(load("leaving_pushed_gently"), setting=1e-3)
    right = np.array(ANSWERS["leaving_pushed_gently"].state[-1], dtype=float)
    assert loose.state[-1] == pytest.approx(right, rel=2e-3, abs=1e-12)

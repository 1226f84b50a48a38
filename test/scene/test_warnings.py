"""What a scene can hardly mean: a warning names the key, its value, why it is odd, and what may be meant."""

from __future__ import annotations

import numpy as np
import pytest
from documents import scene_of

from grasp_ros import scene as scenes
from grasp_ros.cli.main import main
from grasp_ros.scene import Scene, load
from grasp_ros.scene.effects import EFFECTS
from grasp_ros.simulation import simulate

SENSOR = ("loop={}", "left_sensor.noise_seed=1")


@pytest.mark.parametrize(("name", "settings", "words"), [
    ("case_01", ("object_friction={}",), "object_friction: has no effect without viscous_Ns_per_m or coulomb_N"),
    ("case_01", ("object_friction.coulomb_N=0",), "object_friction: has no effect without"),
    ("case_01", ("tilt.angle_rad=0", "tilt.gravity_m_per_s2=9.81"), "tilt.angle_rad: 0.0 leaves"),
    ("case_01", ("tilt.angle_rad=0.1", "tilt.gravity_m_per_s2=0"), "tilt.gravity_m_per_s2: 0.0 leaves"),
    ("case_01", SENSOR, "left_sensor: has no effect without position_noise_m or velocity_noise_m_per_s or "),
    ("case_01", (*SENSOR, "left_sensor.position_noise_m=0"), "left_sensor: has no effect without position_noise_m"),
    ("case_02", (*SENSOR, "left_sensor.velocity_noise_m_per_s=1"), "has no effect: left_feedback.velocity_gain_N"),
    ("case_01", (*SENSOR, "left_sensor.position_noise_m=1", "left_sensor.velocity_step_m_per_s=1",
                 "left_feedback.position_gain_N_per_m=0"),
     "left_sensor.position_noise_m: 1.0 has no effect: left_feedback.position_gain_N_per_m is 0"),
    ("case_01", (*SENSOR, "left_sensor.position_step_m=2"), "left_sensor.position_step_m: 2.0 measures 0"),
    ("case_01", ("loop={}", "left_actuator.limit_N=0"), "left_actuator.limit_N: 0.0 lets no force"),
    ("case_01", ("loop={}", "left_actuator.limit_N=1", "left_feedback.feed_forward_N=-2"),
     "left_actuator.limit_N: 1.0 is less than left_feedback.feed_forward_N alone"),
    ("case_01", ("loop={}", "right_feedback.velocity_gain_Ns_per_m=1e5"),
     "is too long for right_feedback: while the right arm touches nothing, it swings 99 times as far from answer to"),
    ("case_01", ("loop.delay_ticks=20", "left_feedback.velocity_gain_Ns_per_m=100"),
     "time.control_period_s: 0.001 is too long for left_feedback"),
    ("case_01", ("loop.delay_ticks=0",), "loop.delay_ticks: 0 has no effect; meant: a delay above 0, or loop: {}"),
    ("case_01", ("loop.delay_ticks=50", "time.duration_s=0.05"), "loop.delay_ticks: 50 is the whole run of 50"),
    ("case_01", ("loop={}", "time.control_period_s=20"), "time.control_period_s: 20.0 is as long as the run"),
    ("friction_slide", ("loop={}",), "loop: {} holds no command: no side has feedback"),
    ("case_01", ("left_feedback.position_gain_N_per_m=0", "left_feedback.set_point_m=1"),
     "left_feedback.set_point_m: 1.0 has no effect without a position gain"),
    ("pulse", ("object_pulse.force_N=0",), "object_pulse: has no effect without force_N"),
    ("pulse", ("object_pulse.start_s=10",), "object_pulse.start_s: 10.0 is not before the run's end"),
    ("pulse", ("time.duration_s=5.01",), "object_pulse.length_s: 0.02 reaches 0.01 s beyond the end"),
    ("table", ("left_arm_table.force_N=[0,0,0]",), "left_arm_table: has no effect without force_N"),
    ("table", ("left_arm_table.time_s=[20,21,22]",), "left_arm_table.time_s: 20.0 is not before the run's end"),
    ("table", ("left_arm_table.time_s=[1,20,21]", "left_arm_table.force_N=[0,5,6]"),
     "left_arm_table.time_s: 20.0 is not before the run's end: no force acts"),
    ("table", ("time.duration_s=12", "left_arm_table.force_N=[1,2,3]"),
     "left_arm_table.time_s: 12.0 is not before the run's end: its force never acts"),
    ("table", ("time.duration_s=11.999",), "left_arm_table.time_s: 12.0 is not before the run's end"),
    ("table", ("time.duration_s=12", "left_arm_table.time_s=[1,12,13]", "left_arm_table.force_N=[1,0,5]"),
     "left_arm_table.time_s: 13.0 is not before the run's end: its force never acts"),
    ("sine", ("object_sine.amplitude_N=0",), "object_sine: has no effect without amplitude_N"),
    ("case_01", ("left_feedback.position_gain_N_per_m=0", "left_feedback.velocity_gain_Ns_per_m=0"),
     "left_feedback: has no effect without position_gain_N_per_m or velocity_gain_Ns_per_m or feed_forward_N"),
    ("case_01", ("left_arm.position_m=0.9", "right_arm.position_m=1e7"),
     "left_arm.position_m: 0.9 lies 0.9 m inside"),
    ("case_01", ("left_arm.position_m=0.6",), "left_arm.position_m: 0.6 lies right of the right arm"),
    ("case_01", ("right_arm.position_m=-0.4",), "right_arm.position_m: -0.4 lies left of the left arm"),
    ("case_01", ("right_arm.position_m=-0.1",), "right_arm.position_m: -0.1 lies 0.1 m inside the object"),
    ("hammer", ("left_arm.position_m=1",), "left_arm.position_m: 1.0 lies 1 m inside the object"),
])
def test_a_warning_names_the_key_and_what_may_be_meant(name: str, settings: tuple[str, ...], words: str) -> None:
    (warning,) = load(name, settings).warnings
    assert words in warning
    assert "; meant: " in warning


@pytest.mark.parametrize(("side", "far"), [("left", "right"), ("right", "left")])
def test_an_arm_that_passes_through_the_object_is_named(side: str, far: str) -> None:
    (warning,) = scene_of("case_01", without=(f"{far}_contact",)).warnings
    assert warning.startswith(f"{far}_arm: {{'mass_kg': ")
    assert f"touches nothing: without {far}_contact it passes through the object, which the {side} arm hits" in warning
    assert scene_of("case_01", without=("left_contact", "right_contact")).warnings == ()


@pytest.mark.parametrize("hertz", [1e4, 1.0, 1e-6])
def test_both_arms_on_the_wrong_side_are_named(hertz: float) -> None:
    soft = [f"{side}_contact.hertz_N_per_m1_5={hertz}" for side in ("left", "right")]
    left, right = load("case_01", ["left_arm.position_m=0.5", "right_arm.position_m=-0.3", *soft]).warnings
    assert left.startswith("left_arm.position_m: 0.5 lies 0.5 m inside")
    assert right.startswith("right_arm.position_m: -0.3 lies 0.3 m inside")


@pytest.mark.parametrize(("name", "settings"), [
    *((name, ()) for name in scenes.names()),
    ("case_02", ("loop={}",)),  # no losses, and a loop without a delay
    ("case_01", tuple(f"left_{key}=0" for key in (
        "arm.stiffness_N_per_m", "feedback.position_gain_N_per_m", "contact.dissipation_s_per_m",
        "feedback.set_point_m", "feedback.feed_forward_N"))),
    ("case_01", ("object_friction.coulomb_N=1", "object_friction.viscous_Ns_per_m=0")),
    ("case_01", (*SENSOR, "left_sensor.position_noise_m=0", "left_sensor.velocity_step_m_per_s=1e-3")),
    ("case_01", ("loop={}", "left_actuator.limit_N=1", "left_feedback.velocity_gain_Ns_per_m=1e5")),  # is limited
    ("case_01", ("loop={}", "time.control_period_s=2", "time.duration_s=20")),  # ten ticks beyond the limit
    ("pulse", ("time.duration_s=5.02",)),  # ends with the run
    ("table", ("time.duration_s=12",)),  # its last time is the end
    ("sine", ("object_sine.frequency_Hz=500",)),  # half the control frequency
    ("case_01", ("left_arm.position_m=1e-12",)),  # a touch, but for rounding of positions of 0.5 m
    ("no_contact", ("left_arm.position_m=0.5", "right_arm.position_m=-0.5")),  # who never meets has no side
])
def test_what_can_be_meant_does_not_warn(name: str, settings: tuple[str, ...]) -> None:
    assert load(name, settings).warnings == ()


def started(scene: Scene, state: np.ndarray) -> Scene:
    """A scene from another state."""
    positions = {f"{body}.position_m": x
                 for body, x in zip(("left_arm", "object", "right_arm"), state[0::2], strict=True)}
    rates = {f"{body}.velocity_m_per_s": v
             for body, v in zip(("left_arm", "object", "right_arm"), state[1::2], strict=True)}
    return scene.changed({key: float(number) for key, number in {**positions, **rates}.items()})


def test_a_grasp_under_load_may_be_started_where_it_rests() -> None:
    """Its arms overlap by both penetrations, and the motor forces hold them there."""
    for name in ("preload", "preload_feed_forward", "tilt_hold"):
        scene = scene_of(name, "time.duration_s=60")
        held = started(scene, simulate(scene).state[-1])
        assert held.initial_state[0] > held.initial_state[4]
        assert held.warnings == ()


def test_examples_of_the_effects_do_not_warn() -> None:
    bare = load("case_01")
    for effect in EFFECTS:
        extra = {"loop": {}} if "loop" in effect.needs else {}
        values = {**bare.values, **extra, effect.section: {**bare.values.get(effect.section, {}), **effect.example}}
        if effect.section != "object_friction" or effect.example:
            assert scenes.compose(effect.section, values).warnings == ()


def test_a_command_prints_a_warning_once_and_the_description_shows_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "arm_alone", "--grid", "2", "--set", "loop.delay_ticks=0"]) == 0
    printed = capsys.readouterr()
    (warning,) = load("arm_alone", ["loop.delay_ticks=0"]).warnings
    assert printed.err.splitlines().count(f"grasp: warning: arm_alone: {warning}") == 1
    assert [line.split(maxsplit=1) for line in printed.out.splitlines()].count(["warning", warning]) == 1
    assert main(["simulate", "arm_alone", "--grid", "2"]) == 0
    assert "warning" not in "".join(capsys.readouterr())

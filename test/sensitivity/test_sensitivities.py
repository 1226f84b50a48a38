"""Derivatives through impacts: against differences in 25 and more digits, exact relations, and the motion itself."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import STEPS, body, horizon, made, scene_of

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Of, Transition
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.spectrum import spectrum
from grasp_ros.simulation import simulate
from grasp_ros.simulation.differentiate import Sensitivity, differentiate
from lab.reference.solve import difference

P = "left_contact.dissipation_s_per_m"

# Scene, number, time in s, tolerance, and the derivative there of x_l, v_l, x_o, v_o, x_r, v_r by lab.reference.
FROM_REFERENCE: list[tuple[str, str, float, float, list[float]]] = [
    ("case_01", P, 20.0, 1e-10, [1.9880362641581995, -9.177033352694915, 1.922265171331475, 4.1547139514509,
                                 0.18462671862163085, 1.1414727344251359]),
    ("case_09", P, 20.0, 2e-7, [-5862.296714300924, 114080.39094874446, -12194.934644430334, -4258.480461918836,
                                29475.201373716973, 24320.854194861502]),
    ("case_03", P, 20.0, 1e-9, [-1805.6847805734087, -7701.671919032983, 419.42676504673, -5935.053688257526,
                                729.2826958784613, 28993.064570219154]),
    ("v_jump_symmetric", P, 2.0, 1e-10, [0.0012987149231477504, -0.012716308340747917, -0.014297516229988039,
                                          -0.04028464470670711, 0.0013009082026472882, -0.012576725193915709]),
    ("friction", P, 40.0, 1e-10, [0.11958460925071542, -2.1526540094168045e-05, 0.12268154530779884, 0.0,
                                  -6.149544201860378e-07, 1.3100233309641512e-06]),
    ("delay", P, 3.0, 1e-10, [0.29372444457343894, 1.5229152788878912, 0.013253293487082419, -0.14281507949707958,
                              -0.013411953347469457, 2.251685233715378]),
]


def derivatives(scene: Scene, *keys: str) -> Sensitivity:
    """Of a run with its last state alone."""
    return differentiate(simulate(scene, grid=[scene.duration]), keys)


def differences(scene: Scene, key: str, width: float, **settings: Any) -> np.ndarray:
    """Derivative of the last state by a central difference of runs in double precision, for what has no reference."""
    section, _, name = key.partition(".")
    value = scene.values[section][name]
    low, high = (simulate(scene.changed({key: at}), grid=[scene.duration], **settings).state[-1]
                 for at in (value - width, value + width))
    return np.asarray((high - low) / (2.0 * width))


@pytest.mark.parametrize(("name", "key", "seconds", "tolerance", "expected"), FROM_REFERENCE,
                         ids=lambda value: value if isinstance(value, str) else "")
def test_derivatives_are_those_of_the_reference(
    name: str, key: str, seconds: float, tolerance: float, expected: list[float]
) -> None:
    found = derivatives(horizon(name, seconds), key).state_rates[-1, :, 0]
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("key", [
    "left_arm.mass_kg", "left_arm.stiffness_N_per_m", "left_arm.damping_Ns_per_m", "object.mass_kg",
    "left_contact.hertz_N_per_m1_5", "right_contact.dissipation_s_per_m", "right_feedback.position_gain_N_per_m",
    "right_feedback.velocity_gain_Ns_per_m", "left_arm.position_m", "object.position_m", "object.velocity_m_per_s",
])
def test_every_kind_of_number_through_a_joint_touch(key: str) -> None:
    scene = horizon("case_01", 1.2)
    expected = difference(scene, key, [scene.duration])
    found = derivatives(scene, key)
    assert np.abs(found.state_rates[..., 0] - expected.state).max() <= 1e-10 * np.abs(expected.state).max()
    for kind, times in ((Transition.TOUCH, expected.touches), (Transition.RELEASE, expected.releases)):
        for side in (LEFT, RIGHT):
            chosen = (found.event_table[:, 1] == side) & (found.event_table[:, 2] == kind)
            np.testing.assert_allclose(found.event_rates[chosen, 0], times[side], rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("z", [0.1, 0.3, 1.0, 10.0])
def test_restitution_of_two_free_bodies(z: float) -> None:
    """O2: ln(1 - w) + w = ln(1 + z) - z, with z = p v before and w = p v_o after the impact."""
    speed = z / 0.3
    scene = made(2.0, 0.001, left_arm=body(1.0, -0.1, speed), object=body(),
                 left_contact={"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.3})
    found = derivatives(scene, "left_arm.velocity_m_per_s", P)
    w = 0.3 * (found.state[-1, 3] - found.state[-1, 1])
    slope = z * (1.0 - w) / (w * (1.0 + z))  # dw/dz, of the line above
    apart = found.state_rates[-1, 3] - found.state_rates[-1, 1]
    np.testing.assert_allclose(apart, [slope, (slope * speed - w / 0.3) / 0.3], rtol=1e-11)


@pytest.mark.parametrize(("name", "key", "width"), [
    ("everything_smooth", "left_feedback.position_gain_N_per_m", 1e-4),
    ("everything_smooth", "left_feedback.set_point_m", 1e-8),
    ("everything_smooth", "right_sensor.velocity_noise_m_per_s", 1e-7),
    ("everything_smooth", "tilt.angle_rad", 1e-7),
    ("everything_smooth", "object_pulse.force_N", 1e-4),
    ("saturation", "left_actuator.limit_N", 1e-6),
    ("sine", "object_sine.amplitude_N", 1e-7),
    ("friction_slide", "object_friction.coulomb_N", 1e-7),
    ("preload", "left_feedback.set_point_m", 1e-8),
    ("tilt_hold", "tilt.angle_rad", 1e-7),
])
def test_inputs_friction_and_rest(name: str, key: str, width: float) -> None:
    if name == "everything_smooth":
        scene = scene_of("everything", "time.duration_s=1", without=STEPS)
    else:
        scene = scenes.load(name)
        scene = scene.changed({"time.duration_s": min(scene.duration, 4.0)})
    expected = differences(scene, key, width)
    found = derivatives(scene, key).state_rates[-1, :, 0]
    assert np.nanmax(np.abs(found - expected)) <= 3e-5 * np.nanmax(np.abs(expected))


@pytest.mark.parametrize("period", [0.1, 0.01])
def test_an_object_that_a_pulse_moves_from_rest(period: float) -> None:
    """Friction holds it until the pulse; from then on v = (f - F) t / m."""
    scene = made(1.5, period, object=body(), object_friction={"coulomb_N": 0.5},
                 object_pulse={"force_N": 1.0, "start_s": 1.0, "length_s": 0.5})
    keys = ["object_friction.coulomb_N", "object_pulse.force_N"]
    run = simulate(scene, grid=[0.45, 1.0, 1.25, 1.5], sensitivity=keys)
    assert run.sensitivity is not None
    moving = np.array([0.0, 0.0, 0.25, 0.5])
    expected = np.stack([0.5 * moving**2, moving], axis=1)
    for j, sign in ((0, -1.0), (1, 1.0)):
        found = run.sensitivity.state_rates[:, 2:4, j]
        np.testing.assert_allclose(found, sign * expected, rtol=1e-12, atol=1e-15)


def test_an_object_that_stops_just_when_inputs_change_is_flagged() -> None:
    """It stops after 0.5 s, when the pulse begins to push it back."""
    scene = made(1.0, 0.1, object=body(v=0.25), object_friction={"coulomb_N": 0.5},
                 object_pulse={"force_N": -1.0, "start_s": 0.5, "length_s": 0.2})
    found = derivatives(scene, "object.velocity_m_per_s")
    assert found.corner == pytest.approx(0.5)
    assert found.corner_reason == "the object stops just when inputs change"
    later = scene.changed({"object_pulse.start_s": 0.6})
    assert derivatives(later, "object.velocity_m_per_s").corner is None


@pytest.mark.parametrize("grid", [np.linspace(0.0, 10.0, 501), np.geomspace(1e-3, 10.0, 50)])
def test_outputs_at_rest_have_the_derivatives_that_they_have_alone(grid: np.ndarray) -> None:
    """Equal steps from output to output have one flow."""
    keys = ["left_arm.mass_kg", "left_arm.stiffness_N_per_m", "left_feedback.set_point_m"]
    scene = scenes.load("preload")
    several = simulate(scene, grid=grid, sensitivity=keys).sensitivity
    assert several is not None
    largest = np.abs(several.state_rates).max(axis=(0, 1))
    for i in range(0, len(grid), len(grid) // 10):
        alone = simulate(scene, grid=grid[i : i + 1], sensitivity=keys).sensitivity
        assert alone is not None
        assert (np.abs(several.state_rates[i] - alone.state_rates[0]) <= 1e-13 * largest).all()


def test_an_output_exactly_at_a_stick_has_the_derivatives_before_it() -> None:
    scene, key = scenes.load("friction_slide"), "object_friction.coulomb_N"
    run = simulate(scene, grid=[3.0, 3.01], sensitivity=[key])
    assert run.events[-1].time == 3.0
    assert run.sensitivity is not None
    assert run.sensitivity.state_rates[:, 3, 0].tolist() == [pytest.approx(-1.5), 0.0]
    assert (run.sensitivity.corner, run.sensitivity.corner_reason) == (None, None)


def test_the_first_state_of_an_object_that_sticks_at_once_follows_what_it_begins_with() -> None:
    key = ["object.velocity_m_per_s"]
    run = simulate(scenes.load("friction"), grid=np.array([0.0, 1e-3]), sensitivity=key)
    assert run.sensitivity is not None
    assert run.sensitivity.state_rates[:, 3, 0].tolist() == [1.0, 0.0]


def test_times_at_which_a_force_ends_and_returns_beside_a_stuck_object() -> None:
    scene = made(0.1, 0.01, left_arm=body(1.0, 0.02, stiffness_N_per_m=50.0), object=body(),
                 right_arm=body(10.0, -0.01, stiffness_N_per_m=500.0), object_friction={"coulomb_N": 100.0},
                 left_contact={"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 8.0},
                 right_contact={"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.1},
                 left_arm_table={"time_s": [0.0, 0.02], "force_N": [-30.0, 20.0]})
    low, high = (simulate(scene.changed({"left_arm.mass_kg": 1.0 + width})) for width in (-1e-6, 1e-6))
    found = derivatives(scene, "left_arm.mass_kg")
    assert found.event_table[:, 2].tolist() == [Transition.CLAMP, Transition.REENTRY]
    expected = (high.event_table[:, 0] - low.event_table[:, 0]) / 2e-6
    np.testing.assert_allclose(found.event_rates[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("name", ["case_01", "delay", "sine", "friction"])
def test_the_motion_is_that_of_a_plain_run(name: str) -> None:
    scene = horizon(name, 2.0)
    grid = np.linspace(0.0, 2.0, 37)
    plain = simulate(scene, grid=grid)
    found = differentiate(plain, [P if name != "sine" else "object.mass_kg"])
    assert found.state.tobytes() == plain.state.tobytes()
    assert found.event_table.tobytes() == plain.event_table.tobytes()


@pytest.mark.parametrize("sampled", [False, True])
def test_a_run_that_is_asked_has_its_derivatives(sampled: bool) -> None:
    scene, grid = horizon("case_01", 2.0), np.linspace(0.5, 2.0, 4)
    assert simulate(scene, grid=grid, sampled=sampled).sensitivity is None
    run = simulate(scene, grid=grid, sampled=sampled, sensitivity=[P])
    assert run.sensitivity is not None
    found = differentiate(replace(run, sensitivity=None), [P])
    assert run.sensitivity.state_rates.tobytes() == found.state_rates.tobytes()
    assert run.state.tobytes() == run.sensitivity.state.tobytes()


def test_a_run_of_something_else_has_no_derivatives() -> None:
    scene = horizon("case_01", 2.0)
    change = {500: {"left_feedback.velocity_gain_Ns_per_m": 5.0}}
    for settings in ({"method": "dopri5"}, {"controllers": {"left": lambda tick, time, x, v: -x}},
                     {"changes": change, "sampled": True}):
        with pytest.raises(Refused, match="sensitivity: allowed: the method exact"):
            simulate(scene, sensitivity=[P], **settings)
    with pytest.raises(Refused, match="with the scene's own controllers"):
        differentiate(simulate(scene, sampled=True, changes=change), [P])
    alone = {250: {"left_feedback.velocity_gain_Ns_per_m": 5.0}}
    with pytest.raises(Refused, match="with the scene's own controllers"):  # no event tells
        differentiate(simulate(horizon("arm_alone", 1.0), sampled=True, changes=alone), ["left_arm.mass_kg"])
    with pytest.raises(Refused, match="work"):
        simulate(scene, sensitivity=[P], max_work=10)
    with pytest.raises(Refused, match="sensitivity: nothing; allowed: keys of the scene"):
        simulate(scene, sensitivity=[])


def test_directions_do_not_touch_each_other() -> None:
    scene = horizon("case_01", 3.0)
    keys = ["left_arm.mass_kg", P, "object.position_m", "right_arm.stiffness_N_per_m", "object.mass_kg"]
    several = derivatives(scene, *keys)
    for j, key in enumerate(keys):
        alone = derivatives(scene, key)
        np.testing.assert_allclose(several.state_rates[..., j], alone.state_rates[..., 0], rtol=1e-13, atol=0.0)


@pytest.mark.parametrize(("name", "key", "width"), [
    ("preload", "left_arm.mass_kg", 1e-6), ("preload", "left_contact.hertz_N_per_m1_5", 1e-2),
    ("preload", "left_feedback.set_point_m", 1e-8), ("hammer", "object.mass_kg", 1e-6),
])
def test_rates_of_the_energy(name: str, key: str, width: float) -> None:
    scene = horizon(name, 0.8)
    section, _, number = key.partition(".")
    value = scene.values[section][number]
    low, high = (simulate(scene.changed({key: at}), grid=[0.8]).energy.V_c[-1] for at in (value - width, value + width))
    found = derivatives(scene, key)
    np.testing.assert_allclose(found.V_c_rates[-1, 0], (high - low) / (2.0 * width), rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(("name", "key", "word"), [
    ("case_01", "left_arm.colour", "not in this scene"), ("case_01", "time.duration_s", "no derivative"),
    ("noise", P, "sensor quantises"), ("sine", "object_sine.frequency_Hz", "phase_rad"),
    ("table", "left_arm_table.force_N", "a list"), ("delay", "loop.delay_ticks", "whole"),
    ("friction", "object_friction.coulomb_N", "no derivative at 0"),
    ("delay", "left_sensor.position_noise_m", "no derivative at 0"),
])
def test_what_has_no_derivative_is_refused(name: str, key: str, word: str) -> None:
    """Friction and noise of 0 are left out of the system."""
    off = [f"{key}=0"] if word.endswith("at 0") else []
    scene = scenes.load(name, [*off, "left_sensor.noise_seed=3"] if "noise" in key else off)
    with pytest.raises(Refused, match=word):
        derivatives(scene, key)


def test_an_object_that_could_as_well_stay_is_flagged(command: Any, tmp_path: Path) -> None:
    scene = made(0.1, 0.001, object=body(), left_arm=body(1.0, -1.0), object_friction={"coulomb_N": 0.2},
                 tilt={"angle_rad": 0.1, "gravity_m_per_s2": 9.81})
    assert derivatives(scene, "object.velocity_m_per_s").corner == 0.0
    words = "the object starts at rest under a force beyond its friction"
    assert derivatives(scene, "object_friction.coulomb_N").corner is None
    (tmp_path / "corner.yaml").write_text(scene.to_yaml(), "utf-8")
    key = "object.velocity_m_per_s"
    asked = "simulate", "corner.yaml", "--sensitivity", key
    found = json.loads(command(*asked, "--json").stdout)["sensitivity"][key]
    assert (found["corner"], found["corner_reason"], found["events"]) == (0.0, words, [])
    assert f"from t = 0 s on: {words}" in " ".join(command(*asked).stdout.split())


@pytest.mark.parametrize(("limit", "corner"), [(1.5, 0.0), (1.4, None), (1.6, None)])
def test_a_command_just_at_its_limit_is_flagged(limit: float, corner: float | None) -> None:
    scene = scenes.load("case_01", ["time.duration_s=0.01", "loop={}", f"left_actuator.limit_N={limit}"])
    assert scene.system.laws[LEFT].command(0, scene.initial_state[0], 0.0) == min(limit, 1.5)
    found = derivatives(scene, "left_arm.position_m")
    assert found.corner == corner
    assert found.corner_reason == (None if corner is None else "a command is just at its limit")


def test_what_is_printed_as_data_are_the_derivatives(command: Any) -> None:
    words = "simulate", "case_01", "--set", "time.duration_s=1", "--sensitivity", P, "--json"
    printed, found = json.loads(command(*words).stdout)["sensitivity"][P], derivatives(horizon("case_01", 1.0), P)
    assert (printed["state"], printed["corner"]) == (found.state_rates[-1, :, 0].tolist(), None)
    assert [event["rate"] for event in printed["events"]] == found.event_rates[:, 0].tolist()
    assert {event["kind"] for event in printed["events"]} == {"TOUCH", "RELEASE"}


@pytest.mark.parametrize(("stiffness", "corner"), [(0.0, 0.0), (1.0, None)])
def test_a_pair_that_glides_where_its_force_ends_is_flagged(stiffness: float, corner: float | None) -> None:
    """At u' = -1/p for good: a smaller p gives a force, a larger one none."""
    scene = made(0.01, 0.001, object=body(), left_arm=body(1.0, 0.5, -4.0, stiffness_N_per_m=stiffness),
                 left_contact={"hertz_N_per_m1_5": 100.0, "dissipation_s_per_m": 0.25})
    found = derivatives(scene, P)
    assert found.corner == corner
    assert found.corner_reason == (None if corner is None else "a pair starts at u' = -1/p and nothing moves it off")
    assert derivatives(scene, "left_arm.position_m").corner is None


def test_spectrum_of_a_damped_arm_and_of_an_elastic_grasp() -> None:
    arm = scenes.load("arm_alone")
    left = arm.values["left_arm"]
    decay = (left["damping_Ns_per_m"] + arm.values["left_feedback"]["velocity_gain_Ns_per_m"]) / (2.0 * left["mass_kg"])
    bound = 2.0 / arm.duration  # what the first and the last direction may differ by
    assert np.abs(spectrum(arm) + decay).max() <= bound
    assert spectrum(arm).sum() == pytest.approx(-2.0 * decay, rel=1e-9)
    elastic = spectrum(horizon("case_02", 10.0))
    assert elastic.sum() == pytest.approx(0.0, abs=1e-9)
    assert elastic[0] > 0.3
    stiff = arm.changed({"left_arm.damping_Ns_per_m": 300.0})  # which nothing is left of after half a second
    rates = np.linalg.eigvals([[0.0, 1.0], -stiff.system.closed_loop[LEFT, [Of.STIFFNESS, Of.DAMPING]]])
    assert spectrum(stiff) == pytest.approx(np.sort(rates)[::-1], abs=bound)
    with pytest.raises(Refused, match=r"nearly parallel within 0\.000153 s; allowed: slower decay, or a shorter"):
        spectrum(arm.changed({"left_arm.damping_Ns_per_m": 1e12}))
    slides = horizon("friction", 1.0).changed({
        "left_arm.damping_Ns_per_m": 300.0, "object_friction.coulomb_N": 1e-9, "object.velocity_m_per_s": 1.0})
    assert spectrum(slides) == pytest.approx(spectrum(slides.changed({"object_friction.coulomb_N": 0.0})), abs=1e-6)


def test_spectrum_of_tangents_that_grow_and_fall_again_within_a_piece() -> None:
    """A light object bounces 24 times between arms that close; they sum to the mean divergence of the motion."""
    arms = {"left": (0.57, -6e-5, 0.0054, 3e4, 55.0), "right": (1.5e4, 5e-4, 0.0034, 5e7, 0.0)}
    contacts = {"left": (6e9, 0.18), "right": (2e6, 13.0)}
    scene = made(0.032, object=body(4e-5, 0.0, 0.0056), **{
        f"{side}_arm": body(*arm[:3], stiffness_N_per_m=arm[3], damping_Ns_per_m=arm[4]) for side, arm in arms.items()
    }, **{f"{side}_contact": {"hertz_N_per_m1_5": H, "dissipation_s_per_m": p} for side, (H, p) in contacts.items()})
    found = spectrum(scene)
    run = simulate(scene, grid=np.linspace(0.0, 0.032, 2_000_001))
    rate = np.full(len(run.t), 55.0 / 0.57)
    for side, (hertzian, loss), mass in ((0, contacts["left"], 0.57), (1, contacts["right"], 1.5e4)):
        u, d = (run.state[:, 2 * side + k] - run.state[:, 2 * side + 2 + k] for k in (0, 1))
        acts = (u > 0.0) & (1.0 + loss * d > 0.0)
        rate += np.where(acts, hertzian * loss * np.maximum(u, 0.0) ** 1.5, 0.0) * (1.0 / mass + 1.0 / 4e-5)
    assert found.sum() == pytest.approx(-np.trapezoid(rate, run.t) / 0.032, rel=1e-5)
    assert found == pytest.approx(spectrum(scene, accuracy=1e-12), rel=1e-5)


@pytest.mark.parametrize("duration", [1.0, 4.0])
def test_spectrum_of_an_object_that_sticks_is_that_of_the_directions_that_are_left(duration: float) -> None:
    """The one that is lost may be in their midst."""
    scene = horizon("friction", duration)
    keys = ("left_arm.position_m", "left_arm.velocity_m_per_s", "object.position_m", "right_arm.position_m",
            "right_arm.velocity_m_per_s")
    grown = np.abs(np.diag(np.linalg.qr(derivatives(scene, *keys).state_rates[-1])[1]))
    assert spectrum(scene) == pytest.approx([*np.sort(np.log(grown) / duration)[::-1], -math.inf], abs=1e-6)


def test_times_of_sides_in_a_mirror() -> None:
    found = derivatives(horizon("v_jump_symmetric", 1.0), P, P.replace("left", "right"))
    left = found.event_table[:, 1] == LEFT
    np.testing.assert_allclose(found.event_rates[left][:, 0], found.event_rates[~left][:, 1], rtol=1e-9, atol=1e-12)

"""The domain: each rule refuses just outside and accepts just inside; what people write lies inside."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.domain import RANGES, RULES, SMALLEST, Systems, outside
from grasp_ros.physics.layout import EPS
from grasp_ros.scene import Scene, SceneError
from grasp_ros.scene.effects import EFFECTS
from grasp_ros.simulation import simulate
from grasp_ros.simulation.chunk import Variants
from lab.oracles.metamorphic import scaled


def grasp(seconds: float = 1.0, **numbers: dict[str, float]) -> Scene:
    """Two free arms of 1 kg, an object of 1 kg and contacts with p = 0.1, but for the numbers given by section."""
    body = {"mass_kg": 1.0, "velocity_m_per_s": 0.0}
    contact = {"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.1}
    sections: dict[str, dict[str, Any]] = {
        "time": {"duration_s": seconds, "control_period_s": min(seconds, 1e3)},
        "left_arm": body | {"position_m": -0.3}, "object": body | {"position_m": 0.0},
        "right_arm": body | {"position_m": 0.5}, "left_contact": contact, "right_contact": contact,
    }
    if "time" in numbers:
        numbers["time"]["control_period_s"] = numbers["time"]["duration_s"] / 1e4
    return scenes.compose("grasp", sections | {key: sections.get(key, {}) | own for key, own in numbers.items()})


ROUNDING = EPS * 0.5  # of the largest position
PUSH = {"position_gain_N_per_m": 0.0, "velocity_gain_Ns_per_m": 0.0}
LOSSLESS = {"dissipation_s_per_m": 0.0}
HELD = {"stiffness_N_per_m": 15.0, "damping_Ns_per_m": 6.0, "position_m": 0.0}
SQUEEZED = {"left_arm": HELD, "right_arm": HELD, "left_feedback": PUSH | {"feed_forward_N": 1.0},
            "right_feedback": PUSH | {"feed_forward_N": -1.0}}
Sections = dict[str, dict[str, float]]
EDGES: tuple[tuple[str, str, float, float, Sections], ...] = (  # rule, key, inside, outside, the rest
    ("gap or depth", "left_arm.position_m", -1.01e-3 * ROUNDING, -0.99e-3 * ROUNDING, {}),
    ("gap or depth", "left_arm.position_m", 0.0, 5e-324, {}),
    ("relative speed", "left_arm.velocity_m_per_s", 1.01e-3 * EPS, 0.99e-3 * EPS,
     {"left_arm": {"position_m": 0.0}, "right_arm": {"velocity_m_per_s": -1.0}}),
    ("relative speed", "left_arm.velocity_m_per_s", SMALLEST, 0.9 * SMALLEST, {"left_arm": {"position_m": 0.0}}),
    ("mass of the arm", "right_arm.mass_kg", 0.99e9, 1e9, {"object": {"mass_kg": 0.995e-3}}),
    ("mass of the arm", "left_arm.mass_kg", 1.01e-12, 1e-12, {"object": {"mass_kg": 1.005}}),
    ("sqrt(k/m)", "time.duration_s", 0.99e6, 1.01e6, {"right_arm": {"stiffness_N_per_m": 1e12, "position_m": 0.0}}),
    ("speed that a body reaches", "left_arm.mass_kg", 1.01e-2, 0.99e-2,
     {"left_feedback": PUSH | {"feed_forward_N": 1e8}, "left_contact": LOSSLESS}),
    ("speed at which a pair", "left_arm.position_m", 109.0, 110.0,
     {"object": {"mass_kg": 1e-5}, "left_contact": LOSSLESS | {"hertz_N_per_m1_5": 1e10}}),
    ("p J / mu", "left_contact.dissipation_s_per_m", 0.99e8, 1.01e8, {"object": {"velocity_m_per_s": -1.0}}),
    ("p J / mu", "left_contact.dissipation_s_per_m", 1.57e5, 1.59e5, {"left_arm": {"position_m": 0.1}}),
    ("p J / mu", "right_contact.dissipation_s_per_m", 3.3e7, 3.4e7,
     {"left_feedback": PUSH | {"feed_forward_N": 1.0}, "right_feedback": PUSH | {"feed_forward_N": -1.0}}),
    ("p J / mu", "left_contact.dissipation_s_per_m", 2.9e4, 3e4, {"time": {"duration_s": 1e6}, **SQUEEZED}),
)


def numbers_with(key: str, value: float, rest: Sections) -> Sections:
    section, name = key.split(".")
    return rest | {section: rest.get(section, {}) | {name: value}}


@pytest.mark.parametrize(("rule", "key", "inside", "beyond", "rest"), EDGES)
def test_a_rule_accepts_just_inside_and_refuses_just_outside(
    rule: str, key: str, inside: float, beyond: float, rest: Sections
) -> None:
    scene = grasp(**numbers_with(key, inside, rest))
    found = [own for own in RULES if own.text.startswith(rule)]
    with pytest.raises(SceneError) as caught:
        grasp(**numbers_with(key, beyond, rest))
    assert all(part in str(caught.value) for part in (f"grasp: {key}: {beyond!r}", found[0].text, found[0].allowed))
    assert "\n" not in str(caught.value)
    changes = {key: [inside, beyond]}
    if key == "time.duration_s":
        changes["time.control_period_s"] = [inside / 1e4, beyond / 1e4]
    assert Variants(scene, changes).faults() == {1: str(caught.value)}


@pytest.mark.parametrize("loss", [3.0, 100.0])
def test_a_grasp_that_its_springs_hold_at_rest_may_be_held_for_long(loss: float) -> None:
    """It was refused by an impulse that counted its forces for the whole run."""
    numbers = {f"{side}_contact.dissipation_s_per_m": loss for side in ("left", "right")}
    run = simulate(scenes.load("preload").changed({"time.duration_s": 1e6, **numbers}), grid=[0.0, 1e6])
    assert run.at_rest is not None
    assert run.at_rest < 20.0
    assert sum(run.counters.values()) < 1000


def test_a_measure_close_to_its_bound_is_told_with_its_digits() -> None:
    with pytest.raises(SceneError, match=r"duration is 10000000000\d\d.\d+; allowed: at most 1e\+12"):
        grasp(time={"duration_s": 1e6}, right_arm={"stiffness_N_per_m": 1e12, "mass_kg": 1.0 - 1e-11})


def test_every_rule_has_an_edge() -> None:
    assert all(any(rule.text.startswith(name) for name, *_ in EDGES) for rule in RULES)


def test_a_number_close_to_zero_is_refused_where_it_does_not_decay() -> None:
    with pytest.raises(SceneError, match=r"left_arm.stiffness_N_per_m: 1e-40 is not allowed; .*>= 1e-36 or 0"):
        grasp(left_arm={"stiffness_N_per_m": 1e-40})
    assert Variants(grasp(left_arm={"stiffness_N_per_m": 0.0}), {"left_arm.stiffness_N_per_m": [0.0, 1e-40]}).faults()
    grasp(left_arm={"velocity_m_per_s": 1e-279})


def test_the_ranges_of_the_keys_are_those_of_the_domain() -> None:
    bounds = {own.bounds for own in RANGES.values()} | {(0.0, RANGES["force"].high)}
    keys = ("_kg", "_m1_5", "_m_per_s", "_s_per_m", "_N", "_per_m", "duration_s", "period_s", "position_m", "_point_m")
    for effect in EFFECTS:
        for parameter in effect.parameters:
            if parameter.key.endswith(keys) and not effect.section.endswith("sensor"):
                assert (parameter.low, parameter.high) in bounds, parameter.key


@pytest.mark.parametrize("name", scenes.names())
def test_the_scenes_of_the_package_are_inside(name: str) -> None:
    scene = scenes.load(name)
    assert outside(scene.system, scene.duration) is None
    assert outside(scene.system, 1e6) is None


def test_hard_scenes_that_a_person_would_write_are_inside() -> None:
    for hertz, speed, loss in itertools.product((1.0, 1e4, 1e12), (1e-6, 1.0, 1e3), (0.0, 1.0, 100.0)):
        contact = {"hertz_N_per_m1_5": hertz, "dissipation_s_per_m": loss / speed}
        for gap, seconds in ((0.0, 1e-3), (0.3, 1e6), (EPS, 1.0)):
            grasp(seconds, left_contact=contact, right_contact=contact,
                  left_arm={"velocity_m_per_s": speed, "position_m": -gap})
    for mass in (1e-6, 1e6):
        grasp(1e6, object={"mass_kg": mass}, left_arm={"stiffness_N_per_m": 15.0, "damping_Ns_per_m": 0.7})


def test_the_rules_do_not_depend_on_units() -> None:
    """Ratios do not change, to the bit, if lengths are in units of 4 m, times in 2 s and masses in 0.5 kg."""
    here = grasp(left_arm={"velocity_m_per_s": 0.3, "stiffness_N_per_m": 3.0})
    there = scaled(here, 4.0, 2.0, 0.5)
    for rule in RULES:
        if not rule.unit:
            one, other = (rule.measure(rows(scene)) for scene in (here, there))
            assert np.array_equal(one, other), rule.text


def test_a_shorter_run_is_inside_as_well() -> None:
    scene = grasp(1e6, left_arm={"stiffness_N_per_m": 3.0, "position_m": 0.01},
                  right_feedback=PUSH | {"feed_forward_N": -1.0})
    for rule in RULES:
        long, short = (rule.measure(rows(scene, seconds)) for seconds in (1e6, 1.0))
        assert (short <= long).all()


def test_what_is_no_number_is_outside() -> None:
    system = grasp().system
    state = system.state.copy()
    state[0] = math.nan
    assert outside(replace(system, state=state), 1.0) is not None


def rows(scene: Scene, seconds: float | None = None) -> Systems:
    system = scene.system
    return Systems(system.closed_loop[None], system.pairs[None], system.state[None], seconds or scene.duration)

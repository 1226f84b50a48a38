"""What a scene may not say: each refusal names the file, the key, the value and the range."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Collection

import numpy as np
import pytest
import yaml
from documents import BASE, document, text_with

from grasp_ros.physics.domain import SMALLEST
from grasp_ros.scene import compose, load, parse
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.scene.effects.base import Parameter
from grasp_ros.scene.validation import SceneError

EVERY = [(section, parameter) for section in BASE if section in BY_SECTION
         for parameter in BY_SECTION[section].parameters if parameter.key in BASE[section]]
IDS = [f"{section}.{parameter.key}" for section, parameter in EVERY]


def refused(text: str, *words: str, settings: tuple[str, ...] = ()) -> None:
    """The text must be refused with a message of one line that contains the words."""
    with pytest.raises(SceneError) as caught:
        parse(text, "bad", "dir/bad.yaml", settings)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_parameter_is_refused_outside_its_range(section: str, parameter: Parameter) -> None:
    low, high = (float(word) for word in re.findall(r"[<>]=? (\S+?)(?:,|$| and)", parameter.allowed)[:2])
    assert (low, high) == (parameter.low, parameter.high)
    outside = [np.nextafter(parameter.high, math.inf).item(), 10.0 * parameter.high]
    below = parameter.low if parameter.open_low else np.nextafter(parameter.low, -math.inf).item()
    outside += [below, parameter.low - 1.0 - 10.0 * abs(parameter.low)]
    if parameter.has_smallest:
        outside += [math.nextafter(SMALLEST, 0.0), 5e-324]
    for value in outside:
        where, said = f"{section}.{parameter.key}", f"allowed: {parameter.allowed}"
        refused(document(section, parameter.key, value), "dir/bad.yaml", where, repr(value), said)


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_parameter_is_refused_if_it_is_no_number(section: str, parameter: Parameter) -> None:
    where = f"{section}.{parameter.key}"
    for value in (math.nan, math.inf, -math.inf, True, False, None, "5", "5 kg", [1.0], {"a": 1}):
        refused(document(section, parameter.key, value), "dir/bad.yaml", where, repr(value), "allowed: a number")


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_parameter_has_accepted_values(section: str, parameter: Parameter) -> None:
    """Both ends of its range, and the smallest number, beside bodies at rest and without springs."""
    if section == "time":
        return
    partner = {"position_gain_N_per_m": "stiffness_N_per_m", "velocity_gain_Ns_per_m": "damping_Ns_per_m"}
    for value in (parameter.low, max(parameter.low, SMALLEST), parameter.high):
        bodies = {body: {"mass_kg": 1.0, "position_m": x, "velocity_m_per_s": 0.0}
                  for body, x in (("left_arm", -0.3), ("object", 0.0), ("right_arm", 0.5))}
        if parameter.key in partner:
            bodies[section.replace("feedback", "arm")][partner[parameter.key]] = 1e12
        numbers = {"time": BASE["time"], **bodies, section: BASE[section] | {parameter.key: value}}
        assert compose("edge", numbers).values[section][parameter.key] == value


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_key_is_needed_unless_it_is_optional(section: str, parameter: Parameter) -> None:
    changed = copy.deepcopy(BASE)
    del changed[section][parameter.key]
    if parameter.optional:
        scene = parse(yaml.safe_dump(changed), "less", "less.yaml")
        assert parameter.key not in scene.values[section]
    else:
        refused(yaml.safe_dump(changed), "dir/bad.yaml", f"{section}.{parameter.key}", "missing", "allowed")


@pytest.mark.parametrize(("gone", "words"), [
    *(([key], [key, "missing", "allowed"]) for key in ("title", "readings", "time")),
    *(([key], [by, f"needs {key}", "allowed"])
      for key, by in (("left_arm", "left_feedback"), ("object", "left_contact"), ("right_arm", "right_feedback"))),
    (BASE.keys() - {"title", "readings", "time"}, ["no body", "left_arm"]),
])
def test_what_is_needed_is_missed(gone: Collection[str], words: list[str]) -> None:
    refused(yaml.safe_dump({name: value for name, value in BASE.items() if name not in gone}), "dir/bad.yaml", *words)


@pytest.mark.parametrize(("text", "words"), [
    (text_with("mass_kg: 1.0", "mass: 1.0"), ["left_arm.mass", "1.0", "mass_kg"]),  # without its unit
    (text_with("mass_kg: 1.0", "mass_g: 1000.0"), ["left_arm.mass_g", "1000.0", "mass_kg"]),
    (text_with("mass_kg: 1.0", "mass_kg: 1.0\n  colour: 3"), ["left_arm.colour", "3", "allowed: left_arm.mass_kg"]),
    (text_with("mass_kg: 1.0", "mass_kg: 1.0\n  mass_kg: 2.0"), ["mass_kg", "twice"]),
    (text_with("object:", "left_arm:"), ["left_arm", "twice"]),
    (text_with("object:", "gravity: 9.81\nobject:"), ["gravity", "9.81", "allowed"]),
    (text_with("mass_kg: 1.0", "1: 1.0"), ["left_arm.1", "unknown key with the value 1.0"]),
    (text_with("mass_kg: 1.0", "mass_kg: 1,0"), ["left_arm.mass_kg", "1,0"]),
    (text_with("mass_kg: 1.0", "mass_kg: 1e400"), ["left_arm.mass_kg", "inf"]),
    (yaml.safe_dump({**BASE, "title": 4}), ["title", "4", "a text"]),
    (yaml.safe_dump({**BASE, "readings": "one"}), ["readings", "'one'", "a list"]),
    (yaml.safe_dump({**BASE, "readings": [1]}), ["readings", "[1]"]),
    (yaml.safe_dump({**BASE, "object": 5}), ["object", "5", "a mapping"]),
    (yaml.safe_dump({**BASE, "object": None}), ["object", "None", "a mapping"]),
    ("", ["not a mapping"]),
    ("- 1\n- 2\n", ["not a mapping"]),
    ("just text", ["not a mapping"]),
    ("a: b: c", []),
    ("? [1, 2]\n: 3\n", []),  # a list as a key
    ("? {a: 1}\n: 3\n", []),
])
def test_wrong_files_are_refused(text: str, words: list[str]) -> None:
    refused(text, "dir/bad.yaml", *words)


@pytest.mark.parametrize(("section", "key", "value", "words"), [
    ("left_feedback", "position_gain_N_per_m", -10.1, ["left_arm", "stiffness", "sum >= 0"]),
    ("right_feedback", "velocity_gain_Ns_per_m", -0.21, ["right_arm", "damping", "sum >= 0"]),
    ("time", "duration_s", 20.0005, ["time.duration_s", "20.0005", "whole number of control periods", "0.001"]),
    ("time", "control_period_s", 0.003, ["time.duration_s", "0.003"]),
    ("time", "control_period_s", 30.0, ["time.duration_s", "30.0"]),
    ("time", "control_period_s", 1e-10, ["time.control_period_s", "1e-10", "whole nanoseconds"]),
    ("time", "control_period_s", 1.5e-9, ["time.control_period_s", "whole nanoseconds"]),
    ("time", "duration_s", 1 / 3, ["time.duration_s", "whole nanoseconds"]),
])
def test_impossible_combinations_are_refused(section: str, key: str, value: float, words: list[str]) -> None:
    refused(document(section, key, value), "dir/bad.yaml", repr(value) if section == "time" else "", *words)


@pytest.mark.parametrize(("name", "settings", "words"), [
    ("case_01", ["left_arm.mass=2"], ["left_arm.mass=2", "no such key", "left_arm.mass_kg"]),
    ("case_01", ["arm.mass_kg=2"], ["arm.mass_kg=2", "no such key"]),
    ("case_01", ["mass_kg=2"], ["mass_kg=2", "section.key=value"]),
    ("case_01", ["left_arm.mass_kg"], ["left_arm.mass_kg", "section.key=value"]),
    ("case_01", [""], ["section.key=value"]),
    ("case_01", ["left_arm.mass_kg="], ["left_arm.mass_kg", "allowed"]),
    ("case_01", ["left_arm.mass_kg=two"], ["left_arm.mass_kg", "two", "allowed"]),
    ("case_01", ["left_arm.mass_kg=-1"], ["left_arm.mass_kg", "-1", "allowed"]),
    ("case_01", ["left_arm.mass_kg=nan"], ["left_arm.mass_kg", "nan"]),
    ("case_01", ["left_arm.mass_kg=.nan"], ["left_arm.mass_kg", "nan"]),
    ("case_01", ["left_arm.mass_kg=true"], ["left_arm.mass_kg", "True"]),
    ("case_01", ["left_arm.mass_kg='5'"], ["left_arm.mass_kg", "'5'"]),
    ("case_01", ["left_arm.mass_kg=["], ["left_arm.mass_kg"]),
    ("case_01", ["left_arm.mass_kg={1: 2, 1: 3}"], ["left_arm.mass_kg"]),
    ("case_01", ["time.duration_s=0.0015"], ["time.duration_s", "0.0015"]),
    ("case_01", ["title.x=1"], ["title.x=1", "no such key"]),
    ("case_01", ["loop="], ["setting loop=: not understood; allowed: section.key=value, or section={}"]),
    ("case_01", ["loop=5"], ["setting loop=5: not understood"]),
    ("case_01", ["loop={1}"], ["setting loop={1}: not understood"]),
    ("case_01", ["loop={delay_ticks: 2}"], ["not understood"]),
    ("case_01", ["title={}"], ["setting title={}: no such section; did you mean tilt or time?"]),
    ("case_01", ["wind={}"], ["setting wind={}: no such section"]),
    ("case_01", ["left_actuator={}"], ["left_actuator.limit_N: missing"]),
    ("case_01", ["loop.delay_ticks={}"], ["loop.delay_ticks: {} is not allowed; allowed: a whole number"]),
    ("delay", ["loop={}"], ["setting loop={}: loop has numbers, which stay; allowed: loop.key=value"]),
    *(("case_01", twice, ["given 2 times; allowed: once"])
      for twice in (["object.mass_kg=5", "object.mass_kg=6"], ["loop={}", "loop={}"])),
    # a staircase of control periods must show the sine
    ("sine", ["object_sine.frequency_Hz=500.1"], ["object_sine.frequency_Hz: 500.1", "allowed: at most 500.0 Hz"]),
    ("sine", ["time.control_period_s=0.2"], ["object_sine.frequency_Hz: 3.0", "at most 2.5 Hz"]),
    ("pulse", ["object_pulse.start_s=0.0005"], ["object_pulse.start_s", "whole control periods"]),
    ("table", ["left_arm_table.time_s=[0.0, 2.0, 1.0]"], ["left_arm_table.time_s", "ascending"]),
    ("table", ["left_arm_table.force_N=[1.0]"], ["left_arm_table.force_N", "as many forces as times, 3"]),
    ("table", ["left_arm_table.force_N=[]"], ["left_arm_table.force_N", "a list"]),
    ("table", ["left_arm_table.force_N=3.0"], ["left_arm_table.force_N", "a list"]),
    ("delay", ["loop.delay_ticks=1.5"], ["loop.delay_ticks", "a whole number"]),
    ("delay", ["loop.delay_ticks=-1"], ["loop.delay_ticks", ">= 0"]),
    ("case_01", ["left_actuator.limit_N=1.0"], ["left_actuator", "needs loop"]),
    ("case_01", ["left_sensor.noise_seed=1"], ["left_sensor", "needs loop"]),
    ("hammer", ["right_arm_pulse.force_N=1", "right_arm_pulse.start_s=0", "right_arm_pulse.length_s=1"],
     ["right_arm_pulse", "needs right_arm"]),
    ("noise", ["left_sensor.position_step_m=0"], ["left_sensor.position_step_m", ">= 1e-12"]),
    ("pulse", ["object_pulse.length_s=1e-10"], ["object_pulse.length_s", "whole control periods"]),
    ("noise", ["left_sensor.noise_seed=1.5"], ["left_sensor.noise_seed", "a whole number"]),
])
def test_bad_settings_are_refused(name: str, settings: list[str], words: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        load(name, settings)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_setting_in_a_broken_section_is_refused() -> None:
    refused(yaml.safe_dump({**BASE, "object": 5}), "object", settings=("object.mass_kg=2",))

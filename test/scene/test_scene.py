"""Scenes: what is accepted, and that everything else is refused with the file, the key, the value and the range."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from oracles import CASES

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene, load, parse
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.scene.parameter import Parameter
from grasp_ros.scene.validation import SceneError

BASE: dict[str, Any] = yaml.safe_load(load("case_01").to_yaml())
EVERY = [(section, parameter) for section in BASE if section in BY_SECTION
         for parameter in BY_SECTION[section].parameters if parameter.key in BASE[section]]
IDS = [f"{section}.{parameter.key}" for section, parameter in EVERY]


def document(section: str, key: str, value: Any) -> str:
    """Case 1 with one number replaced."""
    result = copy.deepcopy(BASE)
    result[section][key] = value
    return yaml.safe_dump(result, sort_keys=False)


def text_with(old: str, new: str) -> str:
    """Case 1 with one line replaced as text."""
    text = load("case_01").to_yaml()
    assert text.count(old) >= 1
    return text.replace(old, new, 1)


def refused(text: str, *words: str, settings: tuple[str, ...] = ()) -> None:
    """The text must be refused with a message of one line that contains the words."""
    with pytest.raises(SceneError) as caught:
        parse(text, "bad", "dir/bad.yaml", settings)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def bits(scene: Scene) -> list[str]:
    """Every number as its bits."""
    return [value.hex() for table in scene.values.values() for value in table.values()]


# The table of design.md: what differs from case 1, by section and key.
BOTH = ("left", "right")
SYMMETRIC = {("left_arm", "position_m"): -0.5, ("right_arm", "position_m"): 0.5}
CHANGES: dict[str, dict[tuple[str, str], float]] = {
    "case_01": {},
    "case_02": {
        (f"{s}_{what}", key): 0.0
        for s in BOTH
        for what, key in (
            ("arm", "damping_Ns_per_m"),
            ("feedback", "velocity_gain_Ns_per_m"),
            ("contact", "dissipation_s_per_m"),
        )
    },
    "case_03": {
        (f"{s}_{what}", key): 0.0
        for s in BOTH
        for what, key in (("arm", "damping_Ns_per_m"), ("feedback", "velocity_gain_Ns_per_m"))
    },
    "case_04": {(f"{s}_contact", "dissipation_s_per_m"): 1.0 for s in BOTH},
    "case_05": {**SYMMETRIC, **{(f"{s}_arm", "mass_kg"): 10.0 for s in BOTH}},
    "case_06": {**SYMMETRIC, ("left_arm", "mass_kg"): 10.0},
    "case_07": {**SYMMETRIC, **{(f"{s}_arm", "stiffness_N_per_m"): 100.0 for s in BOTH}},
    "case_08": {**SYMMETRIC, **{(f"{s}_arm", "damping_Ns_per_m"): 2.0 for s in BOTH}},
    "case_09": {(f"{s}_feedback", "position_gain_N_per_m"): 50.0 for s in BOTH},
    "case_10": {(f"{s}_feedback", "velocity_gain_Ns_per_m"): 5.0 for s in BOTH},
    "case_11": {("object", "mass_kg"): 50.0},
}
ARM = {"mass_kg": 1.0, "stiffness_N_per_m": 10.0, "damping_Ns_per_m": 0.2, "velocity_m_per_s": 0.0}
CONTACT = {"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.1}
FEEDBACK = {"position_gain_N_per_m": 5.0, "velocity_gain_Ns_per_m": 0.5}
TABLE_1 = {
    "time": {"duration_s": 20.0, "control_period_s": 0.001},
    "left_arm": {**ARM, "position_m": -0.3},
    "object": {"mass_kg": 5.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
    "right_arm": {**ARM, "position_m": 0.5},
    "left_contact": CONTACT,
    "right_contact": CONTACT,
    "left_feedback": FEEDBACK,
    "right_feedback": FEEDBACK,
}


def test_all_cases_are_there() -> None:
    assert set(CASES) < set(scenes.names())


@pytest.mark.parametrize("name", CASES)
def test_numbers_of_the_paper(name: str) -> None:
    expected = {section: dict(table) for section, table in TABLE_1.items()}
    for (section, key), value in CHANGES[name].items():
        expected[section][key] = value
    scene = load(name)
    assert scene.name == name
    assert {section: dict(table) for section, table in scene.values.items()} == expected
    assert any("x_l(0)" in reading for reading in scene.readings)
    left, right = expected["left_arm"], expected["right_arm"]
    assert scene.initial_state.tolist() == [left["position_m"], 0.0, 0.0, 0.0, right["position_m"], 0.0]
    assert scene.grasp.object_mass == expected["object"]["mass_kg"]
    assert scene.grasp.left.mass == left["mass_kg"]
    assert scene.grasp.right.damping == right["damping_Ns_per_m"]
    assert scene.grasp.right_contact.dissipation == expected["right_contact"]["dissipation_s_per_m"]
    assert scene.grasp.left.position_gain == expected["left_feedback"]["position_gain_N_per_m"]
    assert (scene.period_ns, scene.ticks) == (1_000_000, 20_000)
    assert scene.time_of(scene.ticks) == 20.0


@pytest.mark.parametrize("name", CASES)
def test_round_trip_keeps_every_bit(name: str) -> None:
    scene = load(name)
    again = parse(scene.to_yaml(), name, "again")
    assert again == scene
    assert bits(again) == bits(scene)


@pytest.mark.parametrize("value", [0.1 + 0.2, 1e-300, 5e-324, 123456789.123456789, 1 / 3, 2.0**-40, 1e5, 1e16, 1e8 + 1])
def test_round_trip_of_awkward_numbers(value: float) -> None:
    scene = parse(document("left_arm", "stiffness_N_per_m", min(value, 1e12)), "odd", "odd.yaml")
    again = parse(scene.to_yaml(), "odd", "odd.yaml")
    assert bits(again) == bits(scene)


@pytest.mark.parametrize("negative", ["-0.0", "-1e-300"])
def test_round_trip_keeps_signs(negative: str) -> None:
    scene = parse(document("object", "velocity_m_per_s", float(negative)), "odd", "odd.yaml")
    assert parse(scene.to_yaml(), "odd", "odd.yaml").values["object"]["velocity_m_per_s"].hex() == float(negative).hex()


@pytest.mark.parametrize(
    "title", ["plain", "with: colon", "no", "1e4", "null", "# hash", "ä 'quote' \"two\"", " x ", "a\nb"]
)
def test_round_trip_of_awkward_texts(title: str) -> None:
    changed = {**BASE, "title": title, "readings": [title, "other"]}
    scene = parse(json.dumps(changed), "odd", "odd.yaml")
    again = parse(scene.to_yaml(), "odd", "odd.yaml")
    assert (again.title, again.readings) == (title, (title, "other"))


@pytest.mark.parametrize("written", ["10000", "1e4", "1E4", "1.0e+4", "10000.", "+1e4", "1e+4"])
def test_every_way_to_write_a_number(written: str) -> None:
    scene = parse(text_with("hertz_N_per_m1_5: 10000.0", f"hertz_N_per_m1_5: {written}"), "n", "n.yaml")
    value = scene.values["left_contact"]["hertz_N_per_m1_5"]
    assert value == 1e4
    assert type(value) is float


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_parameter_is_refused_outside_its_range(section: str, parameter: Parameter) -> None:
    outside = [np.nextafter(parameter.high, math.inf).item(), 10.0 * parameter.high]
    below = parameter.low if parameter.open_low else np.nextafter(parameter.low, -math.inf).item()
    outside += [below, parameter.low - 1.0 - 10.0 * abs(parameter.low)]
    for value in outside:
        refused(
            document(section, parameter.key, value),
            "dir/bad.yaml",
            f"{section}.{parameter.key}",
            repr(value),
            "allowed",
            f"{parameter.low:g}",
            f"{parameter.high:g}",
        )


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, True, False, None, "5", "5 kg", [1.0], {"a": 1}])
def test_every_parameter_is_refused_if_it_is_no_number(section: str, parameter: Parameter, value: Any) -> None:
    where = f"{section}.{parameter.key}"
    refused(document(section, parameter.key, value), "dir/bad.yaml", where, repr(value), "allowed: a number")


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_parameter_has_accepted_values(section: str, parameter: Parameter) -> None:
    if section == "time":
        return
    for value in (parameter.high, parameter.low if not parameter.open_low else 5e-324):
        partner = {"position_gain_N_per_m": "stiffness_N_per_m", "velocity_gain_Ns_per_m": "damping_Ns_per_m"}
        changed = yaml.safe_load(document(section, parameter.key, value))
        if parameter.key in partner:
            changed[section.replace("feedback", "arm")][partner[parameter.key]] = 1e12
        scene = parse(yaml.safe_dump(changed), "edge", "edge.yaml")
        assert scene.values[section][parameter.key] == value


@pytest.mark.parametrize(("section", "parameter"), EVERY, ids=IDS)
def test_every_key_is_needed_unless_it_is_optional(section: str, parameter: Parameter) -> None:
    changed = copy.deepcopy(BASE)
    del changed[section][parameter.key]
    if parameter.optional:
        scene = parse(yaml.safe_dump(changed), "less", "less.yaml")
        assert parameter.key not in scene.values[section]
    else:
        refused(yaml.safe_dump(changed), "dir/bad.yaml", f"{section}.{parameter.key}", "missing", "allowed")


@pytest.mark.parametrize("key", ["title", "readings", "time"])
def test_texts_and_time_are_needed(key: str) -> None:
    changed = {name: value for name, value in BASE.items() if name != key}
    refused(yaml.safe_dump(changed), "dir/bad.yaml", key, "missing", "allowed")


@pytest.mark.parametrize(
    ("gone", "by"),
    [("left_arm", "left_feedback"), ("object", "left_contact"), ("right_arm", "right_feedback")],
)
def test_what_another_section_needs_is_needed(gone: str, by: str) -> None:
    changed = {name: value for name, value in BASE.items() if name != gone}
    refused(yaml.safe_dump(changed), "dir/bad.yaml", by, f"needs {gone}", "allowed")


def test_a_scene_needs_a_body() -> None:
    refused(yaml.safe_dump({key: BASE[key] for key in ("title", "readings", "time")}), "no body", "left_arm")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (text_with("mass_kg: 1.0", "mass: 1.0"), ["left_arm.mass", "1.0", "mass_kg"]),  # without its unit
        (text_with("mass_kg: 1.0", "mass_g: 1000.0"), ["left_arm.mass_g", "1000.0", "mass_kg"]),
        (text_with("mass_kg: 1.0", "mass_kg: 1.0\n  colour: 3"), ["left_arm.colour", "3", "allowed"]),
        (text_with("mass_kg: 1.0", "mass_kg: 1.0\n  mass_kg: 2.0"), ["mass_kg", "twice"]),
        (text_with("object:", "left_arm:"), ["left_arm", "twice"]),
        (text_with("object:", "gravity: 9.81\nobject:"), ["gravity", "9.81", "allowed"]),
        (text_with("mass_kg: 1.0", "1: 1.0"), ["left_arm.1", "allowed"]),
        (text_with("mass_kg: 1.0", "mass_kg: 1,0"), ["left_arm.mass_kg", "1,0"]),
        (text_with("mass_kg: 1.0", "mass_kg: 1_000"), ["left_arm.mass_kg"]),
        (text_with("mass_kg: 1.0", "mass_kg: 0x10"), ["left_arm.mass_kg"]),
        (text_with("mass_kg: 1.0", "mass_kg: 1:30"), ["left_arm.mass_kg"]),
        (text_with("mass_kg: 1.0", "mass_kg: 017"), ["left_arm.mass_kg"]),
        (text_with("mass_kg: 1.0", "mass_kg: yes"), ["left_arm.mass_kg", "True"]),
        (text_with("mass_kg: 1.0", "mass_kg: !!python/object/apply:os.getcwd []"), []),
        (text_with("mass_kg: 1.0", "mass_kg: [1.0"), []),
        (text_with("mass_kg: 1.0", "mass_kg: " + "9" * 400), ["left_arm.mass_kg"]),
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
        ("\x00", []),
        ("? [1, 2]\n: 3\n", []),  # a list as a key
        ("? {a: 1}\n: 3\n", []),
        ("---\na: 1\n---\nb: 2\n", []),
    ],
)
def test_wrong_files_are_refused(text: str, words: list[str]) -> None:
    refused(text, "dir/bad.yaml", *words)


@pytest.mark.parametrize(
    ("section", "key", "value", "words"),
    [
        ("left_feedback", "position_gain_N_per_m", -10.1, ["left_arm", "stiffness", "sum >= 0"]),
        ("right_feedback", "velocity_gain_Ns_per_m", -0.21, ["right_arm", "damping", "sum >= 0"]),
        ("time", "duration_s", 20.0005, ["time.duration_s", "20.0005", "whole number of control periods", "0.001"]),
        ("time", "control_period_s", 0.003, ["time.duration_s", "0.003"]),
        ("time", "control_period_s", 30.0, ["time.duration_s", "30.0"]),
        ("time", "control_period_s", 1e-10, ["time.control_period_s", "1e-10", "whole nanoseconds"]),
        ("time", "control_period_s", 1.5e-9, ["time.control_period_s", "whole nanoseconds"]),
        ("time", "duration_s", 1 / 3, ["time.duration_s", "whole nanoseconds"]),
    ],
)
def test_impossible_combinations_are_refused(section: str, key: str, value: float, words: list[str]) -> None:
    refused(document(section, key, value), "dir/bad.yaml", repr(value) if section == "time" else "", *words)


def test_a_negative_gain_that_leaves_a_spring_is_allowed() -> None:
    assert (
        parse(document("left_feedback", "position_gain_N_per_m", -10.0), "n", "n.yaml").grasp.left.position_gain
        == -10.0
    )


@pytest.mark.parametrize("period", [0.001, 0.0005, 0.1, 1e-9, 20.0, 0.002])
def test_periods_that_divide_the_duration(period: float) -> None:
    scene = parse(document("time", "control_period_s", period), "n", "n.yaml")
    assert scene.ticks * scene.period_ns == 20 * 10**9


def test_settings_replace_numbers() -> None:
    scene = load("case_01", ["left_arm.mass_kg=2", "left_contact.dissipation_s_per_m=1e1", "left_arm.mass_kg=3.5"])
    assert scene.grasp.left.mass == 3.5
    assert scene.grasp.left_contact.dissipation == 10.0
    assert bits(scene)[0:2] == bits(load("case_01"))[0:2]
    assert load("case_01").grasp.left.mass == 1.0


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("left_arm.mass=2", ["left_arm.mass=2", "no such key", "left_arm.mass_kg"]),
        ("arm.mass_kg=2", ["arm.mass_kg=2", "no such key"]),
        ("mass_kg=2", ["mass_kg=2", "section.key=value"]),
        ("left_arm.mass_kg", ["left_arm.mass_kg", "section.key=value"]),
        ("", ["section.key=value"]),
        ("left_arm.mass_kg=", ["left_arm.mass_kg", "allowed"]),
        ("left_arm.mass_kg=two", ["left_arm.mass_kg", "two", "allowed"]),
        ("left_arm.mass_kg=-1", ["left_arm.mass_kg", "-1", "allowed"]),
        ("left_arm.mass_kg=nan", ["left_arm.mass_kg", "nan"]),
        ("left_arm.mass_kg=.nan", ["left_arm.mass_kg", "nan"]),
        ("left_arm.mass_kg=true", ["left_arm.mass_kg", "True"]),
        ("left_arm.mass_kg='5'", ["left_arm.mass_kg", "'5'"]),
        ("left_arm.mass_kg=[", ["left_arm.mass_kg"]),
        ("left_arm.mass_kg={1: 2, 1: 3}", ["left_arm.mass_kg"]),
        ("time.duration_s=0.0015", ["time.duration_s", "0.0015"]),
        ("title.x=1", ["title.x=1", "no such key"]),
    ],
)
def test_bad_settings_are_refused(setting: str, words: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        load("case_01", [setting])
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_setting_in_a_broken_section_is_refused() -> None:
    refused(yaml.safe_dump({**BASE, "object": 5}), "object", settings=("object.mass_kg=2",))


def test_files_and_names(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(load("case_04").to_yaml(), encoding="utf-8")
    scene = load(str(path))
    assert scene.name == "mine"
    assert bits(scene) == bits(load("case_04"))
    with pytest.raises(SceneError, match="no such file"):
        load(str(tmp_path / "none.yaml"))
    with pytest.raises(SceneError, match="case_01"):
        load("case_99")
    path.write_bytes(b"title: \xff\xfe\n")
    with pytest.raises(SceneError, match=r"mine\.yaml"):
        load(str(path))
    (tmp_path / "dir.yaml").mkdir()
    with pytest.raises(SceneError, match="no such file"):
        load(str(tmp_path / "dir.yaml"))

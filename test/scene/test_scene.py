"""Scenes: the numbers of the paper's cases, round trips of every bit, settings, files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from documents import BASE, document, text_with
from oracles import CASES

from grasp_ros.scene import Scene, load, parse


def bits(scene: Scene) -> list[str]:
    """Every number as its bits."""
    return [value.hex() for table in scene.values.values() for value in table.values()]


SYMMETRIC = {"left_arm.position_m": -0.5, "right_arm.position_m": 0.5}
UNDAMPED = {"arm.damping_Ns_per_m": 0.0, "feedback.velocity_gain_Ns_per_m": 0.0}
CHANGES: dict[str, dict[str, float]] = {  # what differs from case 1, as the paper says it; without a side: of both
    "case_01": {},
    "case_02": {**UNDAMPED, "contact.dissipation_s_per_m": 0.0},
    "case_03": UNDAMPED,
    "case_04": {"contact.dissipation_s_per_m": 1.0},
    "case_05": {**SYMMETRIC, "arm.mass_kg": 10.0},
    "case_06": {**SYMMETRIC, "left_arm.mass_kg": 10.0},
    "case_07": {**SYMMETRIC, "arm.stiffness_N_per_m": 100.0},
    "case_08": {**SYMMETRIC, "arm.damping_Ns_per_m": 2.0},
    "case_09": {"feedback.position_gain_N_per_m": 50.0},
    "case_10": {"feedback.velocity_gain_Ns_per_m": 5.0},
    "case_11": {"object.mass_kg": 50.0},
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


@pytest.mark.parametrize("name", CASES)
def test_numbers_of_the_paper(name: str) -> None:
    expected = {section: dict(table) for section, table in TABLE_1.items()}
    for key_path, value in CHANGES[name].items():
        section, key = key_path.split(".")
        for own in (section,) if section in expected else (f"left_{section}", f"right_{section}"):
            expected[own][key] = value
    scene = load(name)
    assert scene.name == name
    assert {section: dict(table) for section, table in scene.values.items()} == expected
    assert any("x_l(0)" in reading for reading in scene.readings)
    left, right = expected["left_arm"], expected["right_arm"]
    assert scene.initial_state.tolist() == [left["position_m"], 0.0, 0.0, 0.0, right["position_m"], 0.0]
    assert (scene.period_ns, scene.ticks) == (1_000_000, 20_000)
    assert scene.time_of(scene.ticks) == 20.0


@pytest.mark.parametrize(("section", "key", "value"), [
    *(("left_arm", "stiffness_N_per_m", value)
      for value in (0.1 + 0.2, 1e-30, 1.2e-29, 123456789.123456789, 1 / 3, 2.0**-40, 1e5, 1e12, 1e8 + 1)),
    ("object", "velocity_m_per_s", -0.0), ("object", "velocity_m_per_s", -1e-30),
])
def test_round_trip_of_awkward_numbers(section: str, key: str, value: float) -> None:
    scene = parse(document(section, key, value), "odd", "odd.yaml")
    assert scene.values[section][key].hex() == value.hex()
    assert bits(parse(scene.to_yaml(), "odd", "odd.yaml")) == bits(scene)


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


def test_a_negative_gain_that_leaves_a_spring_is_allowed() -> None:
    scene = parse(document("left_feedback", "position_gain_N_per_m", -10.0), "n", "n.yaml")
    assert scene.values["left_feedback"]["position_gain_N_per_m"] == -10.0


@pytest.mark.parametrize("period", [0.001, 0.0005, 0.1, 1e-9, 20.0, 0.002])
def test_periods_that_divide_the_duration(period: float) -> None:
    scene = parse(document("time", "control_period_s", period), "n", "n.yaml")
    assert scene.ticks * scene.period_ns == 20 * 10**9


def test_settings_replace_numbers() -> None:
    scene = load("case_01", ["left_contact.dissipation_s_per_m=1e1", "left_arm.mass_kg=3.5"])
    assert scene.values["left_arm"]["mass_kg"] == 3.5
    assert scene.values["left_contact"]["dissipation_s_per_m"] == 10.0
    assert bits(scene)[0:2] == bits(load("case_01"))[0:2]


def test_files_and_names(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(load("case_04").to_yaml(), encoding="utf-8")
    scene = load(str(path))
    assert scene.name == "mine"
    assert bits(scene) == bits(load("case_04"))

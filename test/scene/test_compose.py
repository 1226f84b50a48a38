"""A scene has one constructor from sections, and sections without numbers work wherever a scene is named."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.scene import SceneError, compose, load, parse
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.simulation import simulate

BARE = [name for name, effect in BY_SECTION.items() if all(parameter.optional for parameter in effect.parameters)]
OBJECT = {"time": {"duration_s": 1.0, "control_period_s": 0.01},
          "object": {"mass_kg": 2.0, "position_m": 0.0, "velocity_m_per_s": 1.0}}


# The constructor.


@pytest.mark.parametrize("name", scenes.names())
def test_the_sections_of_a_file_give_the_scene_of_the_file(name: str) -> None:
    scene = load(name)
    assert compose(name, scene.values, title=scene.title, readings=scene.readings, watch=scene.watch) == scene


def test_what_is_not_given_is_the_name_or_empty() -> None:
    scene = compose("alone", OBJECT)
    assert (scene.name, scene.title, scene.readings, scene.watch) == ("alone", "alone", (), "")
    assert parse(scene.to_yaml(), "alone", "alone") == scene


def test_a_scene_keeps_its_own_numbers() -> None:
    sections = {section: dict(numbers) for section, numbers in OBJECT.items()}
    scene = compose("alone", MappingProxyType({name: MappingProxyType(table) for name, table in sections.items()}))
    sections["object"]["mass_kg"] = 9.0
    assert scene.values["object"]["mass_kg"] == 2.0
    table = {"time_s": np.array([0.0, 0.5]).tolist(), "force_N": (1, 2)}
    forces = compose("table", {**OBJECT, "object_table": table}).values["object_table"]
    assert forces == {"time_s": (0.0, 0.5), "force_N": (1.0, 2.0)}


@pytest.mark.parametrize(("sections", "texts", "complaint"), [
    ({**OBJECT, "tilt": {"angle_rad": 9.0, "gravity_m_per_s2": 9.81}}, {}, "odd: tilt.angle_rad: 9.0 is not all"),
    ({**OBJECT, "title": "a text"}, {}, "odd: title: unknown key"),
    ({"object": OBJECT["object"]}, {}, "odd: time: missing"),
    (OBJECT, {"watch": None}, "odd: watch: None is not allowed; allowed: a text"),
])
def test_sections_are_validated_like_a_file(sections: Any, texts: dict[str, Any], complaint: str) -> None:
    with pytest.raises(SceneError) as caught:
        compose("odd", sections, **texts)
    assert str(caught.value).startswith(complaint)


def test_a_change_is_told_by_the_title_and_is_validated() -> None:
    scene = load("table")
    heavy = scene.changed({"object.mass_kg": 9, "left_arm_table.force_N": [1.0, 2.0, 3.0]})
    assert heavy.title == f"{scene.title} [object.mass_kg=9, left_arm_table.force_N=...]"
    assert (heavy.readings, heavy.watch, bool(scene.watch)) == (scene.readings, "", True)
    assert heavy.changed({"object.mass_kg": 8}).title == f"{scene.title} [other numbers]"
    assert load("table", ["object.mass_kg=9.0"]).title == f"{scene.title} [object.mass_kg=9]"
    assert scene.changed({"left_arm_table.force_N": list(scene.values["left_arm_table"]["force_N"])}) == scene
    longer = load("table", ["time.duration_s=5"])
    assert (longer.title, longer.watch) == (scene.title, scene.watch)
    bracketed = parse(scene.to_yaml().replace(scene.title, "X [mm] long"), "x", "file")
    assert bracketed.changed({"object.mass_kg": 9}).title == "X [mm] long [object.mass_kg=9]"
    assert load("table", [f"object.mass_kg={scene.values['object']['mass_kg']!r}"]) == scene
    assert heavy.values["left_arm_table"]["force_N"] == (1.0, 2.0, 3.0)
    assert scene.changed({}) == scene.changed({"object.mass_kg": scene.values["object"]["mass_kg"]}) == scene
    for name in ("title.x", "tilt.angle_rad", "object", "object.", ".mass_kg"):
        with pytest.raises(SceneError, match="not in this scene"):
            scene.changed({name: 1.0})
    with pytest.raises(SceneError, match="as many forces as times"):
        scene.changed({"left_arm_table.force_N": [1.0]})


# Sections without numbers.


def test_there_are_sections_that_need_no_number() -> None:
    assert BARE == ["loop", "object_friction"]


@pytest.mark.parametrize("section", BARE)
def test_a_section_without_numbers_is_the_same_everywhere(section: str) -> None:
    scene = load("case_01", [f"{section}={{}}"])
    assert scene.values[section] == {}
    assert scene.values.keys() == load("case_01").values.keys() | {section}
    assert parse(scene.to_yaml(), "case_01", "topic scene") == scene
    assert parse(load("case_01").to_yaml() + f"{section}: {{}}\n", "case_01", "file").values == scene.values
    sections = {**load("case_01").values, section: {}}
    assert compose("case_01", sections, title=scene.title, watch=scene.watch, readings=scene.readings) == scene
    zeros = [f"{section}.{parameter.key}=0" for parameter in BY_SECTION[section].parameters]
    numbered, named = (simulate(load("case_01", ["time.duration_s=2", *settings]), sampled=True)
                       for settings in (zeros, [f"{section}={{}}"]))
    assert numbered.state.tobytes() == named.state.tobytes()


def test_a_loop_without_numbers_holds_the_commands() -> None:
    short = ["time.duration_s=2"]
    named, plain = load("case_01", [*short, "loop={}"]), load("case_01", short)
    assert named.sampled
    assert not plain.sampled
    assert simulate(named).state.tobytes() == simulate(plain, sampled=True).state.tobytes()
    assert load("case_01", ["loop={}", "left_actuator.limit_N=1"]).values["left_actuator"] == {"limit_N": 1.0}


def test_friction_without_numbers_is_none() -> None:
    short = ["time.duration_s=2"]
    rough = simulate(load("case_01", [*short, "object_friction={}"]))
    assert rough.state.tobytes() == simulate(load("case_01", short)).state.tobytes()


@pytest.mark.parametrize("order", [1, -1])
def test_naming_a_section_takes_no_number_from_it(order: int) -> None:
    settings = ["loop={}", "loop.delay_ticks=2"][::order]
    assert load("case_01", settings).values["loop"] == {"delay_ticks": 2}
    held = load("case_01", ["loop={}"]).to_yaml()
    assert parse(held, "held", "held", ["loop={}"]).to_yaml() == held


def test_a_section_that_holds_nothing_is_refused() -> None:
    with pytest.raises(SceneError, match=r"file: loop: None is not allowed; allowed: a mapping with delay_ticks"):
        parse(load("case_01").to_yaml() + "loop:\n", "case_01", "file")

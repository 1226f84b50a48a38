"""Effects: each with a scene, a text and refusals; the documentation adds one."""

from __future__ import annotations

from pathlib import Path

import pytest
from oracles import CASES

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene import PAPER
from grasp_ros.scene.effects import BY_SECTION, EFFECTS
from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV
from grasp_ros.simulation import simulate
from lab.site.examples import titled
from lab.site.reference import TWINS, scene_keys
from lab.studies.effects import variants

OTHERS = [name for name in scenes.names() if name not in CASES]


def test_every_effect_has_a_scene() -> None:
    named = {effect.section for name in scenes.names() for effect in scenes.load(name).effects}
    sided = {section.replace("right", "left").replace("object", "left_arm") for section in named}
    for effect in EFFECTS:
        assert effect.section in named or effect.section.replace("right", "left").replace("object", "left_arm") in sided


@pytest.mark.parametrize("name", scenes.names())
def test_scenes_say_what_to_watch_for_and_survive_a_round_trip(name: str) -> None:
    scene = scenes.load(name)
    assert len(scene.watch) > 40, f"{name}: watch says in more than 40 letters what to look at"
    assert scenes.parse(scene.to_yaml(), name, name) == scene


def test_every_parameter_has_a_unit_a_range_and_a_text() -> None:
    for effect in EFFECTS:
        assert effect.text
        assert effect.certificate
        for parameter in effect.parameters:
            assert parameter.unit
            assert parameter.text
            assert parameter.low < parameter.high


def test_topics_follow_the_scene() -> None:
    assert [topic.name for topic in scenes.load("hammer").topics] == [
        JOINT_STATES.name, "left/effort_command", "contact/left", LYAPUNOV.name,
    ]
    assert [topic.name for topic in scenes.load("no_contact").topics][1:-1] == [
        "left/effort_command", "right/effort_command",
    ]
    assert "external_force/object" in [topic.name for topic in scenes.load("pulse").topics]


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-an-effect.md"


def test_the_example_of_the_documentation_works(monkeypatch: pytest.MonkeyPatch) -> None:
    source = titled(PAGE, "rail.py")
    namespace: dict[str, object] = {}
    exec(compile(source, "rail.py", "exec"), namespace)
    for effect in namespace["EFFECTS"]:
        monkeypatch.setitem(BY_SECTION, effect.section, effect)
    others = [effect for effect in EFFECTS if not effect.section.endswith("_rail")]  # a reader may have added it
    monkeypatch.setattr("grasp_ros.scene.effects.EFFECTS", (*others, *namespace["EFFECTS"]))
    rail = scenes.load("case_01", ["left_rail.drag_Ns_per_m=0.3", "time.duration_s=5.0"])
    assert rail.system.bodies[LEFT].tolist() == [1.0, 10.0, 0.5, 0.0]
    same = scenes.load("case_01", ["left_arm.damping_Ns_per_m=0.5", "time.duration_s=5.0"])
    assert simulate(rail).state.tobytes() == simulate(same).state.tobytes()
    with pytest.raises(scenes.SceneError, match="drag_Ns_per_m"):
        scenes.load("case_01", ["left_rail.drag_Ns_per_m=-1"])


def test_every_effect_has_its_row_in_the_cost_table() -> None:
    found = variants(scenes.load("case_01", ["time.duration_s=1.0"]))
    missing = {effect.section for effect in EFFECTS} - found.keys()
    assert missing == PAPER - {"left_feedback", "right_feedback"}
    assert found["all together"].values.keys() == {effect.section for effect in EFFECTS}
    assert found["all together"].system.delay == 2
    for scene in found.values():
        assert simulate(scene.changed({"time.duration_s": 0.1})).status is Status.DONE


def test_an_external_force_names_the_section_of_its_effect() -> None:
    for section, scene in variants(scenes.load("case_01", ["time.duration_s=1.0"])).items():
        if section in BY_SECTION:
            assert {force.section for force in scene.system.external} <= {section}


def test_the_reference_lists_every_effect_and_key() -> None:
    page = scene_keys()
    for effect in EFFECTS:
        assert f"## {effect.section}\n" in page or effect.section.startswith(TWINS)
        assert all(f"`{own.key}`" in page for own in effect.parameters)

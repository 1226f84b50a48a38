"""Drills: messages that cannot be true, senders that should not be there, and wrong names."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from grasp_ros.scene.topics import ALIVE, CHANGES, JOINT_STATES, LEFT_COMMAND, LEFT_CONTACT, LYAPUNOV, RUN, SCENE, Topic
from lab.drills.faults.drill import Drill
from lab.drills.faults.stage import NODE, Stage
from lab.drills.nodes import NAME

STRAY, ROGUE, OTHERS = "a stray message", "a controller that answers wrongly", "others in the same domain"
CODE = "!!python/object/apply:os.mkdir ['owned']"
NAMES_SECONDS = 2.0  # for discovery to tell the names of nodes that have just come
NAMELESS = "a node whose name is not known yet"  # as long as discovery has none
INJECTOR = f"/{NAME}|{NAMELESS}"
MALFORMED: dict[str, Any] = {"name": ["left", "object"], "position": [0.1], "velocity": [], "effort": [1.0, 2.0, 3.0]}


def drills() -> list[Drill]:
    """All of them."""
    return [*_strays(), *_rogues(), *_others()]


def _strays() -> list[Drill]:
    """Somebody sends a message, once or for a while, and is gone again."""
    def stray(name: str, fault: str, topic: Topic, fields: dict[str, Any], seconds: float = 0.0, quick: bool = False
              ) -> Drill:
        send = partial(_stray, topic=topic, fields=fields, seconds=seconds)
        return Drill(name, STRAY, fault, Stage.run, send, quick=quick, culprit=INJECTOR)

    push = {"wrench.force.x": 1.0}
    return [
        stray("wall-clock", "one command stamped with the wall clock", LEFT_COMMAND, {"stamp": "wall", **push},
              quick=True),
        stray("command", "one command stamped with the latest state, 1e6 N", LEFT_COMMAND, {"wrench.force.x": 1e6}),
        stray("frame-number", "one command whose frame_id is 7", LEFT_COMMAND, {"header.frame_id": "7", **push}),
        stray("frame-world", "one command whose frame_id is world", LEFT_COMMAND, {"header.frame_id": "world", **push}),
        stray("flood", "commands at full speed for 2 s", LEFT_COMMAND, push, seconds=2.0),
        stray("malformed-state", "one malformed joint_states", JOINT_STATES, MALFORMED),
        stray("malformed-lyapunov", "one malformed lyapunov stamped with the wall clock", LYAPUNOV,
              {"stamp": "wall", **MALFORMED}),  # the plant reads the stamp alone
        stray("malformed-parameters", "one malformed left/parameters", CHANGES["left"], MALFORMED),
        stray("stray-scene", "a scene with a tag of Python", SCENE, {"data": CODE}),
        stray("stray-run", "a text of another kind on run", RUN, {"data": CODE}),
        Drill("stray-scene-alone", STRAY, "a scene with a tag of Python, before the plant is there", _without_plant,
              _scene_before, settle=False, nothing_to_keep=True, culprit=INJECTOR),
        stray("stray-contact", "contact forces stamped with the wall clock, at full speed for 2 s",
              LEFT_CONTACT, {"stamp": "wall"}, seconds=2.0),
    ]


def _stray(stage: Stage, topic: Topic, fields: dict[str, Any], seconds: float = 0.0) -> None:
    answer = stage.companion.ask("publish", topic=topic, fields=fields, seconds=seconds)
    stage.happens(answer["begin"])


def _without_plant(stage: Stage) -> None:
    for name in ("monitor", "left_controller", "right_controller"):
        stage.node(name)


def _scene_before(stage: Stage) -> None:
    stage.companion.ask("wait_for_sources", topic=ALIVE.name, number=len(stage.started))
    time.sleep(NAMES_SECONDS)
    _stray(stage, SCENE, {"data": CODE})
    stage.node("plant")
    stage.wait(lambda: stage.published > 0, 30.0)


def _rogues() -> list[Drill]:
    """The only controller of an arm, which answers well until then."""
    def rogue(name: str, fault: str, culprit: str = INJECTOR, **fields: Any) -> Drill:
        return Drill(f"rogue-{name}", ROGUE, fault, _with_rogue,
                     lambda stage: stage.companion.ask("control", side="left", **fields), culprit=culprit)

    return [
        rogue("large", "answers with 1e6 N", "", force=1e6),  # which a scene without a limit allows
        rogue("nan", "answers with NaN", **{"wrench.force.x": "nan"}),
        rogue("repeated", "answers each state twenty times", times=20),
        rogue("wall-clock", "stamps its answers with the wall clock", stamp="wall"),
        rogue("old", "stamps its answers with tick 5", stamp=5_000_000),
        rogue("frame", "gives its answers a frame_id of 12", "", **{"header.frame_id": "12"}),  # nobody reads it
        rogue("silent", "answers no more, but stays", times=0),
    ]


def _with_rogue(stage: Stage) -> None:
    stage.run("--without", "left_controller")
    stage.companion.ask("control", side="left")


def _others() -> list[Drill]:
    other = ("-p", "left_feedback.position_gain_N_per_m:=9.0", "-r", "__node:=other")
    return [
        Drill("second-controller", OTHERS, "a second left controller, with another gain", Stage.run,
              partial(_second, name="left_controller", topic=LEFT_COMMAND, words=other), culprit=f"/other|{NAMELESS}"),
        Drill("second-plant", OTHERS, "a second plant", Stage.run, partial(_second, name="plant", topic=JOINT_STATES),
              by_itself=True),
        Drill("second-run", OTHERS, "a second `grasp run`", Stage.run, _second_run, by_itself=True,
              culprit="already runs"),
        Drill("frozen-reader", OTHERS, "a subscriber that is frozen", _with_reader, _freeze_reader),  # nobody needs it
        Drill("other-scene", OTHERS, "the plant is killed, and one with another scene is started", Stage.terminals,
              _other_scene, culprit="/plant"),
    ]


def _second(stage: Stage, name: str, topic: Topic, words: Sequence[str] = ()) -> None:
    """The accident happens when its topic has two sources."""
    stage.start(f"second {name}", [*NODE, name, "--ros-args", *words])
    stage.happens(stage.companion.ask("wait_for_sources", topic=topic.name, number=2)["when"])


def _second_run(stage: Stage) -> None:
    stage.start("second run", stage.run_words(folder="second"))
    stage.wait(lambda: stage.ended("second run"), 20.0)
    stage.happens()


def _with_reader(stage: Stage) -> None:
    stage.run()
    stage.start("reader", [*NODE, "watch", "--ros-args"])


def _freeze_reader(stage: Stage) -> None:
    os.kill(stage.pid("reader"), signal.SIGSTOP)
    time.sleep(3.0)


def _other_scene(stage: Stage) -> None:
    stage.signal("plant", signal.SIGKILL)
    stage.started["plant"].wait()
    stage.started.pop("plant")
    stage.node("plant", scene="arm_alone")
    stage.wait(lambda: stage.ended("monitor"), 20.0)
    stage.wait(lambda: stage.ended("plant"), 15.0)
    if not stage.ended("plant"):  # the monitor had ended before it came: it waits for another one
        stage.signal("plant", signal.SIGINT)

"""Laws that ask for more than their arm: the same bits without ROS, in one process, in four, and from the bag."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SECOND_DOMAIN
from graphs import started
from rclpy.parameter import Parameter

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.bag.recording import Recording
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.processes import Graph
from grasp_ros.physics import control
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.observation import OBSERVABLES
from grasp_ros.simulation import simulate

pytestmark = pytest.mark.slow  # real processes
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "controller.md"
LAWS = """
from collections import deque
class Late:
    "Its answers come three ticks late, beside the delay of the scene."
    def __init__(self):
        self.coming = deque([0.0] * 3)
    def __call__(self, tick, time, x, v, x_object, impact, set_point, x_other):
        self.coming.append(-5.0 * (x - set_point) - 0.5 * v + 2.0 * (x_object - x_other) - 0.01 * impact)
        return self.coming.popleft()
class Slow:
    "It counts its answers: the scene asks it every fifth tick."
    count = 0
    def __call__(self, tick, time, x, v, v_object, v_other, impact, impact_other):
        self.count += 1
        return -5.0 * x - 0.5 * v - 0.1 * (v_object + v_other) + 0.01 * (impact - impact_other) + 1e-3 * self.count
"""
SETTINGS = [
    "time.duration_s=0.7", "loop.delay_ticks=2", "left_feedback.set_point_m=0.01", "left_sensor.noise_seed=3",
    "left_sensor.position_noise_m=1e-4", "right_sensor.noise_seed=4", "right_sensor.velocity_noise_m_per_s=1e-3",
    "right_sensor.position_step_m=1e-4", "right_actuator.limit_N=2.5", "right_rate.period_ticks=5",
]


def test_the_page_lists_what_a_law_may_ask_for() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert tuple(re.findall(r"^\| `(\w+)` \|", text, re.M)) == tuple(OBSERVABLES)


def from_the_bag(recording: Recording, side: int, law: Any) -> list[float]:
    """What a law answers that is given what the bag holds."""
    far = RIGHT if side == LEFT else LEFT
    impacts = [recording.outputs[f"contact/{name}"] for name in ("left", "right")]
    column, other = (0, 4) if side == LEFT else (4, 0)
    answers = []
    for row, measured in enumerate(recording.measured.tolist()):
        given = {
            "x_object": recording.state[row, 2], "v_object": recording.state[row, 3], "x_other": measured[other],
            "v_other": measured[other + 1], "impact": impacts[side][row], "impact_other": impacts[far][row],
            "set_point": recording.scene.system.laws[side].row[2],
        }
        assert given.keys() == set(OBSERVABLES)
        asked = type(law).__call__.__code__.co_varnames
        known = {name: float(value) for name, value in given.items() if name in asked}
        if not control.is_due(recording.scene.system.laws[side].row, int(recording.tick[row])):
            answers.append(answers[-1])
            continue
        force = law(int(recording.tick[row]), float(recording.t[row]), *measured[column : column + 2], **known)
        answers.append(min(max(force, -2.5), 2.5) if side == RIGHT else force)
    return answers


def test_laws_that_see_more_give_the_same_bits_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The arms have laws with another delay and another rate."""
    (tmp_path / "seeing_laws.py").write_text(LAWS)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(LAWS, names)
    case = scenes.load("case_01", SETTINGS)
    simulated = simulate(case, controllers={"left": names["Late"], "right": names["Slow"]})
    assert simulated.impacts.max() > 10.0
    laws = {"left_controller": "seeing_laws:Late", "right_controller": "seeing_laws:Slow"}
    four = Graph(case, tmp_path / "four", ACCURACY, laws=laws)
    one = Graph(case, tmp_path / "one", ACCURACY, laws=laws, one_process=True)
    with started(four):
        monkeypatch.setenv("ROS_DOMAIN_ID", SECOND_DOMAIN)
        with started(one):
            four.wait([])
            one.wait([])
    for graph in (four, one):
        recording = bag.read(graph.bag)
        assert recording.state.tobytes() == simulated.state.tobytes()
        assert recording.command.tobytes() == simulated.command.tobytes()
        assert verify(recording).words == "701 states follow from the recorded inputs, bit for bit"
        for side, law in ((LEFT, names["Late"]), (RIGHT, names["Slow"])):
            answers = np.array(from_the_bag(recording, side, law()))
            assert answers.tobytes() == np.ascontiguousarray(recording.command[:, side]).tobytes()


def test_a_node_refuses_a_scene_without_what_its_law_asks_for_and_numbers_that_do_not_act(
    make: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "asking.py").write_text("def law(tick, time, x, v, x_object):\n    return x_object - x\n")
    monkeypatch.syspath_prepend(tmp_path)
    controller = make(Controller, "left_controller", law="asking:law")
    with pytest.raises(Refused, match="law: asking:law: asks for x_object; the scene has no object"):
        controller._take(scenes.load("arm_alone"))
    controller._take(scenes.load("case_01"))
    gain = "left_feedback.position_gain_N_per_m"
    result = controller.set_parameters([Parameter(gain, value=9.0)])[0]
    assert result.reason == f"{gain}: {control.FIXED}"
    assert controller.set_parameters([Parameter(gain, value=5.0)])[0].successful

"""`module:object`: what it names, and that it begins a run in the same way with the graph and without."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import load_controllers
from grasp_ros.graph.nodes.controller import OwnLaw
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT
from grasp_ros.simulation import simulate

SOURCE = """
class Lag:
    def __init__(self):
        self.before = 0.0
    def __call__(self, tick, time, x, v):
        self.before = 0.9 * self.before + 0.1 * (-5.0 * x - 0.5 * v)
        return self.before
class Reset(Lag):
    def reset(self):
        self.__init__()
class Gain:
    def __init__(self, gain):
        self.gain = gain
class Dumb:
    pass
class Box:
    law = Lag()
lag, reset, number = Lag(), Reset(), 3.0
"""
ENDS = {  # what a law does beside answering, and how it is told
    "sys.exit(3)": "SystemExit: 3", "raise KeyboardInterrupt": "KeyboardInterrupt",
    "raise GeneratorExit": "GeneratorExit",
    "raise BrokenPipeError('mine')": "BrokenPipeError: mine", "raise OSError(28, 'No')": r"OSError: \[Errno 28\] No",
    "1 / 0": "ZeroDivisionError: division by zero",
    "raise type('Mute', (Exception,), {'__str__': lambda error: 1 / 0})": "Mute: without words",
    "__import__('json').loads('')": "JSONDecodeError: Expecting value: line 1 column 1 .char 0.",
    "__import__('rclpy').shutdown()": "RuntimeError: Context must be initialized before it can be shutdown",
}
DOORS: dict[str, Callable[[str], object]] = {
    "simulate": lambda place: load_controllers([f"left={place}"])["left"], "graph": OwnLaw,
}
SHORT = "time.duration_s=0.1"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A directory with modules, and nothing of them left behind."""
    files = {"laws_here": SOURCE, "broken_here": "def f(:\n", "needs_here": "import nowhere_at_all\n"}
    for name, source in files.items():
        (tmp_path / f"{name}.py").write_text(source)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    for name in files:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("laws_here", ""), ("laws_here:", ""), (":lag", ""),
        ("nowhere_at_all:f", ": no module nowhere_at_all; allowed: one of the current directory, or one that is inst"),
        ("laws_here.more:f", ": no module laws_here.more; allowed: one of the current directory"),
        ("broken_here:f", ": broken_here cannot be imported: invalid syntax"),
        ("needs_here:f", ": needs_here cannot be imported: No module named 'nowhere_at_all'"),
        ("laws_here:other", ": laws_here has no other ("), ("laws_here:Box.other", ": laws_here has no Box.other ("),
        ("json:law", f": json has no law ({json.__file__}); allowed: a callable of it"),
        ("laws_here:number", ": 3.0 cannot be called; allowed: a callable of tick, time, x and v"),
    ],
)
def test_what_is_no_law_is_refused_in_the_same_words(door: str, place: str, words: str) -> None:
    begin = {"simulate": f"--controller: left={place}", "graph": f"law: {place}"}[door]
    with pytest.raises(Refused) as caught:
        DOORS[door](place)
    assert str(caught.value).startswith(begin + (words or " is not allowed; allowed: "))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Gain", "Gain: missing a required argument: 'gain'; allowed: a class that is called without arguments"),
        ("Dumb", "is not allowed; allowed: a callable of tick, time, x and v"),
    ],
)
def test_a_class_that_makes_no_law_is_refused_in_the_same_words(name: str, words: str) -> None:
    with pytest.raises(Refused, match=words):
        OwnLaw(f"laws_here:{name}")
    with pytest.raises(Refused, match=words):
        simulate(scenes.load("case_01", [SHORT]), controllers=load_controllers([f"left=laws_here:{name}"]))


@pytest.mark.parametrize("name", ["Lag", "Reset", "reset", "lag", "Box.law"])
def test_a_law_begins_each_run_alike_in_both(name: str) -> None:
    """A class is made anew, `reset` is called where there is one, and any other object goes on."""
    case, place, anew = scenes.load("case_01", [SHORT]), f"laws_here:{name}", name not in ("lag", "Box.law")
    runs = [simulate(case, controllers=load_controllers([f"left={place}"])) for _ in range(2)]
    assert (runs[0].command.tobytes() == runs[1].command.tobytes()) == anew
    own = OwnLaw(place)
    for _ in range(2):
        commands = np.array([
            own.command(case.system, LEFT, tick, case.time_of(tick), state)
            for tick, state in enumerate(runs[0].state.tolist())
        ])
        assert (commands.tobytes() == runs[0].command[:, LEFT].tobytes()) == anew
        own.reset()


def test_a_class_makes_one_law_for_each_arm() -> None:
    words = [f"{side}=laws_here:Lag" for side in ("left", "right")]
    both = simulate(scenes.load("case_01", [SHORT]), controllers=load_controllers(words))
    alone = simulate(scenes.load("case_01", [SHORT]), controllers=load_controllers(words[:1]))
    assert both.command[0, LEFT] == alone.command[0, LEFT]
    assert both.controllers == {"left": "laws_here:Lag", "right": "laws_here:Lag"}


@pytest.mark.parametrize("line", ENDS)
@pytest.mark.parametrize(
    ("source", "when"),
    [
        ("import sys\n{}", ""),
        ("import sys\nclass law:\n    def __init__(self): {}\n    def __call__(self, *_): pass", ""),
        ("import sys\ndef law(*_): {}", ", at tick 7"),
    ],
    ids=["import", "begin", "answer"],
)
def test_whatever_a_law_raises_in_the_graph_is_its_own(here: Path, source: str, when: str, line: str) -> None:
    if "Keyboard" in line and "class" in source:
        pytest.skip("it is somebody's Ctrl-C")
    (here / "needs_here.py").write_text(source.format(line))
    with pytest.raises(Refused, match=rf"^law: needs_here:law: .*{ENDS[line]}, .*needs_here.py, line \d{when}$"):
        OwnLaw("needs_here:law").command(scenes.load("case_01").system, LEFT, 7, 0.007, [0.0] * 6)


@pytest.mark.parametrize(
    ("answer", "told"),
    [("'1.0'", "'1.0'"), ("None", "None"), ("10 ** 5000", "inf"), ("[1.0]", r"\[1.0\]"), ("-1e999", "-inf")],
)
def test_what_is_no_command_is_refused_in_the_same_words(here: Path, answer: str, told: str) -> None:
    (here / "needs_here.py").write_text(f"law = lambda *_: {answer}")
    case, words = scenes.load("case_01", [SHORT]), f": it returned {told} at tick 0, t = 0.0 s; allowed: a finite numb"
    with pytest.raises(Refused, match=f"^law: needs_here:law{words}"):
        OwnLaw("needs_here:law").command(case.system, LEFT, 0, 0.0, [0.0] * 6)
    with pytest.raises(Refused, match=f"^left controller needs_here:<lambda>{words}"):
        simulate(case, controllers=load_controllers(["left=needs_here:law"]))


def test_a_module_here_does_not_hide_an_installed_one(here: Path) -> None:
    (here / "colorsys.py").write_text("mine = print\n")
    with pytest.raises(Refused, match="colorsys has no mine"):
        DOORS["simulate"]("colorsys:mine")

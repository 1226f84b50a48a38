"""Nothing but a refusal is raised for input, and what opens or decodes a file turns its errors into one."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

import grasp_ros
from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import decoding, reading, writing

ROOT = Path(grasp_ros.__file__).parent
LAB = ROOT.with_name("lab")
OUR_OWN = (  # bare ValueErrors that no input of a user reaches
    "lab/studies/certificate.py", "grasp_ros/exact/compilation/kernel_cache.py",
)


@pytest.mark.slow
def test_nothing_else_is_raised_for_input() -> None:
    """A ValueError by its own name says that no input can cause it; nothing is caught that faults of ours raise."""
    raised, caught = set(), set()
    for path in (*ROOT.rglob("*.py"), *LAB.rglob("*.py")):
        name = path.relative_to(ROOT.parent).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Raise) and getattr(getattr(node.exc, "func", node.exc), "id", "") == "ValueError":
                raised.add(name)
            if isinstance(node, ast.ExceptHandler) and (
                node.type is None or getattr(node.type, "id", "") in ("Exception", "BaseException")
            ):
                caught.add(name)
    assert raised == set(OUR_OWN)
    assert caught == {
        "lab/drills/parser_fuzzing.py", "lab/drills/fuzz.py",  # a fault is what they look for
        "lab/benchmarks/compare.py",  # an older checkout may not know a row
        "grasp_ros/graph/nodes/controller.py", "grasp_ros/cli/main.py",  # a user's law that raises is one line
        "grasp_ros/graph/ros/executor.py",  # a fault of ours ends a node in one line
        "grasp_ros/exact/compilation/numba_internals.py",  # whatever a damaged file raises: it is compiled anew
        "grasp_ros/physics/errors.py",  # the words of such an exception are somebody else's, too
        "grasp_ros/exact/driver/user_controller.py",  # what a user's controller raises goes around the kernel
    }


@pytest.mark.parametrize("opens", [reading, writing])
def test_an_opened_file_names_its_path_and_lets_faults_through(opens: Any) -> None:
    with pytest.raises(Refused, match=r"^my file: cannot be \w+: No such file or directory$"), opens("my file"):
        Path("no/such/file").read_bytes()
    with pytest.raises(scenes.SceneError), opens("my file", scenes.SceneError):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(KeyError), opens("my file"):
        raise KeyError("ours")
    with pytest.raises(BrokenPipeError), writing("my file"):
        raise BrokenPipeError


def test_a_decoder_is_not_believed_and_ours_is() -> None:
    with pytest.raises(Refused, match=r"^my file: not a thing: MemoryError$"), decoding("my file", "a thing"):
        raise MemoryError
    with pytest.raises(AttributeError), decoding("my file", "a thing"):
        raise AttributeError("ours")
    with pytest.raises(Refused), decoding("my file", "a thing", also=(AttributeError,)):
        raise AttributeError("theirs")

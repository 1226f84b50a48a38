"""Imports go one way, and files stay small."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import grasp_ros

ROOT = Path(grasp_ros.__file__).parent
SOURCES = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.rglob("*.py"))
MESSAGES = {"std_srvs", "rcl_interfaces", "builtin_interfaces"}
LINES = 300


def imports(name: str) -> set[str]:
    """Full names of all modules that a file imports, anywhere in it."""
    tree = ast.parse((ROOT / name).read_text(encoding="utf-8"))
    package = ["grasp_ros", *Path(name).parts[:-1]]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(
                [*package[: len(package) - node.level + 1], node.module or ""] if node.level else [node.module]
            )
            found |= {base.rstrip(".")} | {f"{base.rstrip('.')}.{alias.name}" for alias in node.names}
    return found


def tops(name: str) -> set[str]:
    """First parts of the imported names."""
    return {module.split(".")[0] for module in imports(name)}


def module_of(name: str) -> str:
    """Dotted name of a file."""
    return ".".join(["grasp_ros", *Path(name).with_suffix("").parts]).removesuffix(".__init__")


def test_the_search_finds_the_files() -> None:
    assert {"physics/hybrid.py", "nodes/plant.py", "bag.py", "plots.py", "scene.py"} <= set(SOURCES)
    assert "rclpy" in tops("nodes/node.py")
    assert "rosbags" in tops("bag.py")
    assert "matplotlib" in tops("plots.py")


@pytest.mark.parametrize("name", SOURCES)
def test_each_library_has_its_room(name: str) -> None:
    found = tops(name)
    if not name.startswith("nodes/"):
        assert not {
            top for top in found if top.startswith(("rclpy", "rosidl")) or top.endswith("_msgs") or top in MESSAGES
        }
    if name != "bag.py":
        assert "rosbags" not in found
    if name not in ("plots.py", "studies/figures.py"):
        assert "matplotlib" not in found
    if not name.startswith("physics/"):
        assert "numba" not in found
    if name not in ("reference.py", "oracles.py"):
        assert not {"gmpy2", "mpmath"} & found


@pytest.mark.parametrize("name", [name for name in SOURCES if name.startswith("physics/")])
def test_physics_knows_only_itself(name: str) -> None:
    own = {module for module in imports(name) if module.split(".")[0] == "grasp_ros"}
    assert all(module.startswith("grasp_ros.physics") for module in own)
    assert not {"yaml", "pathlib", "time", "datetime"} & tops(name) or name == "physics/jit.py"


@pytest.mark.parametrize("name", [name for name in SOURCES if name.startswith("methods/")])
def test_methods_know_the_physics_and_the_scene(name: str) -> None:
    own = {module for module in imports(name) if module.split(".")[0] == "grasp_ros"}
    allowed = ("grasp_ros.physics", "grasp_ros.methods", "grasp_ros.scene")
    assert all(module.startswith(allowed) for module in own)


@pytest.mark.parametrize("name", [name for name in SOURCES if not name.startswith("nodes/")])
def test_nothing_imports_the_nodes(name: str) -> None:
    assert not {module for module in imports(name) if module.startswith("grasp_ros.nodes")}


def test_imports_make_no_circle() -> None:
    modules = {module_of(name): name for name in SOURCES}
    graph = {module: {found for found in imports(name) if found in modules} for module, name in modules.items()}
    done: set[str] = set()
    while len(done) < len(graph):
        free = {module for module, needs in graph.items() if module not in done and needs <= done | {module}}
        assert free, sorted(set(graph) - done)
        done |= free


@pytest.mark.parametrize("name", [name for name in SOURCES if name != "reference.py"])
def test_files_stay_small(name: str) -> None:
    assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) < LINES

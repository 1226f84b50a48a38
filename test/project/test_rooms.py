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
BELOW = {  # what the files of a room may import beside their own room
    "physics": (),
    "exact": ("physics",),
    "observe": ("physics", "exact"),
    "scene": ("physics",),
    "methods": ("physics", "exact", "scene"),
    "simulation": ("physics", "exact", "observe", "scene", "methods"),
    "maps": ("physics", "exact", "observe", "scene", "simulation"),
    "graph": ("physics", "exact", "observe", "scene", "simulation"),
    "verification": ("physics", "exact", "observe", "scene", "simulation"),
    "studies": ("physics", "exact", "observe", "scene", "methods", "simulation", "maps", "graph", "verification"),
    "cli": (
        "physics", "exact", "observe", "scene", "methods", "simulation", "maps", "graph", "verification", "studies",
    ),
}
ROOMS = tuple(BELOW)
DRAW = (
    "simulation/plots.py", "maps/figures.py", "studies/figures.py", "studies/page_figures.py", "studies/map_figures.py",
    "studies/paper/figures.py", "studies/paper/beyond_figures.py",
)


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


def room_of(module: str) -> str:
    """The room of a module of the package; empty for the package itself."""
    return [*module.split("."), ""][1]


def test_the_search_finds_the_files() -> None:
    files = {"exact/driver/advance.py", "graph/nodes/plant.py", "graph/bag.py", "simulation/plots.py", "scene/scene.py"}
    assert files <= set(SOURCES)
    assert "rclpy" in tops("graph/nodes/node.py")
    assert "rosbags" in tops("graph/bag.py")
    assert "matplotlib" in tops("simulation/plots.py")


def test_nothing_lies_loose_at_the_root() -> None:
    assert {path.name for path in ROOT.iterdir() if path.name != "__pycache__"} == {
        "__init__.py", "py.typed", "config", *ROOMS
    }


def test_tests_mirror_the_rooms() -> None:
    tests = Path(__file__).parents[1]
    assert {path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py")} == {*ROOMS, "project"}


@pytest.mark.parametrize("name", SOURCES)
def test_each_library_has_its_place(name: str) -> None:
    found = tops(name)
    if not name.startswith("graph/nodes/"):
        assert not {
            top for top in found if top.startswith(("rclpy", "rosidl")) or top.endswith("_msgs") or top in MESSAGES
        }
    if name not in ("graph/bag.py", "graph/columns.py", "graph/recover.py", "graph/rosbag2.py"):
        assert "rosbags" not in found
    if name not in ("graph/chunks.py", "graph/recorder.py", "graph/storage.py"):
        assert "mcap" not in found
    if name not in DRAW:
        assert "matplotlib" not in found
    if name != "studies/paper/page.py":
        assert "jinja2" not in found
    if not name.startswith(("exact/", "observe/")):
        assert "numba" not in found
    if not name.startswith("verification/"):
        assert not {"gmpy2", "mpmath"} & found
    if name.startswith(("physics/", "exact/", "observe/")) and name != "exact/compilation/kernel_cache.py":
        assert not {"yaml", "pathlib", "time", "datetime"} & found


@pytest.mark.parametrize("name", [name for name in SOURCES if name != "__init__.py"])
def test_a_room_knows_only_those_below(name: str) -> None:
    room = name.split("/")[0]
    known = {room_of(module) for module in imports(name) if module.split(".")[0] == "grasp_ros"}
    assert known <= {*BELOW[room], room, ""}


@pytest.mark.parametrize("name", [name for name in SOURCES if not name.startswith("graph/nodes/")])
def test_nothing_imports_the_nodes(name: str) -> None:
    assert not {module for module in imports(name) if module.startswith("grasp_ros.graph.nodes")}


def test_imports_make_no_circle() -> None:
    modules = {module_of(name): name for name in SOURCES}
    graph = {module: {found for found in imports(name) if found in modules} for module, name in modules.items()}
    done: set[str] = set()
    while len(done) < len(graph):
        free = {module for module, needs in graph.items() if module not in done and needs <= done | {module}}
        assert free, sorted(set(graph) - done)
        done |= free


@pytest.mark.parametrize("name", SOURCES)
def test_files_stay_small(name: str) -> None:
    assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) < LINES

"""What an installation puts where: pip's prefix and colcon's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # builds and installs

ROOT = Path(__file__).parents[2]
EXECUTABLES = {"plant", "left_controller", "right_controller", "monitor", "grasp"}


@pytest.fixture(scope="module")
def colcon_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    workspace = tmp_path_factory.mktemp("workspace")
    kept_out = shutil.ignore_patterns(".*", "build", "install", "log", "runs", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, workspace / "src" / "grasp_ros", symlinks=True, ignore=kept_out)
    colcon = Path(sys.executable).parent / "colcon"
    listed = subprocess.run([colcon, "list"], cwd=workspace, capture_output=True, text=True, timeout=300, check=True)
    assert "(ros.ament_python)" in listed.stdout
    subprocess.run([colcon, "build"], cwd=workspace, capture_output=True, timeout=300, check=True)
    return workspace / "install" / "grasp_ros"


@pytest.fixture(params=["pip", "colcon"])
def prefix(request: pytest.FixtureRequest) -> Path:
    return Path(sys.prefix) if request.param == "pip" else request.getfixturevalue("colcon_prefix")


def test_ros2_finds_the_package_and_its_executables(prefix: Path) -> None:
    assert (prefix / "share/ament_index/resource_index/packages/grasp_ros").is_file()
    assert "<name>grasp_ros</name>" in (prefix / "share/grasp_ros/package.xml").read_text()
    assert len(list((prefix / "share/grasp_ros/config").glob("case_*.yaml"))) >= 11
    found = {path.name for path in (prefix / "lib/grasp_ros").iterdir()}
    assert found == EXECUTABLES
    assert all(os.access(prefix / "lib/grasp_ros" / name, os.X_OK) for name in EXECUTABLES)


def test_executables_run_from_where_ros2_looks(prefix: Path, tmp_path: Path) -> None:
    """As `ros2 run` starts them: by their path, here with the package of that prefix."""
    site = next(prefix.glob("lib/python*/site-packages"))
    environment = {**os.environ, "PYTHONPATH": str(site), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    result = subprocess.run(
        [prefix / "lib/grasp_ros/grasp", "scenes"], cwd=tmp_path, env=environment, capture_output=True, text=True,
        timeout=60, check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "case_11" in result.stdout
    refused = subprocess.run(
        [prefix / "lib/grasp_ros/plant", "--ros-args", "-p", "scene:=no_such_scene"], cwd=tmp_path, env=environment,
        capture_output=True, text=True, timeout=60, check=False,
    )
    assert refused.returncode == 2
    assert "no_such_scene: no such scene" in refused.stderr

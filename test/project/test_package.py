"""What an installation puts where: pip's prefix and colcon's."""

from __future__ import annotations

import os
import re
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


@pytest.fixture(scope="module")
def pip_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, installed; its dependencies are those of this Python."""
    prefix = tmp_path_factory.mktemp("prefix")
    words = ["wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(prefix), str(ROOT)]
    subprocess.run([sys.executable, "-m", "pip", *words], timeout=300, check=True)
    shutil.rmtree(ROOT / "build", ignore_errors=True)
    [wheel] = prefix.glob("*.whl")
    words = ["install", "--quiet", "--no-deps", "--ignore-installed", "--prefix", str(prefix), str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", *words], timeout=300, check=True)
    return prefix


@pytest.fixture(params=["pip", "colcon"])
def prefix(request: pytest.FixtureRequest) -> Path:
    path: Path = request.getfixturevalue(f"{request.param}_prefix")
    return path


def installed(prefix: Path) -> dict[str, str]:
    """An environment in which the package of a prefix is found first."""
    [site] = prefix.glob("lib/python*/site-packages")
    return {**os.environ, "PYTHONPATH": str(site), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


def test_the_wheel_holds_the_product_alone(pip_prefix: Path) -> None:
    [site] = pip_prefix.glob("lib/python*/site-packages")
    assert {path.name for path in site.iterdir() if path.suffix != ".dist-info"} == {"grasp_ros"}
    assert [path.name for path in (pip_prefix / "bin").iterdir()] == ["grasp"]
    [info] = site.glob("*.dist-info")
    needs = [line for line in (info / "METADATA").read_text().splitlines() if line.startswith("Requires-Dist")]
    plain = {re.split(r"[^\w.-]", need.split(": ")[1])[0] for need in needs if "extra ==" not in need}
    assert {"numba", "rosbags"} <= plain
    assert not plain & {"scipy", "gmpy2", "mpmath", "heyoka", "xarray", "pytest"}


@pytest.mark.thorough
def test_the_wheel_runs_a_graph_a_verification_and_a_map(pip_prefix: Path, tmp_path: Path) -> None:
    """In an empty directory, away from the checkout."""
    environment = installed(pip_prefix)

    def grasp(*words: str) -> str:
        result = subprocess.run(
            [sys.executable, "-m", "grasp_ros.cli", *words], cwd=tmp_path, env=environment, capture_output=True,
            text=True, timeout=300, check=False,
        )
        assert result.returncode == 0, result.stderr
        return result.stdout

    grasp("run", "case_01", "--set", "time.duration_s=1", "-o", "run")
    assert "bit for bit" in grasp("verify", "run/bag")
    grasp("map", "case_01", "--set", "time.duration_s=1", "--x", "left_arm.mass_kg=1:2:4", "-o", "map.zarr")


def test_ros2_finds_the_package_and_its_executables(prefix: Path) -> None:
    assert (prefix / "share/ament_index/resource_index/packages/grasp_ros").is_file()
    assert "<name>grasp_ros</name>" in (prefix / "share/grasp_ros/package.xml").read_text()
    assert len(list((prefix / "share/grasp_ros/config").glob("case_*.yaml"))) >= 11
    found = {path.name for path in (prefix / "lib/grasp_ros").iterdir()}
    assert found == EXECUTABLES
    assert all(os.access(prefix / "lib/grasp_ros" / name, os.X_OK) for name in EXECUTABLES)


def test_executables_run_from_where_ros2_looks(prefix: Path, tmp_path: Path) -> None:
    """As `ros2 run` starts them: by their path, here with the package of that prefix."""
    environment = installed(prefix)
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

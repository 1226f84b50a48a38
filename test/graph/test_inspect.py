"""What `grasp inspect` and `grasp verify` say of a bag, as data, and what the sensors measured in it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.bag.summary import summary
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.simulation import Trajectory, simulate
from grasp_ros.simulation.sampled_plant import LoopRecord
from lab.drills import recorder

NOISY = ["time.duration_s=0.5", "loop.delay_ticks=3", "left_sensor.noise_seed=7", "left_sensor.position_noise_m=1e-3",
         "left_sensor.velocity_step_m_per_s=0.01"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trajectory]:
    """A bag, and what it was made of."""
    path, run = tmp_path_factory.mktemp("noisy") / "bag", simulate(scenes.load("case_01", NOISY))
    recorder.write(path, run)
    return path, run


def test_inspect_says_size_duration_and_rates_in_numbers(recorded: tuple[Path, Trajectory], command: Any) -> None:
    path, run = recorded
    found = json.loads(command("inspect", str(path), "--json", "--replay").stdout)
    replay = found["replay"]
    assert (replay["holds"], replay["same_without_ROS"], replay["states_compared"]) == (True, True, 501)
    assert found["size_bytes"] == sum(file.stat().st_size for file in path.iterdir())
    assert (found["duration_s"], found["scene_duration_s"], found["ticks"]) == (0.5, 0.5, 501)
    assert found["topics"]["joint_states"] == {"messages": 501, "rate_Hz": 1000.0}
    assert found["topics"]["scene"] == {"messages": 1, "rate_Hz": None}
    assert "/diagnostics" not in found["topics"]
    assert found["V_J"] == run.energy.V[[0, -1]].tolist()
    assert (found["missing"], found["alarms"], found["lockstep"], found["resets"]) == ({}, 0, True, 0)
    shown = command("inspect", str(path)).stdout
    assert f"\nsize                     {found['size_bytes'] / 1e6:.3g} MB\n" in shown
    assert "501 at 1000 Hz: /clock, joint_states, left/effort_command, " in shown


def test_contacts_at_the_begin_count_again_after_a_reset(tmp_path: Path) -> None:
    case = scenes.load("preload", ["time.duration_s=0.05", "left_arm.position_m=0.001"])
    recorder.write(tmp_path / "bag", simulate(case, sampled=True))
    once = bag.read(tmp_path / "bag")
    twice = replace(once, starts=np.array([0, 51]), tick=np.arange(2 * len(once.tick)), **{
        name: np.tile(getattr(once, name), (2, 1)) for name in ("state", "command", "effort", "lyapunov")})
    assert len(once.tick) == 51
    assert [summary(each)["contacts"] for each in (once, twice)] == [{"left": n, "right": 0} for n in (1, 2)]
    late = replace(twice, starts=twice.starts[1:], **{
        name: getattr(twice, name)[10:] for name in ("tick", "state", "command", "effort", "lyapunov")})
    assert late.scene_tick.tolist() == [*range(10, 51), *range(51)]
    assert [summary(each)["resets"] for each in (once, twice, late)] == [0, 1, 1]
    assert (summary(late)["begin_s"], summary(late)["duration_s"]) == pytest.approx((0.01, 0.091))


def test_more_messages_than_the_recorder_has_written_are_none_that_are_lost(tmp_path: Path) -> None:
    recorder.write(tmp_path / "bag", simulate(scenes.load("case_01", ["time.duration_s=0.05"]), sampled=True))
    (tmp_path / "bag" / "link").symlink_to("nowhere")  # has no size
    once = bag.read(tmp_path / "bag")
    more = replace(once, counts={**once.counts, "/diagnostics": 8})
    assert once.lost["messages written"] == str(sum(once.counts.values()))
    assert [summary(each)["missing"] for each in (once, more)] == [{}, {}]


def test_limits_of_a_free_run_are_none_of_lockstep(recorded: tuple[Path, Trajectory], command: Any) -> None:
    found = command("inspect", str(recorded[0]), "--max-age", "3")
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == "grasp: --max-age 3 is not allowed; allowed: for a free run, a number >= 0\n"


def test_verify_says_in_numbers_what_differs(recorded: tuple[Path, Trajectory], tmp_path: Path, command: Any) -> None:
    path, run = recorded
    found = json.loads(command("verify", str(path), "--json").stdout)
    own = {"commands": 501, "of_the_scene": 501, "announcements_lost": 0}
    assert found == {"bag": str(path), "lockstep": True, "holds": True, "states_compared": 501, "problem": None,
                     "difference": None, "same_without_ROS": True, "controllers": {"left": own, "right": own}}
    command_of_all = run.command.copy()
    command_of_all[20, RIGHT] += 1e-3
    recorder.write(tmp_path / "wrong", replace(run, loop=LoopRecord(command_of_all, run.inputs)))
    asked = command("verify", str(tmp_path / "wrong"), "--json")
    found = json.loads(asked.stdout)
    assert (asked.returncode, found["holds"], found["controllers"]["right"]["of_the_scene"]) == (1, False, 500)
    difference = found["difference"]
    assert (difference["tick"], difference["topic"], difference["name"]) == (24, "joint_states", "right effort")
    assert difference["computed"] - difference["recorded"] == pytest.approx(1e-3)


def test_a_recording_gives_what_the_laws_were_given(recorded: tuple[Path, Trajectory]) -> None:
    path, run = recorded
    given: list[Array] = []

    def notes(_: int, __: float, x: float, v: float) -> float:
        given.append(np.array([x, v]))
        return float(run.command[len(given) - 1, LEFT])

    assert simulate(run.scene, controllers={"left": notes}).state.tobytes() == run.state.tobytes()
    recording = bag.read(path)
    assert recording.measured[:, :2].tobytes() == np.array(given).tobytes()
    assert (recording.measured[:, 4:] == recording.state[:, 4:]).all()
    assert np.isnan(recording.measured[:, 2:4]).all()
    assert np.std(recording.measured[:, 0] - recording.state[:, 0]) == pytest.approx(1e-3, rel=0.1)


def test_a_bag_is_a_table_and_a_motion_with_contacts(recorded: tuple[Path, Trajectory], tmp_path: Path) -> None:
    """The same columns as those of the run; contacts come from the motion that the recorded forces make."""
    path, run = recorded
    recording = bag.read(path)
    ours, theirs = recording.dataframe(), run.dataframe()
    assert ours.attrs["units"] == theirs.attrs["units"]
    for name in theirs:
        assert ours[name].to_numpy().tobytes() == theirs[name].to_numpy().tobytes(), name
    assert recording.dataset()["x_object"].attrs["units"] == "m"
    again = recording.simulated()
    assert again.state.tobytes() == recording.state.tobytes()
    assert again.inputs[:-1].tobytes() == recording.inputs[:-1].tobytes()
    assert again.controllers == {"left": "as recorded", "right": "as recorded"}
    assert len(again.contacts("left")) == 1
    assert again.contacts("left").tobytes() == run.contacts("left").tobytes()
    gap = {name: np.delete(getattr(recording, name), 100, axis=0) for name in ("tick", "state", "effort", "command")}
    with pytest.raises(Refused, match="a tick or a force is missing; allowed: a bag of one run"):
        replace(recording, **gap).simulated()


def test_inspect_writes_the_table(recorded: tuple[Path, Trajectory], tmp_path: Path, command: Any) -> None:
    path, run = recorded
    assert command("inspect", str(path), "-o", "bag.csv").returncode == 0
    run.to_csv(tmp_path / "run.csv")
    assert (tmp_path / "bag.csv").read_text() == (tmp_path / "run.csv").read_text()
    again = command("inspect", str(path), "-o", "bag.csv")
    assert (again.returncode, "--force" in again.stderr) == (2, True)

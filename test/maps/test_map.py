"""Maps: what a file holds, what goes on after a kill, and what is refused."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from processes import GRASP, ran, wait_for

from grasp_ros import scene as scenes
from grasp_ros.cli.main import main
from grasp_ros.cli.map import data_of
from grasp_ros.maps import figures
from grasp_ros.maps import run as runs
from grasp_ros.maps.plan import POINTS, Axis, Plan, read_axis
from grasp_ros.maps.run import run
from grasp_ros.maps.store import STATUS, Store, columns_of, open_group, read
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation.chunk import REFUSED, STATUSES, Setup
from grasp_ros.simulation.ensemble import ensemble
from lab.cases.draw import relative

GAIN, LOSS = "left_feedback.position_gain_N_per_m", "left_contact.dissipation_s_per_m+right_contact.dissipation_s_per_m"
OUTCOMES = ("settling_time", "touches", "last_state")
SHORT = "time.duration_s=1.0"
BEGUN = """
import json, sys
from grasp_ros.maps.plan import Plan
from grasp_ros.maps.run import run
from grasp_ros.physics.errors import Refused
sys.modules["grasp_ros.simulation.ensemble"].CHUNK_S = 1e-9
try: run(Plan.from_document(json.loads(sys.argv[1])), sys.argv[2])
except Refused as error: print(error)
"""


def small_plan(points: int = 12, **settings: object) -> Plan:
    axes = (Axis(GAIN, -20.0, 10.0, 5), Axis(LOSS, 0.01, 1.0, points, True))
    return Plan(scenes.load("case_01", [SHORT]), Setup(OUTCOMES), axes, **settings)  # type: ignore[arg-type]


def assert_same(path: Path, other: Path) -> None:
    found, expected = read(path), read(other)
    for name in ("status", *columns_of(expected)):
        np.testing.assert_array_equal(found[name].values, expected[name].values, name)


@pytest.fixture
def tiny_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[ensemble.__module__], "CHUNK_S", 1e-9)


def test_pixels_of_a_map_lie_around_their_values() -> None:
    assert figures.edges(Axis("object.mass_kg", 1.0, 3.0, 3)) == pytest.approx([0.5, 1.5, 2.5, 3.5])
    assert figures.edges(Axis("object.mass_kg", 10.0, 1e7, 4, True)) == pytest.approx([1.0, 1e2, 1e4, 1e6, 1e8])


def test_a_map_is_an_ensemble_over_two_axes(tmp_path: Path, tiny_chunks: None) -> None:
    plan = small_plan()
    run(plan, tmp_path / "map.zarr")
    data = read(tmp_path / "map.zarr")
    gains, losses = np.linspace(-20.0, 10.0, 5), np.geomspace(0.01, 1.0, 12)
    np.testing.assert_allclose(data[GAIN], gains)
    np.testing.assert_allclose(data[LOSS], losses)
    for i, j in ((0, 3), (2, 0), (4, 11)):
        row = {GAIN: data[GAIN].values[i : i + 1]} | dict.fromkeys(LOSS.split("+"), data[LOSS].values[j:j + 1])
        alone = ensemble(plan.scene, row, OUTCOMES)
        for name, values in alone.columns.items():
            np.testing.assert_array_equal(data[name].values[i, j], values[0])
            assert data[name].attrs["units"]
    assert (data["status"].values[0] == STATUSES.index(REFUSED)).all()  # k + Kp < 0
    assert (data["status"].values[2:] == 0).all()
    found = Plan.from_document(open_group(tmp_path / "map.zarr").attrs["plan"])
    assert found.to_document() == plan.to_document()
    assert open_group(tmp_path / "map.zarr").attrs["versions"]["numba"]


def test_a_sample_does_not_depend_on_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.load("case_01", [SHORT])
    plan = Plan(scene, Setup(OUTCOMES), relative(scene, 0.3), 20, 7)
    assert len(plan.axes) == 17
    run(plan, tmp_path / "whole.zarr")
    monkeypatch.setattr(sys.modules[ensemble.__module__], "CHUNK_S", 1e-9)
    run(plan, tmp_path / "pieces.zarr")
    assert_same(tmp_path / "pieces.zarr", tmp_path / "whole.zarr")
    values = read(tmp_path / "whole.zarr")["object.mass_kg"].values
    assert (np.abs(values / 5.0 - 1.0) <= 0.3).all()
    assert len(set(values)) == 20


def test_chunks_of_slow_rows_are_small(tmp_path: Path) -> None:
    """How long a row takes is measured: a map that is killed again and again gets on."""
    for name, seconds in (("fast", 0.5), ("slow", 2000.0)):
        scene = scenes.load("case_02", [f"time.duration_s={seconds}"])
        run(Plan(scene, Setup(("touches",)), (Axis(GAIN, 5.0, 6.0, 16),)), tmp_path / name)
    fast, slow = (open_group(tmp_path / name)[STATUS].chunks[0] for name in ("fast", "slow"))
    assert slow < min(fast, 16)


def kill(plan: Plan, path: Path, when: Callable[[], bool]) -> None:
    """Begin a map in a process of its own, and kill it."""
    process = subprocess.Popen([sys.executable, "-c", BEGUN, json.dumps(plan.to_document()), str(path)])
    wait_for(lambda: when() or process.poll() is not None, "the moment")
    assert process.poll() is None
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_it_goes_on_after_a_kill_and_computes_only_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tiny_chunks: None
) -> None:
    """A real process, killed when some chunks are done; the file then is that of a run without a kill."""
    path = tmp_path / "killed.zarr"
    plan = Plan(scenes.load("case_01"), Setup(("touches",)), (Axis(GAIN, 1.0, 9.0, 60),))
    # zarr's `4.….partial` is none yet
    kill(plan, path, lambda: sum(file.name.isdigit() for file in path.glob(f"{STATUS}/c/*")) >= 5)
    left = Store(path, plan, 1).spans
    assert 0 < len(left) <= 55
    done: list[int] = []
    monkeypatch.setattr(runs, "compute", lambda variants, *rest: done.append(variants.rows) or compute(variants, *rest))
    run(plan, path)
    assert sum(done) == len(left)
    run(plan, tmp_path / "whole.zarr")
    assert_same(path, tmp_path / "whole.zarr")


compute = runs.compute


def test_threads_that_begin_the_same_map_make_one(tmp_path: Path, tiny_chunks: None) -> None:
    together, plan = tmp_path / "together.zarr", small_plan()
    with ThreadPoolExecutor(3) as pool:
        for begun in [pool.submit(run, plan, together) for _ in range(3)]:
            begun.result()
    run(plan, tmp_path / "alone.zarr")
    assert_same(together, tmp_path / "alone.zarr")
    assert {path.name for path in tmp_path.iterdir()} == {"together.zarr", "alone.zarr"}


@pytest.mark.slow
def test_a_ctrl_c_while_a_map_is_created_leaves_nothing_behind(tmp_path: Path) -> None:
    for trial in range(5):
        (there := tmp_path / str(trial)).mkdir()
        words = ["case_01", "--set", SHORT, "--x", f"{GAIN}=1:9:4", "--outcome", "extremes", "-o", there / "map.zarr"]
        process = subprocess.Popen([*GRASP, "map", *words], stderr=subprocess.PIPE)
        wait_for(lambda there=there: any(there.iterdir()), "the first file")  # type: ignore[misc]
        process.send_signal(signal.SIGINT)
        assert process.communicate()[1].decode().splitlines()[-1] == "grasp: interrupted"
        assert not list(there.glob(".*"))


@pytest.mark.slow
def test_a_map_that_was_killed_while_it_was_created_is_begun_again(tmp_path: Path) -> None:
    path, plan = tmp_path / "there" / "map.zarr", small_plan()
    path.parent.mkdir()
    kill(plan, path, lambda: any(path.parent.iterdir()))
    run(plan, path)
    assert (read(path)["status"].values[2:] == 0).all()


def test_a_chunk_that_lost_a_file_is_not_done(tmp_path: Path, tiny_chunks: None) -> None:
    path, plan = tmp_path / "map.zarr", small_plan()
    run(plan, path)
    shutil.copytree(path, tmp_path / "whole.zarr")
    (path / "touches_left" / "c" / "3" / "0").unlink()
    data = read(path)
    assert (data["status"].values == -1).tolist() == [[row == 3] * 12 for row in range(5)]
    assert np.isnan(data["settling_time"].values[3]).all()
    assert Store(path, plan, 1).spans == [(36, 48)]
    run(plan, path)
    assert_same(path, tmp_path / "whole.zarr")


def test_a_damaged_map_is_refused(tmp_path: Path) -> None:
    path, plan = tmp_path / "map.zarr", small_plan()
    run(plan, path)
    for file, content, words in (
        ("settling_time/zarr.json", None, "a damaged map: without settling_time; allowed: a whole one"),
        (f"{GAIN}/c/0", None, f"a damaged map: without {GAIN}"),
        ("settling_time/zarr.json", b"{", "settling_time: not a whole part of a map"),
        (f"{GAIN}/zarr.json", b"{}", f"{GAIN}: not a whole part of a map"),
        ("settling_time/c/0/0", b"cut off", "settling_time: not a whole column; delete its `c`, and the same command"),
        ("status/c/0/0", "flipped", "status: not a whole column"), (f"{GAIN}/c/0", "flipped", "not a map"),
        ("zarr.json", b"{", "not a map"),
    ):
        before = (path / file).read_bytes()
        (path / file).unlink()
        if content is not None:
            half = len(before) // 2
            flipped = before[:half] + bytes([before[half] ^ 1]) + before[half + 1 :]
            (path / file).write_bytes(flipped if content == "flipped" else content)
        with pytest.raises(Refused, match=re.escape(words)):
            read(path)
        (path / file).write_bytes(before)
    read(path)


def places(node: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to each value of a JSON document."""
    for key in node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
        yield (*way, key)
        yield from places(node[key], (*way, key))


@pytest.mark.slow
def test_metadata_of_another_type_are_refused_or_say_the_same(tmp_path: Path, tiny_chunks: None) -> None:
    path, plan = tmp_path / "map.zarr", small_plan(2)
    run(plan, path)
    (path / "settling_time" / "c" / "3" / "0").unlink()
    whole, answers = read(path), set()
    for file in (path / name / "zarr.json" for name in ("", "settling_time", STATUS, GAIN)):
        before = file.read_text()
        for way in places(json.loads(before)):
            document = json.loads(before)
            *above, last = way
            node = reduce(getitem, above, document)
            node[last] = 1 if isinstance(node[last], str) else "x"
            file.write_text(json.dumps(document))
            for answer in (read, partial(Store, plan=plan, rows=1)):
                try:
                    found = answer(path)
                    answers.add(not isinstance(found, xarray.Dataset) or found.equals(whole))
                except Refused as error:
                    answers.add(str(error).startswith(f"{file.parent}: "))
        file.write_text(before)
    assert answers == {True}


@pytest.mark.slow
def test_a_damaged_chunk_among_many_is_one_line(tmp_path: Path, tiny_chunks: None) -> None:
    run(Plan(scenes.load("case_01", [SHORT]), Setup(("touches",)), (Axis(GAIN, 1.0, 9.0, 100),)), tmp_path / "m.zarr")
    (tmp_path / "m.zarr" / "touches_left" / "c" / "3").write_bytes(b"garbage")
    words = ("map", "case_01", "--set", SHORT, "--x", f"{GAIN}=1:9:100", "--outcome", "touches", "-q", "-o", "m.zarr")
    found = ran(*GRASP, *words, cwd=tmp_path)
    assert found.returncode == 2
    assert re.fullmatch(r"grasp: m.zarr/touches_left: not a whole column; .* decompression error.*\n", found.stderr)


def test_what_is_something_else_is_left_alone(tmp_path: Path) -> None:
    plan = small_plan()
    run(plan, tmp_path / "map.zarr")
    other = Plan(plan.scene, plan.setup._replace(accuracy=1e-12), plan.axes)
    old = json.loads((shutil.copytree(tmp_path / "map.zarr", tmp_path / "old.zarr") / "zarr.json").read_text())
    old["attributes"]["versions"]["numpy"] = "1.0"
    (tmp_path / "old.zarr" / "zarr.json").write_text(json.dumps(old))
    (tmp_path / "text").write_text("mine")
    (tmp_path / "directory").mkdir()
    (tmp_path / "directory" / "mine").write_text("mine")
    for path, asked, words in (
        (tmp_path / "text", plan, "not a map; allowed: a new path"),
        (tmp_path / "directory", plan, "not a map; allowed: a new path"),
        (tmp_path / "old.zarr", plan, r"a map that was made with numpy 1\.0, not .*; allowed: a new path, or a map of"),
        (tmp_path / "map.zarr", other, r"a map of another plan \(setup\); allowed: a new path"),
        (tmp_path / "nowhere" / "\0", plan, "cannot be written|not a map|null byte"),
    ):
        with pytest.raises((Refused, ValueError), match=words):
            run(asked, path)
    assert (tmp_path / "text").read_text() == "mine"
    assert [entry.name for entry in (tmp_path / "directory").iterdir()] == ["mine"]


@pytest.mark.slow
def test_a_full_disk_is_refused_and_what_was_done_is_kept(tmp_path: Path, tiny_chunks: None) -> None:
    """Files of a process that may not grow stand for a full disk: both are an OSError of the write."""
    path, plan = tmp_path / "map.zarr", small_plan()
    Store(path, plan, 1)
    answer = ran(sys.executable, "-c", BEGUN, json.dumps(plan.to_document()), str(path),
                 preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8, 8)))
    assert "cannot be written: File too large; results are kept: the same command resumes" in answer.stdout
    run(plan, path)
    run(plan, tmp_path / "whole.zarr")
    assert_same(path, tmp_path / "whole.zarr")


@pytest.mark.slow
def test_a_worker_that_dies_takes_no_row_with_it(tmp_path: Path, tiny_chunks: None) -> None:
    """Two worker processes of a real cluster, one of which is killed: every chunk is written once, the same bits."""
    from distributed import Client, LocalCluster

    plan = Plan(scenes.load("case_01"), Setup(("settling_time",)), (Axis(GAIN, 1.0, 9.0, 60),))
    run(plan, tmp_path / "alone.zarr")
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster, (
            Client(cluster)) as client:
        workers = client.run(os.getpid)
        reached: list[int] = []

        def kill_one(done: int) -> None:
            reached.append(done)
            if len(reached) == 10:
                os.kill(next(iter(workers.values())), signal.SIGKILL)

        run(plan, tmp_path / "cluster.zarr", scheduler=cluster.scheduler_address, progress=kill_one)
        assert len(set(client.run(os.getpid).values()) - set(workers.values())) <= 1
    assert reached == list(range(61))
    assert_same(tmp_path / "cluster.zarr", tmp_path / "alone.zarr")


@pytest.mark.slow
def test_workers_start_beside_another_cluster(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    with socket.socket() as other:
        with suppress(OSError):  # another one is there
            other.bind(("127.0.0.1", 8787))
            other.listen()
        run(small_plan(), tmp_path / "map.zarr", workers=1)
    assert not [each for each in recwarn if "8787" in str(each.message)]
    assert (read(tmp_path / "map.zarr")["status"].values == STATUSES.index("REFUSED")).sum() == 24


@pytest.mark.slow
def test_a_script_that_its_workers_would_run_again_is_told_what_is_missing(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import json; from grasp_ros.maps.plan import Plan; from grasp_ros.maps.run import run\n"
        f"run(Plan.from_document(json.loads({json.dumps(small_plan().to_document())!r})), 'map.zarr', workers=1)\n")
    last = ran(sys.executable, str(script), cwd=tmp_path).stderr.splitlines()[-1]
    assert "Refused: workers 1: do not start: " in last
    assert last.endswith('allowed: fewer, and in a script the call below `if __name__ == "__main__":`')
    assert not (tmp_path / "map.zarr").exists()


@pytest.mark.slow
def test_the_command_prints_draws_and_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "map.zarr"
    words = ["map", "case_01", "--set", SHORT, "--x", f"{GAIN}=1:9:4", "--y", f"{LOSS}=0.01:1:3:log", "-o", str(path)]
    for _ in range(2):
        assert main(words) == 0
        printed = capsys.readouterr().out
        assert "DONE 12" in printed
    assert (tmp_path / "map_settling_time.png").stat().st_size > 1000
    sample = ["map", "case_01", "--set", SHORT, "--vary", f"{GAIN}=1:9", "--vary", "object.mass_kg=4:6"]
    sample += ["--sample", "9", "--outcome", "peak_impact", "-o", str(tmp_path / "sample.zarr")]
    assert main(sample) == 0
    assert "peak_impact_left" in capsys.readouterr().out


@pytest.mark.slow
def test_a_settling_time_that_nothing_proves_is_counted_and_explained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["map", "case_01", "--set", SHORT, "--set", "loop={}", "--x", f"{GAIN}=1:9:3", "--outcome", "settling_time",
             "--outcome", "last_outside", "-o", str(tmp_path / "map.zarr")]
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert re.search(r"^settling_time( +nan){5} +0 +3$", out, re.M)
    [(largest, infinite)] = re.findall(r"^last_outside .* (\S+) +([0-3]) +0$", out, re.M)
    assert (infinite, largest) == ("3", "inf")  # which quantiles once left out
    assert "settling_time is nan where V_c proves nothing; V_c may rise: commands are held" in err


@pytest.mark.slow
def test_the_command_says_why_runs_did_not_reach_their_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["map", "case_01", "--set", SHORT, "--x", f"{GAIN}=-20:9:3", "--outcome", "touches", "--max-events", "1"]
    assert main([*words, "-o", str(tmp_path / "map.zarr")]) == 0
    err = capsys.readouterr().err
    assert "first run with REFUSED: case_01: left_arm, left_feedback: stiffness_N_per_m + position_gain_N_per_m" in err
    assert "first run with EVENT_BUDGET: stopped: the event budget is used up before the end of the horizon: t =" in err


def test_a_picture_of_somebody_else_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "new_touches_left.png"
    picture.write_text("somebody else's")
    assert main(["map", "case_01", "--set", SHORT, "--x", f"{GAIN}=1:2:2", "-o", str(tmp_path / "new.zarr")]) == 2
    assert "new_touches_left.png: already exists" in capsys.readouterr().err
    assert picture.read_text() == "somebody else's"


def test_more_runs_than_memory_holds_are_refused_before_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A thousand million of them ended in a traceback."""
    monkeypatch.setattr("grasp_ros.maps.plan.MOST", 10**15)
    axes = ["--x", f"{GAIN}=1:2:9999999", "--y", "object.mass_kg=1:2:9999999"]
    assert main(["map", "case_01", *axes, "-o", str(tmp_path / "new.zarr")]) == 2
    assert "case_01: runs: 99999980000001 is not allowed; allowed: as many as fit into" in capsys.readouterr().err


def test_quantiles_between_two_values_are_their_mean() -> None:
    units = {"units": "s"}
    for values, right in ((np.arange(1.0, 21.0), [1.0, 1.5, 10.5, 19.5, 20.0]),
                          (np.array([1.0, 2.0, np.inf, np.inf]), [1.0, 1.0, np.inf, np.inf, np.inf])):
        data = xarray.Dataset({"settling_time": ("row", values, units), "status": ("row", np.zeros(len(values), int))})
        found = data_of(data)["settling_time"]
        assert [found[head] for head in ("least", "5 %", "median", "95 %", "largest")] == right


def test_ranks_of_equal_values_are_equal() -> None:
    plan = Plan(scenes.load("case_01"), Setup(), (Axis(GAIN, 1.0, 9.0),), 5)
    data = {GAIN: xarray.DataArray([1.0, 2.0, 3.0, 4.0, 5.0])}
    assert figures.correlations(data, plan, np.array([0.0, 0.0, 1.0, 0.0, 0.0])) == [(GAIN, 0.0)]


def test_ends_of_an_axis_are_exact() -> None:
    axis = read_axis("--x", "a.b=0.1:0.3:7:log")
    assert axis.values[[0, -1]].tolist() == [0.1, 0.3]
    np.testing.assert_allclose(axis.values, np.geomspace(0.1, 0.3, 7))
    assert read_axis("--vary", "a.b=0.1:0.3::log") == axis._replace(points=POINTS)
    assert read_axis("--x", "a.b=1:20:20").values.tolist() == [*range(1, 21)]
    assert read_axis("--x", "a.b=-1:2:301").values.tolist() == [k / 100 for k in range(-100, 201)]


def test_the_label_of_an_axis_ends_with_its_unit() -> None:
    both = "left_feedback.position_gain_N_per_m+right_feedback.position_gain_N_per_m"
    assert figures.label_of(both) == "left_feedback.position_gain = right_feedback.position_gain, N/m"
    assert figures.label_of("object.velocity_m_per_s") == "object.velocity, m/s"
    assert figures.label_of("left_contact.hertz_N_per_m1_5") == "left_contact.hertz, N/m^1.5"

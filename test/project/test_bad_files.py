"""Damaged and malicious files: none may end in a traceback, a hang or gigabytes, or be taken for valid."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.accuracy.measure import Record
from grasp_ros.physics.errors import LONGEST, Refused
from grasp_ros.scene import files
from grasp_ros.scene.files import replaced, signed
from grasp_ros.scene.strict_yaml import MOST_NODES
from grasp_ros.simulation import plots, simulate
from lab.studies.records import Journal, digest

SECONDS = 10.0  # of this process; no reader takes longer
CASE = scenes.load("case_01").to_yaml()
DURATION = "duration_s: 20.0"


def said(text: str) -> str:
    """What refuses the text of a scene."""
    begin = time.process_time()
    with pytest.raises(scenes.SceneError) as caught:
        scenes.parse(text, "mine", "mine.yaml")
    assert time.process_time() - begin < SECONDS
    assert len(str(caught.value)) < LONGEST + 100
    return str(caught.value)


@pytest.mark.parametrize(
    "value",
    ["!!int 1:30", "!!float 1_0:30", '!!float "2e1"', "!!str 20.0", "! 20.0", "!!python/name:os.system", "!mine 20.0",
     "!!binary eA==", "!!timestamp 2001-01-01", "!!omap [{a: 1}]", "&a 20.0", "*a", "true", "1:30", "0o17", "0x1F",
     "1_0", ".inf", ".nan", "1e999", "9" * 5000, "'20.0'", "[20.0]", "{a: 20.0}", "~", ""],
)
def test_only_a_plain_number_is_a_number(value: str) -> None:
    assert said(CASE.replace(DURATION, f"duration_s: {value}")).startswith("mine.yaml: ")


@pytest.mark.parametrize(("text", "complaint"), [
    ("!!map\n" + CASE, "a tag"),
    ("a: &a [x]\nb: [" + ", ".join(["*a"] * 9) + "]\n", "an anchor or alias"),
    ("title: &a [*a]\n", "an anchor or alias"),
    ("%YAML 1.1\n---\n" + CASE, "a directive"),
    ("%TAG ! tag:x,2000:\n---\n" + CASE, "a directive"),
    (CASE + "---\na: 1\n", "single document"),
    (CASE + "<<: {tilt: {angle_rad: 0.1}}\n", "<<: unknown key"),
    ("[" * 100_000, "nested too deeply"),
    ("{a: " * 100_000, "nested too deeply"),
    ("- " * 100_000, "nested too deeply"),
    ("? " * 100_000, "nested too deeply"),
    ("title: [" + "1," * 300_000, f"more than {MOST_NODES}"),
    ("x" * 2_000_000, "larger than"),
    (CASE.replace("title: ", 'title: "\\ud800" #'), "without control characters"),
    (CASE.replace("title: ", 'title: "\\e]0;owned\\a" #'), "without control characters"),
    (CASE.replace("title: ", "title: ['" + "x" * 100_000 + "'] #"), "is not allowed"),
    (CASE + "\0", "special characters are not allowed"), (CASE + "loop: {", "column 8: loop: {"),
    ('title: x\nwatch: "\\UFFFFFFFF"\n', "line 2: a value cannot be read: "),
    ('title: x\nwatch: "\\U00110000"\n', "line 2: a value cannot be read: "),
])
def test_yaml_that_a_scene_does_not_need_is_refused(text: str, complaint: str) -> None:
    assert complaint in said(text)


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.yaml"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(scenes.SceneError, match=r"large\.yaml: larger than 1048576 bytes"):
        scenes.load(str(path))


@pytest.mark.parametrize("sampled", [False, True])
def test_more_control_periods_than_any_run_can_have_are_refused_at_once(sampled: bool) -> None:
    settings = ["object_sine.amplitude_N=1", "object_sine.frequency_Hz=1", "time.duration_s=1e9"]
    for grid in (None, np.array([0.0, 1.0])):
        with pytest.raises(Refused, match=r"\d{12,} control periods with an input each; allowed: max_work, "):
            simulate(scenes.load("case_01", settings), sampled=sampled, grid=grid)


@pytest.fixture(scope="module")
def arrays(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    path = tmp_path_factory.mktemp("result") / "a.npz"
    simulate(scenes.load("case_01"), grid=np.linspace(0.0, 20.0, 5)).save(path)
    with np.load(path) as data:
        return dict(data)


def header(dtype: str, shape: str) -> bytes:
    text = f"{{'descr': {dtype}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def store(path: Path, arrays: dict[str, np.ndarray], **members: bytes | None) -> Path:
    """A result file in which some members have other bytes, or are not there."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in arrays.items():
            file = io.BytesIO()
            np.save(file, values)
            content = members.get(name, file.getvalue())
            if content is not None:
                archive.writestr(f"{name}.npy", content)
        for name in members.keys() - arrays.keys():
            archive.writestr(f"{name}.npy", members[name] or b"")
    return path


@pytest.mark.parametrize(("members", "complaint"), [
    ({"t": None}, "digest: "), ({"more": b"x"}, "more: not a NumPy array"), ({"t": b""}, "t: not a NumPy array"),
    ({"t": header("'|O'", "(5,)") + b"cos\nsystem\n(S'true'\ntR."}, "t: Object arrays cannot be loaded"),
    ({"t": header("'<f8'", "(1000000000000,)")}, "t: (Unable to allocate|EOF)"),
    ({"t": header("'<f8'", "(5000,)")}, "t: EOF"),
    ({"t": header("'<f8'", "(-5,)")}, "t: negative"), ({"t": header("'<f8'", "5")}, "t: shape is not valid"),
    ({"t": header("[('a', '<f8')]", "(5,)") + bytes(40)}, "digest: "),
    ({"t": header("(" * 2000, "(5,)") + bytes(40)}, "t: .*(too many nested|EOF in)"),
    ({"t": header("'<f8', 'x': __import__('os')", "(5,)") + bytes(40)}, "t: malformed"),
    ({"scene": header("'<U1'", "()") + b"\xff\xff\xff\xff"}, "invalid maximum character"),
])
def test_arrays_that_numpy_does_not_write_are_refused(
    tmp_path: Path, arrays: dict[str, np.ndarray], members: dict[str, bytes | None], complaint: str
) -> None:
    with pytest.raises(Refused, match=r"a\.npz: not a file of `grasp simulate`: .*" + f"({complaint})"):
        simulation.load(store(tmp_path / "a.npz", arrays, **members))


@pytest.mark.parametrize(("name", "value"), [
    ("t", np.array(list("abcde"))), ("t", np.zeros(5, complex)), ("t", np.zeros(5, np.float32)), ("t", np.arange(5)),
    ("state", np.zeros((5, 6), ">f8")), ("state", np.zeros((2, 6))), ("events", np.zeros(3)),
    ("events", np.zeros((3, 4))), ("sampled", np.array("yes")), ("scene", "title: 5"), ("method", "euler"),
    ("status", "FINE"), ("status", np.array("DONE", dtype=object)), ("setting", "fine"), ("setting", np.zeros(2)),
    ("work", np.zeros(2)), ("work_names", np.array(["a"] * 4)), ("touch_left", np.zeros(0)), ("energy_of", "mine"),
    ("more", np.zeros(5)),
])
def test_arrays_that_are_not_those_of_a_run_are_refused(
    tmp_path: Path, arrays: dict[str, np.ndarray], name: str, value: Any
) -> None:
    np.savez(tmp_path / "a.npz", **signed({**arrays, name: value}))
    with pytest.raises(Refused, match=r"a\.npz: "):
        simulation.load(tmp_path / "a.npz")


def test_an_encrypted_or_swollen_result_is_refused(
    tmp_path: Path, arrays: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    content = bytearray(store(tmp_path / "a.npz", arrays).read_bytes())
    place = content.index(b"PK\x01\x02") + 8
    content[place] |= 1
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(Refused, match="encrypted"):
        simulation.load(tmp_path / "a.npz")
    monkeypatch.setattr(files, "MOST_BYTES", 2**20)
    with zipfile.ZipFile(tmp_path / "b.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in arrays:
            archive.writestr(f"{name}.npy", bytes(2**16))
    with pytest.raises(Refused, match="bytes of numbers; allowed: at most"):
        simulation.load(tmp_path / "b.npz")


@pytest.mark.slow
def test_an_output_is_never_the_input_and_replaces_nothing_unasked(command: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(scenes.load("arm_alone").to_yaml())
    (tmp_path / "link.npz").symlink_to("mine.yaml")
    before = (tmp_path / "mine.yaml").read_bytes()
    choice = "design", "mine.yaml", "--free", "left_arm.position_m=-1:1", "--minimise", "touches_left"
    for words, output in ((choice, "mine.yaml"), (("simulate", "mine.yaml"), "link.npz")):
        result = command(*words, "-o", output, "--force")
        assert result.returncode == 2
        assert f"-o {output}: is the input; allowed: another file" in result.stderr
    assert (tmp_path / "mine.yaml").read_bytes() == before
    for line in (("simulate", "mine.yaml", "-o", "a.npz"), ("plot", "a.npz"), ("plot", "mine.yaml", "-o", "b.svg")):
        assert command(*line).returncode == 0
        again = command(*line)
        assert again.returncode == 2
        assert "already exists; allowed: a new file, or --force to replace it" in again.stderr
        assert command(*line, "--force").returncode == 0
    assert {path.suffix for path in tmp_path.iterdir()} == {".yaml", ".npz", ".png", ".svg"}  # and nothing half done


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.npz").write_bytes(b"precious")

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(Refused, match="No space left on device"):
        simulate(scenes.load("arm_alone")).save(tmp_path / "a.npz")
    assert (tmp_path / "a.npz").read_bytes() == b"precious"
    assert len(list(tmp_path.iterdir())) == 1


def test_what_is_half_done_lies_where_the_file_will_be_under_a_name_of_its_own(tmp_path: Path) -> None:
    """A link to another disk, a long name, and a part that a killed process has left under our number were refused."""
    there = tmp_path / "there"
    there.mkdir()
    links = {name: tmp_path / f"{name}.npz" for name in ("link", "loop", "漢" * 80)}
    links["link"].symlink_to(there / "other")
    links["loop"].symlink_to(links["loop"])
    (tmp_path / f".link.{threading.get_native_id()}.part.npz").touch()
    for name, link in links.items():
        with replaced(link) as part:
            assert (part.parent, part.suffix) == (there if name == "link" else tmp_path, ".npz")
            part.touch()
        assert link.is_file()
    assert [path.name for path in there.iterdir()] == ["other"]


@pytest.mark.parametrize("title", ["costs $5 and $x^{, Größe äöü", "\\frac{$" + "x" * 5000])
def test_a_title_is_a_text_and_no_formula(tmp_path: Path, title: str) -> None:
    case = scenes.load("arm_alone")
    case = scenes.compose("mine", case.values, title=title)
    plots.draw(simulate(case), tmp_path / "a.png", "caption")
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_a_figure_without_latex_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(Refused, match=r"pgf: .*not found"):
        plots.draw(simulate(scenes.load("arm_alone")), tmp_path / "a.pgf", "caption")
    assert not list(tmp_path.iterdir())


def test_a_line_of_a_journal_that_was_changed_is_refused(tmp_path: Path) -> None:
    record = Record("s", "f", "m", "k", 1.0, None, 1.0, 1.0, 3, 1.0, None, 2, (1, 2), (3, 4), "done")
    Journal(tmp_path).put("a", record)
    assert Journal(tmp_path).get("a", Record) == record
    assert Journal(tmp_path).get("b", Record) is None
    path = tmp_path / "journal.jsonl"
    line = json.loads(path.read_text())
    for name, other in (("setting", 10**400), ("setting", True), ("there_are", [1]), ("status", None), ("x", 1)):
        value = {**line["value"], name: other}
        path.write_text(json.dumps({**line, "value": value, "sum": digest("a", json.dumps(value))}) + "\n")
        with pytest.raises(Refused, match="not what a study writes"):
            Journal(tmp_path).get("a", Record)
    path.write_text(json.dumps({**line, "value": {**line["value"], "setting": 2.0}}) + "\n")
    with pytest.raises(Refused, match="line 1: its checksum is wrong"):
        Journal(tmp_path)


CACHE = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
(Path(sys.argv[1]) / "rest").write_bytes(bytes(9000))
import ours
print(ours.twice(21.0))
"""
KERNEL = "from grasp_ros.exact.compilation.jit import kernel\n@kernel\ndef twice(x):\n    return 2.0 * x\n"


def test_a_full_disk_under_the_cache_of_kernels_only_costs_time(tmp_path: Path) -> None:
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode:
        pytest.skip("no file system may be mounted here")
    (tmp_path / "ours.py").write_text(KERNEL)
    script = 'mount -t tmpfs -o size=16k none "$0" && cp "$3" "$0" && exec "$2" -c "$1" "$0"'
    disk = tmp_path / "disk"
    disk.mkdir()
    result = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script, str(disk), CACHE, sys.executable, str(tmp_path / "ours.py")],
        capture_output=True, text=True, timeout=60.0, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "XDG_CACHE_HOME": str(disk)},
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout == "42.0\n"

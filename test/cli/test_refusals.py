"""What the command line refuses ends in one line and the status 2; a fault of ours shows its traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import GRASP, ran

from grasp_ros import scene as scenes
from grasp_ros.cli.main import main
from grasp_ros.cli.parser import LONGEST
from grasp_ros.physics.errors import needing
from grasp_ros.physics.observation import CALLABLE

LONG = "a" * 5000
GAIN = "left_feedback.position_gain_N_per_m"


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory full of what is not what it should be."""
    monkeypatch.chdir(tmp_path)
    for name, content in {
        "file": b"x", "bytes.yaml": b"\xff\xfe\x00", "date.yaml": b"title: 2001-13-45\n",
        "digits.yaml": b"title: x\nreadings: " + b"1" * 5000, "empty.npz": b"", "nomarks.md": b"x", "bytes.md": b"\xff",
        "keys/journal.jsonl": b'{"a": 1}\n', "list/journal.jsonl": b"[]\n", "bytes/journal.jsonl": b"\xff\n",
        "exits.py": b"import sys; sys.exit(0)", "breaks.py": b"raise BrokenPipeError",
        "words/journal.jsonl": b"not JSON\n", "bag/metadata.yaml": b"[" * 20_000,
        "there.npz/x": b"", "folder.yaml/x": b"", "no.mcap": b"x", "packed/x.db3.zstd": b"x", "x.mcap.zstd": b"x",
        "split/0.mcap": b"x", "split/1.mcap": b"x",
    }.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(content)
    Path("long.yaml").write_text(scenes.load("case_01").to_yaml().replace("mass_kg", "m" * 5000))
    np.savez("other.npz", a=1)
    Path("full.npz").symlink_to("/dev/full")
    Path("circle.yaml").symlink_to("circle.yaml")
    return tmp_path


@pytest.mark.parametrize(("words", "complaint"), [
    ("simulate case_01 --grid 1", "argument --grid: 1 is not allowed; allowed: a whole number >= 2"),
    ("simulate case_01 --max-work 1e3", "argument --max-work: 1e3 is not allowed; allowed: a whole number >= 1"),
    ("simulate case_01 --controller laws:soft", "laws:soft is not allowed; allowed: side=module:object"),
    *((f"{program} case_01 --controller left=grasp_ros.cli.main:main",
       f"too many positional arguments; allowed: {CALLABLE}") for program in ("run", "simulate")),
    ("run case_01 --controller left=math:sin --controller left=math:cos", "allowed: one for the left side"),
    ("simulate case_01 --controller up=laws:soft", "allowed: side=module:object, with the side left or right"),
    ("simulate case_01 --controller left=nowhere:soft", "left=nowhere:soft: no module nowhere; allowed: one of"),
    ("simulate case_01 --controller left=math:soft", "left=math:soft: math has no soft ("),
    ("simulate case_01 --controller left=math:pi", "left=math:pi: 3.14159"),
    ("simulate case_01 --method rk4 --controller left=math:hypot", "rk4: "),
    ("accuracy case_01 --error x", "argument --error: invalid float value: 'x'"),
    ("accuracy case_01 --error 1_0", "argument --error: invalid float value: '1_0'"),
    ("simulate nowhere", "nowhere: no such scene; allowed: a path that ends in .yaml, or one of case_01"),
    ("simulate nowhere.yaml", "nowhere.yaml: no such file"),
    (f"simulate {LONG}.yaml", "cannot be read: File name too long"),
    (f"fit {LONG} --free object.mass_kg", "cannot be read: File name too long"),
    ("simulate folder.yaml", "folder.yaml: is no file"),
    *((f"{program} {word}", f"argument bag: {word!r} is not allowed; allowed: a name") for word in ("", "-")
      for program in ("inspect", "verify", "recover", "replay", "watch")),
    ("plot ", "'': no such scene"),
    ("fit  --free object.mass_kg", "'' is not allowed; allowed: a name"),
    *((f"verify {name}", words) for name, words in (
        ("bag/metadata.yaml", "bag/metadata.yaml: the metadata of a bag; the bag is its directory, bag"),
        ("split", "split: not a bag of this package: holds 2 .mcap files; allowed: one, as `rosbags-convert"),
        ("packed", "packed: its storage is sqlite3; allowed: MCAP, as `rosbags-convert"),
        ("packed/x.db3.zstd", "packed/x.db3.zstd: its storage is sqlite3; allowed: MCAP, as `rosbags-convert"),
        ("x.mcap.zstd", "x.mcap.zstd: its file is compressed as a whole; allowed: chunks, as `rosbags-convert"))),
    ("plot no.mcap", "no.mcap: not a bag of this package"),
    ("fit no.mcap --free object.mass_kg", "no.mcap: not a bag of this package"),
    ("map case_01 --x object.mass_kg=1:2:10^12 -o m.zarr", "then :n for 2 to 1,000,000,000 values"),
    ("map case_01 -o m.zarr", "parameters to vary: none"),
    *((f"map case_01 -o m.zarr {words}", answer) for words, answer in (
        ("--x mass", "--x mass: not understood; allowed: section.key=low:high"),
        (f"--x {GAIN}=9:1:4", "9.0 to 1.0 is not allowed"), (f"--x {GAIN}=-1:1:4:log", "> 0 where logarithmic"),
        ("--x object.mass_kg=-1:1", "object.mass_kg: -1.0 is not allowed; allowed: a number >= 1e-12"),
        ("--x object.weight=1:2", "object.weight: not in this scene"),
        (f"--x {GAIN}=1:2 --outcome joy", "outcome joy: not known; allowed: settling_time"),
        (f"--vary {GAIN}=1:2", "--vary: allowed: with --sample N"),
        (f"--x {GAIN}=1:2:2 --seed 1", "--seed: allowed: with --sample N"),
        (f"--x {GAIN}=1:2:3 --sample 9",
         "n=3 is for a map's axes; allowed: section.key=low:high, + between keys with one value; then ::log"),
        (f"--x {GAIN}=1:2 --settled 2", "settled: 2.0"),
        (f"--x {GAIN}=1:2:99999 --y object.mass_kg=1:2:99999", "axes: 9,999,800,001 runs; allowed: at most"))),
    pytest.param(f"map case_01 -o m.zarr --x {GAIN}=1:2:2 --scheduler tcp://127.0.0.1:9", "nobody answers",
                 marks=pytest.mark.slow),
    ("design case_01 --sampled --free time.control_period_s=0.001:0.01 --minimise touches_left",
     "a finite touches_left; case_01: time.control_period_s: "),
    ("simulate circle.yaml", "circle.yaml: no such file"),
    ("simulate bytes.yaml", "bytes.yaml: 'utf-8' codec can't decode byte 0xff"),
    ("simulate digits.yaml", "digits.yaml: time: missing"),
    ("simulate date.yaml", "date.yaml: readings: missing; allowed"),
    ("simulate case_01 --set left_arm.mass_kg=2001-13-45", "'2001-13-45' is not allowed; allowed: a number"),
    ("simulate case_01 --set left_arm.mass_kg=\a", "special characters are not allowed"),
    ("simulate case_01 --set a\nb", "setting a b: not understood"),
    ("simulate case_01 --grid 1000000000000", "--grid: 1000000000000 is not allowed; allowed: as many as fit"),
    (f"simulate case_01 --grid {10**30}", "is not allowed; allowed: as many as fit into memory"),
    ("simulate case_01 --sampled --set time.duration_s=1e9 --set time.control_period_s=1e-9",
     "case_01: time.duration_s / control_period_s: 1000000000000000000 is not allowed"),
    ("simulate case_01 --method paper --tolerance 1", "--tolerance is not allowed; allowed for paper: --step"),
    ("simulate case_01 --method rk4 --accuracy 1e-8", "--accuracy is not allowed; allowed for rk4: --step"),
    ("simulate case_01 -o there.npz", "there.npz: cannot be written: Is a directory"),
    ("simulate case_01 -o a.txt", "a.txt: .txt is not allowed; allowed: .npz, .csv"),
    ("simulate case_01 -o ", ".: needs an ending, one of .npz, .csv"),
    ("inspect bag -o x.npz", "x.npz: .npz is not allowed; allowed: .csv"),
    ("accuracy case_01 -o x.csv", "x.csv: .csv is not allowed; allowed: ."),
    ("design case_01 --free object.mass_kg=1:2 --minimise touches -o x.png", "x.png: .png is not allowed; allowed"),
    ("fit other.npz --free object.mass_kg -o x.txt", "x.txt: .txt is not allowed; allowed: .yaml, .yml, ."),
    ("map case_01 --x object.mass_kg=1:2:2 -o -", "-: needs an ending, one of .zarr"),
    ("plot arm_alone --animate -o x.png", "x.png: .png is not allowed; allowed: .gif, .html"),
    ("run case_01 -o -", "argument -o/--output: '-' is not allowed; allowed: a name"),
    ("recover bag -o ", "argument -o/--output: '' is not allowed; allowed: a name"),
    ("simulate case_01 -o file/x.npz", "file/x.npz: cannot be written: Not a directory"),
    ("simulate case_01 --set time.duration_s=1e9 -o no/x.npz", "no/x.npz: cannot be written: No such file"),
    ("simulate case_01 -o full.npz", "full.npz: cannot be written: No space left on device"),
    (f"simulate case_01 -o {LONG}.npz", "cannot be written: File name too long"),
    ("run case_01 -o .", ".: already exists; allowed: a new directory"),
    ("run case_01 --controller left=math:sin --without left_controller -o z",
     "left_controller: --controller and --without; allowed: one of the two"),
    ("run case_01 -o file/x", "file/x: cannot be written: Not a directory"),
    ("run case_01 -o z --max-age 3", "--max-age 3 is not allowed; allowed: for a free run, a number >= 0"),
    ("run case_01 -o z --free-running --min-factor -1", "--min-factor -1 is not allowed; allowed: for a free run"),
    ("run case_01 -o z --free-running --max-age nan", "--max-age nan is not allowed; allowed: for a free run"),
    ("run case_01 -o \udcff", "allowed: a name in UTF-8"),
    *((f"run case_01 -o z --peer-timeout {word}", f"peer_timeout_s: {word} is not allowed; allowed: a number > 0")
      for word in ("0", "-1", "nan", "70")),
    ("run case_01 -o z --free-running 0", "--free-running: 0.0 is not allowed; allowed: 1e-06 to 1e+06"),
    ("replay nope --rate 0", "--rate: 0.0 is not allowed; allowed: 1e-06 to 1e+06"),
    ("run case_01 -o z --free-running nan", "--free-running: nan is not allowed"),
    ("run case_01 -o z --controller left=nowhere:soft", "left_controller: law: nowhere:soft: no module nowhere;"),
    *((f"run case_01 -o z --controller left={module}:law", f"cannot be imported: {error}")
      for module, error in (("exits", "SystemExit: 0"), ("breaks", "BrokenPipeError, "))),
    ("run case_01 --accuracy 2", "accuracy: 2.0"),
    ("ctl --namespace lab status", "'lab' is not allowed; allowed: / and names of ROS such as /lab/one"),
    ("watch --namespace /1a", "'/1a' is not allowed"),
    ("inspect nothing", "nothing: cannot be read: No such file or directory"),
    ("inspect file", "file: not a bag of this package"),
    ("inspect bag", "bag: not a bag of this package"),
    (f"plot {LONG}", "cannot be read: File name too long"),
    ("plot file", "file: no such scene; allowed: a scene, a bag (a directory, or .mcap), or a .npz file of"),
    ("fit file --free object.mass_kg", "file: needs an ending, one of .mcap, .npz, .csv"),
    ("plot list", "list: not a bag of this package"),
    ("plot nothing.npz", "nothing.npz: cannot be read: No such file or directory"),
    ("plot empty.npz", "empty.npz: not a file of `grasp simulate`"),
    ("plot other.npz", "other.npz: not a file of `grasp simulate`"),
    ("plot arm_alone -o x.nonsense", "x.nonsense: .nonsense is not allowed; allowed: ."),
    ("plot arm_alone -o .png", ".png: needs an ending, one of "),
    ("plot arm_alone -o no/x.png", "no/x.png: cannot be written: No such file or directory"),
    ("lab accuracy -o file/x", "file/x/accuracy: cannot be written: Not a directory"),
    ("lab accuracy --quick -o keys", "keys/journal.jsonl: not the journal of a study"),
    ("lab accuracy --quick -o list", "list/journal.jsonl: not the journal of a study"),
    ("lab accuracy --quick -o bytes", "bytes/journal.jsonl: 'utf-8' codec can't decode"),
    ("lab accuracy --quick -o words", "words/journal.jsonl: not the journal of a study"),
    ("lab accuracy --quick --docs file/x", "file/x/accuracy.md: cannot be written"),
    ("lab effects --docs file/x", "file/x/costs.md: cannot be written: Not a directory"),
    ("lab certificate --docs file/x", "file/x/jumps.md: cannot be written: Not a directory"),
    ("lab digits --docs file/x", "file/x/digits.md: cannot be written: Not a directory"),
    ("lab hard --docs file/x", "file/x/hard.md: cannot be written: Not a directory"),
    ("lab fuzz --seconds nan", "--seconds nan is not allowed"),
    ("lab fuzz --seed -1", "--seed: -1 is not allowed"),
    ("lab fuzz --draws 0", "--draws: 0 is not allowed"),
    ("lab fuzz --jobs 0", "--jobs: 0 is not allowed"),
    ("lab fuzz --draws 1 -o file/x", "file/x/scene.yaml: cannot be written: Not a directory"),
    ("lab readers --count 1 -o file/x", "file/x/file: cannot be written: Not a directory"),
    ("simulat case_01", "argument command: simulat is not allowed; did you mean simulate?"),
    ("simulate case_01 --setting a=1", "did you mean --set?"),
    ("simulate case_1", "case_1: no such scene; did you mean case_01 or case_10 or case_11"),
    ("simulate case_01 --set left_contact.dissipation=1", "did you mean left_contact.dissipation_s_per_m?"),
    ("simulate case_01 --set left_contakt={}", "did you mean left_contact?"),
    ("simulate case_01 --method rk5", "argument --method: rk5 is not allowed; did you mean rk45?"),
    ("simulate case_01 --set zzz.qqq=1", "no such key; allowed: time.duration_s, "),
    ("new", "the following arguments are required: FILE.yaml"),
    ("simulate case_01 --nonsense", "grasp simulate: error: "), ("nothing", "grasp: error: "),
    ("simulate --grid x case_01", "grasp simulate: error: "),
    ("simulate long.yaml", "long.yaml: mapping values are not allowed here"),
    ("plot case_01 --from 3 --to 2", "--from 3 --to 2 is not allowed; allowed: ascending from 0 s on"),
    ("plot case_01 --from 99", "--from 99 --to 20 is not allowed; allowed: within 0 to 20 s"),
    ("plot case_01 --to 21", "--from 0 --to 21 is not allowed; allowed: within 0 to 20 s"),
    ("plot case_01 case_03 --sensitivity object.mass_kg", "--sensitivity: allowed: one scene, without --animate"),
    ("plot case_01 --sensitivity object.colour", "object.colour: not in this scene"),
    ("plot case_01 --animate --panel input", "--panel: allowed: without --animate"),
    ("plot case_01 --panel force", "allowed: displacement, input, impact, energy"),
    ("plot case_01 --speed 2", "--speed: allowed: with --animate"),
    ("plot case_01 --width 5", "width_mm: 5.0 is not allowed; allowed: 60 to 1000 mm"),
    ("lab nosuch", "argument name: nosuch is not allowed; allowed: paper, domain, "),
    ("lab steering nothing", "nothing: no such scene"),
])
def test_bad_input_ends_in_a_line(workplace: Path, command: Any, lab_command: Any, words: str, complaint: str) -> None:
    before = set(workplace.rglob("*"))
    program, *rest = words.split(" ")
    result = lab_command(*rest) if program == "lab" else command(program, *rest)
    *others, last = result.stderr.splitlines()
    assert result.returncode == 2
    assert program == "lab" or not [line for line in others if "warning: " not in line]
    assert last.startswith(("grasp", "python -m lab"))
    assert complaint in last
    assert len(last) <= LONGEST
    assert "a node" not in last
    new = [path for path in set(workplace.rglob("*")) - before if "__pycache__" not in str(path)]
    assert not [path for path in new if path.is_file() or program == "run"]


@pytest.mark.parametrize("fault", [ValueError, OSError, MemoryError, KeyError, TypeError, RuntimeError])
def test_a_fault_of_ours_is_not_taken_for_bad_input(monkeypatch: pytest.MonkeyPatch, fault: type[Exception]) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise fault("ours")

    monkeypatch.setattr("grasp_ros.cli.simulate.simulate", broken)
    with pytest.raises(fault, match="ours"):
        main(["simulate", "case_01"])


FAULT = """
import sys
from grasp_ros.cli import scenes
from grasp_ros.cli.main import main
from grasp_ros.cli.parser import LONGEST
from grasp_ros.physics.errors import Refused
def broken(*_):
    raise {raised}
scenes.show = broken  # a command that begins at once
sys.exit(main(["scenes"]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(("raised", "status", "last"), [
    ("Refused('as it is')", 2, "grasp: as it is"),
    ("ValueError('a fault of ours')", 1, "ValueError: a fault of ours"),
    ("KeyboardInterrupt", 130, "grasp: interrupted"),
    ("BrokenPipeError", 0, ""),
    ("OSError(28, 'No space left')", 1, "grasp: the output cannot be written: No space left"),
])
def test_exit_statuses(raised: str, status: int, last: str) -> None:
    result = ran(sys.executable, "-c", FAULT.format(raised=raised))
    assert result.returncode == status
    assert [*result.stderr.splitlines(), ""][-2 if last else -1] == last
    assert ("Traceback" in result.stderr) == (raised.startswith("ValueError"))


@pytest.mark.slow
def test_a_title_that_the_terminal_cannot_show_is_printed_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.yaml").write_text(scenes.load("arm_alone").to_yaml().replace("title: ", "title: 'ä' #"), "utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    result = ran(*GRASP, "simulate", str(tmp_path / "mine.yaml"))
    assert result.returncode == 0, result.stderr
    assert "\\xe4" in result.stdout
    result = ran(*GRASP, "scenes", str(tmp_path / "mine.yaml"), "--json")
    assert json.loads(result.stdout)["title"] == "ä"


@pytest.mark.slow
def test_directories_of_others_are_refused_in_a_line(tmp_path: Path) -> None:
    """Also where the working directory is one, as after `sudo -u`."""
    own = [] if os.getuid() else ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"]  # root as a user
    if own and subprocess.run([*own, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no capability may be given up here")
    shut = tmp_path / "shut"
    shut.mkdir()
    grasp = f"exec {' '.join(own)} {sys.executable} -P -m grasp_ros.cli -q"
    for words, door in (("recover shut/bag/bag", "shut/bag/bag: cannot be read"),
                        ("run case_01 -o shut/of/run", "shut/of/run: cannot be written"),
                        ("map case_01 --x object.mass_kg=4:6:2 -o shut/of/m.zarr", "shut/of/m.zarr: cannot be written"),
                        ("simulate arm_alone", "")):
        result = ran("sh", "-c", f"cd {tmp_path if door else shut}; chmod 0 {shut}; {grasp} {words}")
        shut.chmod(0o700)
        assert result.stderr.removeprefix("grasp: ") == (f"{door}: Permission denied\n" if door else "")
        assert result.returncode == (2 if door else 0)


@pytest.mark.parametrize("program", ["cli simulate case_01", "cli run case_01 --one-process", "graph plant"])
def test_threads_that_numba_cannot_start_are_refused(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "0")
    result = ran(sys.executable, "-m", *f"grasp_ros.{program}".split())
    assert result.stderr.endswith(": NUMBA_NUM_THREADS: 0 is not allowed; allowed: a whole number >= 1\n")
    assert "Traceback" not in result.stderr
    assert result.returncode == 2


@pytest.mark.slow
def test_a_regression_scene_that_is_not_there_is_refused() -> None:
    result = ran(sys.executable, "-m", "lab.cases.regression", "back_to_a_touching_rests")
    assert result.stderr.endswith("back_to_a_touching_rests is not allowed; did you mean back_to_a_touching_rest?\n")
    assert result.returncode == 2


@pytest.mark.slow
def test_a_study_without_its_packages_names_the_one_that_is_missing() -> None:
    program = ("import sys; sys.modules['gmpy2'] = None; from lab.__main__ import main;"
               " sys.exit(main(['hard', '--alone']))")
    result = ran(sys.executable, "-c", program)
    assert result.returncode == 2
    assert result.stderr == "grasp: this needs gmpy2; pip install gmpy2\n"


WITHOUT = """
import sys
for name in {missing}:
    sys.modules[name] = None
from grasp_ros.{program} import {main}
sys.exit({main}())
"""


@pytest.mark.slow
@pytest.mark.parametrize(("missing", "program", "words", "said"), [
    (["scipy"], "cli.main:grasp", "simulate case_01 --method lsoda", "grasp: lsoda needs scipy; pip install scipy"),
    (["scipy", "zarr"], "cli.main:grasp", "map case_01 --vary object.mass_kg=1:2 --sample 2 -o x.zarr",
     "grasp: `grasp map` needs zarr, scipy; pip install zarr scipy"),
    (["mcap"], "cli.main:grasp", "inspect none", "grasp: this needs mcap; pip install mcap"),
    (["zstandard"], "cli.main:grasp", "verify none", "grasp: this needs zstandard; pip install zstandard"),
    (["rclpy", "rosbags"], "cli.main:grasp", "run case_01 -o x",
     "grasp: this needs rclpy, rosbags; pip install ros-jazzy-rclpy[fastrtps] rosbags"),
    (["yaml"], "cli.main:grasp", "simulate case_01", "grasp: this needs yaml; pip install PyYAML"),
    (["mcap"], "graph.__main__:start", "monitor", "monitor: this needs mcap; pip install mcap"),
    (["std_srvs"], "graph.__main__:start", "plant",
     "plant: this needs std_srvs; pip install ros-jazzy-common-interfaces"),
    (["rcl_interfaces"], "graph.__main__:start", "plant",
     "plant: this needs rcl_interfaces; pip install ros-jazzy-rclpy[fastrtps]"),
])
def test_a_package_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: list[str], program: str, words: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    module, main = program.split(":")
    result = ran(sys.executable, "-c", WITHOUT.format(missing=missing, program=module, main=main), *words.split())
    assert result.stderr.splitlines()[-1] == said
    assert result.returncode == 2
    assert not [*tmp_path.iterdir()]


def test_a_module_of_ours_that_is_missing_is_a_fault() -> None:
    with pytest.raises(ModuleNotFoundError), needing("this"):
        raise ModuleNotFoundError("No module named 'grasp_ros.nothing'", name="grasp_ros.nothing")

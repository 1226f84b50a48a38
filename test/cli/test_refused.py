"""What is refused is refused in one line by one exception, and a fault of ours is not taken for it."""

from __future__ import annotations

import ast
import contextlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

import grasp_ros
from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.cli import studies
from grasp_ros.cli.main import main
from grasp_ros.exact.integrator import ACCURACY, Integrator
from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import decoding, reading, writing
from grasp_ros.scene.topics import FORCE, JOINT_STATES, LYAPUNOV
from grasp_ros.simulation import plots, simulate
from grasp_ros.simulation.versions import versions
from grasp_ros.studies import document
from grasp_ros.studies.records import Journal

ROOT = Path(grasp_ros.__file__).parent
LONG = "a" * 5000
OUR_OWN = ("verification/reference.py", "studies/certificate.py")  # bare ValueErrors that no input of a user reaches
START = [sys.executable, "-m", "grasp_ros.graph.nodes.start"]
SECONDS = 60.0


def ran(program: list[str]) -> subprocess.CompletedProcess[str]:
    """A process that has ended."""
    return subprocess.run(program, capture_output=True, text=True, timeout=SECONDS, check=False)


def recorded(path: Path) -> Path:
    """A bag of three ticks, recorded without a graph."""
    scene = scenes.load("case_01", ["time.duration_s=0.002"])
    store = get_typestore(Stores.ROS2_JAZZY)
    types, zeros = store.types, np.zeros(3)
    nothing = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    wrench = types["geometry_msgs/msg/Wrench"](force=nothing, torque=nothing)
    recorder = bag.Recorder(path, scene, versions())
    for time_ns in range(0, (scene.ticks + 1) * scene.period_ns, scene.period_ns):
        stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=time_ns)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        states = types[JOINT_STATES.type](
            header=header, name=["left", "object", "right"], position=zeros, velocity=zeros, effort=zeros
        )
        for topic in scene.topics:
            message = states if topic == JOINT_STATES else types[FORCE](header=header, wrench=wrench)
            if topic == LYAPUNOV:
                recorder.write_lyapunov(time_ns, [0.0] * 6)
            else:
                recorder.write(topic, time_ns, bytes(store.serialize_cdr(message, topic.type)))
    recorder.close()
    return path


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory full of what is not what it should be."""
    monkeypatch.chdir(tmp_path)
    for name, content in {
        "file": b"x", "bytes.yaml": b"\xff\xfe\x00", "deep.yaml": b"[" * 20_000, "tag.yaml": b"title: !!bool x\n",
        "date.yaml": b"title: 2001-13-45\n", "empty.npz": b"", "nomarks.md": b"x", "bytes.md": b"\xff",
        "keys/journal.jsonl": b'{"a": 1}\n', "list/journal.jsonl": b"[]\n", "bytes/journal.jsonl": b"\xff\n",
        "words/journal.jsonl": b"not JSON\n", "bag/metadata.yaml": b"[" * 20_000,
    }.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(content)
    np.savez("other.npz", a=1)
    Path("circle.yaml").symlink_to("circle.yaml")
    return tmp_path


# The command line.


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        (f"simulate {LONG}.yaml", "cannot be read: File name too long"),
        ("simulate circle.yaml", "circle.yaml: no such file"),
        ("simulate bytes.yaml", "bytes.yaml: 'utf-8' codec can't decode byte 0xff"),
        ("simulate deep.yaml", "deep.yaml: nested too deeply"),
        ("simulate tag.yaml", "tag.yaml: a value cannot be read"),
        ("simulate date.yaml", "date.yaml: a value cannot be read: month must be in 1..12"),
        ("simulate case_01 --set left_arm.mass_kg=2001-13-45", "month must be in 1..12; allowed: a number"),
        ("simulate case_01 --set left_arm.mass_kg=\a", "special characters are not allowed"),
        ("simulate case_01 --set a\nb", "--set a b: not understood"),
        ("simulate case_01 --grid 1000000000000", "--grid: 1000000000000 is not allowed; allowed: as many as fit"),
        (f"simulate case_01 --grid {10**30}", "is not allowed; allowed: as many as fit into memory"),
        ("simulate case_01 --sampled --set time.duration_s=1e9 --set time.control_period_s=1e-9",
         "case_01: control periods: 1000000000000000000 is not allowed"),
        ("simulate case_01 --accuracy nan", "exact: accuracy nan is not allowed"),
        ("simulate case_01 --method rk4 --max-work 7", "rk4: has no budget of work"),
        ("simulate case_01 --method rk4 --step nan", "rk4: step nan is not allowed"),
        ("simulate case_01 --method rk4 --accuracy 1e-8", "--accuracy is not allowed; allowed for rk4: --step"),
        ("simulate hammer --method rk4", "hammer: right_arm, right_contact, right_feedback: rk4 knows"),
        ("simulate case_01 -o .", ".: cannot be written: Is a directory"),
        ("simulate case_01 -o file/x.npz", "file/x.npz: cannot be written: Not a directory"),
        ("simulate case_01 -o /dev/full", "/dev/full: cannot be written: No space left on device"),
        (f"simulate case_01 -o {LONG}", "cannot be written: File name too long"),
        ("run case_01 -o .", ".: cannot be written: File exists"),
        ("run case_01 -o file/x", "file/x: cannot be written: Not a directory"),
        ("run case_01 --accuracy 2", "accuracy: 2.0"),
        ("inspect nothing", "nothing: not a bag of this package"),
        ("inspect file", "file: not a bag of this package"),
        ("inspect bag", "bag: not a bag of this package"),
        (f"plot {LONG}", "cannot be read: File name too long"),
        ("plot file", "file: no such scene"),
        ("plot list", "list: not a bag of this package"),
        ("plot empty.npz", "empty.npz: not a file of `grasp simulate`"),
        ("plot other.npz", "other.npz: not a file of `grasp simulate`"),
        ("plot arm_alone -o x.nonsense", "x.nonsense: nonsense is not allowed; allowed: "),
        ("plot arm_alone -o no/x.png", "no/x.png: cannot be written: No such file or directory"),
        ("study accuracy --set time.duration_s=1", "--set: allowed: with a SCENE"),
        ("study accuracy hammer", "hammer: right_arm, right_contact, right_feedback: paper knows"),
        ("study accuracy case_01 -o file/x", "file/x: cannot be written: Not a directory"),
        ("study accuracy case_01 --quick -o keys", "keys/journal.jsonl: not the journal of a study"),
        ("study accuracy case_01 --quick -o list", "list/journal.jsonl: not the journal of a study"),
        ("study accuracy case_01 --quick -o bytes", "bytes/journal.jsonl: 'utf-8' codec can't decode"),
        ("study accuracy case_01 --quick -o words", "words/journal.jsonl: not the journal of a study"),
        ("study advise case_01", "--error, --budget: allowed: exactly one of them"),
        ("study advise case_01 --budget -1", "--error, --budget: allowed: exactly one of them, a number > 0"),
        ("study loop hammer", "hammer: not the paper's grasp"),
        ("study loop case_01 --no-graph --set time.duration_s=1.001", "1.001 is not allowed; allowed: a whole number"),
        ("study prediction case_01 -o file/x", "file/x: cannot be written"),
        ("study page --quick --docs file/x", "file/x/accuracy: cannot be written"),
        ("study speed case_01 --error 0", "--error 0.0 is not allowed; allowed: a number > 0"),
        ("study speed hammer", "hammer: starts in contact"),
        ("study effects case_01 -o nothing.md", "nothing.md: cannot be read: No such file or directory"),
        ("study effects case_01 -o bytes.md", "bytes.md: 'utf-8' codec can't decode"),
        ("study certificate -o nomarks.md", "the document has no marks; allowed: a text with "),
        ("study hard -o list", "list: cannot be read: Is a directory"),
        ("study fuzz --seconds nan", "--seconds nan is not allowed"),
        ("study fuzz --seed -1", "--seed -1 is not allowed"),
        ("study graph nothing", "nothing: no such scene"),
    ],
)
def test_bad_input_ends_in_a_line(
    workplace: Path, capsys: pytest.CaptureFixture[str], command: str, complaint: str
) -> None:
    before = sorted(workplace.rglob("*"))
    assert main(command.split(" ")) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("grasp: ")
    assert complaint in last
    made = [path for path in sorted(workplace.rglob("*")) if path not in before and path.is_file()]
    assert all(path.name == "x.npz" for path in made)


@pytest.mark.parametrize("fault", [ValueError, OSError, MemoryError, KeyError, TypeError, RuntimeError])
def test_a_fault_of_ours_is_not_taken_for_bad_input(monkeypatch: pytest.MonkeyPatch, fault: type[Exception]) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise fault("ours")

    monkeypatch.setattr("grasp_ros.cli.simulate.simulate", broken)
    with pytest.raises(fault, match="ours"):
        main(["simulate", "case_01"])


FAULT = """
import sys
from grasp_ros.cli import simulate
from grasp_ros.cli.main import main
def broken(*_, **__):
    raise {raised}
simulate.simulate = broken
sys.exit(main(["simulate", "case_01"]))
"""


@pytest.mark.parametrize(
    ("raised", "status", "last"),
    [
        ("ValueError('a fault of ours')", 1, "ValueError: a fault of ours"),
        ("KeyboardInterrupt", 130, "grasp: interrupted"),
        ("BrokenPipeError", 0, ""),
    ],
)
def test_exit_statuses(raised: str, status: int, last: str) -> None:
    result = ran([sys.executable, "-c", FAULT.format(raised=raised)])
    assert result.returncode == status
    assert [*result.stderr.splitlines(), ""][-2 if last else -1] == last
    assert ("Traceback" in result.stderr) == (status == 1)


def test_a_title_that_the_terminal_cannot_show_is_printed_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.yaml").write_text(scenes.load("arm_alone").to_yaml().replace("title: ", "title: 'ä' #"), "utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    result = ran([sys.executable, "-m", "grasp_ros.cli", "simulate", str(tmp_path / "mine.yaml")])
    assert result.returncode == 0, result.stderr
    assert "\\xe4" in result.stdout


def test_a_study_without_its_packages_names_the_one_that_is_missing() -> None:
    program = ("import sys; sys.modules['gmpy2'] = None; from grasp_ros.cli.main import main;"
               " sys.exit(main(['study', 'hard', '--alone']))")
    result = ran([sys.executable, "-c", program])
    assert result.returncode == 2
    assert result.stderr == "grasp: this study needs gmpy2; pip install 'grasp_ros[study]'\n"


def test_a_module_of_ours_that_is_missing_is_a_fault() -> None:
    def broken(_: Any) -> int:
        raise ModuleNotFoundError("No module named 'grasp_ros.nothing'", name="grasp_ros.nothing")

    with pytest.raises(ModuleNotFoundError):
        studies._with_packages(broken, studies.argparse.Namespace())


# In Python: the same exception from every room.


REFUSALS: dict[str, Callable[[Path], object]] = {
    "scene": lambda _: scenes.load("nowhere"),
    "sections": lambda _: scenes.compose("none", {}),
    "change": lambda _: scenes.load("case_01").changed({"tilt.angle_rad": 1.0}),
    "grasp": lambda _: scenes.load("hammer").grasp,
    "accuracy": lambda _: Integrator(scenes.load("case_01").system, continuous=True, accuracy=1.0),
    "duration": lambda _: Integrator(scenes.load("case_01").system, continuous=True).advance(-1.0),
    "grid": lambda _: simulate(scenes.load("case_01"), grid=np.array([2.0, 1.0])),
    "method": lambda _: simulate(scenes.load("case_01"), method="euler"),
    "changes": lambda _: simulate(scenes.load("case_01"), changes={0: {"left_feedback.set_point_m": 1.0}}),
    "simulation": lambda path: simulation.load(path / "nothing.npz"),
    "bag": lambda path: bag.read(path),
    "new bag": lambda path: bag.Recorder(path, scenes.load("case_01"), {}),
    "graph": lambda path: Graph(scenes.load("case_01"), path, ACCURACY).start(),
    "figure": lambda path: plots.draw(simulate(scenes.load("arm_alone")), path / "figure.nonsense", ""),
    "marks": lambda _: document.put("text", "part", "block"),
    "document": lambda path: document.read(path),
    "journal": lambda path: Journal(path / "file" / "journal"),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_every_room_refuses_with_the_same_exception(workplace: Path, name: str) -> None:
    with pytest.raises(Refused) as caught:
        REFUSALS[name](workplace)
    assert isinstance(caught.value, ValueError)
    assert str(caught.value)
    assert "\n" not in str(caught.value)


def test_nothing_else_is_raised_for_input() -> None:
    """A ValueError by its own name says that no input can cause it; nothing is caught that faults of ours raise."""
    raised, caught = set(), set()
    for path in ROOT.rglob("*.py"):
        name = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Raise) and getattr(getattr(node.exc, "func", node.exc), "id", "") == "ValueError":
                raised.add(name)
            if isinstance(node, ast.ExceptHandler) and (
                node.type is None or getattr(node.type, "id", "") in ("Exception", "BaseException")
            ):
                caught.add(name)
    assert raised == set(OUR_OWN)
    assert not caught


@pytest.mark.parametrize("door", [reading, writing])
def test_a_door_names_the_path_and_lets_faults_through(door: Any) -> None:
    with pytest.raises(Refused, match=r"^my file: cannot be \w+: No such file or directory$"), door("my file"):
        Path("no/such/file").read_bytes()
    with pytest.raises(scenes.SceneError), door("my file", scenes.SceneError):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(KeyError), door("my file"):
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


# Damage.


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Bytes cut off, cut out, or written over."""
    begin, length = int(rng.integers(len(content))), int(rng.integers(1, 60))
    other = rng.integers(256, size=length).astype(np.uint8).tobytes()
    return (content[:begin], content[:begin] + content[begin + length :], content[:begin] + other + content[begin:],
            content[:begin] + other + content[begin + length :])[int(rng.integers(4))]


@pytest.mark.parametrize("seed", range(3))
def test_a_damaged_bag_is_refused_or_read(tmp_path: Path, seed: int) -> None:
    path, rng = recorded(tmp_path / "bag"), np.random.default_rng(seed)
    assert len(bag.read(path).tick) == 3
    refused = 0
    for file in (path / "bag.mcap", path / "metadata.yaml"):
        whole = file.read_bytes()
        for _ in range(20):
            file.write_bytes(damaged(whole, rng))
            with contextlib.suppress(bag.BagError):
                bag.read(path)
                continue
            refused += 1
        file.write_bytes(whole)
    assert refused > 20


@pytest.mark.parametrize("seed", range(3))
def test_a_damaged_simulation_is_refused_or_read(tmp_path: Path, seed: int) -> None:
    path, rng = tmp_path / "a.npz", np.random.default_rng(seed)
    simulate(scenes.load("case_01"), grid=np.linspace(0.0, 20.0, 5)).save(path)
    whole, refused = path.read_bytes(), 0
    for _ in range(60):
        path.write_bytes(damaged(whole, rng))
        with contextlib.suppress(Refused):
            simulation.load(path)
            continue
        refused += 1
    assert refused > 30


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("state", np.zeros((2, 6))), ("state", np.zeros((5, 5))), ("t", np.zeros((5, 1))), ("t", np.array(["a"] * 5)),
        ("t", np.array(0.0)), ("events", np.zeros(3)), ("events", np.zeros((3, 4))), ("command", np.zeros((5, 3))),
        ("inputs", np.zeros((4, 3))), ("work", np.zeros(2)), ("method", "euler"), ("status", "FINE"),
        ("scene", "title: 5"), ("setting", "fine"), ("setting", np.zeros(2)),
    ],
)
def test_a_simulation_of_another_shape_is_refused(tmp_path: Path, name: str, value: Any) -> None:
    path = tmp_path / "a.npz"
    simulate(scenes.load("case_01"), grid=np.linspace(0.0, 20.0, 5)).save(path)
    with np.load(path) as data:
        np.savez(path, **{**data, name: value})
    with pytest.raises(Refused, match=r"a\.npz: not a file of `grasp simulate`: "):
        simulation.load(path)


def test_a_bag_that_can_no_longer_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = bag.Recorder(tmp_path / "bag", scenes.load("case_01"), {})

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder._writer, "write", full)
    with pytest.raises(bag.BagError, match=r"bag: cannot be written: No space left on device$"):
        recorder.write_lyapunov(0, [0.0] * 6)
    recorder.close()


# Nodes.


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("-p accuracy:=[1.0,2.0]", "accuracy: [1.0, 2.0] is not allowed; allowed: a number"),
        ("-p accuracy:=true", "accuracy: True is not allowed; allowed: a number"),
        ("-p scene:=delay -p loop.delay_ticks:=2.5", "loop.delay_ticks: 2.5 is not allowed; allowed: a whole number"),
        ("-p object.mass_kg:=abc", "object.mass_kg: 'abc' is not allowed; allowed: a number > 0"),
        ("-p scene:=table -p left_arm_table.time_s:=3.0", "left_arm_table.time_s: 3.0 is not allowed; allowed: a list"),
        ("-p use_sim_time:=3", "use_sim_time"),
        ("-p nothing", "--ros-args: "),
        ("--params-file nothing.yaml", "--ros-args: "),
    ],
)
def test_a_node_refuses_in_a_line(arguments: str, complaint: str) -> None:
    result = ran([*START, "plant", "--ros-args", *arguments.split()])
    assert result.returncode == 2, result.stderr
    assert complaint in result.stderr.splitlines()[-1]
    assert "Traceback" not in result.stderr

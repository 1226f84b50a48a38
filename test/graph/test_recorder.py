"""Bags whose recording was killed, cut off, damaged, or ran out of space, read back by three readers."""

from __future__ import annotations

import multiprocessing
import os
import re
import resource
import shutil
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from graphs import written
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer as LibraryWriter
from mcap_ros2.decoder import DecoderFactory
from processes import DEADLINE, ran, wait_for
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.bag.opening import Opened
from grasp_ros.graph.bag.reading import recover
from grasp_ros.graph.bag.recorder import HEAD, NOT_RECORDED, RESERVE_BYTES, Recorder
from grasp_ros.graph.bag.rosbag2 import INFORMATION
from grasp_ros.graph.bag.storage import DATA_END_BYTES, SUM
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.serialization import template_of
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.topics import DIAGNOSTICS, JOINT_STATES, LEFT_COMMAND, Topic
from grasp_ros.simulation import Trajectory, simulate
from lab.drills import recorder as study

LIMIT = 9 * RESERVE_BYTES // 4


@pytest.fixture(scope="module")
def run() -> Trajectory:
    return simulate(scenes.load("case_01", ["time.duration_s=1"]), sampled=True)


@pytest.fixture
def closed(tmp_path: Path, run: Trajectory) -> Path:
    path = tmp_path / "bag"
    study.write(path, run)
    return path


def storage(path: Path) -> Path:
    return next(path.glob("*.mcap"))


def put(path: Path, content: bytes) -> Path:
    """A bag without metadata, as a recorder leaves it that was killed."""
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir()
    (path / "bag.mcap").write_bytes(content)
    return path


def test_a_bag_is_the_run_bit_for_bit(closed: Path, run: Trajectory) -> None:
    recording = bag.read(closed)
    assert recording.state.tobytes() == run.state.tobytes()
    assert recording.command.tobytes() == run.command.tobytes()
    assert recording.inputs.tobytes() == run.inputs.tobytes()
    count = str(7 * len(run.t) + 4)
    assert recording.lost == {"end": "closed", "ticks that are missing": "none", "messages written": count}
    assert {entry.name for entry in closed.iterdir()} == {"bag.mcap", "metadata.yaml"}


def test_the_reader_of_the_library_takes_it(closed: Path, run: Trajectory) -> None:
    with storage(closed).open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics.message_count == 7 * len(run.t) + 4
        rows = list(reader.iter_decoded_messages(topics=["/left/effort_command"]))
        assert [decoded.wrench.force.x for _, _, _, decoded in rows] == run.command[:, 0].tolist()
        schema, channel, message, decoded = rows[500]
        assert (schema.name, message.log_time) == ("geometry_msgs/msg/WrenchStamped", 500_000_000)
        assert (decoded.header.stamp.sec, decoded.header.stamp.nanosec) == (0, 500_000_000)
        assert "reliab" in channel.metadata["offered_qos_profiles"]


def test_the_metadata_are_those_of_another_writer(tmp_path: Path, closed: Path, run: Trajectory) -> None:
    """All that `ros2 bag info` shows, and the copy within the file that it falls back on."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(closed) as reader, Writer(tmp_path / "other", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for connection in reader.connections:
            writer.add_connection(
                connection.topic, connection.msgtype, typestore=store,
                offered_qos_profiles=connection.ext.offered_qos_profiles,
            )
        for connection, time_ns, raw in reader.messages(reader.connections):
            writer.write(writer.connections[connection.id - 1], time_ns, raw)
    ours, theirs = (
        yaml.safe_load((path / "metadata.yaml").read_text())[INFORMATION] for path in (closed, tmp_path / "other")
    )
    assert ours.keys() == theirs.keys()
    for key in ours.keys() - {"custom_data", "ros_distro", "files", "relative_file_paths"}:
        assert ours[key] == theirs[key], key
    assert {**theirs["files"][0], "path": "bag.mcap"} == ours["files"][0]
    with storage(closed).open("rb") as file:
        inside = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert yaml.safe_load(inside["rosbag2"]["serialized_metadata"]) == ours


@pytest.mark.slow
def test_a_bag_that_was_cut_off_at_any_byte_is_read_to_there(tmp_path: Path, closed: Path, run: Trajectory) -> None:
    whole, before = storage(closed).read_bytes(), 0
    cuts = sorted({*np.linspace(1, len(whole) - 1, 16, dtype=int).tolist(), *range(len(whole) - 40, len(whole), 3)})
    for cut in cuts:
        path = put(tmp_path / "cut", whole[:cut])
        try:
            recording = bag.read(path)
        except bag.BagError:
            assert before == 0
            continue
        count = len(recording.tick)
        assert recording.state.tobytes() == run.state[:count].tobytes()
        assert recording.lost["end"].startswith("not closed")
        assert count >= before
        before = count
    assert before == len(run.t)


@pytest.mark.slow
def test_every_flipped_bit_is_noticed(tmp_path: Path, closed: Path, run: Trajectory) -> None:
    whole, rng = storage(closed).read_bytes(), np.random.default_rng(0)
    text = (closed / "metadata.yaml").read_bytes()
    data_end = 8 * whole.rindex(HEAD.pack(Opcode.DATA_END, SUM.size))  # which no checksum covers
    for place in [*rng.integers(8 * len(whole), size=150).tolist(), *range(data_end, data_end + 8 * DATA_END_BYTES)]:
        content = bytearray(whole)
        content[place // 8] ^= 1 << place % 8
        storage(closed).write_bytes(content)
        with pytest.raises(bag.BagError, match=r"bag\.mcap"):
            bag.read(closed)
    for more in (b"\n", whole[-20:-8], whole[:40]):
        storage(closed).write_bytes(whole + more)
        with pytest.raises(bag.BagError, match="its last bytes are not the end of an MCAP file"):
            bag.read(closed)
    storage(closed).write_bytes(whole)
    for place in rng.integers(8 * len(text), size=60).tolist():
        content = bytearray(text)
        content[place // 8] ^= 1 << place % 8
        (closed / "metadata.yaml").write_bytes(content)
        with pytest.raises(bag.BagError, match=r"metadata\.yaml"):
            bag.read(closed)


@pytest.mark.parametrize("chunk", [0, 1])  # the first has the channels of all
def test_what_is_whole_is_recovered_around_damage(tmp_path: Path, closed: Path, run: Trajectory, chunk: int) -> None:
    content = bytearray(storage(closed).read_bytes())
    chunks = [match.start() for match in re.finditer(b"\x04\x00\x00\x00zstd", content)]
    content[chunks[chunk] + 100] ^= 4
    path = put(tmp_path / "damaged", bytes(content))
    with pytest.raises(bag.BagError, match=r"bag\.mcap: damaged: a checksum is wrong; `grasp recover`"):
        bag.read(path)
    half = put(tmp_path / "half", bytes(content[: chunks[3]]))
    with pytest.raises(bag.BagError, match=r"damaged: the checksum of a chunk is wrong, at byte \d+; `grasp recover`"):
        bag.read(half)
    found = recover(path, tmp_path / "new")
    recording = bag.read(tmp_path / "new")
    assert 0 < found.ticks == len(recording.tick) <= len(run.t)
    lost = len(run.t) - found.ticks
    assert (lost > 0) == (chunk == 1)
    assert found.missing == (recording.lost["ticks that are missing"] if lost else "")
    assert recording.state.tobytes() == run.state[recording.tick].tobytes()
    assert recording.lost["ticks that are missing"] == f"0-{recording.tick[0] - 1}" or recording.tick[0] == 0
    assert "checksum" in recording.lost["what was left out"]
    assert storage(path).read_bytes() == content


def test_a_recovered_bag_is_one_for_other_readers(tmp_path: Path, closed: Path, run: Trajectory, command: Any) -> None:
    whole = storage(closed).read_bytes()
    path = put(tmp_path / "killed", whole[: len(whole) // 2])
    result = command("inspect", str(path))
    assert result.returncode == 0
    assert "not closed" in result.stdout
    result = command("recover", "killed")
    assert result.returncode == 0, result.stderr
    ticks = len(bag.read(tmp_path / "killed_recovered").tick)
    assert f"{ticks} ticks written to killed_recovered" in result.stdout
    assert 0 < ticks < len(run.t)
    with Reader(tmp_path / "killed_recovered") as reader:
        assert reader.message_count == 7 * ticks + 4
        assert sum(1 for _ in reader.messages()) == 7 * ticks + 4
    assert {entry.name for entry in path.iterdir()} == {"bag.mcap"}
    shown = command("inspect", "killed_recovered").stdout
    assert "\nrecovered from           killed\nwhat was left out        " in shown
    assert " on: the rest of a record is missing\n" in shown
    again = command("recover", "killed")
    assert again.returncode == 2
    assert "killed_recovered: already exists; allowed: a new directory" in again.stderr


@pytest.mark.parametrize(("name", "new"), [("p_0.1", "p_0.1_recovered"), (".", "../here_recovered"),
                                          ("bag.mcap", "bag_recovered"), ("\udcff", "\udcff_recovered")])
def test_a_recovered_bag_lies_beside_the_old_one(
    tmp_path: Path, closed: Path, command: Any, monkeypatch: pytest.MonkeyPatch, name: str, new: str
) -> None:
    for directory in ("p_0.1", "\udcff"):  # the second one is not UTF-8
        shutil.copytree(closed, tmp_path / "here" / directory)
    shutil.copy(storage(closed), tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    assert command("recover", name).returncode == 0
    assert Path(new, "metadata.yaml").is_file()


def test_a_second_bag_behind_the_first_is_named(tmp_path: Path, closed: Path, run: Trajectory) -> None:
    both = put(tmp_path / "both", 2 * storage(closed).read_bytes())
    found, size = recover(both, tmp_path / "new"), storage(closed).stat().st_size
    assert found.left_out == [f"{size} bytes from byte {size} on: behind the end of the bag"]
    assert found.ticks == len(run.t)


def test_stamps_are_whole_numbers_after_104_days(tmp_path: Path) -> None:
    """2^53 ns, from where on floating-point numbers have not every one."""
    scene = scenes.load("arm_alone", ["time.control_period_s=999.000000001", "time.duration_s=9990000.00001"])
    written(tmp_path / "bag", scene, [])
    reader, template = Opened(tmp_path / "bag"), template_of(JOINT_STATES, ["left"])
    for time_ns in [tick * scene.period_ns for tick in range(9010, 9020)]:
        reader.row(time_ns, {JOINT_STATES: template.fill(time_ns, (0.1, 0.0, 0.0))})
        assert reader.stamp_ns == time_ns


def test_ticks_that_are_missing_are_named_in_the_bag(tmp_path: Path, run: Trajectory) -> None:
    ticks = [tick for number, tick in enumerate(study.ticks_of(run)) if number not in (0, 7, 100, 101, 102)]
    recording = bag.read(written(tmp_path / "bag", run.scene, ticks, {"lost messages": 5}))
    assert recording.lost == {"end": "closed", "ticks that are missing": "0, 7, 100-102", "lost messages": "5",
                              "messages written": str(7 * len(ticks) + 2)}
    assert recording.versions == {"python": "3"}


def test_the_index_of_many_chunks_is_whole_and_takes_little_memory(
    tmp_path: Path, run: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each tick a chunk: what a recording of minutes has."""
    monkeypatch.setattr("grasp_ros.graph.bag.recorder.CHUNK_BYTES", 0)
    recorder = Recorder(tmp_path / "bag", run.scene, {"python": "3"})
    ticks = list(study.ticks_of(run))
    for tick in ticks[:100]:
        recorder.write_tick(*tick)
    tracemalloc.start()
    for tick in ticks[100:]:
        recorder.write_tick(*tick)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    recorder.close()
    assert len(ticks) > 1000
    assert held / len(ticks[100:]) < 400.0  # bytes; some 1400 as objects
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count >= len(ticks)
        file.seek(0)
        chunks = [record for record in StreamReader(file, emit_chunks=True).records if isinstance(record, Chunk)]
    found = [(one.message_start_time, one.message_end_time, one.compressed_size) for one in summary.chunk_indexes]
    assert found == [(chunk.message_start_time, chunk.message_end_time, len(chunk.data)) for chunk in chunks]
    assert all(one.message_index_offsets for one in summary.chunk_indexes)


def test_the_library_would_write_the_same_bytes(
    tmp_path: Path, run: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own way to add a message, which takes much longer."""
    def add(self: Recorder, topic: Topic, time_ns: int, cdr: bytes) -> None:
        channel = self._channels[topic]
        self._writer.add_message(channel, time_ns, cdr, time_ns, self._statistics.channel_message_counts[channel])

    def record(path: Path) -> bytes:
        recorder = Recorder(path / "bag", run.scene, {})
        for tick in study.ticks_of(run):
            recorder.write_tick(*tick)
            recorder.write(DIAGNOSTICS, b"beside")
        recorder.close()
        return storage(path / "bag").read_bytes()

    monkeypatch.setattr("grasp_ros.graph.bag.recorder.FLUSH_SECONDS", DEADLINE)
    monkeypatch.setattr("grasp_ros.graph.bag.recorder.CHUNK_BYTES", 20_000)
    own = record(tmp_path / "own")
    monkeypatch.setattr(Recorder, "_add", add)
    assert record(tmp_path / "library") == own


def test_a_pipe_in_place_of_a_bag_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "bag.mcap")
    for path in (tmp_path, tmp_path / "bag.mcap"):
        with pytest.raises(bag.BagError, match="a pipe; allowed: a file"):
            bag.read(path)


@pytest.mark.parametrize("name", ["chunk_builder", "chunk_indices", "statistics"])
def test_a_writer_of_the_library_that_has_moved_is_refused_in_a_sentence(
    tmp_path: Path, run: Trajectory, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    class Moved(LibraryWriter):
        def __init__(self, *words: Any, **options: Any) -> None:
            super().__init__(*words, **options)
            delattr(self, f"_Writer__{name}")

    monkeypatch.setattr("grasp_ros.graph.bag.recorder.Writer", Moved)
    with pytest.raises(bag.BagError, match=r"mcap \S+: its writer is another one; allowed: mcap>=1\.5,<1\.7"):
        Recorder(tmp_path / "bag", run.scene, {})
    [bound] = [line for line in (Path(__file__).parents[2] / "pyproject.toml").read_text().splitlines()
               if '"mcap>' in line]
    assert bound.strip() == '"mcap>=1.5,<1.7",'


def test_a_topic_without_a_message_is_missing_and_no_error(tmp_path: Path, run: Trajectory, command: Any) -> None:
    ticks = [(time_ns, [row for row in rows if row[0] != LEFT_COMMAND]) for time_ns, rows in study.ticks_of(run)]
    recording = bag.read(written(tmp_path / "bag", run.scene, ticks))
    assert np.isnan(recording.command[:, 0]).all()
    assert recording.missing["left/effort_command"] == len(run.t)
    result = command("inspect", "bag")
    assert result.returncode == 0
    assert re.search(rf"^lost +left/effort_command {len(run.t)}$", result.stdout, re.M)
    with pytest.raises(bag.BagError, match="nothing can be recovered: no message on left/effort_command"):
        recover(tmp_path / "bag", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_what_the_monitor_did_not_record_is_lost(tmp_path: Path, run: Trajectory, command: Any) -> None:
    written(tmp_path / "bag", run.scene, study.ticks_of(run), {NOT_RECORDED: 7})
    result = command("inspect", "bag")
    assert re.search(r"^lost +messages not recorded 7$", result.stdout, re.M)
    assert bag.read(tmp_path / "bag").missing[NOT_RECORDED] == 7


def test_what_was_written_is_on_the_disk_soon_without_more_of_it(tmp_path: Path, run: Trajectory) -> None:
    recorder = Recorder(tmp_path / "bag", run.scene, {})
    for _, tick in zip(range(3), study.ticks_of(run), strict=False):
        recorder.write_tick(*tick)

    def there() -> bool:
        try:
            return len(bag.read(tmp_path / "bag").tick) == 3
        except bag.BagError:
            return False

    wait_for(there, "three ticks")
    recorder.close()


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (shutil.rmtree, "was deleted during the recording"),
        (lambda path: os.truncate(path / "bag.mcap", 100), "was cut off by another program during the recording"),
        (lambda path: path.rename(path.with_name("other")), "was moved during the recording"),
    ],
)
def test_a_bag_that_was_harmed_meanwhile_is_refused_and_one_that_was_moved_opens(
    tmp_path: Path, run: Trajectory, harm: Callable[[Path], None], words: str
) -> None:
    recorder, ticks = Recorder(tmp_path / "bag", run.scene, {}), study.ticks_of(run)
    recorder.write_tick(*next(ticks))
    harm(tmp_path / "bag")
    wait_for(lambda: bool(recorder._error), "the recorder to see it")
    with pytest.raises(bag.BagError, match=words):
        recorder.write_tick(*next(ticks))
    with pytest.raises(bag.BagError, match=words):
        recorder.close()
    if "moved" in words:
        assert bag.read(tmp_path / "other").tick.tolist() == [0]


def fill(path: Path, run: Trajectory, limit: int, answers: Any) -> None:
    """Record without end in a process whose files are limited; how many ticks there were, and what ended it."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    ticks, number = list(study.ticks_of(run)), 0
    try:
        recorder = Recorder(path, run.scene, {})
        for number in range(10**6):
            _, messages = ticks[number % len(ticks)]
            recorder.write_tick(number * run.scene.period_ns, messages)
    except bag.BagError as error:
        answers.put((number, str(error)))


def limited(path: Path, run: Trajectory, limit: int) -> tuple[int, str]:
    """What `fill` answers."""
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=fill, args=(path, run, limit, answers))
    child.start()
    found: tuple[int, str] = answers.get(timeout=DEADLINE)
    child.join(DEADLINE)
    return found


@pytest.mark.slow
def test_a_limit_that_leaves_no_room_is_no_full_disk(tmp_path: Path, run: Trajectory) -> None:
    _, sentence = limited(tmp_path / "bag", run, RESERVE_BYTES)
    assert "no tick could be recorded: files may not be larger" in sentence


@pytest.mark.slow
def test_a_limit_of_the_file_size_ends_the_bag_while_there_is_room(tmp_path: Path) -> None:
    number, sentence = limited(tmp_path / "bag", simulate(scenes.load("case_01"), sampled=True), LIMIT)
    assert "files may not be larger; the bag is closed, and whole up to there" in sentence
    recording = bag.read(tmp_path / "bag")
    ticks = len(recording.tick)
    assert ticks in (number, number + 1)  # with the tick that was refused, unless the bag had been closed before it
    assert np.array_equal(recording.tick, np.arange(ticks))
    assert recording.lost["end"] == "files may not be larger"
    assert storage(tmp_path / "bag").stat().st_size <= LIMIT
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 7 * ticks + 4


FULL = """
import sys
from pathlib import Path
from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.bag.recorder import Recorder
from grasp_ros.simulation import simulate
from lab.drills import recorder as study
run = simulate(scenes.load("case_01"), sampled=True)
disk = Path(sys.argv[1])
recorder = Recorder(disk / "bag", run.scene, {})
number = -1
try:
    for number, tick in enumerate(study.ticks_of(run)):
        if number == 500:  # somebody else fills the disk
            with (disk / "other").open("wb", buffering=0) as other:
                try:
                    while True:
                        other.write(bytes(4096))
                except OSError:
                    pass
        recorder.write_tick(*tick)
except bag.BagError as error:
    found = bag.read(disk / "bag")
    print(number, len(found.tick), found.lost["end"], error, sep="|")
"""


@pytest.mark.slow
def test_a_full_disk_ends_the_bag_while_there_is_room(tmp_path: Path) -> None:
    """A real one, in memory, where this process may mount it."""
    script = f'mount -t tmpfs -o size=6m none "$0" && exec {sys.executable} -c "$1" "$0"'
    if ran("unshare", "-rm", "true").returncode:
        pytest.skip("no file system may be mounted here")
    result = ran("unshare", "-rm", "sh", "-c", script, str(tmp_path), FULL)
    assert result.returncode == 0, result.stderr
    number, ticks, end, sentence = result.stdout.strip().split("|")
    assert int(ticks) >= int(number) >= 500
    assert end == "no space is left on the disk"
    assert "the bag is closed, and whole up to there" in sentence


def test_a_disk_that_is_full_at_the_first_byte_is_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Trajectory
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Recorder, "_begin", full)
    with pytest.raises(bag.BagError, match="bag: cannot be written: No space left on device"):
        Recorder(tmp_path / "bag", run.scene, {})
    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(Refused, match="run: cannot be written: No space left on device"):
        Graph(run.scene, tmp_path / "run", 1e-16).start()
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_recordings_that_are_killed_are_there(run: Trajectory) -> None:
    """`python -m lab recorder --kills 100` does more of them."""
    ticks, rng = list(study.ticks_of(run)), np.random.default_rng(0)
    for _ in range(4):
        end = study.kill(run.scene, ticks, rng.uniform(0.0, study.LONGEST_SECONDS))
        assert end.survived, end


def test_a_bag_of_another_scene_is_refused(tmp_path: Path, run: Trajectory) -> None:
    written(tmp_path / "bag", scenes.load("case_01", ["time.duration_s=0.5"]), study.ticks_of(run))
    with pytest.raises(bag.BagError, match="/joint_states: tick 501: its stamp is not the next one of the scene"):
        bag.read(tmp_path / "bag")
    assert recover(tmp_path / "bag", tmp_path / "new").ticks == 501
    assert bag.read(tmp_path / "new").counts[JOINT_STATES.name] == 501

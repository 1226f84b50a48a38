"""Graphs that run, what holds of their bags, and bags without a graph."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mcap.reader import make_reader
from mcap.writer import Writer
from processes import DEADLINE, wait_for
from std_srvs.srv import Trigger

from grasp_ros.graph import bag
from grasp_ros.graph.bag.recorder import Recorder
from grasp_ros.graph.bag.recording import Recording
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.processes import Graph
from grasp_ros.scene import Scene
from lab.drills.recorder import Tick


def written(
    path: Path, scene: Scene, ticks: Iterable[Tick], counters: Mapping[str, object] | None = None,
    running: Running | None = None,
) -> Path:
    """A new bag of some ticks, closed with counters of what was lost; by default of a run in lockstep."""
    recorder = Recorder(path, scene, {"python": "3"}, running=running or Running())
    for tick in ticks:
        recorder.write_tick(*tick)
    recorder.close(counters)
    return path


def whole(path: Path) -> Recording:
    """A bag that lacks nothing, and follows from its inputs."""
    recording = bag.read(path)
    assert not any(recording.missing.values())
    assert verify(recording).holds
    return recording


@contextmanager
def started(graph: Graph) -> Iterator[dict[str, int]]:
    """A graph that runs, and is stopped whatever happens; then its exit statuses are there."""
    statuses = dict[str, int]()
    try:
        graph.start()
        yield statuses
    finally:
        statuses.update(graph.stop())


def call(service: str, node: tuple[Any, Any]) -> Any:
    """Answer of a service of the plant to a node, which has an executor."""
    peer, executor = node
    client, newest = (peer.create_client(Trigger, f"plant/{name}") for name in (service, "status"))
    assert client.wait_for_service(timeout_sec=DEADLINE)
    assert newest.wait_for_service(timeout_sec=DEADLINE)

    def asked(client: Any, seconds: float) -> Any:
        future = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(future, timeout_sec=seconds)
        return future.result()

    wait_for(lambda: asked(newest, 1.0) is not None, "the plant, which may not know the way back yet")
    answer = asked(client, DEADLINE)
    assert answer is not None, service
    for one in (client, newest):
        peer.destroy_client(one)
    return answer


def status(node: tuple[Any, Any]) -> dict[str, Any]:
    """What the plant says of itself to a node."""
    return json.loads(call("status", node).message)  # type: ignore[no-any-return]


def rewritten(
    old: Path, new: Path, beside: str = "", late_ns: int = 0, without: Mapping[str, int] = MappingProxyType({}),
    by_topic: bool = False, **options: Any,
) -> None:
    """A copy of a file by the library's own writer with its options.

    With a topic beside, all of it so much later, or earlier from 0 on, `without` the messages of topics from a time in
    ns on; `by_topic`: in the order of the topics.
    """
    with old.open("rb") as file, new.open("wb") as copy:
        reader, writer, channels = make_reader(file), Writer(copy, **options), dict[int, int]()
        writer.start("ros2", "another program")
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        writer.add_attachment(0, 0, "notes.txt", "text/plain", b"of somebody")
        found = [*reader.iter_messages(log_time_order=False)]
        for schema, channel, message in sorted(found, key=lambda row: row[1].topic) if by_topic else found:
            if message.log_time >= without.get(channel.topic, message.log_time + 1):
                continue
            if channel.id not in channels:
                of = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, of)
                if beside:
                    writer.register_channel(beside, channel.message_encoding, of)
            time_ns = max(message.log_time + late_ns, 0)
            writer.add_message(channels[channel.id], time_ns, message.data, time_ns)
            if beside:
                writer.add_message(channels[channel.id] + 1, time_ns, message.data, time_ns)
        writer.finish()

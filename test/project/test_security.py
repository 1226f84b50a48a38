"""Files and messages from strangers are data, never code; a graph stays on its host, and says what it cannot be."""

from __future__ import annotations

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from graphs import rewritten
from processes import DEADLINE, START, wait_for

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.graph import bag, host
from grasp_ros.graph.bag.opening import Opened
from grasp_ros.graph.bag.reading import recover
from grasp_ros.graph.bag.recorder import Recorder
from grasp_ros.graph.parameters import PEER_SECONDS, Running
from grasp_ros.maps import store
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import signed
from grasp_ros.scene.scene import Scene
from grasp_ros.simulation import simulate
from lab.drills import recorder
from lab.studies.records import Journal

DDS = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"  # namespace of its profiles
TAGS = [
    "!!python/object/apply:os.mkdir [owned]", "!!python/object/new:os.mkdir [owned]",
    "!!python/name:os.system", "!!python/module:antigravity",
    "!<tag:yaml.org,2002:python/object/apply:os.mkdir> [owned]",
]


class Owner:
    """What makes a directory when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("owned",)


@pytest.fixture(autouse=True)
def _nothing_is_owned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.chdir(tmp_path)
    yield
    assert not (tmp_path / "owned").exists()


def test_the_pickle_would_do_it(tmp_path: Path) -> None:
    """And so the tests below can fail."""
    pickle.loads(pickle.dumps(Owner()))
    (tmp_path / "owned").rmdir()


@pytest.mark.parametrize("name", ["t", "scene", "more"])
def test_a_pickle_in_a_result_is_not_loaded(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.npz"
    simulate(scenes.load("arm_alone")).save(path)
    with np.load(path) as data:
        arrays = dict(data)
    np.savez(path, allow_pickle=True, **signed({**arrays, name: np.array([Owner()], dtype=object)}))
    with pytest.raises(Refused, match=r"a\.npz: "):
        simulation.load(path)


@pytest.mark.parametrize("tag", TAGS)
def test_a_tag_in_a_text_is_not_followed(tmp_path: Path, tag: str) -> None:
    whole = scenes.load("arm_alone").to_yaml()
    for text in (tag, whole + f"watch: {tag}\n", whole.replace("title: ", f"title: {tag} #")):
        (tmp_path / "a.yaml").write_text(text)
        doors: list[Callable[[], object]] = [
            lambda: scenes.load(str(tmp_path / "a.yaml")), lambda text=text: scenes.parse(text, "scene", "topic scene"),
            lambda text=text: Running.parse(text),
        ]
        for door in doors:
            with pytest.raises(Refused):
                door()
    with pytest.raises(Refused):
        scenes.load("case_01", [f"time.duration_s={tag}"])


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "mode: &a [*a]", "mode: x\naccuracy: y", "mode: x\nreactions: [1]", "- 1", "",
             "mode: x\nz: 1", "mode: lockstep\naccuracy: 1.0\n", "a" * 2_000_000,
             "mode: x\nreal_time_factor: 1.0\ntimeouts: {left: 0.1}\n", "mode: x\nreactions: {left: zero}\n"],
)
def test_a_text_on_run_that_no_plant_says_is_refused(text: str) -> None:
    with pytest.raises(Refused, match=r"^(run: not a description of a run by a plant|accuracy)"):
        Running.parse(text)


@pytest.mark.parametrize("tag", TAGS[:2])
@pytest.mark.parametrize("kind", [Scene, Running])
def test_a_tag_in_a_bag_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type, tag: str) -> None:
    """With all checksums right, in the text that the bag keeps and on its topic."""
    path, run = tmp_path / "bag", simulate(scenes.load("case_01", ["time.duration_s=0.01"]), sampled=True)
    with monkeypatch.context() as patch:
        patch.setattr(kind, "to_yaml", lambda _: tag)
        recorder.write(path, run)
    for door in (bag.read, Opened, lambda path: recover(path, tmp_path / "new")):
        with pytest.raises(Refused):
            door(path)


def test_a_map_of_another_version_is_not_opened(tmp_path: Path) -> None:
    """Its arrays may name any codec, pickle among them."""
    zarr = pytest.importorskip("zarr")
    path = tmp_path / "a.zarr"
    attributes = {"format": store.FORMAT, "plan": {"axes": [], "setup": {"outcomes": []}}, "versions": {}}
    zarr.create_group(path, zarr_format=2, attributes=attributes)
    (path / store.STATUS).mkdir()
    (path / store.STATUS / "zarr.json").write_text("{}")
    (path / store.STATUS / ".zarray").write_text(json.dumps({
        "chunks": [1], "compressor": {"id": "pickle"}, "dtype": "<f8", "fill_value": 0, "filters": None,
        "order": "C", "shape": [1], "zarr_format": 2,
    }))
    (path / store.STATUS / "0").write_bytes(pickle.dumps(Owner()))
    for door in (store.read, store.open_group):
        with pytest.raises(Refused, match=r"a\.zarr: not a map"):
            door(path)


def test_a_journal_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").write_bytes(pickle.dumps(Owner()) + b"\n")
    with pytest.raises(Refused):
        Journal(tmp_path)


def test_words_of_a_stranger_do_nothing_to_a_terminal(tmp_path: Path, command: Any) -> None:
    text = scenes.load("arm_alone").to_yaml()
    (tmp_path / "a.yaml").write_text(text + '"\\e]0;mine\\a": 1\n')
    result = command("simulate", "a.yaml")
    assert result.returncode == 2
    assert "\\x1b]0;mine\\x07: unknown key" in result.stderr
    run = simulate(scenes.load("case_01", ["time.duration_s=0.01"]), sampled=True)
    writer = Recorder(tmp_path / "bag", run.scene, {"python": "\x1b[31m3"})
    for tick in recorder.ticks_of(run):
        writer.write_tick(*tick)
    writer.close({"\x1b[2J": 1})
    result = command("inspect", "bag")
    assert result.returncode == 0
    assert "\\x1b[31m3" in result.stdout
    assert "\x1b" not in result.stdout
    rewritten(tmp_path / "bag" / "bag.mcap", tmp_path / "new.mcap", beside="/\x1b[2J")
    result = command("recover", "new.mcap")
    assert "left out: messages on /\\x1b[2J, no topic of its scene: " in result.stdout
    assert "\x1b" not in result.stdout


def test_wishes_of_the_user_come_first() -> None:
    here = {host.RANGE: host.LOCALHOST, host.PROFILES: str(host.PROFILE)}
    there = {host.PROFILES: str(host.NETWORK_PROFILE)}
    for given in ({}, {host.RANGE: host.LOCALHOST}, {host.RANGE: ""}, {host.MIDDLEWARE: host.OURS}):
        assert host.environment(given) == here
        assert host.network(given) == {host.RANGE: host.SUBNET}
        assert host.location(given, "/").endswith("on this host")
    for reach in (host.SUBNET, "SYSTEM_DEFAULT"):
        assert host.environment({host.RANGE: reach}) == there
        assert host.network({host.RANGE: reach}) == {}
        assert host.location({host.RANGE: reach}, "/").endswith("on the network")
        assert host.environment({**here, host.RANGE: reach})[host.PROFILES] == str(host.NETWORK_PROFILE)
    for name in host.OTHERS:
        assert host.environment({name: "x"}) == {host.RANGE: host.LOCALHOST, **there}
    for name in (*host.PROFILE_FILES, host.MIDDLEWARE):
        assert host.environment({name: "x"}) == {host.RANGE: host.LOCALHOST}
        assert host.environment({name: "x", host.RANGE: host.SUBNET}) == {}
    assert host.location({host.RANGE: host.LOCALHOST, host.SERVER: "there:11811"}, "/").endswith(
        "on this host, through ROS_DISCOVERY_SERVER there:11811")


def test_what_was_lost_is_sent_again_before_a_node_seems_to_be_silent() -> None:
    seconds = []
    for file in (host.PROFILE, host.NETWORK_PROFILE):
        [period] = ElementTree.parse(file).iter(f"{DDS}heartbeatPeriod")
        seconds.append(int(period.findtext(f"{DDS}sec", "")) + 1e-9 * int(period.findtext(f"{DDS}nanosec", "")))
    assert seconds == [0.2, 0.2]
    assert seconds[0] < PEER_SECONDS / 4


def plain_environment(domain: int, **more: str) -> dict[str, str]:
    """Nothing of what decides from where a node can be reached."""
    decide = host.RANGE, *host.OTHERS, *host.PROFILE_FILES
    kept = {name: value for name, value in os.environ.items() if name not in decide}
    return {**kept, "ROS_DOMAIN_ID": str(domain), **more}


def listens(port: int) -> set[str]:
    """Addresses of this host at which somebody listens on a port."""
    lines = Path("/proc/net/udp").read_text().splitlines()[1:]
    found = [line.split()[1].split(":") for line in lines]
    here = [int(address, 16) for address, there in found if int(there, 16) == port]
    return {socket.inet_ntoa(address.to_bytes(4, "little")) for address in here}


@pytest.mark.slow
def test_a_node_listens_on_this_host_alone_unless_asked(tmp_path: Path) -> None:
    """The port of the first participant of a domain, as DDS has it."""
    wishes: dict[int, dict[str, str]] = {126: {}, 127: {host.RANGE: host.SUBNET}}
    nodes = {
        domain: subprocess.Popen([*START, "plant"], cwd=tmp_path, env=plain_environment(domain, **more))
        for domain, more in wishes.items()
    }
    try:
        for domain, address in ((126, "127.0.0.1"), (127, "0.0.0.0")):
            port = 7410 + 250 * domain
            wait_for(lambda port=port: bool(listens(port)), "a socket")  # type: ignore[misc]
            assert listens(port) == {address}
    finally:
        for node in nodes.values():
            node.send_signal(signal.SIGINT)
            assert node.wait(DEADLINE) == 0


@pytest.mark.slow
@pytest.mark.parametrize("asked", [False, True])
def test_the_option_asks_for_the_network(tmp_path: Path, asked: bool) -> None:
    """What the process of `grasp ctl` has become has it among its variables."""
    words = [sys.executable, "-m", "grasp_ros.cli", "ctl", "status", *["--network"] * asked]
    process = subprocess.Popen(words, cwd=tmp_path, env=plain_environment(129), stderr=subprocess.PIPE, text=True)
    became = Path(f"/proc/{process.pid}/cmdline")
    wait_for(lambda: b"grasp_ros.graph" in became.read_bytes(), "the node")
    assert (b"ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET" in (became.parent / "environ").read_bytes()) is asked
    process.kill()
    process.communicate(timeout=DEADLINE)


@pytest.mark.slow
def test_a_node_that_cannot_be_secure_does_not_start(tmp_path: Path) -> None:
    """Of the wheels' Fast DDS; one that was built with security would ask for the keys."""
    (tmp_path / "keys" / "enclaves" / "grasp").mkdir(parents=True)
    environment = plain_environment(
        128, ROS_SECURITY_ENABLE="true", ROS_SECURITY_STRATEGY="Enforce", ROS_SECURITY_KEYSTORE=str(tmp_path / "keys"),
    )
    for words in (["--enclave", "/grasp"], ["--enclave", "/other"]):
        result = subprocess.run(
            [*START, "plant", "--ros-args", *words], env=environment, capture_output=True, text=True, timeout=DEADLINE,
            check=False, cwd=tmp_path,
        )
        assert result.returncode == 2, result.stderr
        assert "Traceback" not in result.stderr


def test_the_nodes_do_not_import_from_the_working_directory() -> None:
    from grasp_ros.graph import processes

    assert "-P" in processes._command(["plant"], {}, "/")
    assert processes._command(["plant"], {}, "/")[0] == sys.executable

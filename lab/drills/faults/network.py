"""Drills: three hosts of a network that is cut: network namespaces, joined by a bridge; nothing of the machine itself.

The hosts belong to a user namespace of their own, so they need no rights where such namespaces are permitted, and they
are gone when their last process is.
"""

from __future__ import annotations

import signal
import subprocess
import time
from functools import partial

from grasp_ros.graph.host import LOCALHOST, RANGE, SUBNET
from grasp_ros.scene.topics import JOINT_STATES
from lab.drills.faults.drill import Drill, Evidence, Skipped
from lab.drills.faults.stage import START_SECONDS, Failed, Stage

GROUP = "three hosts"
HOSTS = {"one": ("plant",), "two": ("left_controller", "right_controller"), "three": ("monitor",)}
SHORT, LONG = 1.0, 25.0  # s; the lease of discovery is 20 s
LOOK_SECONDS = 5.0  # for a peer to find a plant; it takes one
WISH = "FASTDDS_DEFAULT_PROFILES_FILE"  # set, it keeps the package from its own profile; the wheels do not look at it
LINK = "10.77.0"
ENTER = ["nsenter", "-U", "-n", "-m", "--preserve-credentials", "-t"]
PRIVATE = "mount -t tmpfs none /dev/shm && ip link set lo up && exec sleep 600"  # no shared memory between hosts
SWITCH = f"ip link add cable type bridge && ip link set cable up && {PRIVATE}"


def drills() -> list[Drill]:
    """Cuts shorter and longer than the lease, and an uninvited guest."""
    cuts = [
        Drill(f"cut-{seconds:g}-s", GROUP, f"the cable of the controllers is cut for {seconds:g} s", start,
              partial(cut, seconds=seconds), culprit=f"{may_be_silent}/(left|right)_controller")  # both are behind it
        for seconds, may_be_silent in ((SHORT, "^$|"), (LONG, ""))  # a short cut may be over before it is noticed
    ]
    fault = "another host that names this one as a peer (`ROS_STATIC_PEERS`), without `--network`"
    return [*cuts, Drill("peer", GROUP, fault, start, start, play=peer)]  # which says itself who was found


def start(stage: Stage) -> None:
    """Start the nodes on their hosts."""
    inside = build(stage)
    for host, nodes in HOSTS.items():
        for node in nodes:
            stage.node(node, prefix=on(inside[host]))
    stage.look_on_from(on(inside["one"]))


def build(stage: Stage) -> dict[str, int]:
    """Build the network; returns a process on each host."""
    needed = ["unshare", "-Urnm", "sh", "-c", "ip link add cable type bridge && mount -t tmpfs none /dev/shm"]
    try:
        permitted = subprocess.run(needed, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        permitted = False
    if not permitted:
        raise Skipped("no network namespaces may be made here")
    switch = stage.start("switch", ["unshare", "-Urnm", "sh", "-c", SWITCH]).pid
    _until(switch, "ip link show cable")
    found = {}
    for number, host in enumerate(HOSTS, start=1):
        found[host] = stage.start(host, [*ENTER, str(switch), "unshare", "-nm", "sh", "-c", PRIVATE]).pid
        _until(found[host], "! ip link show cable && ip link show lo | grep UP")  # until then it is on the switch
        _do(switch, f"ip link add {host} type veth peer name eth0 netns {found[host]}"
                    f" && ip link set {host} master cable && ip link set {host} up")
        _do(found[host], f"ip addr add {LINK}.{number}/24 dev eth0 && ip link set eth0 up"
                         " && ip route add 239.0.0.0/8 dev eth0")
    return found


def on(pid: int, **variables: str) -> list[str]:
    """Words before a command that take it to a host, where it may use the network."""
    given = {RANGE: SUBNET, **variables}
    return [*ENTER, str(pid), "env", *(f"{name}={value}" for name, value in given.items())]


def peer(stage: Stage) -> Evidence:
    """A plant with ROS's own LOCALHOST is found by that peer; one of this package's is not."""
    inside = build(stage)
    stage.look_on_from(on(inside["two"], ROS_STATIC_PEERS=f"{LINK}.1"))
    found, empty = {}, stage.folder / "theirs.xml"
    empty.write_text("<dds/>")
    for name, more in (("theirs", {WISH: str(empty)}), ("ours", {})):
        stage.node("plant", prefix=on(inside["one"], **{RANGE: LOCALHOST, **more}))
        stage.wait(lambda: stage.said("waiting"), START_SECONDS)
        topic = JOINT_STATES.name
        found[name] = stage.companion.ask("wait_for_sources", topic=topic, number=1, seconds=LOOK_SECONDS)["there"]
        stage.started["plant"].send_signal(signal.SIGINT)
        stage.started["plant"].wait()
        stage.output.lines.clear()
        stage.companion.ask("wait_for_sources", topic=topic, number=0)
    theirs, ours = ("found" if found[name] else "not found" for name in ("theirs", "ours"))
    said = f"with ROS's LOCALHOST alone the plant is {theirs}, as this package starts it {ours}"
    wrong = "" if (theirs, ours) == ("found", "not found") else said
    return Evidence(said=said, went_on=True, nothing_to_keep=True, wrong=wrong)


def cut(stage: Stage, seconds: float) -> None:
    """Cut the cable of the controllers, and mend it, sooner if all has ended by then."""
    switch = stage.started["switch"].pid
    _do(switch, "ip link set two down")
    stage.wait(lambda: stage.ended("plant") and stage.ended("monitor"), seconds)
    _do(switch, "ip link set two up")


def _do(pid: int, script: str) -> None:
    result = subprocess.run([*ENTER, str(pid), "sh", "-c", script], check=False, capture_output=True, text=True)
    if result.returncode:
        raise Failed(f"{script}: {result.stderr.strip()}")


def _until(pid: int, condition: str) -> None:
    """Wait until a host is there."""
    end = time.monotonic() + 10.0
    script = f"{condition} && grep ' /dev/shm ' /proc/self/mounts"
    while subprocess.run([*ENTER, str(pid), "sh", "-c", script], capture_output=True, check=False).returncode:
        if time.monotonic() > end:
            raise Skipped("no network namespaces may be made here")
        time.sleep(0.05)

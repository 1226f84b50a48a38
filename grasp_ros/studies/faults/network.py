"""Drills: three hosts of a network that is cut: network namespaces, joined by a bridge; nothing of the machine itself.

The hosts belong to a user namespace of their own, so they need no rights where such namespaces are permitted, and they
are gone when their last process is.
"""

from __future__ import annotations

import subprocess
import time
from functools import partial

from grasp_ros.studies.faults.drill import Drill, Skipped
from grasp_ros.studies.faults.stage import Stage

GROUP = "three hosts"
HOSTS = {"one": ("plant",), "two": ("left_controller", "right_controller"), "three": ("monitor",)}
SHORT, LONG = 1.0, 25.0  # s; the lease of discovery is 20 s
LINK = "10.77.0"
ENTER = ["nsenter", "-U", "-n", "-m", "--preserve-credentials", "-t"]
PRIVATE = "mount -t tmpfs none /dev/shm && ip link set lo up && exec sleep 600"  # no shared memory between hosts
SWITCH = f"ip link add cable type bridge && ip link set cable up && {PRIVATE}"


def drills() -> list[Drill]:
    """Cuts shorter and longer than the lease."""
    return [
        Drill(f"cut-{seconds:g}-s", GROUP, f"the cable of the controllers is cut for {seconds:g} s", start,
              partial(cut, seconds=seconds))
        for seconds in (SHORT, LONG)
    ]


def start(stage: Stage) -> None:
    """Build the network, and start the nodes on its hosts."""
    needed = ["unshare", "-Urnm", "sh", "-c", "ip link add cable type bridge && mount -t tmpfs none /dev/shm"]
    try:
        permitted = subprocess.run(needed, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        permitted = False
    if not permitted:
        raise Skipped("no network namespaces may be made here")
    switch = stage.start("switch", ["unshare", "-Urnm", "sh", "-c", SWITCH]).pid
    _until(switch, "cable")
    for number, (host, nodes) in enumerate(HOSTS.items(), start=1):
        inside = stage.start(host, [*ENTER, str(switch), "unshare", "-nm", "sh", "-c", PRIVATE]).pid
        _until(inside, "lo:.*UP")
        _do(switch, f"ip link add {host} type veth peer name eth0 netns {inside} && ip link set {host} master cable"
                    f" && ip link set {host} up")
        _do(inside, f"ip addr add {LINK}.{number}/24 dev eth0 && ip link set eth0 up"
                    " && ip route add 239.0.0.0/8 dev eth0")
        for node in nodes:
            stage.node(node, prefix=[*ENTER, str(inside), "env", "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"])
    stage.look_on_from([*ENTER, str(stage.started["one"].pid), "env", "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"])


def cut(stage: Stage, seconds: float) -> None:
    """Cut the cable of the controllers, and mend it, sooner if all has ended by then."""
    switch = stage.started["switch"].pid
    _do(switch, "ip link set two down")
    stage.wait(lambda: stage.ended("plant") and stage.ended("monitor"), seconds)
    _do(switch, "ip link set two up")


def _do(pid: int, script: str) -> None:
    subprocess.run([*ENTER, str(pid), "sh", "-c", script], check=True, capture_output=True)


def _until(pid: int, pattern: str) -> None:
    """Wait until a host has a link."""
    end = time.monotonic() + 10.0
    script = f"ip link show | grep -q '{pattern}' && grep -q ' /dev/shm ' /proc/self/mounts"
    while subprocess.run([*ENTER, str(pid), "sh", "-c", script], capture_output=True, check=False).returncode:
        if time.monotonic() > end:
            raise Skipped("no network namespaces may be made here")
        time.sleep(0.05)

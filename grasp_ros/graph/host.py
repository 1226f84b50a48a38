"""The host of a graph: who reaches it there, what it must have, and what killed processes leave in its memory.

A graph is reached from this host alone, unless the network is asked for.

ROS's own setting for that, ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, only says whom a participant looks for: it still
listens on every interface, and who names this host as a static peer is let in. So Fast DDS gets a profile, too, whose
only interface is the loopback one. A participant on this host that has no such profile is found as before.

On the network Fast DDS gets another one, by which what was lost is sent again at once: by default it takes up to 3 s,
in which a node would seem to be silent.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import resource
import socket
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from grasp_ros import CONFIG
from grasp_ros.physics.errors import Refused

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
OFF, LOCALHOST, SUBNET = "OFF", "LOCALHOST", "SUBNET"
RANGES = ("", LOCALHOST, SUBNET, "SYSTEM_DEFAULT")
DOMAIN, MOST_DOMAIN = "ROS_DOMAIN_ID", 232  # the last one whose ports exist
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE, NETWORK_PROFILE = CONFIG / "this_host.xml", CONFIG / "network.xml"
SERVER = "ROS_DISCOVERY_SERVER"
OTHERS = ("ROS_STATIC_PEERS", SERVER)  # on other hosts
PROFILE_FILES = ("FASTDDS_DEFAULT_PROFILES_FILE", PROFILES)
MIDDLEWARE, OURS = "RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"  # the one that the profile is for
LEAST_BYTES = 2**31  # that a node can address: with its libraries and threads it takes up to 1.8e9
LEAST_FILES = 32  # that a node has open: its libraries, and the sockets of DDS
SHARED = Path("/dev/shm")  # of Linux; elsewhere there is nothing to find
LOCK, PREFIX, PORT = "_el", "fastrtps_", "fastrtps_port"  # how Fast DDS names what it has there
YOUNG_SECONDS = 2.0  # a process may be about to lock what it has just made
INDEX = "share/ament_index/resource_index/rmw_typesupport"  # where an installation of ROS lists those that it has


def network(given: Mapping[str, str]) -> dict[str, str]:
    """Variables of a process that the network may reach: ROS's own range if one is set that is more than this host."""
    return {RANGE: SUBNET} if _stays(given) else {}


def environment(given: Mapping[str, str]) -> dict[str, str]:
    """Variables that keep a process on this host and let DDS repair losses soon, but what the given ones wish for.

    Whoever sets a range beyond this host, peers or a discovery server leaves this host; whoever sets a profile of Fast
    DDS, but one of ours, or another middleware gets no profile.
    """
    stays, ours = _stays(given), ("", str(PROFILE), str(NETWORK_PROFILE))
    found = {RANGE: LOCALHOST} if stays else {}
    if given.get(MIDDLEWARE, OURS) != OURS or any(given.get(name, "") not in ours for name in PROFILE_FILES):
        return found
    alone = stays and not any(given.get(name) for name in OTHERS)
    return {**found, PROFILES: str(PROFILE if alone else NETWORK_PROFILE)}


def _stays(given: Mapping[str, str]) -> bool:
    """Whether ROS's range is this host, as it is by default here; a variable without a value is not set."""
    return (given.get(RANGE) or LOCALHOST) == LOCALHOST


def location(given: Mapping[str, str], namespace: str) -> str:
    """Where a process with these variables looks for others, in words."""
    reach = "this host" if _stays(given) else "the network"
    server = given.get(SERVER)
    through = f", through {SERVER} {server}" if server else ""
    return f"in ROS domain {given.get(DOMAIN) or 0}, namespace {namespace}, on {reach}{through}"


def hold(given: Mapping[str, str], namespace: str) -> socket.socket:
    """Take the place of a graph on this host, until the socket is closed, at the latest by the end of the process.

    Raises
    ------
    Refused
        If another one has it: its nodes would take the states and commands of these for their own.
    """
    name = f"{int(given.get(DOMAIN) or 0)} /{namespace.strip('/')}"
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0grasp_ros {hashlib.sha256(name.encode()).hexdigest()}")  # a socket has 107 bytes for its name
    except OSError as error:
        held.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise Refused(f"a graph or a replay already runs {location(given, namespace)}; allowed: another {DOMAIN} or"
                      " --namespace") from None
    return held


def check_reach(given: Mapping[str, str], alone: bool = False) -> None:
    """Refuse a host where a graph would be nowhere, somewhere else, or without memory, or its nodes without each other.

    If all are alone in one process, they need not.
    """
    memory, _ = resource.getrlimit(resource.RLIMIT_AS)
    if 0 <= memory < LEAST_BYTES:  # too little has as many words as libraries
        raise Refused(f"memory (`ulimit -v`): {memory >> 10} kB is not allowed; allowed: {LEAST_BYTES >> 10} or more")
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if 0 <= files < LEAST_FILES:
        raise Refused(f"open files (`ulimit -n`): {files} is not allowed; allowed: {LEAST_FILES} or more")
    domain, reach, middleware = (given.get(name, "") for name in (DOMAIN, RANGE, MIDDLEWARE))
    if domain and not (domain.isascii() and domain.isdecimal() and int(domain) <= MOST_DOMAIN):
        raise Refused(f"{DOMAIN}: {domain!r} is not allowed; allowed: 0 to {MOST_DOMAIN}")
    if reach not in RANGES and not (alone and reach == OFF):
        why = ", no node would find another" if reach == OFF else ""
        raise Refused(f"{RANGE}: {reach!r} is not allowed{why}; allowed: {', '.join(RANGES[1:])}")
    roots = [sys.prefix, *filter(None, given.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    installed = {OURS, *(file.name for root in roots for file in Path(root, INDEX).glob("rmw_*"))}
    installed.discard("rmw_implementation")
    if middleware and middleware not in installed:  # ROS's library would end the process
        raise Refused(f"{MIDDLEWARE}: {middleware!r} is not allowed; allowed here: {', '.join(sorted(installed))}")
    for name, file in ((name, given[name]) for name in PROFILE_FILES if given.get(name)):
        from xml.etree import ElementTree  # most have no such file

        try:  # Fast DDS would pass over it without a word, and listen to every interface
            ElementTree.parse(file)
        except (OSError, ElementTree.ParseError) as error:
            raise Refused(f"{name}: {file!r} is not allowed: {error}; allowed: an XML file of profiles") from None


def remove_left() -> None:
    """Remove the segments of shared memory that killed processes have left.

    A segment has a lock file beside it, which its process holds: if it can be had, nobody uses the segment any more.
    The small segments of ports are left alone: the next process on that port takes them over, perhaps at this moment.
    """
    for lock in SHARED.glob(f"{PREFIX}*{LOCK}"):
        with suppress(OSError), lock.open("rb") as held:
            if not lock.name.startswith(PORT) and time.time() - lock.stat().st_mtime > YOUNG_SECONDS:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                lock.with_name(lock.name.removesuffix(LOCK)).unlink(missing_ok=True)
                lock.unlink()

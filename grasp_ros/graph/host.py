"""From where a graph can be reached: from this host alone, unless the network is asked for.

ROS's own setting for that, ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, only says whom a participant looks for: it still
listens on every interface, and who names this host as a static peer is let in. So Fast DDS gets a profile, too, whose
only interface is the loopback one. A participant on this host that has no such profile is found as before.
"""

from __future__ import annotations

from collections.abc import Mapping

from grasp_ros import CONFIG

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCALHOST, SUBNET = "LOCALHOST", "SUBNET"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE = CONFIG / "this_host.xml"
OTHER_WISHES = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "FASTDDS_DEFAULT_PROFILES_FILE", PROFILES)
OURS = "rmw_fastrtps_cpp"  # the middleware that the profile is for


def network(given: Mapping[str, str]) -> dict[str, str]:
    """Variables of a process that the network may reach: ROS's own range if one is set that is more than this host."""
    return {RANGE: SUBNET} if given.get(RANGE, LOCALHOST) == LOCALHOST else {}


def this_host(given: Mapping[str, str]) -> dict[str, str]:
    """Variables that keep a process on this host, unless the given ones wish for something else.

    Whoever sets a range beyond this host, peers, a discovery server, a profile of Fast DDS or another middleware has
    wished for something else.
    """
    if given.get(RANGE, LOCALHOST) != LOCALHOST:
        return {}
    own = given.get("RMW_IMPLEMENTATION", OURS) != OURS or any(given.get(name) for name in OTHER_WISHES)
    return {RANGE: LOCALHOST} if own else {RANGE: LOCALHOST, PROFILES: str(PROFILE)}

"""What can be set at the start of a node with `-p NAME:=VALUE`, and how a plant then runs: in lockstep or not."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from grasp_ros.physics.accuracy import ACCURACY, check_accuracy
from grasp_ros.physics.errors import Refused

PEER_SECONDS, START_SECONDS = 1.5, 60.0  # without a heartbeat of a node, and until it comes
Settings = dict[str, tuple[bool | float | str, str]]  # default and meaning by name
TIMEOUT = "age of the last command, simulated time since the state it answers, that is too old"
ON_TIMEOUT = "reaction: hold, zero or stop"
PEERS: Settings = {
    "peer_timeout_s": (PEER_SECONDS, "wall time without a heartbeat or an answer"),
    "start_timeout_s": (START_SECONDS, "wall time until peers appear and answer; 0: no limit"),
    "on_silence": ("wait", "reaction to a peer that is gone or silent: end or wait"),
}
MONITORED: Settings = {
    "wait_for_monitor": (False, "start only when a monitor listens; a plant never outruns it"),
}
FREE: Settings = {  # exist with the wall clock
    "real_time_factor": (1.0, "simulated seconds per second"),
    "wait_for_controllers": (False, "start the clock only when each controller has sent a command"),
    "left_timeout_s": (0.1, TIMEOUT), "left_on_timeout": ("zero", ON_TIMEOUT),
    "right_timeout_s": (0.1, TIMEOUT), "right_on_timeout": ("zero", ON_TIMEOUT),
}
PLANT: Settings = {
    "scene": ("case_01", "name of a scene of the package, or path of a .yaml file"),
    "accuracy": (ACCURACY, "relative size of the first neglected term of a contact"), **MONITORED,
    "paused": (False, "begin paused, at the first state"),
    "steps": (1, "control periods of one call of the service step"),
    "progress": (False, "show a progress bar on a terminal"),
    "free_running": (False, "follow the wall clock instead of waiting for the commands"), **FREE, **PEERS,
}
CONTROLLER: Settings = {
    **MONITORED, "law": ("", "your controller instead of the scene's, module:object"), **PEERS,
}
NODES = {
    "plant": PLANT, "left_controller": CONTROLLER, "right_controller": CONTROLLER,
    "monitor": {"bag": ("", "new directory of the bag (default: grasp_ and the time)"), **PEERS},
}
TOOLS: dict[str, Settings] = {  # which commands of `grasp` become
    "player": {"bag": ("", "directory of the bag"), "rate": (1.0, "playback: bag time / wall time")},
    "remote": {"words": ("[]", "what to ask, a JSON list; empty: what the lines of the standard input say")},
    "watch": {},
}
PARAMETERS = NODES | TOOLS
REACTIONS = ("hold", "zero", "stop")
LEAST = 1e-6  # real-time factor


def usage(node: str) -> str:
    """What a node prints when it is asked for help."""
    rows = [f"  {name:<20} {text} ({str(default).lower()})".removesuffix(" ()")
            for name, (default, text) in PARAMETERS[node].items()]
    if node in NODES and node != "monitor":
        own = "left_arm.position_m" if node == "plant" else f"{node.split('_')[0]}_feedback.position_gain_N_per_m"
        rows += ["", f"Numbers of the scene are parameters, too: -p {own}:=0.4"]
    return "\n".join([f"usage: {node} [--ros-args [-p NAME:=VALUE] ...]", "", *rows, ""])


def argument(value: bool | float | str) -> str:
    """A value as `-p` takes one, in ASCII: as YAML; JSON would write pairs of surrogates, which YAML refuses."""
    if not isinstance(value, str):
        return repr(value).lower()
    if re.search("[\ud800-\udfff]", value):
        raise Refused(f"{value}: not allowed; allowed: a name in UTF-8")
    return '"' + re.sub(r'[^ !#-\[\]-~]', lambda sign: f"\\U{ord(sign[0]):08x}", value) + '"'


def check_timeouts(peer: float, start: float) -> None:
    """Refuse wall times in s after which a node is silent, and after which it has not come, that can be none."""
    if not start > 0.0:
        raise Refused(f"start_timeout_s: {start:g} is not allowed; allowed: a number > 0, or 0 for any time")
    if not 0.0 < peer <= start:
        most = f", at most {start:g} like start_timeout_s" if start < math.inf else ""
        raise Refused(f"peer_timeout_s: {peer:g} is not allowed; allowed: a number > 0{most}")


def check_factor(factor: float, name: str = "real_time_factor") -> None:
    """Refuse what no free run, and no replay, can have as its simulated seconds per second."""
    if not LEAST <= factor <= 1.0 / LEAST:
        raise Refused(f"{name}: {factor!r} is not allowed; allowed: {LEAST:g} to {1.0 / LEAST:g}")


@dataclass(frozen=True)
class Running:
    """How a plant runs."""

    accuracy: float = ACCURACY  # of its integrator
    real_time_factor: float = 0.0  # simulated seconds per second of wall time; 0: lockstep
    # By side, in a free run: simulated time in s without a command, and what then acts: "hold" the last command, "zero"
    # force, or "stop" the run.
    timeouts: Mapping[str, float] = field(default_factory=dict)
    reactions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_accuracy(self.accuracy)
        for side, seconds in self.timeouts.items():
            if not 0.0 < seconds < math.inf:
                raise Refused(f"{side}_timeout_s: {seconds!r} is not allowed; allowed: a number > 0")
        if self.real_time_factor:
            check_factor(self.real_time_factor)
        for side, reaction in self.reactions.items():
            if reaction not in REACTIONS:
                raise Refused(f"{side}_on_timeout: {reaction!r} is not allowed; allowed: {', '.join(REACTIONS)}")
        if self.timeouts.keys() != self.reactions.keys():
            raise Refused("timeouts, reactions: different sides; allowed: the same sides in both")

    @property
    def lockstep(self) -> bool:
        """Whether each state waits for its commands."""
        return not self.real_time_factor

    @property
    def words(self) -> str:
        """For a reader."""
        if self.lockstep:
            return "lockstep"
        silence = {side: f"{self.reactions[side]} after {seconds:g} s" for side, seconds in self.timeouts.items()}
        alike = sorted({*silence.values()})
        words = alike if len(alike) == 1 else [f"{side} {reaction}" for side, reaction in silence.items()]
        without = f"; on timeout: {', '.join(words)}" if words else ""
        return f"free-running, {self.real_time_factor:g} s per second{without}"

    def to_yaml(self) -> str:
        """As YAML; `parse` of it gives the same."""
        from grasp_ros.scene import strict_yaml  # with NumPy, for which the entry of a node does not wait

        mode = "lockstep" if self.lockstep else "free-running"
        return strict_yaml.dump({"mode": mode, **asdict(self)})

    @classmethod
    def parse(cls, text: str) -> Running:
        """Read what `to_yaml` wrote."""
        from grasp_ros.scene import strict_yaml

        try:
            found: dict[str, Any] = strict_yaml.load(text)
            found.pop("mode")
            return cls(**found)
        except (Refused, AttributeError, KeyError, TypeError) as error:
            raise Refused(f"run: not a description of a run by a plant: {' '.join(str(error).split())}") from None

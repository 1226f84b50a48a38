"""How a plant runs, as it says it on the topic `run` and as a bag keeps it: in lockstep, or with the wall clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from grasp_ros.physics.accuracy import ACCURACY, check_accuracy
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import strict_yaml

REACTIONS = ("hold", "zero", "stop")
LEAST = 1e-6  # real-time factor


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
        mode = "lockstep" if self.lockstep else "free-running"
        return strict_yaml.dump({"mode": mode, **asdict(self)})


def parse(text: str) -> Running:
    """Read what `Running.to_yaml` wrote."""
    try:
        found: dict[str, Any] = strict_yaml.load(text)
        found.pop("mode")
        return Running(**found)
    except (Refused, AttributeError, KeyError, TypeError) as error:
        raise Refused(f"run: not a description of a run by a plant: {' '.join(str(error).split())}") from None

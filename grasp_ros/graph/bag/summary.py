"""Quantities that summarise a bag, as data: what `grasp inspect` prints, with `--json` and as a table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from grasp_ros.graph.bag.recorder import LEFT_OUT, SOURCE
from grasp_ros.graph.bag.recording import Recording
from grasp_ros.graph.bag.verify import Verification, check_recording
from grasp_ros.physics.model import Mode
from grasp_ros.scene.topics import LYAPUNOV_NAMES


def summary(recording: Recording) -> dict[str, Any]:
    """Quantities of a bag by names that end with the unit; those that the bag does not have are left out.

    V is twice the energy. `topics` are those that have a message; their rates are means over the bag's time. `contacts`
    is how often a pair began to touch, as far as the ticks show it.
    """
    scene, running, rates = check_recording(recording).scene, recording.running, recording.rates
    found: dict[str, Any] = {
        "bag": str(recording.path), "size_bytes": recording.size, "title": scene.title, "watch": scene.watch,
        "warnings": list(scene.warnings), "feedback": scene.feedback_in_words(sampled=True),
        "lockstep": running.lockstep, "accuracy": running.accuracy, "resets": recording.resets,
        "ticks": len(recording.tick), "begin_s": float(recording.t[0]),
        "duration_s": float(recording.t[-1] - recording.t[0]), "scene_duration_s": scene.duration,
        "topics": {name: {"messages": count, "rate_Hz": rates[name]} for name, count in recording.counts.items()
                   if count},
        "missing": {name: count for name, count in recording.missing.items() if count},
        "end": recording.lost["end"], "recorded_with": dict(recording.versions),
        "changes": [{"tick": tick, "time_s": scene.time_of(tick), **numbers}
                    for tick, numbers in recording.changes.items()],
        **_levels(recording),
        **{name.replace(" ", "_"): recording.lost[name] for name in (SOURCE, LEFT_OUT) if name in recording.lost},
    }
    if not running.lockstep:
        found["real_time_factor"] = running.real_time_factor
    if recording.timing:
        found |= {
            "reached_s_per_s": recording.reached, "overruns": recording.overruns,
            "given_up_s": float(recording.timing["lost_s"][-1]),
            "command_age_periods": {side: {"p99": usual, "max": most}
                                    for side, (usual, most) in recording.ages.items()},
            "timed_out_periods": recording.timed_out,
        }
    return found


def _levels(recording: Recording) -> dict[str, Any]:
    """Contacts, energies and their balance; the work is NaN where the monitor's numbers are not whole."""
    work, alarm = (recording.lyapunov[:, LYAPUNOV_NAMES.index(name)] for name in ("work", "alarm"))
    follows = np.diff(recording.tick, prepend=-1) == 1  # else the monitor knows no energy before
    balanced, level = int(np.count_nonzero(follows & ~np.isnan(work + alarm))), recording.energy
    whole, contacts = balanced == recording.tick[-1] + 1, {}
    for side, flag in (("left", Mode.LEFT), ("right", Mode.RIGHT)):
        touching = (level.mode & int(flag)) != 0
        before = np.append(False, touching[:-1]) & ~np.isin(recording.tick, recording.starts)  # a reset begins anew
        contacts[side] = int(np.count_nonzero(touching & ~before))
    return {
        "contacts": contacts,
        "energy_of": recording.energy_of, "V_J": level.V[[0, -1]].tolist(),
        "V_c_J": level.V_c[[0, -1]].tolist(),
        "work_J": 0.5 * float(np.sum(work)) if whole else math.nan, "balanced_ticks": balanced,
        "alarms": recording.alarms,
    }


def verified(verification: Verification) -> dict[str, Any]:
    """What became of a bag that was simulated again, as data; `difference` is the first number that differs."""
    difference = verification.difference
    return {
        "holds": verification.holds, "states_compared": verification.ticks, "problem": verification.problem or None,
        "difference": difference._asdict() if difference else None, "same_without_ROS": verification.same,
        "controllers": {side: {"commands": found.commands, "of_the_scene": found.own, "announcements_lost": found.lost}
                        for side, found in verification.answers.items()},
    }

"""No change of the code changes a bit of a result unless it means to."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from project.digests import digest, last_state, runs, versions

FILE = Path(__file__).with_name("digests.json")
RECORD = "python test/project/digests.py > test/project/digests.json"

LOOSE = 1e-6  # of the largest number of a state: what the scenes make of last bits that differ is far less


@pytest.mark.slow
def test_states_events_and_counters_of_every_scene_keep_every_bit() -> None:
    """Where the last bits of another machine differ, the states at the end are what they were but for roundings."""
    recorded, found = json.loads(FILE.read_text(encoding="utf-8")), runs()
    new = sorted(found.keys() - recorded["digests"].keys())
    assert not new, f"{FILE.name} does not have the runs of a new scene: {', '.join(new)}. Record them: {RECORD}"
    for key, run in found.items():
        before, now = recorded["last states"][key], last_state(run)
        assert now == pytest.approx(before, rel=0, abs=LOOSE * max(map(abs, before))), key
    if recorded["versions"] != versions():
        pytest.skip(f"digests were recorded with {recorded['versions']}, this is {versions()}: last bits may differ")
    different = sorted(key for key, before in recorded["digests"].items()
                       if key not in found or digest(found[key]) != before)
    assert not different, (
        f"{len(different)} of {len(found)} runs have other states, events or counters: {', '.join(different)}. If a"
        " scene that was changed or removed, or a change of the numerics that the CHANGELOG names, explains every one:"
        f" {RECORD}. If not, it is a fault."
    )

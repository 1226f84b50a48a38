"""No change of the code changes a bit of a result unless it means to."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from project.digests import digests, versions

FILE = Path(__file__).with_name("digests.json")


@pytest.mark.slow
def test_states_events_and_counters_of_every_scene_keep_every_bit() -> None:
    recorded = json.loads(FILE.read_text(encoding="utf-8"))
    if recorded["versions"] != versions():
        pytest.skip(f"digests were recorded with {recorded['versions']}, this is {versions()}: last bits may differ")
    found, expected = digests(), recorded["digests"]
    different = sorted(key for key in expected.keys() | found.keys() if expected.get(key) != found.get(key))
    assert not different, (
        f"{len(different)} of {len(found)} runs have other states, events or counters: {', '.join(different)}. If a new"
        " scene, or a change of the numerics that the CHANGELOG names, explains every one of them:"
        " python test/project/digests.py > test/project/digests.json. If not, it is a fault."
    )

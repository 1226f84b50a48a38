"""Files that were damaged, or are of another shape, are refused or read; nothing else comes of them."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.graph import bag
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate
from lab.drills import recorder


def recorded(path: Path) -> Path:
    """A bag of three ticks, recorded without a graph."""
    recorder.write(path, simulate(scenes.load("case_01", ["time.duration_s=0.002"]), sampled=True))
    return path


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Bytes cut off, cut out, put in or written over, or one flipped bit."""
    begin, length = int(rng.integers(len(content))), int(rng.integers(1, 60))
    other = rng.integers(256, size=length).astype(np.uint8).tobytes()
    flipped = bytes([content[begin] ^ 1 << int(rng.integers(8))])
    return (content[:begin], content[:begin] + content[begin + length :], content[:begin] + other + content[begin:],
            content[:begin] + other + content[begin + length :],
            content[:begin] + flipped + content[begin + 1 :])[int(rng.integers(5))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_damaged_bag_is_refused_or_read(tmp_path: Path, seed: int) -> None:
    path, rng = recorded(tmp_path / "bag"), np.random.default_rng(seed)
    assert len(bag.read(path).tick) == 3
    refused = 0
    for file in (path / "bag.mcap", path / "metadata.yaml"):
        whole = file.read_bytes()
        for _ in range(20):
            file.write_bytes(damaged(whole, rng))
            with contextlib.suppress(bag.BagError):
                bag.read(path)
                continue
            refused += 1
        file.write_bytes(whole)
    assert refused > 20


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_damaged_simulation_is_refused_or_what_it_was(tmp_path: Path, seed: int) -> None:
    path, rng = tmp_path / "a.npz", np.random.default_rng(seed)
    run = simulate(scenes.load("case_01"), grid=np.linspace(0.0, 20.0, 5))
    run.save(path)
    whole, refused = path.read_bytes(), 0
    for _ in range(200):
        path.write_bytes(damaged(whole, rng))
        with contextlib.suppress(Refused):
            assert simulation.load(path) == run
            continue
        refused += 1
    assert refused > 100

"""How much faster runs are than those of another checkout, as ratios of one session.

    python benchmarks/ratio.py PATH [ROUNDS]

One process for each of the two runs every scene in turn, so that whatever else the machine does meets both alike. A
time is the least processor time of all rounds; what it takes to compile does not count.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

import numpy as np

HERE = Path(__file__).parents[1]
NOISE = {f"{side}_sensor": {"noise_seed": seed, "position_noise_m": 1e-4, "velocity_noise_m_per_s": 1e-3}
         for seed, side in enumerate(("left", "right"), 1)}
RUNS = ("case 1, continuous", "case 1, sampled", "case 1, noise on both sensors", "everything", "case 1, a sine")


def runs() -> dict[str, Callable[[], object]]:
    """What is timed, by name; `RUNS` has the names."""
    from grasp_ros import scene
    from grasp_ros.simulation import simulate

    case, everything = scene.load("case_01"), scene.load("everything")
    noisy = scene.compose("noisy", {**case.values, "loop": {}, **NOISE})
    sine = scene.compose("sine", {**case.values, "object_sine": {"amplitude_N": 1.0, "frequency_Hz": 2.0}})
    grid = np.linspace(0.0, 20.0, 2001)
    return dict(zip(RUNS, (
        lambda: simulate(case, grid=grid), lambda: simulate(case, sampled=True), lambda: simulate(noisy),
        lambda: simulate(everything), lambda: simulate(sine, grid=grid),
    ), strict=True))


def work() -> None:
    """Run what the standard input names, and print the processor time of each in s."""
    known = runs()
    for call in known.values():
        call()
    for line in sys.stdin:
        begin = time.process_time()
        known[line.strip()]()
        print(time.process_time() - begin, flush=True)


def worker(checkout: Path) -> subprocess.Popen[str]:
    """A process that runs what one checkout has."""
    return subprocess.Popen(
        [sys.executable, str(Path(__file__).resolve()), "work"], env={**os.environ, "PYTHONPATH": str(checkout)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=checkout,
    )


def ask(process: subprocess.Popen[str], name: str) -> float:
    """Seconds that a run takes."""
    write: IO[str] | None = process.stdin
    read: IO[str] | None = process.stdout
    assert write is not None
    assert read is not None
    print(name, file=write, flush=True)
    return float(read.readline())


def main(other: Path, rounds: int) -> None:
    """Print a table."""
    old, new = worker(other.resolve()), worker(HERE)
    print("| run | there, ms | here, ms | ratio |\n|---|---:|---:|---:|")
    for name in RUNS:
        pairs = [(ask(old, name), ask(new, name)) for _ in range(rounds)]
        there, here = (min(times) * 1e3 for times in zip(*pairs, strict=True))
        print(f"| {name} | {there:.2f} | {here:.2f} | {there / here:.2f} |", flush=True)
    for process in (old, new):
        process.communicate()


if __name__ == "__main__":
    if sys.argv[1:] == ["work"]:
        work()
    else:
        main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 20)

"""SHA-256 of states, events and counters of every scene that comes with the package, as written and sampled.

    python test/project/digests.py > test/project/digests.json

records them anew, with the versions that they depend on, and the last states, for machines whose last bits differ;
`test_digests.py` compares. Do this only for a new scene or
for a change of the numerics that the CHANGELOG names: what only moves or renames keeps every bit.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from pathlib import Path

import llvmlite
import numba
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # the checkout, whatever is installed

from grasp_ros import scene
from grasp_ros.simulation import Trajectory, simulate


def versions() -> dict[str, str]:
    """What the last bits depend on beside this package: `libm`, the compiler, the machine."""
    return {
        "libc": " ".join(platform.libc_ver()), "numpy": np.__version__, "numba": numba.__version__,
        "llvmlite": llvmlite.__version__, "machine": platform.machine(),
    }


def digest(trajectory: Trajectory) -> str:
    """SHA-256 of the bytes of states, events and counters."""
    found = hashlib.sha256()
    for array in (trajectory.state, trajectory.event_table, trajectory.work):
        found.update(array.tobytes())
    return found.hexdigest()


def runs() -> dict[str, Trajectory]:
    """Of every scene, by name and kind of run."""
    return {
        f"{name} {kind}": simulate(scene.load(name), sampled=sampled)
        for name in sorted(scene.names())
        for kind, sampled in (("as written", False), ("sampled", True))
    }


def last_state(trajectory: Trajectory) -> list[float]:
    """Positions and velocities at the end, of the bodies that are there."""
    state = trajectory.state[-1]
    return [float(number) for number in state[~np.isnan(state)]]


if __name__ == "__main__":
    found = runs()
    print(json.dumps({
        "versions": versions(), "digests": {key: digest(run) for key, run in found.items()},
        "last states": {key: last_state(run) for key, run in found.items()},
    }, indent=1))

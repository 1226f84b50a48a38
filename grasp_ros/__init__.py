"""A grasp held together by Hunt-Crossley impacts: exact simulation, control and measurement over ROS 2.

Rooms, each importing only from those below it (pyproject.toml has the contract): `cli`; `graph` (nodes and bags) and
`maps` (many runs in files); `simulation` (a run without ROS); `methods` (the other integrators) and `observe` (what is
seen of a run); `exact` (the compiled integrator) and `scene` (what a file may say); `physics` (equations).
"""

from pathlib import Path

_HERE = Path(__file__).parent
# scenes and layouts: within an installed package, beside the package in a checkout
CONFIG = next(path for path in (_HERE / "config", _HERE.parent / "config") if path.is_dir())

"""A grasp held together by Hunt-Crossley impacts: exact simulation, control and measurement over ROS 2.

    import grasp_ros as gr

    run = gr.simulate(gr.load("case_01"))

What is listed in `__all__` is imported when it is first used, so that `import grasp_ros` costs nothing.

Parts, each importing only from those below it (pyproject.toml has the contract): `cli`; `identification` (numbers from
measurements) and `optimization` (numbers chosen for an outcome); `graph` (nodes and bags), `maps` (many runs in files)
and `accuracy` (what it costs); `simulation` (a run without ROS); `sensitivity` (derivatives carried along); `methods`
(the other integrators) and `observe` (what is seen of a run); `exact` (the compiled integrator) and `scene` (what a
file may say); `physics` (equations).
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

_HERE = Path(__file__).parent
# scenes and layouts: within an installed package, beside the package in a checkout
CONFIG = next(path for path in (_HERE / "config", _HERE.parent / "config") if path.is_dir())
_PLACES = {  # module, and the name there where it is another one; their types: __init__.pyi
    "LEFT": "physics.layout", "OBJECT": "physics.layout", "RIGHT": "physics.layout", "Refused": "physics.errors",
    "Scene": "scene.scene", "Status": "exact.integrator", "Trajectory": "simulation.trajectory",
    "Transition": "physics.layout", "compose": "scene.scene", "design": "optimization.search",
    "draw": "simulation.plots", "ensemble": "simulation.ensemble", "fit": "identification.fit", "load": "scene.scene",
    "load_run": "simulation.trajectory_file:load", "names": "scene.scene", "parse": "scene.scene",
    "read_bag": "graph.bag.reading:read", "simulate": "simulation.simulate", "spectrum": "sensitivity.spectrum",
}
__all__ = sorted(_PLACES)


def __getattr__(name: str) -> Any:
    """What is used for the first time."""
    if name == "__version__":
        from importlib.metadata import version  # which takes a while

        return version(__name__)
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, there = _PLACES[name].partition(":")
    found = globals()[name] = getattr(import_module(f"{__name__}.{module}"), there or name)
    return found


def __dir__() -> list[str]:
    return __all__

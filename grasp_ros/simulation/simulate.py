"""Run a scene without ROS: the paper's continuous feedback, or the sampled one of the graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import length_hint
from types import MappingProxyType

import numpy as np

from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Status
from grasp_ros.methods import registry
from grasp_ros.methods.contract import Problem
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.control import Law
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import ascending, mapping, names, truth, whole
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.targets import check_scene
from grasp_ros.sensitivity.directions import check_keys
from grasp_ros.simulation.closed_loop import NO_CHANGES, Changes, check_changes, solve, wrap_controllers
from grasp_ros.simulation.progress import Callback, showing
from grasp_ros.simulation.sampled_plant import tick_times
from grasp_ros.simulation.trajectory import Trajectory

GRID_POINTS = 2001
CHANGED = "the scene's, with numbers set on the way"  # a controller


def simulate(
    scene: Scene,
    *,
    grid: Array | None = None,
    sampled: bool = False,
    method: str = EXACT,
    setting: float | None = None,
    max_events: int = MAX_EVENTS,
    max_work: int = MAX_WORK,
    changes: Changes = NO_CHANGES,
    controllers: Mapping[str, Law | type] = MappingProxyType({}),
    sensitivity: Sequence[str] | None = None,
    progress: Callback | bool | None = None,
) -> Trajectory:
    """Simulate a scene from its initial state to the end of its horizon.

    Parameters
    ----------
    scene : Scene
    grid : array (n,), s, optional
        Ascending output times within the horizon: numbers, one number, or time differences of numpy or pandas. Default:
        2001 equidistant ones, or every control period if the feedback is sampled.
    sampled : bool
        False: feedback acts continuously, as in the paper, unless the scene itself has a `loop`. True: as in the
        graph, each command is computed from the state at the beginning of a control period and held over it.
    method : str
        A key of `methods.registry.METHODS`.
    setting : float, optional
        Accuracy of `exact`, see `exact.integrator.Integrator`; step in s, or tolerance, of another method. Default: the
        method's own.
    max_events : int
        Budget of events.
    max_work : int
        Budget of work, for `exact` alone: flights, Taylor steps, and evaluations of event functions.
    changes : mapping of int to mapping of str to float
        New values of parameters by "section.key", by the tick from which they apply; only for sampled feedback. The run
        lists a controller with such a change in its `controllers`, like one in place of the scene's.
    controllers : mapping of str to callable
        Controllers in place of the scene's feedback, "left" or "right": functions of the tick, its time in s, and the
        measured x in m and v in m/s of the arm that return a command in N, which is limited and delayed as the scene
        defines. Further parameters get the measurements of their names, see `physics.observation.OBSERVABLES`. The
        loop is sampled. Each function is called once for every tick, including the last. A function compiled by numba
        without further parameters runs at full speed. A class is instantiated for the run; any other object is reset
        before it by `reset()`, if it has this method.
    sensitivity : sequence of str, optional
        Keys of the scene, "section.key", with respect to which the motion is differentiated through its impacts, see
        `Trajectory.sensitivity`. This takes two runs: event times of the first are output times of the second.
    progress : callable or True, optional
        True: a bar, in a terminal or in a notebook. A callable gets the time reached, in s: on the way, and
        at the end of the horizon, if the run gets there.

    Raises
    ------
    Refused
        If the grid is not ascending within the horizon, the changes are not those of a running graph, the method
        cannot do what is asked, see `methods.registry.check`, or a controller cannot be called or returns no
        finite number. Exceptions of a controller are passed on, with a note of the tick.
    """
    check_scene(scene)
    changes, controllers = mapping("changes", changes), mapping("controllers", controllers)
    sampled = truth("sampled", sampled) or scene.sampled or bool(controllers)
    max_events, max_work = whole("max_events", max_events, 0), whole("max_work", max_work, 0)
    check_changes(scene, sampled, changes, controllers)
    if sensitivity is not None:
        sensitivity = names("sensitivity", sensitivity)
        check_keys(scene, sensitivity, sampled)
        if method != EXACT or controllers or changes:
            raise Refused(f"{scene.name}: sensitivity: allowed: the method {EXACT}, without controllers and changes")
    setting = registry.check(method, scene, setting, sampled=sampled, max_work=max_work)
    changing = [length_hint(force.changes(scene.ticks)) for force in scene.system.external]
    ticks, most = scene.ticks if sampled else max(changing, default=0), max(MAX_WORK, max_work)
    if ticks > most:  # each of them costs a piece of work at least
        raise Refused(f"{scene.name}: {ticks} control periods with an input each; allowed: max_work, {most}")
    if grid is None:
        grid = tick_times(scene) if sampled else np.linspace(0.0, scene.duration, GRID_POINTS)
    grid = ascending("grid", grid, scene.duration)  # new: kernels are compiled anew for arrays that nobody may write to
    by_user = wrap_controllers(scene, controllers)
    with showing(progress, scene.duration, "s", scene.name) as progress:
        problem = Problem(scene.system, scene.duration, grid, setting, max_events, max_work, sampled, progress=progress)
        found, loop = solve(scene, method, problem, changes, by_user)
        if progress is not None and found.status is Status.DONE:
            progress(scene.duration)
    changed = {name.split("_")[0]: CHANGED for numbers in changes.values() for name in numbers}
    own = {**changed, **{NAMES[side]: controller.name for side, controller in by_user.items()}}
    run = Trajectory(
        scene, grid[: len(found.state)], found.state, loop, found.event_table, found.work, found.status, method,
        setting, found.stop, own, found.at_rest,
    )
    if sensitivity is None:
        return run
    from grasp_ros.simulation.differentiate import differentiate  # whose kernels no other run loads

    return replace(run, sensitivity=differentiate(run, sensitivity))

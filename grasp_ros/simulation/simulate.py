"""Run a scene without ROS: the paper's continuous feedback, or the sampled one of the graph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from zipfile import BadZipFile

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import ACCURACY, MAX_EVENTS, MAX_WORK, Event, Integrator, Status, to_events
from grasp_ros.methods import equations, registry
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.energy import Energy, energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, Work
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.simulation.closed_loop import Changes, Progress, check_changes, continuous_run, sampled_run, tick_times

GRID_POINTS = 2001


@dataclass(frozen=True)
class Trajectory:
    """A simulated or recorded motion.

    Attributes
    ----------
    scene : Scene
    sampled : bool
        Whether the commands were held over control periods.
    t : array (n,), s
    state : array (n, 6), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r; NaN for a body that is not there.
    answers : array (n, 2), N, or None
        What sampled controllers answered last; None under continuous feedback.
    event_table : array (m, 5)
        Time in s, side, kind, u in m and u' in m/s of every event, in the order of time; see `events`.
    work : array of int
        Counters, see `layout.Work` for `exact` and `methods.equations.Work` for the others.
    status : Status
    method : str
        A key of `methods.registry.METHODS`.
    setting : float
        Its accuracy, step in s, or tolerance.
    stop : str
        Why and where a run of `exact` stopped, with time, contact mode and state; empty if it did not.
    """

    scene: Scene
    sampled: bool
    t: Array
    state: Array
    answers: Array | None
    event_table: Array
    work: np.ndarray
    status: Status
    method: str = EXACT
    setting: float = ACCURACY
    stop: str = ""

    @property
    def counters(self) -> dict[str, int]:
        """The work by its names."""
        names = Work if self.method == EXACT else equations.Work
        return {entry.name.lower().replace("_", " "): int(self.work[entry]) for entry in names}

    @property
    def command(self) -> Array:
        """Commands f_l, f_r (n, 2) in N: what the feedback answers to the states, (4), (5), or answered last.

        0 without a controller.
        """
        if self.answers is not None:
            return self.answers
        answers: Array = self.scene.system.commands(0, self.state.T)[:2].T
        return answers

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the output times."""
        return energy(self.scene.system, self.state)

    @property
    def events(self) -> list[Event]:
        """The events as records."""
        return to_events(self.event_table)

    def times(self, kind: Transition, side: int) -> Array:
        """Times in s of one side's events of a kind."""
        chosen: Array = self.event_table[(self.event_table[:, 1] == side) & (self.event_table[:, 2] == kind), 0]
        return chosen

    def save(self, path: Path) -> None:
        """Write everything to a .npz file.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        level = self.energy
        with path.open("wb") as file:
            np.savez_compressed(
                file, t=self.t, state=self.state, command=self.command, V=level.V, V_c=level.V_c, V_rate=level.V_rate,
                mode=level.mode,
                touch_left=self.times(Transition.TOUCH, LEFT), touch_right=self.times(Transition.TOUCH, RIGHT),
                release_left=self.times(Transition.RELEASE, LEFT), release_right=self.times(Transition.RELEASE, RIGHT),
                events=self.event_table, work=self.work,
                work_names=np.array([name.replace(" ", "_") for name in self.counters]), status=self.status.name,
                method=self.method, setting=self.setting, sampled=self.sampled, stop=self.stop,
                scene_name=self.scene.name, scene=self.scene.to_yaml(),
            )


def load(path: Path) -> Trajectory:
    """Read what `Trajectory.save` wrote.

    Raises
    ------
    Refused
        If the file is not such a file.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            scene = scenes.parse(str(data["scene"]), str(data["scene_name"]), str(path))
            answers = data["command"] if data["sampled"] else None
            return Trajectory(
                scene, bool(data["sampled"]), data["t"], data["state"], answers, data["events"], data["work"],
                Status[str(data["status"])], str(data["method"]), float(data["setting"]), str(data["stop"]),
            )
    except (OSError, EOFError, KeyError, ValueError, TypeError, BadZipFile) as error:
        raise Refused(f"{path}: not a file of `grasp simulate`: {error}") from None


def simulate(
    scene: Scene,
    *,
    grid: Array | None = None,
    sampled: bool = False,
    accuracy: float = ACCURACY,
    method: str = EXACT,
    setting: float | None = None,
    max_events: int = MAX_EVENTS,
    max_work: int = MAX_WORK,
    changes: Changes = MappingProxyType({}),
    progress: Progress = None,
) -> Trajectory:
    """Simulate a scene from its initial state to the end of its horizon.

    Parameters
    ----------
    scene : Scene
    grid : array (n,), s, optional
        Ascending output times within the horizon. Default: 2001 equidistant ones, or every control period if the
        feedback is sampled.
    sampled : bool
        False: feedback acts continuously, as in the paper, unless the scene itself has a `loop`. True: as in the
        graph, each command is computed from the state at the beginning of a control period and held over it.
    accuracy : float
        Of the method `exact`, see `physics.integrator.Integrator`.
    method : str
        A key of `methods.registry.METHODS`.
    setting : float, optional
        Accuracy, step in s, or tolerance of the method. Default: `accuracy` for `exact`, otherwise the method's own.
    max_events : int
        Budget of contact events.
    max_work : int
        Budget of work, for `exact`: flights, Taylor steps, and evaluations of event functions.
    changes : mapping of int to mapping of str to float
        Numbers of the scene by "section.key" that were set while it ran, by the tick from which they act; only for
        sampled feedback.
    progress : callable, optional
        Called with the time reached, in s.

    Raises
    ------
    Refused
        If the accuracy is outside its range, the grid is not ascending within the horizon, the changes are not those
        of a running graph, or the method cannot do what is asked, see `methods.registry.check`.
    """
    sampled = sampled or scene.sampled
    check_changes(scene, sampled, changes)
    setting = registry.check(method, scene, accuracy if method == EXACT and setting is None else setting, sampled)
    if grid is None:
        grid = tick_times(scene) if sampled else np.linspace(0.0, scene.duration, GRID_POINTS)
    grid = np.asarray(grid, dtype=float)
    if not ((grid[1:] >= grid[:-1]).all() and np.isfinite(grid[[0, -1]] if len(grid) else grid).all()):
        raise Refused("grid: allowed: ascending finite times")
    if len(grid) and not (grid[0] >= 0.0 and grid[-1] <= scene.duration):
        raise Refused(f"grid: [{grid[0]!r}, {grid[-1]!r}] is not allowed; allowed: within [0, {scene.duration!r}] s")
    if method != EXACT:
        found = registry.solve(method, scene, grid, setting, min(max_events, registry.MOST_EVENTS))
        return Trajectory(
            scene, False, grid[: len(found.state)], found.state, None, found.event_table, found.work, found.status,
            method, setting,
        )
    integrator = Integrator(scene.system, continuous=not sampled, accuracy=setting, max_events=max_events,
                            max_work=max_work)
    if sampled:
        states, answers = sampled_run(scene, integrator, grid, changes, progress)
    else:
        states, answers = continuous_run(scene, integrator, grid), None
    for body in scene.system.absent:
        states[:, COLUMN[body] : COLUMN[body] + 2] = np.nan
    return Trajectory(
        scene, sampled, grid[: len(states)], states, answers, integrator.event_table, integrator.work.copy(),
        integrator.status, EXACT, setting, integrator.stop,
    )

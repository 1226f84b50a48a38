"""Run a scene without ROS: the paper's continuous feedback, or the sampled one of the graph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.methods import equations, registry
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.integrator import ACCURACY, Integrator, Status, SwitchEvent, to_events
from grasp_ros.physics.layout import LEFT, RIGHT, Event, Work
from grasp_ros.physics.model import Array, energy, feedback
from grasp_ros.scene import NANOSECONDS, Scene

GRID_POINTS = 2001
Progress = Callable[[float], object] | None


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
        x_l, v_l, x_o, v_o, x_r, v_r.
    switches : array (m, 5)
        Time in s, side, kind, u in m and u' in m/s of every switch, in the order of time; see `events`.
    work : array of int
        Counters, see `layout.Work` for `exact` and `methods.equations.Work` for the others.
    status : Status
    method : str
        A key of `methods.registry.METHODS`.
    setting : float
        Its accuracy, step in s, or tolerance.
    """

    scene: Scene
    sampled: bool
    t: Array
    state: Array
    switches: Array
    work: np.ndarray
    status: Status
    method: str = EXACT
    setting: float = ACCURACY

    @property
    def counters(self) -> dict[str, int]:
        """The work by its names."""
        names = Work if self.method == EXACT else equations.Work
        return {entry.name.lower().replace("_", " "): int(self.work[entry]) for entry in names}

    @property
    def command(self) -> Array:
        """Input forces f_l, f_r (n, 2) in N that the feedback answers to the states, (4), (5)."""
        return np.stack(command(self.scene, self.state.T), axis=-1)

    @property
    def events(self) -> list[SwitchEvent]:
        """The switches as records."""
        return to_events(self.switches)

    def times(self, kind: Event, side: int) -> Array:
        """Times in s of one side's events of a kind."""
        chosen: Array = self.switches[(self.switches[:, 1] == side) & (self.switches[:, 2] == kind), 0]
        return chosen

    def save(self, path: Path) -> None:
        """Write everything to a .npz file.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        level = energy(self.scene.grasp, self.state)
        with path.open("wb") as file:
            np.savez_compressed(
                file, t=self.t, state=self.state, command=self.command, V=level.V, V_c=level.V_c, V_rate=level.V_rate,
                mode=level.mode, touch_left=self.times(Event.TOUCH, LEFT), touch_right=self.times(Event.TOUCH, RIGHT),
                release_left=self.times(Event.RELEASE, LEFT), release_right=self.times(Event.RELEASE, RIGHT),
                events=self.switches, work=self.work,
                work_names=np.array([name.replace(" ", "_") for name in self.counters]), status=self.status.name,
                method=self.method, setting=self.setting, sampled=self.sampled, scene_name=self.scene.name,
                scene=self.scene.to_yaml(),
            )


def load(path: Path) -> Trajectory:
    """Read what `Trajectory.save` wrote.

    Raises
    ------
    ValueError
        If the file is not such a file.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            scene = scenes.parse(str(data["scene"]), str(data["scene_name"]), str(path))
            return Trajectory(
                scene, bool(data["sampled"]), data["t"], data["state"], data["events"], data["work"],
                Status[str(data["status"])], str(data["method"]), float(data["setting"]),
            )
    except (OSError, EOFError, KeyError, ValueError, TypeError, BadZipFile) as error:
        raise ValueError(f"{path}: not a file of `grasp simulate`: {error}") from None


def simulate(
    scene: Scene,
    *,
    grid: Array | None = None,
    sampled: bool = False,
    accuracy: float = ACCURACY,
    method: str = EXACT,
    setting: float | None = None,
    max_events: int = 10**7,
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
        False: feedback acts continuously, as in the paper. True: as in the graph, each command is computed from
        the state at the beginning of a control period and held over it.
    accuracy : float
        Of the method `exact`, see `physics.integrator.Integrator`.
    method : str
        A key of `methods.registry.METHODS`.
    setting : float, optional
        Accuracy, step in s, or tolerance of the method. Default: `accuracy` for `exact`, otherwise the method's own.
    max_events : int
        Budget of contact switches.
    progress : callable, optional
        Called with the time reached, in s.

    Raises
    ------
    ValueError
        If the accuracy is outside its range, the grid is not ascending within the horizon, or the method cannot do
        what is asked, see `methods.registry.check`.
    """
    setting = registry.check(method, scene, accuracy if method == EXACT and setting is None else setting, sampled)
    if grid is None:
        grid = tick_times(scene) if sampled else np.linspace(0.0, scene.duration, GRID_POINTS)
    grid = np.asarray(grid, dtype=float)
    if not (np.isfinite(grid).all() and (np.diff(grid) >= 0.0).all()):
        raise ValueError("grid: allowed: ascending finite times")
    if len(grid) and not (grid[0] >= 0.0 and grid[-1] <= scene.duration):
        raise ValueError(f"grid: [{grid[0]!r}, {grid[-1]!r}] is not allowed; allowed: within [0, {scene.duration!r}] s")
    if method != EXACT:
        solution = registry.solve(method, scene, grid, setting, min(max_events, registry.MOST_EVENTS))
        return Trajectory(scene, False, grid[: len(solution.state)], *solution, method, setting)
    integrator = Integrator(
        scene.grasp, scene.initial_state, continuous=not sampled, accuracy=setting,
        max_events=max_events
    )
    states = (
        _sampled(scene, integrator, grid, progress) if sampled else integrator.advance(scene.duration, grid)
    )
    grid = grid[: len(states)]
    return Trajectory(
        scene, sampled, grid, states, integrator.switches, integrator.work.copy(), integrator.status, EXACT,
        setting
    )


def tick_times(scene: Scene) -> Array:
    """Times in s of all control periods of a scene, shape (ticks + 1,)."""
    return np.arange(scene.ticks + 1) * scene.period_ns / NANOSECONDS


def command(scene: Scene, state: Array) -> tuple[float, float]:
    """Input forces f_l, f_r in N that the controllers answer to a state (6,)."""
    grasp = scene.grasp
    return feedback(grasp.left, state[0], state[1]), feedback(grasp.right, state[4], state[5])


def _sampled(scene: Scene, integrator: Integrator, grid: Array, progress: Progress) -> Array:
    period = scene.period_ns / NANOSECONDS
    times = tick_times(scene)
    # Each period [t_k, t_k+1) delivers its own outputs; a state at a tick is the one that the controllers see.
    bounds = np.searchsorted(grid, times, side="left")
    rows = [np.empty((0, 6))]
    for tick in range(scene.ticks):
        integrator.hold(*command(scene, integrator.state))
        inside = grid[bounds[tick] : bounds[tick + 1]]
        rows.append(integrator.advance(period, np.clip(inside - times[tick], 0.0, period), times[tick]))
        if integrator.status is not Status.DONE:
            return np.concatenate(rows)
        if progress is not None and tick % 100 == 0:
            progress(times[tick])
    rows.append(np.repeat(integrator.state[None], len(grid) - bounds[-1], axis=0))
    return np.concatenate(rows)

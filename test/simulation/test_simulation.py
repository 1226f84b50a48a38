"""Runs of whole scenes: continuous, sampled, on any grid, and on disk."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import energy

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, Work
from grasp_ros.physics.model import Array, feedback
from grasp_ros.physics.system import System
from grasp_ros.scene import Scene
from grasp_ros.simulation import GRID_POINTS, SampledPlant, Trajectory, load, simulate
from grasp_ros.simulation.trajectory import tick_times


def scene_of(name: str = "case_01", duration: float = 2.0, period: float = 0.001, *settings: str) -> Scene:
    """A case with another length and control period."""
    return scenes.load(name, [f"time.duration_s={duration!r}", f"time.control_period_s={period!r}", *settings])


def plain_loop(scene: Scene) -> tuple[Array, Array]:
    """Sampled feedback as the graph does it: states and commands at the ticks."""
    grasp = scene.grasp
    plant = SampledPlant(System.of(grasp, scene.initial_state), scene.period_ns)
    states, forces = [plant.state], []
    for _ in range(scene.ticks):
        x_l, v_l, _, _, x_r, v_r = plant.state
        forces.append((feedback(grasp.left, x_l, v_l), feedback(grasp.right, x_r, v_r)))
        plant.step(np.array([*forces[-1], 0.0]))
        assert plant.status is Status.DONE
        states.append(plant.state)
    return np.array(states), np.array(forces)


def test_continuous_is_the_integrator() -> None:
    scene = scene_of(duration=5.0)
    result = simulate(scene)
    integrator = Integrator(scene.system, continuous=True)
    states = integrator.advance(5.0, np.linspace(0.0, 5.0, GRID_POINTS))
    assert np.array_equal(result.state, states)
    assert result.events == integrator.events
    assert result.status is Status.DONE
    assert not result.sampled
    assert np.array_equal(result.state[0], scene.initial_state)
    assert result.work[Work.FLIGHTS] > 0 < result.work[Work.CONTACT_STEPS]


@pytest.mark.parametrize("name", ["case_01", "case_02", "case_05", "case_10"])
@pytest.mark.parametrize("period", [0.001, 0.01, 0.05])
def test_sampled_is_a_plain_loop_bit_for_bit(name: str, period: float) -> None:
    scene = scene_of(name, 2.0, period)
    states, forces = plain_loop(scene)
    result = simulate(scene, sampled=True)
    assert np.array_equal(result.state, states)
    assert np.array_equal(result.command[:-1], forces)
    assert np.array_equal(result.t, tick_times(scene))
    assert result.sampled
    assert len(result.times(Transition.TOUCH, LEFT)) >= 1


def test_sampled_between_ticks() -> None:
    scene = scene_of(duration=1.0, period=0.01)
    ticks = simulate(scene, sampled=True)
    fine = simulate(scene, sampled=True, grid=np.sort(np.concatenate([ticks.t, np.linspace(0.0, 1.0, 1234)])))
    index = np.searchsorted(fine.t, ticks.t, side="left")
    assert np.array_equal(fine.t[index], ticks.t)
    assert np.abs(fine.state[index] - ticks.state).max() < 1e-14
    assert [e[1:3] for e in fine.events] == [e[1:3] for e in ticks.events]
    assert np.abs(np.diff(fine.state[:, 0])).max() < 0.01  # no jump between ticks


def test_sampled_approaches_continuous() -> None:
    errors = []
    for period in (0.004, 0.002, 0.001, 0.0005):
        scene = scene_of(duration=1.0, period=period)
        grid = np.linspace(0.0, 1.0, 101)
        errors.append(
            np.abs(simulate(scene, sampled=True, grid=grid).state - simulate(scene, grid=grid).state)[:, 0].max()
        )
    ratios = [a / b for a, b in itertools.pairwise(errors)]
    assert all(1.6 < ratio < 2.5 for ratio in ratios)  # first order in the period
    assert errors[-1] > 1e-6


@pytest.mark.parametrize("grid", [[0.0, 2.1], [-0.1, 1.0], [1.0, 0.5], [0.0, np.nan], [0.0, np.inf], [2.0000000001]])
@pytest.mark.parametrize("sampled", [False, True])
def test_bad_grids_are_refused(grid: Any, sampled: bool) -> None:
    with pytest.raises(ValueError, match="grid"):
        simulate(scene_of(), grid=np.array(grid), sampled=sampled)


@pytest.mark.parametrize("grid", [[], [0.0], [2.0], [0.0, 0.0, 2.0, 2.0], [0.4307053966231132]])
@pytest.mark.parametrize("sampled", [False, True])
def test_small_grids(grid: Any, sampled: bool) -> None:
    result = simulate(scene_of(), grid=np.array(grid), sampled=sampled)
    assert result.state.shape == (len(grid), 6)
    assert result.command.shape == (len(grid), 2)
    assert len(result.events) > 2
    if len(grid) and grid[-1] == 2.0:
        assert np.array_equal(result.state[-1], simulate(scene_of(), sampled=sampled).state[-1])


def test_commands_follow_4_and_5() -> None:
    scene = scene_of("case_09")
    result = simulate(scene)
    assert result.command[:, 0] == pytest.approx(-50.0 * result.state[:, 0] - 0.5 * result.state[:, 1])
    assert result.command[:, 1] == pytest.approx(-50.0 * result.state[:, 4] - 0.5 * result.state[:, 5])


def test_progress_is_reported() -> None:
    seen: list[float] = []
    simulate(scene_of(duration=1.0), sampled=True, progress=seen.append)
    assert seen == sorted(seen)
    assert len(seen) >= 10


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("name", ["case_01", "case_04"])
def test_file_holds_everything(tmp_path: Path, name: str, sampled: bool) -> None:
    result = simulate(scene_of(name, 3.0), sampled=sampled)
    path = tmp_path / "run.npz"
    result.save(path)
    with np.load(path, allow_pickle=False) as data:
        level = result.energy
        assert np.array_equal(data["t"], result.t)
        assert np.array_equal(data["state"], result.state)
        assert np.array_equal(data["command"], result.command)
        assert np.array_equal(data["inputs"], result.inputs, equal_nan=True)
        for key, values in zip(("V", "V_c", "V_rate", "mode"), level, strict=True):
            assert np.array_equal(data[key], values)
        for side, word in ((LEFT, "left"), (RIGHT, "right")):
            assert np.array_equal(data[f"touch_{word}"], result.times(Transition.TOUCH, side))
            assert np.array_equal(data[f"release_{word}"], result.times(Transition.RELEASE, side))
            assert len(data[f"touch_{word}"]) >= 2
        assert data["events"].shape == (len(result.events), 5)
        assert dict(zip(data["work_names"].tolist(), data["work"].tolist(), strict=True)) == {
            entry.name.lower(): result.work[entry] for entry in Work
        }
        assert str(data["status"]) == "DONE"
        assert bool(data["sampled"]) is sampled
        assert scenes.parse(str(data["scene"]), name, "x").values == result.scene.values
    again = load(path)
    assert_same(again, result)


def assert_same(a: Trajectory, b: Trajectory) -> None:
    """Equality of everything."""
    assert a.scene == b.scene
    assert a.sampled is b.sampled
    assert a.events == b.events
    assert all(type(event.kind) is Transition for event in a.events)
    assert a.status is b.status
    for name in ("t", "state", "command", "inputs", "work"):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)


def test_file_of_a_run_without_events(tmp_path: Path) -> None:
    result = simulate(scene_of(duration=0.1), grid=np.zeros(0))
    result.save(tmp_path / "none.npz")
    assert_same(load(tmp_path / "none.npz"), result)
    assert result.events == []


@pytest.mark.parametrize("content", [b"", b"not a file", b"PK\x03\x04broken"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"other\.npz"):
        load(path)
    with pytest.raises(ValueError, match=r"missing\.npz"):
        load(tmp_path / "missing.npz")
    np.savez(tmp_path / "strange.npz", a=1)
    with pytest.raises(ValueError, match=r"strange\.npz"):
        load(tmp_path / "strange.npz")


def test_budget_ends_a_run_with_its_status(tmp_path: Path) -> None:
    scene = scene_of("case_02", 3000.0, 1.0)
    result = simulate(scene, max_events=1500)
    assert result.status is Status.EVENT_BUDGET
    assert 0 < len(result.t) == len(result.state) == len(result.command) < GRID_POINTS
    result.save(tmp_path / "cut.npz")
    assert load(tmp_path / "cut.npz").status is Status.EVENT_BUDGET


# O3 under held commands: the physical energy changes by the work of the commands less the dissipation.


@pytest.mark.parametrize("period", [0.01, 0.1, 0.25])
def test_work_balance_of_held_commands(period: float) -> None:
    scene = scene_of(
        "case_01",
        2.0,
        period,
        "left_arm.damping_Ns_per_m=0",
        "right_arm.damping_Ns_per_m=0",
        "left_contact.dissipation_s_per_m=0",
        "right_contact.dissipation_s_per_m=0",
    )
    result = simulate(scene, sampled=True)
    passive = scene.grasp._replace(
        left=scene.grasp.left._replace(position_gain=0.0, velocity_gain=0.0),
        right=scene.grasp.right._replace(position_gain=0.0, velocity_gain=0.0),
    )
    stored = 0.5 * energy(passive, result.state).V_c
    work = (result.command[:-1] * np.diff(result.state[:, [0, 4]], axis=0)).sum(axis=1)
    assert np.abs(np.diff(stored) - work).max() < 1e-12
    assert np.abs(work).max() > 1e-3


def test_dissipation_is_what_the_balance_lacks() -> None:
    scene = scene_of("case_01", 2.0, 0.05)
    result = simulate(scene, sampled=True)
    passive = scene.grasp._replace(
        left=scene.grasp.left._replace(position_gain=0.0, velocity_gain=0.0),
        right=scene.grasp.right._replace(position_gain=0.0, velocity_gain=0.0),
    )
    stored = 0.5 * energy(passive, result.state).V_c
    work = (result.command[:-1] * np.diff(result.state[:, [0, 4]], axis=0)).sum(axis=1)
    lost = work - np.diff(stored)
    assert (lost >= -1e-14).all()
    assert lost.sum() > 0.1


# The stability limit of the sampled free arm: spectral radius 1 at the period of oracles.md.


@pytest.mark.parametrize(("gains", "limit"), [((5.0, 0.5), 0.275056637414546), ((50.0, 5.0), 0.2027695528985455)])
def test_stability_limit_of_a_sampled_free_arm(gains: tuple[float, float], limit: float) -> None:
    def radius(period: float) -> float:
        """Of the map over one period, whose columns are two integrations; the object is out of reach."""
        columns = []
        for state in ([1.0, 0.0], [0.0, 1.0]):
            scene = scenes.load(
                "case_01",
                [
                    f"left_feedback.position_gain_N_per_m={gains[0]}",
                    f"left_feedback.velocity_gain_Ns_per_m={gains[1]}",
                    "right_arm.stiffness_N_per_m=0",
                ],
            )
            system = System.of(scene.grasp, np.array([*state, 1e6, 0.0, 2e6, 0.0]))
            integrator = Integrator(system, continuous=False)
            plant = SampledPlant(system, period * 1e9, integrator)
            plant.step(np.array([feedback(scene.grasp.left, *state), 0.0, 0.0]))
            assert integrator.events == []
            columns.append(plant.state[:2])
        return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())

    assert radius(limit) == pytest.approx(1.0, abs=1e-11)
    assert radius(limit * 0.99) < 1.0 < radius(limit * 1.01)
    if gains == (5.0, 0.5):  # stability comes back between 1.637 and 2.670 s
        assert [radius(h) < 1.0 for h in (1.636, 1.638, 2.669, 2.671)] == [False, True, True, False]


@pytest.mark.parametrize(("period", "grows"), [(0.2, False), (0.4, True)])
def test_instability_is_reported_faithfully(period: float, grows: bool) -> None:
    far = (
        "object.position_m=1e6",
        "right_arm.position_m=2e6",
        "right_arm.stiffness_N_per_m=0",
        "right_feedback.position_gain_N_per_m=0",
        "right_feedback.velocity_gain_Ns_per_m=0",
    )
    result = simulate(scene_of("case_01", 20.0, period, *far), sampled=True)
    assert result.status is Status.DONE
    assert np.isfinite(result.state).all()
    size = np.abs(result.state[:, 0])
    assert (size[-10:].max() > 2.0 * size[:10].max()) == grows

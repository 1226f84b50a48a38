"""Ensembles: rows are runs of their own, whoever computes them and whatever becomes of the others."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene, SceneError
from grasp_ros.simulation import simulate
from grasp_ros.simulation.chunk import REFUSED, STATUSES, TARGETS, Setup, Variants
from grasp_ros.simulation.ensemble import Table, ensemble
from grasp_ros.simulation.outcomes import GROUPS
from grasp_ros.simulation.quantities import settling_times

OUTCOMES = ("settling_time", "touches", "last_state")
ROWS = 24


def random_changes(scene: Scene, seed: int = 1, rows: int = ROWS) -> dict[str, np.ndarray]:
    """Every number of a scene that is not 0 or a time, off by up to 30 %."""
    rng = np.random.default_rng(seed)
    return {
        f"{section}.{key}": value * rng.uniform(0.7, 1.3, rows)
        for section, numbers in scene.values.items() if section != "time"
        for key, value in numbers.items() if isinstance(value, float) and value and not key.endswith("_s")
    }


def assert_same(table: Table, other: Table) -> None:
    for name, values in table.columns.items():
        np.testing.assert_array_equal(values, other.columns[name], name)
    np.testing.assert_array_equal(table.status, other.status)
    assert table.stops == other.stops


@pytest.mark.parametrize(("name", "sampled"), [
    ("case_01", False), ("case_01", True), ("tilt_hold", False), ("pulse", False),
])
def test_rows_are_simulations_to_the_last_bit(name: str, sampled: bool) -> None:
    scene = scenes.load(name, ["time.duration_s=2.0"])
    changes = random_changes(scene)
    table = ensemble(scene, changes, OUTCOMES, setup=Setup(accuracy=1e-12, sampled=sampled))
    for i in range(ROWS):
        row = scene.changed({key: float(values[i]) for key, values in changes.items()})
        run = simulate(row, sampled=sampled, setting=1e-12)
        found = [table.columns[column][i] for column in GROUPS["last_state"]]
        np.testing.assert_array_equal(found, run.state[-1])


@pytest.mark.parametrize("sampled", [False, True])
def test_rows_do_not_depend_on_threads_order_or_chunks(monkeypatch: pytest.MonkeyPatch, sampled: bool) -> None:
    scene = scenes.load("case_01", ["time.duration_s=1.0"])
    changes, setup = random_changes(scene), Setup(sampled=sampled)
    table = ensemble(scene, changes, OUTCOMES, setup=setup, threads=1)
    turned = ensemble(scene, {key: values[::-1] for key, values in changes.items()}, OUTCOMES, setup=setup, threads=2)
    for name, values in table.columns.items():
        np.testing.assert_array_equal(values, turned.columns[name][::-1])
    monkeypatch.setattr(sys.modules[ensemble.__module__], "CHUNK_S", 1e-9)
    assert_same(table, ensemble(scene, changes, OUTCOMES, setup=setup, threads=3))


def test_a_row_that_is_refused_or_stops_takes_nobody_with_it() -> None:
    scene = scenes.load("case_01", ["time.duration_s=5.0"])
    gains = np.array([5.0, -50.0, np.nan, 5.0, 2e12, 8.0])
    key = "left_feedback.position_gain_N_per_m"
    table = ensemble(scene, {key: gains}, OUTCOMES)
    assert [STATUSES[code] for code in table.status] == ["DONE", REFUSED, REFUSED, "DONE", REFUSED, "DONE"]
    for i in (1, 2, 4):
        with pytest.raises(SceneError) as refusal:
            scene.changed({key: float(gains[i])})
        assert table.stops[i] == str(refusal.value)
        assert np.isnan(table.columns["settling_time"][i])
    assert table.columns["x_left_end"][0] == table.columns["x_left_end"][3]
    cut = ensemble(scene, {key: gains[[0, 5]]}, OUTCOMES, setup=Setup(max_work=100))
    assert [STATUSES[code] for code in cut.status] == ["WORK_BUDGET", "WORK_BUDGET"]
    assert cut.stops[0] == simulate(scene, max_work=100).stop
    assert np.isnan(cut.columns["settling_time"]).all()
    assert np.isfinite(cut.columns["x_left_end"]).all()


@pytest.mark.slow
def test_a_budget_that_ends_behind_the_horizon_leaves_what_is_known() -> None:
    """Only whether the row settles is not, for which it goes on."""
    wanted, scene = ("settling_time", "touches"), scenes.load("case_03")
    found = ensemble(scene, {}, wanted, setup=Setup(max_events=100))
    assert found.done.all()
    assert not found.stops
    assert np.isnan(found.columns["settling_time"]).all()
    assert found.columns["touches_left"] == ensemble(scene, {}, wanted).columns["touches_left"]
    early = ensemble(scene, {}, wanted, setup=Setup(max_events=10))
    assert "before the end of the horizon: t = 2.3" in early.stops[0]


def test_arrays_are_built_and_refused_like_scenes() -> None:
    """Every key that has a place in the arrays: the same system, to the last bit, and the same rows refused."""
    scene = scenes.load("case_01", [
        "left_feedback.set_point_m=0.01", "right_feedback.set_point_m=0.02", "left_feedback.feed_forward_N=0.3",
        "right_feedback.feed_forward_N=0.1", "object_friction.viscous_Ns_per_m=0.1", "object_friction.coulomb_N=0.2",
        "loop={}", *(f"{side}_{key}" for side in ("left", "right") for key in (
            "rate.period_ticks=2", "actuator.limit_N=3",
            "sensor.noise_seed=1", "sensor.position_noise_m=0.1", "sensor.position_step_m=0.1",
            "sensor.velocity_noise_m_per_s=0.1", "sensor.velocity_step_m_per_s=0.1")),
    ])
    rng = np.random.default_rng(3)
    named = {name: rng.normal(1.0, 2.0, 200) for name in TARGETS}
    named = {name: np.where(rng.random(200) < 0.8, np.rint(values), values) if name.endswith("_ticks") else values
             for name, values in named.items()}
    for name, values in named.items():
        variants = Variants(scene, {name: values})
        assert variants.is_plain
        block, faults = variants.block, variants.faults()
        for i in range(variants.rows):
            if i in faults:
                with pytest.raises(SceneError) as refusal:
                    variants.row(i)
                assert faults[i] == str(refusal.value)
                continue
            system = variants.row(i).system
            np.testing.assert_array_equal(variants.closed_loop[i], system.closed_loop)
            np.testing.assert_array_equal(block["bodies"][i], system.bodies)
            np.testing.assert_array_equal(block["pairs"][i], system.pairs)
            np.testing.assert_array_equal(block["state"][i, :, 0], system.state)
            np.testing.assert_array_equal(block["laws"][i], system.law_rows)
            assert block["coulomb"][i, 0, 0] == system.coulomb


def test_what_cannot_be_varied_is_refused() -> None:
    scene = scenes.load("table")
    for changes, words in (
        ({"left_arm.weight_kg": [1.0]}, r"left_arm.weight_kg: not in this scene; did you mean .*\?"),
        ({"left_arm.mass_kg": [1.0], "object.mass_kg": [1.0, 2.0]}, "one length"),
        ({"left_arm.mass_kg": [[1.0]]}, r"left_arm.mass_kg: shape \(1, 1\) .* allowed: \(n,\)"),
    ):
        with pytest.raises(Refused, match=words):
            ensemble(scene, changes)
    infinite = ensemble(scenes.load("case_01", ["left_feedback.set_point_m=0"]), {
        "left_feedback.position_gain_N_per_m": [np.inf]})  # without a warning of numpy
    assert list(infinite.stops) == [0]


def test_each_mass_settles_at_its_own_time() -> None:
    scene = scenes.load("case_01")
    table = ensemble(scene, {"object.mass_kg": [5.0, 2.0]}, ["settling_times", "settling_time"])
    times = np.stack([table.columns[f"settling_time_{name}"] for name in ("left", "object", "right")], axis=1)
    assert times.max(axis=1).tolist() == table.columns["settling_time"].tolist()
    single = settling_times(simulate(scene))
    assert times[0].tolist() == single.tolist()
    alone = ensemble(scenes.load("arm_alone"), {}, ["settling_times"]).columns
    assert np.isnan([alone["settling_time_object"][0], alone["settling_time_right"][0]]).all()


def test_a_table_for_pandas_and_for_other_programs(tmp_path: Path) -> None:
    gains = [5.0, -50.0]
    table = ensemble(scenes.load("case_01", ["time.duration_s=2"]), {"left_feedback.position_gain_N_per_m": gains},
                     ["touches", "peak_impact"])
    assert table.status_names.tolist() == ["DONE", REFUSED]
    assert table.units["left_feedback.position_gain_N_per_m"] == "N/m"
    assert table.units["peak_impact_left"] == "N"
    frame = table.dataframe()
    assert frame[frame.status == "DONE"].touches_left.tolist() == [table.columns["touches_left"][0]]
    assert frame.attrs["units"] == table.units
    table.to_csv(tmp_path / "table.csv")
    heads, first, second = (line.split(",") for line in (tmp_path / "table.csv").read_text().splitlines())
    assert heads[0] == "left_feedback.position_gain_N_per_m [N/m]"
    assert heads[-1] == "status"
    assert float(first[heads.index("peak_impact_left [N]")]) == table.columns["peak_impact_left"][0]
    assert second[-1] == REFUSED

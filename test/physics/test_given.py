"""What Python users hold in their hands: taken, or refused in a sentence before anything is computed."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable
from datetime import timedelta
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import xarray

from grasp_ros import design, draw, read_bag, simulation
from grasp_ros import scene as scenes
from grasp_ros.exact import Integrator
from grasp_ros.graph.bag.summary import summary as bag_summary
from grasp_ros.graph.bag.verify import laws_of, verify
from grasp_ros.identification.fit import fit
from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.maps.run import run as run_map
from grasp_ros.physics.energy import energy, energy_balance
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import compose
from grasp_ros.sensitivity.spectrum import spectrum
from grasp_ros.simulation import SampledPlant, Setup, ensemble, load, simulate, summary
from grasp_ros.simulation.losses import losses
from grasp_ros.simulation.quantities import contact_intervals, settling_times

GAIN = "left_feedback.position_gain_N_per_m"
CASE = scenes.load("case_01", "time.duration_s=1")
MASS = (2, 2.0, np.int64(2), np.uint8(2), np.float32(2.0), np.float64(2.0), np.longdouble(2.0), np.array(2.0),
        np.array(2), Fraction(2), xarray.DataArray(2.0))
NO_MASS = ("2", b"2", True, np.True_, np.array([2.0]), np.timedelta64(2, "s"), 2.0 + 0.0j, None, Decimal(2), [2.0])
TIMES = [0.25, 0.5, 1.0]
GRIDS = (
    TIMES, tuple(TIMES), np.array(TIMES), np.array(TIMES, dtype=np.float32), iter(TIMES), (t for t in TIMES),
    pandas.Series(TIMES), pandas.Index(TIMES), xarray.DataArray(TIMES), np.array(TIMES, dtype=object),
    pandas.to_timedelta(TIMES, unit="s"), pandas.Series(pandas.to_timedelta(TIMES, unit="s")),
    np.array([250, 500, 1000], dtype="timedelta64[ms]"), [timedelta(seconds=t) for t in TIMES],
)
ONE = (1, 1.0, np.float64(1.0), np.array(1.0), np.timedelta64(1, "s"), timedelta(seconds=1), [1.0])
NO_GRIDS: dict[str, tuple[Any, str]] = {
    "text": ("1.0", "numbers"), "columns": (np.array(TIMES)[:, None], "shape"), "names": (["0.5", "1.0"], "numbers"),
    "truth": ([True, False], "numbers"), "dates": (np.array(["2020-01-01"], dtype="datetime64[s]"), "numbers"),
    "ragged": ([[0.5], [0.5, 1.0]], "allowed"), "complex": ([0.5 + 0.0j], "numbers"),
    "masked": (np.ma.masked_array(TIMES, [False, True, False]), "masked"),
    "never": (np.array(["NaT"], dtype="timedelta64[s]"), "ascending"),
}


@pytest.mark.parametrize("mass", MASS, ids=repr)
def test_every_real_number_is_one(mass: Any) -> None:
    changed = CASE.changed({"object.mass_kg": mass})
    values = {**CASE.values, "object": {**CASE.values["object"], "mass_kg": mass}}
    for scene in (changed, compose("case_01", values)):
        found = scene.values["object"]["mass_kg"]
        assert type(found) is float
        assert found == 2.0
        assert scenes.parse(scene.to_yaml(), "case_01", "case_01").values == scene.values


@pytest.mark.parametrize("mass", NO_MASS, ids=repr)
def test_what_is_no_number_is_none(mass: Any) -> None:
    with pytest.raises(Refused, match=r"object\.mass_kg: .* is not allowed; allowed: a number >= "):
        CASE.changed({"object.mass_kg": mass})


def test_lists_of_a_scene_may_be_arrays() -> None:
    table = scenes.load("table")
    (section, key), = ((section, key) for section, numbers in table.values.items() for key, value in numbers.items()
                       if isinstance(value, tuple) and key.endswith("_N"))
    values = np.array(table.values[section][key], dtype=np.float32)
    assert table.changed({f"{section}.{key}": values}).values[section][key] == tuple(values.tolist())


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: type(grid).__name__)
def test_output_times_of_any_kind(grid: Any) -> None:
    assert simulate(CASE, grid=grid).t.tolist() == TIMES


@pytest.mark.parametrize("grid", ONE, ids=repr)
def test_one_output_time(grid: Any) -> None:
    run = simulate(CASE, grid=grid)
    assert run.t.tolist() == [1.0]
    assert run.state.tobytes() == simulate(CASE, grid=TIMES).state[-1].tobytes()
    assert Integrator(CASE.system, continuous=True).advance(np.float32(1.0), grid).shape == (1, 6)


@pytest.mark.parametrize(("grid", "word"), NO_GRIDS.values(), ids=NO_GRIDS)
def test_what_is_no_output_time_is_refused(grid: Any, word: str) -> None:
    with pytest.raises(Refused, match=f"^grid: .*{word}"):
        simulate(CASE, grid=grid)


@pytest.mark.parametrize(
    "settings",
    [{"setting": 1, "method": "rk4"}, {"setting": np.float32(1e-6)},
     {"setting": np.array(1e-9)}, {"max_events": 1e7}, {"max_work": np.int32(10**6)}, {"sampled": np.True_},
     {"sampled": 1}, {"setting": np.int64(1), "method": "rk4"}],
    ids=repr,
)
def test_what_a_run_takes_its_file_gives_back(tmp_path: Path, settings: dict[str, Any]) -> None:
    run = simulate(CASE, grid=TIMES, **settings)
    path = str(tmp_path / "run.npz")
    run.save(path)
    again = load(path)
    assert again.state.tobytes() == run.state.tobytes()
    assert (again.setting, again.sampled) == (run.setting, run.sampled)


NO_ARGUMENTS: list[tuple[Callable[[Any], object], Any, str]] = [
    (lambda changes: ensemble(CASE, changes), [1], "changes: [1]"),
    (lambda setup: ensemble(CASE, {}, setup=setup), {}, "setup: dict"),
    (lambda outcomes: ensemble(CASE, {}, outcomes), 3, "outcomes: 3"),
    (lambda sampled: ensemble(CASE, {}, setup=Setup(sampled=sampled)), "no", "sampled: 'no'"),
    (lambda log: Plan(CASE, Setup(), (Axis(GAIN, 1.0, 2.0, log=log),)), "no", f"{GAIN}: log: 'no'"),
    (lambda sampled: simulate(CASE, sampled=sampled), "no", "sampled: 'no'"),
    (lambda changes: simulate(CASE, changes=changes), [1], "changes: [1]"),
    (lambda changes: simulate(CASE, sampled=True, changes=changes), {0: [1]}, "changes: at tick 0: [1]"),
    (lambda controllers: simulate(CASE, controllers=controllers), ["left"], "controllers: ['left']"),
    (lambda keys: simulate(CASE, sensitivity=keys), [3], "sensitivity: [3]"),
    (lambda free: fit(simulate(CASE), free), 3, "free: 3"),
    (lambda against: fit(simulate(CASE), GAIN, against=against), [GAIN], f"against: ['{GAIN}']"),
    (lambda data: fit(data, GAIN), None, "data: NoneType"),
    (CASE.changed, [1], "numbers: [1]"), (lambda sections: compose("case", sections), [1], "sections: [1]"),
    (lambda settings: scenes.load("case_01", settings), 3, "settings: 3"),
    (lambda level: simulate(CASE).section([1, 0, 0, 0, 0, 0], level), "a", "level: 'a'"),
    (spectrum, "case_01", "scene: str"), (lambda scene: fit(simulate(CASE), GAIN, scene), "case_01", "scene: str"),
    (lambda scene: design(scene, {GAIN: (1, 2)}, "touches"), "case_01", "scene: str"),
    (lambda keys: ensemble(CASE, {}, sensitivity=keys), [3], "sensitivity: [3]"),
    (lambda method: simulate(CASE, method=method), [], "method: list"),
    (lambda method: simulate(CASE, method=method), "euler", "method 'euler'"),
    *((lambda settings: simulate(CASE, **settings), settings, words) for settings, words in (
        ({"max_work": float("nan")}, "max_work: nan"), ({"max_events": "9"}, "max_events: '9'"),
        ({"max_events": 2.5}, "max_events: 2.5"), ({"max_events": True}, "max_events: True"),
        ({"setting": "1e-9"}, "exact: accuracy: '1e-9'"), ({"method": "rk4", "setting": "1"}, "rk4: step: '1'"),
        ({"max_work": -1}, "max_work: -1"))),
    (lambda progress: simulate(CASE, progress=progress), 1, "progress: 1"),
    (lambda progress: ensemble(CASE, {}, progress=progress), "yes", "progress: 'yes'"),
    (lambda progress: design(CASE, {GAIN: (1, 2)}, "touches", progress=progress), [], "progress: []"),
    (lambda bounds: design(CASE, {GAIN: (1, 2)}, "touches", bounds), 0, "subject_to: 0"),
    (lambda side: simulate(CASE).contacts(side), ["left"], "side: list"),
    (lambda side: contact_intervals(simulate(CASE), side), 0, "side: int"),
    (lambda weights: simulate(CASE).section(weights), {}, "section: {}"),
    (scenes.load, None, "reference: NoneType"), (load, 1, "path: int"), (read_bag, [], "path: list"),
    *((door, "", "path: ''") for door in (load, read_bag, lambda path: simulate(CASE).save(path))),
    (lambda path: simulate(CASE).save(path), None, "path: NoneType"),
    (lambda path: simulate(CASE).to_csv(path), 1, "path: int"),
    (lambda text: scenes.parse(text, "case", "case"), None, "case: text: NoneType"),
    (lambda settings: scenes.parse(CASE.to_yaml(), "case", "case", settings), None, "settings: None"),
    (lambda motion: draw(motion, "case.png"), "a", "motion: str"),
    (lambda caption: draw(simulate(CASE), "case.png", caption), 1, "captions: 1"),
    (lambda path: draw(simulate(CASE), path), None, "path: NoneType"),
    *((door, None, "run: NoneType") for door in (summary, settling_times, losses)),
    *((door, None, "recording: NoneType") for door in (verify, laws_of, bag_summary)),
    (lambda system: energy(system, CASE.initial_state), None, "system: NoneType"),
    (lambda state: energy(CASE.system, state), [1.0], "state: float64, shape (1,),"),
    (lambda system: SampledPlant(system, 10**6), None, "system: NoneType"),
    (lambda system: Integrator(system, continuous=True), CASE, "system: Scene"),
    *((lambda period: SampledPlant(CASE.system, period), period, f"period_ns: {period}") for period in (0, -5, 1.5)),
    (lambda after: energy_balance(CASE.system, np.zeros((2, 6)), after, np.zeros((2, 3))), np.zeros((3, 6)),
     "shape of before (2, 6), after (3, 6), forces (2, 3)"),
    (lambda forces: energy(CASE.system, np.zeros((2, 6)), forces), np.zeros((3, 3)),
     "shape of state (2, 6), external (3, 3)"),
]


@pytest.mark.parametrize(("door", "given", "words"), NO_ARGUMENTS, ids=[words for *_, words in NO_ARGUMENTS])
def test_what_is_of_another_kind_is_refused(door: Callable[[Any], object], given: Any, words: str) -> None:
    with pytest.raises(Refused, match=f"^{re.escape(words)} is not allowed; allowed: "):
        door(given)


def test_columns_of_an_ensemble_of_any_kind() -> None:
    gains = [2.0, 5.0]
    expected = ensemble(CASE, {GAIN: gains}, ["last_state"]).columns["x_left_end"].tolist()
    frame = pandas.DataFrame({GAIN: gains})
    for changes in (frame, {GAIN: pandas.Series(gains)}, {GAIN: np.array(gains, dtype=np.float32)},
                    {GAIN: np.array([2, 5])}, {GAIN: (gain for gain in gains)}, {GAIN: xarray.DataArray(gains)}):
        assert ensemble(CASE, changes, "last_state").columns["x_left_end"].tolist() == expected
    for wrong in (["2.0"], 2.0, [[2.0]], [True], "2.0", [None]):
        with pytest.raises(Refused, match=f"^changes: {GAIN}: "):
            ensemble(CASE, {GAIN: wrong})
    with pytest.raises(Refused, match=r"^max_work: nan is not allowed; allowed: a whole number >= 1$"):
        ensemble(CASE, {GAIN: gains}, setup=Setup(max_work=float("nan")))  # type: ignore[arg-type]
    assert ensemble(CASE, {GAIN: gains}, setup=Setup(settled=np.float32(0.5), max_events=1e5)).done.all()  # type: ignore[arg-type]


def test_a_plan_of_numpy_numbers_goes_to_its_file(tmp_path: Path) -> None:
    axes = (Axis(GAIN, np.int64(1), np.float32(2.0), np.int64(2)),)  # type: ignore[arg-type]
    plan = Plan(CASE, Setup(("touches",), np.float32(1e-9), max_work=np.int64(10**6)), axes, seed=np.int32(1))  # type: ignore[arg-type]
    run_map(plan, str(tmp_path / "map.zarr"))
    told: list[int] = []
    run_map(plan, str(tmp_path / "map.zarr"), progress=told.append)
    assert told == [plan.rows]


def test_what_says_that_it_is_frozen_is() -> None:
    run, table = simulate(CASE, sampled=True), ensemble(CASE, {GAIN: [2.0]})
    for array in (run.t, run.state, run.event_table, run.command, run.inputs, CASE.system.bodies, CASE.system.state,
                  table.columns["touches_left"], table.changes[GAIN], table.status):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    for mapping in (CASE.values, CASE.values["object"], table.columns, table.stops, run.controllers):
        with pytest.raises(TypeError):
            mapping["mass_kg"] = 1.0  # type: ignore[index]
    for record in (CASE, run, table):
        for other in (pickle.loads(pickle.dumps(record)), copy.deepcopy(record), copy.copy(record)):
            assert (other, hash(other)) == (record, hash(record))
    assert pickle.loads(pickle.dumps(run)).state.tobytes() == run.state.tobytes()
    assert copy.deepcopy(CASE) == CASE


def test_the_columns_that_are_handed_over_stay_writable() -> None:
    grid, gains = np.array(TIMES), np.array([2.0])
    simulate(CASE, grid=grid)
    ensemble(CASE, {GAIN: gains})
    grid[0], gains[0] = 0.0, 1.0
    assert simulation.load is load

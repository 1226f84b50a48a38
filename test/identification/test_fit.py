"""Numbers from measured motions: from wrong starts, with honest intervals, and nothing that the data do not show."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import rewritten

from grasp_ros import compose, fit, load, read_bag, simulate
from grasp_ros.graph.processes import Graph
from grasp_ros.identification.measured import measured
from grasp_ros.identification.result import whiteness
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory
from lab.drills import recorder

H_LEFT, H_RIGHT = "left_contact.hertz_N_per_m1_5", "right_contact.hertz_N_per_m1_5"
P_LEFT, P_RIGHT = "left_contact.dissipation_s_per_m", "right_contact.dissipation_s_per_m"
CONTACTS = {H_LEFT: 1e4, H_RIGHT: 1e4, P_LEFT: 0.1, P_RIGHT: 0.1}
NOISE = 1e-4  # m
SCENE = load("case_01").changed({"time.duration_s": 1.0, "time.control_period_s": 0.002})

FRICTION = "object_friction.coulomb_N"
STICKING = compose("sticking", {  # the object sticks, as from some 2.8 N of friction on: nothing tells 8 N from more
    "time": {"duration_s": 2.0, "control_period_s": 0.005},
    "left_arm": {"mass_kg": 1.0, "stiffness_N_per_m": 10.0, "damping_Ns_per_m": 0.5, "position_m": -0.05,
                 "velocity_m_per_s": 0.0},
    "object": {"mass_kg": 1.0, "position_m": 0.0, "velocity_m_per_s": 0.0}, "object_friction": {"coulomb_N": 8.0},
    "left_contact": {"hertz_N_per_m1_5": 1e3, "dissipation_s_per_m": 0.2},
    "left_feedback": {"position_gain_N_per_m": 20.0, "velocity_gain_Ns_per_m": 2.0, "set_point_m": 0.02},
})


@pytest.fixture(scope="module")
def held() -> Trajectory:
    """A run whose inputs were recorded at every tick."""
    return simulate(SCENE, sampled=True)


def noisy(run: Trajectory, seed: int, noise: float = NOISE) -> Trajectory:
    """Positions with noise, and no velocities."""
    state = run.state + noise * np.random.default_rng(seed).normal(size=run.state.shape)
    state[:, 1::2] = np.nan
    return replace(run, state=state)


def covered(run: Trajectory, truth: dict[str, float], times: int) -> Array:
    """How often the interval of each number holds its truth, from so many noisy copies of a run."""
    hits = np.zeros(len(truth))
    for seed in range(times):
        found = fit(noisy(run, seed), [*truth])
        hits += (found.low < [*truth.values()]) & (found.high > [*truth.values()])
    return hits


def tenfold(factors: tuple[float, ...]) -> Scene:
    return SCENE.changed({key: value * factor for (key, value), factor in zip(CONTACTS.items(), factors, strict=True)})


@pytest.mark.slow
@pytest.mark.parametrize("factors", [(0.1, 0.1, 0.1, 0.1), (10, 10, 10, 10), (0.1, 10, 10, 0.1), (10, 0.1, 0.1, 10)])
def test_starts_that_are_wrong_by_ten_end_at_one_minimum(held: Trajectory, factors: tuple[float, ...]) -> None:
    data = noisy(held, 1)
    found, right = fit(data, [*CONTACTS], tenfold(factors)), fit(data, [*CONTACTS])
    deviation = np.sqrt(np.diag(right.covariance))
    assert (np.abs(found.estimates - right.estimates) < 0.05 * deviation).all()
    assert (np.abs(found.estimates - [*CONTACTS.values()]) < 4.0 * deviation).all()
    assert found.noise[::2] == pytest.approx(NOISE, rel=0.1)
    assert {contact.side for contact in found.contacts} == {"none", "left"}  # both touch at once: one stretch
    assert all(contact.white > 1e-4 and contact.rms == pytest.approx(1.0, abs=0.1) for contact in found.contacts)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say(held: Trajectory) -> None:
    hits = covered(held, {key: CONTACTS[key] for key in (H_LEFT, P_LEFT)}, 40)
    assert (hits >= 34).all()  # of 40 with 95 %: fewer once in 1500
    assert (hits < 40).any()


@pytest.mark.slow
@pytest.mark.thorough
def test_intervals_hold_the_truth_in_90_to_98_of_100_bags_of_2_s_at_1_kHz() -> None:
    run = simulate(load("case_01").changed({"time.duration_s": 2.0}), sampled=True)
    assert len(run.t) == 2001
    hits = covered(run, CONTACTS, 100)
    assert (hits >= 90).all()
    assert (hits <= 98).all()


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.0, 1e-5])
def test_intervals_hold_a_truth_that_is_zero_or_hardly_more(p: float) -> None:
    run, drawn = simulate(SCENE.changed({P_LEFT: p, P_RIGHT: p}), sampled=True), list[bool]()
    for seed in range(5):
        found = fit(noisy(run, seed), [H_LEFT, P_LEFT], SCENE.changed({P_RIGHT: p}), against={P_LEFT: p})
        drawn.append(found.estimates[1] > 0.01 * np.sqrt(found.covariance[1, 1]))
        assert 0.0 <= found.low[1] <= p <= found.high[1] < 1e-3
        assert not found.against[P_LEFT].rejected
    assert not all(drawn)  # by the search, which begins elsewhere: half of the estimates are at 0, as noise has it


@pytest.mark.slow
def test_an_interval_has_no_end_where_the_data_show_only_a_bound() -> None:
    run, bounds = simulate(STICKING, sampled=True), 0
    assert np.ptp(run.state[:, 2]) == 0.0
    for seed in range(20):
        found = fit(noisy(run, seed), [FRICTION], STICKING.changed({FRICTION: 2.0}))
        if not found.not_identifiable:
            bounds += 1
            assert 2.7 < found.low[0] < found.estimates[0] < found.high[0] == np.inf
    assert bounds > 5


@pytest.mark.parametrize("seed", [5, 7, 11])
def test_a_number_that_the_data_do_not_bound_at_all_is_not_identifiable(seed: int) -> None:
    """With so much noise an object that slides looks like one that sticks."""
    found = fit(noisy(simulate(STICKING, sampled=True), seed, noise=0.3), [FRICTION], STICKING.changed({FRICTION: 2.0}))
    assert (found.low[0], found.high[0]) == (0.0, np.inf)
    assert found.not_identifiable == ((FRICTION,),)


def test_data_without_noise_give_the_numbers_back(held: Trajectory, tmp_path: Path, command: Any) -> None:
    held.save(tmp_path / "run.npz")
    result = command("fit", "run.npz", "--free", *CONTACTS, "--set", f"{H_LEFT}=3000", "--against", f"{P_LEFT}=0",
                     "--json", "-o", "fit.png")
    data = json.loads(result.stdout)
    assert result.returncode == 0, result.stderr
    for key, value in CONTACTS.items():
        assert data["numbers"][key]["estimate"] == pytest.approx(value, rel=1e-9)
    assert data["against"][P_LEFT]["rejected"]
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    command("fit", "run.npz", "--free", *CONTACTS, "-o", "fitted.yaml")
    fitted = load(tmp_path / "fitted.yaml").values
    assert fitted["left_contact"]["hertz_N_per_m1_5"] == pytest.approx(CONTACTS[H_LEFT], rel=1e-9)


def test_a_value_is_rejected_only_where_the_data_say_so(held: Trajectory) -> None:
    found = fit(noisy(held, 2), [H_LEFT, P_LEFT], against={P_LEFT: 0.0, H_LEFT: 1e4})
    assert found.against[P_LEFT].rejected
    assert found.against[P_LEFT].F > 1e4
    assert not found.against[H_LEFT].rejected
    off = abs(found.estimates[0] - 1e4) / np.sqrt(found.covariance[0, 0])
    assert np.sqrt(found.against[H_LEFT].F) == pytest.approx(off, rel=0.01)  # of one number, F is the square of t


def test_what_the_data_do_not_show_is_named(command: Any) -> None:
    gain, stiffness = "left_feedback.position_gain_N_per_m", "left_arm.stiffness_N_per_m"
    command("simulate", "case_01", "--set", "time.duration_s=1", "--grid", "201", "-o", "run.csv")
    words = "fit", "run.csv", "--scene", "case_01", "--free", stiffness, "--free", gain, "--free", P_LEFT
    result = command(*words)
    assert result.returncode == 1
    assert f"not identifiable from these data: {stiffness}, {gain} together" in result.stdout
    data = json.loads(command(*words, "--json").stdout)
    assert data["not_identifiable"] == [[stiffness, gain]]
    assert data["numbers"][P_LEFT]["low"] < 0.1 < data["numbers"][P_LEFT]["high"]
    assert data["numbers"][gain]["high"] is None
    assert f"{fit('run.csv', [stiffness, gain, P_LEFT], load('case_01'))}\n" == result.stdout
    dampers = "left_arm.damping_Ns_per_m", "left_feedback.velocity_gain_Ns_per_m"
    pairs = fit("run.csv", [stiffness, dampers[0], gain, dampers[1]], load("case_01")).not_identifiable
    assert pairs == ((stiffness, gain), dampers)


def test_a_sensor_that_stands_still_beside_others_is_no_fault(tmp_path: Path, command: Any) -> None:
    """As a spreadsheet writes it, with the mark of its encoding."""
    (tmp_path / "data.csv").write_text(ROWS, encoding="utf-8-sig")
    result = command("fit", "data.csv", "--scene", "case_01", "--free", "object.position_m")
    assert (result.returncode, result.stderr) == (1, "")  # it is another motion
    assert "the fitted motion is not the measured one in x_left_m" in result.stdout


@pytest.mark.parametrize("loop", [(), ("loop={}",)])
def test_a_table_says_what_its_run_says(tmp_path: Path, loop: tuple[str, ...]) -> None:
    scene = load("case_01", ["time.duration_s=1", "time.control_period_s=0.005", *loop])
    run = simulate(scene, grid=np.linspace(0.0, 1.0, 201) if not loop else None)
    run = replace(run, state=run.state + NOISE * np.random.default_rng(5).normal(size=run.state.shape))
    run.to_csv(tmp_path / "run.csv")
    found, same = (fit(data, [H_LEFT, P_LEFT], scene) for data in (tmp_path / "run.csv", run))
    assert found.estimates.tolist() == same.estimates.tolist()
    assert ("forces in the table act only in a scene with loop" in str(found)) == (not loop)
    off = np.abs(found.estimates - [1e4, 0.1]) / np.sqrt(np.diag(found.covariance))
    assert ((off > 0.01) & (off < 4.0)).all()


def test_times_may_be_a_rounding_off_the_ticks_and_a_body_without_a_force_needs_no_column(tmp_path: Path) -> None:
    run = simulate(load("case_01", ["time.duration_s=2", "loop={}"]))
    table = np.column_stack([np.linspace(0.0, 2.0, 2001), run.state[:, ::2], run.inputs[:, [LEFT, RIGHT]]])
    np.savetxt(tmp_path / "run.csv", table, fmt="%.17g", delimiter=",", comments="",
               header="t_s,x_left_m,x_object_m,x_right_m,input_left_N,input_right_N")
    assert (table[:, 0] != run.t).any()
    found, same = (measured(data, run.scene) for data in (tmp_path / "run.csv", run))
    assert found.t.tobytes() == same.t.tobytes()
    assert found.inputs is not None
    assert found.inputs.tolist() == same.inputs.tolist()  # type: ignore[union-attr]


def test_an_initial_value_that_was_measured_starts_there() -> None:
    scene, key = load("case_01", ["time.duration_s=2"]), "right_arm.position_m"
    found = fit(noisy(simulate(scene), 7), [key], scene.changed({key: -0.2}))
    assert found.low[0] < 0.5 < found.high[0]
    assert found.missed == ()


def test_a_search_that_ends_at_another_motion_says_so(tmp_path: Path, command: Any) -> None:
    path, stiffness = tmp_path / "run.csv", "left_arm.stiffness_N_per_m"
    noisy(simulate(load("case_01", ["time.duration_s=2"])), 7).to_csv(path)
    words = "fit", str(path), "--scene", "case_01", "--free", H_LEFT, stiffness, "--set", f"{stiffness}=10000"
    result, data = command(*words), json.loads(command(*words, "--json").stdout)
    assert (result.returncode, "x_left_m" in data["missed"]) == (1, True)
    assert "the fitted motion is not the measured one in x_left_m" in result.stdout


def test_masses_are_free_only_up_to_a_scale_without_a_known_force() -> None:
    scene = load("case_01", ["time.duration_s=1"])
    masses = ["left_arm.mass_kg", "object.mass_kg", H_LEFT, H_RIGHT, "left_arm.stiffness_N_per_m"]
    scale = [*masses, "right_arm.mass_kg", "right_arm.stiffness_N_per_m", "left_arm.damping_Ns_per_m",
             "right_arm.damping_Ns_per_m"]
    freely = scene.changed({f"{side}_feedback.{key}": 0.0 for side in ("left", "right")
                            for key in ("position_gain_N_per_m", "velocity_gain_Ns_per_m")})
    run = simulate(freely, grid=np.linspace(0.0, 1.0, 201))
    assert fit(run, scale).not_identifiable == (tuple(scale),)
    assert fit(run, masses).not_identifiable == ()


def test_offsets_and_initial_values(held: Trajectory) -> None:
    state = noisy(held, 3).state.copy()
    state[:, 4] += 0.02
    keys = ["offset.x_right_m", "right_arm.position_m", "object.velocity_m_per_s", "right_arm.stiffness_N_per_m"]
    wrong = SCENE.changed({"right_arm.position_m": 0.45, "right_arm.stiffness_N_per_m": 50.0})
    found = fit(replace(held, state=state), keys, wrong)
    truth = np.array([0.02, 0.5, 0.0, 10.0])
    off = np.abs(found.estimates - truth) / np.sqrt(np.diag(found.covariance))
    assert ((off > 0.01) & (off < 4.0)).all()
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([0.0, 0.0, 0.0, 0.0], abs=0.01)
    assert found.scene.values["right_arm"]["stiffness_N_per_m"] == found.estimates[3]
    assert found.correlation[0, 1] < 0.0


def test_residuals_of_a_wrong_model_are_not_white(held: Trajectory) -> None:
    wrong = SCENE.changed({P_LEFT: 0.0, P_RIGHT: 0.0})
    found = fit(noisy(held, 4), [H_LEFT, H_RIGHT], wrong)
    assert found.contacts[0].rms < 1.0 < found.contacts[-1].rms
    assert found.contacts[-1].white < 1e-12
    white = np.random.default_rng(0).normal(size=(500, 2))
    assert whiteness(white) > 0.01
    assert whiteness(np.cumsum(white, axis=0)) < 1e-12
    assert np.isnan(whiteness(white[:9]))


@pytest.mark.slow
def test_a_bag(recorded: Path) -> None:
    recording = read_bag(recorded)
    starts = recording.scene.changed({H_LEFT: 2e3, P_LEFT: 0.5, "left_feedback.position_gain_N_per_m": 3.0})
    found = fit(recorded, [H_LEFT, P_LEFT], starts)  # the inputs act that were recorded
    assert found.estimates == pytest.approx([1e4, 0.1], rel=1e-9)
    closed = fit(recording, ["left_feedback.position_gain_N_per_m", P_LEFT], starts.changed({H_LEFT: 1e4}))  # the law
    assert closed.estimates == pytest.approx([5.0, 0.1], rel=1e-9)


@pytest.mark.slow
def test_a_bag_whose_sensors_are_noisy(tmp_path: Path) -> None:
    """Of a graph in which the noise acted through the feedback, too; no sensor is on the object."""
    noise = [f"{side}_sensor.{key}" for side, seed in (("left", 3), ("right", 4))
             for key in (f"noise_seed={seed}", "position_noise_m=1e-4", "velocity_noise_m_per_s=1e-3")]
    scene = load("case_01", ["time.duration_s=2", "loop={}", *noise])
    graph = Graph(scene, tmp_path / "run", ACCURACY, one_process=True)
    graph.start()
    try:
        graph.wait([])
    finally:
        graph.stop()
    recording = read_bag(graph.bag)
    starts = recording.scene.changed({key: 3.0 * value for key, value in CONTACTS.items()})
    found = fit(recording, [*CONTACTS], starts, by_sensors=True)
    assert found.noise[[0, 1, 4, 5]] == pytest.approx([1e-4, 1e-3, 1e-4, 1e-3], rel=0.1)
    off = np.abs(found.estimates - [*CONTACTS.values()]) / np.sqrt(np.diag(found.covariance))
    assert ((off > 1e-3) & (off < 4.0)).all()
    assert all(contact.white > 1e-4 or np.isnan(contact.white) for contact in found.contacts)


def test_a_table_may_be_quoted_and_end_with_an_empty_line(tmp_path: Path) -> None:
    run = simulate(SCENE)
    run.to_csv(tmp_path / "plain.csv")
    lines = [",".join(f'"{word}"' for word in line.split(",")) for line in (tmp_path / "plain.csv").read_text().split()]
    (tmp_path / "quoted.csv").write_text("\r\n".join([*lines, "", ""]))
    plain, quoted = (measured(tmp_path / f"{name}.csv", run.scene) for name in ("plain", "quoted"))
    assert quoted.state.tobytes() == plain.state.tobytes()


def test_a_scene_with_a_loop_holds_its_commands_whatever_the_data_came_from() -> None:
    run, held = simulate(SCENE), load("case_01", ["loop={}"])
    assert measured(run, held).acting == "the held commands of the scene"


ROWS = "t_s,x_left_m,x_object_m\n" + "".join(f"{0.01 * row},{-0.3 + 0.001 * row},0\n" for row in range(20))
HELD = "".join(f"{line},{'input_left_N,input_object_N,input_right_N' if line[0] == 't' else '0,0,0'}\n"
               for line in ROWS.splitlines())  # inputs, but not at every tick
CASE = ("--scene", "case_01", "--free", P_LEFT)


@pytest.mark.parametrize(("content", "words", "complaint"), [
    (ROWS, ("--free", P_LEFT), "a table does not name its scene; allowed: with a scene (--scene, or scene=)"),
    (ROWS, ("--scene", "case_01", "--free", "left_contact.hertz"), f"did you mean {H_LEFT}"),
    (ROWS, ("--scene", "case_01", "--free", "time.duration_s"), "has no derivative: it moves ticks"),
    (ROWS, (*CASE, "--free", P_LEFT), "given twice"),
    (ROWS, ("--scene", "case_01", "--free", "offset.x_left_m"), "at least one parameter of the scene"),
    (ROWS, (*CASE, "--free", "offset.v_left_m_per_s"), "not measured"),
    (ROWS, ("--scene", "case_02", "--free", P_LEFT), f"allowed: a start > 0, as by the setting {P_LEFT}=VALUE"),
    (ROWS, (*CASE, "--against", f"{H_LEFT}=1"), "allowed: a free parameter of the scene"),
    (ROWS, (*CASE, "--against", f"{P_LEFT}=1", "--against", f"{P_LEFT}=0"),
     f"--against {P_LEFT}: given twice; allowed: one value"),
    (ROWS, (*CASE, "--against", P_LEFT), "allowed: KEY=VALUE, with a number"),
    (ROWS, (*CASE, "--against", f"{P_LEFT}=-1"), "dissipation_s_per_m: -1.0 is not"),
    (ROWS.replace("t_s", "t"), CASE, "allowed: t_s and at least one of x_left_m"),
    (ROWS.replace("x_object_m", "x_left_m"), CASE, "allowed: each name once"),
    (ROWS.replace("-0.298,", "nan,"), CASE, "x_left_m: nan at t = 0.02 s; all"),
    (ROWS.replace("-0.298,", "north,"), CASE, "line 4: could not convert"),
    (ROWS.replace("-0.298,", ""), CASE, "line 4: 2 entries; allowed: 3"),
    (ROWS.replace("0.02,", "0.2,"), CASE,
     "t_s: 0.03 after 0.2 is not allowed; allowed: ascending from 0 to 20.0 s, each once"),
    ("\n".join(ROWS.splitlines()[:10]), CASE, "samples; allowed: at least 10"),
    ("", CASE, "allowed: t_s and at least one of x_left_m"),
    (ROWS.replace("x_object_m", "x_objekt_m"), CASE, "column 'x_objekt_m': not known; did you mean x_object_m?"),
    (ROWS.replace("-0.298,", "1_0.0,"), CASE, "line 4: could not convert"),
    (ROWS, (*CASE, "--against", f"{P_LEFT}=1_0"), "allowed: KEY=VALUE, with a number"),
    (ROWS, ("--scene", "friction", "--free", "object_friction.coulomb_N", "--against", "object_friction.coulomb_N=0"),
     "object_friction.coulomb_N has no derivative at 0"),
    (re.sub(r"-0\.\d+", "0", ROWS), CASE, "positions do not change; allowed: a"),
    (ROWS, ("--scene", "arm_alone", "--free", "left_arm.mass_kg"), "x_object_m: arm_alone has no such body"),
    (HELD, (*CASE, "--set", "loop={}"), "not the ticks of case_01, every 0.001 s"),
    (HELD.replace("input_right_N", "impact_right_N"), (*CASE, "--set", "loop={}"),
     "no column input_right_N, the force that acted; allowed: one for each body that is driven, or neither forces nor"),
    (HELD.replace("input", "command").replace("command_object_N", "V_J"),
     (*CASE, "--set", "loop={}"), "no column input_left_N, input_right_N, the force"),
    (ROWS.replace("-0.298,", "-2e200,"), CASE, "x_left_m: -2e+200 at t = 0.02 s"),
    (ROWS.replace(",", ";"), CASE, "one of x_left_m, v_left_m_per_s"),
    ("# mine\n" + ROWS, CASE, "line 1: # mine; allowed: t_s and at least one of"),
    (re.sub("0$", "0,ok", ROWS.replace("object_m", "object_m,why"), flags=re.MULTILINE),
     CASE, "column 'why': not known"),
], ids=range(32))
def test_refusals(tmp_path: Path, command: Any, content: str, words: tuple[str, ...], complaint: str) -> None:
    (tmp_path / "data.csv").write_text(content)
    result = command("fit", "data.csv", *words)
    assert (result.returncode, result.stdout) == (2, "")
    assert complaint in result.stderr


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(Refused, match=r"^nope\.csv: cannot be read: No such file or directory$"):
        fit("nope.csv", [P_LEFT])


def test_the_law_of_another_controller_has_no_numbers() -> None:
    run = simulate(SCENE, controllers={"left": lambda tick, time, x, v: -5.0 * x - 0.6 * v})
    assert fit(run, [P_LEFT], SCENE.changed({P_LEFT: 0.2})).estimates == pytest.approx([0.1], rel=1e-9)
    with pytest.raises(Refused, match=r"^run: other controllers acted; allowed: inputs at every tick"):
        fit(run, [P_LEFT, "right_feedback.velocity_gain_Ns_per_m"])


def test_a_bag_without_commands_does_not_say_which_law_acted(held: Trajectory, tmp_path: Path) -> None:
    """Somebody may have set other gains than those of the scene."""
    recorder.write(tmp_path / "bag", held)
    rewritten(tmp_path / "bag" / "bag.mcap", tmp_path / "new.mcap", without={"/left/effort_command": 0})
    assert fit(tmp_path / "new.mcap", [P_LEFT]).estimates == pytest.approx([0.1], rel=1e-9)
    with pytest.raises(Refused, match=r"new\.mcap: no message on left/effort_command says which law acted; allowed: i"):
        fit(tmp_path / "new.mcap", ["left_feedback.velocity_gain_Ns_per_m"])


def test_recorded_inputs_keep_their_times(held: Trajectory) -> None:
    with pytest.raises(Refused, match=r"its inputs change every 0\.002 s; allowed: a scene with that time\.control"):
        fit(held, [P_LEFT], SCENE.changed({"time.control_period_s": 0.001}))


def test_a_start_whose_motions_take_for_ever_is_refused(held: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    """An object of 1 ug between arms of 1 kg bounces in each contact."""
    monkeypatch.setattr("grasp_ros.identification.search.WORK", 1000)
    with pytest.raises(Refused, match=r"run: object.mass_kg 1e-09: with these starts no run .* reaches its end"):
        fit(held, ["object.mass_kg"], SCENE.changed({"object.mass_kg": 1e-9}))


def test_scipy_is_needed_and_named(held: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(Refused, match=r"needs scipy; pip install scipy"):
        fit(held, [P_LEFT])

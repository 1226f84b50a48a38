"""Controllers from outside: the same numbers as the scene's feedback, what they measure, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from documents import scene_of

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.cli.report import describe_trajectory
from grasp_ros.exact.driver import intervals as compiled
from grasp_ros.exact.integrator import Status
from grasp_ros.physics import control
from grasp_ros.physics.control import ControlLaw
from grasp_ros.physics.energy import PLANT_ALONE, PLANT_AND_FEEDBACK, energy_balance
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.simulation import plots, simulate, summary

SHORT = "time.duration_s=2"


def paper(tick: int, time: float, x: float, v: float) -> float:
    """The feedback of case 1."""
    return -5.0 * x - 0.5 * v


KINDS: dict[str, Any] = {
    "python": paper, "numba": numba.njit(paper), "cfunc": numba.cfunc("f8(i8, f8, f8, f8)")(paper),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["case_01", "everything"])
def test_the_feedback_of_the_scene_from_outside_gives_the_same_bits(name: str, kind: str) -> None:
    """Behind the sensors, limits and delay of the scene."""
    scene = scenes.load(name, [SHORT])
    gains = {f"{side}_feedback.{key}": value for side in ("left", "right") for key, value in (
        ("position_gain_N_per_m", 5.0), ("velocity_gain_Ns_per_m", 0.5), ("set_point_m", 0.0)
    ) if key in scene.values[f"{side}_feedback"]}
    own = simulate(scene.changed(gains), sampled=True)
    for sides in (("left",), ("left", "right")):
        run = simulate(scene.changed(gains), controllers=dict.fromkeys(sides, KINDS[kind]))
        for part in ("state", "command", "inputs", "event_table", "work"):
            assert getattr(run, part).tobytes() == getattr(own, part).tobytes()
        assert set(run.controllers) == set(sides)
        assert run.controllers["left"].endswith(":paper")
    assert run.sampled
    assert (own.energy_of, run.energy_of) == (PLANT_AND_FEEDBACK, PLANT_ALONE)


def test_the_compiled_law_has_the_bits_of_the_one_that_a_node_runs() -> None:
    """Over many sizes, with zeros of both signs and without any limit, noise or step."""
    draw = np.random.default_rng(5)
    for _ in range(3000):
        row = ControlLaw().row
        for columns in ([0, 1, 2, 3], [4, 5], [6, 7], [8]):
            chosen = [column for column in columns if draw.random() < 0.6]
            row[chosen] = 10.0 ** draw.uniform(-9.0, 3.0, len(chosen))
        normals = draw.normal(size=2)
        x, v = (float(draw.choice([0.0, -0.0, draw.normal() * 10.0 ** draw.uniform(-9.0, 9.0)])) for _ in range(2))
        seen = compiled.measured(row, normals, x, v)
        plain = row.tolist()
        assert np.array(seen).tobytes() == np.array(control.measured(plain, normals.tolist(), x, v)).tobytes()
        force = compiled.limited(row, compiled.feedback(row, *seen))
        expected = control.limited(plain, control.feedback(plain, *seen))
        assert np.array(force).tobytes() == np.array(expected).tobytes()


class Notes:
    """A controller with a memory."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, float, float, float]] = []

    def __call__(self, tick: int, time: float, x: float, v: float) -> float:
        self.calls.append((tick, time, x, v))
        return 0.25


def test_a_controller_is_called_once_for_every_tick_with_what_is_measured() -> None:
    scene = scenes.load("case_01", ["time.duration_s=3", "time.control_period_s=0.002", "loop={}",
                                    "left_sensor.noise_seed=3", "left_sensor.position_step_m=0.01"])
    law = Notes()
    run = simulate(scene, controllers={"left": law})
    ticks, times, x, v = (np.array(column) for column in zip(*law.calls, strict=True))
    assert ticks.tolist() == list(range(1501))
    assert times.tobytes() == run.t.tobytes()
    assert np.abs(x - run.state[:, 0]).max() <= 0.005 + 1e-12
    assert np.abs(x / 0.01 - np.round(x / 0.01)).max() < 1e-9
    assert v.tobytes() == run.state[:, 1].tobytes()
    assert (run.command[:, 0] == 0.25).all()
    assert (run.inputs[:-1, 0] == 0.25).all()
    assert run.controllers == {"left": f"{__name__}:Notes"}


@pytest.mark.slow
def test_an_arm_without_feedback_takes_one_and_the_energy_is_that_of_the_plant(tmp_path: Path) -> None:
    scene = scene_of("case_01", SHORT, without=("left_feedback",))
    run = simulate(scene, controllers={"left": paper})
    assert run.status is Status.DONE
    assert run.state.tobytes() == simulate(scenes.load("case_01", [SHORT]), sampled=True).state.tobytes()
    balance = energy_balance(scene.system, run.state[:-1], run.state[1:], run.inputs[:-1])
    assert not balance.alarm.any()
    own = 10.0 * run.state[0, 0] ** 2 + 10.0 * run.state[0, 4] ** 2  # at rest, without Kp x^2
    assert run.energy.V_c[0] == pytest.approx(own)
    table = dict(describe_trajectory(run, summary(run)))
    assert table["left controller"].endswith(":paper")
    assert "V_c of the plant alone" in table
    assert "V_c at" not in table
    assert table["certificate"].startswith("none")
    run.save(tmp_path / "run.npz")
    again = simulation.load(tmp_path / "run.npz")
    assert (again.controllers, again.energy_of) == (run.controllers, PLANT_ALONE)
    with np.load(tmp_path / "run.npz") as data:
        assert str(data["energy_of"]) == PLANT_ALONE
        assert data["V_c"].tobytes() == run.energy.V_c.tobytes()
    plots.draw(run, tmp_path / "run.png", "a controller from outside")


def leans(tick: int, time: float, x: float, v: float, gain: float = 2.0, *, v_other: float, impact: float) -> float:
    """Feedback with the other arm and the contact."""
    return -gain * x - 0.5 * (v + v_other) - 0.01 * impact


def leans_too(tick: int, time: float, x: float, v: float, v_other: float, impact: float) -> float:
    """The same, in an order that numba compiles."""
    return -2.0 * x - 0.5 * (v + v_other) - 0.01 * impact


def test_a_controller_is_given_what_it_asks_for_by_name() -> None:
    scene = scenes.load("case_01", [SHORT, "loop={}", "left_feedback.set_point_m=0.02", "right_sensor.noise_seed=3",
                                    "right_sensor.velocity_step_m_per_s=0.1"])
    seen: list[tuple[float, ...]] = []

    def notes(
        tick: int, time: float, x: float, v: float, set_point: float, x_object: float, v_object: float, x_other: float,
        v_other: float, impact: float, impact_other: float,
    ) -> float:
        seen.append((x_object, v_object, x_other, v_other, impact, impact_other, set_point))
        return leans(tick, time, x, v, v_other=v_other, impact=impact)

    run = simulate(scene, controllers={"left": notes})
    given = np.array(seen)
    expected = np.column_stack([run.state[:, 2:5], given[:, 3], run.impacts, np.full(len(run.t), 0.02)])
    assert given.tobytes() == expected.tobytes()
    assert np.abs(given[:, 3] - run.state[:, 5]).max() <= 0.05 + 1e-12
    assert np.abs(given[:, 3] / 0.1 - np.round(given[:, 3] / 0.1)).max() < 1e-9
    assert run.impacts.max(axis=0).min() > 1.0
    for law in (leans, leans_too, numba.njit(leans_too)):
        again = simulate(scene, controllers={"left": law})
        assert again.state.tobytes() == run.state.tobytes()


def test_what_a_scene_does_not_have_cannot_be_asked_for() -> None:
    def asks(tick: int, time: float, x: float, v: float, x_object: float, v_other: float) -> float:
        return 0.0

    with pytest.raises(Refused, match="controllers: left: asks for x_object; the scene has no object"):
        simulate(scenes.load("arm_alone"), controllers={"left": asks})


def fails_at_seven(tick: int, time: float, x: float, v: float) -> float:
    """1 / 0 at tick 7."""
    return 1.0 / (tick - 7)


def answers_nan(tick: int, time: float, x: float, v: float) -> float:
    """No number at tick 7."""
    return math.nan if tick == 7 else 0.0


@pytest.mark.parametrize("compiled", [False, True])
def test_what_a_controller_raises_passes_through_with_its_tick(compiled: bool) -> None:
    law = numba.njit(fails_at_seven) if compiled else fails_at_seven
    with pytest.raises(ZeroDivisionError) as caught:
        simulate(scenes.load("case_01"), controllers={"right": law})
    [note] = caught.value.__notes__
    assert note == f"right controller {__name__}:fails_at_seven, tick 7, t = 0.007 s"


@pytest.mark.parametrize(("law", "words"), [
    (answers_nan, "returned nan at tick 7, t = 0.007 s; allowed: a finite number of N"),
    (numba.njit(answers_nan), "returned nan at tick 7, t = 0.007 s; allowed: a finite number of N"),
    (lambda *_: "much", "returned 'much' at tick 0, t = 0.0 s; allowed: a finite number of N"),
    (lambda *_: None, "returned None at tick 0"),
    (numba.njit(lambda tick, time, x, v: 1.0 if tick < 3 else None), "returned None at tick 3"),
    (lambda *_: np.zeros(1), "returned array"), (lambda *_: np.True_, "returned np.True_"),
    (lambda *_: -math.inf, "returned -inf"),
    (numba.njit(lambda tick, time, x, v: "much"), "float(int, float, float, float): No conversion from "),
    *((law, "too many positional arguments; allowed: a callable of tick, time, x and v")
      for law in (numba.njit(lambda x: x), lambda x: x, math.sin)),
    (lambda tick, time, x, v, more: 0.0, "missing a required argument: 'more'; allowed: a callable of tick"),
    (3.0, "left: 3.0 is not allowed; allowed: a callable of tick, time, x and v"),
])
def test_what_is_no_controller_is_refused(law: Any, words: str) -> None:
    with pytest.raises(Refused) as refusal:
        simulate(scenes.load("case_01"), controllers={"left": law})
    assert words in str(refusal.value)


def test_a_number_of_numpy_without_dimension_is_a_command() -> None:
    scene = scenes.load("case_01", [SHORT])
    plainly, boxed = (simulate(scene, controllers={"left": lambda tick, time, x, v, kind=kind: kind(-x)})
                      for kind in (float, np.asarray))
    assert boxed.state.tobytes() == plainly.state.tobytes()


@pytest.mark.parametrize("side", ["right", "middle"])
def test_a_side_without_an_arm_is_refused(side: str) -> None:
    with pytest.raises(Refused, match=f"'{side}' is not allowed; allowed: left"):
        simulate(scenes.load("arm_alone"), controllers={side: paper})


def test_a_change_of_feedback_that_does_not_act_is_refused() -> None:
    change = {5: {"left_feedback.position_gain_N_per_m": 9.0}}
    limit = {5: {"left_actuator.limit_N": 1.0}}
    for name, refused in (("case_01", change), ("saturation", limit)):
        with pytest.raises(Refused, match=control.FIXED):
            simulate(scenes.load(name), sampled=True, changes=refused, controllers={"left": paper})
    for tick in (1.5, -1, "1", 20_001):
        for numbers in (change[5], {}):
            with pytest.raises(Refused, match=r"changes: at tick .* allowed: 0 to 20000"):
                simulate(scenes.load("case_01"), sampled=True, changes={tick: numbers})  # type: ignore[dict-item]


def simulates(scene: Scene) -> Callable[[int, float, float, float], float]:
    """A controller that simulates while it is called."""
    def law(tick: int, time: float, x: float, v: float) -> float:
        if tick % 500 == 0:
            assert simulate(scene).status is Status.DONE
        return paper(tick, time, x, v)

    return law


def test_a_controller_may_simulate_on_its_own() -> None:
    scene = scenes.load("case_01", [SHORT])
    run = simulate(scene, controllers={"left": simulates(scene)})
    own = simulate(scene, sampled=True)
    assert run.state.tobytes() == own.state.tobytes()
    assert run.event_table.tobytes() == own.event_table.tobytes()

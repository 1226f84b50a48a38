"""The table of contacts, against balances that do not know it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from documents import body, case_of, made, scene_of

from grasp_ros import scene
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.simulation import ensemble, simulate
from grasp_ros.simulation.contacts import UNITS
from grasp_ros.simulation.losses import losses
from grasp_ros.simulation.smooth import expand

RUNS: dict[str, tuple[str, list[str], dict[str, Any]]] = {
    "case 1": ("case_01", [], {}), "sampled": ("case_01", [], {"sampled": True}),
    "late": ("case_02", ["time.duration_s=600"], {}),
    "clamped": ("v_jump_one_sided", [], {}), "held for long": ("preload", [], {}),
    "held for long after an impact of microseconds": ("case_01", [
        f"{side}_{number}" for side, sign in (("left", ""), ("right", "-")) for number in (
            "contact.hertz_N_per_m1_5=1e9", "contact.dissipation_s_per_m=30", "feedback.velocity_gain_Ns_per_m=5",
            f"feedback.feed_forward_N={sign}5")] + ["time.duration_s=500"], {}),
    "from begin to end": ("hammer", ["left_arm.position_m=0.02", "time.duration_s=0.01"], {}),
    "from begin to end, clamped": (
        "hammer", ["left_arm.position_m=0.02", "left_contact.dissipation_s_per_m=100", "time.duration_s=0.2"], {}),
    "pressed in": ("case_01", ["left_arm.position_m=0.02", "right_arm.position_m=-0.015", "time.duration_s=0.2"], {}),
    "by another method": ("case_01", [], {"method": "rk4_events"}),
}


@pytest.mark.parametrize("kind", RUNS)
def test_impulses_are_the_change_of_momentum_and_losses_those_of_the_run(kind: str) -> None:
    name, settings, how = RUNS[kind]
    run = simulate(scene.load(name, settings), **how)
    left, right = run.contacts("left"), run.contacts("right")
    mass = run.scene.values["object"]["mass_kg"]
    change = mass * (run.state[-1, 3] - run.state[0, 3])
    tight = 1e-7 if "method" in how else 1e-11
    assert left["impulse"].sum() - right["impulse"].sum() == pytest.approx(change, abs=tight * left["impulse"].sum())
    lost = left["loss"].sum() + right["loss"].sum()
    if not run.sampled and "method" not in how:  # otherwise `losses` are no more exact than the output times
        assert lost == pytest.approx(float(losses(run).impacts), rel=1e-10)
    assert left.dtype.names == tuple(UNITS)


def test_contacts_are_as_their_scenes_say() -> None:
    run = simulate(scene.load("hammer"))
    hit = run.contacts("left")[0]
    before, after = run.at([hit["begin"], hit["end"]])  # both masses are 1 kg
    assert after[3] == pytest.approx(hit["impulse"], rel=1e-12)
    assert before[1] - after[1] > 1.04 * hit["impulse"]
    run = simulate(scene.load("v_jump_one_sided"))
    clamps, reentries = ([len(run.times(kind, side)) for side in (LEFT, RIGHT)]
                         for kind in (Transition.CLAMP, Transition.REENTRY))
    assert clamps == [1, 1]
    assert reentries == [0, 1]


def test_the_peak_of_an_impact_that_is_over_long_before_its_contact_is_found() -> None:
    """A clamp surface beside it: u' falls within 3 us, while the arm is pressed on for 30 ms."""
    contact = {"hertz_N_per_m1_5": 6e9, "dissipation_s_per_m": 700.0}
    run = simulate(case := made(0.035, left_arm=body(1.1, -0.02, 5.0, stiffness_N_per_m=7000.0), left_contact=contact,
                                object=body(60.0, 0.0, -1.6)))
    seen = ensemble(case, {"object.mass_kg": [60.0]}, ["peak_impact"]).columns["peak_impact_left"]
    assert run.contacts("left")["peak_force"].max() == pytest.approx(seen[0], rel=1e-10)


def test_a_piece_late_in_a_run_is_resolved_though_its_times_are_rounded() -> None:
    def quantity(t: Array, _: Array) -> tuple[Array, Array]:
        return np.sin(1000.0 * (t - 2000.0))[:, None], np.zeros((len(t), 1))

    begin, end = np.array([2000.0]), np.array([2000.01])
    pieces = expand(lambda t: np.zeros((len(t), 6)), quantity, begin, end, np.zeros(1, int))
    assert pieces.resolved.all()
    assert len(pieces.begin) <= 8
    assert pieces.integral(0, 1) == pytest.approx((1.0 - np.cos(10.0)) / 1000.0, rel=1e-10)


def test_a_contact_from_begin_to_end_is_there_and_its_peak_may_be_at_its_begin() -> None:
    name, settings, _ = RUNS["from begin to end"]
    [only] = simulate(scene.load(name, settings)).contacts("left")
    assert (only["begin"], only["end"]) == (0.0, 0.01)
    assert np.isnan([only["speed_in"], only["speed_out"]]).all()
    assert only["peak_force"] == pytest.approx(1e4 * 0.02**1.5, rel=1e-12)
    name, settings, _ = RUNS["pressed in"]
    [right] = simulate(scene.load(name, settings)).contacts("right")
    assert right["peak_force"] == pytest.approx(1e4 * 0.015**1.5, rel=1e-12)
    assert right["deepest"] == pytest.approx(0.015, rel=1e-12)


def test_peaks_are_those_that_an_ensemble_sees() -> None:
    case = case_of(duration=5.0)
    run, seen = simulate(case), ensemble(case, {}, ["peak_impact", "peak_penetration", "touches"]).columns
    for side in ("left", "right"):
        table = run.contacts(side)
        assert table["peak_force"].max() == pytest.approx(seen[f"peak_impact_{side}"][0], rel=1e-11)
        assert table["deepest"].max() == pytest.approx(seen[f"peak_penetration_{side}"][0], rel=1e-11)
        assert len(table) == seen[f"touches_{side}"][0]


def test_a_pair_alone_restitutes_as_its_energy_says() -> None:
    """A free arm hits a free object: what the contact took is what is missing of the energy of the relative motion."""
    case = scene_of("hammer", "left_arm.velocity_m_per_s=1", without=(
        "left_feedback", "left_arm.stiffness_N_per_m", "left_arm.damping_Ns_per_m"))
    [hit] = simulate(case).contacts("left")
    m, m_o = case.values["left_arm"]["mass_kg"], case.values["object"]["mass_kg"]
    energy = 0.5 * m * m_o / (m + m_o) * hit["speed_in"] ** 2
    assert hit["speed_in"] == 1.0
    assert hit["restitution"] ** 2 == pytest.approx(1.0 - hit["loss"] / energy, rel=1e-11)
    assert hit["impulse"] == pytest.approx(m * m_o / (m + m_o) * (hit["speed_in"] + hit["speed_out"]), rel=1e-11)


def test_begin_and_end_of_the_run_may_be_within_a_contact() -> None:
    [only] = simulate(scene.load("preload")).contacts("left")
    assert (only["end"], np.isnan(only["speed_out"]), np.isnan(only["restitution"])) == (10.0, True, True)
    deep = simulate(case_of("case_01", 2.0, 0.001, "left_arm.position_m=0.001")).contacts("left")
    assert deep[0]["begin"] == 0.0
    assert np.isnan(deep[0]["speed_in"])
    run = simulate(case_of())
    assert run.contacts("right")["begin"].tolist() == run.times(Transition.TOUCH, 1).tolist()
    assert run.contacts("left")["end"][0] == run.times(Transition.RELEASE, LEFT)[0]


def test_no_contact_is_an_empty_table_and_no_side_is_refused() -> None:
    assert len(simulate(scene.load("no_contact")).contacts("left")) == 0
    with pytest.raises(Refused, match="side 'up' is not allowed; allowed: left or right"):
        simulate(case_of()).contacts("up")
    run = simulate(case_of(), method="rk4")
    for ask in (lambda: run.contacts("left"), lambda: run.events, lambda: run.times(Transition.TOUCH, LEFT)):
        with pytest.raises(Refused, match="rk4 does not look for contacts; allowed: a run by exact, "):
            ask()
    assert "touch_left" not in run.contents()


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-6, 1e-9])
def test_an_impact_is_off_by_a_few_accuracies(accuracy: float) -> None:
    """Of two bodies that nothing else moves."""
    for loss in np.logspace(-2.5, 0.5, 25).tolist():
        hit = made(1.0, 0.01, left_arm=body(1.0, -0.001, 1.0), object=body(1.0),
                   left_contact={"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": loss})
        found, right = (simulate(hit, setting=own).contacts("left") for own in (accuracy, 1e-16))
        assert len(found) == len(right) == 1
        for column, scale in (("restitution", 1.0), ("impulse", 1.0), ("loss", 0.5)):
            assert abs(found[column][0] - right[column][0]) < 5.0 * accuracy * scale, (loss, column)

"""Derivatives of many variants: each row has those of its run."""

from __future__ import annotations

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import Setup, ensemble, simulate
from grasp_ros.simulation.outcomes import GROUPS

P, GAIN = "left_contact.dissipation_s_per_m", "left_feedback.position_gain_N_per_m"


@pytest.mark.parametrize(("name", "sampled"), [("case_01", False), ("case_01", True), ("tilt_hold", False)])
def test_rows_are_sensitivities_to_the_last_bit(name: str, sampled: bool) -> None:
    scene = scenes.load(name, ["time.duration_s=1.0"])
    changes, keys = {P: np.linspace(0.05, 0.5, 6), GAIN: np.linspace(4.0, 9.0, 6)}, [GAIN, "object.position_m"]
    found, alone = (ensemble(scene, changes, ["last_state"], setup=Setup(sampled=sampled), sensitivity=keys,
                             threads=threads) for threads in (2, 1))
    assert found == alone
    for i in range(6):
        own = scene.changed({key: float(values[i]) for key, values in changes.items()})
        row = simulate(own, grid=[1.0], sampled=sampled, sensitivity=keys).sensitivity
        ends = [found.columns[name][i] for name in (*GROUPS["last_state"], "V_c_end", "corner")]
        np.testing.assert_array_equal(ends, [*row.state[-1], row.V_c[-1], np.inf])
        for column, key in enumerate(keys):
            rates = [found.columns[f"{name} by {key}"][i] for name in (*GROUPS["last_state"], "V_c_end")]
            np.testing.assert_array_equal(rates, [*row.state_rates[-1, :, column], row.V_c_rates[-1, column]])
    assert found.dataframe().attrs["units"]["v_object_end by object.position_m"] == "m/s per m"
    none = ensemble(scene, {P: []}, ["last_state"], setup=Setup(sampled=sampled), sensitivity=keys)
    assert list(none.columns) == list(found.columns)


def test_a_body_that_is_not_there_has_no_derivatives() -> None:
    rates = simulate(scenes.load("arm_alone"), grid=[1.0], sensitivity=[GAIN]).sensitivity.state_rates
    assert np.isnan(rates[0, :, 0]).tolist() == [False, False, True, True, True, True]


def test_a_row_that_is_refused_takes_nobody_with_it() -> None:
    scene = scenes.load("case_01", ["time.duration_s=1.0"])
    done: list[int] = []
    found = ensemble(scene, {GAIN: [5.0, -50.0, 6.0]}, sensitivity=[P], progress=done.append)
    assert done == [1, 2, 3]  # so that few rows, too, are shared among all cores
    assert list(found.stops) == [1]
    assert "position_gain_N_per_m" in found.stops[1]
    assert np.isfinite(found.columns[f"x_left_end by {P}"]).tolist() == [True, False, True]
    with pytest.raises(Refused, match="no derivative"):
        ensemble(scene, {GAIN: [5.0]}, sensitivity=["time.duration_s"])

"""Derivatives of many variants: each row has those of its run."""

from __future__ import annotations

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate
from grasp_ros.simulation.sensitivities import ensemble_sensitivities

P, GAIN = "left_contact.dissipation_s_per_m", "left_feedback.position_gain_N_per_m"


@pytest.mark.parametrize(("name", "sampled"), [("case_01", False), ("case_01", True), ("tilt_hold", False)])
def test_rows_are_sensitivities_to_the_last_bit(name: str, sampled: bool) -> None:
    scene = scenes.load(name, ["time.duration_s=1.0"])
    changes, keys = {P: np.linspace(0.05, 0.5, 6), GAIN: np.linspace(4.0, 9.0, 6)}, [GAIN, "object.position_m"]
    found = ensemble_sensitivities(scene, changes, keys, sampled=sampled, threads=2)
    alone = ensemble_sensitivities(scene, changes, keys, sampled=sampled, threads=1)
    assert found.state_rates.tobytes() == alone.state_rates.tobytes()
    for i in range(6):
        own = scene.changed({key: float(values[i]) for key, values in changes.items()})
        row = simulate(own, grid=[1.0], sampled=sampled, sensitivity=keys).sensitivity
        assert found.state[i].tobytes() == row.state[-1].tobytes()
        assert found.state_rates[i].tobytes() == row.state_rates[-1].tobytes()
        assert found.V_c_rates[i].tobytes() == row.V_c_rates[-1].tobytes()
    frame = found.dataframe()
    np.testing.assert_array_equal(frame[f"v_object_end by {GAIN}"], found.state_rates[:, 3, 0])
    np.testing.assert_array_equal(frame["V_c by object.position_m"], found.V_c_rates[:, 1])


def test_a_row_that_is_refused_takes_nobody_with_it() -> None:
    scene = scenes.load("case_01", ["time.duration_s=1.0"])
    found = ensemble_sensitivities(scene, {GAIN: [5.0, -50.0, 6.0]}, [P])
    assert list(found.stops) == [1]
    assert "position_gain_N_per_m" in found.stops[1]
    assert np.isfinite(found.state_rates).all(axis=(1, 2)).tolist() == [True, False, True]
    with pytest.raises(Refused, match="no derivative"):
        ensemble_sensitivities(scene, {GAIN: [5.0]}, ["time.duration_s"])

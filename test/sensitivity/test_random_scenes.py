"""Derivatives of random scenes beside differences of runs; `python -m lab derivatives --table random` judges more."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.simulation.differentiate import Sensitivity, differentiate
from lab.oracles import differences
from lab.oracles.differences import AGREES, WRONG, judge, judge_draw

DRAWS = 30


@pytest.mark.slow
def test_derivatives_of_random_scenes_are_right_or_refused() -> None:
    found = [judge_draw(number) for number in range(DRAWS)]
    assert [f"{verdict.text}\n{drawn}" for drawn, verdict in found if verdict.word == WRONG] == []
    assert Counter(verdict.word for _, verdict in found)[AGREES] >= 0.7 * DRAWS


@pytest.mark.parametrize("off", [1e-6, np.nan])
def test_a_wrong_derivative_is_noticed(monkeypatch: pytest.MonkeyPatch, off: float) -> None:
    def wrong(*given: Any) -> Sensitivity:
        found = differentiate(*given)
        rates = found.state_rates.copy()
        rates[:, 2] *= 1.0 + off
        return replace(found, state_rates=rates)

    scene, key = scenes.load("case_01", ["time.duration_s=2.0"]), "left_contact.dissipation_s_per_m"
    assert judge(scene, key, 0.1).word == AGREES
    monkeypatch.setattr(differences, "differentiate", wrong)
    assert judge(scene, key, 0.1).word == WRONG

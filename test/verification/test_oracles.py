"""Oracles first: values that are not zero, the first integral, the differential equation, and a wrong model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf
from oracles import impact, ledger, reduced_mass

from grasp_ros import scene as scenes


@pytest.mark.parametrize(
    ("m1", "m2", "hertzian", "p", "speed", "duration", "restitution"),
    [
        (1, 1, 1e4, "0.3", "1", "0.0625829618265027708", "0.83286979226560167"),
        (2, 3, 1e9, "0.5", "0.01", "0.00218480327186658349", "0.996677737196872286"),
        (1, "1e-3", 1e5, "10", "3", "0.00584780956125577992", None),
    ],
)
def test_impact_oracle_has_the_known_digits(
    m1: Any, m2: Any, hertzian: float, p: str, speed: str, duration: str, restitution: str | None
) -> None:
    law = impact(reduced_mass(m1, m2), hertzian, mpf(p), mpf(speed))
    assert abs(law.duration / mpf(duration) - 1) < mpf("1e-15")
    z = mpf(p) * mpf(speed)
    y = z * law.restitution
    assert abs(z - mp.log1p(z) + y + mp.log1p(-y)) < mpf("1e-25")  # the first integral takes one value at both ends
    if restitution:
        assert abs(law.restitution - mpf(restitution)) < mpf("1e-17")


def test_impact_oracle_solves_its_equation() -> None:
    mu, hertzian, p, speed = mpf("0.5"), mpf("1e4"), mpf("0.3"), mpf(1)
    start, law = mp.matrix([0, speed]), impact(mu, hertzian, p, speed)
    # Runge and Kutta in w with dt = 2 w ds: dw/ds = u', du'/ds = -2 (H / mu) w^4 (1 + p u')
    n, depth, t, w, d = 4000, mpf(0), mpf(0), *start

    def rate(w: Any, d: Any) -> tuple[Any, Any, Any]:
        return 2 * w, d, -2 * hertzian / mu * w**4 * (1 + p * d)

    h = mp.sqrt(law.depth) / 1000
    with mp.workdps(25):
        for _ in range(n):
            k1 = rate(w, d)
            k2 = rate(w + h / 2 * k1[1], d + h / 2 * k1[2])
            k3 = rate(w + h / 2 * k2[1], d + h / 2 * k2[2])
            k4 = rate(w + h * k3[1], d + h * k3[2])
            change = [h / 6 * (a + 2 * b + 2 * c + e) for a, b, c, e in zip(k1, k2, k3, k4, strict=True)]
            if w + change[1] < 0:
                t += w * w / -d  # the rest of the way at constant speed: w^2 = -u' dt
                break
            t, w, d = t + change[0], w + change[1], d + change[2]
            depth = max(depth, w * w)
    assert abs(depth / law.depth - 1) < mpf("1e-5")
    assert abs(t / law.duration - 1) < mpf("1e-8")
    assert abs(-d / speed / law.restitution - 1) < mpf("1e-8")


def test_ledger_notices_a_wrong_model() -> None:
    scene = scenes.load("case_01")
    good = ledger(scene.grasp, scene.initial_state, 5.0)
    coarse = ledger(scene.grasp, scene.initial_state, 5.0, accuracy=1e-3)
    assert np.abs(good.energy).max() < 1e-12 < 1e-9 < np.abs(coarse.energy).max()

"""Oracles first: values that are not zero, the first integral, the differential equation, and a wrong model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf
from oracles import balance_of, impact, reduced_mass

from grasp_ros import scene as scenes
from lab.oracles.closed_forms import chain_speeds, elastic_period, graze, tail_rate
from lab.reference.grasp import grasp_of


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
    """O1 and O2."""
    law = impact(reduced_mass(m1, m2), hertzian, mpf(p), mpf(speed))
    assert abs(law.duration / mpf(duration) - 1) < mpf("1e-15")
    z = mpf(p) * mpf(speed)
    y = z * law.restitution
    assert abs(z - mp.log1p(z) + y + mp.log1p(-y)) < mpf("1e-25")  # the first integral takes one value at both ends
    if restitution:
        assert abs(law.restitution - mpf(restitution)) < mpf("1e-17")


def test_impact_oracle_solves_its_equation() -> None:
    """O2."""
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


def test_balance_notices_a_wrong_model() -> None:
    """O3."""
    scene = scenes.load("case_01")
    good = balance_of(grasp_of(scene), scene.initial_state, 5.0)
    coarse = balance_of(grasp_of(scene), scene.initial_state, 5.0, accuracy=1e-3)
    assert np.abs(good.energy).max() < 1e-12 < 1e-9 < np.abs(coarse.energy).max()


def test_chain_speeds_are_those_of_the_laws_of_impact() -> None:
    """O10."""
    assert chain_speeds(1, 0) == (0.0, 0.0, 1.0)
    assert chain_speeds(0.5, 0) == pytest.approx((-5 / 27, 16 / 27, 8 / 9), rel=1e-15)
    damped = (0.0711621355174101678, 0.0835497205190094322, 0.8452881439635804)
    assert chain_speeds(1, mpf("0.3")) == pytest.approx(damped, rel=1e-15)


def test_the_period_of_the_elastic_arm_has_the_known_digits() -> None:
    """O12; without the object's resistance it is a full swing."""
    assert abs(elastic_period(1, 15, 10_000, "0.3") - mpf("0.88931643572931156661")) < mpf("1e-20")
    stiffer = [elastic_period(1, 15, hertzian, "0.3") for hertzian in (0, 1, 100)]
    assert abs(stiffer[0] - 2 * mp.pi / mp.sqrt(15)) < mpf("1e-25")
    assert stiffer == sorted(stiffer, reverse=True)


def test_the_tail_solves_its_averaged_equation() -> None:
    """O9: the mean of |x| v^2 over a swing in the potential (2/5) H |x|^(5/2), by quadrature in the angle."""

    def swing(weight: Any) -> Any:
        """Integral over a quarter of a swing, |x| = cos(angle)^2, in units of the amplitude."""
        def rate(angle: Any) -> Any:
            s = mp.cos(angle) ** 2
            return mp.sin(2 * angle) * weight(s) / mp.sqrt(1 - s ** mpf("2.5"))

        return mp.quad(rate, [0, mp.pi / 2], method="gauss-legendre")

    mean = swing(lambda s: s * (1 - s ** mpf("2.5"))) / swing(lambda s: 1)  # of |x| v^2, in (4 H / 5 m) A^(7/2)
    C, K, H, m = (mpf(value) for value in ("0.7", 15, 10, 5))
    # E = (2/5) H A^(5/2) and E' = -(9/4) C (H / K)^2 (4 H / 5 m) A^(7/2) mean give A' = -kappa A^2
    kappa = mpf("2.25") * C * H**2 / K**2 * 4 / (5 * m) * mean
    assert abs(tail_rate(C, K, H, m) / kappa - 1) < mpf("1e-20")


def test_the_impulse_of_a_graze_is_that_of_the_free_arc() -> None:
    """O13: the force H u^(3/2) along u = eps - a t^2 / 2."""
    eps, a, hertzian = mpf("1e-6"), mpf("3.4"), 10_000
    duration, impulse = graze(eps, a, hertzian)
    assert eps == pytest.approx(float(a * mpf(duration) ** 2 / 8), rel=1e-15)
    force = mp.quad(lambda t: hertzian * max(eps - a * t * t / 2, 0) ** mpf("1.5"), [0, mpf(duration) / 2])
    assert impulse == pytest.approx(float(2 * force), rel=1e-12)

"""The balance of the energy, which held commands and external forces change by their work alone."""

from __future__ import annotations

import numpy as np
import pytest
from documents import body, case_of, horizon, made
from oracles import energy

from grasp_ros import scene as scenes
from grasp_ros.physics.energy import EnergyBalance, energy_balance
from grasp_ros.physics.model import Array
from grasp_ros.simulation import Trajectory, simulate
from lab.reference.grasp import grasp_of


@pytest.mark.parametrize("name", scenes.names())
def test_certificate_holds_or_says_why_not(name: str) -> None:
    """Where nothing is in doubt V_c never rises; everywhere the energy balance closes."""
    scene, short = scenes.load(name), horizon(name, 4.0)
    if not scene.sampled and not scene.system.external:
        V_c = simulate(scene, grid=np.linspace(0.0, scene.duration, 20_001)).energy.V_c
        assert scene.certificate_in_words(sampled=False) == "V_c cannot rise"
        assert np.diff(V_c).max() <= 1e-12 * np.abs(V_c).max()
        assert V_c[-1] < V_c[0] or name == "case_02"
    else:
        assert "may rise: " in scene.certificate_in_words(sampled=False)
    book = balance(simulate(short, sampled=True))
    assert not book.alarm.any()
    assert np.abs(book.work).max() > 0.0 or not short.system.laws


def balance(motion: Trajectory) -> EnergyBalance:
    """Of every control period of a sampled motion."""
    return energy_balance(motion.scene.system, motion.state[:-1], motion.state[1:], motion.inputs[:-1])


def test_the_energy_balance_notices_a_gain() -> None:
    motion = simulate(scenes.load("case_01", ["time.duration_s=1.0"]), sampled=True)
    system, before, after = motion.scene.system, motion.state[500], motion.state[501]
    forces = np.array([*motion.command[500], 0.0])
    fair = energy_balance(system, before, after, forces)
    assert not fair.alarm
    assert fair.residual < 0.0  # what the dampers took
    faster = after.copy()
    faster[1] = np.sqrt(after[1] ** 2 - fair.residual + 1e-10)  # that, and a bit more, is given back
    assert energy_balance(system, before, faster, forces).residual == pytest.approx(1e-10, rel=1e-2)
    assert energy_balance(system, before, faster, forces).alarm
    assert energy_balance(system, before, np.full(6, np.nan), forces).alarm


def test_a_weak_spring_under_a_constant_force_raises_no_alarm() -> None:
    for stiffness in (1e-6, 1e-4, 1e-2):
        weak = made(2.0, 0.001, left_arm=body(stiffness_N_per_m=stiffness),
                    tilt={"angle_rad": 0.1, "gravity_m_per_s2": 9.81})
        motion = simulate(weak, sampled=True)
        assert not balance(motion).alarm.any()


def gained_and_work(scene: scenes.Scene) -> tuple[Array, Array]:
    """Energy that the plant gains in every control period, and the work of the commands."""
    result = simulate(scene, sampled=True)
    left, right = (arm._replace(position_gain=0.0, velocity_gain=0.0) for arm in grasp_of(scene)[:2])
    stored = 0.5 * energy(grasp_of(scene)._replace(left=left, right=right), result.state).V_c
    return np.diff(stored), (result.command[:-1] * np.diff(result.state[:, [0, 4]], axis=0)).sum(axis=1)


@pytest.mark.parametrize("period", [0.01, 0.1, 0.25])
def test_work_balance_of_held_commands(period: float) -> None:
    """O3: without dissipation the energy of the plant changes by the work of the commands."""
    scene = case_of(
        "case_01", 2.0, period, "left_arm.damping_Ns_per_m=0", "right_arm.damping_Ns_per_m=0",
        "left_contact.dissipation_s_per_m=0", "right_contact.dissipation_s_per_m=0",
    )
    gained, work = gained_and_work(scene)
    assert np.abs(gained - work).max() < 1e-12
    assert np.abs(work).max() > 1e-3


def test_dissipation_is_what_the_balance_lacks() -> None:
    """O3."""
    gained, work = gained_and_work(case_of("case_01", 2.0, 0.05))
    lost = work - gained
    assert (lost >= -1e-14).all()
    assert lost.sum() > 0.1

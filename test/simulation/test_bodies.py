"""Bodies and contacts that are not there, and what an impact gives the others."""

from __future__ import annotations

import numpy as np
import pytest
from documents import scene_of
from oracles import flight_array

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import RIGHT, Transition
from grasp_ros.simulation import simulate


def test_an_arm_alone_is_solved_in_closed_form() -> None:
    motion = simulate(scenes.load("arm_alone"))
    exact = 0.1 + flight_array((1.0, 15.0, 0.7, 0.0), -0.4, 0.0, motion.t)[0]
    assert np.abs(motion.state[:, 0] - exact).max() < 1e-15
    assert np.isnan(motion.state[:, 2:]).all()
    assert motion.work.tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("duration", [1.0, 1e4, 1e8])
def test_work_without_contacts_does_not_depend_on_the_duration(duration: float) -> None:
    motion = simulate(scene_of("no_contact", f"time.duration_s={duration!r}"), grid=np.array([duration]))
    assert motion.work.tolist() == [1, 0, 0, 0]
    assert motion.state[0, 2] == 0.05 * duration


def test_arms_without_contacts_move_as_if_alone() -> None:
    together = simulate(scenes.load("no_contact"))
    alone = simulate(scene_of("no_contact", without=("object", "right_arm", "right_feedback")))
    assert together.state[:, :2].tobytes() == alone.state[:, :2].tobytes()


def test_an_absent_arm_is_one_that_is_out_of_reach() -> None:
    motion = simulate(scenes.load("hammer"))
    document = {**scenes.load("case_01", ["right_arm.position_m=1e3", "right_arm.stiffness_N_per_m=0",
                                          "right_feedback.position_gain_N_per_m=0"]).values}
    document.update(scenes.load("hammer").values)
    far = scenes.compose("far", document)
    assert simulate(far).state[:, :4].tobytes() == motion.state[:, :4].tobytes()
    assert np.isnan(motion.state[:, 4:]).all()


def test_the_wall_gives_way_by_its_share_of_the_momentum() -> None:
    motion = simulate(scenes.load("wall"))
    bounces = motion.times(Transition.RELEASE, RIGHT)
    assert len(bounces) == 5
    assert abs(motion.state[-1, 4] - 0.2) < 1e-4
    assert motion.state[-1, 5] > 0.0
    assert motion.scene.controllers.keys() == {"left_controller"}

"""Scenes of the search and of the hard cases that are outside the domain, and the rule that refuses each."""

from __future__ import annotations

import pytest

from grasp_ros import scene as scenes
from grasp_ros.scene import SceneError
from lab.cases.regression import OUTSIDE as DIRECTORY
from lab.cases.regression import refusals

OUTSIDE = {  # what the refusal says: the scenes
    "_arm.mass_kg: mass of the arm / mass of the object": (
        "chain_feed_forward_tilt_1", "chain_tilt_1", "falls_back_between_roundings", "heavy_arm_behind_a_glide",
        "one_wall_feed_forward_pulse_1", "rest_in_contact_set_point_tilt_1", "soft_beside_soft_underflow",
        "zero_gaps_set_point_feed_forward_tilt_1",
    ),
    "_contact.hertz_N_per_m1_5: a number >= 1e-06": (
        "chain_friction_5", "surface_1", "surface_2", "surface_loop_set_point_feed_forward_1",
    ),
    "_arm.position_m: gap or depth of a pair": (
        "clamped_pair_parts_beside_a_start", "denormal_gap", "energy_of_an_early_touch", "gap_beside_a_contact",
        "gap_of_the_smallest_numbers", "gap_that_halves", "parts_beside_a_start",
        "parts_by_the_second_difference", "pressed_by_a_depth_that_is_none", "push_overtakes_a_slow_touch",
        "push_too_short_to_move", "root_next_to_zero", "starts_with_a_denormal_depth",
        "starts_with_a_denormal_gap", "stiff_arm_and_a_gap", "touch_that_moves_a_heavy_object_by_denormals",
        "touch_while_the_other_begins", "two_shallow_contacts",
    ),
    "_contact.dissipation_s_per_m: p J / mu of a pair": (
        "clamped_while_trials_wait", "creeps_after_a_relaxation", "creeps_out_of_a_fast_impact",
        "damped_arm_behind_a_push", "deep_huge_p_stalled", "early_in_an_implicit_step", "falls_with_a_finger",
        "fast_soft_side", "glides_within_roundings", "heavy_arm_in_a_squeezed_contact",
        "heavy_slow_arm_behind_a_light_object", "held_within_the_rounding_of_a_push", "hidden_glide_of_a_stuck_object",
        "more_work_than_the_budget", "pushed_from_both_sides_it_creeps", "reenters_behind_a_slow_object",
        "relaxed_at_low_speed", "release_before_the_first_node", "slips_while_its_noise_falls",
        "squeezed_beside_a_fast_arm", "squeezed_by_friction_at_speed", "squeezed_for_a_day", "squeezed_for_days",
        "squeezed_for_hours", "steps_that_move_less_than_a_rounding", "stopped_within_a_rounding",
        "stuck_beside_a_relaxing_pair", "surface_set_point_1", "symmetric_3", "terms_of_a_high_order_cancel",
        "unit_far_too_small",
    ),
}
RULES = [(words, name) for words, names in OUTSIDE.items() for name in names]


def test_the_table_is_complete() -> None:
    assert sorted(name for _, name in RULES) == sorted(path.stem for path in DIRECTORY.glob("*.yaml"))
    assert sorted(refusals().values()) == sorted(map(len, OUTSIDE.values()))


@pytest.mark.parametrize(("words", "name"), RULES, ids=[name for _, name in RULES])
def test_a_scene_outside_is_refused_by_its_rule(words: str, name: str) -> None:
    path = DIRECTORY / f"{name}.yaml"
    with pytest.raises(SceneError) as caught:
        scenes.load(str(path))
    sentence = str(caught.value)
    assert sentence.startswith(f"{path}: ")
    assert all(part in sentence for part in [*words.split(": "), "allowed: "])

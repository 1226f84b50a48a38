"""Effects: each against an exact relation or an invariant, and nothing simulated that a scene does not name."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from oracles import CASES, flight_array

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import energy_balance
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import PAPER, Scene
from grasp_ros.scene.effects import BY_SECTION, EFFECTS
from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV
from grasp_ros.simulation import SampledPlant, Trajectory, simulate
from grasp_ros.simulation.trajectory import tick_times
from grasp_ros.studies.effects import registry_table, variants

OTHERS = [name for name in scenes.names() if name not in CASES]


def scene_of(name: str, *settings: str, without: tuple[str, ...] = ()) -> Scene:
    """A scene of the package with other numbers, or without some of its sections."""
    document = yaml.safe_load(scenes.load(name, settings).to_yaml())
    kept = {key: value for key, value in document.items() if key not in without}
    return scenes.parse(yaml.safe_dump(kept, sort_keys=False), name, name)


def test_every_effect_has_a_scene() -> None:
    named = {effect.section for name in scenes.names() for effect in scenes.load(name).effects}
    sided = {section.replace("right", "left").replace("object", "left_arm") for section in named}
    for effect in EFFECTS:
        assert effect.section in named or effect.section.replace("right", "left").replace("object", "left_arm") in sided


@pytest.mark.parametrize("name", OTHERS)
def test_scenes_say_what_to_watch_for_and_survive_a_round_trip(name: str) -> None:
    scene = scenes.load(name)
    assert len(scene.watch) > 40
    assert scenes.parse(scene.to_yaml(), name, name) == scene


def test_every_parameter_has_a_unit_a_range_and_a_text() -> None:
    for effect in EFFECTS:
        assert effect.text
        assert effect.certificate
        for parameter in effect.parameters:
            assert parameter.unit
            assert parameter.text
            assert parameter.low < parameter.high


@pytest.mark.parametrize("name", scenes.names())
def test_certificate_holds_or_says_why_not(name: str) -> None:
    """Where nothing is in doubt V_c never rises; everywhere the energy balance closes."""
    scene = scenes.load(name, ["time.duration_s=4.0"])
    if not scene.sampled and not scene.system.external:
        V_c = simulate(scene, grid=np.linspace(0.0, 4.0, 4001)).energy.V_c
        assert scene.certificate_in_words(sampled=False) == "V_c cannot rise"
        assert np.diff(V_c).max() <= 2e-12 * np.abs(V_c).max()
    else:
        assert "may rise: " in scene.certificate_in_words(sampled=False)
    motion = simulate(scene, sampled=True)
    rows = balance(motion)
    assert not any(row.alarm for row in rows)
    assert max(abs(row.work) for row in rows) > 0.0 or not scene.system.laws


def balance(motion: Trajectory) -> list:
    """Energy balance of every control period of a sampled motion."""
    return [
        energy_balance(motion.scene.system, motion.state[tick], motion.state[tick + 1], motion.inputs[tick])
        for tick in range(motion.scene.ticks)
    ]


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


# Bodies and contacts that are not there.


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
    far = scenes.parse(yaml.safe_dump({"title": "", "readings": [], **document}), "far", "far")
    assert simulate(far).state[:, :4].tobytes() == motion.state[:, :4].tobytes()
    assert np.isnan(motion.state[:, 4:]).all()


def test_hammer_gives_the_object_the_momentum_that_the_arm_loses() -> None:
    scene = scenes.load("hammer")
    touch, release = (event.time for event in simulate(scene).events)
    motion = simulate(scene, grid=np.linspace(touch, release, 200_001))
    x, v, v_o = motion.state[:, 0], motion.state[:, 1], motion.state[:, 3]
    spring = np.trapezoid(15.0 * x, motion.t) + 0.7 * (x[-1] - x[0])
    assert (v[-1] - v[0]) + spring == pytest.approx(-(v_o[-1] - v_o[0]), abs=1e-12)
    assert simulate(scene).state[-1, 3] == v_o[-1] > 0.9


def test_the_wall_gives_way_by_its_share_of_the_momentum() -> None:
    motion = simulate(scenes.load("wall"))
    bounces = motion.times(Transition.RELEASE, RIGHT)
    assert len(bounces) == 5
    assert abs(motion.state[-1, 4] - 0.2) < 1e-4
    assert motion.state[-1, 5] > 0.0
    assert motion.scene.controllers.keys() == {"left_controller"}


def test_topics_follow_the_scene() -> None:
    assert [topic.name for topic in scenes.load("hammer").topics] == [
        JOINT_STATES.name, "left/effort_command", "contact/left", LYAPUNOV.name,
    ]
    assert [topic.name for topic in scenes.load("no_contact").topics][1:-1] == [
        "left/effort_command", "right/effort_command",
    ]
    assert "external_force/object" in [topic.name for topic in scenes.load("pulse").topics]


# Set-points and constant forces.


def squeeze(scene: Scene) -> tuple[float, float, float]:
    """Finger forces f_l, f_r and object position at rest, both fingers on the object, by Newton's method."""
    loop = scene.system.closed_loop
    (k_l, f_l), (k_r, f_r), pull = loop[LEFT, [1, 3]], loop[RIGHT, [1, 3]], loop[2, 3]
    (h_l, _), (h_r, _) = scene.system.pairs

    def residuals(q: Array) -> Array:
        x_l, x_o, x_r = q
        push_l, push_r = h_l * max(x_l - x_o, 0.0) ** 1.5, h_r * max(x_o - x_r, 0.0) ** 1.5
        return np.array([f_l - k_l * x_l - push_l, pull + push_l - push_r, f_r - k_r * x_r + push_r])

    q = np.array([0.008, 0.0, -0.008])
    for _ in range(60):
        jacobian = np.stack([(residuals(q + 1e-7 * e) - residuals(q - 1e-7 * e)) / 2e-7 for e in np.eye(3)], axis=1)
        q = q - np.linalg.solve(jacobian, residuals(q))
    return h_l * (q[0] - q[1]) ** 1.5, h_r * (q[1] - q[2]) ** 1.5, q[1]


@pytest.mark.parametrize("name", ["preload", "preload_feed_forward", "tilt_hold"])
def test_a_preloaded_grasp_comes_to_rest_in_its_equilibrium(name: str) -> None:
    scene = scene_of(name, "time.duration_s=60.0")
    f_l, f_r, x_o = squeeze(scene)
    motion = simulate(scene)
    forces = [output.value(scene.system, 0, motion.state[-1]) for output in scene.outputs]
    assert forces == pytest.approx([f_l, f_r], rel=1e-9)
    assert motion.state[-1, 2] == pytest.approx(x_o, abs=1e-12)
    assert f_l - f_r == pytest.approx(-scene.system.bodies[2, 3], rel=1e-9)  # the weight of the object
    assert min(f_l, f_r) > 1.0


def test_the_equilibrium_is_the_one_of_the_overlap() -> None:
    """O14: f / K_l + f / K_r + (f / H_l)^(2/3) + (f / H_r)^(2/3) = d."""
    f, same, _ = squeeze(scenes.load("preload"))
    assert f == pytest.approx(same, rel=1e-12)
    assert 2 * f / 510.0 + 2 * (f / 1e4) ** (2 / 3) == pytest.approx(2 * 500.0 * 0.025 / 510.0, rel=1e-12)


def test_a_set_point_is_a_constant_force() -> None:
    there = simulate(scene_of("preload", "left_feedback.set_point_m=0.03125", "right_feedback.set_point_m=-0.03125"))
    force = simulate(scene_of("preload_feed_forward", "left_feedback.feed_forward_N=15.625",
                              "right_feedback.feed_forward_N=-15.625"))
    assert there.state.tobytes() == force.state.tobytes()


# External forces.


@pytest.mark.parametrize(
    ("section", "impulse"),
    [
        ({"object_pulse": {"force_N": 3.0, "start_s": 0.5, "length_s": 0.25}}, 0.75),
        ({"object_table": {"time_s": [0.1, 0.3, 0.7], "force_N": [1.0, -2.0, 4.0]}}, 0.2 - 0.8 + 1.2),
        ({"object_pulse": {"force_N": 3.0, "start_s": 0.5, "length_s": 0.25},
          "object_table": {"time_s": [0.1], "force_N": [1.0]}}, 0.75 + 0.9),
    ],
)
def test_external_forces_give_their_impulse(section: dict[str, dict[str, object]], impulse: float) -> None:
    document = {"title": "", "readings": [], "time": {"duration_s": 1.0, "control_period_s": 0.01},
                "object": {"mass_kg": 2.0, "position_m": 0.0, "velocity_m_per_s": 1.0}, **section}
    scene = scenes.parse(yaml.safe_dump(document), "push", "push")
    for sampled in (False, True):
        motion = simulate(scene, sampled=sampled)
        assert motion.state[-1, 3] == pytest.approx(1.0 + impulse / 2.0, rel=1e-14)
        work = sum(system_force * step for system_force, step in zip(
            [scene.system.external_at(tick)[2] for tick in range(scene.ticks)],
            np.diff(simulate(scene, grid=tick_times(scene)).state[:, 2]), strict=True))
        assert work == pytest.approx(motion.state[-1, 3] ** 2 - 1.0, rel=1e-12)  # twice m / 2 = 1 kg


def test_a_sine_force_is_a_staircase_with_the_values_of_the_sine() -> None:
    document = {"title": "", "readings": [], "time": {"duration_s": 1.0, "control_period_s": 0.001},
                "object": {"mass_kg": 1.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
                "object_sine": {"amplitude_N": 2.0, "frequency_Hz": 3.0, "phase_rad": 0.5}}
    scene = scenes.parse(yaml.safe_dump(document), "shake", "shake")
    turn = 2 * np.pi * 3.0
    exact = 2.0 / turn * (np.cos(0.5) - np.cos(turn * tick_times(scene) + 0.5))
    found = simulate(scene, sampled=True).state[:, 3]
    assert np.abs(found - exact).max() < 2.0 / turn * (turn * 0.001) ** 2 / 10  # second order in the period
    assert np.abs(found - simulate(scene, grid=tick_times(scene)).state[:, 3]).max() < 1e-15


def test_a_knocked_object_comes_back() -> None:
    motion = simulate(scenes.load("pulse"), grid=np.array([4.999, 5.02, 10.0]))
    assert abs(motion.state[1, 2]) > 0.005
    assert motion.state[2] == pytest.approx(motion.state[0], abs=1e-6)


# The sampled loop.


def plain_loop(scene: Scene, delay: int) -> Array:
    """The loop written out: commands wait in a list, around a plant that knows of no delay."""
    plant = SampledPlant(replace(scene.system, delay=0), scene.period_ns)
    waiting: deque[Array] = deque([np.zeros(3)] * delay)
    states = [plant.state]
    for _ in range(scene.ticks):
        x_l, v_l, _, _, x_r, v_r = plant.state
        waiting.append(np.array([-5.0 * x_l - 0.5 * v_l, -5.0 * x_r - 0.5 * v_r, 0.0]))
        plant.step(waiting.popleft())
        assert plant.status is Status.DONE
        states.append(plant.state)
    return np.array(states)


@pytest.mark.parametrize("delay", [0, 1, 2, 7])
def test_delay_is_a_list_of_waiting_commands(delay: int) -> None:
    scene = scene_of("delay", f"loop.delay_ticks={delay}", "time.duration_s=5.0")
    assert simulate(scene).state.tobytes() == plain_loop(scene, delay).tobytes()


@pytest.mark.parametrize(("factor", "grows"), [(0.98, False), (1.02, True)])
def test_delay_costs_the_stability_that_theory_says(factor: float, grows: bool) -> None:
    """Spectral radius 1 of the sampled arm with one period of delay is at 0.08878 s."""
    period = round(0.0887780231816513 * factor * 1e6) / 1e6
    settings = [f"time.control_period_s={period!r}", f"time.duration_s={period * 2000:.9f}", "loop.delay_ticks=1"]
    document = {key: value for key, value in yaml.safe_load(scenes.load("delay").to_yaml()).items()
                if not key.startswith(("right", "object", "left_contact"))}
    scene = scenes.parse(yaml.safe_dump(document), "d", "d", settings)
    swings = np.abs(simulate(scene).state[:, 0])
    assert (swings[-200:].max() > swings[:200].max()) == grows


def test_saturation_limits_what_the_law_asks_for() -> None:
    motion = simulate(scenes.load("saturation"))
    asked = np.stack([-5.0 * motion.state[:, i] - 0.5 * motion.state[:, i + 1] for i in (0, 4)], axis=1)
    assert np.array_equal(motion.command, np.clip(asked, -1.0, 1.0))
    assert (np.abs(asked) > 1.0).any()


def test_noise_is_seeded_and_as_large_as_it_says() -> None:
    settings = ("time.duration_s=60.0",)
    steps = ("position_step_m", "velocity_step_m_per_s")
    scene = scene_of("noise", *settings)
    sections = {key: dict(numbers) for key, numbers in scene.values.items()}
    for key in ("left_sensor", "right_sensor"):
        for step in steps:
            del sections[key][step]
    smooth = scenes.parse(yaml.safe_dump({"title": "", "readings": [], **sections}), "smooth", "smooth")
    motion = simulate(smooth)
    assert simulate(smooth).state.tobytes() == motion.state.tobytes()
    other = simulate(smooth.changed({"left_sensor.noise_seed": 3}))
    assert other.state.tobytes() != motion.state.tobytes()
    noise = motion.command[:, 0] + 5.0 * motion.state[:, 0] + 0.5 * motion.state[:, 1]
    expected = np.hypot(5.0 * 0.002, 0.5 * 0.01)
    assert noise.std() == pytest.approx(expected, rel=0.02)
    assert abs(noise.mean()) < 5 * expected / np.sqrt(len(noise))
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.03
    right = motion.command[:, 1] + 5.0 * motion.state[:, 4] + 0.5 * motion.state[:, 5]
    assert abs(np.corrcoef(noise, right)[0, 1]) < 0.03


def test_quantised_measurements_are_whole_steps() -> None:
    document = {**scenes.load("noise").values}
    for side in ("left", "right"):
        document[f"{side}_sensor"] = {"noise_seed": 0, "position_step_m": 0.01}
    scene = scenes.parse(yaml.safe_dump({"title": "", "readings": [], **document}), "steps", "steps")
    motion = simulate(scene)
    measured = (motion.command[:, 0] + 0.5 * motion.state[:, 1]) / -5.0
    assert np.abs(measured / 0.01 - np.round(measured / 0.01)).max() < 1e-9
    assert np.abs(measured - motion.state[:, 0]).max() <= 0.005 + 1e-12


def test_changes_act_from_their_tick_on() -> None:
    scene = scenes.load("case_01", ["time.duration_s=2.0"])
    plain = simulate(scene, sampled=True)
    changed = simulate(scene, sampled=True, changes={700: {"left_feedback.position_gain_N_per_m": 50.0}})
    assert changed.state[:701].tobytes() == plain.state[:701].tobytes()
    assert changed.state[701, 1] != plain.state[701, 1]
    assert changed.command[700, 0] == -50.0 * plain.state[700, 0] - 0.5 * plain.state[700, 1]


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("pulse", ["object_pulse.start_s=0.0005"], ["object_pulse.start_s", "whole control periods"]),
        ("table", ["left_arm_table.time_s=[0.0, 2.0, 1.0]"], ["left_arm_table.time_s", "ascending"]),
        ("table", ["left_arm_table.force_N=[1.0]"], ["left_arm_table.force_N", "as many forces as times, 3"]),
        ("table", ["left_arm_table.force_N=[]"], ["left_arm_table.force_N", "a list"]),
        ("table", ["left_arm_table.force_N=3.0"], ["left_arm_table.force_N", "a list"]),
        ("delay", ["loop.delay_ticks=1.5"], ["loop.delay_ticks", "a whole number"]),
        ("delay", ["loop.delay_ticks=-1"], ["loop.delay_ticks", ">= 0"]),
        ("case_01", ["left_actuator.limit_N=1.0"], ["left_actuator", "needs loop"]),
        ("case_01", ["left_sensor.noise_seed=1"], ["left_sensor", "needs loop"]),
        ("hammer", ["right_arm_pulse.force_N=1", "right_arm_pulse.start_s=0", "right_arm_pulse.length_s=1"],
         ["right_arm_pulse", "needs right_arm"]),
        ("noise", ["left_sensor.position_step_m=0"], ["left_sensor.position_step_m", ">= 1e-12"]),
        ("pulse", ["object_pulse.length_s=1e-10"], ["object_pulse.length_s", "whole control periods"]),
        ("noise", ["left_sensor.noise_seed=1.5"], ["left_sensor.noise_seed", "a whole number"]),
    ],
)
def test_effects_refuse_what_makes_no_sense(name: str, settings: list[str], words: list[str]) -> None:
    with pytest.raises(scenes.SceneError) as caught:
        scenes.load(name, settings)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_only_the_paper_s_grasp_is_called_one() -> None:
    for name in OTHERS:
        if not name.startswith("v_jump"):
            with pytest.raises(ValueError, match="not the paper's grasp"):
                _ = scenes.load(name).grasp
    assert scenes.load("case_05").grasp.left.mass == 10.0


DOCUMENT = Path(__file__).parents[2] / "docs" / "effects.md"


def test_the_example_of_the_documentation_works(monkeypatch: pytest.MonkeyPatch) -> None:
    source = DOCUMENT.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    namespace: dict[str, object] = {}
    exec(compile(source, "rail.py", "exec"), namespace)
    for effect in namespace["EFFECTS"]:
        monkeypatch.setitem(BY_SECTION, effect.section, effect)
    others = [effect for effect in EFFECTS if not effect.section.endswith("_rail")]  # a reader may have added it
    monkeypatch.setattr("grasp_ros.scene.scene.EFFECTS", (*others, *namespace["EFFECTS"]))
    rail = scenes.load("case_01", ["left_rail.drag_Ns_per_m=0.3", "time.duration_s=5.0"])
    assert rail.system.bodies[LEFT].tolist() == [1.0, 10.0, 0.5, 0.0]
    same = scenes.load("case_01", ["left_arm.damping_Ns_per_m=0.5", "time.duration_s=5.0"])
    assert simulate(rail).state.tobytes() == simulate(same).state.tobytes()
    with pytest.raises(scenes.SceneError, match="drag_Ns_per_m"):
        scenes.load("case_01", ["left_rail.drag_Ns_per_m=-1"])


def test_every_effect_has_its_row_in_the_cost_table() -> None:
    found = variants(scenes.load("case_01", ["time.duration_s=1.0"]))
    missing = {effect.section for effect in EFFECTS} - found.keys()
    assert missing == PAPER - {"left_feedback", "right_feedback"}
    assert found["all together"].values.keys() == {effect.section for effect in EFFECTS}
    assert found["all together"].system.delay == 2
    for scene in found.values():
        assert simulate(scene.changed({"time.duration_s": 0.1})).status is Status.DONE


def test_the_documentation_lists_every_effect() -> None:
    assert registry_table() in DOCUMENT.read_text(encoding="utf-8")


# Friction of the object.


def against_the_slope(gap: float, friction: float = 1.0) -> Scene:
    """An arm at rest beside an object that friction holds on a slope."""
    document = {"title": "", "readings": [], "time": {"duration_s": 3.0, "control_period_s": 0.001},
                "left_arm": {"mass_kg": 1.0, "stiffness_N_per_m": 5.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
                "left_feedback": {"position_gain_N_per_m": 1.0, "velocity_gain_Ns_per_m": 0.0, "set_point_m": 0.001},
                "object": {"mass_kg": 1.0, "position_m": gap, "velocity_m_per_s": 0.0},
                "object_friction": {"coulomb_N": friction}, "left_contact": {"hertz_N_per_m1_5": 1e4},
                "tilt": {"angle_rad": 0.2, "gravity_m_per_s2": 9.81}}
    return scenes.parse(yaml.safe_dump(document), "slope", "slope")


def test_a_pair_that_touches_at_rest_is_judged_with_the_friction() -> None:
    touching, apart = simulate(against_the_slope(0.0)), simulate(against_the_slope(1e-12))
    assert len(touching.times(Transition.TOUCH, LEFT)) == len(apart.times(Transition.TOUCH, LEFT)) > 3
    assert np.abs(touching.state - apart.state)[:, :4].max() < 1e-9
    assert np.diff(touching.energy.V_c).max() <= 1e-12


def test_impacts_die_out_against_a_stuck_object_without_a_stall() -> None:
    """The other arm leans on the object, so that the scales of both contacts drift apart by many decades."""
    scene = scenes.load("case_01", ["object_friction.coulomb_N=50", "time.duration_s=300"])
    motion = simulate(scene)
    assert motion.status is Status.DONE
    assert np.diff(motion.energy.V_c).max() <= 1e-12
    strong = ["left_feedback.velocity_gain_Ns_per_m=16", "left_feedback.position_gain_N_per_m=900",
              "right_feedback.set_point_m=-0.02", "object_friction.coulomb_N=10", "left_arm.position_m=-0.05",
              "right_arm.position_m=0.001", "object.mass_kg=0.1", "time.duration_s=5"]
    assert simulate(scenes.load("case_01", strong)).status is Status.DONE


def test_a_weak_spring_under_a_constant_force_raises_no_alarm() -> None:
    for stiffness in (1e-6, 1e-4, 1e-2):
        document = {"title": "", "readings": [], "time": {"duration_s": 2.0, "control_period_s": 0.001},
                    "left_arm": {"mass_kg": 1.0, "stiffness_N_per_m": stiffness, "position_m": 0.0,
                                 "velocity_m_per_s": 0.0}, "tilt": {"angle_rad": 0.1, "gravity_m_per_s2": 9.81}}
        motion = simulate(scenes.parse(yaml.safe_dump(document), "weak", "weak"), sampled=True)
        assert not any(row.alarm for row in balance(motion))


@pytest.mark.parametrize(
    ("changes", "sampled", "words"),
    [
        ({5: {"left_feedback.position_gain_N_per_m": 9.0}}, False, "continuous"),
        ({5: {"object.mass_kg": 9.0}}, True, "object.mass_kg at tick 5"),
        ({-1: {"left_feedback.position_gain_N_per_m": 9.0}}, True, "at tick -1"),
    ],
)
def test_changes_that_no_graph_would_take_are_refused(changes: dict, sampled: bool, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        simulate(scenes.load("case_01", ["time.duration_s=1"]), sampled=sampled, changes=changes)


def sliding(**friction: float) -> Scene:
    """An object of 2 kg alone with 1.5 m/s."""
    document = {"title": "", "readings": [], "time": {"duration_s": 10.0, "control_period_s": 0.01},
                "object": {"mass_kg": 2.0, "position_m": 0.25, "velocity_m_per_s": 1.5}, "object_friction": friction}
    return scenes.parse(yaml.safe_dump(document), "slide", "slide")


def test_dry_friction_stops_the_object_where_and_when_it_must() -> None:
    motion = simulate(scenes.load("friction_slide"))
    (stop,) = motion.events
    assert stop.kind is Transition.STICK
    assert stop.time == pytest.approx(2.0 * 1.5 / 1.0, rel=1e-15)
    assert motion.state[-1, 2] == pytest.approx(2.0 * 1.5**2 / 2.0, rel=1e-15)
    assert motion.state[-1, 3] == 0.0
    assert np.unique(motion.state[motion.t > 3.0, 2]).size == 1


def test_both_frictions_together_stop_it_earlier() -> None:
    """m v' = -F - c v: v = 0 at (m / c) ln(1 + c v / F)."""
    motion = simulate(sliding(viscous_Ns_per_m=0.8, coulomb_N=0.5))
    (stop,) = motion.events
    time = 2.0 / 0.8 * np.log1p(0.8 * 1.5 / 0.5)
    assert stop.time == pytest.approx(time, rel=1e-14)
    way = (2.0 * 1.5 - 0.5 * time) / 0.8  # from the momentum: m v = F t + c x
    assert motion.state[-1, 2] == pytest.approx(0.25 + way, rel=1e-14)


def test_viscous_friction_alone_never_stops_it() -> None:
    motion = simulate(sliding(viscous_Ns_per_m=0.8))
    assert motion.events == []
    assert np.abs(motion.state[:, 3] - 1.5 * np.exp(-0.4 * motion.t)).max() < 1e-15


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stuck_object_gives_way_only_to_more_than_the_friction(sign: float) -> None:
    document = {"title": "", "readings": [], "time": {"duration_s": 4.0, "control_period_s": 0.01},
                "object": {"mass_kg": 2.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
                "object_friction": {"coulomb_N": 1.0},
                "object_table": {"time_s": [0.0, 1.0, 2.0], "force_N": [sign, 1.5 * sign, 0.5 * sign]}}
    motion = simulate(scenes.parse(yaml.safe_dump(document), "pull", "pull"))
    slip, stick = motion.events
    assert (slip.kind, stick.kind) == (Transition.SLIP, Transition.STICK)
    assert slip.time == 1.0
    assert stick.time == pytest.approx(3.0, rel=1e-15)  # 0.25 m/s^2 for a second, then as much against it
    assert motion.state[-1, 2] == pytest.approx(sign * 0.25, rel=1e-15)


def test_friction_holds_the_object_against_the_slope() -> None:
    """It slides if tan(angle) > F / (m g cos(angle)): here m g sin(angle) against F."""
    for angle, moves in ((0.05, False), (0.06, True)):
        document = {"title": "", "readings": [], "time": {"duration_s": 2.0, "control_period_s": 0.01},
                    "object": {"mass_kg": 2.0, "position_m": 0.0, "velocity_m_per_s": 0.0},
                    "object_friction": {"coulomb_N": 1.1}, "tilt": {"angle_rad": angle, "gravity_m_per_s2": 9.81}}
        end = simulate(scenes.parse(yaml.safe_dump(document), "slope", "slope")).state[-1]
        pull = 9.81 * np.sin(angle) - 0.55
        assert end[2] == (pytest.approx(-0.5 * pull * 4.0, rel=1e-13) if moves else 0.0)


def test_the_energy_lost_is_force_times_way() -> None:
    scene = scene_of("friction", "left_arm.damping_Ns_per_m=0", "right_arm.damping_Ns_per_m=0",
                     "left_feedback.velocity_gain_Ns_per_m=0", "right_feedback.velocity_gain_Ns_per_m=0",
                     "left_contact.dissipation_s_per_m=0", "right_contact.dissipation_s_per_m=0",
                     "object_friction.viscous_Ns_per_m=0", "time.duration_s=10.0")
    motion = simulate(scene, grid=np.linspace(0.0, 10.0, 400_001))
    kinds = {event.kind for event in motion.events}
    assert {Transition.STICK, Transition.SLIP} <= kinds
    way = np.abs(np.diff(motion.state[:, 2])).sum()
    V_c = motion.energy.V_c
    assert V_c[0] - V_c[-1] == pytest.approx(2.0 * 1.0 * way, abs=1e-7)
    assert V_c[0] - V_c[-1] > 1.0


def test_the_object_sticks_exactly_while_the_arms_push_too_weakly() -> None:
    motion = simulate(scenes.load("friction"))
    stuck = False
    rest = []
    for event in motion.events:
        if event.kind in (Transition.STICK, Transition.SLIP):
            stuck = event.kind is Transition.STICK
            rest.append(event.time)
    assert stuck
    end = motion.t > rest[-1]
    assert np.unique(motion.state[end, 2]).size == 1
    assert not motion.state[end, 3].any()
    assert np.ptp(motion.state[end, 0]) > 1e-3  # the arm still swings
    lean = next(output.value(motion.scene.system, 0, motion.state[-1]) for output in motion.scene.outputs)
    assert lean == pytest.approx(-15.0 * motion.state[-1, 0], rel=1e-4)  # the arm rests against it
    assert 0.5 < lean < 1.0

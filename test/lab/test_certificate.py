"""The certificate: theorems of docs/certificate.md, and the scenes whose V jumps."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import STANDARD, energy, run

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Arm, Contact, hertzian_force, impact_force, in_contact
from grasp_ros.simulation import simulate
from lab.reference import integrate
from lab.reference.grasp import Grasp, grasp_of, system_of
from lab.studies import certificate
from lab.studies.certificate import SCENES, jumps, safe_p

PAPER = [name for name in scenes.names() if name.startswith("case_")]


def draw(rng: np.random.Generator) -> tuple[Grasp, np.ndarray]:
    """A grasp of any kind, released anywhere between the arms with any speed."""
    def arm() -> Arm:
        return Arm(*(10.0 ** rng.uniform(-1, 1, 5) * [1.0, 10.0, 0.2, 20.0, 2.0]).tolist())

    contacts = [Contact(10.0 ** rng.uniform(2, 6), 10.0 ** rng.uniform(-2, 2)) for _ in range(2)]
    start = [-rng.uniform(0, 0.5), rng.normal(), 0.0, rng.normal(), rng.uniform(0, 0.5), rng.normal()]
    return Grasp(arm(), arm(), *contacts, 10.0 ** rng.uniform(-1, 1)), np.array(start)


def test_dissipation_of_theorem_1_is_continuous_and_never_negative() -> None:
    contact, u = Contact(1e4, 2.0), 1e-3
    d = np.linspace(-5.0, 5.0, 10001)
    elastic = hertzian_force(contact, u)
    lost = (impact_force(contact, u, d) - elastic) * d
    expected = elastic * np.where(in_contact(contact, u, d), 2.0 * d * d, np.abs(d))
    assert lost == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert lost.min() >= 0.0
    assert np.abs(np.diff(lost)).max() < 3e-3 * lost.max()


@pytest.mark.parametrize("seed", range(40))
def test_v_c_never_rises_and_v_rises_only_at_reentries(seed: int) -> None:
    grasp, start = draw(np.random.default_rng(seed))
    events = run(grasp, start, 4.0).integrator.events
    grid = np.unique(np.concatenate([np.linspace(0.0, 4.0, 4001), [event.time for event in events]]))
    level = energy(grasp, run(grasp, start, 4.0, grid).states)
    assert np.diff(level.V_c).max() <= 1e-13 * level.V_c[0]
    reentries = np.array([event.time for event in events if event.kind is Transition.REENTRY])
    rises = np.flatnonzero(np.diff(level.V) > 1e-12 * level.V_c[0])
    assert all((reentries >= grid[row] - 1e-12).any() and (reentries <= grid[row + 1] + 1e-12).any() for row in rises)


def test_random_grasps_include_jumps() -> None:
    found = [jumps(system_of(*draw(np.random.default_rng(seed))), 4.0) for seed in range(40)]
    assert sum(bool(each) for each in found) >= 4


@pytest.mark.parametrize("name", SCENES)
def test_scenes_whose_v_jumps(name: str) -> None:
    scene = scenes.load(name)
    found = jumps(scene.system, scene.duration)
    assert found
    for jump in found:
        span = 1e-9
        level = simulate(scene, grid=np.array([jump.time - span, jump.time + span])).energy
        together = sum(other.height for other in found if abs(other.time - jump.time) < span)
        assert level.V[1] - level.V[0] == pytest.approx(together, rel=1e-3)
        assert level.V_c[1] <= level.V_c[0]


def test_jumps_have_the_known_heights() -> None:
    for name, before, height in (
        ("v_jump_symmetric", 0.0248447, 0.0763355825901982 - 0.0248447), ("v_jump_one_sided", None, 0.049268969270082),
    ):
        found = jumps(scenes.load(name).system, 2.0)
        first = [jump.height for jump in found if jump.time < found[0].time + 1e-9]
        assert sum(first) == pytest.approx(height, rel=1e-5 if before else 1e-10)


def test_smallest_jump_is_confirmed_by_the_reference() -> None:
    scene = scenes.load("v_jump_smallest_p")
    found = jumps(scene.system, 1.0)
    reference = integrate(scene, [0.0, 0.6])
    left = [float(time) for time in reference.touches[0]]
    assert [jump.time for jump in found] == pytest.approx(left[1:], abs=1e-10)
    assert [jump.side for jump in found] == [0]


def test_a_small_search_finds_a_jump_near_the_smallest_p() -> None:
    family = certificate.families()[1]
    found = certificate.search(family, draws=400, steps=300, seed=2)
    start, mass, hertzian = family.start(found.point)
    again = jumps(system_of(certificate.table_one(found.p, mass, hertzian), start), certificate.HORIZON)
    assert max(jump.height for jump in again) == found.jump.height >= family.part * 15.0 * (start @ start)
    assert 2.0 < found.p < 3.5


@pytest.mark.parametrize("seed", range(20))
def test_theorem_2_excludes_clamped_pairs(seed: int) -> None:
    grasp, start = draw(np.random.default_rng(seed))
    p = 0.999 * safe_p(grasp, start)
    safe = grasp._replace(left_contact=grasp.left_contact._replace(dissipation=p),
                          right_contact=grasp.right_contact._replace(dissipation=p))
    kinds = {event.kind for event in run(safe, start, 4.0).integrator.events}
    assert kinds <= {Transition.TOUCH, Transition.RELEASE}


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_cases_are_safe(name: str) -> None:
    scene = scenes.load(name)
    p = grasp_of(scene).left_contact.dissipation
    assert (p < safe_p(grasp_of(scene), scene.initial_state)) == (name != "case_04")
    assert all(event.kind in (Transition.TOUCH, Transition.RELEASE) for event in simulate(scene).events)


@pytest.mark.parametrize("losses", [(0.1, 0.1), (0.1, 0.0), (0.0, 0.1)])
def test_theorem_4_one_lossy_contact_is_enough(losses: tuple[float, float]) -> None:
    arm = STANDARD._replace(damping=0.0, velocity_gain=0.0)
    grasp = Grasp(arm, arm, Contact(1e4, losses[0]), Contact(1e4, losses[1]), 5.0)
    states = run(grasp, [-0.3, 0.0, 0.0, 0.0, 0.5, 0.0], 2e4, [0.0, 1e3, 2e4]).states
    level = energy(grasp, states).V_c
    assert level[2] < 0.1 * level[1] < 0.01 * level[0]
    assert abs(states[2, 2]) < 0.1


def test_theorem_5_holds_through_contacts() -> None:
    """Kv = 0 and h <= 2 c / Kp = 0.08 s: V_c falls from tick to tick."""
    numbers = {f"{side}_feedback.velocity_gain_Ns_per_m": 0.0 for side in ("left", "right")}
    for period in (0.01, 0.08):
        times = {"time.control_period_s": period, "time.duration_s": 250 * period}
        trajectory = simulate(scenes.load("case_01").changed({**numbers, **times}), sampled=True)
        assert np.diff(trajectory.energy.V_c).max() <= 0.0
        assert len(trajectory.events) > 5


@pytest.mark.parametrize(("period", "rises"), [(0.08, False), (0.0803, True)])
def test_theorem_5_is_sharp(period: float, rises: bool) -> None:
    """An arm alone passes x = 0, where its speed changes least, with a held command of 0."""
    scene = scenes.load("arm_alone").changed({
        "time.control_period_s": period, "time.duration_s": period, "left_feedback.velocity_gain_Ns_per_m": 0.0,
        "left_feedback.set_point_m": 0.0, "left_arm.position_m": 0.0, "left_arm.velocity_m_per_s": 1.0,
    })
    V_c = simulate(scene, sampled=True).energy.V_c
    assert (V_c[1] > V_c[0]) == rises


def test_rise_under_held_commands_stays_below_its_bound() -> None:
    """(H) of docs/certificate.md, tick by tick, with contacts in between."""
    scene = scenes.load("case_01").changed({"time.control_period_s": 0.02})
    trajectory = simulate(scene, sampled=True)
    rise, bound, h = np.diff(trajectory.energy.V_c), np.zeros(scene.ticks), 0.02
    for column in (0, 4):
        moved, v = np.diff(trajectory.state[:, column]), trajectory.state[:-1, column + 1]
        bound += (5.0 - 2.0 * 0.7 / h) * moved**2 - 2.0 * 0.5 * (v - moved / h) * moved
    assert (rise <= bound + 1e-12).all()
    assert bound.max() > 0.0  # it does allow a rise, where an arm bounces within a period

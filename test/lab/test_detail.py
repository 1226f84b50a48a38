"""What the relations of a run find: nothing in good runs, and what was falsified in others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.simulation import Trajectory
from lab.cases import regression
from lab.cases.case import Product
from lab.drills import fuzz
from lab.oracles import restart_check as restarts
from lab.oracles.metamorphic import mirror, scaling
from lab.oracles.motion import ledgers
from lab.oracles.properties import LIMIT, UNITS, examine, look
from lab.oracles.replay import findings
from lab.oracles.restart_check import digits, reversal, splitting
from lab.oracles.segments import FIRST, INNER, LAST, WHOLE, Detail, pieces_of, rule

SHORT = ["time.duration_s=2", "time.control_period_s=0.5"]


def run(name: str, *settings: str, time: Sequence[str] = SHORT) -> Trajectory:
    """A scene of the package, two seconds of it."""
    scene = scenes.load(name, [*time, *settings])
    return Product().run(scene, None if scene.sampled else [0.0, scene.duration])


def close(first: Trajectory) -> Detail:
    """Its states at the nodes."""
    return look(first, pieces_of(first), Product())


def errors(detail: Detail) -> dict[str, float]:
    """The largest error of each balance and relation."""
    found = {entry.name: float(entry.error.max()) for entry in ledgers(detail)}
    for name, error in findings(detail):
        found[name] = max(error, found.get(name, 0.0))
    return found


def broken(detail: Detail) -> set[str]:
    """Names of what does not hold."""
    return {name for name, error in errors(detail).items() if not error <= LIMIT}


@pytest.fixture(scope="module")
def first() -> Trajectory:
    """Case 1."""
    return run("case_01")


@pytest.fixture(scope="module")
def good(first: Trajectory) -> Detail:
    """Case 1, closely."""
    return close(first)


@pytest.mark.parametrize("kind", [INNER, FIRST, LAST, WHOLE])
def test_the_quadrature_is_exact_for_what_a_piece_of_its_kind_holds(kind: int) -> None:
    table = rule()
    t, weight, coarse = table.nodes[kind], table.weights[kind], table.coarse[:, kind]
    assert weight.sum() == pytest.approx(1.0, abs=1e-14)
    assert coarse.sum(axis=1) == pytest.approx([1.0, 1.0], abs=1e-14)
    assert coarse @ t == pytest.approx([0.5, 0.5], rel=1e-13)
    assert weight @ t**8 == pytest.approx(1.0 / 9.0, rel=1e-14)
    if kind & FIRST:
        assert weight @ t**1.5 == pytest.approx(0.4, rel=1e-14)
    if kind & LAST:
        assert weight @ (1.0 - t) ** 1.5 == pytest.approx(0.4, rel=1e-14)


def test_pieces_cover_the_run_and_no_event_lies_within_one(first: Trajectory) -> None:
    pieces = pieces_of(first)
    assert pieces.begin[0] == 0.0
    assert pieces.end[-1] == first.scene.duration
    assert (pieces.begin[1:] == pieces.end[:-1]).all()
    times = first.event_table[:, 0]
    assert len(times) > 4
    assert np.isin(times, np.append(pieces.begin, pieces.end)).all()


@pytest.mark.parametrize("name", ["case_01", "case_03", "friction", "tilt_hold", "wall", "v_jump_symmetric", "delay"])
def test_good_runs_are_within_a_few_roundings(name: str) -> None:
    found = errors(close(run(name)))
    assert {"position", "momentum", "energy", "open, u > 0", "contact, u < 0"} <= found.keys()
    assert max(found.values()) < 20.0


def shifted(detail: Detail, body: int, by: float) -> Detail:
    """From the middle on a body is faster."""
    v = detail.v.copy()
    v[len(v) // 2 :, :, body] += by
    v[len(v) // 2 - 1, -1, body] += by
    return detail._replace(v=v)


@pytest.mark.parametrize(("body", "name"), [(LEFT, "left"), (RIGHT, "right"), (OBJECT, "object")])
def test_a_velocity_that_jumps_is_noticed(good: Detail, body: int, name: str) -> None:
    assert {f"momentum, {name}", "momentum", "energy"} <= broken(shifted(good, body, 1e-12))
    assert broken(shifted(good, body, 1e-18)) == set()


@pytest.mark.parametrize("by", [1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0])
def test_a_jump_within_a_piece_is_noticed_whether_or_not_a_quadrature_resolves_it(good: Detail, by: float) -> None:
    k, node = len(good.x) // 2, 8
    x, v, passed = good.x.copy(), good.v.copy(), good.t - good.t[k, node]
    v[k, node:, OBJECT] += by
    v[k + 1 :, :, OBJECT] += by
    x[k, node:, OBJECT] += by * passed[k, node:]
    x[k + 1 :, :, OBJECT] += by * passed[k + 1 :]
    kicked = good._replace(x=x, v=v)
    (known,) = (entry.resolved[k] for entry in ledgers(kicked) if entry.name == "momentum, object")
    assert known == (by < 1e-5)
    (error,) = (entry.error[k] for entry in ledgers(kicked) if entry.name == "momentum, object")
    assert error > LIMIT


def test_a_position_that_jumps_is_noticed(good: Detail) -> None:
    x = good.x.copy()
    x[50:, :, OBJECT] += 1e-12
    x[49, -1, OBJECT] += 1e-12
    assert {"position", "position, output to output"} <= broken(good._replace(x=x))


@pytest.mark.parametrize("setting", [
    "left_contact.hertz_N_per_m1_5=10000.000001", "left_contact.dissipation_s_per_m=0.1000001",
    "left_arm.stiffness_N_per_m=10.0000000001", "left_feedback.velocity_gain_Ns_per_m=0.50000000001",
])
def test_the_balances_know_the_model(good: Detail, setting: str) -> None:
    """The states are those of a scene with slightly other numbers."""
    other = scenes.load("case_01", [*SHORT, setting])
    detail = good._replace(run=replace(good.run, scene=other))
    if "contact" not in setting:
        detail = detail._replace(bodies=np.repeat(other.system.closed_loop[None], len(good.x), axis=0))
    assert {"momentum, left", "energy"} <= broken(detail)


def without(detail: Detail, row: int) -> Detail:
    """One event is not recorded."""
    return detail._replace(run=replace(detail.run, event_table=np.delete(detail.run.event_table, row, axis=0)))


def test_a_missing_event_is_noticed(good: Detail) -> None:
    kinds = [event.kind for event in good.run.events]
    last = {kind: len(kinds) - 1 - kinds[::-1].index(kind) for kind in (Transition.TOUCH, Transition.RELEASE)}
    assert "open, u > 0" in broken(without(good, last[Transition.TOUCH]))
    assert "contact, u < 0" in broken(without(good, last[Transition.RELEASE]))
    assert "contact, u < 0" in broken(without(good, kinds.index(Transition.TOUCH)))  # a release says what was before


def test_an_event_at_another_time_is_noticed(good: Detail) -> None:
    table = good.run.event_table.copy()
    pieces = good.pieces
    begin = np.flatnonzero(pieces.begin > table[0, 0])[0]
    table[0, 0] = pieces.begin[begin]
    assert "event time" in broken(good._replace(run=replace(good.run, event_table=table)))


def test_modes_beyond_the_second_surface_are_noticed() -> None:
    detail = close(run("v_jump_symmetric"))
    kinds = [event.kind for event in detail.run.events]
    assert "contact, u' < -1/p" in broken(without(detail, kinds.index(Transition.CLAMP)))
    assert "clamped, u' > -1/p" in broken(without(detail, kinds.index(Transition.REENTRY)))


def with_friction(detail: Detail, coulomb: float) -> Detail:
    """The same states beside another limit of the friction."""
    scene = detail.run.scene.changed({"object_friction.coulomb_N": coulomb})
    return detail._replace(run=replace(detail.run, scene=scene))


def test_friction_beyond_its_bound_is_noticed() -> None:
    detail = close(run("friction", time=["time.duration_s=20", *SHORT[1:]]))
    limit = detail.run.scene.system.coulomb
    assert Transition.STICK in {event.kind for event in detail.run.events}
    assert "stuck, push beyond F" in broken(with_friction(detail, 0.01 * limit))
    assert "momentum, object" in broken(with_friction(detail, limit * (1.0 + 1e-10)))
    moved = detail.v.copy()
    moved[moved == 0.0] = 1e-30
    assert "stuck, v" in broken(detail._replace(v=moved))


@pytest.mark.parametrize("off", ["state", "event_table"])
def test_symmetry_and_units_are_compared_to_the_bit(
    first: Trajectory, off: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, relations = first.scene, (mirror, partial(scaling, *UNITS))
    assert [relation(scene, Product()) for relation in relations] == [0.0, 0.0]
    real = Product.run

    def other(self: Product, *args: object, **named: object) -> Trajectory:
        found: Trajectory = real(self, *args, **named)  # type: ignore[arg-type]
        if len(self.runs) == 1:
            self.runs[-1] = replace(found, **{off: getattr(found, off) * (1.0 + 2.0**-52)})
        return self.runs[-1]

    monkeypatch.setattr(Product, "run", other)
    assert all(relation(scene, Product()) > 0.0 for relation in relations)


def test_a_restarted_run_follows_the_first(good: Detail) -> None:
    for part in (0.0, 0.3, 0.9):
        assert splitting(good, part, Product()) < LIMIT
    assert splitting(shifted(good, OBJECT, 1e-10), 0.3, Product()) > LIMIT


@pytest.mark.parametrize(("name", "part"), [("wall_put_at_a_touch", 0.4), ("arm_waits_at_zero", 0.75)])
def test_roundings_of_the_way_to_a_touch_are_no_errors_behind_it(name: str, part: float) -> None:
    """There the arm is put where the object is."""
    first = Product().run(regression.load(name), [0.0, regression.load(name).duration])
    assert splitting(close(first), part, Product()) <= LIMIT


def test_a_motion_that_died_out_before_the_first_output_does_not_stall() -> None:
    found = examine(regression.load("dies_out_between_outputs"))
    assert (found.end, found.broken) == (Status.DONE.value, [])


def test_ends_beside_the_reference_and_backwards(first: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restarts, "REFERENCE_SECONDS", 600.0)  # on a machine that is busy, too
    assert digits(first, Product()) < 10.0
    assert reversal(first, Product()) is None
    assert reversal(run("case_02"), Product()) < 10.0


def test_held_inputs_are_what_the_laws_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.load("delay", ["time.duration_s=0.5"])
    assert examine(scene, max_work=10**6).broken == []
    real = Product.run

    def other(self: Product, *args: object, **named: object) -> Trajectory:
        found: Trajectory = real(self, *args, **named)  # type: ignore[arg-type]
        assert found.loop is not None
        return replace(found, loop=found.loop._replace(inputs=found.loop.inputs * 1.0000001))

    monkeypatch.setattr(Product, "run", other)
    assert "held inputs" in {check.name for check in examine(scene, max_work=10**6).broken}


def test_a_scene_out_of_budget_is_no_failure() -> None:
    found = examine(scenes.load("case_01"), max_work=10)
    assert "budget" in found.end
    assert found.broken == []


def test_draws_depend_on_seed_and_number_alone() -> None:
    assert fuzz.draw(1, 7).values == fuzz.draw(1, 7).values
    assert fuzz.draw(1, 7).values != fuzz.draw(1, 8).values
    assert fuzz.draw(2, 7).values != fuzz.draw(1, 7).values


@pytest.mark.slow
@pytest.mark.thorough
def test_processes_find_what_one_finds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def table(jobs: int) -> list[str]:
        fuzz.run(3, tmp_path / str(jobs), draws=120, jobs=jobs)
        return capsys.readouterr().out.splitlines()[1:]

    assert table(2) == table(1)


def test_an_exception_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OverflowError("too large")

    monkeypatch.setattr(fuzz, "examine", fail)
    assert fuzz.run(0, tmp_path, draws=2).broken == 2
    assert len(list(tmp_path.glob("traceback_OverflowError*.yaml"))) == 2

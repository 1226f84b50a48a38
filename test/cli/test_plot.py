"""`grasp plot` as people use it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from grasp_ros import scene
from grasp_ros.cli import plot
from grasp_ros.physics.layout import Entry
from grasp_ros.physics.system import NAMES
from grasp_ros.simulation import simulate

BEGINS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.mark.slow
@pytest.mark.parametrize("ending", BEGINS)
def test_scenes_side_by_side_in_every_format(command: Any, tmp_path: Path, ending: str) -> None:
    result = command("plot", "case_01", "case_03", "--set", "time.duration_s=2", "--from", "0.4", "--to", "0.6",
                     "--width", "120", "-o", f"out.{ending}")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / f"out.{ending}").read_bytes().startswith(BEGINS[ending])


def test_width_is_that_of_the_page(command: Any, tmp_path: Path) -> None:
    assert command("plot", "case_02", "--method", "paper", "--step", "1e-2", "--width", "90").returncode == 0
    with Image.open(tmp_path / "case_02.png") as picture:
        assert picture.width == pytest.approx(90 / 25.4 * 150, abs=2)


@pytest.mark.slow
def test_sampled_and_files(command: Any, tmp_path: Path) -> None:
    assert command("simulate", "case_01", "--set", "time.duration_s=1", "--sampled", "-o", "a.npz").returncode == 0
    assert command("plot", "a.npz", "case_01", "--to", "1", "--sampled").returncode == 2
    result = command("plot", "a.npz", "case_01", "--to", "1")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_derivatives_are_drawn_below_the_motion(command: Any, tmp_path: Path) -> None:
    keys = ("--sensitivity", "left_contact.dissipation_s_per_m", "--sensitivity", "object.position_m")
    words = "plot", "case_01", "--set", "time.duration_s=2", "-o"
    for name, more in (("plain", ()), ("both", keys)):
        result = command(*words, f"{name}.svg", *more)
        assert result.returncode == 0, result.stderr
    plain, both = ((tmp_path / f"{name}.svg").read_text("utf-8") for name in ("plain", "both"))
    labels = ["by left_contact.dissipation_s_per_m", "by object.position_m", "derivative, m"]
    assert [(label in both, label in plain) for label in labels] == [(True, False)] * len(labels)


def test_panels_are_chosen(command: Any, tmp_path: Path) -> None:
    words = "plot", "case_01", "--set", "time.duration_s=2", "--panel", "impact", "-o", "one.svg"
    assert command(*words).returncode == 0
    drawn = (tmp_path / "one.svg").read_text("utf-8")
    assert ("impact force, N" in drawn, "displacement, m" in drawn) == (True, False)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What `grasp plot` would write."""
    found: list[Any] = []
    monkeypatch.setattr(plot, "write_figure", lambda figure, _: found.append(figure))
    return found


@pytest.mark.parametrize("name", ["friction", "hammer", "case_03"])
def test_short_impacts_reach_their_peaks(command: Any, figures: list[Any], name: str) -> None:
    """An output time each 20 ms misses a tenth of the first impact of friction."""
    run = simulate(scene.load(name))
    assert command("plot", name, "--panel", "impact").returncode == 0
    for line, body in zip(figures[0].axes[0].lines, run.scene.system.contacts, strict=True):
        peak = run.contacts(NAMES[body])["peak_force"].max()
        assert np.nanmax(np.abs(line.get_ydata())) == pytest.approx(peak, rel=3e-3)


def test_events_outside_the_time_range_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    run = simulate(scene.load("case_03"), grid=np.linspace(0.0, 0.6, 7))
    times = np.unique(run.event_table[:, Entry.TIME])  # both sides touch together
    inside = np.count_nonzero(times < run.t[-1])
    assert 0 < inside < 0.5 * len(times)
    for most, finer in ((inside + 2, True), (inside + 1, False)):  # and both ends
        monkeypatch.setattr(plot, "MOST_EVENTS", most)
        assert (len(plot.with_contacts(run)) > len(run.t)) is finer


def test_a_scene_is_not_run_again_without_a_finer_result(
    command: Any, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def counted(*given: Any, sensitivity: Any = None, **more: Any) -> Any:
        asked.append(sensitivity is not None)
        return simulate(*given, sensitivity=sensitivity, **more)

    monkeypatch.setattr(plot, "simulate", counted)
    short = ("--set", "time.duration_s=1")
    for words, runs in ((("no_contact",), [False]), (("case_01", "--sensitivity", "object.mass_kg"), [False, True]),
                        (("case_01", "--from", "0.01", "--to", "0.02"), [False])):
        assert command("plot", *words, *short).returncode == 0
        assert asked == runs
        asked.clear()


def test_simulate_prints_settling_forces_and_losses(command: Any) -> None:
    lines = dict(line.split("  ", 1) for line in command("simulate", "case_01").stdout.splitlines())
    assert lines["settled to 2%"].strip() == "left 16.61 s, object 16.69 s, right 18.24 s"
    assert lines["largest forces"].strip() == ("input left 1.5 N, input right 2.5 N, impact left 48.295 N,"
                                               " impact right 73.669 N")  # outputs: 72.93
    parts = [float(part.split()[-1]) for part in lines["energy lost, J"].split(",")]
    assert sum(parts) == pytest.approx(0.5 * (5.1 - 0.00129), abs=1e-3)
    assert "watch for" in lines
    lines = dict(line.split("  ", 1) for line in command("simulate", "pulse").stdout.splitlines())
    assert (lines["external work, J"].strip(), "dampers" in lines["energy lost, J"]) == ("0.2935", True)
    assert "; trapezoidal rule at the control periods" in command("simulate", "case_01", "--method", "rk4").stdout

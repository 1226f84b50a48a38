"""Figures: every panel has its place, nothing is hidden, and what is asked for is shown."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT
from grasp_ros.simulation import plots, simulate
from grasp_ros.simulation.plots import compose, contact_spans


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "width"),
    [(("case_01",), None), (("case_02",), 90.0), (("case_01", "case_09", "v_jump_one_sided"), 180.0)],
)
def test_axes_letters_and_legends_do_not_collide(names: tuple[str, ...], width: float | None) -> None:
    runs = [simulate(scenes.load(name)) for name in names]
    figure = compose(runs, ["continuous feedback"] * len(runs), width_mm=width)
    renderer: Any = figure.canvas.get_renderer()
    boxes = [axes.get_tightbbox(renderer, for_layout_only=True) for axes in figure.axes]
    for a, b in combinations(boxes, 2):
        assert min(a.x1, b.x1) - max(a.x0, b.x0) <= 1.0 or min(a.y1, b.y1) - max(a.y0, b.y0) <= 1.0
    for axes, other in product(figure.axes, figure.axes):
        if axes.get_legend() is not None:
            box, data = axes.get_legend().get_window_extent(renderer), other.get_window_extent(renderer)
            assert not box.overlaps(data)
    for box in boxes:
        assert box.x0 >= -1.0
        assert box.x1 <= figure.bbox.x1 + 1.0


def test_some_panels_make_a_lower_figure_in_their_order() -> None:
    run = simulate(scenes.load("case_01"))
    whole, two = (compose([run], [""], panels=panels) for panels in
                  (None, [plots.PANELS["energy"], plots.PANELS["displacement"]]))
    assert [axes.get_ylabel() for axes in two.axes] == ["twice the energy, J", "displacement, m"]
    assert len(whole.axes) == 4
    assert two.bbox.height < 0.7 * whole.bbox.height


def test_a_figure_shows_what_the_table_says() -> None:
    run = simulate(scenes.load("table"))
    lines = {line.get_label(): line.get_ydata() for axes in compose([run]).axes for line in axes.lines}
    assert [*lines] == ["x_left", "x_object", "input_left", "impact_left", "V_c"]
    table = run.dataframe()
    assert all(np.array_equal(y, table[name], equal_nan=True) for name, y in lines.items())
    sine = compose([simulate(scenes.load("sine"))], panels=[plots.PANELS["input"]])
    assert [line.get_label() for line in sine.axes[0].lines] == ["input_left", "input_object", "input_right"]
    alone = simulate(scenes.load("arm_alone"))
    heads = [axes.get_ylabel() for axes in compose([alone]).axes]
    assert heads == ["displacement, m", "input, N", "twice the energy, J"]
    with pytest.raises(Refused, match=r"^nothing to draw: no force acts in these panels"):
        compose([alone], panels=[plots.PANELS["impact"]])


def test_one_scale_for_all_energies_of_a_row_and_steps_for_what_is_held() -> None:
    names = ("case_01", "tilt_hold", "tilt_lose")
    runs = [simulate(scenes.load(name), sampled=True) for name in names]
    panels = [plots.PANELS["energy"], plots.PANELS["input"]]
    for some, scale in ((runs[:1], "log"), (runs, "linear"), (runs[::-1], "linear")):
        figure = compose(some, panels=panels)
        assert {axes.get_yscale() for axes in figure.axes[: len(some)]} == {scale}
        low = min(run.energy.V_c.min() for run in some)
        assert figure.axes[0].get_ylim()[0] < low
        assert {line.get_drawstyle() for line in figure.axes[-1].lines} == {"steps-post"}


def test_the_height_fits_what_lies_within_the_span() -> None:
    run = simulate(scenes.load("noise"))
    late = run.t >= 15.0
    displacement, inputs, impacts, levels = compose([run], span=(15.0, 20.0)).axes
    for axes, y in ((displacement, run.state[:, ::2]), (inputs, run.inputs[:, :2]), (impacts, run.impacts),
                    (levels, run.energy.V_c)):
        assert max(map(abs, axes.get_ylim())) < 1.3 * np.nanmax(np.abs(y[late]))
        assert axes.get_xlim() == (15.0, 20.0)
    short = simulate(scenes.load("noise", ["time.duration_s=2"]))
    assert [axes.get_ylim() for axes in compose([short, run], span=(15.0, 20.0)).axes[1::2]] == [
        axes.get_ylim() for axes in (displacement, inputs, impacts, levels)]
    stopped = simulate(scenes.load("case_01"), max_events=3)
    assert not any(len(line.get_xdata()) for line in compose([stopped, run], span=(15.0, 20.0)).axes[-2].lines)
    with pytest.raises(Refused, match=r"^nothing to draw from 15 to 20 s: the motion is from 0 to 0\.\d+ s$"):
        compose([stopped], span=(15.0, 20.0))


def test_the_title_says_that_a_run_stopped() -> None:
    whole, cut = (compose([simulate(scenes.load("case_01"), max_events=most)]) for most in (10**4, 3))
    titles = [figure.axes[0].get_title() for figure in (whole, cut)]
    assert ["stopped: the event budget" in " ".join(title.split()) for title in titles] == [False, True]


def test_contacts_of_a_recording_are_those_of_the_events() -> None:
    run = simulate(scenes.load("case_03"), grid=np.linspace(0.0, 20.0, 20001))

    class Recorded:
        t, impacts = run.t, run.impacts

    exact, seen = (np.array(contact_spans(motion, LEFT)) for motion in (run, Recorded()))
    assert exact == pytest.approx(seen, abs=2e-3)


def test_what_is_refused(tmp_path: Path) -> None:
    run = simulate(scenes.load("case_01"))
    with pytest.raises(Refused, match=r"^span: 1.0 after 2.0 is not allowed"):
        plots.draw(run, tmp_path / "a.png", span=(2.0, 1.0))
    for grid in ([], [1.0], [1.0, 1.0]):
        with pytest.raises(Refused, match="fewer than two output times"):
            plots.draw(simulate(scenes.load("case_01"), grid=grid), tmp_path / "a.png", "")


DRAWN = """
import sys
from pathlib import Path
from grasp_ros import scene
from grasp_ros.simulation import plots, simulate
plots.draw(simulate(scene.load("case_01", "time.duration_s=1")), sys.argv[1], "a caption", width_mm=90.0)
assert "matplotlib.pyplot" not in sys.modules
"""


@pytest.mark.slow
@pytest.mark.thorough
def test_settings_of_others_change_no_pixel(tmp_path: Path) -> None:
    wild, broken = tmp_path / "wild", tmp_path / "broken"
    wild.write_text("savefig.bbox: tight\ntext.usetex: True\nfont.size: 30\naxes.grid: True\n")
    broken.write_bytes(b"\xff\xfe\x00")
    pictures = []
    for k, settings in enumerate(({}, {"MATPLOTLIBRC": str(wild)}, {"MATPLOTLIBRC": str(broken)},
                                  {"MPLBACKEND": "module://matplotlib_inline.backend_inline"})):
        path = tmp_path / f"{k}.png"
        subprocess.run([sys.executable, "-c", DRAWN, str(path)], env={**os.environ, **settings}, check=True)
        pictures.append(path.read_bytes())
    assert len(set(pictures)) == 1

"""Runs as data sets, frames and text files, and as what a notebook shows."""

from __future__ import annotations

import csv
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from documents import case_of

import grasp_ros as gr
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import progress, simulate
from grasp_ros.simulation.tables import COLUMNS


def test_a_data_set_has_names_and_units_as_attributes() -> None:
    run = simulate(case_of())
    data = run.dataset()
    assert data.sizes == {"t": len(run.t)}
    assert data["x_object"].attrs == {"units": "m", "long_name": "position of the object mass"}
    assert data["t"].attrs["units"] == "s"
    assert data.attrs["scene"] == "case_01"
    assert data["x_object"].values.tobytes() == run.state[:, 2].tobytes()
    assert float(data["impact_left"].sel(t=run.t[50])) == run.impacts[50, 0]
    assert set(data) == {column.name for column in COLUMNS}


def test_a_frame_and_a_text_file_hold_the_same_numbers(tmp_path: Path) -> None:
    run = simulate(case_of(), sampled=True)
    frame = run.dataframe()
    assert frame.index.name == "t"
    assert frame.attrs["units"]["v_left"] == "m/s"
    run.to_csv(tmp_path / "run.csv")
    rows = list(csv.DictReader((tmp_path / "run.csv").read_text().splitlines()))
    assert list(rows[0])[:3] == ["t_s", "x_left_m", "v_left_m_per_s"]
    assert np.array([float(row["v_left_m_per_s"]) for row in rows]).tobytes() == frame["v_left"].to_numpy().tobytes()
    assert len(rows) == len(run.t)


def test_without_the_packages_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    run = simulate(case_of(), grid=np.zeros(1))
    for name, call in (("xarray", run.dataset), ("pandas", run.dataframe)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(Refused, match=f"needs {name}; pip install {name}"):
            call()


def test_a_notebook_shows_a_run_and_a_scene() -> None:
    shown = simulate(case_of())._repr_html_()
    assert "reached the end of the horizon" in shown
    assert "<img src='data:image/png;base64," in shown
    assert "<img" not in simulate(case_of(), grid=[1.0])._repr_html_()
    assert "hertz_N_per_m1_5: 10000.0" in case_of()._repr_html_()
    assert repr(case_of()) == f"<Scene {case_of().name}: {case_of().title}>"
    bad = gr.compose("<b>", case_of().values)
    assert "<b>" not in bad._repr_html_() + simulate(bad)._repr_html_()


def test_a_bar_is_drawn_only_where_somebody_looks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "DELAY_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    simulate(case_of(), progress=True)
    assert capsys.readouterr().err == ""  # no terminal
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    simulate(case_of(), progress=True)
    assert "case_01: 100%" in capsys.readouterr().err
    for name, value in (("TERM", "dumb"), ("NO_COLOR", "1")):
        with monkeypatch.context() as inner:
            inner.setenv(name, value)
            simulate(case_of(), progress=True)
            assert capsys.readouterr().err == ""


def test_what_is_public_is_there() -> None:
    for name in gr.__all__:
        assert getattr(gr, name) is not None
        assert name in dir(gr)
    assert gr.__version__ == version("grasp_ros")
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        gr.nothing  # noqa: B018

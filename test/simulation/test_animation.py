"""Moving pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from documents import case_of
from PIL import Image

from grasp_ros import scene
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate
from grasp_ros.simulation.animation import RATE, animate


@pytest.mark.slow
def test_a_gif_has_a_picture_for_each_part_of_a_second(command: Any, tmp_path: Path) -> None:
    words = ("plot", "case_01", "--animate", "--from", "0.3", "--to", "0.6", "--speed", "0.5", "--width", "80")
    result = command(*words)
    assert result.returncode == 0, result.stderr
    with Image.open(tmp_path / "case_01.gif") as picture:
        assert picture.n_frames == round(0.3 / 0.5 * RATE) + 1
        picture.seek(picture.n_frames - 1)
    assert command(*words).returncode == 2  # it is there
    assert command("plot", "case_01", "case_02", "--animate").returncode == 2


def test_a_page_has_its_pictures_inside_and_bodies_may_be_absent(tmp_path: Path) -> None:
    run = simulate(scene.load("hammer"))
    animate(run, tmp_path / "hit.html", span=(0.4, 0.5), width_mm=60.0)
    text = (tmp_path / "hit.html").read_text()
    assert text.count("data:image/png;base64,") == 3
    assert [path.name for path in tmp_path.iterdir()] == ["hit.html"]


@pytest.mark.parametrize(("name", "how", "sentence"), [
    ("a.png", {}, r"a\.png: \.png is not allowed; allowed: \.gif, \.html"),
    ("a", {}, "needs an ending"),
    ("a.gif", {"speed": 0.0}, "speed: 0.0 is not allowed"),
    ("a.gif", {"speed": 1e-4}, "pictures; allowed: at most"),
    ("no/a.gif", {"span": (0.0, 0.05)}, "cannot be written: No such file"),
])
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, name: str, how: dict[str, Any], sentence: str) -> None:
    with pytest.raises(Refused, match=sentence):
        animate(simulate(case_of()), tmp_path / name, **how)
    assert not list(tmp_path.iterdir())

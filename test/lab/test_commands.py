"""The commands of `python -m lab`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow  # whole studies, though quick ones


def test_page_quick_has_all_sections_and_figures(lab_command: Any, tmp_path: Path) -> None:
    result = lab_command("accuracy", "--quick", "--docs", "docs", "-o", "journal")
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "docs" / "accuracy.md").read_text()
    for title in ("Which method", "What the paper's method costs", "Energy in the elastic case", "over topics",
                  "Where the time goes", "Run times of other methods"):
        assert title in text
    shown = [part.split(")")[0] for part in text.split("](accuracy/")[1:]]
    assert len(shown) == 7
    assert all((tmp_path / "docs" / "accuracy" / name).stat().st_size > 1000 for name in shown)
    assert "275.0566374 ms" in text


@pytest.mark.thorough
def test_maps_quick_writes_its_page_and_figures(lab_command: Any, tmp_path: Path) -> None:
    for _ in range(2):  # the second time from what is there
        result = lab_command("maps", "--quick", "--docs", "docs", "-o", "runs")
        assert result.returncode == 0, result.stderr
    text = (tmp_path / "docs" / "maps.md").read_text()
    for title in ("When the grasp of case 3 settles", "Control period, delay and noise", "Robustness"):
        assert title in text
    for name in ("settling", "limits", "robustness"):
        assert (tmp_path / "docs" / "maps" / f"{name}.png").stat().st_size > 1000

"""The page of random scenes, and the journal from which a search goes on."""

from __future__ import annotations

from pathlib import Path

import pytest

from grasp_ros.physics.errors import Refused
from lab.drills import fuzz
from lab.oracles.properties import Check, Examination

CHECKS = [Check("energy", 3.0, 100.0, skipped=2), Check("mirror", 1.0, 0.0)]


@pytest.fixture
def examined(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Titles of the scenes that were examined; every third one fails."""
    titles: list[str] = []

    def examine(scene: object, **_: object) -> Examination:
        titles.append(str(scene))
        return Examination("reached the end of the horizon", CHECKS[: 2 if len(titles) % 3 == 0 else 1])

    monkeypatch.setattr(fuzz, "examine", examine)
    return titles


def search(directory: Path, draws: int, seed: int = 5) -> str:
    """The page after a search."""
    book = fuzz.run(seed, directory, draws=draws, first=10, memory=fuzz.Kept(directory, seed))
    fuzz.write_page(directory, seed, 10, book)
    return (directory / "fuzz.md").read_text(encoding="utf-8")


def test_a_page_is_the_same_whether_or_not_a_search_was_interrupted(tmp_path: Path, examined: list[str]) -> None:
    whole = search(tmp_path / "whole", 120)
    assert len(examined) == 120
    examined.clear()
    search(tmp_path / "parts", 100)
    assert search(tmp_path / "parts", 120) == whole
    assert len(examined) == 120
    assert search(tmp_path / "parts", 120) == whole
    assert len(examined) == 120


def test_a_page_says_what_was_counted(tmp_path: Path, examined: list[str]) -> None:
    text = search(tmp_path, 9)
    assert len(examined) == 9
    assert "3 of 9 scenes fail." in text
    assert "| energy | 9 | 18 | 0 | 3 | 10 |" in text
    assert "| mirror | 3 | 0 | 3 | 1 | 12 |" in text
    assert "| `--seed 5 --first 12 --draws 1` | mirror 1 |" in text
    assert "| 9 | reached the end of the horizon |" in text


def test_another_seed_is_another_search(tmp_path: Path, examined: list[str]) -> None:
    search(tmp_path, 9)
    search(tmp_path, 9, seed=6)
    assert len(examined) == 18


def test_a_damaged_journal_is_refused(tmp_path: Path, examined: list[str]) -> None:
    search(tmp_path, 9)
    journal = tmp_path / "journal.jsonl"
    journal.write_text(journal.read_text().replace("horizon", "horizont"))
    with pytest.raises(Refused, match="checksum"):
        search(tmp_path, 9)

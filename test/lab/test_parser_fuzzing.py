"""Damaged files against every reader; `python -m lab readers` tries as many as one wants."""

from __future__ import annotations

import resource
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros.graph.bag import recorder
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import Parameter
from lab.drills import parser_fuzzing as readers


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("place")


@pytest.fixture(scope="module")
def all_readers(place: Path) -> list[readers.Reader]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "FLUSH_SECONDS", 600.0)  # on a machine that is busy a bag has no more chunks
        return readers.all_readers(place)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(4))
def test_damaged_files_break_no_reader(
    all_readers: list[readers.Reader], place: Path, tmp_path: Path, number: int
) -> None:
    answers = [readers.attempt(all_readers, place, 1, k, tmp_path)[:2] for k in range(number, 400, 4)]
    assert {reader for reader, _ in answers} == {all_readers[number].name}
    assert {answer for _, answer in answers} == {"accepted", "refused"}
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [6398, 37822, 87690, 95138])
def test_a_bag_whose_last_list_is_none_is_not_recovered_as_one(
    all_readers: list[readers.Reader], place: Path, tmp_path: Path, number: int
) -> None:
    assert readers.attempt(all_readers, place, 77, number, tmp_path)[:2] == ("bag", "refused")


def test_a_reader_that_breaks_is_seen(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def hang(*_: Any) -> None:
        while True:
            time.sleep(0.01)

    def differ(*_: Any) -> None:
        raise readers.Broken("x is 1, not 2")

    def fault(*_: Any) -> None:
        raise KeyError("x")

    def words(*_: Any) -> None:
        raise Refused("a\nb")

    monkeypatch.setattr(readers, "SECONDS", 0.05)
    seen = {
        readers.attempt([readers.Reader("a", lambda _: b"content", read)], place, 0, 0, tmp_path)[1]
        for read in (hang, differ, fault, words)
    }
    assert seen == {"hangs", "accepted although x is 1, not 2", "KeyError", "refused in no sentence"}
    assert (tmp_path / "a_0_0").read_bytes() == b"content"


def test_a_silent_acceptance_is_seen(
    all_readers: list[readers.Reader], place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readers that leave out a check are found by the study's comparisons."""
    right = Parameter.read

    def doubled(parameter: Parameter, value: Any) -> Any:
        return 2.0 * right(parameter, value) if parameter.key == "mass_kg" else right(parameter, value)

    monkeypatch.setattr(Parameter, "read", doubled)
    answers = {readers.attempt(all_readers, place, 0, number, tmp_path)[1] for number in range(0, 160, 4)}
    assert any("mass_kg is" in answer for answer in answers), answers


def test_the_same_number_is_the_same_file(all_readers: list[readers.Reader]) -> None:
    for reader in all_readers[:2] + all_readers[3:]:
        assert reader.make(np.random.default_rng(5)) == reader.make(np.random.default_rng(5))


def test_the_command_prints_what_came_of_it(lab_command: Any) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    result = lab_command("readers", "--count", "8")
    assert result.returncode == 0, result.stderr
    assert resource.getrlimit(resource.RLIMIT_AS) == before  # other tests of this process start programs
    lines = result.stdout.splitlines()
    assert [line.split()[:3] for line in lines] == [
        [name, "2", "files:"] for name in ("scene", "result", "bag", "journal")
    ]

"""When a node says that it stands, on a clock that the test sets."""

from __future__ import annotations

from typing import Any

import pytest

from grasp_ros.graph.health import heartbeat
from grasp_ros.graph.health.heartbeat import EVERY_SECONDS, HEARTBEAT_SECONDS, Watchdog

PATIENCE, LAW_PATIENCE = 2.1, 60.0


class Clock:
    """The wall time that a watchdog sees, and the nodes that were stopped."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, ends: bool) -> None:
        self.now, self.frozen, self.ended = 100.0, ["/plant"], list[int]()
        monkeypatch.setattr(heartbeat.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(heartbeat.os, "_exit", self.ended.append)
        self.most: float | None = LAW_PATIENCE
        self.dog = Watchdog("monitor", PATIENCE, lambda: self.most, ends, lambda: self.frozen)

    def beat(self, times: int, seconds: float = HEARTBEAT_SECONDS) -> None:
        for _ in range(times):
            self.now += seconds
            self.dog.beat()


def test_a_process_that_stands_behind_a_stopped_one_says_so_and_ends(monkeypatch: Any, capsys: Any) -> None:
    clock = Clock(monkeypatch, ends=True)
    clock.beat(5)
    assert not clock.ended
    clock.beat(1)
    assert clock.ended == [1]
    assert capsys.readouterr().err == "[FATAL] [monitor]: blocked for 2.4 s: /plant suspended\n"


def test_one_that_waits_on_says_it_at_once_and_now_and_then(monkeypatch: Any, capsys: Any) -> None:
    clock = Clock(monkeypatch, ends=False)
    clock.beat(6)
    assert capsys.readouterr().err.count("blocked for") == 1
    clock.beat(int(2 * EVERY_SECONDS / HEARTBEAT_SECONDS) + 2)
    assert capsys.readouterr().err.count("blocked for") == 2
    assert not clock.ended


def test_its_own_sleep_is_no_standing(monkeypatch: Any, capsys: Any) -> None:
    clock = Clock(monkeypatch, ends=True)
    clock.beat(4)
    clock.beat(1, 3600.0)
    clock.beat(5)
    assert not clock.ended
    assert not capsys.readouterr().err


def test_a_law_that_does_not_return_has_longer(monkeypatch: Any, capsys: Any) -> None:
    clock = Clock(monkeypatch, ends=True)
    clock.frozen = []
    clock.beat(int(LAW_PATIENCE / HEARTBEAT_SECONDS) - 1)
    assert not clock.ended
    clock.beat(2)
    assert clock.ended
    assert f" s: in {heartbeat.__file__}, line " in capsys.readouterr().err  # where the thread of the nodes is
    clock.most = None
    clock.dog.feed()
    clock.ended.clear()
    clock.beat(1000)
    assert not clock.ended

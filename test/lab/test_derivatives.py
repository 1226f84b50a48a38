"""The page of derivatives: each table by itself, and the impact whose derivatives are known."""

from __future__ import annotations

from pathlib import Path

import pytest

from grasp_ros.physics.errors import Refused
from lab.studies import derivatives, pages, peer_derivatives


def test_derivatives_of_the_impact_that_peers_differentiate() -> None:
    (row,) = peer_derivatives._ours()
    assert peer_derivatives.exact()[0] * 0.3 == pytest.approx(0.3 * 0.83286979226560167, rel=1e-15)
    assert max(row.value, *row.by) <= 1e-13


def test_a_peer_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer_derivatives, "PACKAGES", ("numpy", "no_such_solver"))
    with pytest.raises(Refused, match=r"this needs no_such_solver; pip install"):
        peer_derivatives.run()


def test_one_table_is_written_and_the_rest_stays(tmp_path: Path) -> None:
    before = (pages.HOME / "docs" / derivatives.PAGE).read_text("utf-8")
    after = derivatives.write(tmp_path, {derivatives.PEERS: "| new |"}).read_text("utf-8")
    mark = "<!-- peers -->"
    assert after.split(mark)[1].strip() == f"| new |\n\n{pages.stamp()}"
    assert after.split(mark)[::2] == before.split(mark)[::2]
    assert derivatives.write(tmp_path, {derivatives.RANDOM: "x"}).read_text("utf-8").count("| new |") == 0

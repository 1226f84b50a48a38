"""docs/examples: short scripts, each of which leaves a figure."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.py"))
LINES = 25


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_leaves_its_figure(path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert len(source.splitlines()) <= LINES
    monkeypatch.chdir(tmp_path)
    found: dict[str, object] = {}
    try:
        exec(compile(source, path.name, "exec"), found)
    finally:
        plt.close("all")
    [figure] = tmp_path.iterdir()
    assert figure.stem == path.stem
    with Image.open(figure) as picture:
        assert min(picture.size) > 300
        assert len(set(np.asarray(picture.convert("L")).ravel().tolist())) > 10
    if path.stem == "restitution":
        assert np.abs(np.subtract(found["measured"], found["exact"])).max() < 1e-9

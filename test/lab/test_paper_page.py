"""`python -m lab paper` from the command line to a real browser."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.simulation import simulate
from lab.__main__ import main

pytestmark = pytest.mark.slow  # the whole study, with few random starts

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
A4 = 718  # px, the width of the sheet of paper less the margins of the browser
CONTENT = (
    "The answer", "Judgement", "Replay", "Figures 2 to 12", "Quantities", "Equations (1) to (37)",
    "What the paper could not show",
    "Doubts about the source", "Definitions",
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("paper")
    assert main(["paper", "--quick", "-o", str(directory / "page.html"), "--docs", str(directory / "docs")]) == 0
    return directory


def test_a_place_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["paper", "-o", str(tmp_path / "file" / "page.html")]) == 2
    assert "grasp: " in capsys.readouterr().err


def test_the_page_needs_nothing_else(made: Path) -> None:
    text = (made / "page.html").read_text(encoding="utf-8")
    for title in CONTENT:
        assert f">{title}</h2>" in text
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"', text)
    assert "@import" not in text
    assert all(f'id="{key}"' in text for key in ("O1", "O12", "C3", "T12", "fig2", "fig12"))
    runs = json.loads(re.findall(r'<script id="runs" type="application/json">(.*?)</script>', text, re.S)[0])
    assert len(runs) == 11


def test_the_version_for_the_documentation_shows_every_figure(made: Path) -> None:
    text = (made / "docs" / "paper.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"\]\(paper/([^)]+)\)", text))
    lying = {path.name for path in (made / "docs" / "paper").iterdir()}
    assert shown == lying
    assert len(shown) >= 11 + 1 + 7
    assert all(f"## {title}" in text for title in CONTENT if title != "Replay")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(widths) == 1, table


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright; pip install 'grasp_ros[test]'")
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"needs a Chromium on the path: one of {', '.join(NAMES)}")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(params=[400, 1200])
def page(request: pytest.FixtureRequest, browser: Any, made: Path) -> Iterator[Any]:
    """The page in a window; nothing is fetched, nothing is said on the console."""
    opened = browser.new_page(viewport={"width": request.param, "height": 800})
    said: list[str] = []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda asked: said.append(asked.url) if not asked.url.startswith(("file:", "data:")) else None)
    opened.goto((made / "page.html").as_uri())
    opened.wait_for_selector("#mass-left")
    yield opened
    assert said == []
    opened.close()


def place(page: Any, name: str) -> float:
    return float(page.get_attribute(f"#mass-{name}", "data-x"))


def test_the_slider_moves_the_masses_to_the_states_of_the_run(page: Any) -> None:
    for case, frame in ((0, 40), (2, 700), (8, 1500)):
        page.select_option("#case", str(case))
        page.locator("#slider").evaluate(
            "(slider, frame) => { slider.value = frame; slider.dispatchEvent(new Event('input')); }", frame
        )
        row = page.evaluate(
            """([place, frame]) => {
              const run = JSON.parse(document.getElementById('runs').textContent)[place];
              const bytes = Uint8Array.from(atob(run.data), (c) => c.charCodeAt(0));
              const width = run.columns.length;
              return Array.from(new Float32Array(bytes.buffer).slice(frame * width, (frame + 1) * width));
            }""", [case, frame],
        )
        scene = scenes.load(f"case_{case + 1:02d}")
        state = simulate(scene, grid=np.array([row[0]])).state[0]
        moving = np.abs(state[1::2]).max() * np.spacing(np.float32(row[0]))  # the time is in single precision
        found = [place(page, name) for name in ("left", "object", "right")]
        assert found == pytest.approx(state[0::2].tolist(), abs=1e-7 + moving)
        boxes = [page.locator(f"#mass-{name}").bounding_box() for name in ("left", "object", "right")]
        middle = boxes[1]["x"] + boxes[1]["width"] / 2.0
        assert boxes[0]["x"] < middle < boxes[2]["x"] + boxes[2]["width"]


def test_it_plays_and_slows_down_in_contact(page: Any) -> None:
    page.select_option("#speed", "2")
    page.click("#play")
    page.wait_for_function("document.getElementById('slider').value > 5")
    page.wait_for_function("document.getElementById('readout').textContent.match(/fw [1-9]/)", timeout=20_000)
    assert page.inner_text("#play") == "pause"
    page.click("#play")
    stopped = page.input_value("#slider")
    page.click("#forth")
    assert int(page.input_value("#slider")) == int(stopped) + 1


def test_it_is_legible_on_a_phone_and_in_print(page: Any) -> None:
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    for selector in ("p", "td", "summary", "#readout", ".controls label"):
        size = page.locator(selector).first.evaluate("each => parseFloat(getComputedStyle(each).fontSize)")
        assert size >= 12.0, selector
    text = page.locator("#stage text").first
    assert text.bounding_box()["height"] >= 10.0
    page.emulate_media(media="print")
    assert not page.is_visible("#replay")
    assert page.is_visible("#equations")
    page.set_viewport_size({"width": A4, "height": 800})
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    ends = page.evaluate(
        "Array.from(document.querySelectorAll('table, img'), (each) => each.getBoundingClientRect().right)"
    )
    assert max(ends) <= A4

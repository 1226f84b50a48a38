"""`python -m lab paper` from the command line to a real browser."""

from __future__ import annotations

import csv
import html
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

pytestmark = [pytest.mark.slow, pytest.mark.thorough]  # the whole study, with few random starts

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
A4, WIDE = 695, 1031  # px, the width of a sheet of paper less its margins, upright and across
LARGEST = 4_000_000  # bytes of the page
MOST_WORDS = 2_600  # of the version for the documentation
PAGES = 15  # of a print
SIGNS = {"holds": "\u2713", "holds within stated limits": "~", "does not hold": "\u2717"}
CONTENT = (
    "The answer", "Judgement", "Replay", "Figures 2 to 12", "Quantities", "Equations (1) to (37)",
    "What the paper could not show",
    "Uncertainties in the source", "Definitions",
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
    assert all(f'id="{key}"' in text for key in ("P1", "P12", "C3", "T12", "fig2", "fig12"))
    runs = json.loads(re.findall(r'<script id="runs" type="application/json">(.*?)</script>', text, re.S)[0])
    assert len(runs) == 11
    assert len(text.encode()) < LARGEST


def test_every_check_is_folded_below_its_statement(made: Path) -> None:
    text = (made / "page.html").read_text(encoding="utf-8")
    judgement = text.split('<section id="judgement">')[1].split("</section>")[0]
    folded = re.findall(r"<details>\s*<summary>(\d+) checks</summary>(.*?)</details>", judgement, re.S)
    assert [int(number) for number, _ in folded] == [table.count("<tr><td>") for _, table in folded]
    assert sum(int(number) for number, _ in folded) > 500
    assert "<table" not in re.sub(r"<details>.*?</details>", "", judgement, flags=re.S).split("</table>", 1)[1]


def test_the_first_screen_says_every_verdict_as_the_table_does(made: Path) -> None:
    text = (made / "page.html").read_text(encoding="utf-8")
    grid = re.findall(r'<li><a class="\w+" href="#(\w+)" aria-label="\w+ ([a-z ]+)"[^>]*>\w+ (.)</a></li>', text)
    table = re.findall(r'<tr><td><a href="#(\w+)">\w+</a></td>.*?&nbsp;([a-z ]+)</td></tr>', text, re.S)
    assert [(key, verdict) for key, verdict, _ in grid] == table
    assert len(grid) == 27
    assert all(sign == SIGNS[verdict] for _, verdict, sign in grid)


def test_every_figure_has_a_verdict(made: Path) -> None:
    text = (made / "page.html").read_text(encoding="utf-8")
    rows = re.findall(r'<tr id="fig(\d+)">(.*?)</tr>', text, re.S)
    assert [int(number) for number, _ in rows] == list(range(2, 13))
    assert [number for number, row in rows if "does not agree: input axis" in row] == ["10"]


def test_the_version_for_the_documentation_shows_every_figure(made: Path) -> None:
    text = (made / "docs" / "paper.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"\]\(paper/([^)]+)\)", text))
    lying = {path.name for path in (made / "docs" / "paper").iterdir()}
    assert shown == lying
    assert len(shown) >= 11 + 1 + 7
    assert all(f"## {title}" in text for title in CONTENT if title not in ("Replay", "Quantities", "Definitions"))
    assert len(text.split()) < MOST_WORDS
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(widths) == 1, table


@pytest.fixture(scope="module")
def rows(made: Path) -> dict[str, list[dict[str, str]]]:
    """The table beside the version for the documentation, by sections."""
    found: dict[str, list[dict[str, str]]] = {}
    with (made / "docs" / "paper.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            found.setdefault(row["section"], []).append(row)
    return found


def test_a_verdict_is_that_of_the_weakest_part(made: Path, rows: dict[str, list[dict[str, str]]]) -> None:
    text = (made / "docs" / "paper.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| (\w+) \| .* \| \*\*([a-z ]+)\*\* \| (.*) \|$", text, re.M)
    verdicts = {key: verdict for key, verdict, _ in lines}
    page = (made / "page.html").read_text(encoding="utf-8")
    assert verdicts == dict(re.findall(r'href="#(\w+)" aria-label="\w+ ([a-z ]+)"', page))
    assert len(lines) == 27
    for key, verdict, part in lines:
        own = {row["statement"]: row for row in rows["statements"]
               if row["number"].startswith(f"{key}.") and not row["statement"].startswith("Read as")}
        assert min((row["verdict"] for row in own.values()), key=list(reversed(SIGNS)).index) == verdict
        if part in ("as P1", "as P8"):
            assert verdicts[part.removeprefix("as ")] == verdict
        elif verdict == "holds":
            assert any(f") {part}" in row["note"] for row in own.values())
        else:
            weakest = own[part.split("*")[1]]
            assert weakest["verdict"] == verdict
            assert weakest["found"]


def test_the_table_has_all_rows_of_the_page(made: Path, rows: dict[str, list[dict[str, str]]]) -> None:
    page = html.unescape((made / "page.html").read_text(encoding="utf-8"))
    sections = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', page, re.S))
    lines = {name: re.findall(r"<tr>(?:<td.*?)</tr>", text, re.S) for name, text in sections.items()}
    cells = {name: [re.findall(r"<td[^>]*>(.*?)</td>", line, re.S) for line in found] for name, found in lines.items()}
    checks = [[row[head] for head in ("note", "statement", "found", "verdict")] for row in rows["checks"]]
    assert checks == [line for line in cells["judgement"] if len(line) == 4]
    assert len(checks) > 500
    readings = [[row[head] for head in ("note", "statement", "allowed", "found", "verdict")] for row in rows["figures"]]
    assert readings == [line for line in cells["figures"] if len(line) == 5]
    assert [row["number"] for row in rows["equations"]] == [line[0] for line in cells["equations"] if len(line) == 8]
    assert [row["statement"] for row in rows["quantities"]] == [line[0] for line in cells["quantities"]]
    titles = re.findall(r"<h3>(.*?)</h3>\s*<p>(.*?)</p>", sections["beyond"], re.S)
    results = [row for row in rows["results"] if row["statement"]]
    assert [(row["statement"], row["note"]) for row in results] == titles
    assert len(rows["results"]) - len(results) == len(cells["beyond"])
    for name in ("uncertainties", "definitions"):
        told = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", sections[name], re.S)
        assert [(row["statement"], row["note"]) for row in rows[name]] == told


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
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
        time = page.evaluate(
            """([place, frame]) => {
              const run = JSON.parse(document.getElementById('runs').textContent)[place];
              return new Float32Array(Uint8Array.from(atob(run.data), (c) => c.charCodeAt(0)).buffer)[frame];
            }""", [case, frame],
        )
        state = simulate(scenes.load(f"case_{case + 1:02d}"), grid=np.array([time])).state[0]
        found = [place(page, name) for name in ("left", "object", "right")]
        assert found == pytest.approx(state[0::2].tolist(), rel=1e-7, abs=1e-12)
        shown = [page.inner_text(f"#now-x_{letter}").replace("\u2212", "-") for letter in "lor"]
        assert list(map(float, shown)) == pytest.approx([1e3 * x for x in found], abs=0.051)
        boxes = [page.locator(f"#mass-{name}").bounding_box() for name in ("left", "object", "right")]
        middle = boxes[1]["x"] + boxes[1]["width"] / 2.0
        assert boxes[0]["x"] < middle < boxes[2]["x"] + boxes[2]["width"]


def test_it_plays_and_slows_down_in_contact(page: Any) -> None:
    page.select_option("#speed", "2")
    page.click("#play")
    page.wait_for_function("document.getElementById('slider').value > 5")
    page.wait_for_function("Number(document.getElementById('now-fw_r').textContent) >= 1", timeout=20_000)
    assert page.inner_text("#play") == "pause"
    page.click("#play")
    stopped = page.input_value("#slider")
    page.click("#forth")
    assert int(page.input_value("#slider")) == int(stopped) + 1


def test_case_1_plays_in_30_s_and_in_slow_motion_on_request(page: Any) -> None:
    assert 20.0 / float(page.input_value("#speed")) == pytest.approx(30.0, rel=0.01)
    assert not page.is_checked("#slow")


def test_keys_play_and_step(page: Any) -> None:
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    assert page.input_value("#slider") == "1"
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "pause"
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "play"
    page.focus("#play")
    before = int(page.input_value("#slider"))
    page.keyboard.press("ArrowRight")
    assert int(page.input_value("#slider")) == before + 1


def test_less_motion_is_a_picture_a_second(page: Any) -> None:
    page.emulate_media(reduced_motion="reduce")
    page.click("#play")
    changes = page.evaluate("""() => new Promise((done) => {
      const seen = new Set(), begin = performance.now();
      const look = () => {
        seen.add(document.getElementById("mass-right").dataset.x);
        if (performance.now() - begin < 600) requestAnimationFrame(look); else done(seen.size);
      };
      look();
    })""")
    assert changes <= 2
    assert page.inner_text("#play") == "pause"


def test_one_screen_shows_every_verdict(page: Any) -> None:
    boxes = [each.bounding_box() for each in page.locator(".grid a").all()]
    assert len(boxes) == 27
    assert max(box["y"] + box["height"] for box in boxes) <= page.viewport_size["height"]


def test_a_switch_shows_single_figures_and_sheets_of_16_to_9(page: Any) -> None:
    assert page.is_visible(".sheet img")
    assert not page.is_visible(".one >> nth=0")
    page.check("input[value=single]")
    assert page.locator(".one img >> visible=true").count() == 11
    assert not page.is_visible(".sheet img")
    page.check("input[value=slides]")
    for box in (each.bounding_box() for each in page.locator(".one").all()):
        assert box["width"] / box["height"] == pytest.approx(16.0 / 9.0, rel=0.01)


@pytest.mark.parametrize(("scheme", "view"), [("light", "all"), ("dark", "single"), ("light", "slides")])
def test_axe_finds_nothing(page: Any, scheme: str, view: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python")
    page.emulate_media(color_scheme=scheme)
    page.check(f"input[value={view}]")
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    found = axe.Axe().run(page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"][:200]) for each in found] == []


def test_it_is_legible_on_a_phone_and_in_print(page: Any) -> None:
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    for selector in ("p", "td", "summary", "#readout td", ".controls label"):
        size = page.locator(selector).first.evaluate("each => parseFloat(getComputedStyle(each).fontSize)")
        assert size >= 12.0, selector
    text = page.locator("#stage text").first
    assert text.bounding_box()["height"] >= 10.0


def test_a_print_has_no_checks_and_breaks_no_word(page: Any) -> None:
    page.emulate_media(media="print")
    assert not page.is_visible("#replay")
    assert page.is_visible("#equations")
    assert page.locator("details >> visible=true").count() == 0
    for width, within in ((A4, "section:not(#quantities)"), (WIDE, "#quantities")):
        page.set_viewport_size({"width": width, "height": 800})
        ends = page.locator(within).locator("table, img, p, li").evaluate_all(
            "all => all.map((each) => each.getBoundingClientRect().right)"
        )
        assert max(ends) <= width
    broken = page.evaluate("""Array.from(document.querySelectorAll("main *")).filter((each) => {
      const style = getComputedStyle(each);
      return style.overflowWrap !== "normal" || style.wordBreak !== "normal" || style.hyphens === "auto";
    }).length""")
    assert broken == 0
    pages = len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4", prefer_css_page_size=True)))
    assert pages <= PAGES

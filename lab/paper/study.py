"""`python -m lab paper`: everything computed in several processes, and put together into one report."""

from __future__ import annotations

import io
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import PIL.Image
from tqdm import tqdm

from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.simulation import canvas, simulate
from lab.paper import arms, beyond, beyond_figures, figures
from lab.paper.cases import FIGURES, UNIT_OF, Cases, Figure, Start, load_cases, random_starts, start_of, value_of
from lab.paper.claims import Claim
from lab.paper.compare import Comparison
from lab.paper.equations import equations
from lab.paper.measures import MEASURES
from lab.paper.page import Picture, Report
from lab.paper.prints import LETTERS, compared
from lab.paper.results import Beyond, quantities, replays, uncertainties
from lab.paper.statements import STATEMENTS

RANDOM_STARTS = 200
DPI = 220
COLORS = 256  # of a PNG file
Jobs = dict[str, tuple[Any, ...]]  # by what comes out: what computes it, and of what


def report(starts: int) -> Report:
    """Compute everything, with so many random starts."""
    cases, drawn = load_cases(), random_starts(starts)
    jobs, drawings, claims, done = _jobs(cases, drawn), _drawings(cases), [], {}
    context = multiprocessing.get_context("spawn")
    with context.Pool(os.cpu_count() or 1) as pool, tqdm(total=len(STATEMENTS) + len(jobs), file=sys.stderr) as bar:
        asked = {key: pool.apply_async(function, of) for key, (function, *of) in jobs.items()}
        pictured = {key: pool.apply_async(image, of) for key, of in drawings.items()}
        for each in STATEMENTS.values():  # here: what one measures the next one remembers
            bar.set_description(f"random starts and sweeps of {each.key}")
            claims.append(each.judge(cases, drawn))
            bar.update()
        bar.set_description("figures, what the paper lacks")
        for key, answer in asked.items():
            done[key] = answer.get()
            bar.update()
        found = Beyond(**{key: done.pop(key) for key in Beyond._fields})
        own = {key: (getattr(beyond_figures, key), numbers) for key, numbers in found._asdict().items()}
        pictured |= {key: pool.apply_async(image, of) for key, of in own.items() if key not in pictured}
        images = {key: answer.get() for key, answer in pictured.items()}
    images["sweeps"] = image(beyond_figures.sweeps, _curves(cases, claims))
    pictures = [picture(figure, cases, claims) for figure in FIGURES]
    return Report(starts, claims, pictures, found=found, images=images, **done)


def _jobs(cases: Cases, drawn: list[Start]) -> Jobs:
    """What the paper lacks, the longest first, and the tables of the page."""
    return {
        "chaos": (beyond.chaos, cases), "stiffer": (arms.stiffer, cases, drawn),
        "damped": (arms.damped, cases, drawn), "gap": (beyond.gap, cases), "tail": (beyond.tail, cases[1]),
        "stepped": (arms.stepped, cases), "edge": (beyond.knife_edge, cases), "equations": (equations, cases),
        "quantities": (quantities, cases), "uncertainties": (uncertainties, cases), "replays": (replays, cases),
    }


def _drawings(cases: Cases) -> Jobs:
    """Figures that simulate what they show."""
    return {"sheet": (figures.sheet, cases), "stepped": (beyond_figures.stepped, cases),
            **{f"fig_{each.number:02d}": (figures.large, each, cases) for each in FIGURES}}


def image(draw: Callable[..., Any], *of: Any) -> bytes:
    """What is drawn as a PNG file with a palette, which is a third as large."""
    drawing, large, small = draw(*of), io.BytesIO(), io.BytesIO()
    with canvas.style(figures.STYLE):
        drawing.savefig(large, format="png", dpi=DPI)
    with PIL.Image.open(large) as picture:
        few = picture.convert("RGB").quantize(COLORS, PIL.Image.Quantize.FASTOCTREE, dither=PIL.Image.Dither.NONE)
        few.save(small, format="png", optimize=True)
    return small.getvalue()


def picture(figure: Figure, cases: Cases, claims: Sequence[Claim]) -> Picture:
    """Caption of a figure: parameters, start, touches; the readings of its scene, and what the print says."""
    scene = cases[figure.case]
    run = simulate(scene)
    left, right = (len(run.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
    values = ", ".join(f"{letter} = {value_of(scene, letter):g}" for letter in LETTERS)
    x_l, x_r, x_o = start_of(scene)
    both = "" if (run.energy.V_c == run.energy.V).all() else " and V, where they differ"
    caption = (
        f"{values} (SI units, both sides). At rest from x_l = {x_l:g}, x_o = {x_o:g}, x_r = {x_r:g} m. {left}"
        f" touches on the left, {right} on the right. Below the paper's two panels: impact forces, V_c{both}, and the"
        " energy lost so far by cause; beside them the contact with the fastest approach, from the dense output."
    )
    readings = [each for each in scene.readings if "control period" not in each]
    return Picture(figure.number, figure.title, caption, readings, compared(figure, cases, claims))


def _curves(cases: Cases, claims: Sequence[Claim]) -> list[beyond_figures.Curve]:
    """The sweeps behind the comparisons of the observations, each once."""
    found: dict[Any, beyond_figures.Curve] = {}
    for claim in claims:
        for part, judged in zip(STATEMENTS[claim.key].parts, claim.parts, strict=True):
            if claim.key.startswith("P") and isinstance(part, Comparison) and part.values:
                unit = UNIT_OF[part.letter[:2].rstrip("_")]
                found.setdefault((part.letter, part.measure, part.others[0]), beyond_figures.Curve(
                    f"{claim.key} {part.changed}", f"{part.letter}, {unit}", f"{MEASURES[part.measure].short}, ratio",
                    value_of(part.changed.scene(cases), part.letter), part.higher, judged.curve))
    return list(found.values())

"""`python -m lab paper`: everything computed in several processes, and put together into one report."""

from __future__ import annotations

import io
import multiprocessing
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import PIL.Image
from tqdm import tqdm

from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.scene.versions import versions
from grasp_ros.simulation import canvas, simulate
from lab.paper import arms, beyond, beyond_figures, figures
from lab.paper.answer import answer
from lab.paper.cases import (
    FIGURES,
    SYMMETRIC,
    UNIT_OF,
    Cases,
    Figure,
    Start,
    load_cases,
    random_starts,
    started,
    value_of,
)
from lab.paper.claims import Claim
from lab.paper.compare import Comparison, Variant
from lab.paper.definitions import PRINTS, SUBTITLE, SWEEPS, TITLE, definitions
from lab.paper.doubts import doubts
from lab.paper.equations import equations
from lab.paper.knife_edge import knife_edge
from lab.paper.measures import SHORT
from lab.paper.page import Picture, Report, agreement, summary
from lab.paper.prints import compared
from lab.paper.quantities import quantities
from lab.paper.replay import replay
from lab.paper.results import Beyond, results
from lab.paper.statements import STATEMENTS

DPI = 220
COLORS = 256  # of a PNG file
Job = tuple[str, Callable[..., Any], tuple[Any, ...]]  # what comes out, how, and of what


def report(starts: int) -> Report:
    """Compute everything, with so many random starts."""
    cases, drawn = load_cases(), random_starts(starts)
    jobs = _jobs(cases, drawn)
    claims: list[Claim] = []
    done: dict[str, list[Any]] = {}
    context = multiprocessing.get_context("spawn")
    with context.Pool(os.cpu_count() or 1) as pool, tqdm(total=len(STATEMENTS) + len(jobs), file=sys.stderr) as bar:
        drawing = pool.imap_unordered(_called, jobs)
        for each in STATEMENTS.values():  # here: what one measures the next one remembers
            bar.set_description(f"random starts and sweeps of {each.key}")
            claims.append(each.judge(cases, drawn))
            bar.update()
        bar.set_description("figures, what the paper lacks")
        for key, value in drawing:
            done.setdefault(key, []).append(value)
            bar.update()
    return _put_together(cases, claims, len(drawn), done)


def _called(job: Job) -> tuple[str, Any]:
    key, function, arguments = job
    return key, function(*arguments)


def _jobs(cases: Cases, drawn: list[Start]) -> list[Job]:
    """What can be computed at the same time, the longest first."""
    return [
        ("found", _further, ("chaos", beyond.chaos, (cases, started(cases[2], SYMMETRIC)), beyond_figures.chaos)),
        ("found", _further, ("stiffer", arms.stiffer, (cases, drawn), beyond_figures.stiffer)),
        ("found", _further, ("damped", arms.damped, (cases, drawn), beyond_figures.damped)),
        ("image", _sheet, (cases,)),
        ("equations", equations, (cases,)),
        *(("image", _large, (figure, cases)) for figure in FIGURES),
        ("found", _further, ("gap", beyond.gap, (cases,), beyond_figures.gap)),
        ("found", _further, ("tail", beyond.tail, (cases[1],), beyond_figures.tail)),
        ("found", _stepped, (cases,)),
        ("found", _further, ("edge", knife_edge, (cases,), beyond_figures.edge)),
        ("quantities", quantities, (cases,)),
        ("doubts", doubts, (cases,)),
        ("replays", _replays, (cases,)),
    ]


def image(drawing: Any) -> bytes:
    """A figure as a PNG file with a palette, which is a third as large."""
    large, small = io.BytesIO(), io.BytesIO()
    with canvas.style(figures.style()):
        drawing.savefig(large, format="png", dpi=DPI)
    with PIL.Image.open(large) as picture:
        few = picture.convert("RGB").quantize(COLORS, PIL.Image.Quantize.FASTOCTREE, dither=PIL.Image.Dither.NONE)
        few.save(small, format="png", optimize=True)
    return small.getvalue()


def _sheet(cases: Cases) -> tuple[str, bytes]:
    return "sheet", image(figures.sheet([figures.pictured(figure, cases) for figure in FIGURES]))


def _large(figure: Figure, cases: Cases) -> tuple[str, bytes]:
    return f"fig_{figure.number:02d}", image(figures.large(figures.pictured(figure, cases)))


def _further(
    key: str, compute: Callable[..., Any], arguments: tuple[Any, ...], draw: Callable[[Any], Any]
) -> tuple[str, Any, bytes]:
    """What the paper lacks, and its figure."""
    found = compute(*arguments)
    return key, found, image(draw(found))


def _stepped(cases: Cases) -> tuple[str, Any, bytes]:
    return "stepped", arms.stepped(cases), image(beyond_figures.stepped(cases))


def _replays(cases: Cases) -> list[dict[str, Any]]:
    return [replay(figure, cases[figure.case]) for figure in FIGURES]


def picture(figure: Figure, cases: Cases, claims: Sequence[Claim]) -> Picture:
    """Caption of a figure: parameters, start, touches; the readings of its scene, and what the print says."""
    scene = cases[figure.case]
    run = simulate(scene)
    left, right = (len(run.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
    values = ", ".join(f"{letter} = {value_of(scene, letter):g}" for letter in ("k", "c", "Kp", "Kv", "p", "H", "m_o"))
    masses = f"m_l = {value_of(scene, 'm_l'):g}, m_r = {scene.values['right_arm']['mass_kg']:g}"
    x_l, _, x_o, _, x_r, _ = scene.initial_state.tolist()
    caption = (
        f"{masses}, {values} (SI units, both sides). At rest from x_l = {x_l:g}, x_o = {x_o:g}, x_r = {x_r:g} m. {left}"
        f" touches on the left, {right} on the right. Below the paper's two panels: impact forces,"
        f" V_c{'' if _same_V(run) else ' and V, where they differ'}, and the energy lost so far by cause; beside them"
        " the contact with the fastest approach, from the dense output."
    )
    return Picture(
        figure.number, figure.title, caption, [each for each in scene.readings if "control period" not in each],
        compared(figure, cases, claims),
    )


def _same_V(run: Any) -> bool:
    return bool((run.energy.V_c == run.energy.V).all())


def _curves(cases: Cases, claims: Sequence[Claim]) -> list[beyond_figures.Curve]:
    found: list[beyond_figures.Curve] = []
    seen: set[tuple[str, str, Variant]] = set()
    for claim in claims:
        key = claim.key
        for part, judged_part in zip(STATEMENTS[key].parts, claim.parts, strict=True):
            known = isinstance(part, Comparison) and (part.letter, part.measure, part.other) in seen
            if isinstance(part, Comparison) and part.values and key.startswith("O") and not known:
                seen.add((part.letter, part.measure, part.other))
                value = value_of(part.changed.scene(cases), part.letter)
                label = f"{part.letter}, {UNIT_OF[part.letter[:2].rstrip('_')]}"
                title, measure = f"{key} {part.changed}", SHORT[part.measure]
                found.append(beyond_figures.Curve(title, label, measure, value, part.higher, judged_part.curve))
    return found


def _put_together(cases: Cases, claims: list[Claim], starts: int, done: Mapping[str, list[Any]]) -> Report:
    found = {key: value for key, value, _ in done["found"]}
    images = {**dict(done["image"]), **{key: each for key, _, each in done["found"]}}
    images["sweeps"] = image(beyond_figures.sweeps(_curves(cases, claims)))
    [rows], [heads_and_rows], [doubtful], [replays] = (
        done[key] for key in ("equations", "quantities", "doubts", "replays")
    )
    heads, amounts = heads_and_rows
    further = Beyond(**found)
    return Report(
        title=TITLE, subtitle=SUBTITLE, answer=answer(claims, further), definitions=definitions(starts),
        summary=summary(claims), claims=claims,
        sweeps=SWEEPS, pictures=[picture(figure, cases, claims) for figure in FIGURES], quantity_heads=heads,
        quantities=amounts, prints=PRINTS, agreement=agreement(rows), equations=rows, results=results(further),
        doubts=doubtful, replays=replays, images=images,
        origin="Computed with " + ", ".join(f"{name} {version}" for name, version in versions().items()) + ".",
    )

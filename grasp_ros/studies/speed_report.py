"""The records of the study `speed`, and their tables in plain text."""

from __future__ import annotations

from typing import NamedTuple

from grasp_ros.physics.layout import LEFT, RIGHT

OURS = "grasp_ros"
OUTPUTS = ("grid", "end")


class Attempt(NamedTuple):
    """One run of one solver at one setting."""

    family: str
    method: str
    setting: str
    output: str  # "grid" or "end"
    error: float | None  # None: not installed, or not all the output
    touches: tuple[int, int] | None  # None: does not look for them
    seconds: float  # of this run, with what it compiles
    status: str
    reached: bool


class Timing(NamedTuple):
    """Repeats of an attempt that reached the error, without what it compiles."""

    attempt: Attempt
    least: float  # s
    median: float  # s
    repeats: int


class Growth(NamedTuple):
    """Cost of one horizon."""

    duration: float  # s
    touches: int
    median: float  # s


def report(
    attempts: list[Attempt], timings: list[Timing], endurance: list[Growth], contacts: list[Growth]
) -> list[str]:
    """Lines of the four tables: time to the error with its failures, all attempts, and the two of growth."""
    lines: list[str] = []
    for output in OUTPUTS:
        lines += ["", *_timing_table([timing for timing in timings if timing.attempt.output == output], output)]
        lines += _failures([attempt for attempt in attempts if attempt.output == output])
    lines += ["", "every attempt: setting, error"]
    for output in OUTPUTS:
        for family, method in dict.fromkeys((attempt.family, attempt.method) for attempt in attempts):
            tries = [a for a in attempts if (a.method, a.output) == (method, output) and a.error is not None]
            errors = ";  ".join(f"{a.setting} {a.error:.1e}" for a in tries)
            lines.append(f"  {output:4}  {family + ': ' + method:36}{errors}")
    for title, rows in (("flight without contact", endurance), ("the scene over other horizons", contacts)):
        lines += ["", f"cost grows with contacts, not with duration: {title}, final state, default accuracy"]
        lines.append(f"  {'horizon s':>10}{'touches':>9}{'median ms':>11}{'us a touch':>12}")
        for row in rows:
            each = f"{1e6 * row.median / row.touches:12.1f}" if row.touches else f"{'-':>12}"
            lines.append(f"  {row.duration:10g}{row.touches:9}{1e3 * row.median:11.4f}{each}")
    return lines


def _timing_table(timings: list[Timing], output: str) -> list[str]:
    ours = next((timing.median for timing in timings if timing.attempt.family == OURS), float("nan"))
    lines = [
        f"{'output: ' + output:42}{'setting':16}{'error':>8}{'touches':>9}{'first ms':>11}{'min ms':>10}"
        f"{'median ms':>11}{'runs':>6}{'ratio':>8}"
    ]
    for timing in timings:
        attempt = timing.attempt
        lines.append(
            f"  {attempt.family + ': ' + attempt.method:40}{attempt.setting:16}{attempt.error:8.1e}"
            f"{_touches(attempt):>9}{1e3 * attempt.seconds:11.2f}{1e3 * timing.least:10.3f}{1e3 * timing.median:11.3f}"
            f"{timing.repeats:6}{timing.median / ours:8.2f}  {attempt.status}"
        )
    for family in dict.fromkeys(timing.attempt.family for timing in timings):
        if family != OURS:
            best = min((timing for timing in timings if timing.attempt.family == family), key=lambda row: row.median)
            lines.append(f"  ratio of medians, {family} at its best ({best.attempt.method}) / {OURS}:"
                         f" {best.median / ours:.2f}")
    return lines


def _failures(attempts: list[Attempt]) -> list[str]:
    lines = []
    for method in dict.fromkeys(attempt.method for attempt in attempts):
        tries = [attempt for attempt in attempts if attempt.method == method]
        if not any(attempt.reached for attempt in tries):
            last = tries[-1]
            errors = [attempt.error for attempt in tries if attempt.error is not None]
            best = f"does not reach it: best {min(errors):.1e}" if errors else "no result"
            lines.append(f"  {last.family + ': ' + method:40}{best}; last {last.setting or 'setting'}:"
                         f" {_touches(last)} touches, {last.seconds:.1f} s, {last.status}")
    return lines


def _touches(attempt: Attempt) -> str:
    return "-" if attempt.touches is None else f"{attempt.touches[LEFT]}/{attempt.touches[RIGHT]}"

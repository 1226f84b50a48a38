"""The sections of docs/accuracy.md about the time that `exact` takes: beside its rivals, and where it goes."""

from __future__ import annotations

from collections.abc import Sequence

from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.simulation import GRID_POINTS
from lab.studies import accuracy
from lab.studies.document import prose, table
from lab.studies.profile import Profile
from lab.studies.records import Record, by_scene, milliseconds
from lab.studies.speed import Timing

FINAL_ERROR = 1e-9
AIM = 500  # times as fast as the best of scipy
ODEINT = "odeint"
RIVALS = {
    "`solve_ivp` at its best": [name for name, method in METHODS.items() if method.package == "scipy"],
    "`odeint`": [ODEINT],
    "SUNDIALS at its best": [f"cvode_{kind}{events}" for kind in ("adams", "bdf") for events in ("", "_events")],
    "heyoka at its best": ["heyoka", "heyoka_fast_math"],
}


def ahead(records: Sequence[Record]) -> str:
    """How far ahead of each kind of rival `exact` is."""
    rows = []
    for name, here in by_scene(records).items():
        own = _fastest(here, [EXACT])
        others = [_fastest(here, names) for names in RIVALS.values()]
        rows.append([name, *(f"{o.time / own.time:.3g} ({o.method})" if o and own else "not reached" for o in others)])
    return "\n\n".join([
        f"## How many times as long others take, to an error of {FINAL_ERROR:g}",
        table(["scene", *RIVALS], rows),
    ])


def time_spent(records: Sequence[Record], profiles: Sequence[Profile]) -> str:
    """Where the time of `exact` goes, and what that leaves to be gained."""
    rows = []
    for p in profiles:
        shares = [p.call - p.outputs, p.outputs - p.end, p.expansions, p.end - p.expansions]
        rows.append([p.scene, f"{p.accuracy:.0e}", f"{1e3 * p.call:.3g} ms", *(f"{s / p.call:.0%}" for s in shares),
                     f"{p.contact_steps}, with one side of order {p.order}, {1e9 * p.expansion:.0f} ns each"])
    rivals = {name: _fastest(here, [ODEINT]) for name, here in by_scene(records).items()}
    measured = [(p, rival) for p in profiles if (rival := rivals.get(p.scene)) is not None]
    return "\n\n".join([
        "## Where the time goes",
        table(["scene", "accuracy", "one call", "Python around it", "outputs", "Taylor expansions",
                "steps, events, flights", "Taylor steps"], rows),
        prose("""Medians, in turn. Python around it is what `simulate` does beside the integrator: checks, arrays and
        the record. An expansion is timed by itself, with one side in contact; with both it has half as many
        orders more, each of which costs up to twice as much, and that difference stands in the column after it."""),
        *([odeint(measured)] if measured else []),
    ])


def odeint(measured: Sequence[tuple[Profile, Record]]) -> str:
    """Whether `exact` could be `AIM` times as fast as `odeint`, the fastest of scipy, scene by scene."""
    rows = [
        [p.scene, milliseconds(rival), f"{rival.right_hand_sides}", *(f"{1e3 * s:.2g} ms" for s in
         (rival.time / AIM, p.end, p.expansions)), "yes" if rival.time / AIM > p.end else "no"]
        for p, rival in measured
    ]
    return "\n\n".join([
        prose(f"""`{ODEINT}` is the fastest of scipy because its steps are not taken in Python. `{EXACT}` can be {AIM}
        times as fast where its integration without any output takes less than that part of the time of `{ODEINT}`:"""),
        table(["scene", ODEINT, "compiled right-hand sides", f"1/{AIM} of its time", f"`{EXACT}` without output",
                "its expansions alone", f"{AIM} times as fast?"], rows),
    ])


def output(costs: dict[str, tuple[float, float]]) -> str:
    """What output costs: by scene, seconds with all output times and with the last alone."""
    rows = [
        [name, f"{1e3 * both:.3g} ms", f"{1e3 * last:.3g} ms", f"{both / last:.2f}"]
        for name, (both, last) in costs.items()
    ]
    return "\n\n".join([
        "## What output costs", table(["scene", f"{GRID_POINTS} output times", "the last alone", "ratio"], rows),
        f"`{EXACT}` at its default accuracy, medians, in turn.",
    ])


def final_state(timings: dict[str, list[Timing]]) -> str:
    """The last state alone, where a rival has less to do."""
    rows, ratios = [], []
    for name, row in timings.items():
        times = {timing.record.method == EXACT: timing for timing in row}
        own, other = times.get(True), times.get(False)
        if own is not None and other is not None:
            ratios.append(other.median / own.median)
        cells = [f"{1e3 * t.median:.3g} ms, error {t.record.error:.0e}" if t else "not reached" for t in (own, other)]
        rows.append([name, *cells, f"{ratios[-1]:.2f}" if own and other else "-"])
    return "\n\n".join([
        f"## The last state alone, to an error of {FINAL_ERROR:g}",
        table(["scene", EXACT, "heyoka_fast_math", "ratio"], rows),
        prose(f"""Medians, in turn; `{EXACT}` is ahead on {sum(ratio > 1.0 for ratio in ratios)} of {len(rows)}
        scenes. Where {GRID_POINTS} output times are wanted the ratios are those of the first table: a rival pays more
        for its outputs."""),
    ])


def _fastest(records: Sequence[Record], names: Sequence[str]) -> Record | None:
    return accuracy.fastest([record for record in records if record.method in names], FINAL_ERROR)

"""The sections of docs/accuracy.md: tables, figures, and what follows from them in plain words.

Every number is computed from what was measured. Sentences that could turn out otherwise on another machine are
written either way.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from grasp_ros.methods.contract import TOLERANCE
from grasp_ros.methods.registry import EXACT, METHODS
from lab.studies import accuracy, predictability
from lab.studies.document import prose, table
from lab.studies.drift import Drift
from lab.studies.loop import Point
from lab.studies.records import Record, by_scene, describe_machine, milliseconds
from lab.studies.stability import Limit

SAME_TOLERANCE = 1e-8


def head(command: str) -> str:
    """Title, machine, and what the numbers are."""
    machine = "\n".join(f"    {name:15}{version}" for name, version in describe_machine().items())
    return "\n\n".join([
        "# What accuracy costs",
        prose(f"""Written by `{command}` on {time.strftime('%Y-%m-%d')}. The command measures again what its journal
        does not have from this machine, these versions and these sources. Ratios travel better than milliseconds."""),
        machine,
        prose(f"""Error means: {accuracy.METRIC}. Time is the fastest warm run with all these outputs; the first run,
        with what it compiles, and the median stand in [records.csv](accuracy/records.csv)."""),
    ])


def choice(records: Sequence[Record]) -> str:
    """Which method for which error."""
    rows, ahead, ratios, finest = [], [], [], []
    for name, here in by_scene(records).items():
        mine = [record for record in here if record.method == EXACT]
        others = [record for record in here if record.method != EXACT]
        cells = [name]
        loose, tight = accuracy.fastest(mine, accuracy.TARGETS[0]), min(mine, key=lambda record: record.setting)
        finest += [] if loose is None else [tight.time / loose.time]
        for target in accuracy.TARGETS:
            own, other = accuracy.fastest(mine, target), accuracy.fastest(others, target)
            cells.append(f"{_cell(own)}; {_cell(other)}")
            if target == 1e-9 and own is not None:
                ahead += [name] if other is None or own.time < other.time else []
                ratios += [] if other is None else [other.time / own.time]
        rows.append(cells)
    verdict = f"At an error of 1e-9 `{EXACT}` is the fastest on {len(ahead)} of {len(rows)} scenes"
    if ratios:
        verdict += f"; the best of all others takes {min(ratios):.2g} to {max(ratios):.2g} times as long"
    return "\n\n".join([
        "## Which method",
        f"The fastest setting of `{EXACT}`; the fastest of all other methods:",
        table(["scene", *(f"error <= {target:.0e}" for target in accuracy.TARGETS)], rows),
        prose(f"""{verdict}. Its finest setting costs {min(finest, default=1.0):.2g} to {max(finest, default=1.0):.2g}
        times as much as an error of 1e-3, so there is little reason to ask it for less. Use another method if that is
        what you want to study; `python -m lab advise SCENE --error E` answers for your scene and your machine."""),
        "![error against time](accuracy/error_against_time.png)",
    ])


def paper(records: Sequence[Record]) -> str:
    """What the paper's method costs."""
    rows = []
    for name, here in by_scene(records).items():
        runs = [record for record in here if record.method == "paper"]
        found = accuracy.fastest(runs, 1e-3)
        own = accuracy.fastest([record for record in here if record.method == EXACT], 1e-3)
        best = min((record for record in runs if record.good), key=lambda record: record.error or 0.0, default=None)
        rows.append([
            name, "not reached" if found is None else f"step {found.setting:g} s, {milliseconds(found)}",
            "-" if found is None or own is None else f"{found.time / own.time:.3g}",
            "-" if best is None else f"{best.error:.1e} with steps of {best.setting:g} s in {milliseconds(best)}",
        ])
    return "\n\n".join([
        "## What the paper's method costs",
        table(["scene", "error <= 1e-3", f"as many times `{EXACT}`", "best error tried"], rows),
        prose("""It decides about contact at the two ends of a step and interpolates time and state linearly, which
        makes every touch an error of second order, whatever the order of the Runge-Kutta method around it. Locating
        the event to rounding instead (`rk4_events`) costs no time. Order 4 is still not reached, because
        u^(3/2) has no second derivative at u = 0. For motions as in the paper's figures its method is good
        enough; for numbers it is not."""),
    ])


def tolerance(records: Sequence[Record]) -> str:
    """Where tolerance is not error."""
    title = f"## Where tolerance is not error: what a tolerance of {SAME_TOLERANCE:g} gives"
    chosen = [r for r in records if r.knob == TOLERANCE and abs(r.setting / SAME_TOLERANCE - 1.0) < 1e-6]
    errors = [record.error for record in chosen if record.error is not None]
    if not errors:
        return f"{title}\n\nNo adaptive method was measured at it."
    names = list(by_scene(records))
    rows = []
    for method, group in accuracy.by_method(chosen).items():
        there = {record.scene: record for record in group}
        rows.append([method, *(_error(there.get(name)) for name in names)])
    low, high = min(errors) / SAME_TOLERANCE, max(errors) / SAME_TOLERANCE
    return "\n\n".join([
        title, table(["method", *names], rows),
        prose(f"""The error is {low:.0e} to {high:.0e} times the tolerance: a tolerance bounds one step, and the scene
        amplifies what a step leaves. Only a reference, or a second run with another setting, tells the error."""),
    ])


def missed(records: Sequence[Record]) -> str:
    """Contacts missed, and runs that failed."""
    wrong = [record for record in records if record.missed]
    silent = [record for record in wrong if record.status == "done"]
    failed = [record for record in records if not record.good]
    blocks = [
        "## Contacts missed",
        prose(f"""{len(wrong)} of {len(records)} runs count touches wrongly, and {len(silent)} of these report success.
        Looking at the ends of a step misses two crossings within it, and from a wrong contact on the motion is
        another one."""),
        "![contacts missed](accuracy/contacts_missed.png)",
    ]
    if failed:
        rows = [[r.scene, r.method, f"{r.knob} {r.setting:.0e}", r.status] for r in failed]
        blocks += ["Runs without a result:", table(["scene", "method", "setting", "status"], rows)]
    return "\n\n".join(blocks)


def energy(drifts: Sequence[Drift]) -> str:
    """Energy drift in the elastic case."""
    rows = [
        [row.method, row.setting, f"{row.worst:.1e}" if row.t else "-", f"{row.seconds:.2g} s", row.status]
        for row in sorted(drifts, key=lambda row: row.worst)
    ]
    seconds = max((row.t[-1] for row in drifts if row.t), default=0.0)
    return "\n\n".join([
        "## Energy in the elastic case",
        table(["method", "setting", "worst relative drift", "wall time", "status"], rows),
        prose(f"""Case 2 over {seconds:g} s: nothing dissipates, so V_c must stay what it is. The motion itself cannot
        be predicted that far, see below; its energy tells whether a long run is right. `discrete_gradient` keeps it
        with any step, through every contact, but follows the motion to second order only."""),
        "![energy drift](accuracy/energy_drift.png)",
    ])


def prediction(predictions: Sequence[predictability.Prediction]) -> str:
    """How far ahead a scene can be predicted."""
    rows = []
    for row in predictions:
        ends = [row.until(level) for level in predictability.LEVELS]
        times = [f"> {row.t[-1]:g} s" if end is None else f"{end:.1f} s" for end in ends]
        rows.append([row.scene, f"{row.growth:.0e}", *times])
    levels = [f"below {level:.0e} until" for level in predictability.LEVELS]
    return "\n\n".join([
        "## How far ahead a scene can be predicted",
        table(["scene", "growth of a perturbation over the scene", *levels], rows),
        prose(f"""Motions that begin {predictability.ROUNDINGS:g} roundings apart, the worst of {predictability.RUNS}.
        Where they have parted further than the error you want, no method in double precision can deliver it."""),
        "![prediction](accuracy/prediction.png)",
    ])


def topics(name: str, points: Sequence[Point], limits: Sequence[Limit]) -> str:
    """What accuracy costs over topics, and where the sampled loop loses stability."""
    rows = []
    for point in points:
        walls = ["-" if w is None else f"{w:.3g}" for w in (point.one_process, point.four_processes, point.bare)]
        rows.append([f"{point.period_ms:g} ms", f"{point.deviation:.1e} m", *walls])
    finest = points[-4:]
    order = np.polyfit(np.log([p.period_ms for p in finest]), np.log([p.deviation for p in finest]), 1)[0]
    edges = []
    for limit in limits:
        growth = ", ".join(f"{g:.5f} at {1e3 * h:.2f} ms" for h, _, g in limit.checks)
        edges.append([f"{limit.delay} periods", f"{1e3 * limit.period:.10g} ms", growth])
    return "\n\n".join([
        "## What accuracy costs over topics",
        f"{name}; wall seconds per simulated second in one process, in four, and of bare rclpy:",
        table(["control period", "deviation", "one process", "four processes", "bare rclpy"], rows),
        prose(f"""The deviation is that of positions from the paper's continuous feedback. It is the same in one
        process and in four, bit for bit, and falls with the power {order:.2f} of the period. In four processes
        the messages are the price, not the physics: halving the period doubles the time."""),
        "![control period](accuracy/control_period.png)",
        "Where the sampled loop of a free arm loses stability (spectral radius 1), and what the simulation does there:",
        table(["delay", "largest stable period", "simulated growth per period just below, just above"], edges),
        "![stability](accuracy/stability.png)",
    ])


def methods() -> str:
    """The methods and the peers."""
    rows = [[f"`{m.name}`", m.order, m.at_touch, m.source] for m in METHODS.values()]
    return "\n\n".join([
        "## The methods", table(["name", "order", "at a touch", "source"], rows),
        prose("""Outside peers, only in the studies: `odeint` (LSODA, its loop over the steps outside Python),
        `cvode_*` (SUNDIALS by scikit-sundae) and `heyoka*` (Taylor series by LLVM, given the same regularisation
        w = sqrt(u) and a terminal event per transition). All have compiled right-hand sides. Also tried: the other
        ways of heyoka to generate code, which differ by some percent (`python -m lab speed` has them all); numbalsoda,
        which has no wheel for these versions of Python."""),
    ])


def details(records: Sequence[Record]) -> str:
    """Everything, by scene."""
    blocks = ["## All methods, all scenes"]
    for name, here in by_scene(records).items():
        blocks.append(f"{name}\n\n```text\n" + "\n".join(accuracy.summary(here)) + "\n```")
    return "\n\n".join(blocks)


def _cell(record: Record | None) -> str:
    return "not reached" if record is None else f"{record.method} {milliseconds(record)}"


def _error(record: Record | None) -> str:
    if record is None or record.error is None:
        return "-" if record is None else record.status
    return f"{record.error:.0e}" + (f" ({record.missed} touches wrong)" if record.missed else "")



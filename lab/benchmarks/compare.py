"""Times of the same runs with several checkouts, side by side: what a change costs, or gains.

    python lab/benchmarks/compare.py CHECKOUT [CHECKOUT ...] [--rounds 5] [--rows REGEX] [--slower 0.3] [--json FILE]

Ratios are to the times of the first checkout: below 1 is faster. All run with this interpreter, the scenes of `config/`
beside this script. In each round every checkout has a fresh process, pinned to one core; they take each row in turn,
the order reversed from round to round. Times of a call are processor times, on two cores wall times, after warm calls.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

HERE = Path(__file__).resolve().parents[1]
SECONDS, FEWEST = 0.3, 3  # that a row takes in a process; its calls at least
FINEST, OUTPUTS, SAME = 1e-16, 2001, 1e-3  # accuracy; points of a grid; what last states may differ by, SI units
# As in `python -m lab maps`: numbers of a row off by up to OFF, the coarsest accuracy with an error of at most ERROR.
VARIANTS, OFF, ERROR = 4000, 0.02, 1e-6
LADDER = (1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11, 3e-12, 1e-12)


METHODS = {"paper": 1e-3, "rk4": 1e-3, "rk4_events": 1e-3, "discrete_gradient": 1e-3, "dop853_events": 1e-6}


class Row(NamedTuple):
    """What is timed: a scene, how it is run, and on how many cores; a call does `runs` of them."""

    scene: str
    how: str
    cores: int = 1
    runs: int = 1


CONTINUOUS = ("case_01", "case_02", "case_03", "case_04", "no_contact", "hammer", "friction", "friction_slide", "sine")
ROWS = {
    **{f"{name}, {how}": Row(name, how) for name in CONTINUOUS for how in ("last, 1e-9", "last, finest", "outputs")},
    **{f"{name}, sampled": Row(name, "sampled") for name in ("case_01", "noise", "everything")},
    **{f"case_01, {method}": Row("case_01", method) for method in METHODS},
    "ensemble, one core": Row("case_01", "ensemble", 1, VARIANTS),
    "ensemble, two cores": Row("case_01", "ensemble", 2, VARIANTS),
}
Measured = dict[str, Any]  # "minimum", "median" of a run in ms, "calls", last "state"; or "absent", why there is none


def state(found: Any) -> Any:
    """The last state of a run that reached its end."""
    if found.status.name != "DONE":
        raise RuntimeError(found.stop)
    return np.nan_to_num(found.state[-1])  # bodies that are not there are nan


def prepare(row: Row) -> tuple[Callable[[], Any], Measured]:
    """A call that is timed, once done, and what is told of it."""
    from grasp_ros import scene as scenes
    from grasp_ros.simulation import simulate

    try:
        scene = scenes.load(str(HERE / "config" / f"{row.scene}.yaml"))
    except scenes.SceneError:
        scene = scenes.load(row.scene)  # the checkout's own, where it cannot read this one
    end, grid = np.array([scene.duration]), np.linspace(0.0, scene.duration, OUTPUTS)
    ways: dict[str, dict[str, Any]] = {
        "last, 1e-9": {"grid": end, "setting": 1e-9}, "last, finest": {"grid": end, "setting": FINEST},
        "outputs": {"grid": grid, "setting": FINEST}, "sampled": {"sampled": True},
        **{method: {"method": method, "setting": setting} for method, setting in METHODS.items()},
    }
    if row.how in ways:
        run = partial(simulate, scene, **ways[row.how])
        return run, {"state": state(run()).tolist()}
    from grasp_ros.simulation import Setup, ensemble

    truth = state(simulate(scene, grid=end, setting=FINEST))
    errors = ((float(np.abs(state(simulate(scene, grid=end, setting=a)) - truth).max()), a) for a in LADDER)
    error, accuracy = next(pair for pair in errors if pair[0] <= ERROR)
    numbers = {f"{section}.{key}": value for section, keys in scene.values.items() if section != "time"
               for key, value in keys.items() if isinstance(value, float) and value}
    draws = np.random.default_rng(1).uniform(1.0 - OFF, 1.0 + OFF, (len(numbers), VARIANTS))
    changes = {key: value * draw for (key, value), draw in zip(numbers.items(), draws, strict=True)}
    rows = partial(ensemble, scene, changes, ["last_state"], setup=Setup(accuracy=accuracy), threads=row.cores)
    if not rows().done.all():
        raise RuntimeError("a row of the ensemble is not done")
    return rows, {"state": truth.tolist(), "accuracy": accuracy, "error": error}


def measure(row: Row, allowed: list[int]) -> Measured:
    """Time a row on as many of the allowed cores as it asks for."""
    if len(allowed) < row.cores:
        return {"absent": "there is one core"}
    os.sched_setaffinity(0, allowed[-row.cores:])  # of this thread and of those that it starts
    clock = time.process_time if row.cores == 1 else time.perf_counter
    try:
        call, told = prepare(row)
    except Exception as error:  # whatever another checkout does not have
        return {"absent": f"{type(error).__name__}: {error}"}

    def one() -> float:
        begin = clock()
        call()
        return (clock() - begin) * 1e3 / row.runs

    calls = max(FEWEST, math.ceil(SECONDS * 1e3 / (one() * row.runs)))
    times = [one() for _ in range(calls)]
    return {"minimum": min(times), "median": median(times), "calls": calls, **told}


def work(checkout: Path) -> None:
    """In a process of its own: measure the rows that the standard input names."""
    import grasp_ros

    if not Path(grasp_ros.__file__).is_relative_to(checkout):
        sys.exit(f"{checkout} has no grasp_ros: {grasp_ros.__file__} was found instead")
    allowed = sorted(os.sched_getaffinity(0))
    for line in sys.stdin:
        print(json.dumps(measure(ROWS[line.rstrip("\n")], allowed)), flush=True)


def ask(worker: subprocess.Popen[str], name: str) -> Measured:
    """What a process measures of a row."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    print(name, file=worker.stdin, flush=True)
    answer = worker.stdout.readline()
    return dict(json.loads(answer)) if answer else sys.exit(f"{name}: the process of a checkout ended")


def one_round(checkouts: list[Path], names: list[str], step: int) -> dict[str, list[Measured]]:
    """What each checkout gives for each row; a step of -1 asks the last checkout first."""
    workers = [subprocess.Popen(
        [sys.executable, __file__, "--work", str(checkout)], env={**os.environ, "PYTHONPATH": str(checkout)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for checkout in checkouts]
    found = {name: [ask(worker, name) for worker in workers[::step]][::step] for name in names}
    for worker in workers:
        worker.communicate()
    return found


def summary(bases: Sequence[Measured], owns: Sequence[Measured]) -> Measured:
    """Medians over the rounds of one row with one checkout, and of its ratios to the first one."""
    for given in owns:
        if "absent" in given:
            return given
    told: Measured = {key: median(given[key] for given in owns) for key in ("median", "minimum")}
    if "accuracy" in owns[0]:
        told |= {key: owns[0][key] for key in ("accuracy", "error")} | {"scenes a second": 1e3 / told["median"]}
    if not any("absent" in base for base in bases):
        pairs = list(zip(bases, owns, strict=True))
        told |= {f"ratio, {key}": median(own[key] / base[key] for base, own in pairs) for key in ("median", "minimum")}
        told["differs"] = float(np.abs(np.subtract(owns[0]["state"], bases[0]["state"])).max())
    return told


def text_of(checkouts: list[Path], table: dict[str, list[Measured]]) -> str:
    """The table, and below it what is to be said of single cells."""
    lines = [" " * 28 + "".join(f"{checkout.name[-24:]:>28}" for checkout in checkouts)]
    lines.append(f"{'row':28}" + f"{'ms':>12}{'ratio':>8}{'minima':>8}" * len(checkouts))
    remarks = []
    for name, row in table.items():
        lines.append(f"{name:28}")
        for checkout, told in zip(checkouts, row, strict=True):
            where = f"{name}, {checkout.name}:"
            if "absent" in told:
                lines[-1] += f"{'not there':>12}{'':16}"
                remarks.append(f"{where} {told['absent']}")
                continue
            ratios = (told.get(f"ratio, {key}", math.nan) for key in ("median", "minimum"))
            lines[-1] += f"{told['median']:12.4f}" + "".join(f"{ratio:8.3f}" for ratio in ratios)
            if "accuracy" in told:
                remarks.append(f"{where} {told['scenes a second']:.0f} scenes a second, "
                               f"accuracy {told['accuracy']:.0e}, error {told['error']:.1e}")
            if told.get("differs", 0.0) > SAME:
                remarks.append(f"{where} ANOTHER RUN, its last state differs by {told['differs']:.1e}")
    return "\n".join([*lines, "", *remarks])


def main() -> None:
    """Measure, print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("checkouts", nargs="+", type=lambda text: Path(text).resolve(), metavar="CHECKOUT")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--rows", type=re.compile, default=re.compile(""), metavar="REGEX")
    parser.add_argument("--slower", type=float, default=math.inf, metavar="PART",
                        help="fail if a row's least time is longer than the first checkout's by more than this part")
    parser.add_argument("--json", type=Path, metavar="FILE", help="what each round gave, and the table")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    checkouts = options.checkouts
    if options.work:
        work(checkouts[0])
        return
    names = [name for name in ROWS if options.rows.search(name)]
    rounds = [one_round(checkouts, names, (-1) ** i) for i in range(options.rounds)]
    columns = {name: list(zip(*(found[name] for found in rounds), strict=True)) for name in names}
    table = {name: [summary(given[0], own) for own in given] for name, given in columns.items()}
    print(text_of(checkouts, table))
    if options.json:
        record = {"checkouts": [checkout.name for checkout in checkouts], "table": table, "rounds": rounds}
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    slow = [name for name, row in table.items()
            if any(told.get("ratio, minimum", 0.0) > 1.0 + options.slower for told in row)]
    if slow:
        sys.exit(f"slower by more than {options.slower:.0%}: {'; '.join(slow)}")


if __name__ == "__main__":
    main()

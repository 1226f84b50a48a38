"""The table of all methods, and the one check of what they are asked."""

from __future__ import annotations

from functools import partial

from grasp_ros.exact.integrator import MAX_WORK, Integrator
from grasp_ros.exact.records import one_interval
from grasp_ros.methods import discrete_gradient, fixed_step, library
from grasp_ros.methods.contract import ACCURACY_KNOB, STEP, TOLERANCE, Method, Problem, Solution
from grasp_ros.methods.equations import Work
from grasp_ros.physics import layout
from grasp_ros.physics.accuracy import ACCURACY, COARSEST, FINEST
from grasp_ros.physics.errors import Refused, allowed, need
from grasp_ros.physics.given import number, text
from grasp_ros.scene import PAPER, Scene

EXACT = "exact"
MOST_STEPS = 1e9


def _tens(first: int, last: int) -> tuple[float, ...]:
    """10**-first ... 10**-last."""
    return tuple(float(f"1e-{k}") for k in range(first, last + 1))


_STEPS = tuple(base * 10.0**-decade for decade in range(2, 6) for base in (1.0, 0.5, 0.2))
_HAIRER = "Hairer, Norsett, Wanner, Solving ODEs I"
_STIFF = "Hairer, Wanner, Solving ODEs II"
_INSIDE = "nothing: the events are inside the right-hand side"
_RESTART = "frozen mode; terminal events of scipy, which it looks for at the ends of its steps; restart after each"


def _exact(problem: Problem) -> Solution:
    """The method of this package; inputs that change on the way are driven from outside."""
    integrator = Integrator(
        problem.system, continuous=not problem.sampled, accuracy=problem.setting, max_events=problem.max_events,
        max_work=problem.max_work,
    )
    integrator.progress = problem.progress
    if problem.drive is None:
        states = integrator.run(one_interval(problem.duration, 0.0, len(problem.grid)), problem.grid)
    else:
        states = problem.drive(integrator)
    return Solution(states, integrator.event_table, integrator.work, integrator.status, integrator.stop,
                    integrator.at_rest)


def _fixed(name: str, order: str, source: str, at_touch: str, rule: int) -> Method:
    return Method(
        name, order, source, at_touch, STEP, 1e-4, _STEPS, 0.0, 1e9, partial(fixed_step.solve, rule), Work,
        events=rule != fixed_step.PLAIN,
    )


def _scipy(solver: str, order: str, source: str) -> list[Method]:
    ladder = (*_tens(3, 13), 3e-14)  # solve_ivp takes no less than 100 roundings
    return [
        Method(
            name, order, source, text, TOLERANCE, 1e-9, ladder, 2.3e-14, 1e-2, partial(library.solve, solver, located),
            Work, events=located, package="scipy",
        )
        for name, text, located in ((solver.lower(), _INSIDE, False), (f"{solver.lower()}_events", _RESTART, True))
    ]


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(
            EXACT, "any, by the accuracy", "this package: grasp_ros/exact",
            "closed-form flight to the touch, which cannot be missed; Taylor series in w = sqrt(u) through the contact",
            ACCURACY_KNOB, ACCURACY, _tens(3, 16), FINEST, COARSEST, _exact, layout.Work,
            events=True, effects=True, sampled=True, work_budget=True, energy_check=True,
        ),
        _fixed(
            "paper", "2 at a touch, 4 elsewhere", "Fukuda, Shoji, Inaba (1990), Simulation Method",
            "decided at both ends of a step; time and state by linear interpolation, then the rest of the step",
            fixed_step.PAPER,
        ),
        _fixed("rk4", "4; through a touch 2.5", f"{_HAIRER}, II.1", _INSIDE, fixed_step.PLAIN),
        _fixed(
            "rk4_events", "4; through a touch 2.5", f"{_HAIRER}, II.1",
            "frozen mode; looked for at the ends of a step, located to rounding; restart from there",
            fixed_step.LOCATED,
        ),
        Method(
            "discrete_gradient", "2", "Gonzalez (1996); Celledoni et al. (2012)",
            "nothing is located: a difference quotient spans the touch and conserves V_c", STEP, 1e-4, _STEPS, 0.0, 1e9,
            discrete_gradient.solve, Work, events=False,
        ),
        *_scipy("RK45", "5(4)", f"Dormand, Prince (1980); {_HAIRER}, II.5; scipy"),
        *_scipy("DOP853", "8(5,3)", f"{_HAIRER}, II.5; scipy"),
        *_scipy("Radau", "5, implicit", f"{_STIFF}, IV.8; scipy"),
        *_scipy("LSODA", "1 to 12, implicit where stiff", "Hindmarsh, Petzold (1983); scipy"),
    )
}


def find(name: str) -> Method:
    """A method by its name."""
    if text("method", name) not in METHODS:
        raise Refused(f"method {name!r} is not allowed; {allowed(name, METHODS)}")
    return METHODS[name]


def check(
    name: str, scene: Scene, setting: float | None, *, sampled: bool = False, max_work: int = MAX_WORK
) -> float:
    """The setting of a method, if it can do what is asked; the one place that refuses what it cannot.

    Without a setting: the method's default, or the whole horizon as the step if that is shorter. A `max_work` other
    than MAX_WORK counts as set.
    """
    method = find(name)
    value = method.default if setting is None else number(f"{name}: {method.knob}", setting)
    low, high = method.low, method.high
    if method.knob == STEP:
        low, high = scene.duration / MOST_STEPS, scene.duration
        value = min(value, high) if setting is None else value
    if not low <= value <= high:
        raise Refused(f"{name}: {method.knob} {value!r} is not allowed; allowed: {low:g} to {high:g}")
    if sampled and not method.sampled:
        raise Refused(f"{name}: only continuous feedback; allowed for sampled feedback: {_able('sampled')}")
    if max_work != MAX_WORK and not method.work_budget:
        raise Refused(f"{name}: has no budget of work; allowed with one: {_able('work_budget')}")
    if not method.effects and (odd := _beside_the_paper(scene)):
        raise Refused(
            f"{name}: {scene.name} {'; '.join(odd)}; it supports only the paper's grasp: two arms with feedback to 0,"
            f" an object and both contacts; allowed here: {_able('effects')}"
        )
    if method.package is not None:
        need(name, method.package)
    return value


def _able(capability: str) -> str:
    """Names of the methods that declare a capability."""
    return ", ".join(name for name, method in METHODS.items() if getattr(method, capability))


def _beside_the_paper(scene: Scene) -> list[str]:
    """In words: what a scene lacks of the paper's grasp and its feedback, and what it has beside."""
    forces = [
        f"{section}.{key}" for section in ("left_feedback", "right_feedback")
        for key in ("set_point_m", "feed_forward_N") if scene.values.get(section, {}).get(key)
    ]
    lacking, more = sorted(PAPER - set(scene.values)), sorted([*set(scene.values) - PAPER, *forces])
    return [f"{word} {', '.join(found)}" for word, found in (("lacks", lacking), ("has", more)) if found]

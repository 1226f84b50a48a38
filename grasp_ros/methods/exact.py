"""The method of this package, `grasp_ros.exact`, behind the door of all methods."""

from __future__ import annotations

from grasp_ros.exact.integrator import Integrator
from grasp_ros.methods.contract import Problem, Solution


def solve(problem: Problem) -> Solution:
    """Integrate from event to event; inputs that change on the way are driven from outside."""
    integrator = Integrator(
        problem.system, continuous=not problem.sampled, accuracy=problem.setting, max_events=problem.max_events,
        max_work=problem.max_work,
    )
    integrator.progress = problem.progress
    drive = problem.drive or (lambda free: free.advance(problem.duration, problem.grid))
    states = drive(integrator)
    return Solution(states, integrator.event_table, integrator.work, integrator.status, integrator.stop,
                    integrator.at_rest)

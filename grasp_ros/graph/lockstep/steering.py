"""Steering a plant: pause, resume, step, reset and status, as services.

The meaning is that of the standard `simulation_interfaces`, whose package is not among the wheels; the types are those
of std_srvs. Each answers with what the plant is then, as JSON: `state`, `tick` and others; with `goal`, what `status`
will say when it is done, and of a step how many were `asked` for; and if it does nothing, with `why`.
"""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from std_srvs.srv import Trigger

from grasp_ros.graph.parameters import PARAMETERS
from grasp_ros.graph.ros.node import Phase

if TYPE_CHECKING:  # it imports this one
    from grasp_ros.graph.nodes.plant import Plant

MOST_STEPS = 10**9
PAUSED, STEPPING = "paused", "stepping"  # beside the phases of a node


class Steering:
    """Services `~/pause`, `~/resume`, `~/step`, `~/reset`, `~/status`, and the parameter `steps` of `~/step`."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._paused = plant.read_only("paused")
        self.steps = 0  # control periods that are still to be done although the plant is paused
        self.reset_due = False  # whether it is to be put back once its current state has been answered
        default, text = PARAMETERS["plant"]["steps"]
        plant.declare("steps", default, ParameterDescriptor(
            description=text,
            integer_range=[IntegerRange(from_value=1, to_value=MOST_STEPS, step=1)],
        ))
        for name, action in (("pause", partial(self._pause, True)), ("resume", partial(self._pause, False)),
                             ("step", self._step), ("reset", self._reset),
                             ("status", lambda _, response: self._answer(response))):
            plant.create_service(Trigger, f"~/{name}", action)

    def go_on(self) -> bool:
        """Whether the plant may advance now; takes one of the steps that were asked for."""
        if not self._paused:
            return True
        if not self.steps:
            return False
        self.steps -= 1
        return True

    @property
    def halted(self) -> bool:
        """Whether the plant is paused without steps to go."""
        return self._paused and not self.steps

    def reset_done(self) -> None:
        """Put the plant back; called by its loop when the current state has been answered."""
        self.reset_due = False
        self.steps = 0
        self._plant.restart()

    def _pause(self, paused: bool, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._paused is paused and not self.steps:  # a step that goes on is ended by either
            return self._answer(response, f"already {'paused' if paused else 'running'} at tick {self._plant.tick}")
        self._paused, self.steps = paused, 0
        self._plant.loop.advance()
        return self._answer(response)

    def _step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        plant, wanted = self._plant, int(self._plant.get_parameter("steps").value)
        left = plant.scene.ticks - plant.tick
        if not self._paused:
            return self._answer(response, "not paused; allowed: step of a paused plant")
        if self.steps or self.reset_due:
            busy = "a reset is on its way" if self.reset_due else f"{self.steps} steps are still to go"
            return self._answer(response, f"{busy}; allowed: one step or reset at a time")
        if wanted > left:
            most = f"at most {left}, up to the end of the scene"
            return self._answer(response, f"steps: {wanted} is not allowed; allowed: {most}")
        self.steps, goal = wanted, plant.tick + wanted
        plant.loop.advance()
        return self._answer(response, goal={"tick": goal, "state": PAUSED}, asked=wanted)

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.reset_due:
            return self._answer(response, "a reset is already on its way")
        if not self._plant.tick:  # its first state again would be a repetition to whoever has answered it
            return self._answer(response, "already at the beginning")
        self.reset_due = True
        number, tick = self._plant.resets + 1, self._plant.tick  # which may be over when `advance` returns
        self._plant.loop.advance()
        return self._answer(response, goal={"resets": number, "resetting": False}, last_tick=tick)

    def _answer(self, response: Trigger.Response, why: str = "", **more: Any) -> Trigger.Response:
        """What the plant is now, as JSON; with what it will be, or why it is not."""
        plant, state, words = self._plant, self._plant.phase.value, self._plant.words
        if plant.phase is Phase.RUNNING and self._paused:
            state = words = STEPPING if self.steps else PAUSED
        response.success = not why
        response.message = json.dumps({
            "state": state, "words": words, "tick": plant.tick, "ticks": plant.scene.ticks,
            "time_s": plant.scene.time_of(plant.tick), "steps": self.steps, "resets": plant.resets,
            "resetting": self.reset_due, "scene": plant.scene.name, **({"why": why} if why else {}), **more,
        })
        return response

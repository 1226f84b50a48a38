"""The loop of a plant, which decides when it advances: the commands that it admits, and how it is steered."""

from __future__ import annotations

import json
import math
import time
from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation
from std_srvs.srv import Trigger

from grasp_ros.graph.ros.node import GraspNode, Phase
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import CHANGES, COMMANDS, Topic

if TYPE_CHECKING:  # it imports this one
    from grasp_ros.graph.nodes.plant import Plant

PAUSED, STEPPING = "paused", "stepping"  # beside the phases of a node


class Commands:
    """The commands of one arm that can be true, of a source that is known.

    A message does not name its sender. But a reader knows how many writers it has been connected with so far, and a
    writer is connected before its first message comes. So while that number is constant, all messages come from the
    same source; one that comes within `seconds` after a change may be of another, even of one that has already left.

    The largest force that acts is that of the scene and of the announcements of its controller. The package's own
    controllers keep to it. A larger command of another controller is refused, not clipped: the actuator could not apply
    it, and no controller has computed a clipped one.
    """

    def __init__(
        self, node: GraspNode, scene: Scene, body: int, take: Callable[[Commands, bytes], None], seconds: float
    ) -> None:
        self.body, self.side = body, NAMES[body]
        self.topic, self._node, self._seconds, self._until = COMMANDS[self.side], node, seconds, 0.0
        self._total, self.number = -1, 0  # sources connected so far, and now
        self._limit = float(scene.values.get(f"{self.side}_actuator", {}).get("limit_N", math.inf))
        if self._limit < math.inf:
            node.subscribe(CHANGES[self.side], self._on_change)
        subscription = node.subscribe(self.topic, partial(take, self), raw=True)
        # Asked at every message, in the order of the messages: an event of the executor would come before or after.
        with subscription.handle:
            self._matches = rclpy_implementation.EventHandle(
                subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
            )
        self.clear()

    def clear(self) -> None:
        """Have received none."""
        self.received, self.force = False, 0.0  # N, of the last one
        self.answers = 0  # tick of the state that it answers, of its arrival where it carries no stamp
        self.late = False  # whether it is too old

    def _on_change(self, message: Any) -> None:
        for name, value in zip(message.name, message.position, strict=False):
            if name == f"{self.side}_actuator.limit_N" and 0.0 <= value < math.inf:
                self._limit = value

    def allow(self, force: float) -> bool:
        """Whether the actuator can do a command in N."""
        return abs(force) <= self._limit

    def admit(self, force: float) -> bool:
        """The same, and what it cannot do is counted."""
        if not (allowed := self.allow(force)):
            why = f"{force:g} N; allowed by the actuator of the scene: {self._limit:g} N"
            self._node.refuse("commands beyond a limit", self.topic, why)
        return allowed

    def begin(self) -> None:
        """Take the sources that are there as known."""
        self._look()
        self._until = 0.0

    def settled(self) -> bool:
        """Whether the sources have been the same ones for a while."""
        now, before = time.monotonic(), self._total
        self._look()
        if before not in (-1, self._total):
            self._until = now + self._seconds
        return now >= self._until

    def _look(self) -> None:
        with self._matches:
            status = self._matches.take_event()
        if status is not None:
            self._total, self.number = status.total_count, status.current_count


class Loop:
    """Decides when a plant advances; services `~/pause`, `~/resume`, `~/step`, `~/reset`, `~/status`.

    Their meaning is that of the standard `simulation_interfaces`, whose package is not among the wheels; the types are
    those of std_srvs. Each answers with what the plant is then, as JSON: `state`, `tick` and others; with `goal`, what
    `status` will say when it is done, and of a step how many were `asked` for; and if it does nothing, with `why`.
    """

    def __init__(self, plant: Plant, paused: bool, seconds: float = 0.0) -> None:
        self._plant, self._paused = plant, paused
        self._commands = [Commands(plant, plant.scene, body, self._on_command, seconds)
                          for body in plant.scene.system.laws]
        self.answered = False  # whether all sides have answered a state of this run
        self.topics: list[Topic] = []  # of which it needs each message
        self._steps = 0  # control periods that are still to be done although the plant is paused
        self.reset_due = False  # whether it is to be put back once its current state has been answered
        for name, action in (("pause", partial(self._pause, True)), ("resume", partial(self._pause, False)),
                             ("step", self._step), ("reset", self._reset),
                             ("status", lambda _, response: self._answer(response))):
            plant.create_service(Trigger, f"~/{name}", action)

    @abstractmethod
    def _on_command(self, own: Commands, cdr: bytes) -> None:
        """Take a command."""

    @abstractmethod
    def advance(self) -> None:
        """Do what is due: reset, finish, pause or advance."""

    def report(self) -> None:
        """Say once a second how it goes; in lockstep the plant names who does not answer."""

    def go_on(self) -> bool:
        """Whether the plant may advance now; takes one of the steps that were asked for."""
        if not self._paused:
            return True
        if not self._steps:
            return False
        self._steps -= 1
        return True

    @property
    def halted(self) -> bool:
        """Whether the plant is paused without steps to go."""
        return self._paused and not self._steps

    def reset_done(self) -> None:
        """Put the plant back; called by its loop when the current state has been answered."""
        self.reset_due = False
        self._steps = 0
        for own in self._commands:
            own.clear()
        self._plant.restart()

    def _pause(self, paused: bool, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._paused is paused and not self._steps:  # a step that goes on is ended by either
            return self._answer(response, f"already {'paused' if paused else 'running'} at tick {self._plant.tick}")
        self._paused, self._steps = paused, 0
        self.advance()
        return self._answer(response)

    def _step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        plant, wanted = self._plant, int(self._plant.get_parameter("steps").value)
        left = plant.scene.ticks - plant.tick
        if not self._paused:
            return self._answer(response, "not paused; allowed: step of a paused plant")
        if self._steps or self.reset_due:
            busy = "a reset is on its way" if self.reset_due else f"{self._steps} steps are still to go"
            return self._answer(response, f"{busy}; allowed: one step or reset at a time")
        if wanted > left:
            most = f"at most {left}, up to the end of the scene"
            return self._answer(response, f"steps: {wanted} is not allowed; allowed: {most}")
        self._steps, goal = wanted, plant.tick + wanted
        self.advance()
        return self._answer(response, goal={"tick": goal, "state": PAUSED}, asked=wanted)

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.reset_due:
            return self._answer(response, "a reset is already on its way")
        if not self._plant.tick:  # its first state again would be a repetition to whoever has answered it
            return self._answer(response, "already at the beginning")
        self.reset_due = True
        number, tick = self._plant.resets + 1, self._plant.tick  # which may be over when `advance` returns
        self.advance()
        return self._answer(response, goal={"resets": number, "resetting": False}, last_tick=tick)

    def _answer(self, response: Trigger.Response, why: str = "", **more: Any) -> Trigger.Response:
        """What the plant is now, as JSON; with what it will be, or why it is not."""
        plant, state, words = self._plant, self._plant.phase.value, self._plant.words
        if plant.phase is Phase.RUNNING and self._paused:
            state = words = STEPPING if self._steps else PAUSED
        response.success = not why
        response.message = json.dumps({
            "state": state, "words": words, "tick": plant.tick, "ticks": plant.scene.ticks,
            "time_s": plant.scene.time_of(plant.tick), "steps": self._steps, "resets": plant.resets,
            "resetting": self.reset_due, "scene": plant.scene.name, **({"why": why} if why else {}), **more,
        })
        return response

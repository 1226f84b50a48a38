"""The controllers: from the state of one arm to its command, by the law of the scene or one of the user's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from grasp_ros import scene as scenes
from grasp_ros.graph.health.peers import PeerNode
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.ros.messages import UNREADABLE, State, StateReader
from grasp_ros.graph.ros.node import Phase
from grasp_ros.graph.serialization import list_message, template_of
from grasp_ros.physics.control import FIXED, Column, command_of, limited
from grasp_ros.physics.errors import Failed, Refused, described
from grasp_ros.physics.observation import Observation, check, observables_of
from grasp_ros.physics.system import COLUMN, NAMES, System
from grasp_ros.scene.effects.base import NANOSECONDS, SIDES
from grasp_ros.scene.own_law import begin, find_law
from grasp_ros.scene.topics import CHANGES, COMMANDS, JOINT_STATES, LYAPUNOV, RUN, SCENE
from grasp_ros.scene.validation import SceneError

ANNOUNCE_SECONDS = 1.0


class Controller(PeerNode):
    """Node `left_controller` or `right_controller`; parameters law, wait_for_monitor and others.

    It takes its law from the scene that the plant announces and answers every state with a command of the same stamp,
    in a free run the newest one that has come. It announces the numbers of its law before the first command that rests
    on them: at the beginning, after a reset, and when they were set while it runs. With a law of the user's own it
    announces nothing, and takes no other numbers. When a plant comes with another scene it goes on with that. Other
    parameters are the numbers of the scene.
    """

    why_read_only = "it is fixed for a run, so that the bag and a replay agree; set it in the scene"
    stays = True
    _is_loading = False  # the module of its law

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._executable = name  # the node may have been given another name
        self._side = name.removesuffix("_controller")
        self._monitored = self.read_only("wait_for_monitor")
        law = self.read_only("law")
        self._is_loading = True
        self._own = OwnLaw(law) if law else None
        self._is_loading = False
        topic = COMMANDS[self._side]
        self._commands, self._template = self.publisher(topic), template_of(topic)
        self._announcements = self.publisher(CHANGES[self._side])
        self._scene: scenes.Scene | None = None
        self._staged: dict[str, float] = {}
        self._answered = -1  # time in ns of the last state answered; -1: none of this run
        self._force = 0.0  # that answer
        self._number = 0  # of the last announcement for this scene
        self._ready_to_answer = False
        self.counters.update({"answered states": 0, "repeated states": 0, "refused states": 0, "skipped states": 0})
        self.add_on_set_parameters_callback(self._check)
        self.add_post_set_parameters_callback(self._stage)
        self._free = False  # whether the plant waits for no answer
        self.on_text(RUN, self._on_run)
        self.on_text(SCENE, self._on_scene)
        self.when(self._ready, self._start)

    def blocking_limit(self) -> float | None:
        """An import that does not return, or asks at a terminal, has as long as a node that does not come."""
        return self.start_patience if self._is_loading else super().blocking_limit()

    def progress(self) -> object:
        """The last state answered."""
        return self._answered, self._scene

    def _on_run(self, text: str) -> None:
        self._free = not Running.parse(text).lockstep

    def _on_scene(self, text: str) -> None:
        """A plant has come: the first one, or one after another."""
        self._scene = None
        try:
            self._take(scenes.parse(text, SCENE.name, f"topic {SCENE.name}"))
        except Refused as error:
            if not self.begun:
                raise
            self._left = None  # a living plant is no reason to go on with the last scene
            self.phase, self.words = Phase.IDLE, f"waits for another scene: {error}"
            self.concern = "no command in this scene"
            self.get_logger().error(self.words)
            self.heartbeats.works_with("")
            return
        self.heartbeats.works_with(text)
        if self._ready_to_answer:  # this node stays; those that listen may be new
            self._ready_to_answer = False
            self.when(self._ready, self._start)

    def _take(self, scene: scenes.Scene) -> None:
        """Work with a scene from now on."""
        name = self._executable
        if name not in scene.controllers:
            raise SceneError(f"{SCENE.name}: has no {name}; allowed: {', '.join(scene.controllers) or 'none'}")
        self._staged = self.declare_scene(scene, name)
        scene.changed(self._staged)  # refuses what was given at the start and cannot be run
        if self._own:
            check(self._own.asks, scene.system, SIDES[self._side], f"law: {self._own.words}")
            self._check_own(self._staged)
        self._reader = StateReader([NAMES[body] for body in scene.system.present] if self._own else (self._side,))
        self._scene, self._answered, self.concern, self._number = scene, -1, "", 0

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Whether numbers of the law may be set; somebody else may still refuse them."""
        try:
            if self._scene is not None:
                numbers, before = _numbers(parameters), self._scene.numbers_of(self._executable)
                others = {name: number for name, number in numbers.items() if number != before.get(name)}
                if others and self.phase is Phase.IDLE:
                    raise SceneError(f"{', '.join(others)}: there is no plant, and the next one brings its own numbers")
                self._check_own(others)
                self._scene.changed({**self._staged, **numbers})
        except SceneError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_own(self, numbers: Mapping[str, Any]) -> None:
        """Refuse other numbers beside a law of the user's: neither a bag nor a run without ROS would have them."""
        if self._own and numbers:
            raise SceneError(f"{', '.join(numbers)}: {FIXED}")

    def _stage(self, parameters: list[Parameter]) -> None:
        """Let numbers that were set act from the next state on."""
        if self._scene is not None:
            self._staged.update(_numbers(parameters))

    def _ready(self) -> bool:
        listeners = [JOINT_STATES, LYAPUNOV] if self._monitored else [JOINT_STATES]
        informed = not self._monitored or self.linked(self._announcements, [LYAPUNOV])
        return self._scene is not None and informed and self.linked(self._commands, listeners)

    def _start(self) -> None:
        self.words = f"running with {self._own.words}" if self._own else "running"
        if not self.begun:  # this tells the plant that the controller is ready, so it comes last
            self._states = self.subscribe(JOINT_STATES, self._on_state, raw=True)
        self._ready_to_answer = True
        self.begin()

    def _begin(self, time_ns: int) -> None:
        """Let the numbers that were set act from a time on, and let all know before the command does."""
        assert self._scene is not None
        if time_ns <= self._answered and self._own:
            self._own.reset()
        before, self._scene = self._scene, self._scene.changed(self._staged)
        for warning in self._scene.warnings:
            if warning not in before.warnings:
                self.get_logger().warning(warning)
        self._staged.clear()
        if self._own is None:
            numbers, self._number = self._scene.numbers_of(self._executable), self._number + 1
            numbered = list_message(time_ns, [*numbers], [*numbers.values()], frame=str(self._number))
            self._announcements.publish(numbered)
            # What a reader has received before it receives the command, it also sees before.
            if not self.flush(self._announcements, seconds=ANNOUNCE_SECONDS):
                self.get_logger().warning(f"{CHANGES[self._side].name}: a subscriber did not acknowledge a change")

    def _read(self, cdr: bytes) -> State | None:
        """A state that can be one of this run; None for any other."""
        assert self._scene is not None
        try:
            state, period_ns = self._reader.read(cdr), self._scene.period_ns
        except UNREADABLE:
            self.refuse("malformed messages", JOINT_STATES)
            return None
        known = state.time_ns == 0 or self._answered <= state.time_ns <= self._scene.ticks * period_ns
        if known and state.time_ns % period_ns == 0:
            return state
        self.refuse("refused states", JOINT_STATES)
        return None

    def _on_state(self, cdr: bytes) -> None:
        # A plant that has just come may be sooner than its scene, or than what listens to this node; it asks again.
        if not self._ready_to_answer or self._scene is None or (state := self._read(cdr)) is None:
            return
        if self._free:
            state = self._newest(state)
        time_ns = state.time_ns
        if time_ns == self._answered:
            self.count("repeated states")  # it, or what answered it, was lost on the way
            self._answer(time_ns)
            return
        if self._staged or time_ns <= self._answered or self._answered < 0:
            self._begin(time_ns)
        tick, side, system = time_ns // self._scene.period_ns, SIDES[self._side], self._scene.system
        before, self._answered = self._answered // self._scene.period_ns, time_ns
        every = int(system.laws[side].row[Column.PERIOD])
        if not 0 <= before < tick or before // every != tick // every:  # a free run may pass the tick that is answered
            if self._own:
                force = self._own.command(system, side, tick, self._scene.time_of(tick), state.numbers)
            else:
                force = system.laws[side].command(tick, *state.numbers[COLUMN[side] :][:2])
            if not math.isfinite(force):  # the plant would not take it, and all would wait
                raise Failed(f"the command is no longer finite, t = {time_ns / NANOSECONDS} s")
            self._force = force
        self._answer(time_ns)
        self.count("answered states")

    def _newest(self, state: State) -> State:
        """The last state that waits here, or the first after a reset."""
        for cdr in self.waiting(self._states):
            if (newer := self._read(cdr)) is None:
                continue
            before, state = state, newer
            self.count("skipped states")
            if state.time_ns < before.time_ns:
                self._answered = before.time_ns  # for the reset to be seen, whatever was answered before it
                break
        return state

    def _answer(self, time_ns: int) -> None:
        self._commands.publish(self._template.fill(time_ns, (self._force,)))


class OwnLaw:
    """A law of the user's own, between the sensors and the actuator of the scene."""

    def __init__(self, words: str) -> None:
        self.words = words
        try:
            self._found = find_law(words, f"law: {words}")
        except KeyboardInterrupt as error:  # of the module itself: a node notes signals, they raise none
            raise Refused(f"law: {words}: {described(error)}") from error
        self.reset()

    def reset(self) -> None:
        """Begin anew, without memory."""
        self._law = begin(self._found, f"law: {self.words}")
        self.asks = observables_of(self._law)

    def command(self, system: System, side: int, tick: int, time: float, state: Sequence[float]) -> float:
        """Command in N that answers the state (6,) of a tick, through the stages of the scene."""
        stages, seen = system.laws[side], Observation(system, system.laws, side, tick, state).values(self.asks)
        x, v = stages.measured(tick, *state[COLUMN[side] :][:2])
        try:
            answer = self._law(tick, time, x, v, **seen)
        except BaseException as error:  # an exit and an interrupt, too: a node notes signals, they raise none
            raise Refused(f"law: {self.words}: {described(error)}, at tick {tick}") from error
        return float(limited(stages.row.tolist(), command_of(answer, f"law: {self.words}", tick, time)))


def _numbers(parameters: list[Parameter]) -> dict[str, Any]:
    """Those of the scene."""
    return {parameter.name: parameter.value for parameter in parameters if "." in parameter.name}

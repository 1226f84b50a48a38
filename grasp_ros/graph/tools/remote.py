"""`grasp ctl`: asks a running graph, one call or a shell of them, and waits for what the plant promises."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from inspect import signature
from itertools import islice
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.node import GraspNode, Phase
from grasp_ros.graph.ros.parameter_node import refusing
from grasp_ros.graph.stopping import note_signals, on_signals
from grasp_ros.physics.errors import Failed, Refused, allowed
from grasp_ros.scene import strict_yaml
from grasp_ros.scene.topics import Topic

PATIENCE_SECONDS = 15.0  # without an answer, or without progress; to be found takes over 5 s on a busy machine
SPIN_SECONDS, AGAIN_SECONDS = 0.1, 2.0  # the latter until a question is asked again
SERVICES = ("pause", "resume", "reset", "step", "status")  # of a plant; whoever answers the last client knows all
MOST_DIGITS = 20  # of a whole number; a plant refuses those that it cannot do itself
FAREWELL = ("quit", "exit", "q")
HELP = "pause, resume, step [N], reset, status, get NODE [NAME ...], set NODE NAME VALUE, echo TOPIC [N]"


class Remote(GraspNode):
    """Node `remote`; parameter words, a JSON list: what to ask; empty: what the lines of the standard input say."""

    def __init__(self, **options: Any) -> None:
        super().__init__("remote", **options)
        self._wanted: list[str] = json.loads(self.read_only("words"))
        names = [f"plant/{name}" for name in SERVICES]
        self._known: dict[str, Any] = {name: self.create_client(Trigger, name) for name in names}
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self)
        self._actions: dict[str, Callable[..., str]] = {
            **{name: partial(self.plant, name) for name in SERVICES}, "step": self.step,
            "get": self.get, "set": self.put, "echo": self.echo, "help": lambda: HELP,
        }

    def work(self, received: list[int]) -> bool:
        """Ask once, or be a shell; the exit code is that of the answer, or of the worst one."""

        def stop(number: int, _: object) -> None:  # also a wait for a line, which Python would go on with
            received.append(number)
            raise KeyboardInterrupt

        on_signals(stop)
        try:
            if not received:
                for words in [self._wanted] if self._wanted else self.lines():
                    self.do(words)
        except KeyboardInterrupt:
            self.exit_code = 0  # that of the signal counts
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            if not isinstance(error, BrokenPipeError):  # the reader of our output, `head` say, has had it
                print(f"standard input or output: {error.strerror}", file=sys.stderr)
                self.exit_code = 1
        finally:
            note_signals(received)
        return True

    def lines(self) -> Iterator[list[str]]:
        """Words of the lines of the standard input, until it ends."""
        prompt = "grasp> " if sys.stdin.isatty() else ""
        while True:
            print(prompt, end="", flush=True)
            words = sys.stdin.readline()
            if not words or words.strip() in FAREWELL:
                return
            if words.strip():
                yield words.split()

    def do(self, words: Sequence[str]) -> None:
        """Do what some words ask for, and print what there is to say; the exit code is that of the worst refusal."""
        action = self._actions.get(words[0])
        wrong = Refused(f"{' '.join(words)}: not allowed; allowed: {HELP}")
        try:
            if action is None or "" in words:
                raise wrong
            try:
                signature(action).bind(*words[1:])
            except TypeError:
                raise wrong from None
            with refusing():
                answer = action(*words[1:])
            if answer:
                print(answer, flush=True)
        except Refused as error:
            self.exit_code = max(self.exit_code, error.exit_status)
            print(error, file=sys.stderr, flush=True)

    def step(self, number: str = "1") -> str:
        """Let a paused plant do some periods."""
        wanted = _whole("step", number)
        self._set("plant", "steps", wanted)
        found = self._status("step")
        if (asked := found.get("asked", wanted)) != wanted:
            raise Failed(f"step {wanted}: somebody else has set {asked} steps meanwhile, which are done")
        return self._done(found)

    def plant(self, name: str) -> str:
        """Call a service of the plant, and wait for what it promises."""
        return self._done(self._status(name))

    def _done(self, found: dict[str, Any]) -> str:
        """Wait for what an answer of the plant promises."""
        goal, deadline = found.get("goal", {}), time.monotonic() + PATIENCE_SECONDS
        resets = goal.get("resets", found.get("resets", 0))
        while not goal.items() <= found.items():
            before, found = found, self._status("status")
            if found.get("resets", 0) > resets:
                raise Failed(f"somebody else has reset the plant meanwhile; {_line(found)}")
            if found != before:
                deadline = time.monotonic() + PATIENCE_SECONDS
            elif time.monotonic() > deadline:
                raise Failed(f"no progress in {PATIENCE_SECONDS:g} s: {_line(found)}")
        return _line(found)

    def _status(self, service: str) -> dict[str, Any]:
        if service != "status":  # may not be asked again; a plant that answers the newest client knows all of them
            self._status("status")
        answer = self._ask(Trigger, f"plant/{service}", Trigger.Request(), again=service == "status")
        try:
            found: dict[str, Any] = json.loads(answer.message)
            said = _line(found) if answer.success else found["why"]
        except (ValueError, TypeError, KeyError):
            raise Failed(f"plant/{service}: {answer.message!r} is no answer of a plant") from None
        if not answer.success:
            raise Failed(said)
        return found

    def get(self, node: str, *names: str) -> str:
        """Parameters of a node; all of them without names."""
        known = sorted(self._ask(ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names)
        for name in names:
            if name not in known:
                raise Refused(f"{name}: {node} has no such parameter; {allowed(name, known)}")
        wanted = [*names] or known
        found = self._ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=wanted)).values
        values = [_plain(parameter_value_to_python(value)) for value in found]
        return "\n".join(f"{name}: {json.dumps(value)}" for name, value in zip(wanted, values, strict=False))

    def put(self, node: str, name: str, value: str) -> str:
        """Set a parameter of a node."""
        self._set(node, name, strict_yaml.load(value))
        return self.get(node, name)

    def _set(self, node: str, name: str, value: Any) -> None:
        try:
            message = Parameter(name, value=value).to_parameter_msg()
            serialize_message(message)  # which a call would do, where it is too late to refuse
        except (TypeError, OverflowError, AssertionError, SystemError):  # of the library for what no message holds
            raise Refused(f"{name}: {value} is not allowed; allowed: a type of ROS parameters") from None
        request = SetParameters.Request(parameters=[message])
        [result] = self._ask(SetParameters, f"{node}/set_parameters", request).results
        if not result.successful:
            raise Refused(result.reason)

    def echo(self, topic: str, number: str = "") -> str:
        """Print messages of a topic as they come, a line each; so many, or until a signal."""
        name, wanted = self.resolve_topic_name(topic), _whole(f"echo {topic}", number) if number else None
        self._wait(lambda: bool(self.count_publishers(name)), f"nobody publishes {name} {self.where}")
        [kind, *_] = dict(self.get_topic_names_and_types())[name]
        if kind not in messages.TYPES:
            raise Refused(f"{name}: {kind} cannot be shown; allowed: {', '.join(messages.TYPES)}")
        found: list[Any] = []
        latched = {DurabilityPolicy.TRANSIENT_LOCAL} == {
            writer.qos_profile.durability for writer in self.get_publishers_info_by_topic(name)
        }
        qos = messages.glance_qos(Topic(name, kind, latched=latched))
        subscription = self.create_subscription(messages.TYPES[kind], name, found.append, qos)
        try:
            for message in islice(self._coming(found), wanted):
                print(json.dumps(_plain(message)), flush=True)
        finally:
            self.destroy_subscription(subscription)
        return ""

    def _coming(self, found: list[Any]) -> Iterator[Any]:
        """What a subscription puts into a list, as it comes."""
        while True:
            self._executor.spin_once(timeout_sec=SPIN_SECONDS)
            yield from found
            found.clear()

    def _ask(self, kind: Any, name: str, request: Any, again: bool = True) -> Any:
        """Answer of a service, asked again if none comes: it is lost where the way back is not known within 0.1 s."""
        if name not in self._known:
            self._known[name] = self.create_client(kind, name)
        client = self._known[name]
        self._wait(client.service_is_ready, f"no {name.rpartition('/')[0]} answers {self.where}")
        begin, asked = time.monotonic(), [client.call_async(request)]

        def answered() -> bool:
            if again and time.monotonic() > begin + AGAIN_SECONDS * len(asked):
                asked.append(client.call_async(request))
            return any(future.done() for future in asked)

        self._wait(answered, f"{name}: is there, and has not answered in {PATIENCE_SECONDS:g} s")
        return next(future.result() for future in asked if future.done())

    def _wait(self, condition: Callable[[], bool], otherwise: str) -> None:
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not condition():
            self._executor.spin_once(timeout_sec=SPIN_SECONDS)
            if time.monotonic() > deadline:
                raise Failed(otherwise)


def _whole(what: str, word: str) -> int:
    if not word.isdecimal() or len(word) > MOST_DIGITS or not int(word):
        raise Refused(f"{what} {word}: not allowed; allowed: a whole number >= 1")
    return int(word)


def _line(status: dict[str, Any]) -> str:
    """A status for a reader."""
    if status["state"] == Phase.WAITING.value:
        return f"{status['scene']}: {status['words']}"
    return (f"{status['scene']}: {status['state']} at tick {status['tick']} of {status['ticks']},"
            f" t = {status['time_s']:g} s, resets: {status['resets']}")


def _plain(value: Any) -> Any:
    """A message, or what is in one, as JSON has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (list, tuple, array)):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.hex() if isinstance(value, bytes) else value

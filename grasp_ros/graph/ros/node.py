"""What every node of the graph shares: parameters, health, and the wait for its peers."""

from __future__ import annotations

import os
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from functools import partial
from itertools import islice
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from grasp_ros.graph.host import place
from grasp_ros.graph.parameters import TEXTS
from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.messages import Level
from grasp_ros.graph.stopping import tell_parent
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import DIAGNOSTICS, Topic

RCLError = rclpy_implementation.RCLError
PEER_SECONDS = 0.05
REPORT_SECONDS = 1.0
PATIENCE_SECONDS = 5.0
ACKNOWLEDGE_SECONDS = 5.0
LOSSES = ("lost", "silent")  # how the counters begin that are never again as if nothing had been
SWEEP = 100  # messages of one topic at a time
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # what discovery answers until it has the name


class Phase(Enum):
    """What a node is about; its words say more."""

    WAITING = "waiting"  # for those without whom it does not begin
    RUNNING = "running"
    LEFT = "left"  # without a plant; it waits for the next one
    FINISHED = "finished"
    FAILED = "failed"


class GraspNode(Node):
    """A node with parameters, counters on /diagnostics and an end.

    Parameters
    ----------
    name : str
    options
        As in `rclpy.node.Node`: context, namespace, parameter_overrides and so on.

    Attributes
    ----------
    finished : bool
        Whether there is nothing left to do; `run` and `spin` end then.
    exit_code : int
        0, or 1 after a failure, 2 after a refusal.
    phase : Phase
    words : str
        What it does or waits for; the message of its /diagnostics.
    counters : dict of str to number or text
        The values of its /diagnostics.
    """

    why_read_only = "set at the start only, with -p or a parameter file"
    stays = False  # whether it goes on when a run is over

    def __init__(self, name: str, **options: Any) -> None:
        with _refusing():
            super().__init__(name, **options)
        self.finished = False
        self.exit_code = 0
        self.counters: dict[str, int | float | str] = {}
        self._complaints: dict[tuple[str, Topic], float] = {}  # when to say it again
        self._ended = False
        self.concern = ""  # what is not as it should be, although the node goes on
        self.trouble = ""  # what keeps it from going on
        self.strangers = ""  # who publishes what somebody else does
        self.phase = Phase.WAITING
        self.words = f"waiting for peers {place(os.environ, self.get_namespace())}"
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.publisher(DIAGNOSTICS)
        self.wall_timer(REPORT_SECONDS, self.report)

    def read_only(self, name: str, default: Any) -> Any:
        """Declare a parameter that is set at start only, and return its value."""
        number = isinstance(default, float)  # for which an integer will do as well
        descriptor = ParameterDescriptor(description=TEXTS[name], read_only=True, dynamic_typing=number)
        value = self._declare(name, default, descriptor)
        if not number:
            return value
        if not isinstance(value, (float, int)) or isinstance(value, bool):
            raise Refused(f"{name}: {value!r} is not allowed; allowed: a number")
        return float(value)

    def _declare(self, name: str, default: Any, descriptor: ParameterDescriptor) -> Any:
        """The value that the start has given, or the default."""
        with _refusing():
            return _plain(self.declare_parameter(name, default, descriptor).value)

    def declare_scene(self, scene: Scene, executable: str) -> dict[str, Any]:
        """Declare the numbers of a scene that belong to an executable; returns what the start has put in their place.

        The types are dynamic so that an integer will do for a floating-point number.

        Raises
        ------
        Refused
            If the start has given a number that is not allowed, or one that is not there.
        """
        given = {}
        for effect in scene.effects:
            for parameter in effect.parameters if effect.node == executable else ():
                if parameter.key not in scene.values[effect.section]:
                    continue
                name, value = f"{effect.section}.{parameter.key}", scene.values[effect.section][parameter.key]
                found = self._declare(name, list(value) if parameter.several else value, messages.descriptor(parameter))
                if not parameter.accepts(found):
                    raise Refused(f"{name}: {found!r} is not allowed; allowed: {parameter.allowed}")
                if (found := parameter.read(found)) != value:
                    given[name] = found
        unknown = [name for name in self._parameter_overrides if not self.has_parameter(name)]
        if unknown:  # rclpy itself would not say a word
            raise Refused(f"{', '.join(unknown)}: no such parameter; allowed: {', '.join(sorted(self._parameters))}")
        return given

    def forget_scene(self) -> None:
        """Take back what `declare_scene` declared; rclpy itself does not let go of what is read-only."""
        for name in [name for name in self._parameters if "." in name]:
            del self._parameters[name], self._descriptors[name]

    def set_parameters_atomically(self, parameter_list: list[RosParameter]) -> SetParametersResult:
        """Set parameters; integers become floating-point numbers, and a refusal says why.

        What is fixed may be set to what it is, so that a node takes its own dump.
        """
        numbers = []
        for parameter in parameter_list:
            if self.has_parameter(parameter.name) and self.describe_parameter(parameter.name).read_only:
                if _plain(parameter.value) == _plain(self.get_parameter(parameter.name).value):
                    continue
                return SetParametersResult(successful=False, reason=f"{parameter.name}: {self.why_read_only}")
            whole = parameter.type_ == RosParameter.Type.INTEGER and not self._is_whole(parameter.name)
            numbers.append(RosParameter(parameter.name, value=float(parameter.value)) if whole else parameter)
        return super().set_parameters_atomically(numbers) if numbers else SetParametersResult(successful=True)

    def _is_whole(self, name: str) -> bool:
        """Whether a parameter was declared as an integer for good."""
        if not self.has_parameter(name) or self.describe_parameter(name).dynamic_typing:
            return False
        return bool(self.get_parameter(name).type_ == RosParameter.Type.INTEGER)

    def publisher(self, topic: Topic) -> Publisher:
        """Create the publisher of a topic of the graph."""
        return self.create_publisher(messages.TYPES[topic.type], topic.name, messages.qos(topic))

    def subscribe(
        self, topic: Topic, callback: Callable[[Any], None], raw: bool = False,
        read: Callable[[bytes], Any] | None = None,
    ) -> Subscription:
        """Subscribe to a topic of the graph; raw hands over the serialized bytes, read what it makes of them.

        What cannot be decoded is refused here: the executor would raise.
        """
        kind = messages.TYPES[topic.type]
        read = read or partial(deserialize_message, message_type=kind)

        def decode(cdr: bytes) -> None:
            try:
                message = read(cdr)
            except messages.UNREADABLE:
                self.refuse("malformed messages", topic)
                return
            callback(message)

        qos, take = messages.reader_qos(topic), partial(self.guarded, callback if raw else decode)
        return self.create_subscription(kind, topic.name, take, qos, raw=True)

    def guarded(self, action: Callable[..., None], *words: Any) -> None:
        """Do something; end with a sentence if it is refused. The executor would print a traceback."""
        try:
            action(*words)
        except Refused as error:
            self.fail(str(error))
            self.exit_code = 2

    def sources(self, topic: Topic) -> list[str]:
        """Full names of the nodes that publish on a topic, as far as discovery has them."""
        return sorted(
            f"{writer.node_namespace.rstrip('/')}/{writer.node_name}"
            for writer in self.get_publishers_info_by_topic(topic.name)
        )

    def wall_timer(self, seconds: float, callback: Callable[[], None]) -> Any:
        """Timer on wall time: simulated time waits for the nodes, so no node may wait for it."""
        return self.create_timer(seconds, partial(self.guarded, callback), clock=self._steady)

    def when(self, ready: Callable[[], bool], action: Callable[[], None]) -> None:
        """Do something once, as soon as a condition holds."""

        def poll() -> None:
            if ready():
                timer.cancel()
                action()
            else:
                self.get_logger().info(self.words, throttle_duration_sec=PATIENCE_SECONDS, skip_first=True)

        timer = self.wall_timer(PEER_SECONDS, poll)

    def linked(self, publisher: Publisher, sources: Sequence[Topic]) -> bool:
        """Whether a node that publishes it listens to this publisher, for each source topic.

        Matching is asynchronous and messages sent before it are lost. Names come from discovery, which is earlier
        than matching; so every discovered subscription must also have been matched. A stranger may publish unheard.
        """
        readers = self.get_subscriptions_info_by_topic(publisher.topic_name)
        listening = {(reader.node_namespace, reader.node_name) for reader in readers if reader.node_name != UNKNOWN}
        for source in sources:
            writers = self.get_publishers_info_by_topic(source.name)
            if not any((writer.node_namespace, writer.node_name) in listening for writer in writers):
                return False
        return bool(publisher.get_subscription_count() >= len(readers))

    def delivered(self, publisher: Publisher) -> bool:
        """Whether every reader that is matched has what was published; what it received it will also see first."""
        return bool(publisher.wait_for_all_acked(Duration(seconds=0)))

    def count(self, counter: str, number: int = 1) -> None:
        """Add to a counter."""
        self.counters[counter] = int(self.counters.get(counter, 0)) + number

    def refuse(self, counter: str, topic: Topic) -> None:
        """Count a message that cannot be true, and say every few seconds whose it may be."""
        self.count(counter)
        now = time.monotonic()
        if now >= self._complaints.get((counter, topic), 0.0):
            self._complaints[counter, topic] = now + PATIENCE_SECONDS
            names = " and ".join(self.sources(topic)) or "none any more"
            self.get_logger().warning(f"{topic.name}: {counter}: {self.counters[counter]}; sources: {names}")

    def flush(self, *publishers: Publisher) -> None:
        """Let every reader have the last messages before the process ends, within ACKNOWLEDGE_SECONDS in all."""
        deadline = time.monotonic() + ACKNOWLEDGE_SECONDS
        for publisher in publishers:
            publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 1e-3)))

    def report(self) -> None:
        """Publish the counters."""
        stamp = self.get_clock().now().to_msg()
        lost = any(self.counters[key] for key in self.counters if key.startswith(LOSSES))
        failed, doubtful = self.exit_code or self.trouble, lost or self.concern or self.strangers
        level = Level.ERROR if failed else Level.WARN if doubtful else Level.OK
        summary = "; ".join(words for words in (self.words, self.trouble, self.concern, self.strangers) if words)
        values = {"phase": self.phase.value, **self.counters}
        self._diagnostics.publish(
            messages.diagnostics(stamp, self.get_fully_qualified_name(), summary, level, values)
        )

    def fail(self, reason: str) -> None:
        """End with a sentence, and with the exit status 1."""
        self.phase, self.words = Phase.FAILED, reason
        tell_parent(self.get_name(), reason)
        self.get_logger().fatal(reason)
        self.exit_code = 1
        self.finished = True

    def waiting(self, subscription: Subscription) -> Iterator[Any]:
        """What has come on a topic and was not taken by the executor."""
        while True:
            with subscription.handle:
                found = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if found is None:
                return
            yield found[0]

    def sweep(self) -> None:
        """Take what the executor has not been told of.

        Between looking for messages and listening for them, rmw_fastrtps is deaf for a moment: the first message of a
        topic can lie there until the second comes.
        """
        for subscription in tuple(self.subscriptions):
            for message in islice(self.waiting(subscription), SWEEP):
                subscription.callback(message)
        for service in tuple(self.services):
            with service.handle:
                request, header = service.handle.service_take_request(service.srv_type.Request)
            if header is not None:
                service.send_response(service.callback(request, service.srv_type.Response()), header)

    def behind(self) -> object:
        """What changes while it takes what had arrived before a signal; None: nothing that must be taken."""
        return None

    def end(self) -> None:
        """Close and destroy, once."""
        if not self._ended:
            self._ended = True
            self.close()
            self.part()
            self.destroy_node()

    def part(self) -> None:
        """Say last words; called once, before the node is destroyed."""

    def close(self) -> None:
        """Release what is not ROS; called once, also after a signal, when the context is already invalid."""


def _plain(value: Any) -> Any:
    """Value of a parameter, a list where rclpy has an array."""
    return list(value) if isinstance(value, array) else value


@contextmanager
def _refusing() -> Iterator[None]:
    """Refuse what rclpy refuses of the parameters that the start has given, and what DDS cannot be, secure for one."""
    try:
        yield
    except (ParameterException, RCLError) as error:
        raise Refused(" ".join(str(error).split())) from None

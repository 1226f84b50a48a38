"""What every node of the graph shares: parameters, health, and the wait for its peers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from functools import partial
from itertools import islice
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from grasp_ros.graph.host import location
from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.parameter_node import ParameterNode
from grasp_ros.graph.stopping import tell_parent
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.topics import DIAGNOSTICS, Topic

PEER_SECONDS = 0.05
REPORT_SECONDS = 1.0
PATIENCE_SECONDS = 5.0
ACKNOWLEDGE_SECONDS, LOOK_SECONDS = 5.0, 1e-3  # the latter between looks for acknowledgements
LOSSES = ("lost", "silent")  # how the counters begin that are never again as if nothing had been
SWEEP = 100  # messages of one topic at a time, unless a node ends
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # what discovery answers until it has the name
NEW = "a node whose name is not known yet"


class Phase(Enum):
    """What a node is about; its words say more."""

    WAITING = "waiting"  # for those without whom it does not begin
    RUNNING = "running"
    IDLE = "idle"  # without a plant; it waits for the next one
    FINISHED = "finished"
    FAILED = "failed"


class GraspNode(ParameterNode):
    """A node with counters on /diagnostics and an end."""

    stays = False  # whether it goes on when a run is over

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.begun = False  # whether the peers it waited for have come: what is refused before is what it was given
        self.finished = False  # whether there is nothing left to do
        self.exit_code = 0  # 1 after a failure, 2 after a refusal before it has begun
        self.counters: dict[str, int | float | str] = {}  # the values of its /diagnostics
        # Topics that have one publisher each, with what a second one would do, if that is known.
        self.inputs: dict[Topic, str] = {}
        self._complaints: dict[tuple[str, Topic], float] = {}  # when to say it again
        self.concern = ""  # what is not as it should be, although the node goes on
        self.trouble = ""  # what keeps it from going on
        self.phase = Phase.WAITING
        self.where = location(os.environ, self.get_namespace())  # where it looks for others, in words
        self.words = f"waiting for peers {self.where}"  # what it does or waits for: the message of its /diagnostics
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._diagnostics = self.publisher(DIAGNOSTICS)
        self.wall_timer(REPORT_SECONDS, self.report)

    def publisher(self, topic: Topic) -> Publisher:
        """Create the publisher of a topic of the graph."""
        return self.create_publisher(messages.TYPES[topic.type], topic.name, messages.qos(topic))

    def subscribe(self, topic: Topic, callback: Callable[[Any], None], raw: bool = False) -> Subscription:
        """Subscribe to a topic of the graph; raw hands over the serialized bytes.

        What cannot be decoded is refused here: the executor would raise.
        """
        self.inputs[topic] = ""
        kind = messages.TYPES[topic.type]

        def decode(cdr: bytes) -> None:
            try:
                message = deserialize_message(cdr, kind)
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
            self.fail(str(error), 1 if self.begun else 2)

    def sources(self, topic: Topic) -> list[str]:
        """Full names of the nodes that publish on a topic, as far as discovery has them."""
        return sorted(
            NEW if writer.node_name == UNKNOWN else f"{writer.node_namespace.rstrip('/')}/{writer.node_name}"
            for writer in self.writers(topic)
        )

    def writers(self, topic: Topic, connected: bool = True) -> list[TopicEndpointInfo]:
        """Publishers that a reader of a topic is connected with, or those of another type or quality of service."""
        return [writer for writer in self.get_publishers_info_by_topic(topic.name) if connected is (
            writer.topic_type == topic.type and messages.connects(writer.qos_profile, messages.reader_qos(topic)))]

    def readers(self, publisher: Publisher) -> list[TopicEndpointInfo]:
        """Subscriptions that a publisher is connected with, as soon as discovery is through."""
        return [reader for reader in self.get_subscriptions_info_by_topic(publisher.topic_name)
                if messages.TYPES.get(reader.topic_type) is publisher.msg_type
                and messages.connects(publisher.qos_profile, reader.qos_profile)]

    def wall_timer(self, seconds: float, callback: Callable[[], None]) -> Any:
        """Timer on wall time: simulated time waits for the nodes, so no node may wait for it."""
        return self.create_timer(seconds, partial(self.guarded, callback), clock=self._steady)

    def when(self, ready: Callable[[], bool], action: Callable[[], None]) -> None:
        """Do something once, as soon as a condition holds."""

        def poll() -> None:
            if ready():
                timer.cancel()
                action()

        timer = self.wall_timer(PEER_SECONDS, poll)

    def linked(self, publisher: Publisher, sources: Sequence[Topic]) -> bool:
        """Whether a node that publishes it listens to this publisher, for each source topic.

        Matching is asynchronous and messages sent before it are lost. Names come from discovery, which is earlier
        than matching; so every discovered subscription must also have been matched. Others may publish unheard.
        """
        readers = self.readers(publisher)
        listening = {(reader.node_namespace, reader.node_name) for reader in readers if reader.node_name != UNKNOWN}
        names = ({(writer.node_namespace, writer.node_name) for writer in self.writers(source)} for source in sources)
        return publisher.get_subscription_count() >= len(readers) and all(map(listening.intersection, names))

    def count(self, counter: str, number: int = 1) -> None:
        """Add to a counter."""
        self.counters[counter] = int(self.counters.get(counter, 0)) + number

    def refuse(self, counter: str, topic: Topic, why: str = "", names: Sequence[str] = ()) -> None:
        """Count a message that cannot be true, and say every few seconds whose it may be, and why.

        `names`: of the sources when it came, if that was before; whoever left at once may not be seen.
        """
        self.count(counter)
        now = time.monotonic()
        if now >= self._complaints.get((counter, topic), 0.0):
            self._complaints[counter, topic] = now + PATIENCE_SECONDS
            seen = " and ".join(names or self.sources(topic)) or "none any more"
            words = f"{topic.name}: {counter}: {self.counters[counter]}; sources seen: {seen}"
            self.get_logger().warning(f"{words}; {why}" if why else words)

    def flush(self, *publishers: Publisher, seconds: float = ACKNOWLEDGE_SECONDS) -> bool:
        """Wait until every reader has acknowledged what was published, so many seconds at most; whether all have.

        A longer wait of rclpy's would let no other thread run: no heartbeat, no look at signals.
        """
        deadline = time.monotonic() + seconds
        while not all(publisher.wait_for_all_acked(Duration(seconds=0)) for publisher in publishers):
            if time.monotonic() > deadline:
                return False
            time.sleep(LOOK_SECONDS)
        return True

    def report(self) -> None:
        """Publish the counters."""
        lost = any(self.counters[key] for key in self.counters if key.startswith(LOSSES))
        failed, uncertain = self.exit_code or self.trouble, lost or self.concern
        status = DiagnosticStatus(name=self.get_fully_qualified_name(), hardware_id="grasp_ros")
        status.level = status.ERROR if failed else status.WARN if uncertain else status.OK
        status.message = "; ".join(filter(None, (self.words, self.trouble, self.concern)))
        values = {"phase": self.phase.value, **self.counters}
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def fail(self, reason: str, status: int = 1) -> None:
        """End with a sentence, and with an exit status: 2 of what is refused before it has begun."""
        self.phase, self.words = Phase.FAILED, reason
        tell_parent(self.get_name(), reason, status)
        self.get_logger().fatal(reason)
        self.exit_code = status
        self.finished = True

    def waiting(self, subscription: Subscription) -> Iterator[Any]:
        """What has come on a topic and was not taken by the executor."""
        while True:
            with subscription.handle:
                found = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if found is None:
                return
            yield found[0]

    def take_waiting(self, subscriptions: Iterable[Subscription], most: int = SWEEP) -> None:
        """Take the messages that the executor has not noticed, in the order in which the subscriptions were made.

        Between looking for messages and listening for them, rmw_fastrtps is deaf for a moment: the first message of a
        topic can lie there until the second comes. The last subscription is looked at first: whoever sends a command
        when all have confirmed what he announced before finds both taken, or the announcement alone.
        """
        taken = [(own, [*islice(self.waiting(own), most)]) for own in reversed([*subscriptions])]
        for subscription, came in reversed(taken):
            for message in came:
                subscription.callback(message)

    def sweep(self) -> None:
        """Take messages and requests that the executor has not noticed."""
        self.take_waiting(self.subscriptions)
        for service in tuple(self.services):
            with service.handle:
                request, header = service.handle.service_take_request(service.srv_type.Request)
            if header is not None:
                service.send_response(service.callback(request, service.srv_type.Response()), header)

    def work(self, received: list[int]) -> bool:
        """Do in place of a spin what has an order of its own, until something is received; whether there is any."""
        return False

    def close(self) -> None:
        """Release what is not ROS; called once, also after a signal, when the context is already invalid."""

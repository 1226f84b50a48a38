"""The plant: owner of time. It integrates the collision dynamics and publishes the states.

When it advances is decided by one of two loops, `lockstep` (the default) and `free_running`, and by those who steer it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from typing import Any

from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rclpy.duration import Duration
from std_msgs.msg import String

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status, compile_kernels
from grasp_ros.graph.health.heartbeat import digest
from grasp_ros.graph.health.peers import SLOW, Need, PeerNode
from grasp_ros.graph.lockstep.free_running import FreeRunning
from grasp_ros.graph.lockstep.lockstep import Lockstep
from grasp_ros.graph.parameters import Running, check_factor
from grasp_ros.graph.ros.node import Phase
from grasp_ros.graph.serialization import SHORTEST, raw_stamp_ns, template_of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, LYAPUNOV, RUN, SCENE, WINDOW
from grasp_ros.simulation.progress import showing
from grasp_ros.simulation.sampled_plant import SampledPlant

MOST_STEPS = 10**9


class Plant(PeerNode):
    """Node `plant`; parameters scene, accuracy, wait_for_monitor, progress, those of its loop and of the scene."""

    why_read_only = "it describes what is simulated, which does not change in a run; set it in the scene or with -p"

    def __init__(self, **options: Any) -> None:
        super().__init__("plant", **options)
        name = self.read_only("scene")
        self._accuracy = self.read_only("accuracy")
        self.monitored = self.read_only("wait_for_monitor")
        progress = self.read_only("progress")
        free = self.read_only("free_running")
        waits = free and self.read_only("wait_for_controllers")
        paused = self.read_only("paused")
        default, text = self._settings["steps"]  # of one call of the service `step`
        self.declare("steps", default, ParameterDescriptor(
            description=text, integer_range=[IntegerRange(from_value=1, to_value=MOST_STEPS, step=1)],
        ))
        scene = scenes.load(name)
        running = Running(self._accuracy)
        if free:  # parameters that exist only there
            factor = self.read_only("real_time_factor")
            check_factor(factor)
            timeouts, reactions = {}, {}
            for side in (NAMES[body] for body in scene.system.laws):
                timeouts[side] = self.read_only(f"{side}_timeout_s")
                reactions[side] = self.read_only(f"{side}_on_timeout")
            running = Running(self._accuracy, factor, timeouts, reactions)
        self.scene = scene.changed(self.declare_scene(scene, "plant"))
        for warning in self.scene.warnings:
            self.get_logger().warning(warning)
        self._plant = self._new_plant()
        self._state_template = template_of(JOINT_STATES, [NAMES[body] for body in self.scene.system.present])
        self._clock_template = template_of(CLOCK)
        self._others = False  # whether there was another plant at the last report
        self.resets, self.published_at = 0, math.inf  # wall time of the current state, s
        self._recorded, self.recorded_at = -1, -math.inf  # last tick that the monitor has; when it said so
        self._begin = math.nan  # wall time of the first state
        self.counters["refused records"] = 0
        self._shown = ExitStack()
        self._bar = self._shown.enter_context(showing(progress, self.scene.ticks, "tick", self.scene.name))
        self._states = self.publisher(JOINT_STATES)
        self._forces = [(self.publisher(output.topic), template_of(output.topic), output.value)
                        for output in self.scene.outputs]
        self._simulated = self.publisher(CLOCK)
        self.inputs[CLOCK] = "use_sim_time jumps between their times"  # of all that read it
        self._descriptions = [self.publisher(RUN), self.publisher(SCENE)]
        texts = [running.to_yaml(), self.scene.to_yaml()]
        self.heartbeats.own.texts = [digest(text) for text in texts]
        for publisher, text in zip(self._descriptions, texts, strict=True):
            publisher.publish(String(data=text))
        compile_kernels()  # while others get ready for this scene
        if self.monitored:
            self.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)
        self.loop = FreeRunning(self, paused, running, waits) if free else Lockstep(self, paused)
        self.when(self._ready, self._start)

    def _new_plant(self) -> SampledPlant:
        system = self.scene.system
        integrator = Integrator(system, continuous=False, accuracy=self._accuracy)
        return SampledPlant(system, self.scene.period_ns, integrator)

    @property
    def tick(self) -> int:
        """Control periods done since the start or the last reset."""
        return self._plant.tick

    @property
    def at_end(self) -> bool:
        """Whether the horizon of the scene has been reached."""
        return self.tick == self.scene.ticks

    def outrun(self, lead: int = WINDOW) -> bool:
        """Whether it has to wait for its monitor, which is more than some ticks behind."""
        return self.monitored and self.tick - self._recorded > lead

    def _on_lyapunov(self, cdr: bytes) -> None:
        stamp = raw_stamp_ns(cdr) if len(cdr) >= SHORTEST else -1
        tick, rest = divmod(stamp, self.scene.period_ns)
        newest = 0 if self.resets and self._recorded < 0 else self.tick  # others are of the time before a reset
        if not rest and max(self._recorded, 0) <= tick <= newest:
            self._recorded, self.recorded_at = tick, time.monotonic()
            self.loop.advance()
        elif rest or not self.resets:
            self.refuse("refused records", LYAPUNOV)

    def report(self) -> None:
        """Publish the counters; fail if there is another plant."""
        self.counters.update(tick=self.tick, resets=self.resets)
        super().report()
        self._refuse_other_plants()
        self.loop.report()

    def needs(self) -> Iterator[Need]:
        """Of its loop: controllers and monitor."""
        return self.loop.needs()

    def blocking_limit(self) -> float | None:
        """In one process the laws are in this thread: as long as an answer of another process may take."""
        return SLOW * self.patience if self.begun and self.loop.answered else super().blocking_limit()

    def progress(self) -> object:
        """Its time."""
        return self.tick, self.resets

    def look(self) -> None:
        """See to it that everybody is there; ask again what has not been answered."""
        super().look()
        self._show()
        if self.begun and not self.finished:
            self.loop.ask_again(time.monotonic())

    def _refuse_other_plants(self) -> None:
        """Fail if there is another one that does not give way.

        Before the start any that has a heartbeat, for others may be dead; later one without, if it stays: those of this
        package see that this one is there.
        """
        names = self.sources(JOINT_STATES)
        own, before = self.get_fully_qualified_name(), self._others
        self._others = self.begun and any(name != own and not self.heartbeats.of([name]) for name in names)
        alive = not self.begun and not all(map(self.is_dead, self.heartbeats.of(names)))
        if alive or (before and self._others):
            self.fail(f"{self._states.topic_name}: another plant publishes here, sources {', '.join(names)};"
                      " use another ROS_DOMAIN_ID or namespace")

    def _ready(self) -> bool:
        self._refuse_other_plants()
        missing = [*filter(None, [self.missing(JOINT_STATES)]), *self.loop.missing()]
        monitor = [LYAPUNOV] if self.monitored else []
        missing += [] if self.linked(self._states, monitor) else [LYAPUNOV.name]
        nodes = [name for topic in [*self.loop.topics, *monitor] for name in self.sources(topic)]
        busy = self.heartbeats.without(self.heartbeats.own.texts[-1], nodes)
        if busy and not missing:
            self.words = f"waiting for {' and '.join(busy)} to take this scene"
        elif missing:
            incompatible = [f"not connected: {writer.node_name}, whose {topic.name} is {writer.topic_type},"
                            f" {writer.qos_profile.reliability.name.lower()}; needed: {topic.type}, reliable"
                            for topic in self.scene.controllers.values()
                            for writer in self.writers(topic, connected=False)]
            self.words = "; ".join((f"waiting for {', '.join(missing)}", *incompatible))
        else:
            deaf = [topic.name for topic in self.loop.topics if not self.linked(self._states, [topic])]
            self.words = (f"waiting for publishers of {' and '.join(deaf) or 'a command'} to subscribe to"
                          f" {JOINT_STATES.name} and for connections")
        # Who has been here with another plant must have this scene before its first state.
        known = all(self.linked(publisher, ()) and publisher.wait_for_all_acked(Duration(seconds=0))
                    for publisher in (*self._descriptions, self.heartbeats.publisher))
        return not (missing or busy) and known and self.linked(self._states, [*self.loop.topics, *monitor]) and all(
            self.linked(publisher, monitor) for publisher, _, _ in self._forces
        )

    def _start(self) -> None:
        self.begin()
        self.words = "running"
        self.heartbeats.tell()  # with the digests of its texts
        self._begin = time.monotonic()
        self.publish_state()
        self.loop.start()

    def publish_state(self) -> None:
        """Send the state of the current tick and what belongs to it."""
        self.published_at = time.monotonic()
        self.repeat()

    def repeat(self) -> None:
        """Publish the current state again: something on the way to or from those who answer it was lost."""
        tick, state = self._plant.tick, self._plant.state
        time_ns = tick * self.scene.period_ns
        present, numbers, effort = self.scene.system.present, state.tolist(), self._plant.effort.tolist()
        x, v = ([numbers[COLUMN[body] + part] for body in present] for part in (0, 1))
        self._simulated.publish(self._clock_template.fill(time_ns, ()))
        self._states.publish(self._state_template.fill(time_ns, [*x, *v, *(effort[body] for body in present)]))
        for publisher, template, value in self._forces:  # while the controllers answer the state
            publisher.publish(template.fill(time_ns, (value(self.scene.system, tick, state),)))

    def step(self, forces: Array) -> None:
        """Advance one period with the answers (3,) in N by body to the current state; publish the next."""
        self._plant.step(forces)
        if self._plant.status is not Status.DONE:
            self.fail(self._plant.stop)
            return
        self.publish_state()

    def restart(self) -> None:
        """Put time and state back to the beginning of the scene, and publish the first state again."""
        self.get_logger().info(f"reset at tick {self.tick}")
        self._plant, self._recorded = self._new_plant(), -1
        self.resets += 1
        self._begin = time.monotonic()
        self.publish_state()

    def finish(self) -> None:
        """End: the horizon has been reached and answered."""
        self.phase, self.words = Phase.FINISHED, "finished"
        self.finished = True
        ticks, seconds = self.scene.ticks, time.monotonic() - self._begin
        speed = ticks / seconds
        self.get_logger().info(f"finished {ticks} ticks in {seconds:.1f} s: {speed:.1f} ticks/s including pauses")
        self.heartbeats.end("")  # for the monitor, which may be in this thread

    def _show(self) -> None:
        with suppress(OSError):  # a terminal that is gone ends no run
            if self._bar is not None:
                self._bar(self.tick)

    def close(self) -> None:
        """End the progress bar, and tell how a run that ends early kept its time."""
        self._show()
        with suppress(OSError):
            self._shown.close()
        if self.begun:
            self.loop.report()

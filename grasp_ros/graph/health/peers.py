"""A node that needs others: it notices when one of them is gone or silent, says which, and ends or keeps waiting."""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from grasp_ros.graph.health.heartbeat import ENDED, Heartbeat, Heartbeats, Watchdog, digest
from grasp_ros.graph.parameters import check_timeouts
from grasp_ros.graph.ros.node import ACKNOWLEDGE_SECONDS, NEW, PATIENCE_SECONDS, GraspNode, Phase
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import TEXT_BYTES
from grasp_ros.scene.topics import ALIVE, DIAGNOSTICS, JOINT_STATES, Topic

LOOK_SECONDS = 0.25
STILL_SECONDS = 1.0  # between two looks: this thread was busy
ARRIVAL_SECONDS = 1.0  # at most until what was sent before a signal has arrived: a reader that was killed never says so
GONE_SECONDS = 0.7  # without a source: its last messages are on the way
SLOW = 4  # times longer who shows that it lives may take
MOST_TEXTS = 8  # of a topic, whose digest no heartbeat has yet


class Need(NamedTuple):
    """A topic that somebody has to publish.

    If nobody does any more, a node that `stays` waits for the next one; others end, or do as on_silence says where
    somebody else may take over.
    """

    topic: Topic
    what: str = ""  # is due
    due: float = math.inf  # since this wall time
    first: bool = False  # whether it would be the first
    replaceable: bool = False  # whether somebody else may take over


class Trouble(NamedTuple):
    """What is wrong with a topic."""

    words: str
    certain: bool  # whether it is more than slowness


class PeerNode(GraspNode):
    """A node that needs others; parameters peer_timeout_s, start_timeout_s, on_silence."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.patience = self.read_only("peer_timeout_s")
        self.start_patience = self.read_only("start_timeout_s") or math.inf
        reaction = self.read_only("on_silence")
        check_timeouts(self.patience, self.start_patience)
        if reaction not in ("end", "wait"):
            raise Refused(f"on_silence: {reaction!r} is not allowed; allowed: end, wait")
        self._ends = reaction == "end"
        self._silent: dict[str, float] = {}  # by topic: since when
        self._said = 0.0  # when that was last said
        self._left: tuple[Phase, str] | None = None  # what it did before a peer ended without which it stays
        self._gone: dict[Topic, float] = {}
        self._last: dict[Topic, list[str]] = {}  # names of the last sources
        # Texts that wait: since when, on which topic, from which sources, and who takes them.
        self._texts: list[tuple[float, Topic, list[str], str, Callable[[str], None]]] = []
        self._taken: dict[Topic, tuple[str, str]] = {}  # digest, and who said it
        self._held: set[str] = set()  # digests of texts that wait until another plant has ended
        self.counters.update({"silent peers": 0, "refused texts": 0, "second sources": 0})
        self._watchdog = Watchdog(
            self.get_name(), self.patience, self.blocking_limit, self._ends, lambda: self.heartbeats.frozen()
        )
        self.heartbeats = Heartbeats(self, self.heard, self._watchdog.beat)
        self._looked = time.monotonic()
        self._first_look = 0.0  # wall time of the first look: all that may take long is done
        self._before: object = None  # progress at the last look
        self.wall_timer(LOOK_SECONDS, self.look)

    def needs(self) -> Iterator[Need]:
        """What this node needs of others now that it has begun: the plant, which itself needs all others."""
        yield Need(JOINT_STATES)

    def blocking_limit(self) -> float | None:
        """Time in s that its thread may be blocked, as by a law that does not return; None: any, before it begins."""
        return self.start_patience if self.begun else None

    @abstractmethod
    def progress(self) -> object:
        """Something that changes while all is well."""

    def report(self) -> None:
        """Publish the counters; name the publishers of a topic that has more than one."""
        for topic, why in self.inputs.items():
            if topic not in (ALIVE, DIAGNOSTICS) and len(self.living(topic)) > 1:
                self.refuse("second sources", topic, why)
        super().report()

    def begin(self) -> None:
        """Take note of who is there as it begins: a peer may have ended before the first look."""
        self.begun, self.concern, self.phase = True, "", Phase.RUNNING
        self._last.update((need.topic, names) for need in self.needs() if (names := self.sources(need.topic)))

    def look(self) -> None:
        """See to it that everybody is there."""
        if self._watchdog.stopped:  # its thread looks first
            return
        now = time.monotonic()
        seconds, self._watchdog.suspended_for = self._watchdog.suspended_for, 0.0
        if seconds and self.begun and not self.finished:
            self.get_logger().warning(f"this node was suspended for {seconds:.1f} s")
        if not self._first_look:
            self._first_look = now
            self.heartbeats.own.ready = True
        progress = self.progress()
        if progress == self._before or now - self._looked > STILL_SECONDS:  # what others did may wait here
            self.sweep()
        self._before, self._looked = progress, now
        self._watchdog.feed()
        self.heard()
        if self.finished:
            return
        if not self.begun:
            waited = now - max(self._first_look, self.heartbeats.prepared)
            self.concern = f"for {waited:.0f} s" if waited > self.patience else ""
            self.get_logger().info(self.words, throttle_duration_sec=PATIENCE_SECONDS, skip_first=True)
            if waited > self.start_patience and self._ends:
                self.fail(f"{self.words}; timeout of {self.start_patience:g} s")
            return
        for need in self.needs():
            self._note(need, self._trouble_with(need, now), now)
            if self.finished or self._left:
                return

    def _trouble_with(self, need: Need, now: float) -> Trouble | None:
        """What is wrong with a topic; None if all is well."""
        names = self.sources(need.topic)
        if not names:
            if need.topic not in self._last:  # it has not come yet
                return None
            if now - self._gone.setdefault(need.topic, now) < GONE_SECONDS:
                return None
            last = self._last[need.topic]
            said = [beat.ended for beat in self.heartbeats.of(last) if beat.ended]
            words = f"{need.topic.name}: {' and '.join(last)} {'has ended' if said else 'is no longer connected'}"
            return Trouble(words + "".join(f": {why}" for why in said[-1:] if why != ENDED), True)
        self._gone.pop(need.topic, None)
        if NEW not in names or need.topic not in self._last:  # the name of a node that ends goes before its topics
            self._last[need.topic] = names
        for patience in (self.patience, SLOW * self.patience):
            there = self._watchdog.resumed < now - patience  # this process itself, all the while
            quiet = self.heartbeats.quiet(names, now - patience) if there else []
            if not any(beat.runs for beat in self.heartbeats.of(quiet)):  # on this machine, busy or without its turn
                break
        if quiet:
            return Trouble(f"{need.topic.name}: no heartbeat of {' and '.join(quiet)} for {patience:g} s", True)
        late = now - max(need.due, self._watchdog.resumed)
        if late > self.patience:
            living = bool(self.heartbeats.of(names))  # it may be slow, or compile for its first answer
            limit = (self.start_patience if need.first else SLOW * self.patience) if living else self.patience
            words = f"{need.topic.name}: no {need.what} of {' and '.join(names)} for {min(late, limit):.1f} s"
            return Trouble(f"{words}, only heartbeats" if living else words, late > limit)
        return None

    def _note(self, need: Need, trouble: Trouble | None, now: float) -> None:
        """React to what is wrong with a topic, or to its end."""
        name, gone = need.topic.name, need.topic in self._gone
        since = self._silent.get(name)
        if trouble is None:
            if since is not None and not gone:
                del self._silent[name]
                self.get_logger().warning(f"{name}: is back after {now - since:.1f} s")
            if self.stays and not gone:  # it is there, or another one in its place
                if self._left is not None and self.phase is Phase.IDLE:
                    self.phase, self.words = self._left
                self._left = None
        elif gone and self.stays:
            self._silent.clear()
            if self._left is None:
                self._left = self.phase, self.words
                self.phase, self.words = Phase.IDLE, f"{trouble.words}; waiting for another one"
                self.get_logger().info(self.words)
        elif (gone and not need.replaceable) or (self._ends and trouble.certain):
            self.fail(trouble.words)
        elif since is None or now - self._said > PATIENCE_SECONDS:
            if since is None:
                self._silent[name] = now
                self.count("silent peers")
            self._said = now
            self.get_logger().error(f"{trouble.words}; keeps waiting")
        self.trouble = f"waits for {', '.join(self._silent)}" if self._silent else ""

    def is_dead(self, beat: Heartbeat) -> bool:
        """Whether a process has ended or is silent."""
        return bool(beat.ended) or beat.heard < time.monotonic() - self.patience

    def living(self, topic: Topic) -> list[str]:
        """Sources of a topic without processes that are known to be dead: DDS lists these for up to LEASE_SECONDS."""
        found = []
        for name, number in Counter(self.sources(topic)).items():
            dead = sum(map(self.is_dead, self.heartbeats.of([name])))
            found += [name] * max(1, number - dead)
        return found

    def missing(self, topic: Topic) -> str:
        """A topic that does not have exactly one living source, with the names of several; else nothing."""
        names = self.living(topic)
        several = f" from one publisher, not {' and '.join(names)}" if names else ""
        return "" if len(names) == 1 else f"{topic.name}{several}"

    def on_text(self, topic: Topic, take: Callable[[str], None]) -> None:
        """Subscribe to a text; accepted if a living node sends its digest, or if no node sends digests."""
        self.subscribe(topic, partial(self._on_text, topic, take))

    def _on_text(self, topic: Topic, take: Callable[[str], None], message: Any) -> None:
        if len(message.data) > TEXT_BYTES or sum(own == topic for _, own, *_ in self._texts) >= MOST_TEXTS:
            self.refuse("refused texts", topic)
            return
        self._texts.append((time.monotonic(), topic, self.sources(topic), message.data, take))
        self.heard()

    def heard(self) -> None:
        """Take the texts whose digest a heartbeat has by now; refuse those that have waited in vain."""
        for entry in tuple(self._texts):
            when, topic, names, text, take = entry
            name = digest(text)
            beat, before = self.heartbeats.sender_of(name), self._taken.get(topic, ("", ""))[1]
            if beat and before not in ("", beat.identity) and not self.heartbeats.successor(before):
                self._held.add(name)  # a newer plant than the one that is there gives way, or takes over later
                continue
            waits = time.monotonic() - when < self.patience or any(  # a source has just ended: none has its digests
                known.ended for known in self.heartbeats.of(self.sources(topic)))
            if beat is None and waits and name not in self._held:
                continue
            self._texts.remove(entry)
            if beat is None and name in self._held:  # it has given way
                self._held.remove(name)
            elif beat is None and not self._is_from_another_program(topic):
                self.refuse("refused texts", topic, names=names)
            elif (known := (name, beat.identity if beat else "")) != self._taken.get(topic) or beat is None:
                self._taken[topic] = known
                take(text)

    def _is_from_another_program(self, topic: Topic) -> bool:
        """Whether a text may be of a plant of another program: no heartbeat has any digest, and it publishes states."""
        names = set(self.sources(topic))
        return bool(names) and names <= {*self.sources(JOINT_STATES)} and not any(
            beat.texts for beat in self.heartbeats.alive
        )

    def destroy_node(self) -> None:
        """Say last words before, when all that was published has arrived: others may be behind, and DDS sends again."""
        if self.begun and not self.exit_code:
            self.flush(*self.publishers, seconds=ACKNOWLEDGE_SECONDS if self.finished else ARRIVAL_SECONDS)
        self.heartbeats.end(self.words if self.exit_code else "")
        super().destroy_node()

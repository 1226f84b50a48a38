"""Whether a topic has had the same source all the time.

Who sent a message is not known to whoever gets it. But a reader knows how many writers it has ever been connected with,
and a writer is connected before its first message comes. So while that number stands, all messages come from the same
source; what comes when it has just changed may come from another one, also if that has already left.
"""

from __future__ import annotations

import time

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription


class Sources:
    """The sources of a topic, as a reader is connected with them.

    Parameters
    ----------
    subscription : Subscription
    seconds : float
        After a change for which a message may be somebody else's.

    Attributes
    ----------
    now : int
        How many there are.
    """

    def __init__(self, subscription: Subscription, seconds: float) -> None:
        # Asked at every message, in the order of the messages: an event of the executor would come before or after.
        with subscription.handle:
            self._matches = rclpy_implementation.EventHandle(
                subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
            )
        self._seconds, self._until, self._ever, self.now = seconds, 0.0, -1, 0

    def begin(self) -> None:
        """Take those that are there as known."""
        self._look()
        self._until = 0.0

    def settled(self) -> bool:
        """Whether it has been the same ones for a while."""
        now, before = time.monotonic(), self._ever
        self._look()
        if before not in (-1, self._ever):
            self._until = now + self._seconds
        return now >= self._until

    def alone(self) -> bool:
        """Whether there is one, the same for a while."""
        return self.settled() and self.now < 2

    def _look(self) -> None:
        with self._matches:
            status = self._matches.take_event()
        if status is not None:
            self._ever, self.now = status.total_count, status.current_count

"""What a plant is for its loop and for those who steer it."""

from __future__ import annotations

from abc import abstractmethod

from grasp_ros.graph.health.peers import PeerNode
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene


class SteppedNode(PeerNode):
    """A plant that is advanced from outside.

    Attributes
    ----------
    scene : Scene
    monitored : bool
        Whether it waits for a monitor.
    resets : int
        How often time and state were put back.
    asked : float, s
        Wall time at which the current state was published.
    """

    scene: Scene
    monitored: bool
    resets: int
    asked: float

    @property
    @abstractmethod
    def tick(self) -> int:
        """Control periods done since the start or the last reset."""

    @abstractmethod
    def repeat(self) -> None:
        """Publish the current state again: something on the way to or from those who answer it was lost."""

    @property
    def at_end(self) -> bool:
        """Whether the horizon of the scene has been reached."""
        return self.tick == self.scene.ticks

    @abstractmethod
    def advance(self) -> None:
        """Do what its loop finds due."""

    @abstractmethod
    def step(self, forces: Array) -> None:
        """Advance one period with the answers (3,) in N by body to the current state; publish the next."""

    @abstractmethod
    def restart(self) -> None:
        """Put time and state back to the beginning of the scene, and publish the first state again."""

    @abstractmethod
    def finish(self) -> None:
        """End: the horizon has been reached and answered."""

"""What is refused of bags, apart from what reads them, which takes a while to import."""

from grasp_ros.physics.errors import Refused


class BagError(Refused):
    """A bag that cannot be written or read: names the path and the reason."""


class EmptyBagError(BagError):
    """A bag without a tick."""

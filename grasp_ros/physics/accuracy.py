"""How accurately contacts are integrated: their first neglected Taylor term, relative to the impact."""

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import number

ACCURACY = 1e-16  # default: costs a fifth more than 1e-11, and some scenes amplify an error by 1e7
FINEST, COARSEST = 1e-16, 1e-3


def check_accuracy(accuracy: float) -> float:
    """An accuracy as the kernels take it; what is no number, or outside the range, is refused."""
    found = number("accuracy", accuracy)
    if not FINEST <= found <= COARSEST:
        raise Refused(f"accuracy: {accuracy!r} is not allowed; allowed: {FINEST:g} to {COARSEST:g}")
    return found

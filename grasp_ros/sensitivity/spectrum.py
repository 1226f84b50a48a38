"""Lyapunov exponents: the mean rates at which small differences of states grow, all of them.

Tangents that begin at right angles are made so again after each piece of time, and their lengths add up (G. Benettin,
L. Galgani, A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents, Meccanica 15 (1980)).
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.places import check_scene
from grasp_ros.sensitivity.directions import no_directions
from grasp_ros.sensitivity.run import Carrier

PIECE_S = 0.5


def spectrum(scene: Scene, *, accuracy: float = ACCURACY) -> Array:
    """Lyapunov exponents (2 b,) of a run of b bodies under continuous feedback, descending, 1/s.

    Lengths are those of states (x, v) in m and m/s. An object that sticks loses a direction: its exponent is -inf.

    Raises
    ------
    Refused
        If commands are held or external forces act, or the run does not reach its end.
    """
    check_scene(scene)
    if scene.sampled or scene.system.external:
        raise Refused(f"{scene.name}: Lyapunov exponents: allowed: continuous feedback, no external force")
    places = [place for body in scene.system.present for place in (COLUMN[body], COLUMN[body] + 1)]
    n = len(places)
    start = np.zeros((6, n))
    start[places, range(n)] = 1.0
    integrator = Integrator(scene.system, continuous=True, accuracy=accuracy)
    integrator.observer = carrier = Carrier(integrator, no_directions(n)._replace(state=start), np.zeros(0))
    pieces = max(math.ceil(scene.duration / PIECE_S), 1)
    grown: Array = np.zeros(n)
    for piece in range(pieces):
        begin = scene.duration * piece / pieces
        integrator.advance(scene.duration / pieces, start=begin)
        if integrator.status is not Status.DONE:
            raise Refused(f"{scene.name}: no Lyapunov exponents of a run that {integrator.stop}")
        carrier.finish(begin + scene.duration / pieces)
        square, lengths = np.linalg.qr(carrier.x[places])
        carrier.x[places] = square
        with np.errstate(divide="ignore"):
            grown += np.log(np.abs(np.diag(lengths)))
    return np.sort(grown)[::-1] / scene.duration

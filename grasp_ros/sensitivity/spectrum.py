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
from grasp_ros.physics.layout import OBJECT, Entry, Of, Slide
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.targets import check_scene
from grasp_ros.sensitivity.directions import no_directions
from grasp_ros.sensitivity.run import Carrier

PIECE_S, MOST_PIECES = 0.5, 2**17  # of time: the longest, and how many
FALL = 1e-10  # of a tangent within a piece, to what is left of it at right angles to others: below, it has few digits
AGREE = 0.1  # of the largest logarithm of growth, from pieces to half as long ones: chaotic runs end elsewhere
DECAY = 10.0  # time constants of the dampers in a piece, at most


def spectrum(scene: Scene, *, accuracy: float = ACCURACY) -> Array:
    """Lyapunov exponents (2 b,) of a run of b bodies under continuous feedback, descending, 1/s.

    Lengths are those of states (x, v) in m and m/s. An object that sticks loses a direction: its exponent is -inf, and
    so is that of another one of which no digit is left when it sticks again. NaN: of which no digit is known.

    Raises
    ------
    Refused
        If commands are held or external forces act, the run does not reach its end, or tangents fall too fast.
    """
    check_scene(scene)
    if scene.sampled or scene.system.external:
        raise Refused(f"{scene.name}: Lyapunov exponents: allowed: continuous feedback, no external force")
    columns = [column for body in scene.system.present for column in (COLUMN[body], COLUMN[body] + 1)]
    bodies = scene.system.closed_loop[scene.system.present]
    rate = max(1.0 / PIECE_S, float((bodies[:, Of.DAMPING] / bodies[:, Of.MASS]).max()) / DECAY)
    pieces, before = max(math.ceil(scene.duration * rate), 1), None
    while pieces <= MOST_PIECES:
        grown = _growth(scene, columns, accuracy, pieces)
        if grown is not None and before is not None:  # within a piece tangents may grow, and fall again
            known = min(len(grown), len(before))
            close = np.abs(grown[:known] - before[:known]) <= AGREE * np.abs(grown).max(initial=0.0)
            lost = np.full(len(columns) - known, -np.inf)
            return np.concatenate([np.where(close, before[:known] / scene.duration, np.nan), lost])
        pieces, before = 2 * pieces, grown
    raise Refused(f"{scene.name}: Lyapunov exponents: tangent vectors become nearly parallel within"
                  f" {scene.duration / MOST_PIECES:.3g} s; allowed: slower decay, or a shorter time.duration_s")


def _growth(scene: Scene, columns: list[int], accuracy: float, pieces: int) -> Array | None:
    """Logarithms of how much tangents that are not lost grow, descending; None if one falls too far within a piece."""
    n, piece_s = len(columns), scene.duration / pieces
    start, grown = np.zeros((6, n)), np.zeros(n)
    start[columns, range(n)] = 1.0
    integrator = Integrator(scene.system, continuous=True, accuracy=accuracy)
    carrier = Carrier(scene, integrator, no_directions(n)._replace(state=start), np.zeros(0), False)
    stuck = False
    for piece in range(pieces):
        begin = scene.duration * piece / pieces
        integrator.advance(piece_s, start=begin)
        if integrator.status is not Status.DONE:
            raise Refused(f"{scene.name}: no Lyapunov exponents of a run that {integrator.stop}")
        carrier.finish()
        slide = integrator.records.mode[OBJECT]  # FREE without dry friction
        stuck = stuck or slide == Slide.STUCK or (
            slide != Slide.FREE and bool((integrator.event_table[:, Entry.BODY] == OBJECT).any()))  # stick and slip
        found = _at_right_angles(carrier.x[columns][:, : len(grown)], stuck)
        if found is None:
            return None
        kept, square, lengths = found
        grown = grown[kept] + np.log(lengths)
        carrier.x[:] = 0.0
        carrier.x[np.ix_(columns, range(len(kept)))] = square
    return np.sort(grown)[::-1]


def _at_right_angles(moved: Array, stuck: bool) -> tuple[np.ndarray, Array, Array] | None:
    """Which tangents (n, k) are kept, the same at right angles, and how long each was beside those before it.

    Tangents that a stick of the object has made dependent are dropped; None if others nearly are.
    """
    kept: np.ndarray = np.arange(moved.shape[1])
    while True:
        square, triangle = np.linalg.qr(moved[:, kept])
        lengths, own = np.abs(np.diag(triangle)), np.linalg.norm(moved[:, kept], axis=0)
        lost = np.flatnonzero(~((lengths >= FALL * own) & (own > 0.0)))
        if not len(lost):
            return kept, square, lengths
        if not stuck:
            return None
        kept = np.delete(kept, lost[0])  # what follows it was laid at right angles to nothing

"""Identify numbers of a scene from a measured motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from grasp_ros.identification.measured import FEWEST, INITIAL, Source, measured
from grasp_ros.identification.numbers import OFFSET, acts, numbers_of
from grasp_ros.identification.result import CONFIDENCE, Against, Fit, identifiability_of, residual_table
from grasp_ros.identification.search import FitProblem, first_noise, fitted, mean_square, missed, refine, search
from grasp_ros.physics.errors import Refused, need
from grasp_ros.physics.given import mapping, names, number, truth
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.targets import check_scene
from grasp_ros.sensitivity.directions import check_keys

FARTHEST = 1.0  # a factor of ten, in y, beyond which it has no end


def fit(data: Source, free: Sequence[str], scene: Scene | None = None, *,
        against: Mapping[str, float] = MappingProxyType({}), by_sensors: bool = False) -> Fit:
    """Estimate parameters of a scene from a measured motion, with confidence intervals.

    Positive parameters are fitted by their logarithm, and finally by their value; their intervals are
    symmetric, but never below 0. The noise of each channel is estimated as well, and weights the channel.

    Parameters
    ----------
    data : path, Recording or Trajectory
        A bag, a .npz file of `grasp simulate`, or a .csv file with columns as `Trajectory.to_csv` names them: `t_s`,
        and states, not all of which need be there. Inputs recorded at every tick act as recorded, unless a free
        parameter belongs to a controller or an external force; then the scene's controllers act.
    free : sequence of str
        "section.key" of parameters on which the motion depends smoothly: masses, stiffness, damping, H, p, gains,
        initial values.
        "offset.x_left_m" is the offset of a sensor: measured minus true value.
    scene : Scene, optional
        Known parameters, and starting values of the free ones; initial values that the data have at t = 0 start there.
        Default: the scene of the data; a .csv file has none.
    against : mapping of str to float
        Free parameters and the values to test: whether the data reject them.
    by_sensors : bool
        For a bag: use the noisy measurements of the sensors of its scene instead of the exact states.

    Raises
    ------
    Refused
        If scipy is not installed, the data or the keys are not allowed, or there are too few samples.
    """
    need("a fit", "scipy")
    if scene is not None:
        check_scene(scene)
    free, found = names("free", free), measured(data, scene, truth("by_sensors", by_sensors))
    against = {key: number(f"against: {key}", value) for key, value in mapping("against", against).items()}
    seen = {key: float(found.state[0, i]) for i, key in enumerate(INITIAL) if i in found.channels}
    begun = found.scene.changed({key: seen[key] for key in free if key in seen} if found.t[0] == 0.0 else {})
    numbers = numbers_of(begun, free, found)
    if any(acts(begun, number.key) for number in numbers):
        found = found._replace(inputs=None)
    if found.inputs is None and found.why_unknown:
        raise Refused(f"{found.name}: {found.why_unknown}; allowed: inputs at every tick, and no free parameter of"
                      " controllers or external forces")
    for key, value in against.items():
        if key not in free or key.startswith(OFFSET):
            raise Refused(f"against: {key}: allowed: a free parameter of the scene")
        check_keys(found.scene.changed({key: value}), [key], found.sampled)
    samples = len(found.t) * len(found.channels)
    if samples < len(numbers) + FEWEST:
        raise Refused(f"{found.name}: {samples} measured numbers; allowed for {len(numbers)} free ones: at least"
                      f" {len(numbers) + FEWEST}")
    return _result(fitted(FitProblem(found, numbers, first_noise(found))), against)


def _result(problem: FitProblem, against: Mapping[str, float]) -> Fit:
    """What the minimum, at y = 0, says."""
    data, rows, y = problem.data, len(problem.data.t), np.zeros(len(problem.numbers))
    values, slopes = problem.residuals(y, rows)
    states, _, touches = problem.predict(y, rows)
    states[:, [i for i in range(6) if i not in data.channels]] = np.nan
    covariance, reach, unseen = identifiability_of(slopes, values, len(y))
    below, above = _reaches(problem, reach, covariance, values)
    estimates = problem.values(y)
    found = np.array([*estimates.values()])
    scale, least = np.array([(number.width, number.least) for number in problem.numbers]).T
    low, high = np.maximum(found - scale * below, least), found + scale * above
    lost = (low == least) & np.isinf(high)  # nothing is excluded
    covariance[lost], covariance[:, lost] = np.nan, np.nan
    unseen += [[i] for i in np.flatnonzero(lost).tolist() if not any(i in indices for indices in unseen)]
    return Fit(
        problem.scene_at(y), data.name, data.acting, tuple(estimates), found, low, high,
        covariance * np.outer(scale, scale),
        tuple(tuple(problem.numbers[i].key for i in indices) for indices in unseen),
        data.t, data.state, states, np.where(np.isin(range(6), data.channels), problem.noise, np.nan),
        residual_table(values.reshape(rows, -1), data.t, touches), missed(data, problem.noise),
        {key: _test(problem, key, value, values) for key, value in against.items()},
    )


def _test(problem: FitProblem, key: str, value: float, best: Array) -> Against:
    """F test of a value of one number: by how much the sum of squares grows where it is fixed."""
    from scipy import stats

    fixed, begin, rows = problem.fixed(key, value), np.zeros(len(problem.numbers)), len(problem.data.t)
    least = min(mean_square(fixed, found) for found in (refine(fixed, begin, rows), search(fixed)))
    growth = _growth(least, problem, best)
    return Against(value, growth, float(stats.f.sf(growth, 1, len(best) - len(problem.numbers))))


def _growth(least: float, problem: FitProblem, best: Array) -> float:
    """Growth of the sum of squares to a mean square, in variances."""
    total = float(best @ best)
    return max((least * len(best) - total) / max(total / (len(best) - len(problem.numbers)), 1.0), 0.0)


def _reaches(problem: FitProblem, reach: Array, covariance: Array, best: Array) -> tuple[Array, Array]:
    """How far intervals reach (n,) below and above: as the derivatives say, or farther, or without an end.

    The sum of squares may be flat on one side: with more dry friction than holds an object, nothing changes any more.
    At twice the reach it should have grown four times as far as at the end; where it has not by half of that, the reach
    is doubled.
    """
    from scipy import stats

    enough = 2.0 * stats.f.ppf(CONFIDENCE, 1, len(best) - len(problem.numbers))
    below, above = reach.copy(), reach.copy()
    for i, own in enumerate(problem.numbers):
        others = np.nan_to_num(covariance[i] / covariance[i, i])  # go with it
        for side, sign in ((below, -2.0), (above, 2.0)):
            while side[i] < FARTHEST and own.at(y := sign * side[i]) > own.least:
                fixed = problem.fixed(own.key, float(own.at(y)))
                found = refine(fixed, others * y, len(problem.data.t))
                if _growth(mean_square(fixed, found), problem, best) >= enough:
                    break
                side[i] *= 2.0
                if side[i] >= FARTHEST:
                    side[i] = np.inf
    return below, above

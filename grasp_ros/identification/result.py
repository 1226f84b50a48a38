"""What a fit delivers: estimates, how certain they are, what the data do not see, and what is left over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grasp_ros.identification.measured import CHANNELS
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.layout import LEFT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene

CONFIDENCE = 0.95
BLIND = 1e-9  # singular value, of the largest, below which derivatives are no more than their rounding
PART = 1e-3  # of a direction, from which on a number belongs to it
LAGS = 10
ROUNDING = 1e-3  # of the least noise
UNLIKELY = 1e-4  # probability of residuals
REJECTED = 0.01  # probability below which a test rejects


class Against(NamedTuple):
    """F test of one value of a number that was free."""

    value: float
    F: float  # growth of the sum of squares in variances, where the number has this value and the others are free
    probability: float  # of an F as large by chance

    @property
    def rejected(self) -> bool:
        """Whether the data reject the value, at 1 %."""
        return self.probability < REJECTED


class Residuals(NamedTuple):
    """Residuals from one touch to the next."""

    side: str  # of the touch; "none" before the first
    begin: float  # s
    samples: int
    rms: float  # in standard deviations of the noise
    white: float  # Ljung-Box test: probability of correlations as large by chance; see `whiteness`


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Frozen):
    """Numbers of a scene, estimated from a measured motion.

    Attributes
    ----------
    scene : Scene
        With the estimates.
    source : str
        What the data came from.
    acting : str
        What acted on the bodies: inputs of the data, or what the scene has in their place.
    keys : tuple of str
    estimates, low, high : arrays (n,)
        With 95 % intervals; infinite, or from 0, for what is not identifiable, and on a side that the data do not show.
    covariance : array (n, n)
        In the units of the keys; NaN for what is not identifiable.
    not_identifiable : tuple of tuples of str
        Numbers that can change together without a trace in these data: by a factor of ten of their value or start,
        whichever is larger, or, where negative ones are allowed, by their size or unit.
    t : array (m,), s
    measured, fitted : arrays (m, 6), m and m/s
        NaN for channels that are not measured.
    noise : array (6,), m and m/s
        Standard deviation of each channel, as its residuals have it.
    contacts : tuple of Residuals
        From each touch of the fitted motion to the next.
    missed : tuple of str
        Channels in which the fitted motion is not the measured one: the search ended elsewhere, or the scene is wrong.
    against : mapping of str to Against
        Tests of values.
    """

    scene: Scene
    source: str
    acting: str
    keys: tuple[str, ...]
    estimates: Array
    low: Array
    high: Array
    covariance: Array
    not_identifiable: tuple[tuple[str, ...], ...]
    t: Array
    measured: Array
    fitted: Array
    noise: Array
    contacts: tuple[Residuals, ...]
    missed: tuple[str, ...]
    against: Mapping[str, Against]

    @property
    def residuals(self) -> Array:
        """Measured minus fitted, (m, 6), m and m/s."""
        return self.measured - self.fitted

    @property
    def correlation(self) -> Array:
        """Correlation (n, n) of the estimates."""
        deviation = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(deviation, deviation))

    def __repr__(self) -> str:
        """What the fit has found, as a table."""
        return "\n".join(_lines(self))


def identifiability_of(slopes: Array, residuals: Array, n: int) -> tuple[Array, Array, list[list[int]]]:
    """What residuals (m,) in standard deviations, with derivatives (m, n), say of n numbers y.

    Their covariance (n, n), NaN for what is not identifiable; half of their confidence intervals (n,), inf for that;
    and indices of the numbers of each direction that is not seen, whose standard deviation is not below 1.
    """
    from scipy import linalg, stats

    _, singular, directions = np.linalg.svd(slopes, full_matrices=False)
    free = len(residuals) - n
    variance = max(float(residuals @ residuals) / free, 1.0)  # less is rounding: data without noise
    blind = singular <= BLIND * singular[0]
    lost_directions = directions[blind | (singular < math.sqrt(variance))]
    if len(lost_directions) > 1:  # of their combinations those of few numbers: each has one that no other has
        indices = linalg.qr(lost_directions, mode="r", pivoting=True)[1][: len(lost_directions)]
        lost_directions = np.linalg.solve(lost_directions[:, np.sort(indices)], lost_directions)
    unseen = sorted(np.flatnonzero(np.abs(direction) > PART).tolist() for direction in lost_directions)
    scaled = directions[~blind] / singular[~blind, None]
    covariance = variance * scaled.T @ scaled
    lost = sorted({i for indices in unseen for i in indices})
    reach = np.sqrt(np.diag(covariance)) * stats.t.ppf(0.5 + 0.5 * CONFIDENCE, free)
    reach[lost] = np.inf
    covariance[lost], covariance[:, lost] = np.nan, np.nan
    return covariance, reach, unseen


def residual_table(residuals: Array, t: Array, touches: Array) -> tuple[Residuals, ...]:
    """Residuals (m, k) at times (m,) from each touch, time and side (j, 2), to the next; none without samples."""
    begins = [(float(t[0]), "none"), *((time, "left" if side == LEFT else "right") for time, side in touches.tolist())]
    rows = [*np.searchsorted(t, [begin for begin, _ in begins]).tolist(), len(t)]
    return tuple(
        Residuals(side, begin, end - first, float(np.sqrt(np.mean(residuals[first:end] ** 2))),
                  whiteness(residuals[first:end]))
        for (begin, side), first, end in zip(begins, rows[:-1], rows[1:], strict=True) if end > first
    )


def whiteness(residuals: Array) -> float:
    """Probability that white noise has correlations as large as residuals (m, k) of k channels.

    NaN for fewer than 10 samples, or where nothing is left over but rounding.

    Source: G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65 (1978).
    """
    from scipy import stats

    m, channels = residuals.shape
    if m < LAGS or np.abs(residuals).max() < ROUNDING:
        return math.nan
    lags = np.arange(1, min(LAGS, m // 5) + 1)
    products = np.array([np.sum(residuals[lag:] * residuals[:-lag], axis=0) for lag in lags])
    with np.errstate(invalid="ignore"):  # of residuals that are all 0
        found = products / np.sum(residuals**2, axis=0)
    total = m * (m + 2.0) * np.sum(found**2 / (m - lags)[:, None])
    return float(stats.chi2.sf(total, channels * len(lags)))


def _lines(found: Fit) -> Iterator[str]:
    """Estimates, what is not identifiable, correlations, noise, residuals, and tests."""
    width = max(map(len, found.keys))
    yield f"{found.source}: {len(found.t)} samples, {found.t[0]:g} to {found.t[-1]:g} s, under {found.acting}"
    yield f"{'':<{width}}  {'estimate':>13}  95 % interval"
    lost = {key for keys in found.not_identifiable for key in keys}
    for key, value, low, high in zip(found.keys, found.estimates, found.low, found.high, strict=True):
        yield f"{key:<{width}}  {value:>13.7g}  " + ("-" if key in lost else f"{low:.7g} to {high:.7g}")
    for keys in found.not_identifiable:
        together = " together: the data show only a combination of them" if len(keys) > 1 else ""
        yield f"not identifiable from these data: {', '.join(keys)}{together}"
    for row, key in enumerate(found.keys):
        cells = "".join(_cell(cell, 6, 2) for cell in found.correlation[row, : row + 1])
        yield f"{'correlation' if row == 0 else '':<12}{key:<{width}}{cells}"
    noises = zip(CHANNELS, found.noise, strict=True)
    yield "noise       " + ", ".join(f"{name} {noise:.3g}" for name, noise in noises if math.isfinite(noise))
    yield "residuals   from  samples  rms / noise  probability if white"
    for contact in found.contacts:
        begin = "begin" if contact.side == "none" else f"{contact.side} touch, {contact.begin:.4f} s"
        yield f"  {begin:<24}{contact.samples:>6}{contact.rms:>8.3f}{_cell(contact.white, 10, 3)}"
    if found.missed:
        yield (f"the fitted motion is not the measured one in {', '.join(found.missed)}: the search ended elsewhere, or"
               " the scene is wrong; try other starts")
    elif any(contact.white < UNLIKELY for contact in found.contacts):
        yield ("the residuals are not noise: the scene lacks something that acted, or the data are rounded; the"
               " intervals are too narrow")
    for key, test in found.against.items():
        verdict = "rejected" if test.rejected else "not rejected"
        yield f"{key} = {test.value:g}: {verdict}, F = {test.F:.4g}, probability {test.probability:.2g}"


def _cell(value: float, width: int, digits: int) -> str:
    return f"{'-':>{width}}" if math.isnan(value) else f"{value:{width}.{digits}f}"

"""Forecasts of the touchdown height against what came, as it comes."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise
from math import isnan, nan

import numpy as np

from deck_motion_ros.geometry import height_above_rest
from deck_motion_ros.samples import Array, NANOSECONDS, nanoseconds, Vector3
from deck_motion_ros.streams import OutputSchedule

USEFUL = 0.5  # of the motion's sd: the error up to which a forecast is useful
Z_68, Z_95 = 1.0, 1.96
LONGEST_STEP = nanoseconds(1.25)  # between samples that are interpolated

Samples = deque[tuple[int, float]]


@dataclass(frozen=True, slots=True)
class Score:
    """
    How good the recent forecasts of one horizon were; NaN where nothing came true.

    Attributes
    ----------
    horizon : float
        Seconds ahead.
    number : int
        Forecasts that came true.
    rmse, persistence, zero : float
        Root mean square errors of the forecast, of "it stays as it is" and of "it is at rest" (m).
    motion : float
        sd of what came (m): the error of the best constant.
    noise : float
        sd stated for the measurements that are compared with (m).
    coverage_68, coverage_95 : float
        Share of what came in the intervals of 1 and 1.96 sd.

    """

    horizon: float
    number: int
    rmse: float
    persistence: float
    zero: float
    motion: float
    noise: float
    coverage_68: float
    coverage_95: float

    def over(self, rival: float) -> float:
        """Return the error as a share of a rival's; NaN where there was no motion."""
        return self.rmse / rival if rival > 0 else nan


def useful_horizon(horizons: Sequence[float], ratios: Sequence[float]) -> float:
    """
    Find the longest horizon up to which the error stays below half the motion.

    Parameters
    ----------
    horizons : sequence of float
        Seconds ahead, increasing.
    ratios : sequence of float
        Error over the sd of the motion there; NaN ends what is known.

    Returns
    -------
    float
        Seconds, interpolated; 0 if even the first error is too large, NaN if it is not known, and
        the last horizon that is known if none is too large.

    >>> useful_horizon((1.0, 2.0, 3.0), (0.2, 0.4, 0.8))
    2.25

    """
    reach, below = nan, nan
    for horizon, ratio in zip(horizons, ratios, strict=True):
        if isnan(ratio):
            break
        if ratio >= USEFUL:
            return 0.0 if isnan(reach) else (
                reach + (horizon - reach) * (USEFUL - below) / (ratio - below))
        reach, below = horizon, ratio
    return reach


class RunningScore:
    """
    Score forecasts of the touchdown height with the heights that are measured later.

    What came is the height made of the measured axes at the very stamp, interpolated where an axis
    has no sample there. An axis that never came counts as 0; when one comes to life, the score
    starts anew. Sensor noise is part of every error; the variance stated for it widens the
    intervals by as much. Of the forecasts, two in a second are scored. Stamps alone decide.

    Parameters
    ----------
    lever_arm : tuple of 3 float
        The touchdown point in ship axes (m).
    horizons : sequence of float
        Seconds ahead, increasing.
    window : float
        Forecasts that came true in so many seconds count.

    """

    RATE = 2.0  # Hz: forecasts that are scored
    PATIENCE = nanoseconds(5.0)  # with an axis that is late
    KEPT = 8  # samples of an axis, and those that are still needed

    def __init__(self, lever_arm: Vector3, horizons: Sequence[float],
                 window: float = 300.0) -> None:
        self.horizons, self.window = tuple(horizons), window
        self._lever_arm = lever_arm
        self._ahead = np.array([nanoseconds(horizon) for horizon in horizons])
        rows = round(self.RATE * (window + horizons[-1])) + 8
        self._issued_at = np.zeros(rows, np.int64)
        self._was = np.full(rows, nan)
        # of every scored forecast and horizon: mean, variance, what came
        self._table = np.full((3, rows, len(horizons)), nan)
        self._row = 0
        self._schedule = OutputSchedule(self.RATE)
        self._due: list[tuple[int, int, int]] = []  # heap: stamp, row, column or -1 for "was"
        self._samples: tuple[Samples, ...] = (deque(), deque(), deque())
        self._vars = [0.0, 0.0, 0.0]
        self._newest = 0

    def measure(self, axis: int, stamp: int, value: float, var: float) -> None:
        """Use a measurement of ROLL, PITCH (rad) or HEAVE (m) and the variance of its error."""
        samples = self._samples[axis]
        if not samples:  # what was said of the height without this axis is another height's
            self._table[2] = nan
            self._due.clear()
        elif stamp <= samples[-1][0]:
            return
        samples.append((stamp, value))
        self._vars[axis] = var
        self._newest = max(self._newest, stamp)
        while self._due and stamp > self._due[0][0] and self._is_settled(self._due[0][0]):
            self._settle(self._due[0][0])
        while len(samples) > self.KEPT and not (self._due and samples[2][0] > self._due[0][0]):
            samples.popleft()

    def is_due(self, issued_at: int) -> bool:
        """Say whether a forecast issued at that stamp (ns) is one to score."""
        return self._schedule.is_due(issued_at)

    def forecast(self, issued_at: int, mean: Array, var: Array) -> None:
        """
        Take a forecast to score.

        Parameters
        ----------
        issued_at : int
            Stamp of the newest measurement that it knows (ns).
        mean, var : ndarray, shape (horizons,)
            Heights (m) and the variances of their errors.

        """
        self._schedule.take(issued_at)
        row, self._row = self._row, (self._row + 1) % len(self._was)
        self._issued_at[row], self._was[row] = issued_at, nan
        self._table[0, row], self._table[1, row], self._table[2, row] = mean, var, nan
        heappush(self._due, (issued_at, row, -1))
        for column, ahead in enumerate(self._ahead.tolist()):
            heappush(self._due, (issued_at + ahead, row, column))

    def scores(self) -> list[Score]:
        """Score the forecasts that came true in the window, by horizon."""
        mean, var, came = self._table
        was = self._was[:, None]
        known = np.isfinite(came) & np.isfinite(was) & (
            self._issued_at[:, None] + self._ahead > self._newest - nanoseconds(self.window))
        number = known.sum(axis=0)

        def average(values: Array | float) -> Array:
            total = np.where(known, values, 0.0).sum(axis=0)
            return np.asarray(total / np.where(number, number, nan))

        square, level = (mean - came)**2, average(came)
        columns = (np.sqrt(average(square)), np.sqrt(average((was - came)**2)),
                   np.sqrt(average(came**2)), np.sqrt(average((came - level)**2)),
                   np.sqrt(average(self._noise_var)),
                   average(square <= Z_68**2 * var), average(square <= Z_95**2 * var))
        return [Score(horizon, count, *figures) for horizon, count, *figures in zip(
            self.horizons, number.tolist(), *(column.tolist() for column in columns),
            strict=True)]

    def _is_settled(self, stamp: int) -> bool:
        """Say whether every axis is past the stamp by a sample, or has been late for too long."""
        return self._newest > stamp + self.PATIENCE or all(
            len(samples) > 1 and samples[-2][0] >= stamp for samples in self._samples if samples)

    @property
    def _noise_var(self) -> float:
        """Variance of the measured height's noise."""
        forward, left, _ = self._lever_arm
        roll_var, pitch_var, heave_var = self._vars
        return left * left * roll_var + forward * forward * pitch_var + heave_var

    def _settle(self, stamp: int) -> None:
        """Note what came at a stamp in all forecasts that are due then."""
        roll, pitch, heave = (_value_at(samples, stamp) if samples else 0.0
                              for samples in self._samples)
        height = height_above_rest(roll, pitch, heave, self._lever_arm)
        while self._due and self._due[0][0] == stamp:
            _, row, column = heappop(self._due)
            if column < 0:
                self._was[row] = height
            else:
                self._table[1, row, column] += self._noise_var
                self._table[2, row, column] = height


def _value_at(samples: Samples, stamp: int) -> float:
    """
    Interpolate an axis; NaN outside, and between samples too far apart.

    By the cubic through four samples if they are about evenly spaced, else by a straight line,
    which at 1 Hz is 5 % off in the middle of a 10 s wave.
    """
    k = bisect_left(samples, (stamp,))  # the first that is not older
    if k == len(samples):
        return nan
    when, value = samples[k]
    if when == stamp:
        return value
    if k == 0 or when - samples[k - 1][0] > LONGEST_STEP:
        return nan
    near = [samples[j] for j in range(max(k - 2, 0), min(k + 2, len(samples)))]
    steps = [after - before for (before, _), (after, _) in pairwise(near)]
    if len(near) < 4 or max(steps) > 2 * min(steps):
        near = [samples[k - 1], samples[k]]
    return _polynomial([((when - stamp) / NANOSECONDS, value) for when, value in near])


def _polynomial(points: Sequence[tuple[float, float]]) -> float:
    """Evaluate at 0 the polynomial through some points (Lagrange)."""
    total = 0.0
    for k, (x, y) in enumerate(points):
        for j, (other, _) in enumerate(points):
            if j != k:
                y *= other / (other - x)
        total += y
    return total

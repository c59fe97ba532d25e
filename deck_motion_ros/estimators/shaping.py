"""Li2014: a shaping-filter Kalman filter per axis, as printed or tuned on line to the ship."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from functools import lru_cache
from itertools import chain
from math import floor, inf, nan, radians, sqrt
from typing import Protocol

import numpy as np

from deck_motion_ros.estimators.kalman import predicted_output, State, step
from deck_motion_ros.processes import (
    LI2014_HEAVE,
    LI2014_PITCH,
    LI2014_ROLL,
    ShapingFilter,
)
from deck_motion_ros.samples import Array, MotionForecast

RATE_WINDOW = 0.5  # s: a rate is the mean rate over this long, since the model has no other


def in_radians(process: ShapingFilter) -> ShapingFilter:
    """Turn a shaping filter of degrees into one of radians."""
    return ShapingFilter(radians(process.gain), process.damping, process.stiffness,
                         process.intensity)


# roll, pitch (rad), heave (m)
LI2014 = (in_radians(LI2014_ROLL), in_radians(LI2014_PITCH), LI2014_HEAVE)
NOW = np.zeros(1)


class AxisFilter:
    """
    The Kalman filter of one axis: a shaping filter about a mean level.

    Parameters
    ----------
    process : ShapingFilter
        Model of the motion about its mean.
    mean : float
        Level about which the axis moves.
    excess_var : float
        Motion that the model cannot have: part of every measurement's and forecast's variance.

    Attributes
    ----------
    time : float
        Of the newest measurement (s); NaN before the first.
    state : tuple of 5 float
        Estimate and covariance then.

    """

    __slots__ = ('process', 'mean', 'time', 'state', '_excess')

    def __init__(self, process: ShapingFilter, mean: float = 0.0,
                 excess_var: float = 0.0) -> None:
        self.process = process
        self.mean = mean
        self.time = nan
        self.state: State = (0.0, 0.0, *process.stationary)
        self._excess = excess_var

    def measure(self, time: float, value: float, var: float) -> float:
        """
        Use a measurement at ``time`` (s, not before the last one).

        Returns
        -------
        float
            The standardised innovation.

        """
        phi, noise = self.process.step(self.age(time))
        self.time = time
        self.state, innovation = step(self.state, phi, noise, value - self.mean,
                                      var + self._excess)
        return innovation

    def expected(self, time: float) -> float:
        """Predict the axis at ``time`` (s), the mean alone."""
        (f1, f2, _, _), _ = self.process.step(self.age(time))
        return self.mean + f1 * self.state[0] + f2 * self.state[1]

    def age(self, time: float) -> float:
        """Return the seconds since the newest measurement, 0 before the first."""
        return time - self.time if self.time == self.time else 0.0

    def deviation(self, ahead: float) -> tuple[float, float]:
        """Predict the deviation from the mean: its mean and variance ``ahead`` seconds on."""
        mean, var = predicted_output(self.state, *self.process.step(ahead))
        return mean, var + self._excess

    def mean_rate(self, ahead: float) -> tuple[float, float]:
        """
        Predict the mean rate over RATE_WINDOW around ``ahead`` seconds on: mean and variance.

        The instantaneous rate of this model has no finite variance (Li2014 calls x2 the rate).
        """
        rate, var = self.table(np.array([ahead]))[2:, 0].tolist()
        return rate, var

    def table(self, ahead: Array) -> Array:
        """
        Predict many times at once.

        Parameters
        ----------
        ahead : ndarray, shape (n,)
            Seconds on.

        Returns
        -------
        ndarray, shape (4, n)
            Deviation, its variance, mean rate (see :meth:`mean_rate`), its variance.

        """
        factors = _linear(self.process, ahead.tobytes())
        return (np.array((*self.state, self._excess, 1.0)) @ factors).reshape(4, -1)

    def frozen(self) -> AxisFilter:
        """Return a copy that keeps today's estimate."""
        copy = AxisFilter(self.process, self.mean, self._excess)
        copy.time, copy.state = self.time, self.state
        return copy


@lru_cache(maxsize=64)
def _linear(process: ShapingFilter, times: bytes) -> Array:
    """
    Write the table of :meth:`AxisFilter.table` as a linear function of state and covariance.

    Parameters
    ----------
    process : ShapingFilter
        Of the axis.
    times : bytes
        An array of n seconds as bytes, which can be remembered.

    Returns
    -------
    ndarray, shape (7, 4 * n)
        Factors of x1, x2, p11, p12, p22 and the excess variance, and what comes of itself.

    """
    (phi_11, phi_12, _, _), (window_var, _, _) = process.step(RATE_WINDOW)
    r1, r2 = (phi_11 - 1) / RATE_WINDOW, phi_12 / RATE_WINDOW  # rate = r1 x1 + r2 x2 + noise
    table = []
    for time in np.frombuffer(times).tolist():
        (f1, f2, _, _), (var, _, _) = process.step(time)
        (s11, s12, s21, s22), (q11, q12, q22) = process.step(max(time - RATE_WINDOW / 2, 0.0))
        g1, g2 = r1 * s11 + r2 * s21, r1 * s12 + r2 * s22
        rate_var = r1 * r1 * q11 + 2 * r1 * r2 * q12 + r2 * r2 * q22 + window_var / RATE_WINDOW**2
        table.append(((f1, f2, 0.0, 0.0, 0.0, 0.0, 0.0),
                      (0.0, 0.0, f1 * f1, 2 * f1 * f2, f2 * f2, 1.0, var),
                      (g1, g2, 0.0, 0.0, 0.0, 0.0, 0.0),
                      (0.0, 0.0, g1 * g1, 2 * g1 * g2, g2 * g2, 0.0, rate_var)))
    return np.array(table).T.reshape(7, -1)


class Slots:
    """
    The recent past of one axis on a grid of SLOT seconds, gaps marked.

    Uneven and gappy input of any rate becomes slot means; a slot without a sample stays empty.
    """

    SLOT = 0.25
    WINDOW = 300.0
    LAGS: Array = np.linspace(0.25, 8.0, 32)

    def __init__(self) -> None:
        self._slots: deque[tuple[int, float]] = deque()
        self._index = -1
        self._sum = 0.0
        self._count = 0

    def add(self, time: float, value: float) -> None:
        """Take a sample at ``time`` (s, not before the last one)."""
        index = floor(time / self.SLOT)
        if index != self._index:
            self._close()
            self._index = index
        self._sum += value
        self._count += 1

    def _close(self) -> None:
        if self._count:
            self._slots.append((self._index, self._sum / self._count))
            oldest = self._index - self.WINDOW / self.SLOT
            while self._slots[0][0] < oldest:
                self._slots.popleft()
        self._sum, self._count = 0.0, 0

    @property
    def span(self) -> float:
        """Seconds from the first slot to the last."""
        return (self._slots[-1][0] - self._slots[0][0]) * self.SLOT if self._slots else 0.0

    def moments(self) -> tuple[float, float]:
        """Return mean and variance over the slots with samples, 0 without any."""
        if not self._slots:
            return 0.0, 0.0
        values = np.array([value for _, value in self._slots])
        return float(values.mean()), float(values.var())

    def autocovariance(self) -> tuple[float, float, Array, Array]:
        """
        Estimate mean, variance and autocovariance over the pairs of slots that have samples.

        Returns
        -------
        mean, var : float
            Over all slots with samples.
        cov : ndarray, shape (32,)
            Autocovariance at ``LAGS``; 0 where no pair of slots has that lag.
        pairs : ndarray, shape (32,)
            Number of pairs behind each.

        """
        table = np.fromiter(chain.from_iterable(self._slots), float).reshape(-1, 2)
        index = table[:, 0].astype(int) - int(table[0, 0])
        mean, var = float(table[:, 1].mean()), float(table[:, 1].var())
        series, there = np.zeros(index[-1] + 1), np.zeros(index[-1] + 1)
        series[index] = table[:, 1] - mean
        there[index] = 1.0
        sums, pairs = np.zeros(len(self.LAGS)), np.zeros(len(self.LAGS))
        for k in range(1, min(len(self.LAGS), index[-1]) + 1):
            sums[k - 1] = series[k:] @ series[:-k]
            pairs[k - 1] = there[k:] @ there[:-k]
        return mean, var, sums / np.maximum(pairs, 1.0), pairs


# The shaping filters tried when an axis is tuned: unit variance, peak (rad/s), damping ratio.
_PEAKS = np.geomspace(0.25, 3.0, 60)
_DAMPING_RATIOS = (0.03, 0.05, 0.08, 0.12, 0.18, 0.25, 0.35, 0.5, 0.7)
_CANDIDATES = [(float(peak), ratio) for peak in _PEAKS for ratio in _DAMPING_RATIOS]
_CORRELATIONS = np.array([ShapingFilter.of_motion(1.0, peak, ratio).autocorrelation(Slots.LAGS)
                          for peak, ratio in _CANDIDATES])


def fit_shaping_filter(slots: Slots) -> tuple[ShapingFilter, float, float]:
    """
    Fit peak, damping and size of a shaping filter to the recent autocovariance.

    Weighted least squares over lags of 0.25-8 s, which by Wiener and Khinchin is a fit to the
    spectrum around its peak, and works with uneven and missing samples.

    Returns
    -------
    process : ShapingFilter
    mean : float
        Level of the axis.
    excess_var : float
        Variance that the filter does not explain.

    """
    mean, var, cov, pairs = slots.autocovariance()
    weights = np.where(pairs >= 3, pairs, 0.0)
    weighted = _CORRELATIONS * weights
    power = np.einsum('ij,ij->i', weighted, _CORRELATIONS)
    sizes = np.clip(weighted @ cov / np.maximum(power, 1e-12), 0.02 * var, var)
    misfit = sizes * (sizes * power - 2 * (weighted @ cov))
    best = int(np.argmin(misfit))
    size = max(float(sizes[best]), 1e-18)
    return (ShapingFilter.of_motion(sqrt(size), *_CANDIDATES[best]), mean, max(var - size, 0.0))


def early_mean(slots: Slots, prior_sd: float, independent_after: float = 8.0) -> float:
    """
    Estimate the level of an axis from a few seconds, drawn to 0 as far as they cannot tell.

    Parameters
    ----------
    slots : Slots
        What came so far.
    prior_sd : float
        How far from 0 the level may be.
    independent_after : float
        Seconds after which the motion says something new about its mean.

    """
    mean, var = slots.moments()
    prior_var = prior_sd * prior_sd
    return mean * prior_var / (prior_var + var * independent_after / max(slots.span, slots.SLOT))


class ForecastScore:
    """
    How good one axis's forecasts have been, some horizons ahead, recent ones counting most.

    A forecast is a filter's deviation d with variance P. Over those that came true this keeps
    the slope of what came on d (1 for a right model, 0 for a useless one: then the mean is the
    best forecast) and the ratio of the error of slope * d to its promise, the noise of what came
    set aside.

    Parameters
    ----------
    ratio : float
        Believed of real to promised squared error before any forecast came true.

    """

    HORIZONS = (0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
    SPACING = 0.5  # s between forecasts that are kept
    HALF_LIFE = 120.0  # s
    PRIOR = 10.0  # forecasts that the initial belief (slope 1 and the ratio) weighs

    def __init__(self, ratio: float = 1.0) -> None:
        self._ratio = ratio
        self._kept: deque[tuple[float, AxisFilter]] = deque()
        n = len(self.HORIZONS)
        # of each horizon: sums of d * came / P, d * d / P, error^2 / P, noise / P, their number
        self._sums = [(0.0, 0.0, 0.0, 0.0, 0.0)] * n
        self.slopes = (1.0,) * (n + 1)  # at 0 and at the horizons
        self.ratios = (1.0, *(ratio,) * n)

    def compare(self, time: float, value: float, var: float) -> float | None:
        """
        Score the forecasts for ``time`` (s) with the value that came and its variance.

        Returns
        -------
        float or None
            The standardised error of the 3 s forecast, if there was one.

        """
        if not self.is_due(time):
            return None
        fade = 0.5 ** (self.SPACING / self.HALF_LIFE)
        recent = None
        for k, horizon in enumerate(self.HORIZONS):
            kept = self._kept_at(time - horizon)
            if kept is None:
                continue
            deviation, promised = kept.deviation(kept.age(time))
            came = value - kept.mean
            error = came - self.slopes[k + 1] * deviation
            # a surprise counts as one of 4 sd: else a calm that ends would be felt for minutes
            scale = max(promised, (error / 4)**2)
            both, own, errors, noise, number = self._sums[k]
            self._sums[k] = (
                fade * both + deviation * came / scale, fade * own + deviation**2 / scale,
                fade * errors + error * error / scale, fade * noise + var / scale,
                fade * number + 1.0)
            if horizon == 3.0:
                recent = error / sqrt(promised * self.ratios[k + 1] + var)
        # a sensor that could not confirm forecasts so well is not as bad as it is said to be
        believed = float(self._sums[0][2] >= self._sums[0][3])
        self.slopes = (1.0, *(min(max((both + self.PRIOR) / (own + self.PRIOR), 0.0), 1.0)
                              for both, own, _, _, _ in self._sums))
        self.ratios = (1.0, *(
            (max(errors - believed * noise, 0.5 * errors) + self._ratio * self.PRIOR)
            / (number + self.PRIOR) for _, _, errors, noise, number in self._sums))
        return recent

    def is_due(self, time: float) -> bool:
        """Say whether the forecast made at ``time`` (s) is one to keep."""
        return not self._kept or time - self._kept[-1][0] >= self.SPACING - 1e-9

    def keep(self, time: float, state: AxisFilter) -> None:
        """Keep the forecast made at ``time`` (s) until it has come true."""
        if self.is_due(time):
            self._kept.append((time, state.frozen()))
            while time - self._kept[0][0] > self.HORIZONS[-1] + 2 * self.SPACING:
                self._kept.popleft()

    def _kept_at(self, time: float) -> AxisFilter | None:
        for when, state in reversed(self._kept):
            if when <= time + 1e-9:
                return state if time - when < 2 * self.SPACING else None
        return None


class AxisOutlook:
    """
    What one axis can say of the future, frozen.

    Parameters
    ----------
    state : AxisFilter
        A copy that nobody changes any more.
    slopes, ratios : tuple of float
        At 0 and ForecastScore.HORIZONS.

    """

    __slots__ = ('_state', '_slopes', '_ratios')
    _GRID = (0.0, *ForecastScore.HORIZONS)

    def __init__(self, state: AxisFilter, slopes: tuple[float, ...],
                 ratios: tuple[float, ...]) -> None:
        self._state, self._slopes, self._ratios = state, slopes, ratios

    def mean(self, time: float) -> float:
        """Predict the axis at ``time`` (s)."""
        ahead = self._state.age(time)
        return self._state.mean + self._at(ahead, self._slopes) * self._state.deviation(ahead)[0]

    def predict(self, time: float) -> tuple[float, float, float, float]:
        """Predict value, its variance, mean rate and its variance at ``time`` (s)."""
        value, var, rate, rate_var = self.table(time, NOW)[:, 0].tolist()
        return value, var, rate, rate_var

    def table(self, time: float, horizons: Array) -> Array:
        """
        Predict the same for ``horizons`` (s, shape (n,)) after ``time`` (s).

        Returns
        -------
        ndarray, shape (4, n)

        """
        ahead = round(self._state.age(time), 6) + horizons  # so that its factors come again
        table = self._state.table(ahead)
        table[::2] *= np.interp(ahead, self._GRID, self._slopes)
        table[1::2] *= np.interp(ahead, self._GRID, self._ratios)
        table[0] += self._state.mean
        return table

    def _at(self, ahead: float, values: tuple[float, ...]) -> float:
        k = bisect_right(self._GRID, ahead)
        if k >= len(values):
            return values[-1]
        left, right = self._GRID[k - 1], self._GRID[k]
        return values[k - 1] + (values[k] - values[k - 1]) * (ahead - left) / (right - left)


class FixedAxis:
    """One axis of Li2014 as published: a model that never changes."""

    ones = (1.0,) * (len(ForecastScore.HORIZONS) + 1)

    def __init__(self, process: ShapingFilter) -> None:
        self._filter = AxisFilter(process)

    def measure(self, time: float, value: float, var: float) -> bool:
        """Use a measurement at ``time`` (s); no forecast is scored."""
        self._filter.measure(time, value, var)
        return False

    def outlook(self) -> AxisOutlook:
        """Return what is known of the future now."""
        return AxisOutlook(self._filter.frozen(), self.ones, self.ones)


class TunedAxis:
    """
    One axis whose shaping filter follows the ship.

    Every TUNE_EVERY seconds the filter is fitted anew to the last five minutes and started again
    from the last minute's samples, so the change leaves no step. Before the first fit the prior
    filter moves about what is known of the mean. What the realised forecasts teach
    (:class:`ForecastScore`) shrinks the forecast towards the mean and scales its variance.
    """

    TUNE_EVERY = 5.0
    TUNE_FIRST = 20.0
    CENTRE_EVERY = 2.0
    REPLAY = 60.0
    FIRST_RATIO = 2.0  # of squared errors, right after the first fit: it rests on little

    def __init__(self, prior: ShapingFilter) -> None:
        self._prior = prior
        self.filter = AxisFilter(prior)
        self.score = ForecastScore()
        self.slots = Slots()
        self._recent: deque[tuple[float, float, float]] = deque()
        self._due = -inf
        self._fitted = False
        self.last_error: tuple[float, float] | None = None

    def measure(self, time: float, value: float, var: float) -> bool:
        """Use a measurement at ``time`` (s); say whether there is a new ``last_error``."""
        error = self.score.compare(time, value, var)
        if error is not None:
            self.last_error = (time, error)
        self.slots.add(time, value)
        if time >= self._due:
            self._tune(time, var)
            for item in self._recent:
                self.filter.measure(*item)
        self.filter.measure(time, value, var)
        self.score.keep(time, self.filter)
        if not self._recent or time - self._recent[-1][0] >= 0.9 * Slots.SLOT:
            self._recent.append((time, value, var))
            while time - self._recent[0][0] > self.REPLAY:
                self._recent.popleft()
        return error is not None

    def _tune(self, time: float, var: float) -> None:
        if self.slots.span >= self.TUNE_FIRST:
            self._due = time + self.TUNE_EVERY
            process, mean, excess = fit_shaping_filter(self.slots)
            # even a stuck sensor leaves a doubt, a fraction of its noise
            self.filter = AxisFilter(process, mean, max(excess, var / 4))
            if not self._fitted:  # what the prior's forecasts taught is past
                self._fitted = True
                self.score = ForecastScore(self.FIRST_RATIO)
        else:
            self._due = time + self.CENTRE_EVERY
            self.filter = AxisFilter(self._prior, early_mean(self.slots, self._prior.sd / 2))

    def outlook(self) -> AxisOutlook:
        """Return what is known of the future now."""
        return AxisOutlook(self.filter.frozen(), self.score.slopes, self.score.ratios)


class Foresight(Protocol):
    """What :class:`Outlook` asks of an axis; see :class:`AxisOutlook`."""

    def mean(self, time: float) -> float:
        """Predict the axis at ``time`` (s)."""

    def table(self, time: float, horizons: Array) -> Array:
        """Predict value, its variance, rate, its variance: shape (4, n), for n horizons (s)."""


class Outlook:
    """
    What all axes together can say of the future, frozen.

    Parameters
    ----------
    axes : tuple of 3 Foresight
        Roll, pitch (rad), heave (m).
    correlation : ndarray, shape (3, 3)
        Of their forecast errors.

    """

    __slots__ = ('_axes', '_correlation')

    def __init__(self, axes: tuple[Foresight, ...], correlation: Array) -> None:
        self._axes, self._correlation = axes, correlation

    def mean(self, time: float) -> tuple[float, float, float]:
        """Predict roll, pitch (rad) and heave (m) at ``time`` (s), the mean alone."""
        roll, pitch, heave = self._axes
        return roll.mean(time), pitch.mean(time), heave.mean(time)

    def forecast(self, time: float, horizons: Array) -> MotionForecast:
        """
        Predict the motion ``horizons`` seconds (shape (n,)) after ``time`` (s).

        An axis that never came is predicted at rest, with the model's own spread.
        """
        mean, var, rate, rate_var = np.stack(
            [axis.table(time, horizons) for axis in self._axes], axis=-1)
        return MotionForecast(horizons, mean, _joined(var, self._correlation),
                              rate, _joined(rate_var, self._correlation))


class ShapingPredictor:
    """
    Roll, pitch and heave, each by its own filter, joined by what their errors have in common.

    Parameters
    ----------
    tuned : bool
        Follow the ship (:class:`TunedAxis`), or keep Li2014's models.

    """

    CORRELATION_PRIOR = 30.0  # error triples that "uncorrelated" weighs

    def __init__(self, tuned: bool = True) -> None:
        self.axes: tuple[TunedAxis | FixedAxis, ...] = tuple(
            TunedAxis(process) if tuned else FixedAxis(process) for process in LI2014)
        self._joint = np.zeros((3, 3))
        self._joint_time = nan
        self._correlation: Array = np.eye(3)

    def measure(self, axis: int, time: float, value: float, var: float) -> None:
        """
        Use a measurement.

        Parameters
        ----------
        axis : int
            ROLL, PITCH or HEAVE.
        time : float
            Seconds, not before the axis's last one.
        value, var : float
            Radians or metres, and the variance of its error.

        """
        if self.axes[axis].measure(time, value, var):
            self._learn_correlation()

    def _learn_correlation(self) -> None:
        errors = [axis.last_error for axis in self.axes if isinstance(axis, TunedAxis)]
        recent = [error for error in errors if error is not None]
        if len(recent) < 3:
            return
        times = [time for time, _ in recent]
        if max(times) == self._joint_time or max(times) - min(times) > ForecastScore.SPACING / 2:
            return
        self._joint_time = max(times)
        vec = np.clip([error for _, error in recent], -5.0, 5.0)
        self._joint *= 0.5 ** (ForecastScore.SPACING / ForecastScore.HALF_LIFE)
        self._joint += np.outer(vec, vec)
        mat = self._joint + np.eye(3) * self.CORRELATION_PRIOR
        sd = np.sqrt(np.diag(mat))
        self._correlation = mat / np.outer(sd, sd)

    def outlook(self) -> Outlook:
        """Return what is known of the future now."""
        return Outlook(tuple(axis.outlook() for axis in self.axes), self._correlation)


def _joined(var: Array, correlation: Array) -> Array:
    """Make covariances (n, 3, 3) of variances (n, 3) and one correlation (3, 3)."""
    sd = np.sqrt(var)
    return np.asarray(sd[:, :, None] * correlation * sd[:, None, :])

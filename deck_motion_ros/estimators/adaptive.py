"""The predictor that learns the ship: per-axis filters first, all axes together as they learn."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from math import inf, isfinite

import numpy as np

from deck_motion_ros.estimators.joint import JointModel, JointOutlook
from deck_motion_ros.estimators.resampling import Grid, Resampler, Tick
from deck_motion_ros.estimators.shaping import AxisOutlook, LI2014, TunedAxis
from deck_motion_ros.samples import Array, AXES, MotionForecast, Vector3


class OutlierGate:
    """
    Turn away single samples that no motion explains.

    A sample is an outlier if its innovation is beyond ``LIMIT`` times the recent rms innovation;
    the third in a row is believed: the sensor or the ship has changed.
    """

    LIMIT, PATIENCE, HALF_LIFE, WARM_UP = 7.0, 2, 50, 20

    def __init__(self) -> None:
        self._square = 0.0
        self._number = 0.0
        self._seen = 0
        self._refused = 0

    def admits(self, innovation: float) -> bool:
        """Judge a sample by its innovation, any unit."""
        square = innovation * innovation
        usual = self._square / self._number if self._number else inf
        if (self._seen >= self.WARM_UP and square > self.LIMIT**2 * usual
                and self._refused < self.PATIENCE):
            self._refused += 1
            return False
        self._refused = 0
        self._seen += 1
        fade = 0.5 ** (1 / self.HALF_LIFE)
        bound = 25.0 * usual if self._seen > 5 else inf
        self._square = fade * self._square + min(square, bound)
        self._number = fade * self._number + 1
        return True


class AdaptiveOutlook:
    """
    What filters and joint model together say of the future, frozen.

    Parameters
    ----------
    filters : tuple of 3 AxisOutlook
        Per-axis filters.
    axes : tuple of int
        Axes of the joint model.
    joint : JointOutlook or None
        None while there is no joint model.

    """

    __slots__ = ('_filters', '_axes', '_joint')

    def __init__(self, filters: tuple[AxisOutlook, ...], axes: tuple[int, ...],
                 joint: JointOutlook | None) -> None:
        self._filters, self._axes, self._joint = filters, axes, joint

    def mean(self, time: float) -> Vector3:
        """Predict roll, pitch (rad) and heave (m) at ``time`` (s), the mean alone."""
        value = [0.0, 0.0, 0.0]
        joint = self._joint
        guest, ahead = 1.0, 0.0
        if joint is not None:
            ahead = time - joint.time
            guest = float(np.interp(ahead, joint.times, joint.guest))
        for axis, item in enumerate(self._filters):
            if guest > 1e-6 or axis not in self._axes:
                value[axis] = item.mean(time)
        if joint is not None:
            own = _hermite(joint, ahead)[0]
            for k, axis in enumerate(self._axes):
                value[axis] = guest * value[axis] + (1 - guest) * float(own[k])
        return value[0], value[1], value[2]

    def forecast(self, time: float, horizons: Array) -> MotionForecast:
        """
        Predict the motion ``horizons`` seconds (shape (n,)) after ``time`` (s).

        An axis that never came is predicted at rest, with the filter's own spread.
        """
        joint, n = self._joint, len(horizons)
        chosen = np.array(self._axes, int)
        ahead = time + horizons - (joint.time if joint else 0.0)
        guest = np.interp(ahead, joint.times, joint.guest) if joint else np.ones(n)
        trust = joint.trust if joint else 0.0
        table = np.zeros((n, 3, 4))  # value, variance, rate, its variance
        for k in range(n):
            for axis, item in enumerate(self._filters):
                if guest[k] > 1e-6 or trust < 1 or axis not in self._axes:
                    table[k, axis] = item.predict(time + float(horizons[k]))
        mean, rate = table[..., 0], table[..., 2]
        cov, rate_cov = (table[:, :, None, k] * np.eye(3) for k in (1, 3))
        if joint is not None and n:
            both = [_hermite(joint, float(item)) for item in ahead]
            own, own_rate = (np.array([pair[i] for pair in both]) for i in (0, 1))
            share = guest[:, None]
            mean[:, chosen] = share * mean[:, chosen] + (1 - share) * own
            rate[:, chosen] = share * rate[:, chosen] + (1 - share) * own_rate
            block = (slice(None), chosen[:, None], chosen)
            for mat, learned in ((cov, joint.cov), (rate_cov, joint.rate_cov)):
                known = _between(ahead, joint.times, learned)
                mat[block] = trust * known + (1 - trust) * mat[block]
        return MotionForecast(horizons, mean, cov, rate, rate_cov)


def _hermite(joint: JointOutlook, ahead: float) -> tuple[Array, Array]:
    """Interpolate value and rate between the knots; hold the last value beyond them."""
    knots = JointModel.KNOTS
    at = min(max(ahead, 0.0), float(knots[-1]))
    k = min(bisect_right(knots, at), len(knots) - 1) - 1
    h = float(knots[k + 1] - knots[k])
    u = (at - float(knots[k])) / h
    p, q = joint.value[k], joint.value[k + 1]
    r, s = h * joint.rate[k], h * joint.rate[k + 1]
    a, b = 2 * (p - q) + r + s, 3 * (q - p) - 2 * r - s
    return p + u * (r + u * (b + u * a)), (r + u * (2 * b + u * 3 * a)) / h


def _between(ahead: Array, times: Array, covs: Array) -> Array:
    """Interpolate covariances (h, m, m) at ``times`` (h,) to ``ahead`` (n,)."""
    flat = covs.reshape(len(times), -1)
    columns = [np.interp(ahead, times, column) for column in flat.T]
    return np.stack(columns, axis=-1).reshape(len(ahead), *covs.shape[1:])


class AdaptivePredictor:
    """
    Predict roll, pitch and heave of a ship of which nothing is known in advance.

    Per-axis filters (:class:`TunedAxis`) predict from the first sample on. Once the axes that come
    and their rate are known, a :class:`JointModel` learns them together; the filters are its
    guests, and what is published when they are better or the only ones.

    Stamps alone decide; the order of calls within one stamp changes nothing.

    Parameters
    ----------
    profile : mapping of str to ndarray, optional
        What :meth:`profile` gave on an earlier run of the same ship and sensors, for a warm
        start; one of other axes or another rate is left aside.

    """

    LOOK = 8.0  # s of samples that decide on axes and grid
    THIN = 0.05  # s between those that are kept meanwhile
    LONGEST_GAP = 10.0  # s: beyond it the recent past is worthless
    DEAD = 60.0  # s: an axis silent for so long is given up
    SLOWEST = 2.1  # s between samples: no joint model beyond

    def __init__(self, profile: Mapping[str, Array] | None = None) -> None:
        self._profile = profile or {}
        self._filters = tuple(map(TunedAxis, LI2014))
        self._gates = tuple(OutlierGate() for _ in AXES)
        self._noise_var = [0.0, 0.0, 0.0]
        self._newest = [-inf, -inf, -inf]
        self._intervals: tuple[deque[float], ...] = tuple(deque(maxlen=64) for _ in AXES)
        self._look_from = inf
        self._waiting: list[tuple[float, int, float]] = []
        self._axes: tuple[int, ...] = ()
        self._resampler: Resampler | None = None
        self._joint: JointModel | None = None
        self._bridge: AdaptiveOutlook | None = None
        self._samples: Array = np.ones(0)  # in a slot, which averages their noise
        self._time = -inf

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
        if time <= self._newest[axis] or not isfinite(value):
            return
        newest = max(self._newest)
        since, self._newest[axis] = time - self._newest[axis], time
        filtered = self._filters[axis]
        expected = filtered.filter.mean + filtered.filter.deviation(filtered.filter.age(time))[0]
        self._noise_var[axis] = var
        if not self._gates[axis].admits(value - expected):
            return
        filtered.measure(time, value, var)
        if since < self.LONGEST_GAP:
            self._intervals[axis].append(since)
        if time - newest > self.LONGEST_GAP and newest > -inf:
            self._interrupt(time)
        self._watch_axes(axis, time)
        if self._resampler is None:
            self._look(axis, time, value)
        elif axis in self._axes:
            for tick in self._resampler.add(self._axes.index(axis), time, value):
                self._advance(tick)

    def _interrupt(self, time: float) -> None:
        if self._resampler is not None and self._joint is not None:
            self._resampler = Resampler(self._resampler.grid, len(self._axes), time)
            self._joint.interrupt()
            self._bridge = None

    def _watch_axes(self, axis: int, time: float) -> None:
        """Start to look anew when an axis has died or come to life."""
        if self._resampler is None:
            return
        dead = any(time - self._newest[other] > self.DEAD for other in self._axes)
        if dead or (axis not in self._axes and len(self._intervals[axis]) >= 5):
            for other, intervals in enumerate(self._intervals):
                if time - self._newest[other] > self.DEAD:
                    intervals.clear()
            self._resampler = self._joint = self._bridge = None
            self._axes, self._look_from, self._waiting = (), time, []

    def _look(self, axis: int, time: float, value: float) -> None:
        """Collect samples until axes and rate are known, then start the joint model with them."""
        self._look_from = min(self._look_from, time)
        kept = [when for when, other, _ in reversed(self._waiting) if other == axis]
        if not kept or time - kept[0] >= self.THIN:
            self._waiting.append((time, axis, value))
        if time < self._look_from + self.LOOK:
            return
        axes = tuple(k for k in range(3) if len(self._intervals[k]) >= 3
                     and time - self._newest[k] < self.LOOK / 2)
        period = max((float(np.median(self._intervals[k])) for k in axes), default=inf)
        if period > self.SLOWEST:
            self._look_from, self._waiting = time, []
            return
        grid = Grid.of_period(period)
        waiting = sorted(item for item in self._waiting if item[1] in axes)
        start = max(min(when for when, other, _ in waiting if other == k) for k in axes)
        self._axes = axes
        self._samples = np.array([max(grid.step / float(np.median(self._intervals[k])), 1.0)
                                  for k in axes])
        self._joint = JointModel(len(axes), grid)
        self._joint.recall(self._profile, axes)
        self._resampler = Resampler(grid, len(axes), start)
        self._waiting = []
        for when, other, sample in waiting:
            for tick in self._resampler.add(axes.index(other), when, sample):
                self._advance(tick, live=False)

    def _advance(self, tick: Tick, live: bool = True) -> None:
        assert self._joint is not None and self._resampler is not None
        joint, grid = self._joint, self._resampler.grid
        values, known = tick.values, bool(tick.known.all())
        if known:
            self._bridge = None
        else:
            self._bridge = self._bridge or self.outlook()
            middle = tick.time - (grid.tick / 2 if grid.ticks > 1 else 0.0)
            expected = np.array(self._bridge.mean(middle))[list(self._axes)]
            values = np.where(tick.known, values, expected)
        guest = None
        if live and joint.ends_slot:
            outlooks = [self._filters[axis].outlook() for axis in self._axes]
            guest = np.array([[item.mean(tick.time + ahead) for item in outlooks]
                              for ahead in joint.times.tolist()])
        noise_var = np.array([self._noise_var[axis] for axis in self._axes]) / self._samples
        joint.advance(values, known, guest, noise_var)
        self._time = tick.time

    def profile(self) -> dict[str, Array]:
        """Return what was learned of the ship, to be saved; empty before anything was."""
        return self._joint.profile(self._axes) if self._joint is not None else {}

    def outlook(self) -> AdaptiveOutlook:
        """Return what is known of the future now."""
        joint = self._joint.outlook(self._time) if self._joint is not None else None
        return AdaptiveOutlook(tuple(item.outlook() for item in self._filters), self._axes, joint)

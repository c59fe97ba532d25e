"""The predictor that learns the ship: per-axis filters first, all axes together as they learn."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import exp, inf, isfinite, nan

import numpy as np

from deck_motion_ros.estimators.joint import JointModel, JointOutlook
from deck_motion_ros.estimators.resampling import Grid, Resampler, Tick
from deck_motion_ros.estimators.wave_bank import BANK, BankAxis, BankOutlook, Certainty
from deck_motion_ros.geometry import wrapped
from deck_motion_ros.samples import Array, AXES, MotionForecast, Vector3

IDENTITY = np.eye(len(AXES))


class OutlierGate:
    """
    Turn away single samples that no motion explains.

    A sample is an outlier if its innovation is beyond ``LIMIT`` times the recent rms innovation;
    the third in a row is believed: the sensor or the ship has changed.
    """

    LIMIT, PATIENCE, WARM_UP = 7.0, 2, 20
    FADE = 0.5 ** (1 / 50)
    BOUND = 25.0  # times the mean square, which a square counts at most

    def __init__(self) -> None:
        self._square = self._number = 0.0
        self._seen = self._refused = 0

    def admits(self, innovation: float) -> bool:
        """Judge a sample by its innovation, any unit."""
        square = innovation * innovation
        if self._seen > 5:
            usual = self._square / self._number
            if (square > self.LIMIT**2 * usual and self._seen >= self.WARM_UP
                    and self._refused < self.PATIENCE):
                self._refused += 1
                return False
            square = min(square, self.BOUND * usual)
        self._refused = 0
        self._seen += 1
        self._square = self.FADE * self._square + square
        self._number = self.FADE * self._number + 1
        return True


class AdaptiveOutlook:
    """
    What filters and joint model together say of the future, frozen.

    Parameters
    ----------
    filters : tuple of 3 BankOutlook
        Per-axis filters.
    axes : tuple of int
        Axes of the joint model.
    joint : JointOutlook or None
        None while there is no joint model.

    """

    __slots__ = ('_filters', '_axes', '_joint')

    def __init__(self, filters: tuple[BankOutlook, ...], axes: tuple[int, ...],
                 joint: JointOutlook | None) -> None:
        self._filters, self._axes, self._joint = filters, axes, joint

    def mean(self, time: float) -> Vector3:
        """Predict roll, pitch (rad) and heave (m) at ``time`` (s), the mean alone."""
        joint = self._joint
        if joint is None:
            roll, pitch, heave = (item.mean(time) for item in self._filters)
            return roll, pitch, heave
        ahead, value = time - joint.time, [0.0, 0.0, 0.0]
        shares = joint.shares(np.array([ahead]))[0, 0].tolist()
        for axis, own, share in zip(self._axes, joint.mean(ahead), shares, strict=True):
            value[axis] = (1 - share) * own
            if share > 0:
                value[axis] += share * self._filters[axis].mean(time)
        for axis, item in enumerate(self._filters):
            if axis not in self._axes:
                value[axis] = item.mean(time)
        return value[0], value[1], value[2]

    def forecast(self, time: float, horizons: Array) -> MotionForecast:
        """
        Predict the motion ``horizons`` seconds (shape (n,)) after ``time`` (s).

        An axis that never came is predicted at rest, with the filter's own spread.
        """
        joint, axes = self._joint, self._axes
        mean, var = np.zeros((2, 2, len(horizons), len(AXES)))  # each of value and rate
        if joint is not None:
            ahead = time + horizons - joint.time
            share, slope = joint.shares(ahead)
        for axis, item in enumerate(self._filters):
            if joint is None or axis not in axes or share.any() or slope.any():
                mean[..., axis] = item.motion(time, horizons)
            if joint is None or axis not in axes or joint.trust < 1:
                var[..., axis] = item.spread(time, horizons)
        if joint is None:
            cov = var[..., None] * IDENTITY
        else:
            at, across = ((slice(None), slice(None)) if len(axes) == len(AXES)  # which is faster
                          else (np.array(axes), np.array(axes)[:, None]))
            own = joint.motion(ahead)
            apart = mean[..., at] - own
            mean[..., at] = own + share * apart
            mean[1][:, at] += slope * apart[0]
            var[..., at] *= 1 - joint.trust
            cov = var[..., None] * IDENTITY
            cov[..., across, at] += joint.trust * joint.spread(ahead)
        return MotionForecast(horizons, mean[0], cov[0], mean[1], cov[1])


class AdaptivePredictor:
    """
    Predict roll, pitch and heave of a ship of which nothing is known in advance.

    Banks of filters of each axis (:class:`BankAxis`) predict from the first sample on. Once the
    axes that come and their rate are known, a :class:`JointModel` learns them together; the banks
    are its guests, and what is published when they are better or the only ones.

    Stamps alone decide; the order of calls within one stamp changes nothing.

    Parameters
    ----------
    profile : mapping of str to ndarray, optional
        What :meth:`profile` gave on an earlier run of the same ship and sensors, for a warm
        start; one of other axes or another rate is left aside.

    """

    USUAL = (0.05, 0.02, 1.0)  # sd of the axes before anything came (rad, m)
    LOOK = 8.0  # s of samples that decide on axes and grid
    THIN = 0.05  # s between those that are kept meanwhile
    LONGEST_GAP = 10.0  # s: beyond it the recent past is worthless
    LONGEST_BRIDGE = 3.0  # s that an axis may be guessed while others come
    STUCK = 5.0  # s: an axis without any change for so long counts as silent
    DEAD = 60.0  # s: an axis silent for so long is given up
    STEADY = 5.0  # s over which the heading is averaged
    SLOWEST = 2.1  # s between samples: no joint model beyond

    def __init__(self, profile: Mapping[str, Array] | None = None) -> None:
        self._profile = profile or {}
        start = Certainty(BANK)
        self._filters = tuple(BankAxis(sd, start) for sd in self.USUAL)
        self._gates = tuple(OutlierGate() for _ in AXES)
        self._noise_var = [0.0, 0.0, 0.0]
        self._newest = [-inf, -inf, -inf]
        self._values = [nan, nan, nan]
        self._changed = [-inf, -inf, -inf]
        self._intervals: tuple[deque[float], ...] = tuple(deque(maxlen=64) for _ in AXES)
        self._look_from = inf
        self._looked_at: list[tuple[float, int, float]] = []
        self._axes: tuple[int, ...] = ()
        self._resampler: Resampler | None = None
        self._joint: JointModel | None = None
        self._bridge: AdaptiveOutlook | None = None
        self._bridged_from = -inf
        self._lost = False  # too long for a bridge: the filters are alone
        self._samples: Array = np.ones(0)  # in a slot, which averages their noise
        self._heading: float | None = None
        self._headed = -inf
        self._stamp = self._time = -inf  # of the newest sample; of the newest tick
        self._waiting: list[tuple[int, float, float]] = []  # of that stamp

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
        self._reach(time)
        self._waiting.append((axis, value, var))
        if len(self._waiting) == len(AXES):
            self._settle()

    def head(self, time: float, yaw: float) -> None:
        """Use the ship's heading (rad), as far as it is known: after a turn the sea is another."""
        self._reach(time)
        if self._heading is None:
            self._heading = yaw
        else:
            weight = 1 - exp(-max(time - self._headed, 0.0) / self.STEADY)
            self._heading += weight * wrapped(yaw - self._heading)
        self._headed = time

    def _reach(self, time: float) -> None:
        """Go to the stamp ``time``, if it is a new one."""
        if time != self._stamp:
            self._settle()
            self._stamp = time
            if self._joint is not None and self._heading is not None:
                self._joint.heading = self._heading  # of the stamps before

    def _settle(self) -> None:
        """Use what came with the newest stamp, in the order of the axes."""
        waiting, self._waiting = sorted(self._waiting), []
        if waiting:
            self._watch_axes(self._stamp)
        for axis, value, var in waiting:
            self._use(axis, self._stamp, value, var)

    def _use(self, axis: int, time: float, value: float, var: float) -> None:
        since = time - self._newest[axis]
        if not (since > 0 and isfinite(value)):
            return
        self._newest[axis] = time
        self._noise_var[axis] = var
        if value != self._values[axis]:
            self._values[axis], self._changed[axis] = value, time
        filtered = self._filters[axis]
        if not self._gates[axis].admits(value - filtered.expected(time)):
            return
        stuck = time - self._changed[axis] > self.STUCK
        if not (stuck and filtered.usual > var):  # a ship at rest may stay there
            filtered.measure(time, value, var)
        if since < self.LONGEST_GAP:
            self._intervals[axis].append(since)
        if stuck:
            return
        if self._resampler is None:
            kept = [when for when, other, _ in reversed(self._looked_at) if other == axis]
            if not kept or time - kept[0] >= self.THIN:
                self._looked_at.append((time, axis, value))
        elif axis in self._axes:
            for tick in self._resampler.add(self._axes.index(axis), time, value):
                self._advance(tick)

    def _watch_axes(self, time: float) -> None:
        """Start when there is enough to look at, again when an axis has died or come to life."""
        newest = max(self._newest)
        if self._resampler is None or self._joint is None:
            self._look_from = min(self._look_from, time)
            if time >= self._look_from + self.LOOK:
                self._begin(time)
        elif time - newest > self.LONGEST_GAP:
            self._resampler = Resampler(self._resampler.grid, len(self._axes), time)
            self._joint.interrupt()
            self._bridge, self._lost = None, False
        elif (newest - min(self._changed[axis] for axis in self._axes) > self.DEAD
              or any(len(self._intervals[axis]) >= 5 and newest == self._changed[axis]
                     for axis in range(len(AXES)) if axis not in self._axes)):
            for last, intervals in zip(self._newest, self._intervals, strict=True):
                if newest - last > self.DEAD:
                    intervals.clear()
            if len(self._axes) >= len(self._profile.get('grid', ())) - 2:
                self._profile = self._joint.profile(self._axes)
            self._resampler = self._joint = self._bridge = None
            self._axes, self._look_from, self._looked_at = (), time, []
            self._lost = False

    def _begin(self, time: float) -> None:
        """Start the joint model with the samples collected, once axes and rate are known."""
        heard = {axis for _, axis, _ in self._looked_at}
        axes = tuple(k for k in sorted(heard) if len(self._intervals[k]) >= 3
                     and time - self._changed[k] < self.LOOK / 2)
        period = max((float(np.median(self._intervals[k])) for k in axes), default=inf)
        if period > self.SLOWEST:
            self._look_from, self._looked_at = time, []
            return
        grid = Grid.of_period(period)
        waiting = sorted(item for item in self._looked_at if item[1] in axes)
        start = max(min(when for when, other, _ in waiting if other == k) for k in axes)
        self._axes = axes
        self._samples = np.array([max(grid.step / float(np.median(self._intervals[k])), 1.0)
                                  for k in axes])
        self._joint = JointModel(axes, grid)
        self._joint.recall(self._profile, axes)
        self._resampler = Resampler(grid, len(axes), start)
        self._looked_at = []
        for when, other, sample in waiting:
            for tick in self._resampler.add(axes.index(other), when, sample):
                self._advance(tick, live=False)

    def _advance(self, tick: Tick, live: bool = True) -> None:
        assert self._joint is not None and self._resampler is not None
        joint, grid = self._joint, self._resampler.grid
        values, known = tick.values, all(tick.known)
        if known:
            self._bridge, self._lost = None, False
        elif self._lost:
            return
        else:
            if self._bridge is None:
                self._bridge, self._bridged_from = self._outlook(), tick.time
            if tick.time - self._bridged_from > self.LONGEST_BRIDGE:
                self._lost = True
                joint.interrupt()
                return
            middle = tick.time - (grid.tick / 2 if grid.ticks > 1 else 0.0)
            expected = np.array(self._bridge.mean(middle))[list(self._axes)]
            values = np.where(tick.known, values, expected)
        guest = None
        if live and joint.ends_slot:
            guest = np.stack([self._filters[axis].outlook().motion(tick.time, joint.times)
                              for axis in self._axes], axis=-1)
        noise_var = np.array([self._noise_var[axis] for axis in self._axes]) / self._samples
        joint.advance(values, known, guest, noise_var)
        self._time = tick.time

    def profile(self) -> dict[str, Array]:
        """Return what was learned of the ship, to be saved; empty before anything was."""
        self._settle()
        return self._joint.profile(self._axes) if self._joint is not None else {}

    def outlook(self) -> AdaptiveOutlook:
        """Return what is known of the future now."""
        self._settle()
        return self._outlook()

    def _outlook(self) -> AdaptiveOutlook:
        joint = self._joint.outlook(self._time) if self._joint and not self._lost else None
        return AdaptiveOutlook(tuple(item.outlook() for item in self._filters), self._axes, joint)

"""The touchdown point ahead: streams joined, motion predicted, the lever arm applied."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, nan, pi, radians
from typing import Protocol

import numpy as np

from deck_motion_ros.config import parameter
from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.interleaved import InterleavedPredictor
from deck_motion_ros.estimators.shaping import ShapingPredictor
from deck_motion_ros.estimators.window import chosen_limits, Limits, Lookout, PRESETS
from deck_motion_ros.geometry import (
    attitude_of_mounted,
    height_above_rest,
    matrix_from_rpy,
    quaternion_from_rpy,
    rate_axes,
    rpy_from_quaternion,
    turned_arm,
    wrapped,
)
from deck_motion_ros.samples import (
    Array,
    HEAVE,
    HeaveSample,
    ImuSample,
    MotionForecast,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
    PITCH,
    Rejected,
    ROLL,
    seconds,
    TouchdownForecast,
    TouchdownPose,
    Vector3,
)
from deck_motion_ros.streams import OutputSchedule, Rewind, StampGate

Sample = ImuSample | HeaveSample | OdometrySample

FORECAST_TIMES: Array = np.linspace(0.5, 10.0, 20)  # s ahead, of touchdown/forecast
MAX_HEAVE = 100.0  # m: no ship heaves more


@dataclass(frozen=True, slots=True)
class PredictorConfig:
    """Parameters of the predictor."""

    method: str = parameter(
        'adaptive', 'How the motion is predicted: all axes learned together while the ship is '
        'observed, on top of the next (adaptive); per-axis shaping-filter Kalman filters '
        '(Li2014); or pairs of interleaved constant-acceleration filters (Zhang2021: for up to '
        '1 s ahead)', choices=('adaptive', 'shaping', 'interleaved'))
    horizon: float = parameter(3.0, 'How far ahead the height is predicted', 's', 0.1, 10.0)
    lever_arm: Vector3 = parameter(
        (-67.97, 3.05, 19.5), 'Touchdown point in ship_base_link: forward, left, up', 'm',
        -1000.0, 1000.0, length=3)
    attitude_sd: float = parameter(
        0.0005, 'White noise of measured roll and pitch, where the message does not say', 'rad',
        1e-6, 1.0)
    heave_sd: float = parameter(
        0.05, 'White noise of measured heave, where the message does not say', 'm', 1e-5, 10.0)
    output_rate: float = parameter(
        10.0, 'At most this many outputs per second of stamp time', 'Hz', 0.01, 1000.0)
    shaping_preset: str = parameter(
        'tuned', 'Shaping filters: fitted on line to the ship; or as published, with noise '
        '0.7 deg (paper) or 0.05 deg and 0.05 m (mru) in place of attitude_sd and heave_sd',
        choices=('tuned', 'paper', 'mru'))
    sensor_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'How the sensor of ship/imu is mounted: its roll, pitch, yaw in '
        'ship_base_link', 'deg', -360.0, 360.0, length=3)
    horizontal_sd: float = parameter(
        0.5, 'What surge and sway, which are not measured, are worth', 'm', 0.0, 100.0)
    window_preset: str = parameter(
        'helicopter', 'Limits of a landing: for a helicopter, significant amplitudes by the RMS '
        'criteria of STANAG 4154 as remembered, not verified (2.5 m, 2 m/s, roll 5, pitch 3 deg); '
        'or for a small drone, our own guess (1.5 m, 0.75 m/s, 4, 2.5 deg)',
        choices=tuple(PRESETS))
    window_height: float = parameter(
        nan, 'Limit of the height, up or down from rest; unset = of the preset', 'm', 0.001, 100.0)
    window_rate: float = parameter(
        nan, 'Limit of the vertical rate; unset = of the preset', 'm/s', 0.001, 100.0)
    window_roll_deg: float = parameter(
        nan, 'Limit of the roll; unset = of the preset', 'deg', 0.001, 90.0)
    window_pitch_deg: float = parameter(
        nan, 'Limit of the pitch; unset = of the preset', 'deg', 0.001, 90.0)
    window_duration: float = parameter(
        5.0, 'How long the deck must stay within the limits', 's', 0.25, 10.0)
    window_confidence: float = parameter(
        0.9, 'From which probability on it is go', '', 0.5, 0.999)
    window_output_rate: float = parameter(
        2.0, 'At most this many landing windows per second of stamp time', 'Hz', 0.01, 1000.0)
    profile: str = parameter(
        '', 'File of what an earlier run learned of this ship with these sensors, for a warm '
        'start of method adaptive; empty = none. One of other axes or another rate is left aside')
    save_profile: str = parameter(
        '', 'File to keep what method adaptive learns, renewed every 60 s of stamps and at the '
        'end; empty = none. If profile names the same file, that need not exist at first')
    ship_level_frame: str = parameter('ship_level', 'Level frame at the reference point')
    ship_base_link_frame: str = parameter('ship_base_link', "The ship's body frame")
    touchdown_frame: str = parameter('touchdown', 'Frame of the touchdown point, deck axes')
    touchdown_rest_frame: str = parameter(
        'touchdown_rest', 'Level frame where the touchdown point rests')

    def noise(self) -> tuple[float, float]:
        """Return the variances of attitude (rad^2) and heave (m^2) that the preset implies."""
        attitude_sd = {'tuned': self.attitude_sd, 'paper': radians(0.7),
                       'mru': radians(0.05)}[self.shaping_preset]
        heave_sd = self.heave_sd if self.shaping_preset == 'tuned' else 0.05
        return attitude_sd**2, heave_sd**2

    def limits(self) -> Limits:
        """Return what a landing bears: the preset, but for what is set."""
        return chosen_limits(self.window_preset, self.window_height, self.window_rate,
                             radians(self.window_roll_deg), radians(self.window_pitch_deg))

    def lookout(self) -> Lookout:
        """Make what judges landing windows."""
        return Lookout(self.limits(), self.window_duration, self.window_confidence,
                       self.window_output_rate)


class MotionOutlook(Protocol):
    """What a method can say of the future, frozen; times in seconds from a common start."""

    def mean(self, time: float) -> Vector3:
        """Predict roll, pitch (rad) and heave (m) at a time, the mean alone."""

    def forecast(self, time: float, horizons: Array) -> MotionForecast:
        """Predict the motion some horizons (s) after a time."""


class MotionPredictor(Protocol):
    """What every method offers; times in seconds from a common start."""

    def measure(self, axis: int, time: float, value: float, var: float) -> None:
        """Use a measurement of ROLL, PITCH (rad) or HEAVE (m)."""

    def outlook(self) -> MotionOutlook:
        """Return what is known of the future now."""


@dataclass(frozen=True, eq=False)
class TouchdownPrediction:
    """
    The touchdown point, predicted from everything up to ``issued_at``.

    Attributes
    ----------
    issued_at, valid_at : int
        Nanoseconds: the newest measurement, and that plus the horizon.
    height : float
        Above rest at ``valid_at`` (m).

    The rest is computed when asked for, from what was known at ``issued_at``.

    """

    issued_at: int
    valid_at: int
    height: float
    _outlook: MotionOutlook
    _time: float
    _heading_var: float
    _config: PredictorConfig

    @cached_property
    def _motion(self) -> MotionForecast:
        """The ship at FORECAST_TIMES and, last, at ``valid_at``."""
        horizon = seconds(self.valid_at - self.issued_at)
        return self._outlook.forecast(self._time, np.append(FORECAST_TIMES, horizon))

    @cached_property
    def _arm(self) -> Array:
        """The lever arm turned with ``_motion``."""
        return self._turned_arm(self._motion)

    def _turned_arm(self, motion: MotionForecast) -> Array:
        roll, pitch, _ = motion.mean.T
        return turned_arm(roll, pitch, self._config.lever_arm)

    def forecast(self, horizons: Array = FORECAST_TIMES) -> TouchdownForecast:
        """Predict the touchdown point ``horizons`` seconds (shape (n,)) after ``issued_at``."""
        if horizons is FORECAST_TIMES:
            motion, arm = self._motion.part(slice(-1)), self._arm[:, :-1]
        else:
            motion = self._outlook.forecast(self._time, horizons)
            arm = self._turned_arm(motion)
        vec, by_roll, by_pitch = arm
        roll_rate, pitch_rate, heave_rate = motion.rate.T[..., None]
        position, velocity = vec.copy(), by_roll * roll_rate + by_pitch * pitch_rate
        position[:, 2:] += motion.mean[:, 2:]
        velocity[:, 2:] += heave_rate
        gradient = np.ones((len(horizons), 3))
        gradient[:, 0], gradient[:, 1] = by_roll[:, 2], by_pitch[:, 2]
        return TouchdownForecast(
            self.issued_at, horizons,
            position[:, 2] - self._config.lever_arm[2], _sd_along(gradient, motion.cov),
            velocity[:, 2], _sd_along(gradient, motion.rate_cov), position, velocity, motion)

    def pose(self) -> TouchdownPose:
        """Predict pose and twist at ``valid_at`` with their covariances."""
        motion = self._motion.part(slice(-1, None))
        roll, pitch, heave = motion.mean[0].tolist()
        horizontal_var = self._config.horizontal_sd**2
        # surge, sway and yaw are not predicted: they are worth their own spread, and as much
        # again times (2 pi / 10 s) as rates
        unmeasured = np.array([self._heading_var, horizontal_var, horizontal_var])
        cov = _block(motion.cov[0], unmeasured)
        rate_cov = _block(motion.rate_cov[0], unmeasured * (2 * pi / 10)**2)
        vec, by_roll, by_pitch = self._arm[:, -1]
        jacobian = np.zeros((6, 6))  # of place and turn, by roll, pitch, heave, yaw, surge, sway
        jacobian[:3, 0], jacobian[:3, 1] = by_roll, by_pitch
        jacobian[:3, 3] = -vec[1], vec[0], 0.0
        jacobian[2, 2] = jacobian[0, 4] = jacobian[1, 5] = 1.0
        jacobian[3:, [0, 1, 3]] = rate_axes(pitch)
        mat_deck = matrix_from_rpy(roll, pitch, 0.0).T
        to_deck = (mat_deck @ jacobian.reshape(2, 3, 6)).reshape(6, 6)
        return TouchdownPose(
            self.valid_at, vec + np.array([0.0, 0.0, heave]),
            quaternion_from_rpy(roll, pitch, 0.0), jacobian @ cov @ jacobian.T,
            to_deck[:, :3] @ motion.rate[0], to_deck @ rate_cov @ to_deck.T)


def _sd_along(gradient: Array, cov: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum('ni,nij,nj->n', gradient, cov, gradient)))


def _block(cov: Array, variances: Array) -> Array:
    mat = np.zeros((6, 6))
    mat[:3, :3] = cov
    mat[range(3, 6), range(3, 6)] = variances
    return mat


class HeadingSpread:
    """
    How far the heading swings about its mean of the last minutes.

    Parameters
    ----------
    time_constant : float
        Of mean and variance (s).
    start_sd : float
        Believed before anything is known (rad).

    """

    def __init__(self, time_constant: float = 120.0, start_sd: float = radians(2.0)) -> None:
        self.var = start_sd**2
        self._time_constant = time_constant
        self._mean: float | None = None
        self._time = 0.0

    def measure(self, time: float, yaw: float) -> None:
        """Use a heading (rad) at ``time`` (s)."""
        if self._mean is None:
            self._mean, self._time = yaw, time
        weight = 1 - exp(-(time - self._time) / self._time_constant)
        self._time = time
        swing = wrapped(yaw - self._mean)
        self._mean = wrapped(self._mean + weight * swing)
        self.var += weight * (swing * swing - self.var)


class TouchdownPredictor:
    """
    Measurements of the ship in, the touchdown point some seconds ahead out.

    Messages act at their stamps. Streams that share stamps are joined: the output for a stamp is
    made once both have it or a newer stamp arrives; otherwise nothing waits.

    Parameters
    ----------
    config : PredictorConfig
    profile : mapping of str to ndarray, optional
        What :meth:`profile` gave on an earlier run, for method ``adaptive``.

    Attributes
    ----------
    restarts : int
        How often the clock was found to have been set anew.
    newest : int or None
        Newest stamp (ns).
    measured : list of (int, float, float)
        Axis, value and variance of what the last sample measured.

    """

    PATIENCE = 10  # intervals without a shared stamp (1 s at least): then nobody waits for one

    def __init__(self, config: PredictorConfig,
                 profile: Mapping[str, Array] | None = None) -> None:
        self.config = config
        self._profile = profile
        self._attitude_var, self._heave_var = config.noise()
        roll, pitch, yaw = map(radians, config.sensor_rpy_deg)
        self._mount = (roll, pitch, yaw)
        self._horizon = nanoseconds(config.horizon)
        self.restarts = 0
        self._start()

    def _start(self) -> None:
        self._motion: MotionPredictor = (
            AdaptivePredictor(self._profile) if self.config.method == 'adaptive'
            else InterleavedPredictor() if self.config.method == 'interleaved'
            else ShapingPredictor(self.config.shaping_preset == 'tuned'))
        self._schedule = OutputSchedule(self.config.output_rate)
        self._streams: dict[type, _Stream] = {}
        self._heading = HeadingSpread()
        self._axis_newest = [-inf, -inf, -inf]
        self._origin = 0
        self.newest: int | None = None
        self._rewind = Rewind()
        self._waits = False  # the output for the newest stamp is due, but another stream may come
        self._shared: int | None = None  # newest stamp that two streams had in common

    def update(self, sample: Sample) -> list[TouchdownPrediction]:
        """
        Use one sample; return the predictions that it completes, oldest first.

        Raises
        ------
        Rejected
            If the sample's stamp or content cannot be used; nothing has changed then.

        """
        measured, yaw = self._measured(sample)
        stream = self._streams.get(type(sample))
        if stream is None:
            stream = self._streams[type(sample)] = _Stream()
        anew = stream.admit(sample.stamp, self.newest)
        if anew or self._rewind.is_over(sample.stamp, self.newest):
            self._start()
            self.restarts += 1
            self._streams[type(sample)] = stream
        for axis, _, _ in measured:  # ship/odometry and its rivals measure the same axes
            if self._axis_newest[axis] > sample.stamp:
                raise Rejected('older stamp')
        if self.newest is None:
            self.newest = self._origin = sample.stamp
        made = []
        if self._waits and sample.stamp > self.newest:
            made.append(self._predict())
        self.newest = max(self.newest, sample.stamp)
        self.measured = measured
        time = seconds(sample.stamp - self._origin)
        for axis, value, var in measured:
            self._motion.measure(axis, time, value, var)
            self._axis_newest[axis] = sample.stamp
        if yaw is not None:
            self._heading.measure(time, yaw)
            if isinstance(self._motion, AdaptivePredictor):
                self._motion.head(time, yaw)
        if sample.stamp == self.newest and self._is_ready(sample, stream):
            made.append(self._predict())
        return made

    def _measured(self, sample: Sample) -> tuple[list[tuple[int, float, float]], float | None]:
        """Turn a sample into (axis, value, variance) and yaw, or reject it."""
        measured, yaw = [], None
        if isinstance(sample, HeaveSample):
            measured.append((HEAVE, _plausible(sample.height), self._heave_var))
        else:
            if sample.orientation is None:
                raise Rejected('no attitude')
            if isinstance(sample, ImuSample):
                orientation = attitude_of_mounted(sample.orientation, self._mount)
                roll_var, pitch_var, _ = sample.attitude_var
            else:
                orientation = sample.orientation
                _, _, heave_var, roll_var, pitch_var, _ = sample.pose_var
                measured.append((HEAVE, _plausible(sample.position[2]),
                                 heave_var if heave_var > 0 else self._heave_var))
            roll, pitch, yaw = rpy_from_quaternion(orientation)
            measured += [(ROLL, roll, roll_var if roll_var > 0 else self._attitude_var),
                         (PITCH, pitch, pitch_var if pitch_var > 0 else self._attitude_var)]
        return measured, yaw

    def _is_ready(self, sample: Sample, stream: _Stream) -> bool:
        """Say whether the output for the newest stamp is due and need not wait."""
        other = self._streams.get(HeaveSample if isinstance(sample, ImuSample) else ImuSample)
        complete = isinstance(sample, OdometrySample)
        if not complete and other is not None and other.newest == sample.stamp:
            self._shared, complete = sample.stamp, True
        due = self._schedule.is_due(sample.stamp)
        self._waits = due and not complete and self._may_complete(sample.stamp, stream, other)
        return due and not self._waits

    def _may_complete(self, stamp: int, stream: _Stream, other: _Stream | None) -> bool:
        if self._shared is None or other is None:  # only the first stamp waits to find out
            return stamp == self._origin
        patience = max(NANOSECONDS, self.PATIENCE * max(stream.interval, other.interval))
        return stamp - self._shared <= patience and other.may_come(stamp)

    def profile(self) -> dict[str, Array]:
        """Return what was learned of the ship, to be saved; empty before anything was."""
        return self._motion.profile() if isinstance(self._motion, AdaptivePredictor) else {}

    def _predict(self) -> TouchdownPrediction:
        assert self.newest is not None
        self._schedule.take(self.newest)
        self._waits = False
        outlook = self._motion.outlook()
        time = seconds(self.newest - self._origin)
        height = height_above_rest(*outlook.mean(time + self.config.horizon),
                                   self.config.lever_arm)
        return TouchdownPrediction(self.newest, self.newest + self._horizon, height, outlook,
                                   time, self._heading.var, self.config)


def _plausible(heave: float) -> float:
    if not -MAX_HEAVE < heave < MAX_HEAVE:
        raise Rejected('implausible heave')
    return heave


class _Stream(StampGate):
    """One topic's stamps: its gate, and how far apart they are."""

    def __init__(self) -> None:
        super().__init__()
        self.interval = self._shortest = 0

    def admit(self, stamp: int, others: int | None = None) -> bool:
        before = self.newest
        restarted = super().admit(stamp, others)
        self.interval = 0 if restarted or before is None else stamp - before
        self._shortest = min(self._shortest or self.interval, self.interval)
        return restarted

    def may_come(self, stamp: int) -> bool:
        """Say whether this stream's next sample may have ``stamp`` (a slower one's may not)."""
        return self.newest is None or 2 * (stamp - self.newest) >= self._shortest

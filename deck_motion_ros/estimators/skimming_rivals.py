"""
The filters that LiSkimming compares, as labelled reproductions.

None of them knows that waves are slow or that the altimeter's bias cannot be seen. Each takes one
step of height, rate and acceleration for one aircraft or for many runs at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import exp
from typing import Protocol

import numpy as np

from deck_motion_ros.estimators.wave_filter import SensorErrors
from deck_motion_ros.samples import Array

UNKNOWN = np.zeros((2, 2))
UNKNOWN.flags.writeable = False


class HeightFilter(Protocol):
    """
    What every filter offers; heights and rates have the shape of the runs.

    Attributes
    ----------
    state : ndarray, shape (states, *runs)
        Estimate: height, rate and more.

    """

    state: Array

    @property
    def height(self) -> Array:
        """Height above mean sea level (m)."""

    @property
    def rate(self) -> Array:
        """Height rate (m/s)."""

    @property
    def cov(self) -> Array:
        """Covariance of both as the filter believes it, shape (2, 2); 0 = it has none."""

    def start(self, height: float, height_sd: float, rate: float, rate_sd: float) -> None:
        """Begin at a height (m) and rate (m/s), each known to a standard deviation."""

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """Go ahead by ``dt`` seconds; use height (m) and rate (m/s) measured then, if any."""


class Reproduction:
    """
    Motion driven by the measured acceleration: height, rate, and what the filter adds to them.

    Parameters
    ----------
    errors : SensorErrors
        Of the sensors.
    runs : tuple of int
        Shape of the measurements.

    """

    states = 2

    def __init__(self, errors: SensorErrors, runs: tuple[int, ...] = ()) -> None:
        self.errors = errors
        self.state = np.zeros((self.states, *runs))
        self.full_cov: Array = np.zeros((self.states, self.states))

    def start(self, height: float, height_sd: float, rate: float, rate_sd: float) -> None:
        """See :class:`HeightFilter`."""
        self.state[:] = 0.0
        self.state[0], self.state[1] = height, rate
        sds = (height_sd, rate_sd, self.errors.accel_bias)[:self.states]
        self.full_cov = np.diag(np.square(sds))

    @property
    def height(self) -> Array:
        """Height above mean sea level (m)."""
        return np.asarray(self.state[0])

    @property
    def rate(self) -> Array:
        """Height rate (m/s)."""
        return np.asarray(self.state[1])

    @property
    def cov(self) -> Array:
        """It has none."""
        return UNKNOWN


def model_error(dt: float, missed: float | Array, weight: float) -> float | Array:
    """
    Return the predictive filter's correction of the acceleration (LiSkimming eq 18).

    Of all d the one with the least d^2 weight dt^2 + (missed - d dt^2 / 2)^2.

    Parameters
    ----------
    dt : float
        Step (s).
    missed : float or ndarray
        Measured height minus the one predicted without d (m).
    weight : float
        W R / dt^2 of the paper (s^2): heights missed turn into acceleration at about
        1 / (2 weight).

    """
    reach = dt * dt / 2
    return missed * (reach / (reach * reach + weight * dt * dt))


class PredictiveFilter(Reproduction):
    """
    Crassidis and Markley's filter: the model's error from the height predicted without it.

    It trusts the model so much that it is close to dead reckoning.
    """

    WEIGHT = 530.0  # s^2

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """See :class:`HeightFilter`; the rate is not used."""
        missed: float | Array = 0.0
        if height is not None:
            h, v = self.state[0], self.state[1]
            missed = height - (h + v * dt + acceleration * (dt * dt / 2))
        total = acceleration + model_error(dt, missed, self.WEIGHT)
        self.state[0] += self.state[1] * dt + total * (dt * dt / 2)
        self.state[1] += total * dt


class ExtendedStateObserver(Reproduction):
    """Height, rate and an unknown acceleration; three poles at -200 1/s, exactly discretised."""

    POLE = 200.0
    states = 3

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """See :class:`HeightFilter`; the rate is not used."""
        h, v, extra = self.state
        total = acceleration + extra
        h = h + v * dt + total * (dt * dt / 2)
        v = v + total * dt
        if height is not None:
            b = exp(-self.POLE * dt)
            missed = height - h
            h = h + (1 - b**3) * missed
            v = v + 1.5 * (1 - b)**2 * (1 + b) / dt * missed
            extra = extra + (1 - b)**3 / dt**2 * missed
        self.state = np.stack([h, v, extra])


class BiasFilter(Reproduction):
    """
    The paper's "EKF": height, rate and accelerometer bias; altimeter noise and bias as if white.

    Its offset is that bias, and waves pass as far as they are not white.
    """

    states = 3

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """See :class:`HeightFilter`."""
        errors = self.errors
        mat_a, push, density = _step(dt, errors)
        self.state = mat_a @ self.state + np.multiply.outer(push, acceleration)
        self.full_cov = mat_a @ self.full_cov @ mat_a.T + density * np.outer(push, push) / dt
        for k, value, var in ((0, height, errors.range_white**2 + errors.range_bias**2),
                              (1, rate, errors.rate_white**2 + errors.rate_bias**2)):
            if value is not None:
                gain = self.full_cov[k] / (self.full_cov[k, k] + var)
                self.state = self.state + np.multiply.outer(gain, value - self.state[k])
                self.full_cov = self.full_cov - np.outer(gain, self.full_cov[k])

    @property
    def cov(self) -> Array:
        """As the filter believes it: without the altimeter's bias."""
        return self.full_cov[:2, :2]


def _step(dt: float, errors: SensorErrors) -> tuple[Array, Array, float]:
    """Return Phi of height, rate, bias, how acceleration drives them, its noise density."""
    mat_a = np.array([[1.0, dt, -dt * dt / 2], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]])
    density = errors.accel_white**2 * dt + 2 * errors.accel_drift**2 / errors.drift_rate
    return mat_a, np.array([dt * dt / 2, dt, 0.0]), density


class CombinedFilter(Reproduction):
    """
    LiSkimming's own: differences of successive measurements, and the predictive filter.

    The difference of two heights knows nothing of the height: what ties the estimate to the
    altimeter is the predictive filter's correction alone. The gain of the differences is that of
    the printed eq 11-13, made without it; as the covariance of the height grows, the two together
    become unstable, after about 30 s.
    """

    states = 3
    WEIGHT = 3.0  # s^2
    RANGE_STEP, RATE_STEP = 5.0, 0.28  # m, m/s: sd of what two measurements' errors differ by

    def __init__(self, errors: SensorErrors, runs: tuple[int, ...] = ()) -> None:
        super().__init__(errors, runs)
        self._before: tuple[float | Array, float | Array] | None = None

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """See :class:`HeightFilter`; a step without both measurements is a prediction."""
        errors = self.errors
        mat_a, push, density = _step(dt, errors)
        ahead = mat_a @ self.state + np.multiply.outer(push, acceleration)
        noise = density * np.outer(push, push) / dt
        cov = mat_a @ self.full_cov @ mat_a.T + noise
        if height is None or rate is None:
            self._before = None
        else:
            ahead = ahead + np.multiply.outer(
                push, model_error(dt, height - ahead[0], self.WEIGHT))
            if self._before is not None:
                rows = (mat_a - np.eye(3))[:2]
                var = np.diag([self.RANGE_STEP**2, self.RATE_STEP**2])
                cross = mat_a @ self.full_cov @ rows.T + noise[:, :2]
                gain = cross @ np.linalg.inv(
                    rows @ self.full_cov @ rows.T + noise[:2, :2] + var)
                came = np.stack([height - self._before[0], rate - self._before[1]])
                ahead = ahead + np.tensordot(gain, came - (ahead - self.state)[:2], 1)
                cov = cov - gain @ cross.T
            self._before = height, rate
        self.state, self.full_cov = ahead, cov

    @property
    def cov(self) -> Array:
        """As the filter believes it: without the altimeter's bias."""
        return self.full_cov[:2, :2]


RIVALS: Mapping[str, Callable[[SensorErrors, tuple[int, ...]], HeightFilter]] = {
    'combined': CombinedFilter, 'predictive': PredictiveFilter, 'eso': ExtendedStateObserver,
    'ekf': BiasFilter}

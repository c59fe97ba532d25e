"""The Kalman filter of height, rate, every sensor's bias and the waves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from deck_motion_ros.estimators.encounter import WaveModel
from deck_motion_ros.processes import van_loan
from deck_motion_ros.samples import Array

HEIGHT, RATE, ACCEL_BIAS, ACCEL_DRIFT, RANGE_BIAS, RATE_BIAS, WAVES = range(7)
STATES = WAVES + 4
LONGEST = 0.1  # s: longest step in one piece


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """
    What is wrong with altimeter and accelerometer: standard deviations.

    Attributes
    ----------
    range_bias, range_white : float
        Constant error and noise of the height (m).
    rate_bias, rate_white : float
        Of the height rate (m/s).
    accel_bias, accel_drift, accel_white : float
        Constant error, Markov error, noise of a sample (m/s^2).
    drift_rate : float
        1 / correlation time of the Markov error (1/s); the paper's alpha.

    """

    range_bias: float = 1.0
    range_white: float = 0.5
    rate_bias: float = 0.2
    rate_white: float = 0.2
    accel_bias: float = 0.05
    accel_drift: float = 0.05
    accel_white: float = 0.05
    drift_rate: float = 5.0


class WaveFilter:
    """
    Ten states: height, rate, accelerometer's bias and drift, altimeter's biases, four of waves.

    The vertical acceleration is the input. Range = height + bias + waves + noise, rate = rate +
    bias + noise. The covariance does not depend on the data, so any number of runs share it.

    Parameters
    ----------
    errors : SensorErrors
        Of the sensors.
    waves : WaveModel
        The sea.
    runs : tuple of int
        Shape of the measurements: () for one aircraft, (n,) for many.

    Attributes
    ----------
    state : ndarray, shape (10, *runs)
        Estimate.
    full_cov : ndarray, shape (10, 10)
        Covariance of its error.

    """

    def __init__(self, errors: SensorErrors, waves: WaveModel, runs: tuple[int, ...] = ()) -> None:
        self.errors, self.waves = errors, waves
        self._steps: dict[WaveModel, dict[float, tuple[Array, Array, Array]]] = {}
        self._range_row, self._rate_row = np.zeros((2, STATES))
        self._range_row[[HEIGHT, RANGE_BIAS, WAVES + waves.order]] = 1.0
        self._rate_row[[RATE, RATE_BIAS]] = 1.0
        self._push = np.zeros(STATES)
        self._acceleration: float | Array = 0.0
        self._scratch = np.empty((STATES, STATES))
        self.state = np.zeros((STATES, *runs))
        self.full_cov = np.zeros((STATES, STATES))

    def start(self, height: float, height_sd: float, rate: float, rate_sd: float) -> None:
        """Begin at a height (m) and rate (m/s), each known to a standard deviation."""
        errors = self.errors
        self.state[:] = 0.0
        self.state[HEIGHT], self.state[RATE] = height, rate
        sds = (height_sd, rate_sd, errors.accel_bias, errors.accel_drift, errors.range_bias,
               errors.rate_bias)
        self.full_cov[:] = 0.0
        self.full_cov[range(WAVES), range(WAVES)] = np.square(sds)
        self.full_cov[WAVES:, WAVES:] = self.waves.stationary

    def _transition(self, dt: float) -> tuple[Array, Array, Array]:
        """Return Phi, its transpose and Q of a step, remembered for next time."""
        steps = self._steps.setdefault(self.waves, {})
        if dt not in steps:
            if len(steps) > 500:  # uneven input never asks twice
                steps.clear()
            mat_phi, mat_q = van_loan(*self.model(), dt)
            steps[dt] = mat_phi, np.ascontiguousarray(mat_phi.T), (mat_q + mat_q.T) / 2
        return steps[dt]

    def model(self) -> tuple[Array, Array]:
        """Return drift matrix and noise density, shape (10, 10), accelerometer noise aside."""
        errors = self.errors
        mat_a, mat_w = np.zeros((2, STATES, STATES))
        mat_a[HEIGHT, RATE] = 1.0
        mat_a[RATE, [ACCEL_BIAS, ACCEL_DRIFT]] = -1.0
        mat_a[ACCEL_DRIFT, ACCEL_DRIFT] = -errors.drift_rate
        mat_w[ACCEL_DRIFT, ACCEL_DRIFT] = 2 * errors.drift_rate * errors.accel_drift**2
        mat_a[WAVES:, WAVES:] = self.waves.mat_a
        mat_w[-1, -1] = self.waves.intensity
        return mat_a, mat_w

    def rows(self) -> Array:
        """Return the rows by which range and rate see the states, shape (2, 10)."""
        return np.array([self._range_row, self._rate_row])

    def predict(self, dt: float, acceleration: float | Array, density: float) -> None:
        """
        Go ahead by a step.

        Parameters
        ----------
        dt : float
            Seconds, of few different values: transitions are remembered.
        acceleration : float or ndarray, shape runs
            Measured, vertical, without gravity: mean over the step (m/s^2).
        density : float
            Spectral density of its white error, (m/s^2)^2 s: variance of a sample times its
            interval.

        """
        self._acceleration = acceleration
        while dt > LONGEST:
            self._predict(LONGEST, density)
            dt = round(dt - LONGEST, 4)
        self._predict(dt, density)

    def _predict(self, dt: float, density: float) -> None:
        mat_phi, transposed, mat_q = self._transition(dt)
        state: Array = mat_phi @ self.state
        gained = self._acceleration * dt
        state[HEIGHT] += gained * (dt / 2)
        state[RATE] += gained
        self.state = state
        cov = self.full_cov
        np.dot(mat_phi, cov, out=self._scratch)
        np.dot(self._scratch, transposed, out=cov)
        cov += mat_q
        cov[RATE, RATE] += density * dt

    def use_range(self, value: float | Array, var: float, age: float = 0.0,
                  gate: float = np.inf) -> float | Array:
        """
        Use a measured height above the water.

        Parameters
        ----------
        value : float or ndarray, shape runs
            Metres.
        var : float
            Variance of its noise (m^2).
        age : float
            How long ago it was measured (s); the noise of the steps since then is left out.
        gate : float
            It is not used if its standardised innovation is larger.

        Returns
        -------
        float or ndarray
            Standardised innovation: of variance 1 if the model holds.

        """
        return self._use(self._range_row, value, var, age, gate)

    def use_rate(self, value: float | Array, var: float, age: float = 0.0,
                 gate: float = np.inf) -> float | Array:
        """Use a measured height rate (m/s); see :meth:`use_range`."""
        return self._use(self._rate_row, value, var, age, gate)

    def _use(self, row: Array, value: float | Array, var: float, age: float,
             gate: float) -> float | Array:
        state, cov = self.state, self.full_cov
        innovation = value - row @ state
        if age > 0:
            row = np.array(np.linalg.solve(self._transition(age)[1], row), np.float64)
            past = state.copy()
            past[HEIGHT] -= self._acceleration * (age * age / 2)
            past[RATE] -= self._acceleration * age
            innovation = value - row @ past
        ahead = cov @ row
        sd = sqrt(ahead @ row + var)
        innovation = innovation / sd
        if gate == np.inf or abs(innovation) <= gate:
            ahead /= sd
            self.state = np.asarray(state + (
                ahead * innovation if state.ndim == 1 else np.outer(ahead, innovation)))
            np.subtract(cov, np.multiply(ahead[:, None], ahead, out=self._scratch), out=cov)
        return innovation

    def step(self, dt: float, acceleration: float | Array, height: float | Array | None,
             rate: float | Array | None) -> None:
        """Go ahead by ``dt`` seconds and use height and rate measured then, if any."""
        errors = self.errors
        self.predict(dt, acceleration, errors.accel_white**2 * dt)
        if height is not None:
            self.use_range(height, errors.range_white**2)
        if rate is not None:
            self.use_rate(rate, errors.rate_white**2)

    def widen(self, height_sd: float, rate_sd: float) -> None:
        """Doubt height (m) and rate (m/s) by as much more."""
        self.full_cov[HEIGHT, HEIGHT] += height_sd**2
        self.full_cov[RATE, RATE] += rate_sd**2

    def forget(self, states: Mapping[int, float]) -> None:
        """Set states to 0, each known to a standard deviation and independent of the others."""
        for k, sd in states.items():
            self.state[k] = self.full_cov[k] = self.full_cov[:, k] = 0.0
            self.full_cov[k, k] = sd * sd

    def symmetrise(self) -> None:
        """Take off what rounding adds to the covariance's antisymmetric part in hours."""
        self.full_cov[:] = (self.full_cov + self.full_cov.T) / 2

    def rest_on_range(self, total: float, var: float, bias_sd: float) -> None:
        """Know of the height only its sum with the range's bias (m), and that to a variance."""
        self.forget({HEIGHT: sqrt(var + bias_sd**2), RANGE_BIAS: bias_sd})
        self.state[HEIGHT] = total
        self.full_cov[HEIGHT, RANGE_BIAS] = self.full_cov[RANGE_BIAS, HEIGHT] = -bias_sd**2

    def expect(self, waves: WaveModel) -> None:
        """
        Go on with waves of another size, of a model of the same order.

        If they are higher, what was learnt while they were believed lower is worth less.
        """
        larger = waves.sea.var / self.waves.sea.var
        if larger > 1:
            scale = np.ones(STATES)
            scale[:WAVES] = sqrt(larger)
            self.full_cov *= np.outer(scale, scale)
        self.waves = waves

    @property
    def height(self) -> Array:
        """Height above mean sea level (m), shape runs."""
        return np.asarray(self.state[HEIGHT])

    @property
    def rate(self) -> Array:
        """Height rate (m/s), shape runs."""
        return np.asarray(self.state[RATE])

    @property
    def cov(self) -> Array:
        """Covariance of height and rate, shape (2, 2)."""
        return self.full_cov[:2, :2]

    @property
    def wave_power(self) -> float:
        """Expected square of the elevation now (m^2), of a single run."""
        k = WAVES + self.waves.order
        return float(self.state[k]**2 + self.full_cov[k, k])

"""Zhang2021: constant-acceleration filters on the interleaved halves of the samples."""

from __future__ import annotations

from collections import deque
from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from deck_motion_ros.estimators.shaping import AxisOutlook, FixedAxis, LI2014, Outlook
from deck_motion_ros.estimators.square_root import predicted, updated
from deck_motion_ros.processes import ShapingFilter
from deck_motion_ros.samples import Array

STEP = 1.0  # s from one sample of a half to its next: twice the paper's sampling period
FADING = 100.0  # the paper's s, for one STEP
# Q / R over one STEP, 1, 1/s^2, 1/s^4: the paper's Q = I and R = 0.01 in degrees. The gains depend
# on nothing else, so the filter is the same in radians and in metres.
NOISE_RATIO = 100.0
FADE: float = 0.5 ** (1 / 240)  # of what an axis's innovations teach, from one to the next
SURPRISE = 10.0  # sd: what a greater innovation counts as
ROW_H: Array = np.array([1.0, 0.0, 0.0])


def transition(dt: float) -> Array:
    """
    Return A of constant acceleration over ``dt`` seconds (Zhang2021 eq 22).

    The paper takes the sampling period, 0.5 s, although each filter steps 1 s.
    """
    return np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def jerk_covariance(dt: float) -> Array:
    """Return what white jerk of density 1 adds to angle, rate, acceleration in ``dt`` seconds."""
    return np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                     [dt**3 / 6, dt**2 / 2, dt]])


class AccelerationFilter:
    """
    The Kalman filter of one half: update before predict, fading memory, array square root.

    Its own P only makes the gains: with s above 1, and a Q that no ship has, it is not the
    covariance of the error. That is carried beside it, for the gains as they are: from the noise
    of the measurements, and from the motion's jerk, taken as white, for each unit of its density.

    Parameters
    ----------
    value : float or ndarray, shape (runs,)
        First measurement.
    var : float
        Variance of its error.
    rate_sd, acceleration_sd : float
        Of the motion, not known yet.
    jerk_psd : float
        Of that motion.
    fading : float
        s for a step of STEP seconds, at least 1.

    Attributes
    ----------
    vec_x : ndarray, shape (3,) or (3, runs)
        Value, rate, acceleration at the newest measurement.
    root : ndarray, shape (3, 3)
        Of the filter's own P.
    by_noise, by_jerk : ndarray, shape (3, 3)
        Covariance of the error of ``vec_x``: ``by_noise + jerk_psd * by_jerk``.

    """

    def __init__(self, value: Any, var: float, rate_sd: float, acceleration_sd: float,
                 jerk_psd: float = 1.0, fading: float = FADING) -> None:
        self._fading = fading
        self.vec_x: Any = np.multiply.outer(ROW_H, value)
        self.root: Any = np.diag([sqrt(var), rate_sd, acceleration_sd])
        self.by_noise = np.diag([var, 0.0, 0.0])
        self.by_jerk = np.diag([0.0, rate_sd**2, acceleration_sd**2]) / jerk_psd

    def step(self, dt: float, value: Any, var: float) -> tuple[Any, float, float]:
        """
        Use a measurement ``dt`` seconds after the last one.

        Returns
        -------
        innovation : float or ndarray, shape (runs,)
        noise_var, jerk_var : float
            What its variance should be: the first, and the second times the jerk's density.

        """
        mat_a, steps = transition(dt), dt / STEP
        root_q = sqrt(NOISE_RATIO * var * steps) * np.eye(3)
        vec_x, root = predicted(self.vec_x, self.root, mat_a, root_q, self._fading**steps)
        self.vec_x, self.root, gain, _ = updated(vec_x, root, ROW_H, value, sqrt(var))
        by_noise = mat_a @ self.by_noise @ mat_a.T
        by_jerk = mat_a @ self.by_jerk @ mat_a.T + jerk_covariance(dt)
        kept = np.eye(3) - np.outer(gain, ROW_H)
        self.by_noise = kept @ by_noise @ kept.T + var * np.outer(gain, gain)
        self.by_jerk = kept @ by_jerk @ kept.T
        return value - vec_x[0], float(by_noise[0, 0]) + var, float(by_jerk[0, 0])

    def ahead(self, horizon: float) -> Any:
        """Predict the value ``horizon`` seconds after the newest measurement."""
        return transition(horizon)[0] @ self.vec_x


class Parabola(NamedTuple):
    """
    What one axis can say of the future, frozen: a parabola, and how far it errs.

    Attributes
    ----------
    time : float
        Of the newest measurement used (s).
    vec_x : ndarray, shape (3,)
        Value, rate, acceleration then.
    cov : ndarray, shape (3, 3)
        Of their errors.
    jerk_psd : float
        Density of the jerk that takes the motion away from the parabola.

    """

    time: float
    vec_x: Array
    cov: Array
    jerk_psd: float

    def mean(self, time: float) -> float:
        """Predict the axis at ``time`` (s)."""
        value, rate, acceleration = self.vec_x.tolist()
        ahead = time - self.time
        return float(value + ahead * (rate + ahead / 2 * acceleration))

    def table(self, time: float, horizons: Array) -> Array:
        """Predict value, its variance, rate, its variance: shape (4, n), for n horizons (s)."""
        ahead = time - self.time + horizons
        rows = np.stack([np.ones_like(ahead), ahead, ahead**2 / 2], axis=-1)
        slopes = np.stack([np.zeros_like(ahead), np.ones_like(ahead), ahead], axis=-1)
        return np.stack([
            rows @ self.vec_x,
            np.einsum('ni,ij,nj->n', rows, self.cov, rows) + self.jerk_psd * ahead**5 / 20,
            slopes @ self.vec_x,
            np.einsum('ni,ij,nj->n', slopes, self.cov, slopes) + self.jerk_psd * ahead**3 / 3])


class InterleavedAxis:
    """
    One axis: two filters that take the samples in turn, each half a STEP after the other.

    Faster input is thinned to the paper's two samples a STEP; slower input is taken as it comes,
    and the filters then step further. After a long gap a half starts anew. The forecast is that
    of the half with the newest sample.

    Parameters
    ----------
    prior : ShapingFilter
        The motion believed before it is known: its size, and what its jerk is like.

    """

    LONGEST = 5.0  # s: beyond it a parabola knows nothing any more
    PRIOR = 4.0  # innovations that the prior's jerk weighs

    def __init__(self, prior: ShapingFilter) -> None:
        peak = sqrt(prior.stiffness)
        self._prior = prior
        self._rate_sd, self._acceleration_sd = prior.sd * peak, prior.sd * peak**2
        # white jerk that makes the third difference of the sine of that size and frequency
        self._prior_psd = self.jerk_psd = prior.sd**2 * peak**5
        self._sum, self._number = self.PRIOR * self.jerk_psd, self.PRIOR
        self._halves: deque[tuple[float, AccelerationFilter]] = deque(maxlen=2)
        self._due = -inf

    def measure(self, time: float, value: float, var: float) -> float | None:
        """
        Use a measurement at ``time`` (s), or pass it over if it comes too soon.

        Returns
        -------
        float or None
            The standardised innovation, if there was one.

        """
        if time < self._due - STEP / 8:
            return None
        self._due += STEP / 2
        if self._due <= time:
            self._due = time + STEP / 2
        since = time - self._halves[0][0] if len(self._halves) == 2 else inf
        error = None
        if since > self.LONGEST:
            half = AccelerationFilter(value, var, self._rate_sd, self._acceleration_sd,
                                      self._prior_psd)
        else:
            half = self._halves[0][1]
            error = self._learn(*half.step(since, value, var))
        self._halves.append((time, half))
        return error

    def _learn(self, innovation: float, noise_var: float, jerk_var: float) -> float:
        expected = noise_var + self.jerk_psd * jerk_var
        error = float(innovation) / sqrt(expected)
        square = min(error**2, SURPRISE**2) * expected
        self._sum = FADE * self._sum + (square - noise_var) / jerk_var
        self._number = FADE * self._number + 1
        self.jerk_psd = max(self._sum / self._number, 0.0)
        return error

    def outlook(self) -> Parabola | AxisOutlook:
        """Return what is known of the future now: before the first measurement, the prior."""
        if not self._halves:
            return FixedAxis(self._prior).outlook()
        time, half = self._halves[-1]
        return Parabola(time, half.vec_x, half.by_noise + self.jerk_psd * half.by_jerk,
                        self.jerk_psd)


class InterleavedPredictor:
    """Roll, pitch and heave, each by its own pair, joined by what their errors have in common."""

    PRIOR = 30.0  # innovation triples that "uncorrelated" weighs

    def __init__(self) -> None:
        self.axes = tuple(map(InterleavedAxis, LI2014))
        self._errors: dict[int, tuple[float, float]] = {}  # the newest time and innovation
        self._joint = np.zeros((3, 3))

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
        error = self.axes[axis].measure(time, value, var)
        if error is not None:
            self._errors[axis] = time, error
        if len(self._errors) == 3:
            times, errors = zip(*(self._errors[axis] for axis in range(3)), strict=True)
            self._errors.clear()
            if max(times) - min(times) < STEP / 4:
                vec = np.clip(errors, -SURPRISE, SURPRISE)
                self._joint = FADE * self._joint + np.outer(vec, vec)

    def outlook(self) -> Outlook:
        """Return what is known of the future now."""
        mat = self._joint + self.PRIOR * np.eye(3)
        sd = np.sqrt(np.diag(mat))
        return Outlook(tuple(axis.outlook() for axis in self.axes), mat / np.outer(sd, sd))

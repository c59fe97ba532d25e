"""Linear stochastic processes: the shaping filter, exactly discretised."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, exp, sin, sqrt

import numpy as np
from scipy.linalg import expm

from deck_motion_ros.samples import Array

Matrix2 = tuple[float, float, float, float]  # row by row
Symmetric2 = tuple[float, float, float]  # 11, 12, 22


@dataclass(frozen=True)
class ShapingFilter:
    """
    White noise through G(s) = g s / (s^2 + a s + d) (Li2014 eq 3-4).

    States: the output and (its rate - g w), w the noise: the true rate has infinite variance.

    Parameters
    ----------
    gain : float
        g, output unit.
    damping : float
        a, 1/s, above 0.
    stiffness : float
        d, 1/s^2, above 0; the spectrum peaks at sqrt(d) rad/s.
    intensity : float
        Power spectral density q of w (1/(rad/s) two-sided, E[w(t) w(s)] = q delta(t - s)).

    Raises
    ------
    ValueError
        If damping, stiffness or intensity is not positive: no stationary motion.

    """

    gain: float
    damping: float
    stiffness: float
    intensity: float = 1.0

    def __post_init__(self) -> None:
        if not (self.damping > 0 and self.stiffness > 0 and self.intensity > 0):
            raise ValueError('a shaping filter needs positive damping, stiffness and intensity')

    @classmethod
    def of_motion(cls, sd: float, peak: float, damping_ratio: float) -> ShapingFilter:
        """
        Make the filter of a motion of known size and spectral peak.

        Parameters
        ----------
        sd : float
            Stationary standard deviation, output unit.
        peak : float
            Spectral peak, rad/s.
        damping_ratio : float
            a / (2 peak): half the relative bandwidth.

        """
        damping = 2 * damping_ratio * peak
        return cls(sd * sqrt(2 * damping), damping, peak * peak)

    @cached_property
    def stationary(self) -> Symmetric2:
        """
        Stationary covariance 11, 12, 22.

        Solves A P + P A' + q b b' = 0 by hand: q g^2 / (2 a), -q g^2 / 2,
        q g^2 (d + a^2) / (2 a).
        """
        power = self.intensity * self.gain**2
        a, d = self.damping, self.stiffness
        return (power / (2 * a), -power / 2, power * (d + a * a) / (2 * a))

    @cached_property
    def sd(self) -> float:
        """Stationary standard deviation of the output."""
        return sqrt(self.stationary[0])

    def transition(self, dt: float) -> Matrix2:
        """
        Return Phi(dt) = expm(A dt), row by row (Li2014 eq 11 with theta^2 = d - a^2/4).

        The paper prints d - a^2/2 there, and I + A dt after eq 5, which is unstable for
        dt > a/d.

        >>> ShapingFilter(0.4, 0.1, 0.36).transition(0.0)
        (1.0, 0.0, -0.0, 1.0)
        """
        half = self.damping / 2
        square = self.stiffness - half * half
        if square > 0:
            theta, decay = sqrt(square), exp(-half * dt)
            c, s = decay * cos(theta * dt), decay * sin(theta * dt) / theta
        elif square < 0:
            theta = sqrt(-square)
            slow, fast = exp((theta - half) * dt), exp(-(theta + half) * dt)
            c, s = (slow + fast) / 2, (slow - fast) / (2 * theta)
        else:
            c = exp(-half * dt)
            s = c * dt
        return (c + half * s, s, -self.stiffness * s, c - half * s)

    def step_noise(self, transition: Matrix2) -> Symmetric2:
        """
        Return the covariance that the noise adds over a step, 11, 12, 22.

        Exact for any step: in the stationary state P = Phi P Phi' + Q, so Q = P - Phi P Phi'.
        """
        p11, p12, p22 = self.stationary
        q11, q12, q22 = propagated((p11, p12, p22), transition)
        return (p11 - q11, p12 - q12, p22 - q22)

    @cached_property
    def _steps(self) -> dict[float, tuple[Matrix2, Symmetric2]]:
        return {}

    def step(self, dt: float) -> tuple[Matrix2, Symmetric2]:
        """Return transition and noise of a step of ``dt`` seconds, remembered for next time."""
        steps = self._steps
        if dt not in steps:
            if len(steps) > 500:  # uneven input never asks twice
                steps.clear()
            transition = self.transition(dt)
            steps[dt] = transition, self.step_noise(transition)
        return steps[dt]

    def autocorrelation(self, lags: Array) -> Array:
        """Return the output's autocorrelation at ``lags`` (s, any shape), 1 at lag 0."""
        shape = np.shape(lags)
        flat = np.abs(np.ravel(lags))
        p11, p12, _ = self.stationary
        values = [(f11 * p11 + f12 * p12) / p11
                  for f11, f12, _, _ in (self.transition(float(lag)) for lag in flat)]
        return np.reshape(np.array(values), shape)

    def spectrum(self, omega: Array) -> Array:
        """Return the one-sided spectral density at ``omega`` (rad/s); it integrates to sd^2."""
        w2 = np.square(omega)
        power = self.intensity * self.gain**2 * w2
        return np.asarray(
            power / ((self.stiffness - w2)**2 + self.damping**2 * w2) / np.pi)

    @property
    def mat_a(self) -> Array:
        """The drift matrix A of dx = A x dt + b w dt, shape (2, 2)."""
        return np.array([[0.0, 1.0], [-self.stiffness, -self.damping]])

    @property
    def vec_b(self) -> Array:
        """The noise input b, shape (2,)."""
        return np.array([self.gain, -self.gain * self.damping])


def propagated(cov: Symmetric2, transition: Matrix2) -> Symmetric2:
    """Return Phi P Phi' as 11, 12, 22."""
    p11, p12, p22 = cov
    f11, f12, f21, f22 = transition
    a11, a12 = f11 * p11 + f12 * p12, f11 * p12 + f12 * p22
    a21, a22 = f21 * p11 + f22 * p12, f21 * p12 + f22 * p22
    return (a11 * f11 + a12 * f12, a11 * f21 + a12 * f22, a21 * f21 + a22 * f22)


def van_loan(mat_a: Array, mat_w: Array, dt: float) -> tuple[Array, Array]:
    """
    Discretise dx = A x dt + noise of spectral density W over ``dt`` seconds.

    Parameters
    ----------
    mat_a, mat_w : ndarray, shape (n, n)
        Drift and noise spectral density.
    dt : float
        Seconds.

    Returns
    -------
    mat_phi, mat_q : ndarray, shape (n, n)
        Transition and noise covariance (Van Loan 1978).

    """
    n = len(mat_a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -mat_a, mat_w, mat_a.T
    exponential = expm(block * dt)
    mat_phi = exponential[n:, n:].T
    return mat_phi, mat_phi @ exponential[:n, n:]


# Li2014: pitch as printed (its Q = 0.64 is the intensity), degrees. No coefficients for heave (m)
# and roll (deg) are published: these are ours.
LI2014_PITCH = ShapingFilter(0.4, 0.1, 0.36, 0.64)
LI2014_HEAVE = ShapingFilter(0.5196, 0.12, 0.36)
LI2014_ROLL = ShapingFilter(1.470, 0.06, 0.26)

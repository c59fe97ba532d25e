"""The smallest possible error of a height over waves: the optimal estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz

from deck_motion_ros.estimators.encounter import EncounterSea
from deck_motion_ros.estimators.wave_filter import SensorErrors
from deck_motion_ros.processes import van_loan
from deck_motion_ros.samples import Array

PAIR = 2  # samples that are taken together: the matrices are four times smaller so


@dataclass(frozen=True, eq=False)
class Bound:
    """
    The optimal estimator of the height: it knows the exact spectrum of the waves.

    Attributes
    ----------
    sd : ndarray, shape (n,)
        Of its error after every ``PAIR`` samples (m).

    """

    sd: Array
    _factor: Array
    _weights: Array

    @property
    def rmse(self) -> float:
        """Root mean square of the error over all times (m)."""
        return float(np.sqrt(np.mean(self.sd**2)))

    def estimate(self, ranges: Array, rates: Array | None) -> Array:
        """
        Estimate the error of dead reckoning on runs.

        Parameters
        ----------
        ranges, rates : ndarray, shape (PAIR n, runs)
            Measured, less those of dead reckoning (m, m/s).

        Returns
        -------
        ndarray, shape (n, runs)
            After every ``PAIR`` samples (m).

        """
        pairs = [item.reshape(-1, PAIR, item.shape[1]).mean(axis=1)
                 for item in (ranges, rates) if item is not None]
        values = np.stack(pairs, axis=1).reshape(-1, ranges.shape[1])
        whitened = solve_triangular(self._factor, values, lower=True)
        return np.asarray(self._weights.T @ whitened)


def bound(sea: EncounterSea, errors: SensorErrors, start_sd: tuple[float, float], seconds: float,
          rate: float, use_rate: bool = True) -> Bound:
    """
    Solve for the optimal estimator.

    What dead reckoning errs by is a Gauss-Markov process, waves are a Gaussian process of the
    exact autocovariance; all measurements up to each time are used together, by one Cholesky
    factor of their covariance. ``PAIR`` successive measurements are averaged (which raises the
    bound by less than 0.1 %).

    Parameters
    ----------
    sea : EncounterSea
        The true one.
    errors : SensorErrors
        The true ones.
    start_sd : tuple of 2 float
        How well height (m) and rate (m/s) are known at the start.
    seconds, rate : float
        Duration; measurements per second.
    use_rate : bool
        Whether the rate is measured.

    """
    n, dt = round(seconds * rate) // PAIR, PAIR / rate
    mat_a, mat_w = np.zeros((2, 4, 4))  # height, rate, accelerometer's bias and drift
    mat_a[0, 1] = 1.0
    mat_a[1, 2:] = -1.0
    mat_a[3, 3] = -errors.drift_rate
    mat_w[1, 1] = errors.accel_white**2 / rate
    mat_w[3, 3] = 2 * errors.drift_rate * errors.accel_drift**2
    mat_phi, mat_q = van_loan(mat_a, mat_w, dt)
    powers, cov = np.empty((2, n, 4, 4))
    powers[0], state = np.eye(4), np.diag(np.square(
        (*start_sd, errors.accel_bias, errors.accel_drift)))
    for k in range(n):
        powers[k] = mat_phi @ powers[k - 1] if k else powers[0]
        state = mat_phi @ state @ mat_phi.T + mat_q
        cov[k] = state

    def covariance(i: int, j: int) -> Array:
        """Return E[e_i(t_k) e_j(t_l)] for k >= l, else 0."""
        table = np.zeros((n, n))
        for k in range(n):
            table[k:, k] = powers[:n - k, i] @ cov[k, :, j]
        return table

    height = covariance(0, 0)
    height += np.tril(height, -1).T
    waves = toeplitz(sea.autocovariance(dt * np.arange(n, dtype=np.float64)))
    ranged = height + waves + errors.range_bias**2 + errors.range_white**2 / PAIR * np.eye(n)
    total, cross = ranged, height
    if use_rate:
        rated = covariance(1, 1)
        rated += np.tril(rated, -1).T
        rated += errors.rate_bias**2 + errors.rate_white**2 / PAIR * np.eye(n)
        both = covariance(0, 1) + np.triu(covariance(1, 0).T, 1)  # height by rate
        total, cross = np.empty((2 * n, 2 * n)), np.empty((2 * n, n))
        total[::2, ::2], total[1::2, 1::2], total[::2, 1::2], total[1::2, ::2] = (
            ranged, rated, both, both.T)
        cross[::2], cross[1::2] = height, both.T
    factor = cholesky(total, lower=True, overwrite_a=True)
    weights = solve_triangular(factor, cross, lower=True)
    known = np.arange(len(weights))[:, None] // (len(weights) // n) <= np.arange(n)
    weights *= known
    var = np.diag(height) - np.sum(weights**2, axis=0)
    return Bound(np.sqrt(var), factor, weights)

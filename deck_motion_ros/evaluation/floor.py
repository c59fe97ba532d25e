"""
The floor: the causal Wiener predictor, below which no linear predictor gets.

For stationary Gaussian motion it is the best of all predictors. Report every accuracy as a ratio
to it, and for a finite record as a ratio to its error **on that record**: short stretches wander
about the expectation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.signal import fftconvolve

from deck_motion_ros.estimators.var import ForgettingVar
from deck_motion_ros.samples import Array

Covariance = Callable[[Array], Array]  # lags (m,) -> E[x_i(t + lag) x_j(t)], (m, 3, 3)


@dataclass(frozen=True, slots=True)
class SensorModel:
    """
    Errors of measured roll, pitch (rad) and heave (m): white noise and Gauss-Markov drift.

    Attributes
    ----------
    white_sd, drift_sd, drift_time : sequence of 3 float
        sd of what is new at every sample, sd of the drift, its correlation time (s).

    """

    white_sd: Sequence[float]
    drift_sd: Sequence[float] = (0.0, 0.0, 0.0)
    drift_time: Sequence[float] = (1.0, 1.0, 1.0)

    def covariance(self, steps: int, dt: float) -> Array:
        """Return the autocovariance of each axis's error at lags 0 ... steps - 1, (steps, 3)."""
        lags = dt * np.arange(steps)[:, None]
        drift = np.square(self.drift_sd) * np.exp(-lags / np.asarray(self.drift_time))
        return np.asarray(drift + np.square(self.white_sd) * (lags == 0))


@dataclass(frozen=True, eq=False)
class WienerPredictor:
    """
    The best linear predictor of lever' x(t + horizon) from the samples of the last seconds.

    Attributes
    ----------
    horizon, dt : float
        Seconds ahead, seconds between samples.
    axes : tuple of int
        Whose history is used.
    weights : ndarray, shape (taps, axes)
        Of the samples, the newest first.
    sd, error_sd : float
        Of what is predicted, and of the error.

    """

    horizon: float
    dt: float
    axes: tuple[int, ...]
    weights: Array
    sd: float
    error_sd: float

    @property
    def ratio(self) -> float:
        """Smallest error as a share of the motion."""
        return self.error_sd / self.sd

    def predict(self, record: Array) -> Array:
        """
        Run along a record.

        Parameters
        ----------
        record : ndarray, shape (n, 3)
            Measured every ``dt`` seconds, about the mean.

        Returns
        -------
        ndarray, shape (n,)
            Row k: predicted for ``horizon`` after row k; NaN while the history is too short.

        """
        out = fftconvolve(record[:, self.axes], self.weights, axes=0)[:len(record)].sum(axis=1)
        out[:len(self.weights) - 1] = np.nan
        return np.asarray(out)


def wiener_predictors(covariance: Covariance, sensor: SensorModel, lever: Sequence[float],
                      horizons: Sequence[float], axes: Sequence[int] = (0, 1, 2),
                      dt: float = 0.1, memory: float = 100.0) -> list[WienerPredictor]:
    """
    Solve the block Toeplitz normal equations of exact autocovariances, once for all horizons.

    Parameters
    ----------
    covariance : callable
        Of the true motion: lags (s), shape (m,), to E[x_i(t + lag) x_j(t)], shape (m, 3, 3).
    sensor : SensorModel
        What is measured is the motion plus these errors.
    lever : sequence of 3 float
        What is predicted, as a combination of roll, pitch, heave: (y, -x, 1) for the height of a
        point at x forward, y left; (0, 0, 1) for heave.
    horizons : sequence of float
        Seconds ahead; any, not only multiples of ``dt``.
    axes : sequence of int
        Whose history is used.
    dt, memory : float
        Spacing and length of the history (s). 20 s of history cost about 8 %.

    Returns
    -------
    list of WienerPredictor
        One for each horizon.

    """
    taps, chosen, vec = round(memory / dt), list(axes), np.asarray(lever, float)
    lags = np.arange(taps, dtype=float) * dt
    motion = covariance(lags)[:, chosen][:, :, chosen]
    noise = sensor.covariance(taps, dt)[:, chosen]
    n = len(chosen)
    normal = np.empty((taps, n, taps, n))  # E[z_i(t - k dt) z_j(t - l dt)]
    for i in range(n):
        for j in range(n):
            extra = noise[:, i] * (i == j)
            normal[:, i, :, j] = toeplitz(motion[:, j, i] + extra, motion[:, i, j] + extra)
    factor = cho_factor(normal.reshape(n * taps, n * taps), lower=True, overwrite_a=True)
    total = float(vec @ covariance(np.zeros(1))[0] @ vec)
    made = []
    for horizon in horizons:
        cross = (vec @ covariance(horizon + lags))[:, chosen].ravel()
        weights = cho_solve(factor, cross)
        made.append(WienerPredictor(
            horizon, dt, tuple(chosen), weights.reshape(taps, n), total**0.5,
            max(total - float(cross @ weights), 0.0)**0.5))
    return made


def estimated_floor(record: Array, dt: float, lever: Sequence[float], horizons: Sequence[float],
                    order: int | None = None) -> Array:
    """
    **Estimate** the floor of a recording from a long VAR fitted to all of it.

    The motion's true spectra are not known, so this is no bound: it is what the model that knows
    the whole record promises for another record like it, measurement noise included.

    Parameters
    ----------
    record : ndarray, shape (n, m)
        Measured every ``dt`` seconds, without gaps.
    dt : float
        Seconds.
    lever : sequence of m float
        What is predicted, as a combination of the axes.
    horizons : sequence of float
        Seconds ahead, each rounded to a multiple of ``dt``.
    order : int, optional
        Of the VAR; by default 30 s, but at most a coefficient for every four samples.

    Returns
    -------
    ndarray, shape (horizons,)
        Rms error.

    Raises
    ------
    ValueError
        If the record is too short for the order.

    """
    n, m = record.shape
    order = order or max(min(round(30 / dt), n // (4 * m)), 2)
    if n < (m + 1) * order + 10:
        raise ValueError(f'{n} samples are too few for a VAR of order {order}')
    scale = np.std(record, axis=0) + 1e-12
    var = ForgettingVar(m, order, float('inf'))
    var.learn(record / scale)
    mean = np.mean(record / scale, axis=0)
    model = var.solve(mean, np.zeros(m))
    rows = np.stack([record[order - k - 1:n - k - 1] for k in range(order)], axis=1) / scale - mean
    missed = (record[order:] / scale - mean
              - rows.reshape(n - order, -1) @ model.coefficients.T)
    innovation = missed.T @ missed / (n - order - m * order)
    steps = [max(round(horizon / dt), 1) for horizon in horizons]
    response, _ = model.ahead(max(steps))
    vec = np.asarray(lever, float) * scale
    # error after k steps: innovations through I, F_1, ..., F_(k-1) of the newest sample
    through = np.concatenate([vec[None], vec @ response[:-1, :, :m]])
    power = np.cumsum(np.einsum('ki,ij,kj->k', through, innovation, through))
    return np.asarray(np.sqrt(power[np.array(steps) - 1]))

"""Vector autoregression learned on line: least squares that forgets, iterated ahead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from deck_motion_ros.samples import Array


@dataclass(frozen=True, slots=True, eq=False)
class VarModel:
    """
    y(t) - mean = sum over k of A_k (y(t - k) - mean) + innovation.

    Attributes
    ----------
    coefficients : ndarray, shape (m, order * m)
        A_1 ... A_order side by side.
    mean : ndarray, shape (m,)

    """

    coefficients: Array
    mean: Array

    def ahead(self, steps: int) -> tuple[Array, Array]:
        """
        Iterate: the prediction ``k`` steps ahead is F_k past + c_k.

        Returns
        -------
        F : ndarray, shape (steps, m, order * m)
            For the past y(t), y(t - 1), ... in one row, the newest first.
        c : ndarray, shape (steps, m)

        """
        mat, m = self.coefficients, len(self.mean)
        ahead = np.empty((steps, *mat.shape))
        ahead[0] = mat
        for k in range(1, steps):
            np.dot(ahead[k - 1, :, :m], mat, out=ahead[k])
            ahead[k, :, :-m] += ahead[k - 1, :, m:]
        gain = ahead.reshape(steps, m, -1, m).sum(axis=2)
        return ahead, self.mean - gain @ self.mean


class ForgettingVar:
    """
    Least squares of y(t) on y(t - 1) ... y(t - order), old samples forgotten exponentially.

    Kept are the second moments of (y(t), ..., y(t - order)), so that mean and penalties are chosen
    when solving. A tiny ridge that grows with the lag keeps the normal equations definite; a
    penalty on what the **other** axes contribute, worth ``cross`` samples, keeps a short record
    from inventing couplings.

    Parameters
    ----------
    axes, order : int
        Number of axes m and of lags.
    memory : float
        Samples after which a sample counts 1/e.
    cross : float
        Samples.

    """

    QUICK = 60.0  # samples remembered while forgetting quickly
    RIDGE, RIDGE_LAGS = 1e-3, 8.0  # of unit-variance data; grows by e every so many lags

    def __init__(self, axes: int, order: int, memory: float, cross: float = 0.0) -> None:
        self.axes, self.order, self.memory, self._cross = axes, order, memory, cross
        n = axes * (order + 1)
        self.moments: Array = np.zeros((n, n))
        self.sums: Array = np.zeros(n)
        self.weight = 0.0
        # second moments about the mean from an earlier run, their number of samples appended
        self.prior: Array = np.zeros((n + 1, n))
        self._hurry = 0
        growth = np.exp(np.minimum(np.arange(1, order + 1) / self.RIDGE_LAGS, 12.0))
        self._ridge = np.repeat(self.RIDGE * growth, axes)

    def learn(self, samples: Array, known: NDArray[np.bool_] | None = None) -> None:
        """
        Take samples.

        Parameters
        ----------
        samples : ndarray, shape (order + k, m)
            The oldest first: k new ones and those before.
        known : ndarray of bool, shape (k,), optional
            False where a new one was not measured; it serves as past only.

        """
        rows = sliding_window_view(samples, self.order + 1, axis=0)[:, :, ::-1]
        rows = rows.transpose(0, 2, 1).reshape(len(rows), -1)
        quick, self._hurry = self._hurry > 0, max(self._hurry - len(rows), 0)
        once = 1 - 1 / min(self.memory, self.QUICK if quick else np.inf)
        weights = once ** np.arange(len(rows) - 1, -1, -1.0)
        if known is not None:
            weights = weights * known
        fade = once ** len(rows)
        self.moments *= fade
        self.moments += (rows.T * weights) @ rows
        self.sums = fade * self.sums + weights @ rows
        self.weight = fade * self.weight + float(weights.sum())
        self.prior *= fade

    def forget(self, samples: int) -> None:
        """Forget quickly for so many samples: what was learned holds no more."""
        self._hurry = samples

    def fade(self, share: float) -> None:
        """Let all that was learned count so much less."""
        self.moments *= share
        self.sums *= share
        self.weight *= share
        self.prior *= share

    @property
    def is_ready(self) -> bool:
        """Say whether there are samples enough for a first model."""
        return self.weight + float(self.prior[-1, 0]) >= max(20.0, 1.2 * self.order)

    def learned(self, mean: Array) -> Array:
        """Return second moments about a mean, and in the last row their number of samples."""
        mu = np.tile(mean, self.order + 1)
        half = np.outer(self.sums - self.weight / 2 * mu, mu)
        learned = self.prior.copy()
        learned[:-1] += self.moments
        learned[:-1] -= half
        learned[:-1] -= half.T
        learned[-1] += self.weight
        return learned

    def solve(self, mean: Array, noise_sd: Array, expected: Array | None = None,
              order: int | None = None, unsure: float = 0.0) -> VarModel:
        """
        Fit the model about a mean.

        The mean decides: the best predictor's gain at frequency 0, where there is no motion, is
        arbitrary and large. Take it from a smooth window over whole waves, not from the sums.

        Parameters
        ----------
        mean, noise_sd : ndarray, shape (m,)
            Of the axes; an axis that moves less than its noise counts as still.
        expected : ndarray, optional
            What else is believed to be learned, as :meth:`learned` returns it.
        order : int, optional
            Lags of the model, at most ``self.order``; all of them by default.
        unsure : float
            Variance of the mean's error, as a share of the motion's. ``prior`` was learned about
            another mean: as far as it decides, the model leans less on this one.

        Raises
        ------
        numpy.linalg.LinAlgError
            If round-off has spoilt the equations: steps far beyond the motion were learned.

        """
        m, k = self.axes, order or self.order
        learned = self.learned(mean)
        if expected is not None:
            learned += expected
        n, weight, before = m * (k + 1), learned[-1, 0], float(self.prior[-1, 0])
        cov = learned[:n, :n]
        sd = np.sqrt(np.maximum(np.diag(cov)[:m] / weight, np.square(noise_sd) + 1e-30))
        if before * unsure:
            blocks = cov.reshape(k + 1, m, k + 1, m)
            np.einsum('iaja->ija', blocks)[:] += before * unsure * np.square(sd)
        normal, right = cov[m:, m:], cov[m:, :m]
        np.einsum('ii->i', normal)[:] += self._ridge[:m * k] * np.tile(np.square(sd), k)
        if self._cross:
            found = np.stack([_solved(self._penalised(normal, axis, weight), right[:, axis])
                              for axis in range(m)])
        else:
            found = _solved(normal, right).T
        return VarModel(found, mean)

    def _penalised(self, normal: Array, axis: int, weight: float) -> Array:
        """Penalise the variance that the other axes contribute to the forecast of one."""
        others = np.arange(len(normal)) % self.axes != axis
        return np.asarray(normal * (1 + self._cross / weight * np.outer(others, others)))


def _solved(normal: Array, right: Array) -> Array:
    """Solve positive definite equations by Cholesky."""
    _, found, info = dposv(normal.T, right, lower=1)  # .T: rows are columns to Fortran
    if info:
        raise np.linalg.LinAlgError('normal equations are not positive definite')
    return np.asarray(found)

"""Vector autoregression learned on line: least squares that forgets, iterated ahead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg.blas import dsyrk
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
        m, width = self.coefficients.shape
        ahead = np.empty((steps * m, width))
        ahead[:m] = self.coefficients
        done = m
        while done < steps * m:  # as many more from there, where the newest past is foretold
            more = ahead[:steps * m - done][:done]
            foretold = ahead[:done].reshape(-1, m, width)[::-1].reshape(done, width)[:width]
            there = ahead[done:done + len(more)]
            np.dot(more[:, :done], foretold, out=there)
            there[:, :-done] += more[:, done:]
            done += len(more)
        gain = ahead @ np.tile(self.mean, width // m)
        return ahead.reshape(steps, m, width), self.mean - gain.reshape(steps, m)


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
        self.moments: Array = np.zeros((n, n))  # on and above the diagonal
        self.sums: Array = np.zeros(n)
        self.weight = 0.0
        self.recalled = 0.0  # samples of an earlier run, in the moments about its mean
        self._hurry = 0
        growth = np.exp(np.minimum(np.arange(1, order + 1) / self.RIDGE_LAGS, 12.0))
        self._ridge = np.repeat(self.RIDGE * growth, axes)
        other = ~np.eye(axes, dtype=bool)[:, None]
        # by the axis foretold and row within a lag: the pairs of which none is that axis
        self._others = other.transpose(0, 2, 1) & np.tile(other, order)

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
        fade, scaled = once ** len(rows), rows * np.sqrt(weights)[:, None]
        # .T here and below: rows are columns to Fortran
        self.moments = dsyrk(1.0, scaled.T, fade, self.moments.T, lower=1, overwrite_c=1).T
        self.sums = fade * self.sums + weights @ rows
        self.weight = fade * self.weight + float(weights.sum())
        self.recalled *= fade

    def recall(self, learned: Array) -> None:
        """Start from what :meth:`learned` gave on an earlier run."""
        self.moments += learned[:-1]
        self.recalled += float(learned[-1, 0])

    def forget(self, samples: int) -> None:
        """Forget quickly for so many samples: what was learned holds no more."""
        self._hurry = samples

    def fade(self, share: float) -> None:
        """Let all that was learned count so much less."""
        self.moments *= share
        self.sums *= share
        self.weight *= share
        self.recalled *= share

    @property
    def is_ready(self) -> bool:
        """Say whether there are samples enough for a first model."""
        return self.weight + self.recalled >= max(20.0, 1.2 * self.order)

    def learned(self, mean: Array) -> Array:
        """
        Return second moments about a mean, and in the last row their number of samples.

        Those below the diagonal mean nothing.
        """
        mu = np.tile(mean, self.order + 1)
        half = self.sums - self.weight / 2 * mu
        learned = np.empty((len(mu) + 1, len(mu)))
        np.subtract(self.moments, np.column_stack([half, mu]) @ [mu, half], out=learned[:-1])
        learned[-1] = self.weight + self.recalled
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
            Variance of the mean's error, as a share of the motion's. What was recalled was
            learned about another mean: as far as it decides, the model leans less on this one.

        Raises
        ------
        numpy.linalg.LinAlgError
            If round-off has spoilt the equations: steps far beyond the motion were learned.

        """
        m, k = self.axes, order or self.order
        learned = self.learned(mean)
        if expected is not None:
            learned += expected
        n, weight = m * (k + 1), learned[-1, 0]
        cov = learned[:n, :n]
        sd = np.sqrt(np.maximum(np.diag(cov)[:m] / weight, np.square(noise_sd) + 1e-30))
        if self.recalled * unsure:
            blocks = cov.reshape(k + 1, m, k + 1, m)
            np.einsum('iaja->ija', blocks)[:] += self.recalled * unsure * np.square(sd)
        normal, right = cov[m:, m:], cov[:m, m:].T
        np.einsum('ii->i', normal)[:] += self._ridge[:m * k] * np.tile(np.square(sd), k)
        if not self._cross:
            return VarModel(_solved(normal, right).T, mean)
        # penalise the variance that the other axes contribute to the forecast of one
        others = self._others[..., :m * k]
        penalised = normal.reshape(k, m, -1) * (1 + self._cross / weight * others)[:, None]
        return VarModel(np.stack([_solved(each, row) for each, row in zip(
            penalised.reshape(m, m * k, -1), cov[:m, m:], strict=True)]), mean)


def _solved(normal: Array, right: Array) -> Array:
    """Solve positive definite equations by Cholesky, given what is above the diagonal."""
    _, found, info = dposv(normal.T, right, lower=1)
    if info:
        raise np.linalg.LinAlgError('normal equations are not positive definite')
    return np.asarray(found)

"""Rival forecasts combined by what became of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deck_motion_ros.samples import Array

Mask = NDArray[np.bool_]


class Combination:
    """
    Discounted minimum-variance weights of rivals that forecast the same axes.

    Kept is the covariance of the rivals' realised errors among each other, per horizon and axis.
    For the weights it is drawn towards the mean over the axes: pooled, they wander less. Pairs of
    rivals of whom one is silent keep what they had.

    Parameters
    ----------
    horizons, axes, rivals : int
        Numbers of each.
    half_life : float
        Scored steps after which an error counts half.

    """

    POOLED = 0.6  # of the way to the mean over the axes
    RIDGE = 0.1  # of the best rival's error variance: what the estimates wander by
    NEWCOMER = 1.5  # times the best rival's error variance

    def __init__(self, horizons: int, axes: int, rivals: int, half_life: float) -> None:
        self._sums = np.zeros((horizons, axes, rivals, rivals))
        self._number = np.zeros((horizons, rivals, rivals))
        self._fade = 0.5 ** (1 / half_life)

    def score(self, errors: Array, spoke: Mask) -> None:
        """
        Take what the forecasts missed by.

        Parameters
        ----------
        errors : ndarray, shape (horizons, rivals, axes)
            Forecast minus what came.
        spoke : ndarray of bool, shape (horizons, rivals)
            Who forecast.

        """
        pairs = spoke[:, :, None] & spoke[:, None, :]
        fade = np.where(pairs, self._fade, 1.0)
        vec = (errors * spoke[..., None]).transpose(0, 2, 1)
        self._sums *= fade[:, None]
        self._sums += vec[..., :, None] * vec[..., None, :]
        self._number *= fade
        self._number += pairs

    def fade(self, share: float, least: float) -> None:
        """Let all errors count so much less, but together no less than ``least`` new ones."""
        kept = np.clip(least / np.maximum(self._number, 1e-30), share, 1.0)
        self._sums *= kept[:, None]
        self._number *= kept

    def recall(self, covariance: Array, number: float) -> None:
        """Start with so many errors that had this covariance, shaped as :attr:`covariance`."""
        self._sums, self._number[:] = number * covariance, number

    def introduce(self, rival: int, speaking: Mask) -> None:
        """Believe a new rival to err like the best of those who speak, but more."""
        cov = self.covariance
        size = np.einsum('hajj->haj', cov)
        others = np.flatnonzero(speaking & (np.arange(len(speaking)) != rival))
        best = size[:, :, others].min(axis=-1, keepdims=True)
        like = int(others[np.argmin((size[:, :, others] / (best + 1e-30)).mean(axis=(0, 1)))])
        for table in (self._sums, self._number):
            table[..., rival, :] = table[..., like, :]
            table[..., :, rival] = table[..., :, like]
        self._sums[..., rival, rival] *= self.NEWCOMER

    @property
    def scored(self) -> Array:
        """Number of errors behind the best known rival's variance, shape (horizons,)."""
        return np.asarray(np.einsum('hii->hi', self._number).max(axis=1))

    @property
    def covariance(self) -> Array:
        """Error covariance among the rivals, shape (horizons, axes, rivals, rivals)."""
        return np.asarray(self._sums / np.maximum(self._number, 1.0)[:, None])

    def losses(self, floor: Array) -> Array:
        """Return everybody's error variance over the best one's, on average; floor as below."""
        size = np.einsum('hajj->haj', self.covariance) + floor[:, None]
        return np.asarray((size / size.min(axis=-1, keepdims=True)).mean(axis=(0, 1)))

    def weights(self, speaking: Mask, floor: Array) -> Array:
        """
        Return the weights of those who speak: not negative, sum 1.

        Parameters
        ----------
        speaking : ndarray of bool, shape (rivals,)
            At least one.
        floor : ndarray, shape (axes,)
            Error variance below which no difference matters.

        Returns
        -------
        ndarray, shape (horizons, axes, rivals)

        """
        chosen = np.flatnonzero(speaking)
        cov = self.covariance[..., chosen[:, None], chosen]
        best = np.einsum('hajj->haj', cov).min(axis=-1) + floor
        cov = cov / best[..., None, None]
        cov += self.POOLED * (cov.mean(axis=1, keepdims=True) - cov)
        weights = np.zeros((*cov.shape[:2], len(speaking)))
        weights[..., chosen] = _minimum_variance(cov + self.RIDGE * np.eye(len(chosen)))
        return weights


def _minimum_variance(cov: Array) -> Array:
    """Minimise w' cov w over w >= 0 with sum 1, dropping whom the optimum would sell short."""
    alone = np.eye(cov.shape[-1])
    best = alone[np.einsum('...jj->...j', cov).argmin(axis=-1)] > 0
    kept = np.ones(cov.shape[:-1], bool)
    while True:
        both = kept[..., None] & kept[..., None, :]
        share = np.linalg.solve(np.where(both, cov, alone), kept[..., None].astype(float))[..., 0]
        if (share[kept] > 0).all():
            return np.asarray(share / share.sum(axis=-1, keepdims=True))
        kept &= share > 0
        kept |= best & ~kept.any(axis=-1, keepdims=True)  # pairs of unlike pasts may contradict

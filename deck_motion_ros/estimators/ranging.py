"""Filters of ranges: the joint filter of the product, and Pan2020's four averaged filters."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from math import exp, inf
from typing import NamedTuple

import numpy as np

from deck_motion_ros.estimators.multilateration import (
    Fix,
    HUBER,
    NO_ERRORS,
    RangeErrors,
    REJECT,
    weighted_least_squares,
)
from deck_motion_ros.samples import Array, Vector3

DOUBT_SD = 1.0  # m: of a bias that has just come up
DOUBT_RATE = 0.3  # m in a second^0.5: how it goes on, as the line of sight to the anchor turns


class Innovation(NamedTuple):
    """
    What m measurements said that was new.

    Attributes
    ----------
    weights : ndarray, shape (m,)
        Of each: 1 = full, 0 = rejected.
    standard : ndarray, shape (m,)
        How far each is off what the others and the prediction say, in standard deviations: the
        best test for an error of one of them (Baarda).
    residual : ndarray, shape (k,)
        Measured minus expected, of those that were not rejected.
    information : ndarray, shape (k, k)
        Inverse covariance of that.

    """

    weights: Array
    standard: Array
    residual: Array
    information: Array


class JointFilter:
    """
    Position, velocity and error of acceleration from ranges, robust against long ones.

    Between ranges it is linear: constant velocity, disturbed by white acceleration and by a
    Gauss-Markov one; if asked for, the ranges have slowly varying errors. Those of an anchor in
    doubt have a bias of their own, a random walk.

    Parameters
    ----------
    fix : Fix
        To start from.
    acceleration_sd, acceleration_time : float
        Of the Gauss-Markov acceleration (m/s^2, s).
    errors : RangeErrors
        Those of the fix.
    error_time : float
        Their correlation time (s).

    Attributes
    ----------
    state : ndarray, shape (9 + n,)
        Position (m), velocity (m/s), acceleration (m/s^2), errors of the ranges, biases in doubt.
    cov : ndarray, shape (9 + n, 9 + n)
    doubted : tuple of int
        The anchors in doubt.

    """

    def __init__(self, fix: Fix, acceleration_sd: float, acceleration_time: float,
                 errors: RangeErrors = NO_ERRORS, error_time: float = inf) -> None:
        count = len(fix.errors)
        kept = [*range(6), *range(9, 9 + count)]
        self.state = np.zeros(9 + count)
        self.state[kept] = np.concatenate([fix.position, fix.velocity, fix.errors])
        self.cov = np.zeros((9 + count, 9 + count))
        self.cov[np.ix_(kept, kept)] = fix.cov
        self.cov[6:9, 6:9] = acceleration_sd**2 * np.eye(3)
        self._var, self._time = acceleration_sd**2, acceleration_time
        self._errors, self._error_time = errors, error_time
        self._sure = 9 + count
        self.doubted: tuple[int, ...] = ()
        self._steps: dict[tuple[float, int], tuple[Array, Array, Array]] = {}

    def doubting(self, anchor: int) -> JointFilter:
        """Return a copy in which an anchor's ranges have a bias of unknown size from now on."""
        other = self._without(anchor, self.state, self.cov)
        other.doubted = (*other.doubted, anchor)
        size = len(other.state)
        cov = np.zeros((size + 1, size + 1))
        cov[:size, :size], cov[size, size] = other.cov, DOUBT_SD**2
        other.state, other.cov = np.append(other.state, 0.0), cov
        return other

    def trusting(self, anchor: int) -> JointFilter:
        """Return a copy in which the bias of an anchor in doubt turned out to be 0."""
        row = self._sure + self.doubted.index(anchor)
        gain = self.cov[row] / self.cov[row, row]
        return self._without(anchor, self.state - gain * self.state[row],
                             self.cov - np.outer(gain, self.cov[row]))

    def _without(self, anchor: int, state: Array, cov: Array) -> JointFilter:
        """Return a copy with this state, but for the anchor's doubt."""
        other = copy(self)
        other.doubted = tuple(item for item in self.doubted if item != anchor)
        kept = [*range(self._sure), *(
            self._sure + k for k, item in enumerate(self.doubted) if item != anchor)]
        other.state, other.cov = state[kept], cov[np.ix_(kept, kept)]
        return other

    def biases(self) -> dict[int, tuple[float, float]]:
        """Return mean and sd of the bias of each anchor in doubt (m)."""
        sds = np.sqrt(self.cov.diagonal()[self._sure:])
        return dict(zip(self.doubted, zip(
            self.state[self._sure:].tolist(), sds.tolist(), strict=True), strict=True))

    def advance(self, dt: float, psd: Array) -> None:
        """
        Go on.

        Parameters
        ----------
        dt : float
            By so much (s).
        psd : ndarray, shape (3,)
            Density of the white acceleration along each axis ((m/s^2)^2 s).

        """
        key = dt, len(self.state)
        if key not in self._steps:
            if len(self._steps) > 500:  # uneven input never asks twice
                self._steps.clear()
            self._steps[key] = self._step(dt)
        mat_phi, white, slow = self._steps[key]
        self.state = mat_phi @ self.state
        self.cov = mat_phi @ self.cov @ mat_phi.T + slow
        self.cov[:6, :6] += white * np.concatenate([psd, psd])

    def _step(self, dt: float) -> tuple[Array, Array, Array]:
        """Return transition, noise per density and the other noise; exact for dt << time."""
        n, sure, eye = len(self.state), self._sure, np.eye(3)
        keep, hold = exp(-dt / self._time), exp(-dt / self._error_time)
        mat_phi = np.diag([hold] * sure + [1.0] * (n - sure))
        mat_phi[:9, :9] = np.kron(
            [[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, keep]], eye)
        white = np.asarray(np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], eye), dtype=float)
        slow = np.diag([DOUBT_RATE**2 * dt] * n)
        slow[9:sure, 9:sure] = np.diag((1 - hold * hold) * np.square(self._errors.sds))
        slow[:9, :9] = self._var * (1 - keep * keep) * np.kron(
            [[dt**4 / 20, dt**3 / 8, dt**2 / 6], [dt**3 / 8, dt**2 / 3, dt / 2],
             [dt**2 / 6, dt / 2, 1.0]], eye)
        return mat_phi, white, slow

    def errors(self) -> tuple[Array, Array]:
        """Return mean and sd of the errors of the ranges, without the doubts."""
        return self.state[9:self._sure], np.sqrt(np.diag(self.cov)[9:self._sure])

    def expected(self, points: Sequence[Vector3], lag: float,
                 owners: Sequence[int]) -> tuple[Array, Array]:
        """
        Predict ranges to ``points`` ``lag`` seconds ago.

        Returns
        -------
        ranges : ndarray, shape (m,)
        mat_h : ndarray, shape (m, 9 + n)
            Their derivatives by the state.

        """
        position = self.state[:3]
        if lag:
            position = position - lag * self.state[3:6] + lag * lag / 2 * self.state[6:9]
        away = position - np.array(points)
        ranges = np.sqrt(np.einsum('ij,ij->i', away, away))
        mat_h = np.zeros((len(points), len(self.state)))
        mat_h[:, :3] = away / ranges[:, None]
        if lag:
            mat_h[:, 3:6] = -lag * mat_h[:, :3]
        if len(self.state) > 9:
            whose = np.array(owners)
            mat_h[:, 9:self._sure] = self._errors.derivatives(whose, ranges)
            mat_h[:, self._sure:] = whose[:, None] == self.doubted
            ranges = ranges + mat_h[:, 9:] @ self.state[9:]
        return ranges, mat_h

    def update(self, residual: Array, mat_h: Array, var: Array) -> Innovation:
        """
        Use measurements together, each as far as it agrees with the others and the prediction.

        Parameters
        ----------
        residual, var : ndarray, shape (m,)
            Measured minus expected; variances of the noise.
        mat_h : ndarray, shape (m, 9 + n)
            Derivatives of what is expected by the state.

        Returns
        -------
        Innovation

        """
        mat_hp = mat_h @ self.cov
        mat_s = mat_hp @ mat_h.T
        gain, information = _gain(mat_s, var, mat_hp)
        standard = information @ residual / np.sqrt(information.diagonal())
        weights = robust_weights(residual, mat_s, var)
        if weights.min() < 1:
            used = weights > 0
            residual, mat_hp, mat_s = residual[used], mat_hp[used], mat_s[np.ix_(used, used)]
            gain, information = _gain(mat_s, var[used] / weights[used], mat_hp)
        self.state = self.state + residual @ gain
        self.cov = self.cov - mat_hp.T @ gain
        self.cov = (self.cov + self.cov.T) / 2
        return Innovation(weights, standard, residual, information)


def _gain(mat_s: Array, noise: Array, mat_hp: Array) -> tuple[Array, Array]:
    """Return the transposed gain and the inverse covariance of the innovation, in one go."""
    eye = np.eye(len(noise))
    both = np.asarray(np.linalg.solve(mat_s + eye * noise, np.hstack([mat_hp, eye])), dtype=float)
    size = mat_hp.shape[1]
    return both[:, :size], both[:, size:]


def robust_weights(residual: Array, mat_s: Array, var: Array) -> Array:
    """
    Weigh measurements by what is left of their residuals after the update (Huber, rejection).

    Parameters
    ----------
    residual, var : ndarray, shape (m,)
        Measured minus expected; variances of the noise.
    mat_s : ndarray, shape (m, m)
        Covariance of what was expected.

    """
    ones = np.ones(len(residual))
    if np.all(residual**2 <= HUBER**2 * (np.diag(mat_s) + var)):
        return ones
    weights = ones
    sd = np.sqrt(var)
    for step in range(6):
        noise = var / weights
        left = np.abs(noise * np.linalg.solve(mat_s + np.diag(noise), residual)) / sd
        weights = np.minimum(1.0, HUBER / np.maximum(left, 1e-12))
        if step > 2:
            weights[left > REJECT] = 1e-6
    return np.where(weights > 1e-6, weights, 0.0)


class PaperFilter:
    """
    Pan2020's filter: linear least squares, then one filter per anchor, averaged.

    Each filter has position, velocity and acceleration (eq 11), and measures the range to its
    anchor and the position of least squares (eq 13-14; the norm that the print of eq 13 has lost
    is restored) as if the two were independent, which they are not: its covariance promises too
    much.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Anchors (m), four or more, not in one plane.
    sd : float
        Of the ranges (m).
    noise : tuple of 3 float
        Sd that each second adds to position, velocity and acceleration (eq 12; not published).

    Attributes
    ----------
    state : ndarray, shape (9,)
        The average.
    cov : ndarray, shape (9, 9)
        Of each filter, averaged.

    """

    def __init__(self, points: Array, sd: float, noise: tuple[float, float, float]) -> None:
        self._points, self._sd = points, sd
        self._noise = np.diag(np.repeat(np.square(noise), 3))
        self._states: Array | None = None
        self._covs = np.empty(0)

    def update(self, dt: float, ranges: Array) -> None:
        """Use the ranges of all anchors (m), ``dt`` seconds after those before."""
        fix, fix_cov = weighted_least_squares(self._points, ranges, self._sd)
        count = len(ranges)
        if self._states is None:
            self._states = np.tile(np.concatenate([fix, np.zeros(6)]), (count, 1))
            cov = np.diag(np.repeat([0.0, 3.0**2, 1.0], 3))
            cov[:3, :3] = fix_cov
            self._covs = np.tile(cov, (count, 1, 1))
        else:
            mat_phi = np.kron([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]], np.eye(3))
            self._states = self._states @ mat_phi.T
            self._covs = mat_phi @ self._covs @ mat_phi.T + dt * self._noise
            away = self._states[:, :3] - self._points
            expected = np.linalg.norm(away, axis=1)
            mat_h = np.zeros((count, 4, 9))
            mat_h[:, 0, :3] = away / expected[:, None]
            mat_h[:, 1:, :3] = np.eye(3)
            mat_r = np.zeros((4, 4))
            mat_r[0, 0], mat_r[1:, 1:] = self._sd**2, fix_cov
            residual = np.column_stack([ranges - expected, fix - self._states[:, :3]])
            mat_ph = self._covs @ mat_h.swapaxes(1, 2)
            gain = mat_ph @ np.linalg.inv(mat_h @ mat_ph + mat_r)
            self._states = self._states + np.einsum('nij,nj->ni', gain, residual)
            covs = self._covs - gain @ mat_ph.swapaxes(1, 2)
            self._covs = (covs + covs.swapaxes(1, 2)) / 2
        self.state, self.cov = self._states.mean(axis=0), self._covs.mean(axis=0)

"""Positions from ranges to known points: Gauss-Newton, dilution, and Pan2020's linear solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deck_motion_ros.samples import Array

HUBER = 2.0  # standard deviations: beyond, a range loses weight
REJECT = 3.5  # beyond, it has none


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """
    A position from ranges.

    Attributes
    ----------
    position, velocity : ndarray, shape (3,)
        At time 0 (m, m/s).
    errors : ndarray, shape (n,)
        What the ranges to each anchor are too long by (m), and by which share all are (last).
    cov : ndarray, shape (6 + n, 6 + n)
        Of position, velocity and errors.
    weights : ndarray, shape (m,)
        Of each range: 1 = full, 0 = rejected.
    cost : float
        Sum of the squared standardised residuals, each at most that of a rejected range.

    """

    position: Array
    velocity: Array
    errors: Array
    cov: Array
    weights: Array
    cost: float


@dataclass(frozen=True, slots=True)
class RangeErrors:
    """
    What may be wrong with ranges besides white noise; sd 0 = nothing.

    Attributes
    ----------
    anchors : int
        Number of anchors.
    bias_sd : float
        Of a bias of each (m).
    scale_sd : float
        Of the share by which all ranges are too long.

    """

    anchors: int
    bias_sd: float = 0.0
    scale_sd: float = 0.0

    @property
    def sds(self) -> list[float]:
        """Standard deviation of each error: of the anchors' biases, then of the scale."""
        return ([self.bias_sd] * self.anchors * (self.bias_sd > 0)
                + [self.scale_sd] * (self.scale_sd > 0))

    def derivatives(self, owners: NDArray[np.intp], distance: Array) -> Array:
        """
        Differentiate ranges by the errors.

        Parameters
        ----------
        owners : ndarray of int, shape (m,)
            The anchor of each range; -1 = a range without errors.
        distance : ndarray, shape (m,)
            True ranges (m).

        Returns
        -------
        ndarray, shape (m, n)

        """
        columns = []
        if self.bias_sd > 0:
            columns.append(owners[:, None] == np.arange(self.anchors))
        if self.scale_sd > 0:
            columns.append((distance * (owners >= 0))[:, None])
        return np.hstack(columns) if columns else np.empty((len(owners), 0))


NO_ERRORS = RangeErrors(0)


def gauss_newton(points: Array, ranges: Array, sd: Array, start: Array,
                 times: Array | None = None, velocity_sd: float = 1.0,
                 owners: NDArray[np.intp] | None = None, errors: RangeErrors = NO_ERRORS,
                 error_prior: tuple[Array, Array] | None = None,
                 robust: bool = False, iterations: int = 30) -> Fix | None:
    """
    Find position and constant velocity from ranges, by Gauss-Newton.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Where each range was measured from (m).
    ranges, sd : ndarray, shape (m,)
        Measured, and the sd of its noise (m).
    start : ndarray, shape (3,)
        First guess (m): of two mirrored solutions the one on its side is found.
    times : ndarray, shape (m,), optional
        Of the ranges, relative to the fix (s); all 0 without.
    velocity_sd : float
        Of the velocity before anything is known, about 0 (m/s).
    owners : ndarray of int, shape (m,), optional
        The anchor of each range; -1 = none.
    errors : RangeErrors
        What else to estimate; needs ``owners``.
    error_prior : tuple of 2 ndarray, shape (n,), optional
        Mean and sd of these errors before; without, 0 and their own.
    robust : bool
        Weigh ranges by their residuals (Huber's weights, then rejection).
    iterations : int
        At most.

    Returns
    -------
    Fix or None
        ``None`` where the ranges do not determine a position.

    """
    when = np.zeros(len(ranges)) if times is None else times
    whose = np.full(len(ranges), -1) if owners is None else owners
    error_mean, error_sd = error_prior or (np.zeros(len(errors.sds)), np.array(errors.sds))
    prior = np.concatenate([np.zeros(3), np.full(3, velocity_sd**-2.0), error_sd**-2.0])
    first = state = np.concatenate([start, np.zeros(3), error_mean])
    weights = np.ones(len(ranges))
    reach = max(float(np.median(ranges)), 1.0)
    for step in range(iterations):
        away = state[:3] + np.outer(when, state[3:6]) - points
        distance = np.sqrt(np.einsum('ij,ij->i', away, away))
        if not distance.all():
            return None
        unit = away / distance[:, None]
        mat_h = np.hstack([unit, when[:, None] * unit, errors.derivatives(whose, distance)])
        residual = (ranges - distance - mat_h[:, 6:] @ state[6:]) / sd
        if robust and step:
            weights = _weights(residual, reject=step > iterations // 3)
        weighted = (weights / sd)[:, None] * mat_h
        information = weighted.T @ (mat_h / sd[:, None]) + np.diag(prior)
        try:
            change = np.linalg.solve(
                information, weighted.T @ residual - prior * (state - first))
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(change[:3]))
        state = state + change * min(1.0, 0.5 * reach / max(size, 1e-12))
        if size < 1e-9 * reach and (not robust or step > iterations // 3 + 1):
            break
    else:
        if not robust or not size < 1e-3 * reach:
            return None
    eigenvalues = np.linalg.eigvalsh(information[:3, :3])
    if not eigenvalues[0] > 1e-12 * eigenvalues[-1]:
        return None
    cov = np.asarray(np.linalg.inv(information), dtype=float)
    cost = float(np.minimum(residual**2, REJECT**2).sum() + prior @ (state - first)**2)
    return Fix(state[:3], state[3:6], state[6:], cov, weights, cost)


def _weights(residual: Array, reject: bool) -> Array:
    """Weigh standardised residuals, by their own scale where it is above 1."""
    size = np.abs(residual)
    size = size / max(1.0, 1.4826 * float(np.median(size)))
    weights = np.minimum(1.0, HUBER / np.maximum(size, 1e-12))
    return np.where(size > REJECT, 0.0, weights) if reject else weights


def dilution(points: Array, position: Array) -> Array:
    """
    Return by what the noise of ranges is multiplied in x, y and z, shape (3,).

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Of the anchors (m).
    position : ndarray, shape (3,)
        Of the aircraft (m).

    Returns
    -------
    ndarray, shape (3,)
        Infinite where the ranges say nothing of the position.

    """
    away = position - points
    unit = away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
    information = unit.T @ unit
    if np.linalg.matrix_rank(information, tol=1e-9) < 3:
        return np.full(3, np.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))


def extents(points: Array) -> Array:
    """
    Return the rms extents (m) of a set of points along its three main axes, falling.

    The last is 0 where the points lie in a plane, the second too where they lie on a line.
    """
    centred = points - points.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(points))
    return np.asarray(np.pad(spread, (0, 3 - len(spread))))


def weighted_least_squares(points: Array, ranges: Array, sd: float) -> tuple[Array, Array]:
    """
    Solve Pan2020's linear equations (eq 2-4, 8-10).

    Squared ranges are differenced against the first one's, which throws away what all have in
    common: up to 58 times worse than :func:`gauss_newton` in height. The squares that the print
    of eq 8-9 has flattened are restored: Q_ij = 4 (d_1^2 s^2 + [i = j] d_i^2 s^2).

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Anchors (m), four or more, not in one plane.
    ranges : ndarray, shape (m,)
        Measured (m).
    sd : float
        Of their noise (m).

    Returns
    -------
    position : ndarray, shape (3,)
    cov : ndarray, shape (3, 3)

    """
    square = np.einsum('ij,ij->i', points, points)
    mat_m = 2 * (points[1:] - points[0])
    vec_n = ranges[0]**2 - ranges[1:]**2 + square[1:] - square[0]
    mat_q = 4 * sd**2 * (ranges[0]**2 + np.diag(ranges[1:]**2))
    weighted = np.linalg.solve(mat_q, mat_m)
    cov = np.linalg.inv(mat_m.T @ weighted)
    return cov @ (weighted.T @ vec_n), cov

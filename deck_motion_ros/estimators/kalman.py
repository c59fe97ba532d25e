"""Kalman filter steps as pure functions: one axis in scalars, many runs in arrays."""

from __future__ import annotations

from math import sqrt

import numpy as np

from deck_motion_ros.processes import Matrix2, ShapingFilter, Symmetric2
from deck_motion_ros.samples import Array

State = tuple[float, float, float, float, float]  # x1, x2, p11, p12, p22


def predicted(state: State, transition: Matrix2, noise: Symmetric2) -> State:
    """
    Carry a two-state estimate over one step: x = Phi x, P = Phi P Phi' + Q (Li2014 eq 6).

    Parameters
    ----------
    state : tuple of 5 float
        Estimate x1, x2 and its covariance p11, p12, p22.
    transition : tuple of 4 float
        Phi, row by row.
    noise : tuple of 3 float
        Q as 11, 12, 22.

    """
    x1, x2, p11, p12, p22 = state
    f11, f12, f21, f22 = transition
    a11, a12 = f11 * p11 + f12 * p12, f11 * p12 + f12 * p22
    a21, a22 = f21 * p11 + f22 * p12, f21 * p12 + f22 * p22
    return (f11 * x1 + f12 * x2, f21 * x1 + f22 * x2, a11 * f11 + a12 * f12 + noise[0],
            a11 * f21 + a12 * f22 + noise[1], a21 * f21 + a22 * f22 + noise[2])


def predicted_output(state: State, transition: Matrix2,
                     noise: Symmetric2) -> tuple[float, float]:
    """Do as :func:`predicted`, for x1 alone: its mean and variance."""
    x1, x2, p11, p12, p22 = state
    f11, f12, _, _ = transition
    a11, a12 = f11 * p11 + f12 * p12, f11 * p12 + f12 * p22
    return f11 * x1 + f12 * x2, a11 * f11 + a12 * f12 + noise[0]


def step(state: State, transition: Matrix2, noise: Symmetric2, value: float,
         var: float) -> tuple[State, float]:
    """
    Predict to the time of a measurement of x1 and use it (Li2014 eq 6-9).

    Eq 8 as printed propagates twice. A stationary state stays so under prediction, so a filter
    that starts stationary needs no special first step.

    Parameters
    ----------
    state, transition, noise
        As in :func:`predicted`.
    value, var : float
        Measured x1 and the variance of its error, above 0.

    Returns
    -------
    state : tuple of 5 float
        Updated.
    innovation : float
        Standardised: of variance 1 if the model holds.

    """
    x1, x2, p11, p12, p22 = state
    f11, f12, f21, f22 = transition
    q11, q12, q22 = noise
    a11 = f11 * p11 + f12 * p12
    a12 = f11 * p12 + f12 * p22
    a21 = f21 * p11 + f22 * p12
    a22 = f21 * p12 + f22 * p22
    p11 = a11 * f11 + a12 * f12 + q11
    p12 = a11 * f21 + a12 * f22 + q12
    s = p11 + var
    k1 = p11 / s
    k2 = p12 / s
    x = f11 * x1 + f12 * x2
    e = value - x
    return ((x + k1 * e, f21 * x1 + f22 * x2 + k2 * e, k1 * var, k2 * var,
             a21 * f21 + a22 * f22 + q22 - k2 * p12), e / sqrt(s))


def gain_sequence(process: ShapingFilter, dt: float, var: float, steps: int) -> Array:
    """
    Compute the gains of a filter that starts stationary and measures every ``dt`` seconds.

    They do not depend on the data, so any number of runs share them.

    Returns
    -------
    ndarray, shape (steps, 2)

    """
    transition = process.transition(dt)
    noise = process.step_noise(transition)
    state: State = (0.0, 0.0, *process.stationary)
    gains = np.empty((steps, 2))
    for k in range(steps):
        state, _ = step(state, transition, noise, 0.0, var)
        gains[k] = state[2] / var, state[3] / var  # K = P H' / R, P updated
    return gains


def filtered_runs(process: ShapingFilter, dt: float, gains: Array, values: Array,
                  horizon: float) -> Array:
    """
    Filter many runs at once and predict each ``horizon`` seconds ahead.

    Parameters
    ----------
    process : ShapingFilter
        The model of the axis.
    dt : float
        Seconds between measurements.
    gains : ndarray, shape (steps, 2)
        From :func:`gain_sequence`.
    values : ndarray, shape (steps, runs)
        Measurements.
    horizon : float
        Seconds.

    Returns
    -------
    ndarray, shape (steps, runs)
        Row k: x1 predicted for the time of row k plus the horizon.

    """
    mat_phi = np.reshape(process.transition(dt), (2, 2))
    ahead_row = np.array(process.transition(horizon)[:2])
    correct = np.zeros((len(gains), 2, 3))  # x = (I - K H) x + K z
    correct[:, :, :2] = np.eye(2)
    correct[:, :, 0] -= gains
    correct[:, :, 2] = gains
    mats = np.concatenate([mat_phi @ correct, ahead_row @ correct[:, None]], axis=1)
    now, then = np.zeros((2, 3, values.shape[1]))  # rows x1, x2 and measurement / prediction
    ahead = np.empty_like(values)
    for mat, row, out in zip(mats, values, ahead, strict=True):
        now[2] = row
        np.dot(mat, now, out=then)
        out[:] = then[2]
        now, then = then, now
    return ahead


def riccati_bound(process: ShapingFilter, dt: float, var: float, horizon: float) -> float:
    """
    Return the smallest possible rms error ``horizon`` seconds ahead, measuring for ever.

    The steady state of the Riccati recursion, carried ahead: no estimator does better on this
    process.
    """
    transition = process.transition(dt)
    noise = process.step_noise(transition)
    state: State = (0.0, 0.0, *process.stationary)
    change = np.inf
    while change > 1e-12 * (process.stationary[0] + process.stationary[2]):
        before = state
        state, _ = step(state, transition, noise, 0.0, var)
        change = abs(state[2] - before[2]) + abs(state[4] - before[4])
    ahead = process.transition(horizon)
    return sqrt(predicted_output(state, ahead, process.step_noise(ahead))[1])

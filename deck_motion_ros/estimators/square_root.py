"""The Kalman filter in array form: a root of the covariance is carried by QR, never P itself."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]  # float32 stays float32


class Updated(NamedTuple):
    """
    What a measurement makes of an estimate.

    Attributes
    ----------
    vec_x : ndarray, shape (n,) or (n, runs)
    root : ndarray, shape (n, n)
    gain : ndarray, shape (n,)
        K = P H' / (H P H' + R).
    innovation : ndarray, shape () or (runs,)
        Standardised: of variance 1 if the model holds.

    """

    vec_x: Floats
    root: Floats
    gain: Floats
    innovation: Floats


def triangular_root(array: Floats) -> Floats:
    """
    Return the lower triangular L with L L' = M M' and a diagonal that is not negative.

    M M' is not formed: L is the transposed R of the QR decomposition of M'. So the condition is
    that of M, half as many digits as that of M M', and L L' cannot be indefinite.

    Parameters
    ----------
    array : ndarray, shape (..., n, m)
        M, m at least n; factors side by side add what they stand for.

    >>> triangular_root(np.array([[3.0, 4.0]]))
    array([[5.]])

    """
    upper: Any = np.linalg.qr(np.swapaxes(array, -1, -2), mode='r')
    lower = np.swapaxes(upper, -1, -2)
    diagonal = np.diagonal(lower, axis1=-2, axis2=-1)
    return np.asarray(lower * np.copysign(lower.dtype.type(1), diagonal)[..., None, :])


def predicted(vec_x: Floats, root: Floats, mat_a: Floats, root_q: Floats,
              fading: float = 1.0) -> tuple[Floats, Floats]:
    """
    Carry an estimate over one step: x = A x, P = s A P A' + Q (Zhang2021 eq 12, 14).

    Parameters
    ----------
    vec_x : ndarray, shape (n,) or (n, runs)
        Estimate; runs that share their covariance side by side.
    root, mat_a, root_q : ndarray, shape (n, n)
        Root of P, transition, root of Q.
    fading : float
        s of fading memory (Sorenson and Sacks), at least 1; it multiplies A P A', not Q.

    """
    through = sqrt(fading) * (mat_a @ root)
    return mat_a @ vec_x, triangular_root(np.concatenate([through, root_q], axis=-1))


def updated(vec_x: Floats, root: Floats, row_h: Floats, value: Any, sd: float) -> Updated:
    """
    Use a measurement of H x (Zhang2021 eq 9-11 without 19 and 20, which form P).

    One QR turns the array [[sd, H S], [0, S]] into [[sd of the innovation, 0], [K times that, S]].

    Parameters
    ----------
    vec_x, root
        As in :func:`predicted`.
    row_h : ndarray, shape (n,)
        H.
    value : float or ndarray, shape (runs,)
        What was measured.
    sd : float
        Of its error, above 0.

    """
    n = len(root)
    array = np.zeros((n + 1, n + 1), root.dtype)
    array[0, 0], array[0, 1:], array[1:, 1:] = sd, row_h @ root, root
    array = triangular_root(array)
    innovation_sd = array[0, 0]
    gain = array[1:, 0] / innovation_sd
    missed = np.asarray(value - row_h @ vec_x)
    return Updated(vec_x + np.multiply.outer(gain, missed), array[1:, 1:], gain,
                   np.asarray(missed / innovation_sd))

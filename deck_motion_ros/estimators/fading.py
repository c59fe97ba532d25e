"""Fading of strong tracking filters: how much the innovations say that a covariance must grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deck_motion_ros.geometry import transformed
from deck_motion_ros.samples import Array


@dataclass(frozen=True)
class StrongTracking:
    """
    The fading of Bai2016.

    Attributes
    ----------
    weights : tuple of float
        alpha, by state; a state of weight 0 does not fade.
    memory : float
        rho, within 0 to 1.
    weakening : float
        beta: the larger, the less noise alone makes it fade. With 1 it fires on ordinary noise.

    """

    weights: tuple[float, ...]
    memory: float = 0.95
    weakening: float = 5.0


def remembered(mat_v: Array | None, innovation: Array, memory: float) -> Array:
    """
    Estimate the innovations' covariance (Bai2016 eq 16, 25).

    Parameters
    ----------
    mat_v : ndarray, shape (..., m, m), or None
        The estimate so far; none before the first innovation.
    innovation : ndarray, shape (..., m)
        The newest.
    memory : float
        rho. The recursion as printed forgets half of the past at every step whatever rho is near
        1: it remembers 2 innovations, not 20.

    """
    square = innovation[..., :, None] * innovation[..., None, :]
    return square if mat_v is None else np.asarray((memory * mat_v + square) / (1 + memory))


def fading_factors(tracking: StrongTracking, mat_v: Array, mat_r: Array, mat_hqh: Array,
                   spread: Array) -> Array:
    """
    Return the factor by which each state's variance fades (Bai2016 eq 23-27).

    Eq 24 lost the index of M_ii, eq 26 the noise's own matrix.

    Parameters
    ----------
    tracking : StrongTracking
        alpha and beta.
    mat_v : ndarray, shape (..., m, m)
        Covariance of the innovations as they came.
    mat_r, mat_hqh : ndarray, shape (..., m, m)
        R and H Q H'.
    spread : ndarray, shape (..., n)
        Diagonal of M = Phi P Phi' H' H.

    Returns
    -------
    ndarray, shape (..., n)
        lambda, at least 1.

    """
    weights = np.array(tracking.weights)
    excess = np.trace(mat_v - tracking.weakening * mat_r - mat_hqh, axis1=-2, axis2=-1)
    return np.asarray(np.maximum((excess / (spread @ weights))[..., None] * weights, 1.0))


def faded(mat: Array, factors: Array) -> Array:
    """
    Return L^1/2 M L^1/2 for factors L, shape (..., n).

    Eq 19 prints L Phi P Phi', which is not symmetric where the factors differ.
    """
    root = np.sqrt(factors)
    return np.asarray(root[..., :, None] * mat * root[..., None, :])


def surprise(innovation: Array, inverse: Array, gate: float) -> tuple[Array, Array]:
    """
    Find what variance along the innovation makes it ordinary.

    Parameters
    ----------
    innovation : ndarray, shape (..., m)
        e.
    inverse : ndarray, shape (..., m, m)
        Of S, what its covariance should be.
    gate : float
        Below ``gate`` times m of e' S^-1 e nothing is surprising.

    Returns
    -------
    share : ndarray, shape (...)
        c such that with S + c e e' the innovation is of its expected size; 0 below the gate.
    size : ndarray, shape (...)
        e' S^-1 e / m, 1 on average if the model holds.

    """
    m = innovation.shape[-1]
    size = np.asarray((innovation * transformed(inverse, innovation)).sum(-1) / m)
    return np.where(size > gate, (1 - 1 / np.maximum(size, 1)) / m, 0.0), size

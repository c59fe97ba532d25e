"""What ships do in waves, fitted on line with a handful of numbers: a prior for richer models."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cache
from math import exp, log, pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from deck_motion_ros.estimators.resampling import Grid
from deck_motion_ros.geometry import wrapped
from deck_motion_ros.samples import Array, HEAVE, PITCH, ROLL

GRAVITY = 9.80665
LENGTH, PERIOD, HEADING, SPEED, ROLL_PERIOD, DAMPING, SPREAD, ROLL_GAIN, PITCH_GAIN, HEIGHT = (
    range(10))
# what is believed before anything was measured: mean, sd
BELIEF: Array = np.array([
    [log(130.0), 0.8],  # log length of the ship (m)
    [log(9.0), 0.35],  # log peak period of the sea (s)
    [0.0, np.inf],  # direction the waves travel towards, from the bow (rad)
    [6.0, 4.0],  # speed of the ship (m/s)
    [log(11.0), 0.3],  # log natural period of roll (s), of a ship of 130 m
    [log(0.07), 0.5],  # log damping of roll, as a share of the critical
    [log(2.5), 0.7],  # log exponent of the cosine by which directions spread
    [0.0, 0.3],  # log of roll and
    [0.0, 0.3],  # of pitch beside what the closed forms say
    [log(2.0), 1.5],  # log size of the waves (m)
])
DELTA: Array = np.array([0.01, 0.01, 0.02, 0.1, 0.01, 0.03, 0.05, 0.01, 0.01, 0.01])
REACH: Array = np.array([0.5, 0.25, 0.5, 3.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5])  # of one step


def responses(params: Array, frequencies: int, directions: int
              ) -> tuple[Array, NDArray[np.complex128]]:
    """
    Return the line spectra of roll, pitch (rad) and heave (m).

    A Bretschneider sea, its directions spread as cos^n; heave and pitch after Jensen, Mansour and
    Olsen 2004 for a hull of usual proportions; roll a damped oscillator driven by the wave slope.
    No ship is like that; what is alike is how few numbers tie the axes and frequencies together.

    Parameters
    ----------
    params : ndarray, shape (b, 10)
        As ``BELIEF``.
    frequencies, directions : int
        Waves of the grid.

    Returns
    -------
    omega : ndarray, shape (b, n)
        Encounter frequency (rad/s), negative where the ship overtakes the waves.
    response : ndarray, shape (b, 3, n)
        Complex amplitudes, for E|wave|^2 = 1.

    """
    columns = params.T[:, :, None, None]
    length, peak, roll_period, damping, spread, roll_gain, pitch_gain, height = np.exp(
        columns[[LENGTH, PERIOD, ROLL_PERIOD, DAMPING, SPREAD, ROLL_GAIN, PITCH_GAIN, HEIGHT]])
    heading, speed = columns[HEADING], np.maximum(columns[SPEED], 0.0)
    ratio, energy, angle = _waves(frequencies, directions)
    share = np.cos(angle)**spread
    amplitude = height * np.sqrt(energy * share / share.sum(axis=-1, keepdims=True))

    omega = 2 * pi / peak * ratio
    k = omega**2 / GRAVITY
    kx, ky = k * np.cos(heading + angle), k * np.sin(heading + angle)
    beam, draught, block = length / 7.3, length / 23.5, 0.53
    encounter = omega - kx * speed
    alpha = encounter / omega
    square_alpha = alpha * alpha
    kt, kb, half = k * draught, k * (beam * block), kx * (length / 2)
    mean = _sinc(half)  # of a wave over the hull
    square = half * half + 1e-6
    root = np.sqrt(square)
    slope = 3 * (np.sin(root) / root - np.cos(root)) / square
    force = kb * alpha * (_sinc(kb / 2 * square_alpha) * np.exp(-kt * square_alpha))**2
    oscillator = amplitude * np.exp(-kt) * np.sqrt((1 - kt)**2 + force * force) / (
        1 - 2 * kt * square_alpha + 1j * np.abs(alpha) * force)
    tune = encounter * (roll_period * (length / 130)**0.7 / (2 * pi))
    roll = amplitude * np.exp(-kt / 2) * mean * _sinc(ky * (beam / 2)) / (
        1 - tune * tune + 1j * (2 * damping * tune))
    response = np.stack([
        -1j * roll_gain * ky * roll, 1j * pitch_gain * kx * slope * oscillator,
        oscillator * mean], axis=1)
    return encounter.reshape(len(params), -1), response.reshape(len(params), 3, -1)


def _sinc(phase: Array) -> Array:
    phase = phase + 1e-30  # so that 0 gives 1
    return np.asarray(np.sin(phase) / phase)


@cache
def _waves(frequencies: int, directions: int) -> tuple[Array, Array, Array]:
    """Return frequencies beside the peak, their share of the energy, angles off the mean."""
    ratio = np.geomspace(0.45, 4.0, frequencies)[:, None]
    energy = ratio**-4 * np.exp(-1.25 * ratio**-4)
    angle = ((np.arange(directions) + 0.5) / directions - 0.5) * pi
    return ratio, energy / energy.sum(), angle


class SeakeepingFit:
    """
    Fit ship and sea to slots of roll, pitch and heave as they come.

    Sought is the maximum of the posterior: the Gaussian likelihood of the last minutes, of each
    slot given those of the seconds before, times ``BELIEF``. One step of Fisher scoring at a time;
    a challenger from elsewhere climbs in turn with the best, and replaces it if it gets higher.

    Parameters
    ----------
    axes : sequence of int
        Which of ROLL, PITCH, HEAVE the slots hold.
    grid : Grid
        Of the slots.

    """

    PAST = 9.0  # s before a slot that its likelihood is conditional on
    MEMORY = 150.0  # s after which a slot counts 1/e
    LEAST = 40.0  # slots to begin with
    COARSE, FINE = (22, 15), (56, 21)  # waves: to fit, to tell
    CLIMB = 6  # steps that a challenger has
    YAWING, TURN = 0.09, 0.1  # rad: turns to be ignored; by which what was seen counts 1/e
    WATCH = 10  # headings over which a turn is seen

    def __init__(self, axes: Sequence[int], grid: Grid) -> None:
        self._axes, self._grid = list(axes), grid
        self.order = max(round(self.PAST / grid.step), 4)
        self._fade = exp(-grid.step / self.MEMORY)
        n = len(axes) * (self.order + 1)
        self._moments, self._weight = np.zeros((n, n)), 0.0
        self._noise_var: Array = np.zeros(len(axes))
        self._climbers: Array = np.zeros((0, len(BELIEF)))  # the best and the challenger
        self._damping = np.full(2, 1e-2)
        self._starts: list[Array] = []
        self._turn = self._steps = 0
        self._headings: deque[float] = deque(maxlen=self.WATCH)

    @property
    def params(self) -> Array | None:
        """The best found, as ``BELIEF``; None before there was any."""
        return self._climbers[0] if len(self._climbers) else None

    def learn(self, slots: Array, known: NDArray[np.bool_]) -> None:
        """Take slots about their mean, shape (order + k, m); ``known``, shape (k,), the new."""
        rows = sliding_window_view(slots, self.order + 1, axis=0)
        rows = rows[:, :, ::-1].transpose(0, 2, 1).reshape(len(rows), -1)
        weights = self._fade ** np.arange(len(rows) - 1, -1, -1.0) * known
        self._forget(self._fade ** len(rows))
        self._moments += (rows.T * weights) @ rows
        self._weight += float(weights.sum())

    def _forget(self, share: float) -> None:
        self._moments *= share
        self._weight *= share

    def head(self, heading: float) -> float:
        """
        Use the ship's heading (rad, no jumps): the sea turns the other way, the past fades.

        Returns
        -------
        float
            The share of what was learned that still counts.

        """
        turned = 0.0
        if self._headings:
            self._climbers[:, HEADING] -= heading - self._headings[-1]
            turned = max(abs(heading - self._headings[0]) - self.YAWING, 0.0)
        self._headings.append(heading)
        share = exp(-turned / self.TURN / self.WATCH)
        self._forget(share)
        return share

    def improve(self, noise_var: Array) -> None:
        """Go one step; ``noise_var``, shape (m,), is that of a slot."""
        self._noise_var = noise_var + 1e-30
        if not len(self._climbers):
            if self._weight < self.LEAST:
                return
            starts = self._guesses()
            self._starts = list(starts[np.argsort(self._cost(starts))])
            self._climbers = np.stack([self._starts.pop(0), self._starts.pop(0)])
        self._turn += 1
        try:
            self._climb(self._turn % 2)
        except np.linalg.LinAlgError:
            return  # what came is like no motion

    def _guesses(self) -> Array:
        """Return ships of three sizes in seas from all sides, as large as what came."""
        guesses = np.tile(BELIEF[:, 0], (24, 1))
        guesses[:, HEADING] = np.arange(24) * pi / 4 + 0.02
        guesses[:, LENGTH] = np.log(np.repeat([70.0, 140.0, 280.0], 8))
        var = np.einsum('bii->bi', self._covariances(guesses, 0, self.COARSE)[:, 0])
        came = np.diag(self._moments)[:len(self._axes)] / self._weight + self._noise_var
        gain = dict(zip(self._axes, np.log(came / var).T / 2, strict=True))
        size = gain[max(gain)]  # heave, if it comes
        guesses[:, HEIGHT] += np.clip(size, -4.0, 4.0)
        for axis, index in ((ROLL, ROLL_GAIN), (PITCH, PITCH_GAIN)):
            if axis in gain and HEAVE in gain:
                guesses[:, index] = np.clip(gain[axis] - size, -0.6, 0.6)
        return guesses

    def _compare(self, behind: float) -> None:
        """Let the challenger win, climb on, or make way for the next."""
        self._steps += 1
        if behind < -1.0:
            self._climbers, self._damping = self._climbers[::-1].copy(), self._damping[::-1].copy()
            self._steps = 0
        gap = np.abs(self._climbers[1] - self._climbers[0])
        alike = (abs(wrapped(float(gap[HEADING]))) < 0.2 and gap[LENGTH] < 0.1
                 and gap[ROLL_PERIOD] < 0.15)
        if self._steps >= self.CLIMB or (alike and self._steps):
            self._steps = 0
            self._climbers[1], self._damping[1] = self._challenger(), 1e-2

    def _challenger(self) -> Array:
        """Return the next guess, or the best ship in one of the three likeliest other seas."""
        self._turn += 2
        if self._starts and self._turn % 4 < 2:
            return self._starts.pop(0)
        others = np.tile(self._climbers[0], (7, 1))
        others[:, HEADING] += np.arange(1, 8) * pi / 4
        return np.asarray(others[np.argsort(self._cost(others))[self._turn // 4 % 3]])

    def _covariances(self, params: Array, lags: int, waves: tuple[int, int]) -> Array:
        """Return E[y(t + k) y(t)'] of the slots, k = 0 ... lags: shape (b, lags + 1, m, m)."""
        omega, response = responses(params, *waves)
        response, step, m = response[:, self._axes], self._grid.step, len(self._axes)
        if self._grid.ticks > 1:
            response *= _sinc(omega * (step / 2))[:, None]
        cross = response[:, :, None].conj() * response[:, None]
        wave = np.empty((lags + 1, *omega.shape), complex)
        wave[0], wave[1:2] = 1.0, np.exp(1j * step * omega)
        done = 1
        while done < lags:
            more = wave[1:lags + 1 - done][:done]
            np.multiply(more, wave[done], out=wave[done + 1:][:len(more)])
            done += len(more)
        # real part of wave times cross conjugate, as one product of reals
        flat = wave.view(float).transpose(1, 0, 2)
        cov = (flat @ cross.view(float).reshape(len(params), m * m, -1).transpose(0, 2, 1)
               ).reshape(len(params), lags + 1, m, m)
        cov[:, 0] += np.diag(self._noise_var)
        return np.asarray(cov)

    def _models(self, params: Array) -> tuple[Array, Array, Array]:
        """Return the best predictors from the past, what they miss, the past's covariances."""
        m = len(self._axes)
        second = block_toeplitz(self._covariances(params, self.order, self.COARSE))
        past, cross = second[:, m:, m:], second[:, m:, :m]
        np.einsum('bii->bi', past)[:] *= 1 + 1e-6
        gain = np.asarray(np.linalg.solve(past, cross).transpose(0, 2, 1))
        missed = second[:, :m, :m] - gain @ cross
        return gain, (missed + missed.transpose(0, 2, 1)) / 2, past

    def _cost(self, params: Array) -> Array:
        return self._misfit(params, *self._models(params)[:2])

    def _misfit(self, params: Array, gain: Array, missed: Array) -> Array:
        """Return -log posterior, shape (b,)."""
        m = len(self._axes)
        whole = np.concatenate([np.broadcast_to(np.eye(m), (len(params), m, m)), -gain], axis=2)
        came = whole @ self._moments @ whole.transpose(0, 2, 1)
        away = (params - BELIEF[:, 0]) / BELIEF[:, 1]
        return np.asarray(self._weight * np.linalg.slogdet(missed)[1]
                          + np.trace(np.linalg.solve(missed, came), axis1=1, axis2=2)
                          + np.sum(away**2, axis=1)) / 2

    def _climb(self, who: int) -> None:
        """Step along the slope by the inverse of Fisher's information, damped; keep what helps."""
        here = self._climbers[who]
        around = np.vstack([here, here + np.diag(DELTA)])
        gain, missed, past = self._models(around)
        cost = self._misfit(around, gain, missed)
        slope, delta = (cost[1:] - cost[0]) / DELTA, DELTA[:, None, None]
        precision = np.linalg.inv(missed[0])
        by_missed = precision @ (missed[1:] - missed[0]) / delta
        by_gain = np.linalg.cholesky(precision).T @ (gain[1:] - gain[0]) / delta
        many = len(DELTA), -1
        info = self._weight * (
            (by_gain @ past[0]).reshape(many) @ by_gain.reshape(many).T
            + by_missed.reshape(many) @ by_missed.transpose(0, 2, 1).reshape(many).T / 2)
        info += np.diag(BELIEF[:, 1]**-2.0 + 1e-6)
        slope -= np.diag(info) * DELTA / 2  # a difference is the slope half a step on
        info += self._damping[who] * np.diag(np.diag(info))
        # rounded: computers that round differently go the same way
        there = np.round(here + np.clip(-np.linalg.solve(info, slope), -REACH, REACH), 5)
        after, other = self._cost(np.stack([there, self._climbers[1 - who]]))
        if after < cost[0]:
            self._climbers[who] = there
            self._damping[who] = max(self._damping[who] / 3, 1e-3)
        else:
            self._damping[who] = min(self._damping[who] * 10, 1e3)
        if who:
            self._compare(min(after, cost[0]) - other)

    def expected(self, order: int, samples: float) -> Array | None:
        """Return second moments as ``ForgettingVar.learned`` would of so many samples, if any."""
        if self.params is None:
            return None
        second = block_toeplitz(
            samples * self._covariances(self.params[None], order, self.FINE))[0]
        return np.vstack([second, np.full(len(second), samples)])


def block_toeplitz(covs: Array) -> Array:
    """Return E[z z'] of z = (y(t), y(t - 1), ...) from E[y(t + k) y(t)'], shape (b, k, m, m)."""
    count, lags, m, _ = covs.shape
    # one axis now, all at the lags 1 - lags ... lags - 1: what the matrix has in its rows
    across = np.concatenate([covs[:, :0:-1].transpose(0, 3, 1, 2), covs.transpose(0, 2, 1, 3)],
                            axis=2).reshape(count, m, -1)
    second = np.empty((count, lags, m, lags * m))
    second[:] = sliding_window_view(across, lags * m, axis=2)[:, :, ::-m].transpose(0, 2, 1, 3)
    return second.reshape(count, lags * m, lags * m)

"""One axis in an unknown sea: a bank of wave spectra, weighed by how well each foretells."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan, pi
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from deck_motion_ros.samples import Array

Complex = NDArray[np.complex128]


NOW = np.zeros(1)
NEAR = 0.75  # s over which a cubic is a motion
LONGEST = 1e4  # s: all is forgotten then


def outer(vec: Complex) -> Complex:
    """Multiply vectors (b, n) by their own conjugates: (b, n, n)."""
    return np.asarray(vec[:, :, None] * vec.conj()[:, None])


def variance(factors: Complex, cov: Complex) -> Array:
    """Return the variances of modes (k, n, n) times factors (k, n, h), summed: (k, h)."""
    return np.asarray((factors * (cov @ factors.conj())).sum(axis=1).real)


class WaveBank:
    """
    Motions in seas of all kinds: the models of a bank of Kalman filters.

    Each is white noise through a Butterworth band-pass, of unit variance, about a level that
    wanders. In its modes, z' = lambda z + noise, a step of t seconds is a product of numbers: z
    goes to z exp(lambda t), its covariance P to S + exp(lambda t) (P - S) exp(lambda t)^H, with S
    the stationary one. What is measured is the sum of the modes.

    Parameters
    ----------
    periods, widths : sequence of float
        Of the bands: s of the middle; half the band as a share of its middle frequency.
    kinds : sequence of (float, float, float)
        Variance of a measurement and of the level, as shares of the motion's; s in which the
        level wanders.

    Attributes
    ----------
    rates : ndarray, shape (models, n)
        lambda (1/s): of the modes above the real axis, of the level, of their conjugates below.
        The models are all combinations of the parameters.
    stationary : ndarray, shape (models, n, n)
        S.
    noise : ndarray, shape (models,)
        Variance of a measurement.
    near : ndarray, shape (4, models * half * 2)
        What the modes, weighted, say of value and rate, now and NEAR seconds on.

    """

    ORDER = 3
    HALF = ORDER + 1  # modes that need an estimate: those below mirror those above
    READ = np.array([2.0] * ORDER + [1.0])  # their sum with the mirrored ones

    def __init__(self, periods: Sequence[float], widths: Sequence[float],
                 kinds: Sequence[tuple[float, float, float]]) -> None:
        models = [(period, width, *kind)
                  for period in periods for width in widths for kind in kinds]
        period, width, self.noise, level_var, level_time = np.array(models).T
        order, one = self.ORDER, np.eye(2 * self.ORDER)
        circle = np.exp(1j * pi * (0.5 + (np.arange(order) + 0.5) / order))
        above = 2 * pi / period[:, None] * (1j + width[:, None] * circle)
        poles = np.hstack([above, above.conj()])
        # partial fractions of s^(order - 1) over all (s - pole)
        share = poles**(order - 1) / np.prod(poles[:, :, None] - poles[:, None] + one, axis=2)
        cov = -outer(share) / (poles[:, :, None] + poles.conj()[:, None])
        cov /= cov.sum(axis=(1, 2), keepdims=True).real
        self.rates: Complex = np.insert(poles, order, -1 / level_time, axis=1)
        self.stationary: Complex = np.insert(np.insert(cov, order, 0, axis=1), order, 0, axis=2)
        self.stationary[:, order, order] = level_var
        rates = self.rates[:, :self.HALF]
        turn = self.READ * np.exp(np.array([[[0.0]], [[NEAR]]]) * rates)
        # conj, since Re(a z) is Re(a) Re(z) - Im(a) Im(z)
        self.near: Array = np.stack([turn, rates * turn], axis=1).conj().view(float).reshape(4, -1)


# little to much noise about a steady level; one that drifts, which is no wave. Without noise the
# level may be all there is: what does not move is no slow wave
BANK = WaveBank(np.geomspace(3.0, 30.0, 12).tolist(), (0.15, 0.4), (
    (1e-5, 1.0, 3000.0), (1e-3, 0.3, 3000.0), (0.03, 0.3, 3000.0), (1e-4, 3.0, 100.0)))


class Certainty:
    """
    How sure the models of a bank are after a measurement, whatever it said.

    Axes measured at the same times share it, and even steps soon lead back to where they are.

    Parameters
    ----------
    bank : WaveBank
        The models.
    cov : ndarray, shape (models, n, n)
        Error covariance of the modes; by default before any measurement.

    Attributes
    ----------
    turn, gain : ndarray, shape (models, half)
        Transition to the measurement, and what it changes for each unit of surprise.
    var, log_var : ndarray, shape (models,)
        Of the surprise.

    """

    __slots__ = ('bank', 'cov', 'turn', 'gain', 'var', 'log_var', '_step', '_next', '__weakref__')
    SETTLED = 1e-6  # change of cov that is none

    turn: Complex
    gain: Complex
    var: Array
    log_var: Array

    def __init__(self, bank: WaveBank, cov: Complex | None = None) -> None:
        self.bank = bank
        self.cov: Complex = bank.stationary if cov is None else cov
        self._step = nan  # that led here
        self._next: tuple[float, ref[Certainty]] = (nan, ref(self))

    def after(self, step: float) -> Certainty:
        """Return that after another measurement, ``step`` seconds later."""
        if step == self._next[0] and (known := self._next[1]()) is not None:
            return known
        turn = np.exp(self.bank.rates * step)
        cov = self.bank.stationary + outer(turn) * (self.cov - self.bank.stationary)
        across = cov.sum(axis=2)
        var = across.sum(axis=1).real + self.bank.noise
        found = Certainty(self.bank, cov - outer(across) / var[:, None, None])
        if step == self._step and np.abs(found.cov - self.cov).max() < self.SETTLED:
            found = self
        else:
            half = self.bank.HALF
            found.turn, found.gain = turn[:, :half], across[:, :half] / var[:, None]
            found.var, found.log_var, found._step = var, np.log(var), step
        self._next = step, ref(found)
        return found


class BankOutlook:
    """
    What a bank says of the future of its axis, frozen.

    Parameters
    ----------
    time : float
        Of the newest measurement (s).
    certainty : Certainty
        After it.
    weights, sizes : ndarray, shape (models,)
        Probability of each model; variance of the motion, should it be right.
    modes : ndarray, shape (models, half)
        Estimates.
    usual : float
        Variance of the motion over minutes: where nothing is known, the uncertainty is no less.

    """

    __slots__ = ('time', '_certainty', '_chosen', '_weights', '_sizes', '_modes', '_usual',
                 '_rates', '_parts')
    FAITH = 3e-3  # of the best model's probability: below, a model does not count

    def __init__(self, time: float, certainty: Certainty, weights: Array, sizes: Array,
                 modes: Complex, usual: float) -> None:
        self.time, self._certainty, self._usual = time, certainty, usual
        self._chosen = chosen = np.flatnonzero(weights > self.FAITH * weights.max())
        self._sizes = sizes[chosen, None]
        weights = weights[chosen]
        self._weights = weights / weights.sum()
        self._modes: Complex = WaveBank.READ * modes[chosen]
        self._rates: Complex = certainty.bank.rates[chosen]
        rates = self._rates[:, :WaveBank.HALF].ravel()
        value = (self._weights[:, None] * self._modes).ravel()
        self._parts = rates, np.array([value, rates * value]).T

    def mean(self, time: float) -> float:
        """Predict the axis at ``time`` (s)."""
        return float(self.motion(time, NOW)[0, 0])

    def motion(self, time: float, horizons: Array) -> Array:
        """Predict value and rate ``horizons`` (s, shape (n,)) after ``time``: shape (2, n)."""
        rates, parts = self._parts
        turn = np.exp(self._ahead(time, horizons)[:, None] * rates)
        return np.asarray((turn @ parts).real.T)

    def spread(self, time: float, horizons: Array) -> Array:
        """Return the variances of both, each model's and among them, shape (2, n)."""
        stationary = self._certainty.bank.stationary[self._chosen]
        known = stationary - self._certainty.cov[self._chosen]
        rates = self._rates[:, :, None]
        turn = np.exp(rates * self._ahead(time, horizons))
        usual = self._usual / variance(np.ones_like(rates), stationary)
        var = np.zeros((2, turn.shape[2]))
        for kind, factor in enumerate((np.ones_like(rates), rates)):
            whole = variance(factor, stationary)
            own = whole - variance(factor * turn, known)
            sizes = self._sizes + own / whole * np.maximum(usual - self._sizes, 0)
            each = ((factor * turn)[:, :WaveBank.HALF] * self._modes[:, :, None]).real.sum(axis=1)
            away = each - self._weights @ each
            var[kind] = self._weights @ (sizes * own + away * away)
        return var

    def _ahead(self, time: float, horizons: Array) -> Array:
        return np.minimum(max(time - self.time, 0.0) + horizons, LONGEST)


class BankAxis:
    """
    One axis, foretold by a bank of models.

    Samples are averaged over about BIN seconds. What comes tells how probable each model is and
    how large its motion, the past fading.

    Parameters
    ----------
    sd : float
        Of the motion, before anything came.
    start : Certainty
        Before any measurement.

    Attributes
    ----------
    usual : float
        Variance of the motion over minutes.

    """

    BIN = 0.5  # s
    HALF_LIFE = 20.0  # s of what came
    USUAL_HALF_LIFE = 200.0  # s, for the motion's variance
    EXPECTED = 0.1  # measurements that the expected size weighs
    DOUBT, LEAST = 0.1, 1e-18  # share of a measurement's variance, and variance (rad^2, m^2),
    # that even a stuck sensor leaves

    def __init__(self, sd: float, start: Certainty) -> None:
        models = len(start.bank.noise)
        self._certainty, self._expected = start, self.EXPECTED * sd * sd
        self._modes: Complex = np.zeros((models, start.bank.HALF), complex)
        self._squares, self._logs, self._number = np.zeros(models), np.zeros(models), 0.0
        self._mean = self.usual = self._weight = 0.0
        self._time = self._newest = self._first = -inf
        self._count, self._since, self._sum = 0, 0.0, 0.0
        self._weights = np.full(models, 1 / models)
        self._outlook: BankOutlook | None = None
        self._near = 0.0, 0.0, 0.0, 0.0  # coefficients of a cubic

    def measure(self, time: float, value: float, var: float) -> None:
        """Use a measurement at ``time`` (s, after the last one) with its variance."""
        period, self._newest = time - self._newest, time
        if not self._count:
            self._first = time
        self._count += 1
        self._since += time - self._first
        self._sum += value
        if time - self._first + 1.5 * period > self.BIN:  # the next one is too far
            self._update(self._first + self._since / self._count, self._sum / self._count,
                         var / self._count)
            self._count, self._since, self._sum = 0, 0.0, 0.0

    def _update(self, time: float, value: float, var: float) -> None:
        step = min(round(time - self._time, 6), LONGEST)
        now = self._certainty = self._certainty.after(step)
        self._time, self._outlook = time, None
        modes = now.turn * self._modes
        error = value - modes.real @ WaveBank.READ
        self._modes = modes + now.gain * error[:, None]
        fade = 0.5 ** (step / self.HALF_LIFE)
        self._squares = fade * self._squares + (
            error * error + self.DOUBT * var + self.LEAST) / now.var
        self._logs = fade * self._logs + now.log_var
        self._number = fade * self._number + 1
        self._weight = 0.5 ** (step / self.USUAL_HALF_LIFE) * self._weight + 1
        away = value - self._mean
        self._mean += away / self._weight
        self.usual += (away * (value - self._mean) - self.usual) / self._weight
        # of Gaussian errors whose size is not known
        likelihood = (self._logs + self._number * np.log(self._squares)) / -2
        weights = np.exp(likelihood - likelihood.max())
        self._weights = weights / weights.sum()
        parts = self._weights[:, None] * self._modes
        here, slope, there, later = (now.bank.near @ parts.view(float).ravel()).tolist()
        mean = (there - here) / NEAR
        self._near = (here, slope, (3 * mean - 2 * slope - later) / NEAR,
                      (slope + later - 2 * mean) / NEAR**2)

    def expected(self, time: float) -> float:
        """Predict the axis at ``time`` (s), the mean alone."""
        ahead = time - self._time
        if ahead > NEAR:
            return self.outlook().mean(time)
        a, b, c, d = self._near
        return a + ahead * (b + ahead * (c + ahead * d))

    def outlook(self) -> BankOutlook:
        """Return what is known of the future now."""
        if self._outlook is None:
            sizes = (self._squares + self._expected) / (self._number + self.EXPECTED)
            self._outlook = BankOutlook(self._time, self._certainty, self._weights, sizes,
                                        self._modes, self.usual)
        return self._outlook

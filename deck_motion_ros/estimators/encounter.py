"""The sea as a moving aircraft meets it, and wave states fitted to its spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import log, pi

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import least_squares

from deck_motion_ros.samples import Array

GRAVITY = 9.80665
LINES = 4000  # lines by which a spectrum is integrated
DIRECTIONS = 31  # of a short-crested sea
BANDS = 200  # of the spectrum that is fitted
DIGITS = 3  # of the fitted logarithms: the same on every machine
FLOOR = 1e-3  # of the density that is fitted, as a share of variance / frequency


@dataclass(frozen=True)
class EncounterSea:
    """
    The two-parameter spectrum of the ITTC, met at some speed and heading (LiSkimming eq 2).

    S(w) = A w^-5 exp(-B w^-4), A = 173 Hs^2 / T1^4, B = 691 / T1^4; a wave of frequency w is met
    with w - w^2 V cos(heading) / g.

    Parameters
    ----------
    height : float
        Significant wave height (m).
    mean_period : float
        T1 (s); the peak period is 1.296 T1.
    speed : float
        Of the observer (m/s).
    heading : float
        Direction the waves travel towards, from the observer's course (rad); pi = head sea.
    spreading : float
        Exponent n of cos^n within +-90 deg of it; 0 = long-crested.

    """

    height: float
    mean_period: float
    speed: float
    heading: float
    spreading: float = 0.0

    @property
    def peak(self) -> float:
        """Frequency of the peak for an observer at rest, rad/s."""
        return float((0.8 * 691)**0.25 / self.mean_period)

    @property
    def var(self) -> float:
        """Variance of the elevation, (Hs / 4)^2 (m^2)."""
        return self.height**2 / 16

    @cached_property
    def lines(self) -> tuple[Array, Array]:
        """Encounter frequencies (rad/s, at least 0) and their variances (m^2)."""
        b = 691 / self.mean_period**4
        edges = self.peak * np.geomspace(0.3, 6.0, LINES + 1)
        omega = (edges[1:] + edges[:-1]) / 2
        power = np.diff(np.exp(-b / edges**4))
        power *= self.var / power.sum()
        angle = pi * ((np.arange(DIRECTIONS) + 0.5) / DIRECTIONS - 0.5)
        share = np.cos(angle)**self.spreading
        if self.spreading == 0:
            angle, share = np.zeros(1), np.ones(1)
        along = self.speed / GRAVITY * np.cos(self.heading + angle)
        met = np.abs(omega[:, None] - omega[:, None]**2 * along).ravel()
        var = np.outer(power, share / share.sum()).ravel()
        if self.spreading == 0:
            return met, var
        bins = met.max() * np.append(0.0, np.geomspace(1e-4, 1.0, LINES))
        total, moment = (np.histogram(met, bins, weights=item)[0] for item in (var, var * met))
        return moment[total > 0] / total[total > 0], total[total > 0]

    @cached_property
    def middle(self) -> float:
        """Frequency below which half of the variance is met, rad/s."""
        omega, var = self.lines
        order = np.argsort(omega)
        return float(omega[order][np.searchsorted(np.cumsum(var[order]), self.var / 2)])

    def density(self, edges: Array) -> Array:
        """Return the mean spectral density (m^2 s/rad) between ``edges`` (rad/s), shape (n,)."""
        omega, var = self.lines
        return np.asarray(np.histogram(omega, edges, weights=var)[0] / np.diff(edges))

    def autocovariance(self, lags: Array) -> Array:
        """Return the autocovariance of the elevation (m^2) at ``lags`` (s), shape (n,)."""
        omega, var = self.lines
        return np.concatenate([np.cos(np.outer(part, omega)) @ var
                               for part in np.array_split(lags, len(lags) // 200 + 1)])

    @cached_property
    def correlation_time(self) -> float:
        """
        Integral of the squared autocorrelation over all lags (s).

        A record of length T tells the variance as well as T over this independent values.
        """
        edges = np.concatenate([[0.0], self.middle * np.geomspace(0.05, 20, BANDS)])
        return float(pi * np.sum(self.density(edges)**2 * np.diff(edges)) / self.var**2)


@dataclass(frozen=True, eq=False)
class WaveModel:
    """
    Elevation as white noise through g s^m / ((s^2 + a1 s + d1) (s^2 + a2 s + d2)).

    The states are a signal and its first three derivatives; the elevation is the m-th.

    Attributes
    ----------
    sea : EncounterSea
        What it was fitted to.
    damping, stiffness : tuple of 2 float
        a (1/s) and d (1/s^2).
    intensity : float
        Spectral density of the noise, E[w(t) w(s)] = intensity delta(t - s).
    order : int
        m.
    misfit : float
        Root mean square of log(fitted / true density), noise floor included.

    """

    sea: EncounterSea
    damping: tuple[float, float]
    stiffness: tuple[float, float]
    intensity: float
    order: int
    misfit: float

    @cached_property
    def mat_a(self) -> Array:
        """The drift matrix, shape (4, 4)."""
        poly = np.ones(1)
        for a, d in zip(self.damping, self.stiffness, strict=True):
            poly = np.convolve(poly, [1.0, a, d])
        mat = np.eye(4, k=1)
        mat[-1] = -poly[:0:-1]
        return mat

    @cached_property
    def stationary(self) -> Array:
        """Stationary covariance, shape (4, 4)."""
        noise = np.diag([0.0, 0.0, 0.0, self.intensity])
        cov = solve_continuous_lyapunov(self.mat_a, -noise)
        return np.asarray((cov + cov.T) / 2)

    def spectrum(self, omega: Array) -> Array:
        """Return the one-sided spectral density (m^2 s/rad) at ``omega`` (rad/s)."""
        power = self.intensity / pi * omega**(2 * self.order)
        for a, d in zip(self.damping, self.stiffness, strict=True):
            power = power / ((d - omega**2)**2 + (a * omega)**2)
        return np.asarray(power)


def wave_model(sea: EncounterSea, order: int | None = None) -> WaveModel:
    """
    Fit wave states to an encounter spectrum.

    Least squares on the logarithm of the density, a decade of frequency weighing like another,
    above a floor: what is far below the altimeter's noise need not be fitted. A steep flank
    towards low frequencies matters most, for there height and waves are told apart; where waves
    are met at all frequencies (a following sea) a lower order fits better.

    Parameters
    ----------
    sea : EncounterSea
        The sea, higher than 0.
    order : int, optional
        Of the numerator, 1 to 3; by default the one that fits best.

    """
    if order is None:
        return min((_fitted(sea, order) for order in (3, 2, 1)), key=lambda item: item.misfit)
    return _fitted(sea, order)


@lru_cache(maxsize=256)
def _fitted(sea: EncounterSea, order: int) -> WaveModel:
    middle = sea.middle
    edges = middle * np.geomspace(0.1, 20.0, BANDS + 1)
    omega2 = (edges[1:] * edges[:-1]) / middle**2
    floor = FLOOR
    target = np.log(sea.density(edges) * middle / sea.var + floor)

    def density(params: Array) -> tuple[Array, Array]:
        """Return the density without floor (variance and frequency 1), its log's gradient."""
        power, gradient = np.exp(params[4]) * omega2**order, np.ones((BANDS, 5))
        for i in (0, 1):
            d, a2 = np.exp(params[i]), np.exp(2 * params[2 + i])
            den = (d - omega2)**2 + a2 * omega2
            power = power / den
            gradient[:, i] = -2 * d * (d - omega2) / den
            gradient[:, 2 + i] = -2 * a2 * omega2 / den
        return power, gradient

    def residual(params: Array) -> Array:
        return np.asarray(np.log(density(params)[0] + floor) - target)

    def jacobian(params: Array) -> Array:
        power, gradient = density(params)
        return np.asarray((power / (power + floor))[:, None] * gradient)

    fits = [least_squares(residual, [-0.2, log(spread), log(0.4), log(0.8), 0.0], jacobian,
                          bounds=([-4.0] * 4 + [-20.0], [4.0] * 4 + [20.0]), xtol=1e-13,
                          ftol=1e-13, gtol=1e-13) for spread in (1.5, 4.0)]
    best = min(fits, key=lambda fit: round(float(fit.cost), 9))
    d1, d2, a1, a2, gain = np.exp(np.round(best.x, DIGITS)).tolist()
    model = WaveModel(sea, (a1 * middle, a2 * middle), (d1 * middle**2, d2 * middle**2), 1.0,
                      order, float(np.sqrt(np.mean(best.fun**2))))
    scale = sea.var / model.stationary[order, order]
    return WaveModel(sea, model.damping, model.stiffness, float(scale), order, model.misfit)

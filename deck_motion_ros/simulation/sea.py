"""
The sea: wave spectra, spreading, and the regular waves whose sum it is.

Deep water, linear waves. Directions are those the waves travel **towards** (rad, ENU,
counter-clockwise from east).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import Protocol

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from deck_motion_ros.samples import Array

GRAVITY = 9.80665


class Spectrum(Protocol):
    """A one-sided wave spectrum, m^2 s/rad; it integrates to (significant height / 4)^2."""

    @property
    def peak(self) -> float:
        """Frequency of the peak, rad/s."""

    def density(self, omega: Array) -> Array:
        """Return the spectral density at ``omega`` (rad/s, above 0, any shape)."""


@dataclass(frozen=True)
class Bretschneider:
    """
    The two-parameter spectrum of the ITTC.

    Parameters
    ----------
    height : float
        Significant wave height (m).
    period : float
        Peak period (s).

    """

    height: float
    period: float

    @property
    def peak(self) -> float:
        """Frequency of the peak, rad/s."""
        return 2 * pi / self.period

    def density(self, omega: Array) -> Array:
        """Return the spectral density at ``omega`` (rad/s, above 0, any shape)."""
        ratio4 = (self.peak / omega)**4
        return np.asarray(5 / 16 * self.height**2 * ratio4 / omega * np.exp(-1.25 * ratio4))


@dataclass(frozen=True)
class Jonswap(Bretschneider):
    """
    A growing sea's peaked spectrum (Hasselmann et al. 1973), scaled to the height exactly.

    Parameters
    ----------
    height, period : float
        Significant wave height (m), peak period (s).
    gamma : float
        Peak enhancement; 1 gives :class:`Bretschneider`.

    """

    gamma: float = 3.3

    def _shape(self, omega: Array) -> Array:
        ratio = omega / self.peak
        width = np.where(ratio <= 1, 0.07, 0.09)
        return super().density(omega) * self.gamma**np.exp(-((ratio - 1) / width)**2 / 2)

    @cached_property
    def _scale(self) -> float:
        omega = self.peak * np.geomspace(0.2, 50, 20001)
        plain = trapezoid(super().density(omega), omega)
        return float(plain / trapezoid(self._shape(omega), omega)) if plain > 0 else 1.0

    def density(self, omega: Array) -> Array:
        """Return the spectral density at ``omega`` (rad/s, above 0, any shape)."""
        return self._scale * self._shape(omega)


@dataclass(frozen=True)
class Pan2020:
    """
    The wind-sea spectrum of Pan2020 (eq 21-22), as printed: U = 6.28 sqrt(height).

    It integrates to 0.9969 of the height. Its peak follows from the height.

    Parameters
    ----------
    height : float
        Significant wave height (m).

    """

    height: float

    @property
    def _decay(self) -> float:
        return 9.81**2 / (6.28**2 * max(self.height, 1e-9))  # g^2 / U^2

    @property
    def peak(self) -> float:
        """Frequency of the peak, rad/s."""
        return sqrt(0.4 * self._decay)

    def density(self, omega: Array) -> Array:
        """Return the spectral density at ``omega`` (rad/s, above 0, any shape)."""
        return np.asarray(0.74 / omega**5 * np.exp(-self._decay / omega**2))


@dataclass(frozen=True)
class WaveSystem:
    """
    Wind sea or swell: a spectrum spread about a direction.

    Parameters
    ----------
    spectrum : Spectrum
        How the energy is spread over frequency.
    direction : float
        Mean direction the waves travel towards (rad, ENU).
    spreading : float
        Exponent n of cos^n within +-90 deg of it; 0 = long-crested, all in one direction.

    """

    spectrum: Spectrum
    direction: float
    spreading: float = 2.0

    def directions(self, quantile: Array) -> Array:
        """Return the direction (rad) below which the share ``quantile`` of the energy travels."""
        if self.spreading == 0:
            return np.full(np.shape(quantile), self.direction)
        angle = np.linspace(-pi / 2, pi / 2, 2001)
        share = cumulative_trapezoid(np.cos(angle)**self.spreading, angle, initial=0)
        return np.asarray(self.direction + np.interp(quantile, share / share[-1], angle))

    def bands(self, count: int) -> tuple[Array, Array]:
        """
        Divide 0.3 to 6 peak frequencies into bands, half by energy, half by log frequency.

        Returns
        -------
        edges : ndarray, shape (count + 1,)
            rad/s.
        energy : ndarray, shape (count,)
            Variance of the elevation in each band (m^2).

        """
        omega = self.spectrum.peak * np.geomspace(0.3, 6.0, 8001)
        energy = cumulative_trapezoid(self.spectrum.density(omega), omega, initial=0)
        share = (energy / (energy[-1] or 1.0) + np.linspace(0, 1, len(omega))) / 2
        edges = np.interp(np.linspace(0, share[-1], count + 1), share, omega)
        return edges, np.diff(np.interp(edges, omega, energy))


@dataclass(frozen=True, eq=False)
class Waves:
    """
    Regular waves; their sum is the sea.

    Attributes
    ----------
    amplitude, omega, direction, phase : ndarray, shape (n,)
        m, rad/s, rad (ENU, towards), rad (at the map's origin at time 0).

    """

    amplitude: Array
    omega: Array
    direction: Array
    phase: Array

    @cached_property
    def vectors(self) -> Array:
        """Wave vectors east, north (rad/m), shape (2, n): k = omega^2 / g."""
        towards = np.stack([np.cos(self.direction), np.sin(self.direction)])
        return np.asarray(self.omega**2 / GRAVITY * towards)

    def phases(self, times: Array, positions: Array) -> Array:
        """Return the phase of each wave (rad), shape (m, n), at times (m,), positions (m, 2)."""
        return np.outer(times, self.omega) - positions @ self.vectors + self.phase

    def elevation(self, times: Array, positions: Array) -> Array:
        """Return the height of the sea (m), shape (m,), at times (m,) (s), positions (m, 2)."""
        return np.asarray(np.cos(self.phases(times, positions)) @ self.amplitude)


def random_waves(system: WaveSystem, count: int, rng: np.random.Generator) -> Waves:
    """
    Draw a sea: one wave in each band, its amplitude sqrt(2 energy) (Pan2020 eq 20).

    Frequencies are uniform within their bands, so that nothing repeats; phases uniform on
    (0, 2 pi) (the paper's (0, pi) gives a transient); directions run through the spreading with
    the golden ratio, so that neighbouring bands together show all of it.
    """
    edges, energy = system.bands(count)
    quantile = (rng.random() + np.arange(count) * (sqrt(5) - 1) / 2) % 1.0
    return Waves(np.sqrt(2 * energy), rng.uniform(edges[:-1], edges[1:]),
                 system.directions(quantile), rng.uniform(0, 2 * pi, count))


def dense_waves(system: WaveSystem, frequencies: int = 400, directions: int = 40) -> Waves:
    """Cover spectrum and spreading by a fine grid, phases 0: for statistics, not for a sea."""
    edges, energy = system.bands(frequencies)
    angles = system.directions((np.arange(directions) + 0.5) / directions)
    if system.spreading == 0:
        angles = angles[:1]
    omega, direction = np.meshgrid((edges[1:] + edges[:-1]) / 2, angles, indexing='ij')
    amplitude = np.repeat(np.sqrt(2 * energy / len(angles)), len(angles))
    return Waves(amplitude, omega.ravel(), direction.ravel(), np.zeros(omega.size))


def joined(seas: Iterable[Waves]) -> Waves:
    """Put wave systems into one sea."""
    seas = tuple(seas)
    return Waves(*(np.concatenate([getattr(sea, name) for sea in seas])
                   for name in ('amplitude', 'omega', 'direction', 'phase')))

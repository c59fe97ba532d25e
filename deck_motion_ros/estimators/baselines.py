"""Peers that a predictor must beat: the least, an AR model per axis, a bank of harmonics."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import exp, inf

import numpy as np
from scipy.interpolate import CubicSpline

from deck_motion_ros.estimators.resampling import Grid, Resampler
from deck_motion_ros.estimators.var import ForgettingVar
from deck_motion_ros.samples import Array, AXES, Vector3

Foresight = Callable[[float], float]  # time (s) to value


class BaselineOutlook:
    """What a baseline says of the future, frozen: the mean alone."""

    def __init__(self, axes: Sequence[Foresight]) -> None:
        self._axes = axes

    def mean(self, time: float) -> Vector3:
        """Predict roll, pitch (rad) and heave (m) at ``time`` (s)."""
        roll, pitch, heave = self._axes
        return roll(time), pitch(time), heave(time)


class StillAxis:
    """It is at rest."""

    def measure(self, time: float, value: float, var: float) -> None:
        """Leave a measurement unused."""

    def outlook(self) -> Foresight:
        """Return 0 for ever."""
        return lambda time: 0.0


class PersistentAxis:
    """It stays as it was last measured."""

    def __init__(self) -> None:
        self._value = 0.0

    def measure(self, time: float, value: float, var: float) -> None:
        """Use a measurement."""
        self._value = value

    def outlook(self) -> Foresight:
        """Return the last measurement for ever."""
        value = self._value
        return lambda time: value


class AutoregressiveAxis:
    """
    An AR model, fitted on line by least squares and iterated.

    Slots of 0.5 s, or the samples where they are slower; until there are enough for a fit, the
    mean is the forecast.
    """

    ORDER = 30
    MEMORY = 600.0  # s after which a sample counts 1/e
    REFIT_EVERY = 5.0  # s
    FURTHEST = 12.0  # s ahead
    LOOK = 8  # samples that decide on the grid

    def __init__(self) -> None:
        self._waiting: list[tuple[float, float]] = []
        self._resampler: Resampler | None = None
        self._slots: list[float] = []  # that end at each of the recent ticks
        self._known: list[bool] = []
        self._model: tuple[Array, Array] | None = None

    def measure(self, time: float, value: float, var: float) -> None:
        """Use a measurement (any unit) at ``time`` (s, above the last one)."""
        if self._resampler is not None:
            self._take(self._resampler, time, value)
            return
        self._waiting.append((time, value))
        if len(self._waiting) == self.LOOK:
            grid = Grid.of_period(float(np.median(np.diff(self._waiting, axis=0)[:, 0])))
            self._resampler = Resampler(grid, 1, self._waiting[0][0])
            self._var = ForgettingVar(1, self.ORDER, self.MEMORY / grid.step)
            self._ticks: deque[float] = deque(maxlen=grid.ticks)
            self._new = max(round(self.REFIT_EVERY / grid.step), 1)
            for sample in self._waiting:
                self._take(self._resampler, *sample)

    def _take(self, resampler: Resampler, time: float, value: float) -> None:
        grid = resampler.grid
        for tick in resampler.add(0, time, value):
            self._ticks.append(float(tick.values[0]))
            self._slots.append(sum(self._ticks) / len(self._ticks))
            self._known.append(tick.known[0])
            if len(self._slots) == (self.ORDER + self._new) * grid.ticks:
                self._fit(grid)

    def _fit(self, grid: Grid) -> None:
        """Learn the new slots, keep as many as the model looks back."""
        newest = slice(grid.ticks - 1, None, grid.ticks)
        self._var.learn(np.array(self._slots[newest])[:, None],
                        np.array(self._known[newest][self.ORDER:]))
        del self._slots[:self._new * grid.ticks], self._known[:self._new * grid.ticks]
        if self._var.is_ready:
            mean = self._var.sums[:1] / self._var.weight
            through, offset = self._var.solve(mean, np.zeros(1)).ahead(
                round(self.FURTHEST / grid.step))
            self._model = through[:, 0], offset[:, 0]

    def outlook(self) -> Foresight:
        """Return the iterated forecast, a spline through its slots."""
        if self._resampler is None or self._model is None:
            known = self._slots or [value for _, value in self._waiting]
            mean = float(np.mean(known)) if known else 0.0
            return lambda time: mean
        grid, (through, offset) = self._resampler.grid, self._model
        past = np.array(self._slots[::-grid.ticks][:self.ORDER])
        path = np.concatenate([past[3::-1], through @ past + offset])
        middles = self._resampler.time - grid.age + grid.step * np.arange(-3.0, len(path) - 3)
        spline = CubicSpline(middles, path)
        return lambda time: float(spline(time))


class HarmonicAxis:
    """
    A bank of harmonics and a level, their amplitudes Gauss-Markov: a Kalman filter.

    The state is the amplitudes themselves, so that it rests while the row of the measurement
    turns. How large each harmonic is in the long run is learned from its recent power.
    """

    OMEGA = np.linspace(0.2, 2.0, 32)  # rad/s
    COHERENCE = 200.0  # s in which an amplitude is forgotten
    MEMORY = 30.0  # s in which its recent power is forgotten
    LEAST = 1e-3  # share of the mean power that every harmonic is believed to have

    def __init__(self) -> None:
        size = 2 * len(self.OMEGA) + 1
        self._vec = np.zeros(size)
        self._cov = np.zeros((size, size))
        self._var = np.einsum('ii->i', self._cov)  # a view
        self._power = np.zeros(size)
        self._time = -inf

    def _row(self, time: float) -> Array:
        angle = self.OMEGA * time
        return np.concatenate([np.cos(angle), np.sin(angle), [1.0]])

    def measure(self, time: float, value: float, var: float) -> None:
        """Use a measurement (any unit) at ``time`` (s, not before the last one)."""
        if self._time == -inf:
            self._power += (value * value + var) / len(self.OMEGA)
        since, self._time = time - self._time, time
        kept = exp(-since / self.COHERENCE)
        self._vec *= kept
        self._cov *= kept * kept
        self._var += (1 - kept * kept) * self._power
        row = self._row(time)
        cross = self._cov @ row
        total = float(row @ cross) + var
        self._vec += cross * ((value - float(row @ self._vec)) / total)
        self._cov -= np.multiply.outer(cross, cross / total)
        power = np.square(self._vec) + self._var
        power = np.maximum(power, self.LEAST * power.mean())
        self._power += min(since / self.MEMORY, 1.0) * (power - self._power)

    def outlook(self) -> Foresight:
        """Return the harmonics as they are now."""
        vec, start = self._vec.copy(), self._time
        return lambda time: float(self._row(time) @ vec) * exp((start - time) / self.COHERENCE)


Axis = StillAxis | PersistentAxis | AutoregressiveAxis | HarmonicAxis


class PerAxis:
    """
    Roll, pitch and heave, each by a baseline of its own.

    Parameters
    ----------
    make : callable
        Makes the baseline of an axis.

    """

    def __init__(self, make: Callable[[], Axis]) -> None:
        self._axes = tuple(make() for _ in AXES)

    def measure(self, axis: int, time: float, value: float, var: float) -> None:
        """
        Use a measurement.

        Parameters
        ----------
        axis : int
            ROLL, PITCH or HEAVE.
        time : float
            Seconds, above the axis's last one.
        value, var : float
            Radians or metres, and the variance of its error.

        """
        self._axes[axis].measure(time, value, var)

    def outlook(self) -> BaselineOutlook:
        """Return what is known of the future now."""
        return BaselineOutlook([axis.outlook() for axis in self._axes])

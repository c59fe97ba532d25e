"""Forecast against what came: errors, calibration, spectra, gaps, motion statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import welch
from scipy.special import ndtri

from deck_motion_ros.geometry import turned_arm
from deck_motion_ros.samples import Array, NANOSECONDS, Vector3

Stamps = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Series:
    """
    A measured or true quantity and its stamps; see :meth:`of` to make one from raw messages.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Nanoseconds, strictly increasing.
    values : ndarray, shape (n,)
        Finite.

    """

    stamps: Stamps
    values: Array

    @classmethod
    def of(cls, stamps: Sequence[int] | Stamps, values: Sequence[float] | Array) -> Series:
        """Keep what is finite and newer than everything before it."""
        when, what = np.asarray(stamps, np.int64), np.asarray(values, float)
        finite = np.isfinite(what)
        when, what = when[finite], what[finite]
        newest = np.maximum.accumulate(when)
        fresh = np.ones(len(when), bool)
        fresh[1:] = when[1:] > newest[:-1]
        return cls(when[fresh], what[fresh])

    def __len__(self) -> int:
        return len(self.stamps)

    @cached_property
    def times(self) -> Array:
        """Seconds since the first stamp."""
        return np.asarray((self.stamps - self.stamps[:1]) / NANOSECONDS)

    @cached_property
    def period(self) -> float:
        """Median time between samples (s); NaN for fewer than two."""
        return float(np.median(np.diff(self.times))) if len(self) > 1 else np.nan

    @cached_property
    def runs(self) -> list[slice]:
        """Runs without a gap: steps up to 1.5 periods, and up to 0.5 s in any case."""
        longest = max(1.5 * self.period, 0.5) if len(self) > 1 else 0.5
        cuts = np.flatnonzero(np.diff(self.times) > longest) + 1
        return [slice(a, b) for a, b in pairwise([0, *cuts.tolist(), len(self)])]

    def at(self, stamps: Sequence[int] | Stamps) -> Array:
        """
        Interpolate with a cubic spline; NaN before, after and inside gaps.

        The spline passes through the samples, so a stamp that was sampled keeps its value. In the
        middle between samples of 1 Hz it misses 0.04 % of the amplitude of a 10 s wave, 0.1 % at
        8 s and 0.4 % at 6 s, where a straight line misses 4.9, 7.6 and 13 %.

        Parameters
        ----------
        stamps : sequence of int
            Nanoseconds, any order.

        """
        result = np.full(len(stamps), np.nan)
        if not len(self):
            return result
        when = (np.asarray(stamps, np.int64) - self.stamps[0]) / NANOSECONDS
        begins = self.times[[run.start for run in self.runs]]
        belongs = np.searchsorted(begins, when, side='right') - 1
        for number, run in enumerate(self.runs):
            times, values = self.times[run], self.values[run]
            inside = (belongs == number) & (when <= times[-1])
            if inside.any():
                result[inside] = CubicSpline(times, values)(when[inside]) if len(
                    times) > 1 else values[0]
        return result

    def longest_run(self) -> Series:
        """Return the longest part without a gap."""
        if not len(self):
            return self
        longest = max(self.runs, key=lambda run: run.stop - run.start)
        return Series(self.stamps[longest], self.values[longest])


def touchdown_height(axes: Sequence[Series | None], stamps: Stamps, lever_arm: Vector3) -> Array:
    """
    Height of the touchdown point above its rest from measured or true motion.

    Parameters
    ----------
    axes : sequence of 3 Series or None
        Roll, pitch (rad, REP-103), heave (m, up); an axis that never came counts as 0.
    stamps : ndarray of int64, shape (n,)
        When (ns).
    lever_arm : tuple of 3 float
        The point in ship axes (m).

    Returns
    -------
    ndarray, shape (n,)
        Metres; NaN where an axis has a gap.

    """
    roll, pitch, heave = (
        np.zeros(len(stamps)) if axis is None else axis.at(stamps) for axis in axes)
    return np.asarray(turned_arm(roll, pitch, lever_arm)[0][:, 2] + heave - lever_arm[2])


@dataclass(frozen=True, eq=False)
class Comparison:
    """
    Forecasts of one horizon beside what came, on the same instants for every figure.

    Attributes
    ----------
    horizon : float
        Seconds ahead.
    issued_at, valid_at : ndarray of int64, shape (n,)
        Nanoseconds.
    mean, sd : ndarray, shape (n,)
        Forecast and its standard deviation; NaN or 0 = the forecast states none.
    came : ndarray, shape (n,)
        What came, true or measured, at ``valid_at``.
    was : ndarray, shape (n,)
        What was measured at ``issued_at``: the forecast "it stays as it is".

    """

    horizon: float
    issued_at: Stamps
    valid_at: Stamps
    mean: Array
    sd: Array
    came: Array
    was: Array

    def __len__(self) -> int:
        return len(self.valid_at)

    def where(self, chosen: NDArray[np.bool_]) -> Comparison:
        """Return the part that a mask chooses."""
        arrays: dict[str, Any] = {item.name: getattr(self, item.name)[chosen]
                                  for item in fields(self) if item.name != 'horizon'}
        return replace(self, **arrays)

    def issued_from(self, stamp: int) -> Comparison:
        """Leave out the forecasts issued before ``stamp`` (ns): the warm-up."""
        return self.where(self.issued_at >= stamp)

    @property
    def error(self) -> Array:
        """Forecast minus what came."""
        return self.mean - self.came

    @property
    def rmse(self) -> float:
        """Root mean square error of the forecast."""
        return rms(self.error)

    @property
    def bias(self) -> float:
        """Mean error of the forecast."""
        return float(np.mean(self.error)) if len(self) else np.nan

    @property
    def persistence(self) -> float:
        """Root mean square error of "it stays as it is"."""
        return rms(self.was - self.came)

    @property
    def zero(self) -> float:
        """Root mean square error of "it is at rest": what came, about 0."""
        return rms(self.came)

    @property
    def motion(self) -> float:
        """Standard deviation of what came: the error of the best constant."""
        return float(np.std(self.came)) if len(self) else np.nan

    @property
    def share(self) -> float:
        """Error as a share of the motion; NaN where nothing moved."""
        return self.rmse / self.motion if self.motion > 0 else np.nan

    @cached_property
    def normalised(self) -> Array:
        """Errors over their stated sd, where one is stated; standard normal if it is honest."""
        stated = self.sd > 0
        return np.asarray(self.error[stated] / self.sd[stated])

    @property
    def nis(self) -> float:
        """Mean square of the normalised error: 1 if the sd is honest, above if too small."""
        return rms(self.normalised)**2

    def coverage(self, probability: float) -> float:
        """
        Share of what came inside the central interval of that probability.

        Raises
        ------
        ValueError
            If the probability is not between 0 and 1.

        """
        if not 0 < probability < 1:
            raise ValueError(f'a probability lies between 0 and 1, not {probability!r}')
        if not len(self.normalised):
            return np.nan
        return float(np.mean(np.abs(self.normalised) <= ndtri((1 + probability) / 2)))


def compared(horizon: float, issued_at: Stamps, valid_at: Stamps, mean: Array, sd: Array,
             came: Callable[[Stamps], Array], measured: Callable[[Stamps], Array]) -> Comparison:
    """
    Set forecasts beside what came, where it is known what came and what was measured.

    Parameters
    ----------
    horizon, issued_at, valid_at, mean, sd
        As in :class:`Comparison`.
    came, measured : callable
        Value at stamps (ns), NaN where unknown: the yardstick, and what a crew saw.

    """
    everything = Comparison(horizon, issued_at, valid_at, np.asarray(mean, float),
                            np.asarray(sd, float), came(valid_at), measured(issued_at))
    return everything.where(np.isfinite(everything.mean) & np.isfinite(everything.came)
                            & np.isfinite(everything.was))


def rms(values: Array) -> float:
    """
    Root mean square; NaN for no values.

    >>> rms(np.array([1.0, 7.0]))
    5.0
    """
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


@dataclass(frozen=True)
class MotionStatistics:
    """
    One motion in figures, in its own unit.

    Attributes
    ----------
    mean, sd, low, high : float
        Over all samples.
    significant : float
        4 sd: the significant height of heave, the significant double amplitude of an angle.
    zero_crossing_period, peak_period : float
        Seconds; NaN where the record is too short.

    """

    mean: float
    sd: float
    low: float
    high: float
    significant: float
    zero_crossing_period: float
    peak_period: float


def motion_statistics(series: Series) -> MotionStatistics:
    """
    Sum up one motion.

    Raises
    ------
    ValueError
        If the series is empty.

    """
    if not len(series):
        raise ValueError('no motion to sum up')
    values = series.values
    sd = float(np.std(values))
    frequency, density = spectrum(series)
    peak = frequency[np.argmax(density)] if density.any() else 0.0
    return MotionStatistics(float(np.mean(values)), sd, float(np.min(values)),
                            float(np.max(values)), 4 * sd, zero_crossing_period(series),
                            float(1 / peak) if peak else np.nan)


def zero_crossing_period(series: Series, threshold: float = 0.2) -> float:
    """
    Mean time between up-crossings of the mean (s); NaN with fewer than two in a run.

    An up-crossing is a way from below ``-threshold`` sd to above it, so that sensor noise on the
    way through is not counted as waves.
    """
    level = series.values - np.mean(series.values) if len(series) else series.values
    bar = threshold * np.std(level) if len(series) else 0.0
    total, waves = 0.0, 0
    for piece in series.runs if len(series) else ():
        crossings = series.times[piece][_up_crossings(level[piece], float(bar))]
        if len(crossings) > 1:
            total += crossings[-1] - crossings[0]
            waves += len(crossings) - 1
    return total / waves if waves else np.nan


def _up_crossings(level: Array, bar: float) -> NDArray[np.intp]:
    outside = np.flatnonzero(np.abs(level) > bar)
    above = level[outside] > 0
    return outside[1:][above[1:] & ~above[:-1]]


def spectrum(series: Series) -> tuple[Array, Array]:
    """
    Welch's estimate of the one-sided spectral density, from the longest run without a gap.

    Hann windows of a quarter of the run, but 60 to 300 s, half overlapping, mean removed; uneven
    samples are first interpolated to their median period.

    Returns
    -------
    frequency, density : ndarray
        Hz, unit^2/Hz: the area below is the variance. Empty for fewer than 16 samples.

    """
    run = series.longest_run()
    if len(run) < 16:
        return np.empty(0), np.empty(0)
    step = run.period
    count = int(run.times[-1] / step) + 1
    values = run.at(run.stamps[0] + np.round(np.arange(count) * step * NANOSECONDS).astype(int))
    values = values[np.isfinite(values)]
    length = min(len(values), round(min(max(run.times[-1] / 4, 60.0), 300.0) / step))
    frequency, density = welch(values, 1 / step, nperseg=length, detrend='constant')
    return frequency, density


@dataclass(frozen=True)
class Regularity:
    """
    How evenly the stamps of one topic came.

    Attributes
    ----------
    count : int
        Messages.
    first, last : int
        Oldest and newest stamp (ns); 0 without any.
    rate : float
        One over the mean step that is no gap (Hz); NaN for fewer than two stamps.
    gaps : tuple of (int, float)
        Stamp (ns) before each gap, and its length (s). A gap is a step above 2.5 times the step
        that nine of ten do not exceed: what comes in bursts has no gap between two of them.
    duplicates, backwards : int
        Stamps equal to, and older than, the newest before them.

    """

    count: int
    first: int
    last: int
    rate: float
    gaps: tuple[tuple[int, float], ...]
    duplicates: int
    backwards: int


def regularity(stamps: Sequence[int] | Stamps) -> Regularity:
    """Look at the stamps of one topic (ns), in the order in which they came."""
    when = np.asarray(stamps, np.int64)
    newest = np.maximum.accumulate(when)
    ahead = when[1:] - newest[:-1]
    unique = np.unique(when)
    steps = np.diff(unique)
    usual = float(np.quantile(steps, 0.9, method='lower')) if len(steps) else np.nan
    late = np.flatnonzero(steps > 2.5 * usual)
    mean = float(np.mean(np.delete(steps, late))) if len(steps) else np.nan
    first, last = (int(unique[0]), int(unique[-1])) if len(unique) else (0, 0)
    return Regularity(len(when), first, last, NANOSECONDS / mean,
                      tuple((int(unique[i]), float(steps[i] / NANOSECONDS)) for i in late),
                      int(np.sum(ahead == 0)), int(np.sum(ahead < 0)))


def crests(series: Series) -> Array:
    """
    Find the time of each wave's crest: one between two up-crossings of the mean.

    Returns
    -------
    ndarray
        Seconds since the first stamp; each from a parabola through a second to either side of the
        maximum, so that noise does not move it.

    """
    return np.array(list(_crests(series.longest_run(), series))) if len(series) else np.empty(0)


def _crests(run: Series, whole: Series) -> Iterator[float]:
    offset = float((run.stamps[0] - whole.stamps[0]) / NANOSECONDS)
    level = run.values - np.mean(run.values)
    starts = _up_crossings(level, 0.2 * float(np.std(level)))
    for a, b in pairwise(starts.tolist()):
        top = run.times[a + int(np.argmax(level[a:b]))]
        near = np.abs(run.times - top) <= max(1.0, 1.2 * run.period)
        if near.sum() > 2:
            bend, slope, _ = np.polyfit(run.times[near] - top, level[near], 2)
            if bend < 0:
                yield offset + float(top - slope / (2 * bend))


def crest_errors(issued_at: Array, horizons: Array, heights: Array, came: Array,
                 nearest: float = 2.0, farthest: float = 4.0) -> Array:
    """
    Time announced for a crest minus the time of the nearest crest that came.

    Parameters
    ----------
    issued_at : ndarray, shape (n,)
        Seconds on the clock of ``came``.
    horizons : ndarray, shape (m,)
        Seconds ahead, evenly spaced.
    heights : ndarray, shape (n, m)
        Forecasts.
    came : ndarray, shape (k,)
        Times of crests (s), increasing.
    nearest, farthest : float
        Only crests announced so far ahead (s).

    Returns
    -------
    ndarray
        Seconds, one for each crest announced within the span of ``came``.

    """
    before, top, after = heights[:, :-2], heights[:, 1:-1], heights[:, 2:]
    ahead = horizons[1:-1]
    peaks = (top > before) & (top >= after) & (ahead >= nearest) & (ahead <= farthest)
    rows, columns = np.nonzero(peaks)
    shift = 0.5 * (before - after)[peaks] / (before - 2 * top + after)[peaks]
    announced = issued_at[rows] + ahead[columns] + shift * (horizons[1] - horizons[0])
    if len(came) < 2:
        return np.empty(0)
    announced = announced[(announced >= came[0]) & (announced <= came[-1])]
    right = np.clip(np.searchsorted(came, announced), 1, len(came) - 1)
    middle = (came[right - 1] + came[right]) / 2
    return np.asarray(announced - np.where(announced < middle, came[right - 1], came[right]))

"""The landing window: when the deck will be quiet for long enough, and when it crests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, isnan, nan, pi, radians
from typing import Protocol

import numpy as np

from deck_motion_ros.samples import (
    Array,
    GO,
    LandingWindow,
    NANOSECONDS,
    NO_GO,
    TouchdownForecast,
    WAIT,
)

TIMES: Array = np.linspace(0.0, 10.0, 41)  # s ahead, for which a forecast is asked


@dataclass(frozen=True, slots=True)
class Limits:
    """
    What a landing bears, either way of rest.

    Attributes
    ----------
    height, rate : float
        Of the touchdown point (m, m/s up or down).
    roll, pitch : float
        Of the deck (rad).

    """

    height: float
    rate: float
    roll: float
    pitch: float


PRESETS = {
    # significant single amplitudes, twice the RMS criteria for helicopters of STANAG 4154: roll
    # 2.5 deg, pitch 1.5 deg, vertical velocity 1 m/s, displacement 1.25 m; from memory, not
    # verified against the standard
    'helicopter': Limits(2.5, 2.0, radians(5.0), radians(3.0)),
    # a multicopter of some kilograms; ours, no published source
    'drone': Limits(1.5, 0.75, radians(4.0), radians(2.5)),
}


def chosen_limits(preset: str, height: float = nan, rate: float = nan, roll: float = nan,
                  pitch: float = nan) -> Limits:
    """
    Return the limits of a preset, or others where they are not NaN.

    >>> chosen_limits('helicopter', rate=1.5).rate
    1.5
    """
    given = {'height': height, 'rate': rate, 'roll': roll, 'pitch': pitch}
    return replace(PRESETS[preset],
                   **{name: value for name, value in given.items() if not isnan(value)})


class Prediction(Protocol):
    """What a forecast is asked of."""

    @property
    def issued_at(self) -> int:
        """Stamp of the newest measurement (ns)."""

    def forecast(self, horizons: Array) -> TouchdownForecast:
        """Predict the touchdown point ``horizons`` seconds ahead."""


class Lookout:
    """
    Judge predictions now and then: the first in each period of stamp time.

    Parameters
    ----------
    limits : Limits
        What must not be exceeded.
    duration, confidence : float
        See :func:`landing_window`.
    rate : float
        Periods per second.

    """

    def __init__(self, limits: Limits, duration: float, confidence: float, rate: float) -> None:
        self._limits, self._duration, self._confidence = limits, duration, confidence
        self._period = round(NANOSECONDS / rate)
        self._newest: int | None = None

    def update(self, prediction: Prediction) -> LandingWindow | None:
        """Judge a prediction if it is the first of its period."""
        number = prediction.issued_at // self._period
        if number == self._newest:
            return None
        self._newest = number
        return landing_window(prediction.forecast(TIMES), self._limits, self._duration,
                              self._confidence)


def landing_window(forecast: TouchdownForecast, limits: Limits, duration: float = 5.0,
                   confidence: float = 0.9) -> LandingWindow:
    """
    Judge a forecast.

    Parameters
    ----------
    forecast : TouchdownForecast
        At evenly spaced times from 0 on, such as ``TIMES``.
    limits : Limits
        What must not be exceeded.
    duration : float
        Of a window (s), rounded up to the forecast's step; at most its length.
    confidence : float
        Probability from which on the state is ``go``.

    """
    quiet = quiet_probability(forecast, limits, duration)
    starts = forecast.horizons
    state, seconds = NO_GO, nan
    likely = np.flatnonzero(quiet[1:] >= 0.5)
    if quiet[0] >= confidence:
        doubtful = np.flatnonzero(quiet < confidence)
        state, seconds = GO, starts[(doubtful[0] if len(doubtful) else len(quiet)) - 1]
    elif len(likely):
        state, seconds = WAIT, starts[1 + likely[0]]
    return LandingWindow(forecast.issued_at, state, float(seconds), float(quiet[0]),
                         *next_crest(forecast), *next_crest(forecast, -1))


def next_crest(forecast: TouchdownForecast, side: int = 1) -> tuple[float, float]:
    """
    Find where the forecast's vertical rate next falls through zero.

    To first order the time errs by the rate's error over the curvature there.

    Parameters
    ----------
    forecast : TouchdownForecast
        At evenly spaced times.
    side : int
        1 for the crest, -1 for the trough.

    Returns
    -------
    time, sd : float
        Seconds ahead; NaN where there is none.

    """
    rate, times = side * forecast.rate, forecast.horizons
    tops = np.flatnonzero((rate[:-1] > 0) & (rate[1:] <= 0))
    if not len(tops):
        return nan, nan
    k = tops[0]
    step, fall = times[k + 1] - times[k], rate[k] - rate[k + 1]
    time = times[k] + step * rate[k] / fall
    return float(time), float(np.interp(time, times, forecast.rate_sd) * step / fall)


def quiet_probability(forecast: TouchdownForecast, limits: Limits, duration: float) -> Array:
    """
    Probability that the deck stays within limits throughout a window.

    It is the share of possible courses, forecast plus or minus one of ``PAIRS`` errors, that do.
    The errors of height, roll and pitch count as independent of each other.

    Parameters
    ----------
    forecast : TouchdownForecast
        At evenly spaced times from 0 on.
    limits : Limits
        What must not be exceeded.
    duration : float
        Of the window (s), rounded up to the forecast's step; at most its length.

    Returns
    -------
    ndarray, shape (starts,)
        For a window that begins at each of the forecast's times, as far as it ends within it.

    """
    motion, times = forecast.motion, forecast.horizons
    mean = np.column_stack([forecast.height, motion.mean[:, :2]])
    sd = np.column_stack([forecast.height_sd, _sd(motion.cov)]) + LEAST
    rate_sd = np.column_stack([forecast.rate_sd, _sd(motion.rate_cov)])
    error, rate_error = possible_errors(times, sd, rate_sd)
    either = np.array([limits.height, limits.roll, limits.pitch])
    # minus an error is plus it in the mirror: with the forecast upside down
    low, high = ((side * either - mean * MIRROR) / sd for side in (-1, 1))
    quiet = ((error >= low[..., None]) & (error <= high[..., None])).all(axis=2)
    quiet &= np.abs(forecast.rate[:, None] * MIRROR + rate_error) <= limits.rate
    count = ceil(duration / (times[1] - times[0]) - 1e-9) + 1
    total = np.zeros((2, len(times) + 1, PAIRS), np.int16)
    np.cumsum(quiet, axis=1, out=total[:, 1:])
    return np.asarray((total[:, count:] - total[:, :-count] == count).mean(axis=(0, 2)))


def _sd(cov: Array) -> Array:
    """Return the sd of roll and pitch, shape (n, 2)."""
    return np.asarray(np.sqrt(np.einsum('nii->ni', cov)[:, :2]))


def possible_errors(times: Array, sd: Array, rate_sd: Array) -> tuple[Array, Array]:
    """
    Draw possible courses of a forecast's error from its sd and the sd of its rate alone.

    Write the error as e = sd(t) u(t). As u keeps its variance of 1, it is not correlated with its
    own rate, so rate_sd^2 = sd'^2 + sd^2 w^2 with w^2 the variance of u'. Over the phase s, the
    integral of w, the rate of u has a variance of 1 all along; there u is taken for stationary,
    with the correlation of a narrow band, exp(-BAND s^2 / 2) cos((1 - BAND)^1/2 s). The errors of
    forecasts of simulated ships have it.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Seconds ahead, evenly spaced.
    sd, rate_sd : ndarray, shape (n, 3)
        Of height, roll, pitch; sd above 0.

    Returns
    -------
    u : ndarray, shape (n, 3, PAIRS)
        Of height, roll, pitch; as many again are the same with the other sign.
    rate : ndarray, shape (n, PAIRS)
        Of the height's error e (m/s).

    """
    growth = np.gradient(sd, times[1] - times[0], axis=0)
    swing = np.sqrt(np.maximum(np.square(rate_sd) - np.square(growth), 0.0))
    pace = swing / sd
    phase = np.zeros_like(sd)
    np.cumsum((pace[1:] + pace[:-1]) * (times[1] - times[0]) / 2, axis=0, out=phase[1:])
    at = np.rint(phase / SPACING).astype(int) % len(_UNIT)
    error = _UNIT[at, np.arange(3)]
    return error, growth[:, :1] * error[:, 0] + swing[:, :1] * _UNIT_RATE[at[:, 0]]


LEAST = 1e-9  # m, rad: no sd is smaller
PAIRS = 128  # of courses of opposite sign
MIRROR = np.array([1.0, -1.0])[:, None, None]
BAND = 0.06
PERIOD = 10 * pi  # of the phase, after which the unit paths repeat
SPACING = PERIOD / 640


def _unit_paths() -> tuple[Array, Array]:
    """
    Make the unit paths, which are the same for ever.

    With those of opposite sign the mean over all paths is 0, and as the coefficients are
    orthogonal, their covariance exactly the one of the band.

    Returns
    -------
    value : ndarray, shape (phases, 3, PAIRS)
    rate : ndarray, shape (phases, PAIRS)
        Of the first of the three, by the phase.

    """
    tone = 2 * pi / PERIOD * np.arange(1, 10)
    power = np.exp(-np.square(tone - np.sqrt(1 - BAND)) / (2 * BAND))
    size = np.tile(np.sqrt(power / power.sum()), 2)
    draws = np.random.RandomState(1).standard_normal((PAIRS, 3 * len(size)))
    unit = np.sqrt(PAIRS) * np.linalg.qr(draws)[0].T.reshape(3, len(size), -1)
    weights = size[:, None] * unit
    angle = np.outer(np.arange(round(PERIOD / SPACING)) * SPACING, tone)
    cos, sin = np.cos(angle), np.sin(angle)
    value = np.hstack([cos, sin]) @ weights
    rate = np.hstack([-tone * sin, tone * cos]) @ weights[0]
    return np.ascontiguousarray(value.transpose(1, 0, 2)), rate


_UNIT, _UNIT_RATE = _unit_paths()

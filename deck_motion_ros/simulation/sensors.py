"""Sensors: noise, drift, bias and resolution of each axis; lateness and losses of each stream."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

from deck_motion_ros.samples import nanoseconds


@dataclass(frozen=True, slots=True)
class AxisErrors:
    """
    The errors of one axis, in its own unit.

    Attributes
    ----------
    white_sd : float
        New at every sample.
    drift_sd, drift_time : float
        Stationary Gauss-Markov drift: sd and correlation time (s).
    bias : float
        Constant.
    resolution : float
        Step of the quantisation; 0 = none.

    """

    white_sd: float = 0.0
    drift_sd: float = 0.0
    drift_time: float = 100.0
    bias: float = 0.0
    resolution: float = 0.0

    @property
    def var(self) -> float:
        """Variance of the error about the bias."""
        return self.white_sd**2 + self.drift_sd**2 + self.resolution**2 / 12


class AxisSensor:
    """
    One axis of a sensor.

    Parameters
    ----------
    errors : AxisErrors
        What is wrong with it.
    rng : numpy.random.Generator
        Two numbers are drawn from it at the start and at every sample.

    """

    __slots__ = ('_errors', '_normal', '_drift', '_time')

    def __init__(self, errors: AxisErrors, rng: np.random.Generator) -> None:
        self._errors = errors
        self._normal = rng.standard_normal
        self._drift = errors.drift_sd * self._normal()
        self._time: float | None = None

    def measure(self, value: float, time: float) -> float:
        """Return the reading of ``value`` at ``time`` (s), not before the one before."""
        errors = self._errors
        if self._time is not None:
            keep = exp((self._time - time) / errors.drift_time)
            self._drift = (keep * self._drift
                           + errors.drift_sd * sqrt(1 - keep * keep) * self._normal())
        self._time = time
        reading = value + errors.bias + self._drift + errors.white_sd * self._normal()
        if errors.resolution > 0:
            reading = errors.resolution * round(reading / errors.resolution)
        return reading


@dataclass(frozen=True, slots=True)
class Delivery:
    """
    How the samples of one stream come to the user.

    Attributes
    ----------
    latency : float
        The stamp is this much later than the instant measured (s): data older than they say.
    jitter : float
        Standard deviation of the stamp about that (s); at most 0.4 of the period either way.
    delay : float
        The message arrives this long after its stamp (s).
    dropout : float
        Probability that a message is lost.

    """

    latency: float = 0.0
    jitter: float = 0.0
    delay: float = 0.0
    dropout: float = 0.0

    def deliver(self, instant: int, period: float,
                rng: np.random.Generator) -> tuple[int, int] | None:
        """
        Stamp a sample.

        Parameters
        ----------
        instant : int
            When it was measured (ns).
        period : float
            Of the stream (s).
        rng : numpy.random.Generator
            Two numbers are drawn from it.

        Returns
        -------
        tuple of 2 int or None
            Stamp and time of arrival (ns), neither of them out of order; ``None``: lost.

        """
        bound = 0.4 * period
        jitter = max(-bound, min(bound, self.jitter * rng.standard_normal()))
        lost = rng.random() < self.dropout
        stamp = instant + nanoseconds(self.latency + jitter)
        return None if lost else (stamp, max(instant, stamp) + nanoseconds(self.delay))

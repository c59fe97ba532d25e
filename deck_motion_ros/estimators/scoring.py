"""Forecast against what came, as it comes."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from math import isnan, nan, sqrt


@dataclass(frozen=True, slots=True)
class Score:
    """
    How good the recent forecasts were.

    Attributes
    ----------
    number : int
        Forecasts that have come true.
    rmse, persistence_rmse : float
        Of the forecast, and of saying "it stays as it is" (m); NaN without forecasts.
    coverage : float
        Share of the 95 % intervals that held; NaN without forecasts.

    """

    number: int
    rmse: float
    persistence_rmse: float
    coverage: float


class RunningScore:
    """
    Score forecasts of a height with the heights that come.

    Parameters
    ----------
    window : float
        Seconds that count.

    """

    def __init__(self, window: float = 60.0) -> None:
        self._window = window
        self._times: list[float] = []
        self._heights: list[float] = []
        self._open: deque[tuple[float, float, float, float]] = deque()
        self._errors: deque[tuple[float, float, float, float]] = deque()

    def came(self, time: float, height: float) -> None:
        """Take the height (m) at ``time`` (s); times must grow, others are left out."""
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        self._heights.append(height)
        while self._open and self._open[0][0] <= time:
            valid, mean, sd, issued = self._open.popleft()
            then, before = self._at(valid), self._at(issued)
            if not (isnan(then) or isnan(before)):
                self._errors.append((valid, mean - then, before - then, sd))
        while self._errors and self._errors[0][0] < time - self._window:
            self._errors.popleft()
        if len(self._times) > 2 and self._times[len(self._times) // 2] < time - 2 * self._window:
            half = len(self._times) // 2
            del self._times[:half], self._heights[:half]

    def forecast(self, issued: float, valid: float, mean: float, sd: float) -> None:
        """Take a forecast (m) made at ``issued`` for ``valid`` (s)."""
        self._open.append((valid, mean, sd, issued))

    def score(self) -> Score:
        """Score the forecasts that came true in the window."""
        n = len(self._errors)
        if not n:
            return Score(0, nan, nan, nan)
        return Score(n, sqrt(sum(error**2 for _, error, _, _ in self._errors) / n),
                     sqrt(sum(stay**2 for _, _, stay, _ in self._errors) / n),
                     sum(abs(error) <= 1.96 * sd for _, error, _, sd in self._errors) / n)

    def _at(self, time: float) -> float:
        """Interpolate the height at ``time``; NaN outside and in gaps of over 2 s."""
        k = bisect_left(self._times, time)
        if k == len(self._times) or (k == 0 and self._times[0] != time):
            return nan
        if self._times[k] == time:
            return self._heights[k]
        left, right = self._times[k - 1], self._times[k]
        if right - left > 2.0:
            return nan
        share = (time - left) / (right - left)
        return self._heights[k - 1] * (1 - share) + self._heights[k] * share

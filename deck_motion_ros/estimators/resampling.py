"""Uneven, gappy samples of several axes at any rate in, one even series of slots out."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf

import numpy as np

from deck_motion_ros.samples import Array


@dataclass(frozen=True, slots=True)
class Grid:
    """
    How time is divided.

    Attributes
    ----------
    tick : float
        Seconds between the instants at which a new past is ready.
    ticks : int
        In one slot. With 1, a slot is the value at its instant; with more, the mean over the
        slot that ends there.
    slack : float
        Seconds by which an instant may come early to meet a stamp.

    """

    tick: float
    ticks: int
    slack: float

    @property
    def step(self) -> float:
        """Length of a slot (s)."""
        return self.tick * self.ticks

    @property
    def age(self) -> float:
        """How long before its instant the middle of a slot lies (s)."""
        return self.step / 2 if self.ticks > 1 else 0.0

    @classmethod
    def of_period(cls, period: float) -> Grid:
        """
        Choose slots of about 0.5 s for samples every ``period`` seconds, or one for each sample.

        >>> Grid.of_period(0.01), Grid.of_period(1.0)
        (Grid(tick=0.1, ticks=5, slack=0.001), Grid(tick=1.0, ticks=1, slack=0.1))
        """
        if period > 0.26:
            return cls(period, 1, period / 10)
        tick = max(period, 0.1)
        return cls(tick, round(0.5 / tick), period / 10)


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """
    What one instant of the grid brought.

    Attributes
    ----------
    time : float
        The instant (s).
    values : ndarray, shape (m,)
        Mean of each axis over the tick that ends there; the value there if a slot is one tick.
    known : tuple of m bool
        False where the samples around lie too far apart to say.

    """

    time: float
    values: Array
    known: tuple[bool, ...]


class _Axis:
    """The samples of one axis that the grid has not passed yet, and the last it has."""

    def __init__(self) -> None:
        self.samples: deque[tuple[float, float]] = deque()
        self.newest = -inf

    def add(self, time: float, value: float) -> None:
        if time > self.newest:
            self.samples.append((time, value))
            self.newest = time

    def pass_to(self, start: float, end: float, mean: bool) -> tuple[float, float]:
        """Interpolate linearly; return mean over (start, end) or value at end, and widest gap."""
        samples = self.samples
        total, gap, at = 0.0, 0.0, start
        left, value = samples[0]
        while at < end:
            if len(samples) == 1 or left > end:  # nothing on the other side: hold
                total += value * (end - at)
                gap = max(gap, abs(end - left))
                break
            right, later = samples[1]
            slope = (later - value) / (right - left)
            upto = right if right < end else end
            if upto > at:
                total += (value + slope * ((at + upto) / 2 - left)) * (upto - at)
                gap = max(gap, right - left)
                at = upto
            if right > end:
                value += slope * (end - left)
                break
            samples.popleft()
            left, value = right, later
        return (total / (end - start) if mean else value), gap


class Resampler:
    """
    Bring the samples of several axes to one grid, locked to the newest stamps.

    Between samples the signal is a straight line. An instant is passed once every axis that still
    comes has reached it; the grid follows slow drifts of the sampling clock.

    Parameters
    ----------
    grid : Grid
    axes : int
        Number of axes.
    start : float
        First instant (s).

    """

    LATE = 0.02  # share of a tick by which an instant may be put off to meet a stamp

    def __init__(self, grid: Grid, axes: int, start: float) -> None:
        self.grid, self.time = grid, start
        self._axes = [_Axis() for _ in range(axes)]
        self._patience = 2.5 * max(grid.step, 0.5)
        self._widest = 1.7 * grid.step

    def add(self, axis: int, time: float, value: float) -> list[Tick]:
        """Take a sample; return the instants that are complete now, the oldest first."""
        self._axes[axis].add(time, value)
        if time - self.time - self.grid.tick < -self.grid.slack:  # no axis makes it complete
            return []
        came = [item.newest for item in self._axes]
        newest, ready = max(came), min(came)
        if ready < newest - self._patience:
            ready = min(when for when in came if when >= newest - self._patience)
        tick, made = self.grid.tick, []
        while (late := ready - self.time - tick) >= -self.grid.slack:
            end = self.time + tick + min(late, self.LATE * tick)
            made.append(self._passed(end))
            self.time = end
        return made

    def _passed(self, end: float) -> Tick:
        mean = self.grid.ticks > 1
        values, gaps = zip(*(axis.pass_to(self.time, end, mean) if axis.samples else (0.0, inf)
                             for axis in self._axes), strict=True)
        return Tick(end, np.array(values), tuple(gap <= self._widest for gap in gaps))

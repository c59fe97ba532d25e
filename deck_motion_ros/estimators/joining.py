"""Streams asked for at the stamps of another: exact, or interpolated between two samples."""

from __future__ import annotations

from collections import deque

import numpy as np

from deck_motion_ros.samples import Array, NANOSECONDS


class Interpolated:
    """
    The newest samples of a stream, as arrays.

    Parameters
    ----------
    max_gap : float
        Between samples further apart than this nothing is known (s).
    size : int
        Samples that are kept at most.

    """

    def __init__(self, max_gap: float, size: int = 4000) -> None:
        self._max_gap = round(max_gap * NANOSECONDS)
        self._stamps: deque[int] = deque(maxlen=size)
        self._values: deque[Array] = deque(maxlen=size)

    @property
    def newest(self) -> int | None:
        """Stamp of the newest sample (ns)."""
        return self._stamps[-1] if self._stamps else None

    @property
    def value(self) -> Array | None:
        """The newest sample."""
        return self._values[-1] if self._values else None

    @property
    def spacing(self) -> float:
        """Time between the newest two samples (s); 0 before there are two."""
        return (self._stamps[-1] - self._stamps[-2]) / NANOSECONDS if (
            len(self._stamps) > 1) else 0.0

    def add(self, stamp: int, value: Array) -> None:
        """Take a sample newer than all before."""
        self._stamps.append(stamp)
        self._values.append(value)

    def covers(self, stamp: int) -> bool:
        """Say whether no sample still to come matters for ``stamp`` (ns)."""
        return bool(self._stamps) and self._stamps[-1] >= stamp

    def at(self, stamp: int) -> Array | None:
        """
        Return the value at a stamp that is covered; stamps asked for must rise.

        Returns
        -------
        ndarray or None
            None before the first sample and within a gap.

        """
        stamps, values = self._stamps, self._values
        while len(stamps) > 1 and stamps[1] <= stamp:
            stamps.popleft()
            values.popleft()
        if stamps[0] == stamp:
            return values[0]
        if stamps[0] > stamp or stamps[1] - stamps[0] > self._max_gap:
            return None
        share = (stamp - stamps[0]) / (stamps[1] - stamps[0])
        return np.asarray(values[0] + share * (values[1] - values[0]))

"""A figure, what it is compared with, and how two things are timed side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import gc
from time import process_time
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Figure:
    """
    One measured figure.

    Attributes
    ----------
    bench, name : str
        The bench and the figure in it.
    value, unit
        Ours; of something measured several times the median.
    reference : str or None
        What it is compared with; without a ``reference_value`` that was not there to measure.
    reference_value, ratio : float or None
        Its figure, in the same unit, and the median of ours / its in each round.
    spread : tuple of 2 float or None
        Quartiles of the ratio over the rounds.
    goal : str
        Such as ``>= 30`` or ``93 to 97``: of the ratio where there is a reference, else of the
        value.
    headline : bool
        Printed; otherwise it is in the file only.

    """

    bench: str
    name: str
    value: float
    unit: str
    reference: str | None = None
    reference_value: float | None = None
    ratio: float | None = None
    spread: tuple[float, float] | None = None
    goal: str = ''
    headline: bool = True

    def as_dict(self) -> dict[str, Any]:
        """Return the figure as ``deck_motion bench --json`` writes it."""
        names = ('bench', 'name', 'value', 'unit', 'reference', 'reference_value', 'ratio')
        return {name: getattr(self, name) for name in names}

    @property
    def met(self) -> bool | None:
        """
        Say whether the goal is met; ``None`` if there is none or nothing to compare with.

        >>> Figure('memory', 'growth', 4.0, 'MB', goal='<= 5').met
        True
        """
        judged = self.value if self.reference is None else self.ratio
        if not self.goal or judged is None:
            return None
        if ' to ' in self.goal:
            low, high = map(float, self.goal.split(' to '))
            return low <= judged <= high
        sign, bound = self.goal.split()
        return judged >= float(bound) if sign == '>=' else judged <= float(bound)


def compared(bench: str, name: str, unit: str, ours: Sequence[float], reference: str,
             theirs: Sequence[float], goal: str = '') -> Figure:
    """
    Make a figure of rounds that were measured in turn, ours and theirs.

    Without any of theirs (the peer is not installed) there is no ratio.
    """
    if not theirs:
        return Figure(bench, name, float(np.median(ours)), unit, reference, goal=goal)
    low, ratio, high = np.percentile(np.divide(ours, theirs), [25, 50, 75]).tolist()
    return Figure(bench, name, float(np.median(ours)), unit, reference,
                  float(np.median(theirs)), ratio, (low, high), goal)


def alternated(rounds: int, *tasks: Callable[[], object]) -> list[list[float]]:
    """
    Time tasks in turn, A B A B, so that what slows the machine slows them alike.

    Returns
    -------
    list of list of float
        For each task the CPU seconds of this process in each round, so that other programs do
        not count. The garbage of one task is collected before the next.

    """
    times: list[list[float]] = [[] for _ in tasks]
    for _ in range(rounds):
        for task, seconds in zip(tasks, times, strict=True):
            gc.collect()
            start = process_time()
            task()
            seconds.append(process_time() - start)
    return times

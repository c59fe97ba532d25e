"""Which sea state it is: a ladder of them, judged by the waves the filter finds."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log, sqrt

import numpy as np

from deck_motion_ros.estimators.encounter import EncounterSea, wave_model, WaveModel

HIGHEST, LOWEST = 16.0, 0.25  # m: significant height of the ladder's ends
FIRST = 7.5  # m: begin in a sea at least as high: to believe it too low costs most
STEP = sqrt(2.0)  # from one height to the next
RARER = 0.1  # probability of a sea above the first, from one height to the next
DOWN, UP = 0.05, 0.3  # go down if a higher sea is less probable than this, up if it is more so
MEMORY = 120.0  # s


class SeaBelief:
    """
    The probability of each sea state of a ladder, steepness alike.

    What tells them apart is the mean square of the elevation, over as many independent values as
    the time seen has correlation times: a scaled chi-square. The level in use is one that is
    hardly exceeded, for waves believed too low pass for motion, and waves believed too high only
    cost patience; it begins high and goes down as the evidence comes.

    Parameters
    ----------
    sea : EncounterSea
        What the user expects.
    adapt : bool
        False: a ladder of that one sea.

    Attributes
    ----------
    waves : WaveModel
        Of the level in use.

    """

    def __init__(self, sea: EncounterSea, adapt: bool = True) -> None:
        scales = [1.0]
        if adapt:
            down, up = (int(log(end / sea.height) / log(STEP)) for end in (LOWEST, HIGHEST))
            scales = [STEP**k for k in range(min(down, 0), max(up, 0) + 1)]
        expected = wave_model(sea)
        self._models = [wave_model(replace(
            sea, height=sea.height * scale, mean_period=sea.mean_period * sqrt(scale)),
            expected.order) for scale in scales]
        heights = np.array([model.sea.height for model in self._models])
        first = max(sea.height, FIRST) if adapt else sea.height
        self._level = int(np.argmin(np.abs(np.log(heights / first))))
        self._var = heights**2 / 16
        self._prior = log(RARER) * np.maximum(np.arange(len(heights)) - self._level, 0)
        self._correlation_times = [model.sea.correlation_time for model in self._models]
        self._power = self._time = 0.0
        self.waves: WaveModel = self._models[self._level]

    def observe(self, dt: float, power: float) -> None:
        """Take the expected square of the elevation (m^2), ``dt`` seconds after the last one."""
        keep = exp(-dt / MEMORY)
        self._time = self._time * keep + dt
        self._power = self._power * keep + power * dt

    def probabilities(self) -> list[float]:
        """Return the probability of each level, from low to high."""
        half = self._time / self._correlation_times[self._level] / 2
        mean = self._power / self._time if self._time > 0 else 0.0
        likelihood = self._prior - half * (np.log(self._var) + mean / self._var)
        weight = np.exp(likelihood - likelihood.max())
        return list((weight / weight.sum()).tolist())

    def decide(self) -> bool:
        """Choose the level; return whether it is another one now."""
        share, before = self.probabilities(), self._level
        while self._level > 0 and sum(share[self._level:]) < DOWN:
            self._level -= 1
        while sum(share[self._level + 1:]) > UP:
            self._level += 1
        self.waves = self._models[self._level]
        return self._level != before

"""Li2014's ship: roll, pitch and heave each by its own shaping filter, independent."""

from __future__ import annotations

from math import radians, sqrt

import numpy as np

from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.processes import LI2014_HEAVE, LI2014_PITCH, LI2014_ROLL, ShapingFilter
from deck_motion_ros.samples import Array
from deck_motion_ros.simulation.states import State


class ShapedAxis:
    """
    One axis driven by white noise through a shaping filter, exact for any step.

    Parameters
    ----------
    process : ShapingFilter
        The filter; the axis has its unit.
    rng : numpy.random.Generator
        Two numbers are drawn from it at the start (the stationary state) and at every step.

    """

    def __init__(self, process: ShapingFilter, rng: np.random.Generator) -> None:
        self._process, self._normal = process, rng.standard_normal
        self._x1, self._x2 = self._draw(process.stationary)

    @property
    def value(self) -> float:
        """The output."""
        return self._x1

    def advance(self, dt: float) -> float:
        """Go on by ``dt`` (s); return the mean rate over it (at an instant it is infinite)."""
        before = self._x1
        transition = self._process.transition(dt)
        w1, w2 = self._draw(self._process.step_noise(transition))
        f11, f12, f21, f22 = transition
        self._x1, self._x2 = (f11 * self._x1 + f12 * self._x2 + w1,
                              f21 * self._x1 + f22 * self._x2 + w2)
        return (self._x1 - before) / dt

    def _draw(self, cov: tuple[float, float, float]) -> tuple[float, float]:
        c11, c12, c22 = cov
        n1, n2 = self._normal(), self._normal()
        root = sqrt(c11)
        return (root * n1, c12 / root * n1 + sqrt(max(c22 - c12 * c12 / c11, 0.0)) * n2)


class ShapingStates:
    """
    The states of Li2014's ship: roll, pitch and heave only, on a straight course.

    Rates are means over the step before; specific force is gravity alone, for the acceleration
    of this motion is infinite.
    """

    def __init__(self, yaw: float, start: float, rng: np.random.Generator) -> None:
        self._axes = [ShapedAxis(process, rng)
                      for process in (LI2014_ROLL, LI2014_PITCH, LI2014_HEAVE)]
        self._yaw, self._time = yaw, start

    def at(self, times: Array) -> list[State]:
        """Return the states at ``times`` (s), rising from call to call."""
        return [self._advance(time) for time in times.tolist()]

    def _advance(self, time: float) -> State:
        dt, self._time = time - self._time, time
        roll_rate, pitch_rate, climb = (
            axis.advance(dt) if dt > 0 else 0.0 for axis in self._axes)
        roll, pitch, heave = (axis.value for axis in self._axes)
        rpy = (radians(roll), radians(pitch), 0.0)
        return State((0.0, 0.0, heave), (0.0, 0.0, climb), rpy,
                     (radians(roll_rate), radians(pitch_rate), 0.0),
                     quaternion_from_rpy(*rpy[:2], self._yaw), (0.0, 0.0, 0.0))

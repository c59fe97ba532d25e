"""The ship's state at single instants, and what an inertial sensor makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import cos, sin
from typing import NamedTuple

from deck_motion_ros.geometry import (
    conjugate,
    multiply,
    normalised,
    quaternion_from_rpy,
    rotated,
    rotation_vector,
)
from deck_motion_ros.samples import Array, Quaternion, Vector3
from deck_motion_ros.simulation.sea import GRAVITY
from deck_motion_ros.simulation.ship import ShipInWaves


class State(NamedTuple):
    """
    The ship at one instant.

    Attributes
    ----------
    position, velocity : tuple of 3 float
        Of the reference point in ``ship_level`` (m, m/s).
    rpy, rates : tuple of 3 float
        Relative to ``ship_level`` (rad, rad/s).
    orientation : tuple of 4 float
        Body to ENU.
    enu_velocity : tuple of 3 float
        The mean course included (m/s).

    """

    position: Vector3
    velocity: Vector3
    rpy: Vector3
    rates: Vector3
    orientation: Quaternion
    enu_velocity: Vector3


class SeaStates:
    """The states of a ship in waves."""

    def __init__(self, ship: ShipInWaves) -> None:
        self._ship = ship

    def at(self, times: Array) -> list[State]:
        """Return the states at ``times`` (s), rising."""
        motion = self._ship.motion(times)
        track = motion.track
        return [self._state(*row) for row in zip(
            motion.value.tolist(), motion.rate.tolist(), track.yaw.tolist(),
            track.yaw_rate.tolist(), track.velocity.tolist(), strict=True)]

    @staticmethod
    def _state(value: list[float], rate: list[float], yaw: float, yaw_rate: float,
               velocity: list[float]) -> State:
        x, y, z, roll, pitch, wave_yaw = value
        by_x, by_y, by_z = rate[:3]
        ahead, aside = by_x - yaw_rate * y, by_y + yaw_rate * x
        east, north = velocity
        c, s = cos(yaw), sin(yaw)
        return State((x, y, z), (by_x, by_y, by_z), (roll, pitch, wave_yaw),
                     (rate[3], rate[4], rate[5]),
                     quaternion_from_rpy(roll, pitch, yaw + wave_yaw),
                     (east + c * ahead - s * aside, north + s * ahead + c * aside, by_z))


def mean_inertial(states: Sequence[State], dt: float) -> tuple[Vector3, Vector3]:
    """
    Average turn rate and specific force in the body's own turning axes.

    Each step's change of velocity is seen from the attitude half way through it.

    Parameters
    ----------
    states : sequence of State
        Evenly spaced, from the start to the end of the interval.
    dt : float
        The spacing (s).

    Returns
    -------
    rate, force : tuple of 3 float
        rad/s, m/s^2 (+g up at rest).

    """
    turns, forces = [], []
    for old, new in pairwise(states):
        (x, y, z, w), (x1, y1, z1, w1) = old.orientation, new.orientation
        sign = 1.0 if x * x1 + y * y1 + z * z1 + w * w1 > 0 else -1.0
        middle = normalised((x + sign * x1, y + sign * y1, z + sign * z1, w + sign * w1))
        (e, n, u), (e1, n1, u1) = old.enu_velocity, new.enu_velocity
        turns.append(rotation_vector(multiply(conjugate(old.orientation), new.orientation)))
        forces.append(rotated(conjugate(middle or old.orientation), (
            (e1 - e) / dt, (n1 - n) / dt, (u1 - u) / dt + GRAVITY)))
    return _total(turns, 1 / (len(turns) * dt)), _total(forces, 1 / len(forces))


def _total(vectors: list[Vector3], scale: float) -> Vector3:
    x, y, z = (scale * sum(parts) for parts in zip(*vectors, strict=True))
    return (x, y, z)

"""The turning Earth: WGS-84 normal gravity and rates in local axes east, north, up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, sin, sqrt, tan

import numpy as np

from deck_motion_ros.samples import Array

RATE = 7.292115e-5  # rad/s
RADIUS = 6378137.0  # m, of the equator
ECCENTRICITY_SQUARED = 6.69437999014e-3
EQUATOR_GRAVITY, POLE_GRAVITY = 9.7803253359, 9.8321849378  # m/s^2


@dataclass(frozen=True)
class Earth:
    """
    The Earth about one place at the height of the sea.

    Parameters
    ----------
    latitude : float
        Geodetic (rad), not a pole.

    """

    latitude: float

    @cached_property
    def gravity(self) -> Array:
        """
        Normal gravity of WGS-84 (Somigliana), shape (3,), m/s^2.

        >>> from math import radians
        >>> Earth(radians(45.0)).gravity.round(5).tolist()
        [0.0, 0.0, -9.8062]
        """
        square = sin(self.latitude)**2
        k = POLE_GRAVITY * sqrt(1 - ECCENTRICITY_SQUARED) / EQUATOR_GRAVITY - 1
        return np.array([0.0, 0.0, -EQUATOR_GRAVITY * (1 + k * square)
                         / sqrt(1 - ECCENTRICITY_SQUARED * square)])

    @cached_property
    def rate(self) -> Array:
        """Turn rate of the Earth, shape (3,), rad/s."""
        return np.array([0.0, RATE * cos(self.latitude), RATE * sin(self.latitude)])

    @cached_property
    def _by_velocity(self) -> Array:
        slimness = 1 - ECCENTRICITY_SQUARED * sin(self.latitude)**2
        normal = RADIUS / sqrt(slimness)
        meridian = normal * (1 - ECCENTRICITY_SQUARED) / slimness
        return np.array([[0.0, 1 / normal, tan(self.latitude) / normal],
                         [-1 / meridian, 0.0, 0.0], [0.0, 0.0, 0.0]])

    def transport_rate(self, vec_v: Array) -> Array:
        """Turn rate of the local axes relative to the Earth at velocity (m/s), shape (..., 3)."""
        return np.asarray(vec_v @ self._by_velocity)

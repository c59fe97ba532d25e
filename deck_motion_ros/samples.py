"""Frozen records that flow through everything: one per kind of measurement or estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w
Array = NDArray[np.float64]

NANOSECONDS = 1_000_000_000

ROLL, PITCH, HEAVE = 0, 1, 2
AXES = ('roll', 'pitch', 'heave')
WINDOW_STATES = GO, WAIT, NO_GO = 'go', 'wait', 'no_go'


class Rejected(ValueError):
    """
    A message that must not be used.

    Parameters
    ----------
    reason : str
        A few words, the same for all messages of that kind: they name a counter on
        ``/diagnostics``.

    """

    @property
    def reason(self) -> str:
        """The name of the counter."""
        return str(self.args[0])


def seconds(stamp: int) -> float:
    """
    Convert a stamp (ns) to float seconds; good to 0.3 us for today's dates.

    >>> seconds(1_500_000_000)
    1.5
    """
    return stamp / NANOSECONDS


def nanoseconds(time: float) -> int:
    """
    Convert float seconds to the nearest integer nanosecond.

    >>> nanoseconds(0.1)
    100000000
    """
    return round(time * NANOSECONDS)


@dataclass(frozen=True, slots=True)
class ImuSample:
    """
    One ``sensor_msgs/Imu``.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    frame_id : str
        Frame of the sensor.
    orientation : tuple of 4 float or None
        Unit quaternion x, y, z, w, body to ENU; ``None`` where the sensor has no attitude.
    attitude_var : tuple of 3 float
        Variances about x, y, z (rad^2); 0 = unknown.
    angular_velocity : tuple of 3 float
        Mean over the interval that ends at the stamp, sensor axes (rad/s).
    specific_force : tuple of 3 float
        Mean over the interval that ends at the stamp, sensor axes, +g up at rest (m/s^2).

    """

    stamp: int
    frame_id: str
    orientation: Quaternion | None
    attitude_var: Vector3
    angular_velocity: Vector3
    specific_force: Vector3


@dataclass(frozen=True, slots=True)
class HeaveSample:
    """Heave of the ship's reference point above its rest: stamp (ns), frame, height (m, up)."""

    stamp: int
    frame_id: str
    height: float


@dataclass(frozen=True, slots=True)
class OdometrySample:
    """
    One ``nav_msgs/Odometry``: a pose in ``frame_id`` and a twist in ``child_frame_id``.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    frame_id, child_frame_id : str
        Frame of the pose, frame of the twist.
    position : tuple of 3 float
        Metres, in ``frame_id``.
    orientation : tuple of 4 float or None
        Unit quaternion x, y, z, w, child to ``frame_id``.
    linear_velocity, angular_velocity : tuple of 3 float
        In the axes of ``child_frame_id`` (m/s, rad/s).
    pose_var : tuple of 6 float
        Variances x, y, z (m^2), about x, y, z (rad^2); 0 = unknown.

    """

    stamp: int
    frame_id: str
    child_frame_id: str
    position: Vector3
    orientation: Quaternion | None
    linear_velocity: Vector3
    angular_velocity: Vector3
    pose_var: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class RangeSample:
    """One ``sensor_msgs/Range``: stamp (ns), frame, distance (m), variance (m^2; 0 = unknown)."""

    stamp: int
    frame_id: str
    distance: float
    var: float


@dataclass(frozen=True, slots=True)
class VelocitySample:
    """
    One ``geometry_msgs/TwistWithCovarianceStamped``, of which the linear part is used.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    frame_id : str
        Frame of the axes.
    velocity : tuple of 3 float
        m/s.
    var : tuple of 3 float
        (m/s)^2; 0 = unknown.

    """

    stamp: int
    frame_id: str
    velocity: Vector3
    var: Vector3


@dataclass(frozen=True, slots=True)
class VectorSample:
    """One ``geometry_msgs/Vector3Stamped``: stamp (ns), frame, vector."""

    stamp: int
    frame_id: str
    vector: Vector3


@dataclass(frozen=True, slots=True, eq=False)
class MotionForecast:
    """
    Roll, pitch and heave at some times ahead of the newest measurement.

    Attributes
    ----------
    horizons : ndarray, shape (n,)
        Seconds ahead.
    mean, rate : ndarray, shape (n, 3)
        Roll, pitch (rad), heave (m) and their rates (rad/s, m/s).
    cov, rate_cov : ndarray, shape (n, 3, 3)
        Error covariances of ``mean`` and ``rate``.

    """

    horizons: Array
    mean: Array
    cov: Array
    rate: Array
    rate_cov: Array

    def part(self, rows: slice) -> MotionForecast:
        """Return some of the times."""
        return MotionForecast(self.horizons[rows], self.mean[rows], self.cov[rows],
                              self.rate[rows], self.rate_cov[rows])


@dataclass(frozen=True, slots=True, eq=False)
class TouchdownForecast:
    """
    The touchdown point at some times ahead of the newest measurement.

    Attributes
    ----------
    issued_at : int
        Stamp of the newest measurement (ns).
    horizons : ndarray, shape (n,)
        Seconds ahead.
    height, height_sd, rate, rate_sd : ndarray, shape (n,)
        Above rest (m), vertical rate (m/s), and their standard deviations.
    position, velocity : ndarray, shape (n, 3)
        Of the point, in ``ship_level`` (m, m/s).
    motion : MotionForecast
        Of the ship.

    """

    issued_at: int
    horizons: Array
    height: Array
    height_sd: Array
    rate: Array
    rate_sd: Array
    position: Array
    velocity: Array
    motion: MotionForecast


@dataclass(frozen=True, slots=True, eq=False)
class DeckForecast:
    """
    The touchdown point at some times ahead, as ``touchdown/forecast`` says it.

    Attributes
    ----------
    stamp : int
        Of the newest measurement (ns).
    frame_id : str
        Level frame of positions and velocities.
    times : ndarray, shape (n,)
        Seconds ahead of the stamp.
    position, velocity : ndarray, shape (n, 3)
        Of the point (m, m/s).

    """

    stamp: int
    frame_id: str
    times: Array
    position: Array
    velocity: Array


@dataclass(frozen=True, slots=True)
class LandingWindow:
    """
    Whether to land, from everything up to ``issued_at``.

    Attributes
    ----------
    issued_at : int
        Stamp of the newest measurement (ns).
    state : str
        ``go``: the deck stays within limits throughout a window that begins now; ``wait``: more
        likely than not, throughout one that begins later in the forecast; ``no_go``: neither.
    seconds : float
        ``go``: how long it stays so, that is, until when a window may still begin; ``wait``: until
        one begins; ``no_go``: NaN.
    probability : float
        That the deck stays within limits throughout a window that begins now.
    next_crest_in, next_crest_sd, next_trough_in, next_trough_sd : float
        Until the next highest and lowest height of the touchdown point, and the sd of these times
        (s); NaN where the forecast has none.

    """

    issued_at: int
    state: str
    seconds: float
    probability: float
    next_crest_in: float
    next_crest_sd: float
    next_trough_in: float
    next_trough_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class TouchdownPose:
    """
    Pose and twist of the touchdown point with their error covariances.

    Attributes
    ----------
    valid_at : int
        Nanoseconds.
    position : ndarray, shape (3,)
        In ``ship_level`` (m).
    orientation : tuple of 4 float
        x, y, z, w, ``touchdown`` to ``ship_level``.
    pose_cov : ndarray, shape (6, 6)
        Position and rotation about the fixed axes of ``ship_level``.
    twist : ndarray, shape (6,)
        Linear and angular velocity in the axes of ``touchdown`` (m/s, rad/s).
    twist_cov : ndarray, shape (6, 6)

    """

    valid_at: int
    position: Array
    orientation: Quaternion
    pose_cov: Array
    twist: Array
    twist_cov: Array

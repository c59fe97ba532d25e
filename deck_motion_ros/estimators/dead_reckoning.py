"""Attitude and dead-reckoned motion of a body from its inertial unit, at any time near by."""

from __future__ import annotations

from math import cos, hypot, sin, sqrt

from deck_motion_ros.geometry import conjugate, multiply, normalised, rotated, rotation_vector
from deck_motion_ros.samples import ImuSample, Quaternion, seconds, Vector3

GRAVITY = 9.80665
NOTHING = (0.0, 0.0, 0.0)
CONTRADICTED = 0.1  # rad: rates and measured attitude do not belong together


class InertialTrack:
    """
    Where a body is, up to a constant velocity and a start, from samples of its inertial unit.

    The attitude is that of the samples, smoothed with the turn rates; where these contradict it,
    as after a gap, the sample's alone. Position and velocity are integrals of the specific force
    in axes east, north, up, from rest at the first sample. A body without specific force (all
    zeros) stays there. Past its newest sample, the acceleration stays for as long as two samples,
    then the velocity.

    Parameters
    ----------
    mount : tuple of 4 float
        x, y, z, w, the sensor's axes to the body's.
    smoothing : float
        Time constant over which measured attitudes are averaged (s).
    longest : float
        Between samples without being a gap (s).

    Attributes
    ----------
    stamp : int or None
        Of the newest sample (ns).
    attitude : tuple of 4 float
        x, y, z, w, body to east, north, up, at that stamp.
    rate : tuple of 3 float
        Turn rate in body axes at that stamp (rad/s).
    patience : float
        How long after the newest sample the attitude still is one (s).
    has_force : bool
        Whether the newest sample came with specific force, and after no gap.

    """

    def __init__(self, mount: Quaternion, smoothing: float = 0.5, longest: float = 0.5) -> None:
        self._mount, self._smoothing, self.longest = mount, smoothing, longest
        self.stamp: int | None = None
        self.attitude: Quaternion = (0.0, 0.0, 0.0, 1.0)
        self.rate: Vector3 = NOTHING
        self._mean_rate: Vector3 = NOTHING  # over the newest interval
        self.has_force = False
        self._acceleration = self._velocity = self._position = NOTHING
        self.patience = longest
        self._hold = 0.0  # s: how long the acceleration is believed past the newest sample
        self._weight = 1.0  # of the next measured attitude, at least

    def update(self, sample: ImuSample) -> None:
        """Use a sample that has an attitude and is newer than those before it."""
        assert sample.orientation is not None
        measured = multiply(sample.orientation, conjugate(self._mount))
        rate, force = (rotated(self._mount, vec) for vec in (
            sample.angular_velocity, sample.specific_force))
        has_force = force != NOTHING
        dt = 0.0 if self.stamp is None else self.age(sample.stamp)
        if rate == NOTHING and dt > 0:
            rate = _scaled(rotation_vector(multiply(conjugate(self.attitude), measured)), 1 / dt)
        half = turned(self.attitude, rate, dt / 2)
        predicted = turned(half, rate, dt / 2)
        correction = rotation_vector(multiply(conjugate(predicted), measured))
        if not 0 < dt <= self.longest or hypot(*correction) > CONTRADICTED:
            _, self._position, self._velocity = self.at(sample.stamp)
            self.attitude, self._acceleration = measured, NOTHING
            self.rate = self._mean_rate = rate
            self.stamp, self.has_force, self._weight = sample.stamp, False, 0.5
            self.patience = max(self.longest, 1.5 * dt)
            return
        gain = max(self._weight, dt / (dt + self._smoothing))
        self._weight = self._weight / (1 + self._weight)
        self.attitude = normalised(turned(predicted, correction, gain)) or measured
        if has_force:
            east, north, up = rotated(half, force)
            acceleration = (east, north, up - GRAVITY)
            self._position = _moved(self._position, self._velocity, acceleration, dt)
            self._velocity = _plus(self._velocity, acceleration, dt)
            self._acceleration = acceleration
        else:
            self._position = _moved(self._position, self._velocity, NOTHING, dt)
            self._acceleration = NOTHING
        self.rate = _plus(_scaled(rate, 1.5), self._mean_rate, -0.5)  # at the interval's end
        self.stamp, self._mean_rate, self.has_force = sample.stamp, rate, has_force
        self._hold, self.patience = 2 * dt, self.longest

    def age(self, stamp: int) -> float:
        """Return how much later ``stamp`` (ns) is than the newest sample (s)."""
        return float('inf') if self.stamp is None else seconds(stamp - self.stamp)

    def is_inertial(self, stamp: int) -> bool:
        """Say whether the motion at ``stamp`` (ns) is known from specific force."""
        return self.has_force and self.age(stamp) <= self._hold

    def at(self, stamp: int) -> tuple[Quaternion, Vector3, Vector3]:
        """Return attitude, position (m) and velocity (m/s) at ``stamp`` (ns)."""
        if self.stamp is None:
            return self.attitude, NOTHING, NOTHING
        dt = self.age(stamp)
        held = min(dt, self._hold)
        velocity = _plus(self._velocity, self._acceleration, held)
        position = _moved(self._position, self._velocity, self._acceleration, held)
        return turned(self.attitude, self.rate, dt), _plus(position, velocity, dt - held), velocity


def turned(attitude: Quaternion, rate: Vector3, dt: float) -> Quaternion:
    """Turn an attitude about its own axes by ``rate`` (rad/s) for ``dt`` (s)."""
    x, y, z = rate
    half = sqrt(x * x + y * y + z * z) * dt / 2
    scale = sin(half) / half * dt / 2 if abs(half) > 1e-9 else dt / 2
    return multiply(attitude, (scale * x, scale * y, scale * z, cos(half)))


def _scaled(vec: Vector3, by: float) -> Vector3:
    x, y, z = vec
    return (x * by, y * by, z * by)


def _plus(vec: Vector3, rate: Vector3, dt: float) -> Vector3:
    (x, y, z), (u, v, w) = vec, rate
    return (x + u * dt, y + v * dt, z + w * dt)


def _moved(position: Vector3, velocity: Vector3, acceleration: Vector3, dt: float) -> Vector3:
    return _plus(_plus(position, velocity, dt), acceleration, dt * dt / 2)

"""Rotations and lever arms in REP-103 axes: the only place where an axis is flipped."""

from __future__ import annotations

from functools import lru_cache
from math import asin, atan2, copysign, cos, isfinite, pi, sin, sqrt

import numpy as np

from deck_motion_ros.samples import Array, Quaternion, Vector3


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """
    Compose the quaternion of Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    roll, pitch, yaw : float
        Radians, REP-103 (pitch positive bow down).

    Returns
    -------
    tuple of 4 float
        x, y, z, w, body to world.

    >>> quaternion_from_rpy(0.0, 0.0, 0.0)
    (0.0, 0.0, 0.0, 1.0)

    """
    cr, sr = cos(roll / 2), sin(roll / 2)
    cp, sp = cos(pitch / 2), sin(pitch / 2)
    cy, sy = cos(yaw / 2), sin(yaw / 2)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def rpy_from_quaternion(quaternion: Quaternion) -> Vector3:
    """
    Split a unit quaternion x, y, z, w into roll, pitch, yaw (rad, REP-103).

    Pitch within +-pi/2; at the poles roll and yaw share one angle: roll has it, yaw is 0.
    """
    x, y, z, w = quaternion
    sin_pitch = 2 * (w * y - z * x)
    if abs(sin_pitch) > 1 - 1e-12:
        return wrapped(2 * atan2(x, w)), copysign(pi / 2, sin_pitch), 0.0
    return (atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), asin(sin_pitch),
            atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Multiply two quaternions x, y, z, w: the rotation b followed by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def conjugate(quaternion: Quaternion) -> Quaternion:
    """Invert a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return (-x, -y, -z, w)


def rotated(quaternion: Quaternion, vec: Vector3) -> Vector3:
    """Turn a vector by a unit quaternion x, y, z, w: from its child to its parent frame."""
    x, y, z, w = quaternion
    a, b, c = vec
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p)


def rotation_vector(quaternion: Quaternion) -> Vector3:
    """
    Return axis times angle (rad, at most pi) of a unit quaternion x, y, z, w.

    >>> rotation_vector((0.0, 0.0, 0.0, 1.0))
    (0.0, 0.0, 0.0)
    """
    x, y, z, w = quaternion
    length = sqrt(x * x + y * y + z * z)
    half = atan2(copysign(length, w), abs(w))
    scale = 2 * half / length if length > 1e-12 else copysign(2.0, w)
    return (scale * x, scale * y, scale * z)


def normalised(quaternion: Quaternion) -> Quaternion | None:
    """
    Scale a quaternion to unit length; ``None`` for zero or non-finite ones.

    >>> normalised((0.0, 0.0, 0.0, 2.0))
    (0.0, 0.0, 0.0, 1.0)
    """
    x, y, z, w = quaternion
    length = sqrt(x * x + y * y + z * z + w * w)
    if not isfinite(length) or length < 1e-9:
        return None
    return (x / length, y / length, z / length, w / length)


def angular_velocity(rpy: Vector3, rates: Vector3) -> Vector3:
    """Turn rates of roll, pitch, yaw (rad/s) at ``rpy`` (rad) into a turn rate in body axes."""
    roll, pitch, _ = rpy
    by_roll, by_pitch, by_yaw = rates
    across, along = by_pitch, by_yaw * cos(pitch)
    return (by_roll - by_yaw * sin(pitch), cos(roll) * across + sin(roll) * along,
            cos(roll) * along - sin(roll) * across)


def matrix_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return the matrix Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), body to world (rad)."""
    cr, sr, cp, sp, cy, sy = (cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw))
    return np.array([[cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
                     [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
                     [-sp, sr * cp, cr * cp]])


def attitude_of_mounted(orientation: Quaternion, mount_rpy: Vector3) -> Quaternion:
    """
    Give the body's attitude from that of a sensor mounted turned in it.

    Parameters
    ----------
    orientation : tuple of 4 float
        Sensor to world.
    mount_rpy : tuple of 3 float
        Roll, pitch, yaw of the sensor in the body (rad).

    """
    return multiply(orientation, _unmounting(mount_rpy))


@lru_cache(maxsize=8)
def _unmounting(mount_rpy: Vector3) -> Quaternion:
    return conjugate(quaternion_from_rpy(*mount_rpy))


def yaw_from_heading(heading: float) -> float:
    """
    Convert a compass heading (rad, clockwise from north) to ENU yaw within (-pi, pi].

    >>> yaw_from_heading(pi / 2)
    0.0
    """
    return wrapped(pi / 2 - heading)


def wrapped(angle: float) -> float:
    """Wrap an angle (rad) into (-pi, pi]."""
    return pi - (pi - angle) % (2 * pi)


def pitch_bow_down(pitch_bow_up: float) -> float:
    """Convert a pitch counted bow up (papers, logs) to REP-103, or back (rad or deg)."""
    return -pitch_bow_up


def heave_up(heave_down: float) -> float:
    """Convert a heave counted positive down (Seapath's PSXN) to up, or back (m)."""
    return -heave_down


def from_starboard_forward_up(vec: Vector3) -> Vector3:
    """
    Turn a vector from the axes of Li2014 (starboard, forward, up) to REP-103.

    >>> from_starboard_forward_up((-3.05, -67.97, 19.5))
    (-67.97, 3.05, 19.5)
    """
    x, y, z = vec
    return (y, -x, z)


def height_above_rest(roll: float, pitch: float, heave: float, lever_arm: Vector3) -> float:
    """
    Height of a point of the ship above where it rests (Li2014 eq 14, corrected).

    The paper's row is transposed and keeps heave inside the rotation; heave is added outside.

    Parameters
    ----------
    roll, pitch : float
        Radians, REP-103.
    heave : float
        Metres, up, of the reference point.
    lever_arm : tuple of 3 float
        The point in ship axes (m).

    Returns
    -------
    float
        Metres.

    >>> from math import radians
    >>> arm = (-67.97, 3.05, 19.5)
    >>> round(height_above_rest(radians(2), radians(-1), 0.5, arm), 6)
    -0.59466

    """
    x, y, z = lever_arm
    return (-sin(pitch) * x + cos(pitch) * (sin(roll) * y + cos(roll) * z)) + heave - z


def turned_arm(roll: Array, pitch: Array, lever_arm: Vector3) -> Array:
    """
    Turn a lever arm with the ship and differentiate it, for many attitudes at once.

    Parameters
    ----------
    roll, pitch : ndarray, shape (...)
        Radians, REP-103.
    lever_arm : tuple of 3 float
        In ship axes (m).

    Returns
    -------
    ndarray, shape (3, ..., 3)
        The arm in level axes along the ship's heading (m), and its derivatives by roll and by
        pitch (m/rad).

    """
    x, y, z = lever_arm
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    across, up = cr * y - sr * z, sr * y + cr * z
    ahead, high = cp * x + sp * up, cp * up - sp * x
    table = np.array([[ahead, across, high], [sp * across, -up, cp * across],
                      [high, np.zeros_like(up), -ahead]])
    return table.transpose(0, *range(2, table.ndim), 1)  # moveaxis takes longer than the sines


def rate_axes(pitch: float) -> Array:
    """
    Return the matrix that turns roll, pitch and yaw rates into an angular velocity at yaw 0.

    Parameters
    ----------
    pitch : float
        Radians, REP-103.

    Returns
    -------
    ndarray, shape (3, 3)
        Columns: the axes of roll, pitch and yaw in the level frame along the heading.

    """
    return np.array([[cos(pitch), 0.0, 0.0], [0.0, 1.0, 0.0], [-sin(pitch), 0.0, 1.0]])


EYE = np.eye(3)
_CROSS = np.zeros((3, 3, 3))  # the matrices of the cross products with the unit vectors
_CROSS[0, 2, 1] = _CROSS[1, 0, 2] = _CROSS[2, 1, 0] = 1
_CROSS[0, 1, 2] = _CROSS[1, 2, 0] = _CROSS[2, 0, 1] = -1
_SKEW = _CROSS.reshape(3, 9)


def skew(vec: Array) -> Array:
    """Return the matrices of the cross products ``vec`` x, shape (..., 3) to (..., 3, 3)."""
    return np.asarray(np.dot(vec, _SKEW)).reshape(*vec.shape, 3)


def cross(a: Array, b: Array) -> Array:
    """Return a x b, shape (..., 3): ``numpy.cross`` takes five times as long."""
    return transformed(skew(a), b)


def transformed(mat: Array, vec: Array) -> Array:
    """Multiply matrices, shape (..., m, n), with vectors, shape (..., n)."""
    return np.asarray(mat @ vec[..., None])[..., 0]


def rotation_matrix(vec: Array) -> Array:
    """
    Return Exp(vec): the turns about axis times angle (rad), shape (..., 3) to (..., 3, 3).

    >>> rotation_matrix(np.array([0.0, 0.0, pi / 2])).round(9).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    mat = skew(vec)
    if vec.ndim == 1:  # twice as fast
        single = sqrt(vec @ vec) + 1e-150
        return np.asarray(EYE + sin(single) / single * mat
                          + 2 * (sin(single / 2) / single)**2 * (mat @ mat))
    angle = np.sqrt((vec * vec).sum(-1) + 1e-200)[..., None, None]
    half = np.sin(angle / 2) / angle
    return np.asarray(EYE + np.sin(angle) / angle * mat + 2 * half * half * (mat @ mat))


def slight_rotation(vec: Array) -> Array:
    """Return Exp(vec) to second order, shape (..., 3) to (..., 3, 3): off by |vec|^3 / 6."""
    mat = skew(vec)
    return np.asarray(EYE + mat + mat @ mat / 2)


def rotation_vectors(mat: Array) -> Array:
    """
    Return axis times angle (rad, below pi) of matrices, shape (..., 3, 3) to (..., 3).

    >>> rotation_vectors(rotation_matrix(np.array([0.1, 0.2, -0.3]))).round(9).tolist()
    [0.1, 0.2, -0.3]
    """
    twice = np.stack([mat[..., 2, 1] - mat[..., 1, 2], mat[..., 0, 2] - mat[..., 2, 0],
                      mat[..., 1, 0] - mat[..., 0, 1]], axis=-1)
    sine = np.sqrt(np.einsum('...i,...i', twice, twice)) / 2
    cosine = (np.trace(mat, axis1=-2, axis2=-1) - 1) / 2
    angle = np.arctan2(sine, cosine)
    return np.asarray(twice / (2 * np.sinc(angle / pi))[..., None])


def matrix_from_quaternion(quaternion: Quaternion) -> Array:
    """Return the matrix of a unit quaternion x, y, z, w, shape (3, 3), child to parent."""
    x, y, z, w = quaternion
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion_from_matrix(mat: Array) -> Quaternion:
    """Return the unit quaternion x, y, z, w of a rotation matrix, shape (3, 3)."""
    a, b, c = mat[0, 0], mat[1, 1], mat[2, 2]
    squares = (1 + a - b - c, 1 - a + b - c, 1 - a - b + c, 1 + a + b + c)  # 4 q_i^2
    rows = np.array([
        [squares[0], mat[1, 0] + mat[0, 1], mat[0, 2] + mat[2, 0], mat[2, 1] - mat[1, 2]],
        [mat[1, 0] + mat[0, 1], squares[1], mat[2, 1] + mat[1, 2], mat[0, 2] - mat[2, 0]],
        [mat[0, 2] + mat[2, 0], mat[2, 1] + mat[1, 2], squares[2], mat[1, 0] - mat[0, 1]],
        [mat[2, 1] - mat[1, 2], mat[0, 2] - mat[2, 0], mat[1, 0] - mat[0, 1], squares[3]]])
    x, y, z, w = (rows[int(np.argmax(squares))] / np.sqrt(4 * max(squares))).tolist()
    return (x, y, z, w)

"""Strapdown navigation on increments, in axes east, north, up; any number of runs at once."""

from __future__ import annotations

from typing import NamedTuple

from deck_motion_ros.earth import Earth
from deck_motion_ros.geometry import cross, rotation_matrix, slight_rotation, transformed
from deck_motion_ros.samples import Array, ImuSample, Rejected

MAX_FORCE, MAX_RATE = 1000.0, 35.0  # m/s^2, rad/s: no ship and no aircraft


class Increments(NamedTuple):
    """
    What an inertial unit integrated over one interval, in its own turning axes.

    Attributes
    ----------
    turn, push : ndarray, shape (..., 3)
        Integrals of turn rate (rad) and specific force (m/s).

    """

    turn: Array
    push: Array


def check_plausible(sample: ImuSample) -> None:
    """Raise ``Rejected`` if nothing that sails or flies turns or accelerates like a sample."""
    if max(map(abs, sample.angular_velocity)) > MAX_RATE:
        raise Rejected('implausible turn rate')
    if max(map(abs, sample.specific_force)) > MAX_FORCE:
        raise Rejected('implausible specific force')


def advanced(mat: Array, vec_v: Array, now: Increments, before: Increments, dt: float,
             earth: Earth) -> tuple[Array, Array]:
    """
    Carry attitude and velocity over one interval.

    Coning and sculling by the increments of the interval before, the turn of the local axes to
    first order (Savage 1998).

    Parameters
    ----------
    mat : ndarray, shape (..., 3, 3)
        Body to ENU.
    vec_v : ndarray, shape (..., 3)
        Velocity relative to the Earth (m/s, ENU).
    now, before : Increments
        Of this interval and of the one before it, of the same length.
    dt : float
        Seconds.
    earth : Earth
        At the place.

    """
    cone = now.turn + cross(before.turn, now.turn) / 12
    push = now.push + cross(now.turn / 2 + before.turn / 12, now.push) + cross(
        before.push, now.turn) / 12
    transport = earth.transport_rate(vec_v)
    turned = slight_rotation(-dt * (earth.rate + transport))
    old = transformed(mat, push)
    # the axes turn while the push acts: half of it, on average
    push_enu = (old + transformed(turned, old)) / 2
    free = earth.gravity - cross(2 * earth.rate + transport, vec_v)
    return turned @ mat @ rotation_matrix(cone), vec_v + push_enu + dt * free

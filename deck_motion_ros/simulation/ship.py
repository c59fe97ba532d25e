"""
The ship in waves: hulls, transfer functions, the mean course, the motion.

Transfer functions are complex: a wave of elevation Re(a e^{i p}) at the ship's reference point
moves it by Re(H a e^{i p}). Axes and signs are REP-103: a crest ahead lifts the bow (pitch
negative), a crest to port lifts the port side (roll positive).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from deck_motion_ros.samples import Array
from deck_motion_ros.simulation.sea import GRAVITY, Waves

ComplexArray = NDArray[np.complex128]

SURGE, SWAY, HEAVE, ROLL, PITCH, YAW = range(6)


@dataclass(frozen=True, slots=True)
class Hull:
    """
    What the closed-form motions need to know of a ship.

    Attributes
    ----------
    length, beam, draught : float
        At the waterline (m).
    block_coefficient : float
        Displaced volume / (length beam draught).
    roll_period : float
        Natural period of roll (s).
    roll_damping : float
        Ratio to the critical damping.

    """

    length: float
    beam: float
    draught: float
    block_coefficient: float
    roll_period: float
    roll_damping: float


# Nominal values: main dimensions as published for CVN-65 (93,000 t), the DTMB 5415 / DDG-51 hull
# (8,400 t) and an 80 m offshore patrol vessel (1,900 t); roll period and damping typical of the
# type (about 0.8 beam / sqrt(GM), bilge keels).
HULLS = {
    'cvn65': Hull(317.0, 40.5, 11.9, 0.60, 22.0, 0.05),
    'destroyer': Hull(142.0, 19.1, 6.15, 0.507, 11.0, 0.07),
    'patrol': Hull(80.0, 13.6, 3.8, 0.45, 8.5, 0.08),
}


def transfer_functions(hull: Hull, omega: Array, heading: Array, speed: Array) -> ComplexArray:
    """
    Return surge, sway, heave (m/m), roll, pitch, yaw (rad/m) of regular waves.

    Heave and pitch: Jensen, Mansour and Olsen 2004, a box of beam B C_b, with the Smith factor
    exp(-k T) that also works in beam seas. Their damping A^2 / (k B alpha^3) changes sign in
    waves the ship overtakes; here it always damps. Roll: a damped oscillator driven by the wave
    slope, averaged over the hull. Surge, sway, yaw: the hull goes with the mean orbital motion
    of the water.

    Parameters
    ----------
    hull : Hull
        The ship.
    omega : ndarray
        Wave frequency (rad/s), shape (..., n).
    heading : ndarray
        Direction the waves travel towards, counter-clockwise from the bow (rad), same shape:
        0 = following, pi/2 = from starboard, pi = head sea.
    speed : ndarray
        Speed of the ship (m/s), shape broadcast with the others.

    Returns
    -------
    ndarray, shape (6, ..., n)
        Complex.

    """
    k = omega**2 / GRAVITY
    kx, ky = k * np.cos(heading), k * np.sin(heading)
    alpha = 1 - kx * speed / omega  # encounter frequency / wave frequency
    kt = k * hull.draught
    kb = k * hull.beam * hull.block_coefficient
    half = kx * hull.length / 2
    mean = _sinc(half)  # of a wave over the hull's length
    slope = _slope(half)  # of the straight line fitted to it, relative to its steepest

    # A^2 / (k B alpha^2) and A^2 / (k B alpha^3), A = 2 sin(k B alpha^2 / 2) exp(-k T alpha^2)
    force = kb * alpha * (_sinc(kb * alpha**2 / 2) * np.exp(-kt * alpha**2))**2
    damping = np.abs(alpha) * force
    excitation = np.exp(-kt) * np.hypot(1 - kt, force)  # kappa f
    oscillator = excitation / (1 - 2 * kt * alpha**2 + 1j * damping)

    orbit = np.exp(-kt / 2)
    ratio = alpha * omega * hull.roll_period / (2 * pi)
    roll = orbit * mean * _sinc(ky * hull.beam / 2) / (
        1 - ratio**2 + 2j * hull.roll_damping * ratio)
    bearing = np.stack([np.cos(heading), np.sin(heading)])
    surge, sway = -1j * bearing * orbit * mean
    return np.stack([surge, sway, oscillator * mean, -1j * ky * roll,
                     1j * kx * slope * oscillator, -kx * np.sin(heading) * slope * orbit])


def _sinc(x: Array) -> Array:
    return np.sinc(x / pi)


def _slope(x: Array) -> Array:
    square = x * x + 1e-6  # off the 0/0, for an error of 1e-7
    root = np.sqrt(square)
    return np.asarray(3 * (np.sin(root) / root - np.cos(root)) / square)


@dataclass(frozen=True, slots=True)
class Change:
    """
    A manoeuvre: yaw and speed go smoothly from what they were to what they will be.

    Attributes
    ----------
    start, duration : float
        Seconds.
    turn : float
        Change of yaw (rad, to port positive).
    speed_up : float
        Change of speed (m/s).

    """

    start: float
    duration: float
    turn: float = 0.0
    speed_up: float = 0.0


def turn_at(start: float, turn: float, rate: float) -> Change:
    """Make a turn by ``turn`` (rad) whose rate rises to ``rate`` (rad/s) half way, and falls."""
    return Change(start, 1.5 * abs(turn) / rate, turn=turn)


def speed_up_at(start: float, speed_up: float, acceleration: float) -> Change:
    """Make a change of speed (m/s) whose acceleration rises to ``acceleration`` (m/s^2)."""
    return Change(start, 1.5 * abs(speed_up) / acceleration, speed_up=speed_up)


@dataclass(frozen=True, eq=False)
class Track:
    """
    Where the mean course takes the ship, at m times.

    Attributes
    ----------
    yaw, yaw_rate, speed, acceleration : ndarray, shape (m,)
        rad (ENU), rad/s, m/s, m/s^2.
    position, velocity : ndarray, shape (m, 2)
        East, north (m, m/s).

    """

    yaw: Array
    yaw_rate: Array
    speed: Array
    acceleration: Array
    position: Array
    velocity: Array


class Course:
    """
    The ship's mean course: constant yaw and speed between changes.

    Parameters
    ----------
    yaw : float
        At the start, rad (ENU).
    speed : float
        At the start, m/s.
    changes : tuple of Change
        May overlap; their effects add.

    """

    def __init__(self, yaw: float, speed: float, changes: tuple[Change, ...] = ()) -> None:
        self._yaw, self._speed = yaw, speed
        self._changes = tuple(item for item in changes if item.duration > 0)
        ends = [(item.start, item.start + item.duration) for item in self._changes]
        self.edges = np.unique(np.array(ends, float))  # between them: steady, or one manoeuvre
        self._path: CubicHermiteSpline | None = None
        if len(self.edges):
            count = max(2, round((self.edges[-1] - self.edges[0]) / 0.25))
            nodes = np.linspace(self.edges[0], self.edges[-1], count + 1)
            half = (nodes[1:] - nodes[:-1])[:, None] / 2
            middle = (nodes[1:] + nodes[:-1]) / 2
            ends_velocity = self._velocity(nodes)
            cells = half / 3 * (ends_velocity[:-1] + 4 * self._velocity(middle)
                                + ends_velocity[1:])  # Simpson
            path = np.cumsum(np.concatenate([nodes[:1, None] * ends_velocity[:1], cells]), axis=0)
            self._path = CubicHermiteSpline(nodes, path, ends_velocity)

    def steady(self, time: float) -> bool:
        """Say whether no change is under way at ``time`` (s)."""
        return not any(0 <= time - item.start <= item.duration for item in self._changes)

    def _profile(self, times: Array) -> tuple[Array, Array, Array, Array]:
        yaw, speed = np.full(len(times), self._yaw), np.full(len(times), self._speed)
        yaw_rate, acceleration = np.zeros(len(times)), np.zeros(len(times))
        for item in self._changes:
            u = np.clip((times - item.start) / item.duration, 0, 1)
            step, slope = u * u * (3 - 2 * u), 6 * u * (1 - u) / item.duration
            yaw += item.turn * step
            yaw_rate += item.turn * slope
            speed += item.speed_up * step
            acceleration += item.speed_up * slope
        return yaw, yaw_rate, speed, acceleration

    def _velocity(self, times: Array) -> Array:
        yaw, _, speed, _ = self._profile(times)
        return np.stack([speed * np.cos(yaw), speed * np.sin(yaw)], axis=1)

    def at(self, times: Array) -> Track:
        """Return the mean course at ``times`` (s), shape (m,)."""
        yaw, yaw_rate, speed, acceleration = self._profile(times)
        velocity = np.stack([speed * np.cos(yaw), speed * np.sin(yaw)], axis=1)
        if self._path is None:
            position = velocity * times[:, None]
        else:
            inside = np.clip(times, self.edges[0], self.edges[-1])
            position = self._path(inside) + velocity * (times - inside)[:, None]
        return Track(yaw, yaw_rate, speed, acceleration, position, velocity)


@dataclass(frozen=True, eq=False)
class Motion:
    """
    The ship's motion at m times.

    Attributes
    ----------
    track : Track
        The mean course.
    value, rate : ndarray, shape (m, 6)
        Surge, sway, heave (m), roll, pitch, yaw (rad) about the mean course in ``ship_level``,
        and their derivatives.

    """

    track: Track
    value: Array
    rate: Array


class ShipInWaves:
    """
    A ship on her course through a sea.

    Every wave's phase is taken at the ship's mean position, so that encounter frequencies, turns
    and changes of speed come of themselves; the transfer functions are those of the yaw and speed
    of the moment (quasi-steady: what the hull remembers of another course is left out).

    Parameters
    ----------
    hull : Hull
        The ship.
    waves : Waves
        The sea.
    course : Course
        Where she goes.

    """

    def __init__(self, hull: Hull, waves: Waves, course: Course) -> None:
        self.hull, self.waves, self.course = hull, waves, course
        self._cache: tuple[int, Array] = (-1, np.empty(0))

    def motion(self, times: Array) -> Motion:
        """Return the motion at ``times`` (s), shape (m,), rising."""
        track = self.course.at(times)
        stretch = np.searchsorted(self.course.edges, times)
        out = np.empty((len(times), 12))
        starts = np.union1d(np.arange(0, len(times), 256), np.flatnonzero(np.diff(stretch)) + 1)
        for first, last in zip(starts, [*starts[1:], len(times)], strict=True):
            rows = slice(first, last)
            angle = self.waves.phases(times[rows], track.position[rows])
            wave = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
            if self.course.steady((times[first] + times[last - 1]) / 2):
                out[rows] = wave @ self._steady_response(int(stretch[first]), track, first).T
            else:
                out[rows] = np.einsum('jmn,mn->mj', self._response(track, rows), wave)
        return Motion(track, out[:, :6], out[:, 6:])

    def _steady_response(self, stretch: int, track: Track, row: int) -> Array:
        if stretch != self._cache[0]:
            self._cache = (stretch, self._response(track, slice(row, row + 1))[:, 0])
        return self._cache[1]

    def _response(self, track: Track, rows: slice) -> Array:
        """Return values and rates by cosine and sine of each wave's phase, (12, m, 2n)."""
        yaw, speed = track.yaw[rows, None], track.speed[rows, None]
        step_yaw, step_speed = track.yaw_rate[rows, None], track.acceleration[rows, None]

        def transfer(ahead: float) -> ComplexArray:
            return transfer_functions(
                self.hull, self.waves.omega, self.waves.direction - yaw - ahead * step_yaw,
                speed + ahead * step_speed)

        value = transfer(0.0)
        rate = 1j * (self.waves.omega - track.velocity[rows] @ self.waves.vectors) * value
        if np.any(step_yaw) or np.any(step_speed):
            rate += (transfer(1e-3) - value) / 1e-3
        both = np.concatenate([value, rate]) * self.waves.amplitude
        return np.concatenate([both.real, -both.imag], axis=-1)


@dataclass(frozen=True, eq=False)
class MotionLines:
    """
    The line spectrum of roll, pitch and heave on a steady course.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Encounter frequency of each wave, rad/s, at least 0.
    response : ndarray, shape (3, n)
        Complex amplitudes of roll, pitch (rad) and heave (m): x = Re(response e^{i omega t}).

    """

    omega: Array
    response: ComplexArray

    def covariance(self, lags: Array) -> Array:
        """
        Return E[x_i(t + lag) x_j(t)] over random phases.

        Parameters
        ----------
        lags : ndarray, shape (m,)
            Seconds.

        Returns
        -------
        ndarray, shape (m, 3, 3)

        """
        angle = np.outer(lags, self.omega)
        cross = (self.response[:, None] * self.response.conj() / 2).reshape(9, -1)
        both = np.cos(angle) @ cross.real.T - np.sin(angle) @ cross.imag.T
        return np.asarray(both.reshape(len(lags), 3, 3))


def motion_lines(hull: Hull, waves: Waves, yaw: float, speed: float) -> MotionLines:
    """
    Give the exact line spectrum of a steady course; of ``dense_waves`` for an ensemble of seas.

    Parameters
    ----------
    hull : Hull
        The ship.
    waves : Waves
        The sea.
    yaw, speed : float
        Of the ship: rad (ENU), m/s.

    """
    along = np.array([np.cos(yaw), np.sin(yaw)]) @ waves.vectors
    omega = waves.omega - speed * along
    response = transfer_functions(
        hull, waves.omega, waves.direction - yaw, np.array(speed))[[ROLL, PITCH, HEAVE]]
    response = response * (waves.amplitude * np.exp(1j * waves.phase))
    return MotionLines(np.abs(omega), np.where(omega < 0, response.conj(), response))

"""A launch from the catapult as two inertial units and a laser Doppler velocimeter see it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, cos, inf, isfinite, nan, pi, radians, sin, sqrt

import numpy as np

from deck_motion_ros.config import parameter
from deck_motion_ros.earth import Earth
from deck_motion_ros.geometry import (
    cross,
    matrix_from_quaternion,
    matrix_from_rpy,
    quaternion_from_matrix,
    rotation_matrix,
    rotation_vectors,
    transformed,
    yaw_from_heading,
)
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    nanoseconds,
    VectorSample,
    VelocitySample,
)
from deck_motion_ros.simulation.simulator import Event, ship_in_waves, SimulatorConfig
from deck_motion_ros.simulation.states import SeaStates

ARCMIN = radians(1 / 60)
MICRO_G = 9.80665e-6
DEG_H = radians(1) / 3600
PIECE = 1e-3  # s: longest piece of the interval over which rates and forces are averaged
UNIT_STEP = 0.01  # s: track_*_sd are sd of the mean over it
BLOCK = 100  # samples that are made at once


@dataclass(frozen=True, slots=True)
class CatapultSimulatorConfig(SimulatorConfig):
    """Parameters of the scenario ``catapult``; the defaults are a quiet launch of Bai2016."""

    scenario: str = parameter('catapult', 'catapult: a launch, its sensors', choices=(
        'sea', 'shaping', 'catapult', 'landing', 'altitude'))
    rate: float = parameter(100.0, 'samples of each unit per second', 'Hz', 1.0, 1000.0)
    course_deg: float = parameter(
        30.0, 'mean course at the start, clockwise from north', 'deg', -360.0, 360.0)
    speed: float = parameter(5.14, 'speed at the start', 'm/s', 0.0, 25.0)
    deck: str = parameter('sea', 'sea: the hull in the random sea; steady: rolling as '
                          'deck_roll_deg says', choices=('sea', 'steady'))
    deck_roll_deg: float = parameter(0.0, 'amplitude of the steady deck', 'deg', 0.0, 30.0)
    deck_roll_period: float = parameter(12.0, 'period of the steady deck', 's', 1.0, 60.0)
    latitude_deg: float = parameter(40.0, 'of the ship', 'deg', -85.0, 85.0)

    hold: float = parameter(10.0, 'on deck before the launch', 's', 0.0, 1e6)
    stroke: float = parameter(3.0, 'length of the launch', 's', 0.01, 10.0)
    thrust: float = parameter(19.6133, 'acceleration along the track', 'm/s^2', 0.0, 100.0)
    ramp: float = parameter(0.0, 'the thrust rises over this time', 's', 0.0, 3.0)
    abort_after: float = parameter(
        nan, 'the catapult brakes from then on; unset = never', 's', 0.01, 10.0)
    lever_arm: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), "aircraft's start relative to the master unit, ship axes", 'm', length=3)
    track_rpy_deg: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), "catapult track in the ship's axes", 'deg', -180.0, 180.0, length=3)
    misalignment_arcmin: tuple[float, ...] = parameter(
        (15.0, -10.0, -30.0), 'of the slave to the master, about forward, left, up', 'arcmin',
        -600.0, 600.0, length=3)
    flexure_arcmin: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), 'amplitude of the deck turning under the aircraft, about forward, left, '
        'up', 'arcmin', 0.0, 60.0, length=3)
    flexure_period: float = parameter(4.0, 'of that turning', 's', 0.1, 60.0)

    vibration: float = parameter(0.0, 'amplitude at the start of the launch', 'm/s^2', 0.0, 100.0)
    vibration_frequency: float = parameter(100.0, 'of the nose gear', 'Hz', 0.1, 1000.0)
    vibration_phase_deg: float = parameter(0.0, 'of its cosine', 'deg', -360.0, 360.0)
    vibration_decay: float = parameter(0.0957, 'to 1/e', 's', 0.001, 10.0)
    vibration_direction: tuple[float, ...] = parameter(
        (1.0, 0.0, 1.0), 'times the amplitude: on forward, left, up', '', -1.0, 1.0, length=3)
    vibration_lag_deg: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), 'phase by which forward, left, up come later', 'deg', -360.0, 360.0,
        length=3)
    sampling: str = parameter(
        'increments', 'points: the vibration at the stamp, aliased; increments: its mean over '
        'the interval, from a unit that samples at unit_rate', choices=('points', 'increments'))
    unit_rate: float = parameter(2000.0, 'of the slave inside', 'Hz', 1000.0, 1e5)

    slave_accel_bias_sd_ug: float = parameter(100.0, 'constant in a run', 'ug', 0.0, 1e5)
    slave_gyro_drift_sd_deg_h: float = parameter(0.01, 'constant in a run', 'deg/h', 0.0, 100.0)
    slave_accel_white_sd: float = parameter(
        2e-4, 'white noise, sd of its mean over 1 s', 'm/s^2', 0.0, 1.0)
    slave_gyro_white_sd: float = parameter(
        1e-6, 'white noise, sd of its mean over 1 s', 'rad/s', 0.0, 0.1)
    master_accel_bias_sd_ug: float = parameter(
        50.0, 'constant in a run; the velocity drifts with it', 'ug', 0.0, 1e5)
    master_gyro_drift_sd_deg_h: float = parameter(0.001, 'constant in a run', 'deg/h', 0.0, 100.0)
    master_accel_white_sd: float = parameter(
        1e-4, 'white noise, sd of its mean over 1 s', 'm/s^2', 0.0, 1.0)
    master_gyro_white_sd: float = parameter(
        1e-7, 'white noise, sd of its mean over 1 s', 'rad/s', 0.0, 0.1)
    ldv_sd: float = parameter(0.01, 'white noise of the velocimeter', 'm/s', 0.0, 10.0)
    track_lateral_sd: float = parameter(
        0.02, "white error of the ship's velocity across the track: sd of its mean over "
        '0.01 s', 'm/s', 0.0, 10.0)
    track_vertical_sd: float = parameter(
        0.05, "white error of the ship's velocity normal to the deck: sd of its mean over "
        '0.01 s', 'm/s', 0.0, 10.0)
    skew: float = parameter(
        0.0, 'data of master and velocimeter are this much older than their stamps', 's',
        -0.5, 0.5)
    master_every: int = parameter(1, 'only one in so many samples of the master comes', '', 1, 100)
    ldv_every: int = parameter(1, 'only one in so many of the velocimeter comes', '', 1, 100)
    ldv_dropout: tuple[float, ...] = parameter(
        (0.0, 0.0), 'the velocimeter is silent from, to, after the launch', 's', -1e6, 1e6,
        length=2)

    map_frame: str = parameter('map', 'axes east, north, up')
    uav_base_link_frame: str = parameter('uav_base_link', 'frame of the aircraft')
    track_frame: str = parameter('track', 'frame of the catapult, x along the stroke')


class Stroke:
    """
    The aircraft's way along its track: pieces of constant jerk.

    Parameters
    ----------
    config : CatapultSimulatorConfig
        The run.

    Attributes
    ----------
    start, end : float
        Of the launch (s); at its end the aircraft leaves deck and velocimeter.

    """

    def __init__(self, config: CatapultSimulatorConfig) -> None:
        self.start, self.end = config.hold, config.hold + config.stroke
        ramp = min(config.ramp, config.stroke)
        pieces = [(self.start, 0.0, config.thrust / ramp)] if ramp else []
        pieces.append((self.start + ramp, config.thrust, 0.0))
        if isfinite(config.abort_after) and config.abort_after < config.stroke:
            braking = config.hold + max(config.abort_after, ramp)
            pieces += [(braking, -config.thrust, 0.0), (2 * braking - self.start - ramp / 2, 0, 0)]
            self.end = inf
        else:
            pieces.append((self.end, 0.0, 0.0))
        self._knots = np.array([time for time, _, _ in pieces])
        rows, speed, way = [(0.0, 0.0, 0.0, 0.0)], 0.0, 0.0
        for (time, acceleration, jerk), after in zip(pieces, self._knots[1:].tolist() + [0.0],
                                                     strict=True):
            rows.append((way, speed, acceleration, jerk))
            dt = after - time
            way += dt * (speed + dt * (acceleration / 2 + dt * jerk / 6))
            speed += dt * (acceleration + dt * jerk / 2)
        self._rows = np.array(rows)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return way (m) and speed (m/s) at ``times`` (s), shape (n,)."""
        piece = np.searchsorted(self._knots, times, side='right')
        dt = times - self._knots[np.maximum(piece - 1, 0)]
        way, speed, acceleration, jerk = self._rows[piece].T
        return (way + dt * (speed + dt * (acceleration / 2 + dt * jerk / 6)),
                speed + dt * (acceleration + dt * jerk / 2))


@dataclass(frozen=True, eq=False)
class Reference:
    """
    The ship and the aircraft's way over her deck at n times.

    Attributes
    ----------
    mat : ndarray, shape (n, 3, 3)
        Ship to ENU.
    rate : ndarray, shape (n, 3)
        Of the ship, relative to ENU, in her axes (rad/s).
    velocity : ndarray, shape (n, 3)
        Of the master unit (m/s, ENU).
    way, speed : ndarray, shape (n,)
        Along the track (m, m/s).

    """

    mat: Array
    rate: Array
    velocity: Array
    way: Array
    speed: Array


class Launch:
    """
    The true motion of ship and aircraft.

    Parameters
    ----------
    config : CatapultSimulatorConfig
        The run.

    """

    def __init__(self, config: CatapultSimulatorConfig) -> None:
        self._config = config
        self.stroke = Stroke(config)
        self.earth = Earth(radians(config.latitude_deg))
        self.mat_track = matrix_from_rpy(*np.radians(config.track_rpy_deg))
        self._deck = _sea_deck(config) if config.deck == 'sea' else _steady_deck(config)

    def reference(self, times: Array) -> Reference:
        """Return ship and way at ``times`` (s), shape (n,)."""
        step = PIECE / 2
        mats, velocity = self._deck(np.add.outer((-step, 0.0, step), times).ravel())
        before, mat, after = mats.reshape(3, -1, 3, 3)
        rate = rotation_vectors(before.swapaxes(-1, -2) @ after) / (2 * step)
        return Reference(mat, rate, velocity.reshape(3, -1, 3)[1], *self.stroke.at(times))

    def velocity(self, reference: Reference) -> Array:
        """Return the aircraft's velocity (m/s, ENU), shape (n, 3)."""
        along = self.mat_track[:, 0]
        arm = self._config.lever_arm + np.multiply.outer(reference.way, along)
        relative = cross(reference.rate, arm) + np.multiply.outer(reference.speed, along)
        return reference.velocity + transformed(reference.mat, relative)

    def attitude(self, times: Array) -> Array:
        """Return the aircraft's attitude, were it not misaligned: to ENU, shape (n, 3, 3)."""
        return np.asarray(self._deck(times)[0] @ self._flexure(times))

    def inertial(self, times: Array) -> tuple[Array, Array]:
        """
        Average turn rate and specific force over the intervals that end at ``times``.

        Parameters
        ----------
        times : ndarray, shape (n + 1,)
            Evenly spaced; the first is the start of the first interval (s).

        Returns
        -------
        rate, force : ndarray, shape (n, 3)
            In the aircraft's axes, were it not misaligned (rad/s, m/s^2).

        """
        period = times[1] - times[0]
        pieces = ceil(period / PIECE - 1e-9)
        dt = period / pieces
        nodes = times[0] + dt * np.arange(pieces * (len(times) - 1) + 1)
        here = self.reference(nodes)
        rate, force = _mean_inertial(here.mat @ self._flexure(nodes), self.velocity(here), dt,
                                     self.earth)
        return tuple(vec.reshape(-1, pieces, 3).mean(axis=1) for vec in (rate, force))

    def _flexure(self, times: Array) -> Array:
        angles = ARCMIN * np.array(self._config.flexure_arcmin)
        return rotation_matrix(np.multiply.outer(
            np.sin(2 * pi / self._config.flexure_period * times), angles))


def _mean_inertial(mat: Array, velocity: Array, dt: float,
                   earth: Earth) -> tuple[Array, Array]:
    """Average turn rate and specific force, (n, 3) each, between n + 1 attitudes, velocities."""
    turn = rotation_vectors(mat[:-1].swapaxes(-1, -2) @ mat[1:]) / dt
    to_body = (mat[:-1] @ rotation_matrix(turn * dt / 2)).swapaxes(-1, -2)
    mean = (velocity[:-1] + velocity[1:]) / 2
    transport = earth.transport_rate(mean)
    force = np.diff(velocity, axis=0) / dt - earth.gravity + cross(
        2 * earth.rate + transport, mean)
    return turn + transformed(to_body, earth.rate + transport), transformed(to_body, force)


def _steady_deck(config: CatapultSimulatorConfig) -> Callable[[Array], tuple[Array, Array]]:
    yaw = yaw_from_heading(radians(config.course_deg))
    mat_level = matrix_from_rpy(0.0, 0.0, yaw)
    velocity = config.speed * np.array([cos(yaw), sin(yaw), 0.0])
    roll, omega = radians(config.deck_roll_deg), 2 * pi / config.deck_roll_period

    def at(times: Array) -> tuple[Array, Array]:
        turn = np.multiply.outer(roll * np.sin(omega * times), (1.0, 0.0, 0.0))
        return mat_level @ rotation_matrix(turn), np.tile(velocity, (len(times), 1))

    return at


def _sea_deck(config: CatapultSimulatorConfig) -> Callable[[Array], tuple[Array, Array]]:
    states = SeaStates(ship_in_waves(config))

    def at(times: Array) -> tuple[Array, Array]:
        rising, back = np.unique(times, return_inverse=True)
        found = states.at(rising)
        return (np.stack([matrix_from_quaternion(state.orientation) for state in found])[back],
                np.array([state.enu_velocity for state in found])[back])

    return at


@dataclass(frozen=True, eq=False)
class Measured:
    """
    What comes at n times in any number of runs.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Stamps (s).
    slave_rate, slave_force, master_rate : ndarray, shape (n, runs, 3)
        Means over the interval before each stamp, in the unit's axes (rad/s, m/s^2).
    mat_master : ndarray, shape (n, 3, 3)
        Ship to ENU.
    master_force : ndarray, shape (n, 3)
        As ``slave_force``, the same in all runs.
    velocity : ndarray, shape (n, runs, 3)
        Of the master (m/s, ENU).
    speed : ndarray, shape (n, runs)
        Along the track (m/s).

    """

    times: Array
    slave_rate: Array
    slave_force: Array
    mat_master: Array
    master_rate: Array
    master_force: Array
    velocity: Array
    speed: Array


class CatapultSensors:
    """
    The units and the velocimeter of any number of runs of one launch.

    Parameters
    ----------
    config : CatapultSimulatorConfig
        The run.
    rng : numpy.random.Generator
        Source of all errors.
    misalignment : ndarray, shape (runs, 3)
        About forward, left, up (rad); of the configuration if not given.
    frequency, phase : ndarray, shape (runs,)
        Of the vibration (Hz, rad), likewise.

    """

    def __init__(self, config: CatapultSimulatorConfig, rng: np.random.Generator,
                 misalignment: Array | None = None, frequency: Array | None = None,
                 phase: Array | None = None) -> None:
        self._config, self._rng = config, rng
        self.launch = Launch(config)
        self.misalignment = ARCMIN * np.array([config.misalignment_arcmin]) if (
            misalignment is None) else misalignment
        runs = self._runs = len(self.misalignment)
        self._frequency = np.array([config.vibration_frequency]) if (
            frequency is None) else frequency
        self._phase = np.radians([config.vibration_phase_deg]) if phase is None else phase

        def constant(sd: float) -> Array:
            return sd * rng.normal(size=(runs, 3))

        self._slave_bias = constant(MICRO_G * config.slave_accel_bias_sd_ug)
        self._slave_drift = constant(DEG_H * config.slave_gyro_drift_sd_deg_h)
        self._master_bias = constant(MICRO_G * config.master_accel_bias_sd_ug)
        self._master_drift = constant(DEG_H * config.master_gyro_drift_sd_deg_h)
        self._velocity_error = np.zeros((runs, 3))

    def measure(self, first: int, number: int) -> Measured:
        """Measure at the stamps k / rate, k = first ...; calls must go on where the last ended."""
        config, mat_track = self._config, self.launch.mat_track
        dt = 1 / config.rate
        times = np.arange(first - 1, first + number) / config.rate
        rate, force = (np.einsum('rji,nj->nri', rotation_matrix(self.misalignment), vec)
                       for vec in self.launch.inertial(times))
        late = times - config.skew
        there = self.launch.reference(late)
        master_rate, master_force = _mean_inertial(there.mat, there.velocity, dt,
                                                   self.launch.earth)

        def white(sd: float) -> Array:
            return sd / sqrt(dt) * self._rng.normal(size=(number, self._runs, 3))

        drift = self._master_bias * dt + dt * white(config.master_accel_white_sd)
        error = self._velocity_error + np.cumsum(
            np.einsum('nij,nrj->nri', there.mat[1:], drift), axis=0)
        self._velocity_error = error[-1]
        across = self._rng.normal(size=(number, self._runs, 3)) * (
            0.0, config.track_lateral_sd, config.track_vertical_sd) * sqrt(
                UNIT_STEP / (dt * config.master_every))
        velocity = there.velocity[1:, None] + error + np.einsum(
            'nij,jk,nrk->nri', there.mat[1:], mat_track, across)
        return Measured(
            times[1:], rate + self._slave_drift + white(config.slave_gyro_white_sd),
            force + self._slave_bias + white(config.slave_accel_white_sd)
            + self._vibration(times[1:]),
            there.mat[1:],
            master_rate[:, None] + self._master_drift + white(config.master_gyro_white_sd),
            master_force, velocity,
            there.speed[1:, None] + config.ldv_sd * self._rng.normal(size=(number, self._runs)))

    def _vibration(self, times: Array) -> Array:
        """Return what the nose gear adds to the slave's force, shape (n, runs, 3)."""
        config = self._config
        parts = round(config.unit_rate / config.rate) if config.sampling == 'increments' else 1
        age = np.add.outer(times - self.launch.stroke.start,
                           -np.arange(parts) / (parts * config.rate))[..., None, None]
        phase = self._phase[:, None] - np.radians(config.vibration_lag_deg)
        swing = np.cos(2 * pi * self._frequency[:, None] * age + phase) * np.exp(
            -np.maximum(age, 0) / config.vibration_decay) * (age > 1e-9)
        return np.asarray(config.vibration * np.array(config.vibration_direction)
                          * swing.mean(axis=1))


class CatapultSimulator:
    """
    Iterate, once, over a launch's samples in the order in which they arrive.

    Those of one stamp come together: ``master/imu``, ``master/velocity``, ``ldv/velocity``,
    ``slave/imu``, ``alignment/truth``. The aircraft leaves the velocimeter at the stroke's end.

    Parameters
    ----------
    config : CatapultSimulatorConfig
        The run.
    start : int
        Stamp of the first samples (ns).

    """

    def __init__(self, config: CatapultSimulatorConfig, start: int = 0) -> None:
        self._config, self._start = config, start
        self._sensors = CatapultSensors(config, np.random.default_rng([config.seed, 2]))
        self._events = self._run()

    def __iter__(self) -> Iterator[Event]:
        return self._events

    def _run(self) -> Iterator[Event]:
        config = self._config
        total = ceil(config.duration * config.rate - 1e-9) if config.duration else None
        first = 0
        while total is None or first < total:
            number = BLOCK if total is None else min(BLOCK, total - first)
            block = self._sensors.measure(first, number)
            for row in range(number):
                yield from self._samples(block, row, first + row)
            first += number

    def _samples(self, block: Measured, row: int, k: int) -> Iterator[Event]:
        config, time = self._config, float(block.times[row])
        stamp = self._start + nanoseconds(time)
        ship, aircraft = config.ship_base_link_frame, config.uav_base_link_frame
        stroke = self._sensors.launch.stroke
        zero = (0.0, 0.0, 0.0)
        if k % config.master_every == 0:
            yield Event(stamp, 'master/imu', ImuSample(
                stamp, ship, quaternion_from_matrix(block.mat_master[row]), zero,
                tuple(block.master_rate[row, 0].tolist()),
                tuple(block.master_force[row].tolist())))
            yield Event(stamp, 'master/velocity', VelocitySample(
                stamp, config.map_frame, tuple(block.velocity[row, 0].tolist()), zero))
        silent_from, silent_to = (stroke.start + edge for edge in config.ldv_dropout)
        if k % config.ldv_every == 0 and time <= stroke.end + 1e-9 and not (
                silent_from <= time < silent_to):
            yield Event(stamp, 'ldv/velocity', VelocitySample(
                stamp, config.track_frame, (float(block.speed[row, 0]), 0.0, 0.0), zero))
        yield Event(stamp, 'slave/imu', ImuSample(
            stamp, aircraft, None, zero, tuple(block.slave_rate[row, 0].tolist()),
            tuple(block.slave_force[row, 0].tolist())))
        yield Event(stamp, 'alignment/truth', VectorSample(
            stamp, aircraft, tuple(self._sensors.misalignment[0].tolist())))

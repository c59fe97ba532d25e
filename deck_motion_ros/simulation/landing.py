"""An aircraft that comes to a rolling deck, the radios there, and the inertial units of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from math import ceil, exp, inf, pi, radians, sqrt
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from deck_motion_ros.config import parameter
from deck_motion_ros.geometry import quaternion_from_rpy, yaw_from_heading
from deck_motion_ros.samples import (
    Array,
    HeaveSample,
    ImuSample,
    nanoseconds,
    OdometrySample,
    RangeSample,
    Vector3,
)
from deck_motion_ros.simulation.sea import GRAVITY, Pan2020
from deck_motion_ros.simulation.sensors import AxisErrors, Delivery
from deck_motion_ros.simulation.ship import Course, Motion, ShipInWaves
from deck_motion_ros.simulation.simulator import (
    axis_errors,
    Event,
    ship_in_waves,
    SimulatorConfig,
    STEP,
)

CHUNK = 10.0  # s computed at once
TILT_SD = (0.02, 0.03, 0.03)  # rad: yaw, pitch, roll of the aircraft
NLOS_LEAST = 0.3  # m: by so much a range without line of sight is too long at least
PAN2020_PLATFORM = (1.5, 1.5, 0.5, -1.5, 1.5, 1.0, -1.5, -1.5, 0.5, 1.5, -1.5, 1.0)


@dataclass(frozen=True, slots=True)
class LandingSimulatorConfig(SimulatorConfig):
    """Parameters of the scenario ``landing``; the defaults are a helicopter and a destroyer."""

    scenario: str = parameter(
        'landing', 'landing: an aircraft comes to the deck',
        choices=('sea', 'shaping', 'catapult', 'landing', 'altitude'))
    deck: str = parameter(
        'hull', 'How the deck moves: hull = as the hull of that name in the sea of these '
        'parameters; pan2020 = as the small boat of Pan2020 in sea state 4',
        choices=('hull', 'pan2020'))
    boat_rotation: float = parameter(
        1.0, "What roll, pitch and yaw of Pan2020's boat are multiplied by", '', 0.0, 2.0)
    deck_lever_arm: Vector3 = parameter(
        (-67.97, 3.05, 19.5), 'Origin of deck in ship_base_link: forward, left, up', 'm',
        -1000.0, 1000.0, length=3)
    anchor_frames: tuple[str, ...] = parameter(
        ('anchor_1', 'anchor_2', 'anchor_3', 'anchor_4'), 'frame_id of the ranges to each anchor')
    anchor_positions: tuple[float, ...] = parameter(
        PAN2020_PLATFORM, 'x, y, z of each anchor in deck, as the landing node is told', 'm')
    survey_sd: float = parameter(
        0.0, 'Error of that, of each coordinate: where the anchors really are', 'm', 0.0, 10.0)

    range_rate: float = parameter(10.0, 'Ranges per second to each anchor', 'Hz', 0.1, 200.0)
    range_spacing: float = parameter(
        0.0, 'Between the ranges to one anchor and the next; 0 = all at once', 's', 0.0, 1.0)
    range_white_sd: float = parameter(0.05, 'White noise of ranges', 'm', 0.0, 10.0)
    range_bias_sd: float = parameter(
        0.0, 'Constant error of the ranges to each anchor', 'm', 0.0, 10.0)
    nlos_share: float = parameter(
        0.0, 'Share of the ranges that are too long, without line of sight', '', 0.0, 1.0)
    nlos_excess: float = parameter(
        1.0, 'By how much more than 0.3 m on average (exponential)', 'm', 0.0, 100.0)
    range_dropout: float = parameter(0.0, 'Share of ranges that are lost', '', 0.0, 1.0)
    outage_start: float = parameter(0.0, 'No range at all from then on', 's', 0.0, 1e7)
    outage_duration: float = parameter(0.0, 'for this long', 's', 0.0, 1e7)
    lost_anchor: str = parameter('', 'frame_id of an anchor that fails')
    lost_time: float = parameter(20.0, 'when it fails', 's', 0.0, 1e7)
    moved_anchor: str = parameter('', 'frame_id of an anchor that is moved')
    moved_time: float = parameter(20.0, 'when it is moved', 's', 0.0, 1e7)
    moved_by: Vector3 = parameter(
        (1.0, 0.0, 0.0), 'where to, relative to its place, in deck', 'm', -100.0, 100.0, length=3)

    uav_start: Vector3 = parameter(
        (10.0, 20.0, 15.0), 'Aircraft over the deck at the start', 'm', -1e4, 1e4, length=3)
    approach_time: float = parameter(20.0, 'until it is above the deck', 's', 1.0, 1e4)
    hold_time: float = parameter(20.0, 'until it descends', 's', 0.0, 1e4)
    descent_time: float = parameter(20.0, 'until it is down', 's', 1.0, 1e4)
    final_height: float = parameter(0.0, 'over the deck then', 'm', 0.0, 100.0)
    follow_lag: float = parameter(
        0.4, 'By how much the aircraft is late when it follows the deck', 's', 0.0, 10.0)
    wander_sd: Vector3 = parameter(
        (0.3, 0.3, 0.15), 'How gusts move it about: forward, left, up', 'm', 0.0, 100.0, length=3)
    uav_heading_deg: float = parameter(
        90.0, 'Heading, clockwise from north', 'deg', -360.0, 360.0)
    antenna_lever_arm: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'Its radio in uav_base_link', 'm', -100.0, 100.0, length=3)

    uav_rate: float = parameter(
        100.0, 'Samples of uav/imu per second; 0 = none', 'Hz', 0.0, 1000.0)
    uav_attitude_sd: float = parameter(0.002, 'White noise of its attitude', 'rad', 0.0, 1.0)
    uav_attitude_drift_sd: float = parameter(0.002, 'Slow error of it', 'rad', 0.0, 1.0)
    uav_gyro_white_sd: float = parameter(0.002, 'White noise of its turn rates', 'rad/s', 0.0)
    uav_gyro_drift_sd: float = parameter(5e-4, 'Slow error of them', 'rad/s', 0.0)
    uav_accel_white_sd: float = parameter(
        0.05, 'White noise of its specific force', 'm/s^2', 0.0)
    uav_accel_drift_sd: float = parameter(0.03, 'Slow error of it', 'm/s^2', 0.0)
    uav_drift_time: float = parameter(
        100.0, 'Correlation time of these slow errors', 's', 0.001)

    deck_frame: str = parameter('deck', 'axes of the ship, origin on the landing platform')
    uav_deck_frame: str = parameter('uav_deck', 'at the aircraft, parallel to deck')
    uav_base_link_frame: str = parameter('uav_base_link', 'frame of the aircraft')


class Wandering(NamedTuple):
    """
    Smooth random motion along k axes: sums of cosines of n frequencies.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        rad/s.
    even, odd : ndarray, shape (n, k)
        What each cosine and sine adds to each axis.

    """

    omega: Array
    even: Array
    odd: Array

    @classmethod
    def draw(cls, omega: Array, var: Array, rng: np.random.Generator) -> Wandering:
        """Draw it; ``var``, shape (n, k), is the variance of each cosine."""
        amplitude, phase = np.sqrt(2 * var), rng.uniform(0, 2 * pi, var.shape)
        return cls(omega, amplitude * np.cos(phase), amplitude * np.sin(phase))

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return values and rates at ``times`` (s), shape (m, k)."""
        angle = np.outer(times, self.omega)
        even, odd = np.cos(angle), np.sin(angle)
        return (even @ self.even + odd @ self.odd,
                (even * self.omega) @ self.odd - (odd * self.omega) @ self.even)


def _spread(low: float, high: float, number: int, rng: np.random.Generator) -> tuple[
        Array, float]:
    """Return frequencies, one drawn from each of equal bands, and the width of these."""
    width = (high - low) / number
    return low + width * (np.arange(number) + rng.random(number)), width


class Pan2020Boat:
    """
    The small boat of Pan2020 in sea state 4.

    Roll, pitch and yaw fill the bands and ranges that the paper reports; surge, sway and heave
    are each the sea's elevation (eq 20-22, significant height 1.875 m).

    Parameters
    ----------
    rotation : float
        What the angles are multiplied by.
    course : Course
        Of the boat.
    rng : Generator
        Source of the phases.

    """

    def __init__(self, rotation: float, course: Course, rng: np.random.Generator) -> None:
        self._course = course
        sea, width = _spread(0.2, 4 * pi, 100, rng)
        bands = [_spread(2 * pi * low, 2 * pi * high, 30, rng)[0]
                 for low, high in ((0.2, 0.5), (0.2, 0.7), (0.05, 0.3))]
        var = np.zeros((190, 6))
        var[:100, :3] = (Pan2020(1.875).density(sea) * width)[:, None]
        for axis, sd in enumerate((2.8, 4.8, 6.0)):
            var[100 + 30 * axis:130 + 30 * axis, 3 + axis] = (rotation * radians(sd))**2 / 30
        self._waves = Wandering.draw(np.concatenate([sea, *bands]), var, rng)
        self._mean = np.array([0.0, 0.0, 0.0, radians(-3.0) * rotation, 0.0, 0.0])

    def motion(self, times: Array) -> Motion:
        """Return the motion at ``times`` (s), shape (m,)."""
        value, rate = self._waves.at(times)
        return Motion(self._course.at(times), value + self._mean, rate)


@dataclass(frozen=True, eq=False)
class Body:
    """
    Ship or aircraft at n times.

    Attributes
    ----------
    position, velocity : ndarray, shape (n, 3)
        In ``ship_level`` (m, m/s).
    turn : Rotation
        n, body to ``ship_level``.
    enu_turn : Rotation
        n, body to east, north, up.
    enu_velocity : ndarray, shape (n, 3)
        The mean course included (m/s).

    """

    position: Array
    velocity: Array
    turn: Rotation
    enu_turn: Rotation
    enu_velocity: Array


class LandingScene:
    """
    The truth: ship, deck and aircraft at any time.

    Parameters
    ----------
    config : LandingSimulatorConfig
        The scene.

    """

    def __init__(self, config: LandingSimulatorConfig) -> None:
        self._config = config
        rng = np.random.default_rng([config.seed, 2])
        ship: ShipInWaves | Pan2020Boat = (
            ship_in_waves(config) if config.deck == 'hull' else Pan2020Boat(
                config.boat_rotation,
                Course(yaw_from_heading(radians(config.course_deg)), config.speed), rng))
        self._motion_at = ship.motion
        self._newest: tuple[Array, Motion] | None = None
        omega, _ = _spread(0.05, 8.0, 60, rng)
        # a helicopter that holds its place (1 rad/s, damping 0.7) in gusts that last 1 s
        share = 1 / (((1 - omega**2)**2 + (1.4 * omega)**2) * (1 + omega**2))
        sd = np.array([*config.wander_sd, *TILT_SD])
        self._wander = Wandering.draw(omega, np.outer(share / share.sum(), sd**2), rng)
        self.arm = np.array(config.deck_lever_arm)

    def motion(self, times: Array) -> Motion:
        """Return the ship's motion at ``times`` (s), shape (n,), rising."""
        if self._newest is None or self._newest[0] is not times:
            self._newest = times, self._motion_at(times)
        return self._newest[1]

    def ship(self, times: Array) -> Body:
        """Return the ship at ``times`` (s), shape (n,), rising."""
        motion = self.motion(times)
        roll, pitch, yaw = motion.value[:, 3:].T
        position, velocity = motion.value[:, :3], motion.rate[:, :3]
        return _body(motion, position, velocity, np.stack([yaw, pitch, roll], axis=1))

    def deck(self, times: Array) -> tuple[Array, Array, Rotation]:
        """Return position and velocity of the deck's origin in ``ship_level``, and its turn."""
        motion = self.motion(times)
        roll, pitch, yaw = motion.value[:, 3:].T
        turn = Rotation.from_euler('ZYX', np.stack([yaw, pitch, roll], axis=1))
        rate = turn_rate(motion)
        return (motion.value[:, :3] + turn.apply(self.arm),
                motion.rate[:, :3] + turn.apply(np.cross(rate, self.arm)), turn)

    def aircraft(self, times: Array) -> Body:
        """Return the aircraft at ``times`` (s), shape (n,), rising."""
        config = self._config
        path, path_rate, share, share_rate = self._path(times)
        motion = self.motion(times)
        deck, deck_rate, _ = self.deck(times - config.follow_lag)
        wander, wander_rate = self._wander.at(times)
        away = deck - self.arm
        position = self.arm + path + share * away + wander[:, :3]
        velocity = path_rate + share * deck_rate + share_rate * away + wander_rate[:, :3]
        tilt = wander[:, 3:]
        tilt[:, 0] += yaw_from_heading(radians(config.uav_heading_deg)) - motion.track.yaw
        return _body(motion, position, velocity, tilt)

    def over_deck(self, times: Array) -> tuple[Array, Array]:
        """Return position of the aircraft in ``deck`` and its rate there, shape (n, 3)."""
        (position, velocity, turn), rate = self.deck(times), turn_rate(self.motion(times))
        aircraft = self.aircraft(times)
        over = turn.inv().apply(aircraft.position - position)
        return over, turn.inv().apply(aircraft.velocity - velocity) - np.cross(rate, over)

    def _path(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Return the aircraft's way over the deck, how far it follows the deck, and both rates."""
        config = self._config
        near, near_rate = _smooth(times / config.approach_time)
        down_start = config.approach_time + config.hold_time
        down, down_rate = _smooth((times - down_start) / config.descent_time)
        x, y, z = config.uav_start
        drop = z - config.final_height
        near_rate, down_rate = near_rate / config.approach_time, down_rate / config.descent_time
        path = np.stack([x * (1 - near), y * (1 - near), z - drop * down], axis=1)
        path_rate = np.stack([-x * near_rate, -y * near_rate, -drop * down_rate], axis=1)
        return (path, path_rate, np.stack([near, near, down], axis=1),
                np.stack([near_rate, near_rate, down_rate], axis=1))


def _smooth(u: Array) -> tuple[Array, Array]:
    """Rise from 0 to 1 while ``u`` does, with a continuous rate; return value and rate."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * (3 - 2 * u), 6 * u * (1 - u)


def turn_rate(motion: Motion) -> Array:
    """Return the turn rate relative to ``ship_level`` in body axes (rad/s), shape (n, 3)."""
    roll, pitch, _ = motion.value[:, 3:].T
    by_roll, by_pitch, by_yaw = motion.rate[:, 3:].T
    along = by_yaw * np.cos(pitch)
    return np.stack([by_roll - by_yaw * np.sin(pitch),
                     np.cos(roll) * by_pitch + np.sin(roll) * along,
                     np.cos(roll) * along - np.sin(roll) * by_pitch], axis=1)


def _body(motion: Motion, position: Array, velocity: Array, yaw_pitch_roll: Array) -> Body:
    track = motion.track
    mean = Rotation.from_euler('z', track.yaw[:, None])
    turn = Rotation.from_euler('ZYX', yaw_pitch_roll)
    carried = np.cross(np.stack([0 * track.yaw, 0 * track.yaw, track.yaw_rate], axis=1), position)
    enu = mean.apply(velocity + carried)
    enu[:, :2] += track.velocity
    return Body(position, velocity, turn, mean * turn, enu)


def inertial(body: Body, dt: float, pieces: int) -> tuple[Array, Array]:
    """
    Average turn rate and specific force over intervals, in the body's own turning axes.

    Parameters
    ----------
    body : Body
        At n * ``pieces`` + 1 times.
    dt : float
        Between these (s).
    pieces : int
        In an interval.

    Returns
    -------
    rate, force : ndarray, shape (n, 3)
        rad/s, m/s^2 (+g up at rest).

    """
    before, after = body.enu_turn[:-1], body.enu_turn[1:]
    turns = (before.inv() * after).as_rotvec()
    middle = before * Rotation.from_rotvec(turns / 2)
    force = middle.inv().apply(np.diff(body.enu_velocity, axis=0) / dt + [0.0, 0.0, GRAVITY])
    return (turns.reshape(-1, pieces, 3).mean(axis=1) / dt,
            force.reshape(-1, pieces, 3).mean(axis=1))


class ErrorStream:
    """
    Errors of some axes of a sensor, sample after sample.

    Parameters
    ----------
    errors : list of AxisErrors
        Of each axis (resolution aside).
    period : float
        Between samples (s).
    rng : Generator
        Source of the noise.

    """

    def __init__(self, errors: list[AxisErrors], period: float, rng: np.random.Generator) -> None:
        self._errors, self._rng = errors, rng
        self._keep = [exp(-period / item.drift_time) for item in errors]
        self._drift = [item.drift_sd * rng.standard_normal() for item in errors]

    def draw(self, count: int) -> Array:
        """Return the next ``count`` errors, shape (count, axes)."""
        columns = np.empty((count, len(self._errors)))
        for k, (item, keep) in enumerate(zip(self._errors, self._keep, strict=True)):
            white = self._rng.standard_normal(count)
            drive = item.drift_sd * sqrt(1 - keep * keep) * self._rng.standard_normal(count)
            drift, _ = lfilter([1.0], [1.0, -keep], drive, zi=[keep * self._drift[k]])
            self._drift[k] = drift[-1] if count else self._drift[k]
            columns[:, k] = item.bias + drift + item.white_sd * white
        return columns


class LandingSimulator:
    """
    Iterate, once, over a run's samples in the order in which they arrive.

    ``ship/imu``, ``ship/heave``, ``ship/truth`` and ``landing/truth`` at ``start`` + k / rate,
    ``uav/imu`` at ``start`` + k / uav_rate, a round of ``uwb/range`` every 1 / range_rate. Turn
    rates and specific forces are means over the interval before.

    Parameters
    ----------
    config : LandingSimulatorConfig
        The run.
    start : int
        Stamp of the first samples (ns).
    truth : bool
        Whether the topics of the truth are wanted; the others do not depend on it.

    Attributes
    ----------
    scene : LandingScene
        The truth at any time.
    anchors : ndarray, shape (n, 3)
        Where the anchors really are, in ``deck`` (m).

    Raises
    ------
    ValueError
        If names and positions of the anchors do not fit.

    """

    def __init__(self, config: LandingSimulatorConfig, start: int = 0, *,
                 truth: bool = True) -> None:
        names = config.anchor_frames
        if len(config.anchor_positions) != 3 * len(names):
            raise ValueError(f"parameter 'anchor_positions' needs {3 * len(names)} numbers for "
                             f'{len(names)} anchor_frames, not {len(config.anchor_positions)}')
        self._config, self._start, self._with_truth = config, start, truth
        self.scene = LandingScene(config)
        self._rng = rng = np.random.default_rng([config.seed, 1])
        surveyed = np.reshape(config.anchor_positions, (-1, 3))
        self.anchors = surveyed + config.survey_sd * rng.standard_normal(surveyed.shape)
        self._range_bias = config.range_bias_sd * rng.standard_normal(len(names))
        self._ship_errors = ErrorStream(axis_errors(config), 1 / config.rate, rng)
        attitude = AxisErrors(config.uav_attitude_sd, config.uav_attitude_drift_sd,
                              config.uav_drift_time)
        gyro = AxisErrors(config.uav_gyro_white_sd, config.uav_gyro_drift_sd,
                          config.uav_drift_time)
        accel = AxisErrors(config.uav_accel_white_sd, config.uav_accel_drift_sd,
                           config.uav_drift_time)
        self._uav_errors = ErrorStream([attitude] * 3 + [gyro] * 3 + [accel] * 3,
                                       1 / (config.uav_rate or inf), rng)
        self._deliveries = [
            Delivery(*values) for values in zip(config.latency, config.jitter, config.delay,
                                                config.dropout, strict=True)]
        self._events = self._run()

    def __iter__(self) -> Iterator[Event]:
        return self._events

    def _run(self) -> Iterator[Event]:
        config = self._config
        pending: list[Event] = []
        for k in count():
            first, last = k * CHUNK, (k + 1) * CHUNK
            if 0 < config.duration < last:
                last = config.duration
            made = [*self._ship(first, last), *self._uav(first, last), *self._ranges(first, last)]
            if self._with_truth:
                made += self._truth(first, last)
            pending = sorted([*pending, *made], key=lambda event: event.time)
            end = self._start + nanoseconds(last)
            done = len(pending) if last == config.duration else sum(
                event.time < end for event in pending)
            yield from pending[:done]
            pending = pending[done:]
            if last == config.duration:
                return

    def _stamps(self, first: float, last: float, rate: float) -> tuple[Array, list[int]]:
        """Return the times (s) of the samples from ``first`` to before ``last``, and stamps."""
        numbers = np.arange(ceil(first * rate - 1e-6), ceil(last * rate - 1e-6))
        times = numbers / rate
        return times, [self._start + nanoseconds(time) for time in times.tolist()]

    def _ship(self, first: float, last: float) -> Iterator[Event]:
        config, (times, stamps) = self._config, self._stamps(first, last, self._config.rate)
        if not stamps:
            return
        pieces = ceil(1 / config.rate / STEP - 1e-9)
        dt = 1 / config.rate / pieces
        body = self.scene.ship(_grid(times, pieces, dt))
        rate, force = inertial(body, dt, pieces)
        at = slice(pieces, None, pieces)
        errors = self._ship_errors.draw(len(times))
        yaw, pitch, roll = body.enu_turn[at].as_euler('ZYX').T
        attitudes = np.stack([roll, pitch, yaw], axis=1) + errors[:, :3]
        heave = body.position[at, 2] + errors[:, 3]
        rate, force = rate + errors[:, 4:7], force + errors[:, 7:]
        roll_errors, pitch_errors, yaw_errors = axis_errors(config)[:3]
        var = (roll_errors.var, pitch_errors.var, yaw_errors.var)
        level, ship = config.ship_level_frame, config.ship_base_link_frame
        for k, stamp in enumerate(stamps):
            imu, heave_times = (delivery.deliver(stamp, 1 / config.rate, self._rng)
                                for delivery in self._deliveries)
            if imu:
                yield Event(imu[1], 'ship/imu', ImuSample(
                    imu[0], ship, quaternion_from_rpy(*attitudes[k].tolist()), var,
                    _vector(rate[k]), _vector(force[k])))
            if heave_times:
                yield Event(heave_times[1], 'ship/heave',
                            HeaveSample(heave_times[0], level, float(heave[k])))

    def _truth(self, first: float, last: float) -> Iterator[Event]:
        config, (times, stamps) = self._config, self._stamps(first, last, self._config.rate)
        if not stamps:
            return
        motion, ship = self.scene.motion(times), self.scene.ship(times)
        # nav_msgs/Odometry: the twist is in the axes of the child
        velocity, rate = ship.turn.inv().apply(ship.velocity), turn_rate(motion)
        over, over_rate = self.scene.over_deck(times)
        attitudes, unknown = ship.turn.as_quat().tolist(), (0.0,) * 6
        for k, stamp in enumerate(stamps):
            yield Event(stamp, 'ship/truth', OdometrySample(
                stamp, config.ship_level_frame, config.ship_base_link_frame,
                _vector(ship.position[k]), tuple(attitudes[k]), _vector(velocity[k]),
                _vector(rate[k]), unknown))
            yield Event(stamp, 'landing/truth', OdometrySample(
                stamp, config.deck_frame, config.uav_deck_frame, _vector(over[k]),
                (0.0, 0.0, 0.0, 1.0), _vector(over_rate[k]), (0.0, 0.0, 0.0), unknown))

    def _uav(self, first: float, last: float) -> Iterator[Event]:
        config = self._config
        if config.uav_rate == 0:
            return
        times, stamps = self._stamps(first, last, config.uav_rate)
        if not stamps:
            return
        pieces = ceil(1 / config.uav_rate / STEP - 1e-9)
        dt = 1 / config.uav_rate / pieces
        body = self.scene.aircraft(_grid(times, pieces, dt))
        rate, force = inertial(body, dt, pieces)
        errors = self._uav_errors.draw(len(times))
        wrong = Rotation.from_rotvec(errors[:, :3])  # about east, north, up
        attitudes = (wrong * body.enu_turn[pieces::pieces]).as_quat().tolist()
        rate, force = rate + errors[:, 3:6], force + errors[:, 6:]
        var = (config.uav_attitude_sd**2 + config.uav_attitude_drift_sd**2,) * 3
        for k, stamp in enumerate(stamps):
            yield Event(stamp, 'uav/imu', ImuSample(
                stamp, config.uav_base_link_frame, tuple(attitudes[k]), var, _vector(rate[k]),
                _vector(force[k])))

    def _ranges(self, first: float, last: float) -> Iterator[Event]:
        config, rng, names = self._config, self._rng, self._config.anchor_frames
        rounds, _ = self._stamps(first, last, config.range_rate)
        count = len(names)
        times = (rounds[:, None] + config.range_spacing * np.arange(count)).ravel()
        owner = np.tile(np.arange(count), len(rounds))
        anchors = self.anchors[owner]
        if config.moved_anchor in names:
            moved = (owner == names.index(config.moved_anchor)) & (times >= config.moved_time)
            anchors[moved] += config.moved_by
        order = np.argsort(times, kind='stable')
        times, owner, anchors = times[order], owner[order], anchors[order]
        if not len(times):
            return
        aircraft, (origin, _, turn) = self.scene.aircraft(times), self.scene.deck(times)
        antenna = aircraft.position + aircraft.turn.apply(config.antenna_lever_arm)
        distance = np.linalg.norm(antenna - origin - turn.apply(anchors), axis=1)
        excess = NLOS_LEAST + rng.exponential(config.nlos_excess, len(times))
        distance += (self._range_bias[owner]
                     + config.range_white_sd * rng.standard_normal(len(times))
                     + excess * (rng.random(len(times)) < config.nlos_share))
        lost = rng.random(len(times)) < config.range_dropout
        lost |= (times >= config.outage_start) & (
            times < config.outage_start + config.outage_duration)
        if config.lost_anchor in names:
            lost |= (owner == names.index(config.lost_anchor)) & (times >= config.lost_time)
        for time, number, value in zip(times[~lost].tolist(), owner[~lost].tolist(),
                                       distance[~lost].tolist(), strict=True):
            stamp = self._start + nanoseconds(time)
            yield Event(stamp, 'uwb/range', RangeSample(stamp, names[number], value, 0.0))


def _grid(times: Array, pieces: int, dt: float) -> Array:
    """Return the times of the pieces of intervals that end at ``times``, and the start."""
    return np.asarray(times[0] + dt * np.arange(-pieces, (len(times) - 1) * pieces + 1))


def _vector(row: Array) -> Vector3:
    x, y, z = row.tolist()
    return (x, y, z)

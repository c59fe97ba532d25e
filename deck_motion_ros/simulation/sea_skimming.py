"""An aircraft low over the sea: her flight, the sea under her, her altimeter and accelerometer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import atan2, cos, exp, hypot, inf, radians, sin

import numpy as np
from scipy.signal import lfilter

from deck_motion_ros.config import parameter
from deck_motion_ros.geometry import conjugate, quaternion_from_rpy, rotated, yaw_from_heading
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    nanoseconds,
    OdometrySample,
    RangeSample,
    VelocitySample,
)
from deck_motion_ros.simulation.sea import GRAVITY, joined, random_waves, Waves
from deck_motion_ros.simulation.sensors import Delivery
from deck_motion_ros.simulation.simulator import Event, SimulatorConfig, wave_systems

AIRSPEED = 20.0  # m/s at least: a slower aircraft does not pitch along her path


@dataclass(frozen=True, slots=True)
class SkimmingSimulatorConfig(SimulatorConfig):
    """Parameters of the scenario ``altitude``: a helicopter at 60 m/s over sea state 7."""

    scenario: str = parameter('altitude', 'an aircraft low over the sea', choices=('altitude',))
    rate: float = parameter(100.0, 'samples of uav/imu per second', 'Hz', 1.0, 1000.0)
    altimeter_rate: float = parameter(
        100.0, 'samples of altimeter/range and altimeter/rate per second, at most rate; rounded '
        'so that rate is a multiple of it', 'Hz', 0.1, 1000.0)

    speed: float = parameter(60.0, 'of the aircraft; 0 = hover', 'm/s', 0.0, 400.0)
    profile_heights: tuple[float, ...] = parameter(
        (45.0, 8.0, 35.0), 'heights above mean sea level: first, low, last', 'm', 0.0, 1e4,
        length=3)
    profile_times: tuple[float, ...] = parameter(
        (5.0, 60.0), 'when descent and climb begin', 's', 0.0, 1e7, length=2)
    transition_time: float = parameter(12.0, 'from one height to the next', 's', 0.1, 1e5)

    significant_wave_height: float = parameter(7.5, 'of the wind sea', 'm', 0.0, 20.0)
    peak_period: float = parameter(15.03, 'of the wind sea: 1.296 mean periods', 's', 2.0, 30.0)
    wave_heading_deg: float = parameter(
        180.0, 'direction the waves travel towards, counter-clockwise from the course: '
        '0 = following, 90 = from starboard, 180 = head sea', 'deg', -360.0, 360.0)
    footprint: float = parameter(
        0.0, 'radius over which the altimeter averages the surface', 'm', 0.0, 1000.0)
    rate_sees_waves: bool = parameter(
        False, "altimeter/rate is that of the range, waves included, not the aircraft's own")

    altimeter_bias_sd: float = parameter(1.0, 'constant error of the range', 'm', 0.0)
    altimeter_sd: float = parameter(0.5, 'noise of the range', 'm', 0.0)
    rate_bias_sd: float = parameter(0.2, 'constant error of altimeter/rate', 'm/s', 0.0)
    rate_sd: float = parameter(0.2, 'noise of altimeter/rate', 'm/s', 0.0)
    accel_bias_sd: float = parameter(
        0.05, 'error of the specific force along the z axis from one switching on to the next',
        'm/s^2', 0.0)
    accel_drift_sd: float = parameter(0.05, 'its slow error, a Markov process', 'm/s^2', 0.0)
    accel_white_sd: float = parameter(0.05, 'its noise', 'm/s^2', 0.0)
    inertial_drift_time: float = parameter(
        0.2, 'correlation time of the slow error', 's', 0.001)

    latency: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and altimeter: the data are this much older than their stamp',
        's', 0.0, 10.0, length=2)
    jitter: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and altimeter: sd of the stamp about that', 's', 0.0, 1.0, length=2)
    delay: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and altimeter: a message comes this long after its stamp',
        's', 0.0, 10.0, length=2)
    dropout: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and altimeter: probability that a message is lost',
        '', 0.0, 1.0, length=2)
    loss_of_lock: tuple[float, ...] = parameter(
        (0.0, 0.0), 'from and to: the altimeter has no echo and says +inf (REP-117)', 's', 0.0,
        length=2)
    obstacle: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), 'from (s), to (s), height (m): what the altimeter sees instead of the '
        'water, such as a deck', '', 0.0, length=3)

    uav_base_link_frame: str = parameter('uav_base_link', 'frame of the aircraft')
    uav_level_frame: str = parameter('uav_level', 'level frame at the aircraft')
    mean_sea_frame: str = parameter('mean_sea', 'level frame, z up from mean sea level')


@dataclass(frozen=True)
class Profile:
    """
    Heights to fly: a fifth-order step at each time, smooth up to the acceleration.

    Attributes
    ----------
    heights, times : tuple of float
        Metres; seconds at which each step to the next height begins.
    transition : float
        Duration of a step (s).

    """

    heights: tuple[float, ...]
    times: tuple[float, ...]
    transition: float

    def at(self, time: float) -> tuple[float, float, float, float]:
        """Return height (m), rate, acceleration and jerk at ``time`` (s)."""
        height, rate, acceleration, jerk = self.heights[0], 0.0, 0.0, 0.0
        for step, start in zip(np.diff(self.heights).tolist(), self.times, strict=True):
            u = min(max((time - start) / self.transition, 0.0), 1.0)
            v = 1 - u
            height += step * u**3 * (10 + u * (6 * u - 15))
            rate += step / self.transition * 30 * (u * v)**2
            acceleration += step / self.transition**2 * 60 * u * v * (v - u)
            jerk += step / self.transition**3 * 60 * (1 - 6 * u * v) * (0.0 < u < 1.0)
        return height, rate, acceleration, jerk


class Autopilot:
    """
    Fly a profile: what is known of height and rate in, the aircraft's vertical motion out.

    The commanded acceleration is that of the profile, its lag undone, and a proportional and
    differential correction; the aircraft follows with a first-order lag.

    Parameters
    ----------
    profile : Profile
        What to fly; the flight begins on it.
    dt : float
        Seconds from step to step.
    runs : tuple of int
        Shape of height and rate: () for one aircraft, (n,) for many.

    Attributes
    ----------
    height, rate : ndarray
        True, now (m, m/s).

    """

    STIFFNESS, DAMPING, LAG = 1.0, 1.8, 0.3  # 1/s^2, 1/s, s

    def __init__(self, profile: Profile, dt: float, runs: tuple[int, ...] = ()) -> None:
        self._profile, self._dt, self._steps = profile, dt, 0
        self.height = np.full(runs, profile.heights[0])
        self.rate, self._acceleration = np.zeros(runs), np.zeros(runs)

    def step(self, height: Array, rate: Array) -> Array:
        """Fly one step, believing ``height`` and ``rate``; return the mean acceleration."""
        want, want_rate, acceleration, jerk = self._profile.at(self._steps * self._dt)
        command = (acceleration + self.LAG * jerk + self.DAMPING * (want_rate - rate)
                   + self.STIFFNESS * (want - height))
        dt, lag = self._dt, self.LAG
        excess = self._acceleration - command
        share = 1 - exp(-dt / lag)
        gained = command * dt + excess * lag * share
        self.height = (self.height + self.rate * dt + command * dt * dt / 2
                       + excess * lag * (dt - lag * share))
        self.rate = self.rate + gained
        self._acceleration = command + excess * (1 - share)
        self._steps += 1
        return np.asarray(gained / dt)


@dataclass(frozen=True, eq=False)
class Disturbances:
    """
    What comes between the true motion and the sensors' readings, each of shape (steps, runs).

    Attributes
    ----------
    elevation, elevation_rate : ndarray
        Of the surface under the aircraft (m), and how fast that rises (m/s).
    range, rate : ndarray
        Errors of the altimeter, waves aside (m, m/s).
    acceleration : ndarray
        Error of the accelerometer (m/s^2), mean over the step that ends.

    """

    elevation: Array
    elevation_rate: Array
    range: Array
    rate: Array
    acceleration: Array


class DisturbanceSource:
    """
    Draw the disturbances of many runs, stretch by stretch; run k is that of seed + k alone.

    Parameters
    ----------
    config : SkimmingSimulatorConfig
        Sea, flight and sensors.
    runs : int
        How many.

    """

    def __init__(self, config: SkimmingSimulatorConfig, runs: int = 1) -> None:
        self._config, self._steps = config, 0
        self._rngs = [np.random.default_rng([config.seed + k, 2]) for k in range(runs)]
        self._seas = [_encountered(config, np.random.default_rng([config.seed + k, 0]))
                      for k in range(runs)]
        first = np.array([rng.normal(size=4) for rng in self._rngs]).T
        self._range_bias, self._rate_bias, self._accel_bias, self._drift = first * np.array(
            [[config.altimeter_bias_sd], [config.rate_bias_sd], [config.accel_bias_sd],
             [config.accel_drift_sd]])

    def take(self, steps: int) -> Disturbances:
        """Return the next ``steps`` steps."""
        config = self._config
        times = (self._steps + np.arange(steps)) / config.rate
        self._steps += steps
        surface = np.array([_surface(sea, times, config.rate_sees_waves) for sea in self._seas])
        ranged, rated, white, driven = np.moveaxis(
            np.array([rng.normal(size=(steps, 4)) for rng in self._rngs]), (2, 1), (0, 1))
        keep = exp(-1 / (config.rate * config.inertial_drift_time))
        drift, last = lfilter(
            [config.accel_drift_sd * (1 - keep * keep)**0.5], [1.0, -keep], driven, axis=0,
            zi=keep * self._drift[None])
        self._drift = drift[-1]
        return Disturbances(
            surface[:, 0].T, surface[:, 1].T,
            self._range_bias + config.altimeter_sd * ranged,
            self._rate_bias + config.rate_sd * rated,
            self._accel_bias + drift + config.accel_white_sd * white)


def _encountered(config: SkimmingSimulatorConfig, rng: np.random.Generator) -> Waves:
    """Draw a sea; its frequencies are those of encounter, amplitudes those of the footprint."""
    sea = joined(random_waves(system, config.waves, rng) for system in wave_systems(config))
    yaw = _yaw(config)
    along = np.array([cos(yaw), sin(yaw)]) @ sea.vectors
    smooth = np.exp(-np.square(sea.omega**2 / GRAVITY * config.footprint) / 4)
    return Waves(sea.amplitude * smooth, sea.omega - config.speed * along, sea.direction,
                 sea.phase)


def _surface(sea: Waves, times: Array, with_rate: bool) -> tuple[Array, Array]:
    angle = np.outer(times, sea.omega) + sea.phase
    rate = np.sin(angle) @ (-sea.amplitude * sea.omega) if with_rate else np.zeros(len(times))
    return np.cos(angle) @ sea.amplitude, rate


def _yaw(config: SkimmingSimulatorConfig) -> float:
    return yaw_from_heading(radians(config.course_deg))


def profile(config: SkimmingSimulatorConfig) -> Profile:
    """Make the profile of a configuration."""
    return Profile(config.profile_heights, config.profile_times, config.transition_time)


class SkimmingSimulator:
    """
    Iterate, once, over a flight's samples in the order in which they arrive.

    ``uav/imu`` and ``altitude/truth`` come at ``start`` + k / rate, ``altimeter/range`` and
    ``altimeter/rate`` at some of these instants, before them. The specific force is the mean over
    the interval before; ``altitude/truth`` is free of errors. The autopilot knows the truth.

    Parameters
    ----------
    config : SkimmingSimulatorConfig
        The flight.
    start : int
        Stamp of the first samples (ns).

    """

    def __init__(self, config: SkimmingSimulatorConfig, start: int = 0) -> None:
        self._config, self._start = config, start
        self._source = DisturbanceSource(config)
        self._pilot = Autopilot(profile(config), 1 / config.rate)
        self._rng = np.random.default_rng([config.seed, 1])
        self._imu, self._altimeter = (
            Delivery(*values) for values in zip(config.latency, config.jitter, config.delay,
                                                config.dropout, strict=True))
        self._events = self._run()

    def __iter__(self) -> Iterator[Event]:
        return self._events

    def _run(self) -> Iterator[Event]:
        config, stretch = self._config, max(round(self._config.rate), 1)
        pending: list[tuple[int, int, Event]] = []
        order = count()
        for k in count():
            time = k / config.rate
            instant = self._start + nanoseconds(time)
            if 0 < config.duration <= time:
                break
            if k % stretch == 0:
                disturbed = self._source.take(stretch)
            while pending and pending[0][0] < instant:
                yield heappop(pending)[2]
            for event in self._sample(k, instant, disturbed, k % stretch):
                heappush(pending, (event.time, next(order), event))
        while pending:
            yield heappop(pending)[2]

    def _sample(self, k: int, instant: int, disturbed: Disturbances, row: int) -> Iterator[Event]:
        config, pilot, time = self._config, self._pilot, k / self._config.rate
        mean = pilot.step(pilot.height, pilot.rate) if k else np.zeros(())
        height, rate = float(pilot.height), float(pilot.rate)
        every = max(round(config.rate / config.altimeter_rate), 1)
        times = self._altimeter.deliver(instant, every / config.rate, self._rng)
        if times and k % every == 0:
            distance = height - disturbed.elevation[row, 0] + disturbed.range[row, 0]
            since, until, top = config.obstacle
            distance -= top * (since <= time < until)
            if config.loss_of_lock[0] <= time < config.loss_of_lock[1]:
                distance = inf
            seen = rate - disturbed.elevation_rate[row, 0] + disturbed.rate[row, 0]
            yield Event(times[1], 'altimeter/range', RangeSample(
                times[0], config.uav_level_frame, float(distance), 0.0))
            if distance < inf:
                yield Event(times[1], 'altimeter/rate', VelocitySample(
                    times[0], config.uav_level_frame, (0.0, 0.0, float(seen)), (0.0,) * 3))
        times = self._imu.deliver(instant, 1 / config.rate, self._rng)
        if times:
            path = atan2(rate, hypot(config.speed, AIRSPEED))
            attitude = quaternion_from_rpy(0.0, -path, _yaw(config))
            ahead, aside, up = rotated(conjugate(attitude), (0.0, 0.0, float(mean) + GRAVITY))
            white = config.accel_white_sd * self._rng.normal(size=2)
            yield Event(times[1], 'uav/imu', ImuSample(
                times[0], config.uav_base_link_frame, attitude, (0.0,) * 3, (0.0,) * 3,
                (ahead + float(white[0]), aside + float(white[1]),
                 up + float(disturbed.acceleration[row, 0]))))
        yield Event(instant, 'altitude/truth', OdometrySample(
            instant, config.mean_sea_frame, config.uav_level_frame, (0.0, 0.0, height),
            (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, rate), (0.0,) * 3, (0.0,) * 6))

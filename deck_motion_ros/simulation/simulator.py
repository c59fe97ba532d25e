"""The simulated ship as her sensors see her: configuration in, stamped samples out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import ceil, isfinite, nan, radians
from typing import NamedTuple

import numpy as np

from deck_motion_ros.config import parameter
from deck_motion_ros.geometry import (
    angular_velocity,
    conjugate,
    quaternion_from_rpy,
    rotated,
    rpy_from_quaternion,
    wrapped,
    yaw_from_heading,
)
from deck_motion_ros.samples import (
    HeaveSample,
    ImuSample,
    nanoseconds,
    OdometrySample,
    RangeSample,
    VectorSample,
    VelocitySample,
)
from deck_motion_ros.simulation.sea import (
    Bretschneider,
    joined,
    Jonswap,
    Pan2020,
    random_waves,
    Spectrum,
    WaveSystem,
)
from deck_motion_ros.simulation.sensors import AxisErrors, AxisSensor, Delivery
from deck_motion_ros.simulation.shaping import ShapingStates
from deck_motion_ros.simulation.ship import (
    Change,
    Course,
    HULLS,
    ShipInWaves,
    speed_up_at,
    turn_at,
)
from deck_motion_ros.simulation.states import mean_inertial, SeaStates

Sample = ImuSample | HeaveSample | OdometrySample | RangeSample | VelocitySample | VectorSample
STEP = 0.02  # s: longest piece of the interval over which rates and forces are averaged


@dataclass(frozen=True, slots=True)
class SimulatorConfig:
    """Parameters of the simulator; the defaults are a destroyer in sea state 5."""

    scenario: str = parameter(
        'sea', 'sea: a hull in a random sea; shaping: the shaping filters of Li2014, each axis '
        'alone', choices=('sea', 'shaping', 'catapult', 'landing', 'altitude'))
    seed: int = parameter(1, 'same seed, same sea and same noise', low=0, high=2**31 - 1)
    rate: float = parameter(50.0, 'samples per second', 'Hz', 1.0, 200.0)
    duration: float = parameter(0.0, 'end after this long; 0 = never', 's', 0.0, 1e7)
    realtime: bool = parameter(
        True, 'in real time by the clock of the node; false = as fast as possible, with /clock')
    fast_rate: float = parameter(
        1000.0, 'where not in real time, samples per second at most: what every reader keeps up '
        'with', 'Hz', 1.0, 1e5)
    subscribers: int = parameter(
        0, 'begin once this many subscribe to the first topic (ship/imu in a sea), so that none '
        'misses the start', '', 0, 99)

    hull: str = parameter('destroyer', 'ship', choices=tuple(HULLS))
    course_deg: float = parameter(
        90.0, 'mean course at the start, clockwise from north', 'deg', -360.0, 360.0)
    speed: float = parameter(7.5, 'speed at the start', 'm/s', 0.0, 25.0)
    turn_to_deg: float = parameter(
        nan, 'course to turn to, the short way; unset = no turn', 'deg', -360.0, 360.0)
    turn_time: float = parameter(300.0, 'when the turn begins', 's', 0.0, 1e7)
    turn_rate_deg: float = parameter(1.0, 'rate half way through the turn', 'deg/s', 0.01, 5.0)
    speed_to: float = parameter(
        nan, 'speed to change to; unset = no change', 'm/s', 0.0, 25.0)
    speed_change_time: float = parameter(300.0, 'when the change begins', 's', 0.0, 1e7)
    acceleration: float = parameter(
        0.05, 'acceleration half way through the change', 'm/s^2', 0.001, 1.0)

    spectrum: str = parameter(
        'bretschneider', 'of the wind sea; pan2020 has its own peak period',
        choices=('bretschneider', 'jonswap', 'pan2020'))
    significant_wave_height: float = parameter(3.25, 'of the wind sea', 'm', 0.0, 20.0)
    peak_period: float = parameter(9.7, 'of the wind sea', 's', 2.0, 30.0)
    wave_heading_deg: float = parameter(
        135.0, 'direction the waves travel towards, counter-clockwise from the course at the '
        'start: 0 = following, 90 = from starboard, 180 = head sea', 'deg', -360.0, 360.0)
    gamma: float = parameter(3.3, 'peak enhancement of jonswap', '', 1.0, 20.0)
    spreading: float = parameter(
        2.0, 'n of the spreading cos^n about the heading; 0 = long-crested', '', 0.0, 200.0)
    swell_height: float = parameter(
        0.0, 'significant height of a swell on top (jonswap, gamma 6); 0 = none', 'm', 0.0, 20.0)
    swell_period: float = parameter(14.0, 'peak period of the swell', 's', 2.0, 30.0)
    swell_heading_deg: float = parameter(
        135.0, 'as wave_heading_deg', 'deg', -360.0, 360.0)
    swell_spreading: float = parameter(20.0, 'as spreading', '', 0.0, 200.0)
    waves: int = parameter(600, 'regular waves in each wave system', '', 10, 5000)

    white_sd: tuple[float, ...] = parameter(
        (0.0004, 0.0004, 0.03), 'noise of roll, pitch (rad) and heave (m), new at every sample',
        '', 0.0, length=3)
    drift_sd: tuple[float, ...] = parameter(
        (0.0003, 0.0003, 0.04), 'slow errors of roll, pitch (rad) and heave (m)',
        '', 0.0, length=3)
    drift_time: tuple[float, ...] = parameter(
        (300.0, 300.0, 60.0), 'correlation times of the slow errors', 's', 0.001, length=3)
    bias: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), 'constant errors of roll, pitch (rad) and heave (m)', length=3)
    resolution: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), 'quantisation of roll, pitch (rad) and heave (m); 0 = none',
        '', 0.0, length=3)
    heading_sd: float = parameter(0.001, 'noise of the heading', 'rad', 0.0, 1.0)
    gyro_white_sd: float = parameter(2e-4, 'noise of the turn rates', 'rad/s', 0.0)
    gyro_drift_sd: float = parameter(2e-5, 'slow error of the turn rates', 'rad/s', 0.0)
    accel_white_sd: float = parameter(5e-3, 'noise of the specific force', 'm/s^2', 0.0)
    accel_drift_sd: float = parameter(2e-3, 'slow error of the specific force', 'm/s^2', 0.0)
    inertial_drift_time: float = parameter(
        1000.0, 'correlation time of the slow errors of rates and specific force', 's', 0.001)
    latency: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and heave: the data are this much older than their stamp',
        's', 0.0, 10.0, length=2)
    jitter: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and heave: sd of the stamp about that', 's', 0.0, 1.0, length=2)
    delay: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and heave: a message comes this long after its stamp',
        's', 0.0, 10.0, length=2)
    dropout: tuple[float, ...] = parameter(
        (0.0, 0.0), 'imu and heave: probability that a message is lost', '', 0.0, 1.0, length=2)

    ship_level_frame: str = parameter('ship_level', 'frame that rests with the mean course')
    ship_base_link_frame: str = parameter('ship_base_link', 'frame of the ship')


class Event(NamedTuple):
    """A sample that arrives at ``time`` (ns) on ``topic``."""

    time: int
    topic: str
    sample: Sample


class ShipSimulator:
    """
    Iterate, once, over a run's samples in the order in which they arrive.

    ``ship/imu``, ``ship/heave`` and ``ship/truth`` are sampled together, at ``start`` + k / rate.
    Turn rate and specific force are means over the interval before; ``ship/truth`` is free of
    errors, its twist relative to ``ship_level``.

    Parameters
    ----------
    config : SimulatorConfig
        The run.
    start : int
        Stamp of the first samples (ns).

    """

    def __init__(self, config: SimulatorConfig, start: int = 0) -> None:
        self._config, self._start = config, start
        self._rng = np.random.default_rng([config.seed, 1])
        self._period = 1 / config.rate
        first = -self._period
        self._states: SeaStates | ShapingStates = (
            SeaStates(ship_in_waves(config)) if config.scenario == 'sea' else ShapingStates(
                _yaw(config), first, np.random.default_rng([config.seed, 0])))
        self._newest = self._states.at(np.array([first]))[0]
        self._pieces = ceil(self._period / STEP - 1e-9)
        self._axes = [AxisSensor(errors, self._rng) for errors in axis_errors(config)]
        roll, pitch, heading = axis_errors(config)[:3]
        self._attitude_var = (roll.var, pitch.var, heading.var)
        self._deliveries = [
            Delivery(*values) for values in zip(config.latency, config.jitter, config.delay,
                                                config.dropout, strict=True)]
        self._events = self._run()

    def __iter__(self) -> Iterator[Event]:
        return self._events

    def _run(self) -> Iterator[Event]:
        config = self._config
        pending: list[tuple[int, int, Event]] = []
        for k in count():
            time = k / config.rate
            instant = self._start + nanoseconds(time)
            if 0 < config.duration <= time:
                break
            while pending and pending[0][0] < instant:
                yield heappop(pending)[2]
            for order, event in enumerate(self._sample(time, instant)):
                heappush(pending, (event.time, 3 * k + order, event))
        while pending:
            yield heappop(pending)[2]

    def _sample(self, time: float, instant: int) -> Iterator[Event]:
        level, body = self._config.ship_level_frame, self._config.ship_base_link_frame
        piece = self._period / self._pieces
        states = [self._newest, *self._states.at(
            np.linspace(time - self._period + piece, time, self._pieces))]
        self._newest = state = states[-1]
        rate, force = mean_inertial(states, piece)
        true = (*rpy_from_quaternion(state.orientation), state.position[2], *rate, *force)
        roll, pitch, yaw, heave, p, q, r, ahead, aside, up = (
            sensor.measure(value, time)
            for sensor, value in zip(self._axes, true, strict=True))
        imu_times, heave_times = (
            delivery.deliver(instant, self._period, self._rng) for delivery in self._deliveries)
        if imu_times:
            yield Event(imu_times[1], 'ship/imu', ImuSample(
                imu_times[0], body, quaternion_from_rpy(roll, pitch, yaw), self._attitude_var,
                (p, q, r), (ahead, aside, up)))
        if heave_times:
            yield Event(heave_times[1], 'ship/heave', HeaveSample(heave_times[0], level, heave))
        attitude = quaternion_from_rpy(*state.rpy)
        yield Event(instant, 'ship/truth', OdometrySample(
            instant, level, body, state.position, attitude,
            rotated(conjugate(attitude), state.velocity),
            angular_velocity(state.rpy, state.rates), (0.0,) * 6))


def ship_in_waves(config: SimulatorConfig) -> ShipInWaves:
    """Make the ship, her sea and her course of the scenario ``sea``."""
    rng = np.random.default_rng([config.seed, 0])
    waves = joined(random_waves(system, config.waves, rng) for system in wave_systems(config))
    return ShipInWaves(HULLS[config.hull], waves, _course(config))


def wave_systems(config: SimulatorConfig) -> list[WaveSystem]:
    """List wind sea and swell of the scenario ``sea``."""
    yaw = _yaw(config)
    height, period = config.significant_wave_height, config.peak_period
    spectra: dict[str, Spectrum] = {
        'bretschneider': Bretschneider(height, period),
        'jonswap': Jonswap(height, period, config.gamma),
        'pan2020': Pan2020(height)}
    systems = [WaveSystem(spectra[config.spectrum], yaw + radians(config.wave_heading_deg),
                          config.spreading)]
    if config.swell_height > 0:
        systems.append(WaveSystem(
            Jonswap(config.swell_height, config.swell_period, 6.0),
            yaw + radians(config.swell_heading_deg), config.swell_spreading))
    return systems


def _yaw(config: SimulatorConfig) -> float:
    return yaw_from_heading(radians(config.course_deg))


def _course(config: SimulatorConfig) -> Course:
    changes: list[Change] = []
    if isfinite(config.turn_to_deg):
        turn = wrapped(yaw_from_heading(radians(config.turn_to_deg)) - _yaw(config))
        changes.append(turn_at(config.turn_time, turn, radians(config.turn_rate_deg)))
    if isfinite(config.speed_to):
        changes.append(speed_up_at(
            config.speed_change_time, config.speed_to - config.speed, config.acceleration))
    return Course(_yaw(config), config.speed, tuple(changes))


def axis_errors(config: SimulatorConfig) -> list[AxisErrors]:
    """List the errors of roll, pitch, heading, heave, three turn rates, three forces."""
    roll, pitch, heave = (AxisErrors(*values) for values in zip(
        config.white_sd, config.drift_sd, config.drift_time, config.bias, config.resolution,
        strict=True))
    gyro = AxisErrors(config.gyro_white_sd, config.gyro_drift_sd, config.inertial_drift_time)
    accel = AxisErrors(config.accel_white_sd, config.accel_drift_sd, config.inertial_drift_time)
    return [roll, pitch, AxisErrors(config.heading_sd), heave, *[gyro] * 3, *[accel] * 3]

"""Attitude and motion from an inertial unit: closed forms, gaps, noise."""

from math import pi

import numpy as np
import pytest

from deck_motion_ros.estimators.dead_reckoning import GRAVITY, InertialTrack
from deck_motion_ros.geometry import (
    conjugate,
    multiply,
    quaternion_from_rpy,
    rotated,
    rotation_vector,
)
from deck_motion_ros.samples import ImuSample

LEVEL = (0.0, 0.0, 0.0, 1.0)
ZERO = (0.0, 0.0, 0.0)
MS = 1_000_000


def imu(stamp, attitude=LEVEL, rate=ZERO, force=(0.0, 0.0, GRAVITY)):
    return ImuSample(stamp, 'imu', attitude, ZERO, rate, force)


def angle(a, b):
    return np.linalg.norm(rotation_vector(multiply(conjugate(a), b)))


def test_constant_acceleration_is_exact_between_and_past_samples():
    track = InertialTrack(LEVEL)
    for k in range(101):
        track.update(imu(k * 10 * MS, force=(1.0, -2.0, GRAVITY + 0.5)))
    for late in (-5, 0, 5, 15):
        t = 1.0 + late / 1000
        _, position, velocity = track.at(1000 * MS + late * MS)
        assert position == pytest.approx([t * t / 2, -t * t, t * t / 4], abs=1e-12)
        assert velocity == pytest.approx([t, -2 * t, t / 2], abs=1e-12)
    assert track.is_inertial(1015 * MS)
    assert not track.is_inertial(1025 * MS)


def test_force_is_turned_by_the_attitude_half_way_through_the_interval():
    # spinning about the vertical at constant speed, pushed along its own x axis: the velocity
    # goes round a circle of radius 1 / omega
    omega, dt, mount = 2.0, 0.01, quaternion_from_rpy(0.3, -0.2, 1.0)
    track = InertialTrack(mount)
    for k in range(158):
        body = quaternion_from_rpy(0.0, 0.0, omega * k * dt)
        to_sensor = conjugate(mount)
        track.update(imu(10 * k * MS, multiply(body, mount),
                         rotated(to_sensor, (0.0, 0.0, omega)),
                         rotated(to_sensor, (1.0, 0.0, GRAVITY))))
    t = 1.57
    attitude, _, velocity = track.at(1570 * MS)
    expected = [np.sin(omega * t) / omega, (1 - np.cos(omega * t)) / omega, 0.0]
    assert velocity == pytest.approx(expected, abs=1e-4)
    assert angle(attitude, quaternion_from_rpy(0, 0, omega * t)) < 1e-9
    assert track.rate == pytest.approx([0, 0, omega])


def test_attitude_noise_is_averaged_with_the_gyro():
    rng, dt, sd = np.random.default_rng(1), 0.02, 0.004
    track, errors = InertialTrack(LEVEL), []
    for k in range(2000):
        roll, rate = 0.2 * np.sin(1.2 * k * dt), 0.24 * np.cos(1.2 * (k - 0.5) * dt)
        noisy = quaternion_from_rpy(roll + sd * rng.normal(), sd * rng.normal(), 0.0)
        track.update(imu(20 * k * MS, noisy, (rate, 0.0, 0.0)))
        errors.append(angle(track.attitude, quaternion_from_rpy(roll, 0.0, 0.0)))
    assert np.sqrt(np.mean(np.square(errors[100:]))) < 0.3 * sd * np.sqrt(2)


def test_without_turn_rates_they_come_from_the_attitudes():
    track = InertialTrack(LEVEL)
    for k in range(50):
        track.update(imu(20 * k * MS, quaternion_from_rpy(0.1 * 0.02 * k, 0.0, 0.0), force=ZERO))
    assert track.rate == pytest.approx([0.1, 0, 0], abs=1e-9)
    assert track.at(49 * 20 * MS)[1:] == (ZERO, ZERO)
    assert not track.is_inertial(49 * 20 * MS)


def test_nothing_jumps_over_a_gap():
    track = InertialTrack(LEVEL)
    for k in range(50):
        track.update(imu(20 * k * MS, force=(1.0, 0.0, GRAVITY)))
    after = 49 * 20 * MS + 3000 * MS
    _, position, velocity = track.at(after)
    track.update(imu(after, quaternion_from_rpy(0.1, 0, 0), force=(1.0, 0.0, GRAVITY)))
    assert track.at(after) == (quaternion_from_rpy(0.1, 0, 0), position, velocity)
    assert velocity[0] == pytest.approx(0.98 + 0.04)  # held for two samples, not for 3 s
    assert not track.is_inertial(after)
    assert track.age(after + 500 * MS) == 0.5


@pytest.mark.parametrize('rate', [1, 4])
def test_slow_samples_stay_good_until_the_next(rate):
    track = InertialTrack(LEVEL)
    for k in range(5):
        track.update(imu(k * 1000 * MS // rate, quaternion_from_rpy(0, 0, pi / 8 * k)))
    assert track.patience > 1 / rate


def test_turn_rates_that_the_attitude_contradicts_are_a_gap():
    track = InertialTrack(LEVEL)
    for k in range(40):
        track.update(imu(k * 10 * MS, rate=(3.0 * (k >= 20), 0.0, 0.0)))
        assert angle(track.attitude, LEVEL) < 0.1
    for k in range(40, 50):
        track.update(imu(k * 10 * MS))
    assert track.is_inertial(490 * MS)
    assert np.linalg.norm(track.at(490 * MS)[2]) < 0.2  # 3 m/s, were they believed

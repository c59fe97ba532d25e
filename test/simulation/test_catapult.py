"""The simulated launch against hand-solved cases."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from deck_motion_ros.earth import Earth
from deck_motion_ros.geometry import rotation_matrix
from deck_motion_ros.simulation.catapult import (
    ARCMIN,
    CatapultSensors,
    CatapultSimulator,
    CatapultSimulatorConfig,
    Launch,
    Stroke,
)
from deck_motion_ros.simulation.runs import SCENARIOS

EXACT = dict.fromkeys(
    (f'{unit}_{error}' for unit in ('slave', 'master') for error in (
        'accel_bias_sd_ug', 'gyro_drift_sd_deg_h', 'accel_white_sd', 'gyro_white_sd')), 0.0) | {
    'ldv_sd': 0.0, 'track_lateral_sd': 0.0, 'track_vertical_sd': 0.0}
STILL = CatapultSimulatorConfig(deck='steady', hold=1.0, duration=5.0, **EXACT)


def measured(config, seconds=4.0):
    sensors = CatapultSensors(config, np.random.default_rng(1))
    return sensors, sensors.measure(0, round(seconds * config.rate) + 1)


def test_a_stroke_by_hand():
    times = np.array([0.5, 1.0, 2.0, 4.0, 5.0])
    way, speed = Stroke(STILL).at(times)
    np.testing.assert_allclose(speed, np.array([0, 0, 1, 3, 3]) * 19.6133)
    np.testing.assert_allclose(way, np.array([0, 0, 0.5, 4.5, 7.5]) * 19.6133)


def test_a_ramp_loses_half_its_length():
    _, speed = Stroke(replace(STILL, ramp=0.4)).at(np.array([1.4, 4.0]))
    np.testing.assert_allclose(speed, np.array([0.2, 2.8]) * 19.6133)


def test_an_aborted_launch_comes_to_rest():
    way, speed = Stroke(replace(STILL, abort_after=1.0)).at(np.array([2.0, 2.5, 3.0, 9.0]))
    np.testing.assert_allclose(speed, np.array([1, 0.5, 0, 0]) * 19.6133, atol=1e-9)
    np.testing.assert_allclose(way[-2:], 19.6133)


def test_forces_of_a_still_deck_by_hand():
    config = replace(STILL, speed=0.0, misalignment_arcmin=(0.0, 0.0, 600.0))
    _, data = measured(config)
    g = -Earth(radians(40.0)).gravity[2]
    np.testing.assert_allclose(data.slave_force[50, 0], [0, 0, g], atol=1e-9)
    turn = radians(10.0)  # the slave points 10 deg to port of the thrust
    expected = [19.6133 * np.cos(turn), -19.6133 * np.sin(turn), g]
    np.testing.assert_allclose(data.slave_force[250, 0], expected, atol=2e-2)  # Coriolis
    np.testing.assert_allclose(np.linalg.norm(data.slave_rate[50, 0]), 7.292115e-5, rtol=1e-6)


def test_increments_of_the_slave_are_the_change_of_its_velocity():
    """The force, turned to ENU and freed of gravity, adds up to the velocity."""
    config = replace(STILL, deck_roll_deg=3.0, lever_arm=(20.0, 8.0, 5.0), ramp=0.2,
                     track_rpy_deg=(0.0, -2.0, 5.0), speed=0.0)
    sensors, data = measured(config)
    launch, earth = sensors.launch, Earth(radians(40.0))
    velocity = launch.velocity(launch.reference(data.times))
    middle = launch.attitude(data.times[1:] - 0.005) @ rotation_matrix(
        ARCMIN * np.array(config.misalignment_arcmin))
    push = np.einsum('nij,nj->ni', middle, data.slave_force[1:, 0]) + earth.gravity
    mean = (velocity[1:] + velocity[:-1]) / 2
    push -= np.cross(2 * earth.rate + earth.transport_rate(mean), mean)
    np.testing.assert_allclose(np.cumsum(push, axis=0) / 100, velocity[1:] - velocity[0],
                               atol=2e-4)


def test_what_master_and_velocimeter_say_is_the_velocity_of_the_slave():
    config = replace(STILL, deck='sea', hull='patrol', lever_arm=(0.0, 10.0, 5.0))
    sensors, data = measured(config)
    here = sensors.launch.reference(data.times)
    np.testing.assert_allclose(data.velocity[:, 0], here.velocity)
    np.testing.assert_allclose(data.speed[:, 0], here.speed)
    numeric = np.gradient(here.velocity, 0.01, axis=0)[5:-5]  # the waves do move her
    assert 0.05 < np.max(np.abs(numeric)) < 3.0


def test_a_cosine_at_the_sampling_rate_is_seen_as_a_push_and_is_none():
    """Sum of A exp(-k dt / tau) dt: 1.82 m/s at 20 m/s^2; its integral is 0.0005 m/s."""
    shaken = replace(STILL, vibration=20.0, misalignment_arcmin=(0.0, 0.0, 0.0))
    _, quiet = measured(STILL)
    gained = {}
    for sampling in ('points', 'increments'):
        _, data = measured(replace(shaken, sampling=sampling))
        _, quiet = measured(replace(shaken, vibration=0.0))
        gained[sampling] = np.sum(data.slave_force - quiet.slave_force, axis=(0, 1)) / 100
    tau = shaken.vibration_decay
    np.testing.assert_allclose(gained['points'], np.array([1, 0, 1]) * 0.2 / np.expm1(0.01 / tau),
                               rtol=1e-6)
    exact = 20.0 / tau / (tau**-2 + (200 * np.pi)**2)
    np.testing.assert_allclose(gained['increments'][0], exact, atol=0.006)  # 2 kHz inside


def test_skew_makes_the_reference_old():
    _, data = measured(replace(STILL, skew=0.005))
    np.testing.assert_allclose(data.speed[-1, 0], 19.6133 * 2.995)


def test_errors_have_the_size_that_is_asked_for():
    sensors = CatapultSensors(replace(CatapultSimulatorConfig(deck='steady'), hold=2.0),
                              np.random.default_rng(1), np.zeros((400, 3)))
    data = sensors.measure(0, 101)
    bias = np.mean(data.slave_force, axis=0) - [0, 0, 9.8017]
    assert np.std(bias) / 9.80665e-6 == pytest.approx(100.0, rel=0.1)
    assert np.std(data.speed) == pytest.approx(0.01, rel=0.05)
    across = np.std(data.velocity[..., 2])
    assert across == pytest.approx(0.05, rel=0.05)


def test_blocks_go_on_where_the_last_ended():
    config = replace(CatapultSimulatorConfig(deck='steady', hold=1.0), **EXACT, deck_roll_deg=2.0)
    sensors, whole = measured(config, 1.5)
    parts = CatapultSensors(config, np.random.default_rng(1))
    first, second = parts.measure(0, 60), parts.measure(60, 91)
    np.testing.assert_allclose(np.concatenate([first.slave_force, second.slave_force]),
                               whole.slave_force, atol=1e-9)
    np.testing.assert_allclose(np.concatenate([first.velocity, second.velocity]), whole.velocity)


def test_the_scenario_gives_its_topics_in_order_and_ends():
    config = CatapultSimulatorConfig(deck='steady', hold=0.2, stroke=0.5, duration=1.0,
                                     ldv_dropout=(0.105, 0.205), master_every=2)
    events = list(CatapultSimulator(config, 10**9))
    topics = [event.topic for event in events]
    assert set(topics) == set(SCENARIOS['catapult'].topics)
    assert topics.count('slave/imu') == 100 and topics.count('master/imu') == 50
    assert topics.count('ldv/velocity') == 71 - 10
    assert [event.time for event in events] == sorted(event.time for event in events)
    assert list(CatapultSimulator(config, 10**9)) == events


def test_no_misalignment_no_flexure_the_slave_is_parallel_to_the_ship():
    launch = Launch(replace(STILL, deck_roll_deg=3.0))
    times = np.array([0.3, 2.7])
    np.testing.assert_allclose(launch.attitude(times), launch.reference(times).mat, atol=1e-12)
    bent = Launch(replace(STILL, flexure_arcmin=(0.0, 30.0, 0.0))).attitude(times[:1])
    assert np.max(np.abs(bent - launch.attitude(times[:1]))) > 10 * ARCMIN

"""The landing scene: truth against its own derivatives, sensors against the truth, faults."""

from collections import Counter
from dataclasses import replace
from itertools import takewhile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deck_motion_ros.samples import NANOSECONDS, seconds
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig
from deck_motion_ros.simulation.sea import GRAVITY

QUIET = LandingSimulatorConfig(
    duration=60.0, seed=3, deck='pan2020', deck_lever_arm=(-20.0, 1.0, 4.0),
    white_sd=(0.0,) * 3, drift_sd=(0.0,) * 3, heading_sd=0.0, gyro_white_sd=0.0,
    gyro_drift_sd=0.0, accel_white_sd=0.0, accel_drift_sd=0.0, range_white_sd=0.0,
    uav_attitude_sd=0.0, uav_attitude_drift_sd=0.0, uav_gyro_white_sd=0.0, uav_gyro_drift_sd=0.0,
    uav_accel_white_sd=0.0, uav_accel_drift_sd=0.0)


def of(config, topic):
    return [event.sample for event in LandingSimulator(config) if event.topic == topic]


@pytest.mark.parametrize('deck', ['pan2020', 'hull'])
def test_velocity_over_the_deck_is_the_derivative_of_the_position(deck):
    scene = LandingSimulator(replace(QUIET, deck=deck, waves=100)).scene
    times, h = np.linspace(0.5, 62.0, 400), 1e-4
    before, _ = scene.over_deck(times - h)
    after, _ = scene.over_deck(times + h)
    _, rate = scene.over_deck(times)
    assert rate == pytest.approx((after - before) / (2 * h), abs=2e-3)


@pytest.mark.parametrize(('topic', 'body'), [('ship/imu', 'ship'), ('uav/imu', 'aircraft')])
def test_inertial_data_integrate_to_the_truth(topic, body):
    config = replace(QUIET, deck='hull', duration=20.0, turn_to_deg=110.0, turn_time=5.0, waves=12)
    samples = of(config, topic)
    times = np.array([seconds(item.stamp) for item in samples])
    truth = getattr(LandingSimulator(config).scene, body)(times)
    assert np.max((Rotation.from_quat([item.orientation for item in samples]).inv()
                   * truth.enu_turn).magnitude()) < 1e-9
    dt = np.diff(times)[:, None]
    turn = truth.enu_turn[:-1] * Rotation.from_rotvec(
        dt * [item.angular_velocity for item in samples[1:]])
    assert np.max((turn.inv() * truth.enu_turn[1:]).magnitude()) < 1e-4
    middle = truth.enu_turn[:-1] * Rotation.from_rotvec(
        dt / 2 * [item.angular_velocity for item in samples[1:]])
    force = middle.apply([item.specific_force for item in samples[1:]]) - [0, 0, GRAVITY]
    velocity = truth.enu_velocity[0] + np.cumsum(dt * force, axis=0)
    assert velocity == pytest.approx(truth.enu_velocity[1:], abs=5e-3)


def test_ranges_are_distances_on_the_rolling_deck():
    config = replace(QUIET, range_spacing=0.02, antenna_lever_arm=(0.3, 0.1, -0.4))
    simulator = LandingSimulator(config)
    events = [event.sample for event in simulator if event.topic == 'uwb/range']
    times = np.array([seconds(item.stamp) for item in events])
    over, _ = simulator.scene.over_deck(times)
    (_, _, deck), aircraft = simulator.scene.deck(times), simulator.scene.aircraft(times)
    antenna = over + (deck.inv() * aircraft.turn).apply(config.antenna_lever_arm)
    anchors = simulator.anchors[[int(item.frame_id[-1]) - 1 for item in events]]
    assert [item.distance for item in events] == pytest.approx(
        np.linalg.norm(antenna - anchors, axis=1))
    assert np.diff(times[:5]) == pytest.approx([0.02, 0.02, 0.02, 0.04])


def test_truth_topics_are_the_scene():
    config = replace(QUIET, duration=12.0)
    simulator = LandingSimulator(config)
    landing, ship = ([item for item in of(config, topic)]
                     for topic in ('landing/truth', 'ship/truth'))
    times = np.array([seconds(item.stamp) for item in landing])
    over, rate = simulator.scene.over_deck(times)
    assert np.array([item.position for item in landing]) == pytest.approx(over)
    assert np.array([item.linear_velocity for item in landing]) == pytest.approx(rate)
    body = simulator.scene.ship(times)
    turn = Rotation.from_quat([item.orientation for item in ship])
    assert turn.apply([item.linear_velocity for item in ship]) == pytest.approx(body.velocity)
    assert {item.frame_id for item in landing} == {'deck'}


def test_same_seed_same_run_whatever_its_length_and_whether_truth_is_wanted():
    config = replace(QUIET, range_white_sd=0.05, uav_accel_white_sd=0.1, duration=14.0)
    short = list(LandingSimulator(config, 5 * NANOSECONDS))
    longer = list(takewhile(lambda event: event.time < 19 * NANOSECONDS, LandingSimulator(
        replace(config, duration=0.0), 5 * NANOSECONDS)))
    blind = list(LandingSimulator(config, 5 * NANOSECONDS, truth=False))
    first = [event for event in short if event.time < 15 * NANOSECONDS]
    assert first == [event for event in longer if event.time < 15 * NANOSECONDS]
    assert [event for event in short if not event.topic.endswith('truth')] == blind
    assert list(LandingSimulator(replace(config, seed=4))) != list(LandingSimulator(config))


def test_events_come_in_order_and_as_often_as_asked():
    config = replace(QUIET, duration=21.0, rate=20.0, uav_rate=40.0, range_rate=7.0,
                     range_spacing=0.03)
    events = list(LandingSimulator(config))
    times = [event.time for event in events]
    assert times == sorted(times)
    counts = Counter(event.topic for event in events)
    assert counts == {'ship/imu': 420, 'ship/heave': 420, 'ship/truth': 420,
                      'landing/truth': 420, 'uav/imu': 840, 'uwb/range': 588}
    assert 'uav/imu' not in {e.topic for e in LandingSimulator(replace(config, uav_rate=0.0))}


def test_faults_of_the_radios():
    config = replace(QUIET, nlos_share=0.2, range_dropout=0.1, lost_anchor='anchor_2',
                     lost_time=30.0, outage_start=40.0, outage_duration=5.0,
                     moved_anchor='anchor_3', moved_time=50.0, moved_by=(0.0, 0.0, 1.0))
    clean = {(item.stamp, item.frame_id): item.distance for item in of(QUIET, 'uwb/range')}
    found = {(item.stamp, item.frame_id): item.distance for item in of(config, 'uwb/range')}
    assert not [key for key in found if key[1] == 'anchor_2' and key[0] >= 30 * NANOSECONDS]
    assert not [key for key in found if 40 <= seconds(key[0]) < 45]
    before = [key for key in clean if key[0] < 30 * NANOSECONDS]
    assert len([key for key in before if key in found]) / len(before) == pytest.approx(
        0.9, abs=0.03)
    excess = np.array([found[key] - clean[key] for key in before if key in found])
    assert np.mean(excess > 0) == pytest.approx(0.2, abs=0.04)
    assert excess[excess > 0].min() >= 0.3
    assert excess[excess > 0].mean() == pytest.approx(1.3, abs=0.2)
    moved = [found[key] - clean[key] for key in found
             if key[1] == 'anchor_3' and key[0] >= 50 * NANOSECONDS]
    assert np.median(moved) < -0.1


def test_the_papers_boat():
    config = LandingSimulatorConfig(deck='pan2020', seed=5)
    values = np.concatenate([
        LandingSimulator(replace(config, seed=seed)).scene.motion(np.arange(0, 300, 0.5)).value
        for seed in range(6)])
    assert 4 * values[:, :3].std(axis=0) == pytest.approx([1.87] * 3, rel=0.1)
    assert np.degrees(values[:, 3:].mean(axis=0)) == pytest.approx([-3, 0, 0], abs=0.5)
    low, high = np.degrees(np.percentile(values[:, 3:], [1, 99], axis=0))
    assert low == pytest.approx([-9.5, -11.2, -14], abs=1.5)
    assert high == pytest.approx([3.5, 11.2, 14], abs=1.5)


def test_phases_of_the_landing():
    config = replace(QUIET, wander_sd=(0.0, 0.0, 0.0), follow_lag=0.0, boat_rotation=0.0)
    over, _ = LandingSimulator(config).scene.over_deck(np.array([0.0, 20.0, 30.0, 40.0, 60.0]))
    assert over[0] == pytest.approx([10, 20, 15], abs=2.0)  # the boat moves below it
    assert over[1:4, :2] == pytest.approx(np.zeros((3, 2)), abs=1e-6)
    assert over[1:4, 2] == pytest.approx([15] * 3, abs=2.0)
    assert over[4] == pytest.approx([0, 0, 0], abs=1e-6)


def test_positions_that_do_not_fit_are_named():
    with pytest.raises(ValueError, match='anchor_positions'):
        LandingSimulator(LandingSimulatorConfig(anchor_positions=(1.0, 2.0)))

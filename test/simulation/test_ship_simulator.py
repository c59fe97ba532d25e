"""The simulated ship: what her sensors say against her true motion."""

from collections import defaultdict
from itertools import islice
from math import cos, pi, sin

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deck_motion_ros.config import configured
from deck_motion_ros.processes import LI2014_HEAVE, LI2014_PITCH, LI2014_ROLL
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.shaping import ShapedAxis
from deck_motion_ros.simulation.simulator import (
    ship_in_waves,
    ShipSimulator,
    SimulatorConfig,
    wave_systems,
)

EXACT = {'white_sd': [0.0] * 3, 'drift_sd': [0.0] * 3, 'heading_sd': 0.0, 'gyro_white_sd': 0.0,
         'gyro_drift_sd': 0.0, 'accel_white_sd': 0.0, 'accel_drift_sd': 0.0}
IMU, HEAVE, TRUTH = TOPICS = ('ship/imu', 'ship/heave', 'ship/truth')


def run(start=0, **values):
    """Return the samples by topic and the events."""
    values = {'waves': 60, 'duration': 20.0, **values}
    events = list(ShipSimulator(configured(SimulatorConfig, values), start))
    samples = defaultdict(list)
    for event in events:
        samples[event.topic].append(event.sample)
    return samples, events


def column(samples, name):
    return np.array([getattr(sample, name) for sample in samples])


@pytest.mark.parametrize('scenario', ['sea', 'shaping'])
@pytest.mark.parametrize('rate', [1.0, 7.0, 50.0, 200.0])
def test_samples_are_stamped_by_the_schedule(scenario, rate):
    start = 1_700_000_000_123_456_789
    samples, events = run(start, scenario=scenario, rate=rate, duration=3.0)
    for topic in TOPICS:
        offsets = column(samples[topic], 'stamp') - start
        np.testing.assert_allclose(
            offsets, np.arange(3 * rate) / rate * NANOSECONDS, rtol=0, atol=0.51)
    assert [event.topic for event in events[:3]] == list(TOPICS)
    assert all(event.time == event.sample.stamp for event in events)


def test_same_seed_same_run():
    assert run(seed=5)[1] == run(seed=5)[1]
    one, two = (run(seed=seed)[0][TRUTH][9].position for seed in (5, 6))
    assert one != two


def test_sensors_do_not_change_the_sea():
    noisy, quiet = run()[0], run(**EXACT, dropout=[0.5, 0.5])[0]
    assert noisy[TRUTH] == quiet[TRUTH]
    assert noisy[HEAVE][5] != quiet[HEAVE][5]


@pytest.mark.parametrize('scenario', ['sea', 'shaping'])
def test_perfect_sensors_tell_the_truth(scenario):
    samples, _ = run(scenario=scenario, course_deg=30.0, **EXACT)
    truth = samples[TRUTH]
    np.testing.assert_allclose(column(samples[HEAVE], 'height'), column(truth, 'position')[:, 2])
    course = Rotation.from_euler('z', 60, degrees=True)  # 30 deg from north is 60 deg from east
    expected = course * Rotation.from_quat(column(truth, 'orientation'))
    seen = Rotation.from_quat(column(samples[IMU], 'orientation'))
    assert (expected.inv() * seen).magnitude().max() < 1e-12
    assert column(samples[IMU], 'attitude_var').max() == 0


def test_in_a_flat_calm_nothing_moves():
    for spectrum in ('bretschneider', 'jonswap', 'pan2020'):
        samples, _ = run(significant_wave_height=0.0, spectrum=spectrum, duration=2.0, **EXACT)
        np.testing.assert_allclose(
            column(samples[IMU], 'specific_force'), [[0, 0, 9.80665]] * 100, atol=1e-9)
        np.testing.assert_allclose(column(samples[IMU], 'angular_velocity'), 0, atol=1e-9)
        np.testing.assert_allclose(column(samples[HEAVE], 'height'), 0, atol=1e-9)


def test_dead_reckoning_gives_attitude_and_velocity_back():
    samples, _ = run(duration=60.0, hull='patrol', turn_to_deg=190.0, turn_time=5.0,
                     turn_rate_deg=3.0, **EXACT)
    truth, imu = samples[TRUTH], samples[IMU]

    def velocity(k, course):
        sway = Rotation.from_quat(truth[k].orientation).apply(truth[k].linear_velocity)
        ahead = np.array([7.5, 0.0, 0.0])
        return Rotation.from_euler('z', course).apply(ahead + sway)

    attitude = Rotation.from_quat(imu[0].orientation)
    speed = velocity(0, 0.0)
    for sample in imu[1:]:
        half = Rotation.from_rotvec(np.array(sample.angular_velocity) * 0.01)
        force = (attitude * half).apply(sample.specific_force)
        speed = speed + (force - [0, 0, 9.80665]) * 0.02
        attitude = attitude * half * half
    end = Rotation.from_quat(imu[-1].orientation)
    assert (attitude.inv() * end).magnitude() < 1e-6
    np.testing.assert_allclose(speed, velocity(-1, np.radians(-100)), atol=1e-3)
    bow = end.apply([1, 0, 0])
    assert np.degrees(np.arctan2(bow[1], bow[0])) == pytest.approx(-100, abs=5)


def test_slow_samples_are_the_means_of_fast_ones():
    fast, slow = (run(rate=rate, hull='patrol', **EXACT)[0][IMU] for rate in (50.0, 2.0))
    for name, atol in (('angular_velocity', 1e-9), ('specific_force', 1e-9)):
        means = column(fast, name)[1:976].reshape(-1, 25, 3).mean(axis=1)
        np.testing.assert_allclose(column(slow, name)[1:], means, atol=atol)


def test_twist_of_the_truth_is_the_rate_of_its_pose():
    truth = run(rate=200.0, duration=5.0, hull='patrol')[0][TRUTH]
    attitude = Rotation.from_quat(column(truth, 'orientation'))
    moved = np.gradient(column(truth, 'position'), 0.005, axis=0)
    np.testing.assert_allclose(attitude.apply(column(truth, 'linear_velocity'))[1:-1],
                               moved[1:-1], atol=1e-4)
    turned = (attitude[:-2].inv() * attitude[2:]).as_rotvec() / 0.01
    np.testing.assert_allclose(column(truth, 'angular_velocity')[1:-1], turned, atol=1e-4)


def test_turn_shows_in_gyro_and_course():
    samples, _ = run(significant_wave_height=0.0, turn_to_deg=0.0, turn_time=2.0, speed=10.0,
                     turn_rate_deg=5.0, duration=40.0, **EXACT)
    rates = column(samples[IMU], 'angular_velocity')
    assert rates[:, 2].sum() / 50 == pytest.approx(pi / 2, abs=1e-6)  # east to north is to port
    side = column(samples[IMU], 'specific_force')[:, 1]
    np.testing.assert_allclose(side, 10.0 * rates[:, 2], atol=1e-4)  # centripetal: to port too
    assert rates[:, 2].max() == pytest.approx(np.radians(5.0), rel=1e-3)
    np.testing.assert_allclose(column(samples[TRUTH], 'position'), 0, atol=1e-12)


def test_speed_changes_as_told():
    samples, _ = run(significant_wave_height=0.0, speed_to=9.5, speed_change_time=2.0,
                     acceleration=0.2, duration=40.0, **EXACT)
    ahead = column(samples[IMU], 'specific_force')[:, 0]
    assert ahead.sum() / 50 == pytest.approx(2.0, abs=1e-6)
    assert ahead.max() == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize('heading, still', [(180.0, True), (0.0, True), (90.0, False)])
def test_wave_heading_is_relative_to_the_course(heading, still):
    for course in (0.0, 200.0):
        truth = run(wave_heading_deg=heading, course_deg=course, spreading=0.0, rate=5.0,
                    speed=0.0)[0][TRUTH]
        tilt = Rotation.from_quat(column(truth, 'orientation')).as_euler('ZYX')
        assert (np.abs(tilt[:, 2]).max() < 1e-9) == still  # roll
        assert (np.abs(tilt[:, 1]).max() > 1e-3) == still  # pitch


def test_noise_is_that_of_the_sensors_and_is_told():
    sds = {'white_sd': [0.003, 0.002, 0.1], 'drift_sd': [0.004, 0.0, 0.0],
           'drift_time': [0.01, 1.0, 1.0], 'heading_sd': 0.006}
    samples, _ = run(**sds, significant_wave_height=0.0, duration=100.0)
    imu = samples[IMU]
    tilt = Rotation.from_quat(column(imu, 'orientation')).as_euler('ZYX')
    np.testing.assert_allclose(tilt.std(axis=0), [0.006, 0.002, 0.005], rtol=0.05)
    np.testing.assert_allclose(np.sqrt(imu[0].attitude_var), [0.005, 0.002, 0.006])
    assert column(samples[HEAVE], 'height').std() == pytest.approx(0.1, rel=0.05)


def test_data_are_as_old_as_the_latency_says():
    late, prompt = (run(latency=[0.0, latency], **EXACT)[0][HEAVE] for latency in (0.3, 0.0))
    assert [sample.height for sample in late] == [sample.height for sample in prompt]
    assert {a.stamp - b.stamp for a, b in zip(late, prompt, strict=True)} == {300_000_000}


@settings(max_examples=20)
@given(latency=st.floats(0, 0.2), jitter=st.floats(0, 0.1), delay=st.floats(0, 0.5),
       dropout=st.floats(0, 0.9), rate=st.sampled_from([1.0, 10.0, 50.0]))
def test_events_come_in_the_order_of_their_arrival(latency, jitter, delay, dropout, rate):
    samples, events = run(latency=[latency, 0.0], jitter=[jitter, jitter], delay=[0.0, delay],
                          dropout=[dropout, 0.0], rate=rate, duration=4.0, waves=10)
    assert np.all(np.diff([event.time for event in events]) >= 0)
    assert len(samples[TRUTH]) == len(samples[HEAVE]) == 4 * rate >= len(samples[IMU])


def test_duration_0_never_ends():
    config = configured(SimulatorConfig, {'waves': 10, 'rate': 1.0})
    assert len(list(islice(ShipSimulator(config), 3000))) == 3000


def test_swell_and_wind_sea_make_one_sea():
    config = configured(SimulatorConfig, {
        'swell_height': 2.0, 'swell_period': 14.0, 'significant_wave_height': 1.5, 'waves': 200})
    assert len(wave_systems(config)) == 2
    waves = ship_in_waves(config).waves
    assert 4 * np.sqrt(np.sum(waves.amplitude**2) / 2) == pytest.approx(2.5, rel=2e-3)


@pytest.mark.parametrize('values, words', [
    ({'scenario': 'submarine'}, "'scenario' must be one of sea, shaping, catapult"),
    ({'hull': 'raft'}, "'hull' must be one of cvn65, destroyer, patrol"),
    ({'rate': 500.0}, "'rate' must be within 1 to 200 Hz"),
    ({'significant_wave_height': -1.0}, "'significant_wave_height'"),
    ({'peak_period': float('nan')}, "'peak_period'"),
    ({'white_sd': [0.1]}, "'white_sd' needs 3 numbers"),
    ({'dropout': [0.0, 1.5]}, "'dropout'"),
    ({'turn_to_deg': float('inf')}, "'turn_to_deg'"),
    ({'wave_height': 3.0}, "unknown parameter 'wave_height'")])
def test_wrong_configuration_is_named(values, words):
    with pytest.raises(ValueError, match=words):
        configured(SimulatorConfig, values)


@pytest.mark.parametrize('process', [LI2014_ROLL, LI2014_PITCH, LI2014_HEAVE])
def test_shaped_axis_has_the_processs_covariance_at_uneven_steps(process):
    steps = (0.7, 0.02, 2.5)
    runs = []
    for seed in range(3000):
        axis = ShapedAxis(process, np.random.default_rng(seed))
        values = [axis.value]
        for step in steps:
            before, rate = axis.value, axis.advance(step)
            assert before + rate * step == pytest.approx(axis.value)
            values.append(axis.value)
        runs.append(values)
    cov = np.cov(np.array(runs).T)
    times = np.concatenate([[0], np.cumsum(steps)])
    # of a second-order system driven by white noise, by hand
    theta = np.sqrt(process.stiffness - process.damping**2 / 4)
    lag = np.abs(times[:, None] - times)
    decay = np.exp(-process.damping / 2 * lag)
    expected = process.sd**2 * decay * (
        np.cos(theta * lag) - process.damping / 2 / theta * np.sin(theta * lag))
    np.testing.assert_allclose(cov, expected, atol=0.06 * process.sd**2)


@pytest.mark.parametrize('rate', [1.0, 100.0])
def test_shaping_gives_the_papers_sizes_whatever_the_rate(rate):
    runs = [run(scenario='shaping', rate=rate, duration=3 / rate, seed=seed)[0][TRUTH][-1]
            for seed in range(400)]
    tilts = Rotation.from_quat(column(runs, 'orientation')).as_euler('ZYX', degrees=True)
    _, pitch, roll = tilts.std(axis=0)
    heave = column(runs, 'position')[:, 2].std()
    np.testing.assert_allclose([roll, pitch, heave], [4.243, 0.716, 1.061], rtol=0.12)


def test_shaping_ship_moves_in_three_axes_only():
    samples, _ = run(scenario='shaping', course_deg=120.0, **EXACT)
    for sample in samples[TRUTH]:
        x, y, _ = sample.position
        assert (x, y) == (0.0, 0.0)
    force = np.linalg.norm(column(samples[IMU], 'specific_force'), axis=1)
    np.testing.assert_allclose(force, 9.80665)
    bow = Rotation.from_quat(samples[IMU][0].orientation).apply([1, 0, 0])
    assert bow[:2] @ [cos(np.radians(-30)), sin(np.radians(-30))] == pytest.approx(1, abs=0.01)

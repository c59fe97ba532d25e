"""The simulated flight over the sea against integrals, hand calculations and its own arrays."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
from scipy.signal import welch

from deck_motion_ros.geometry import rotated
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.sea import Bretschneider, GRAVITY
from deck_motion_ros.simulation.sea_skimming import (
    Autopilot,
    DisturbanceSource,
    Profile,
    SkimmingSimulator,
    SkimmingSimulatorConfig,
)

CONFIG = SkimmingSimulatorConfig(duration=20.0, profile_times=(2.0, 12.0), transition_time=4.0,
                                 waves=100)
QUIET = replace(CONFIG, altimeter_bias_sd=0.0, altimeter_sd=0.0, rate_bias_sd=0.0, rate_sd=0.0,
                accel_bias_sd=0.0, accel_drift_sd=0.0, accel_white_sd=0.0,
                significant_wave_height=0.0)


def streams(config, start=0):
    """Return the samples by topic."""
    found = {}
    for _, topic, sample in SkimmingSimulator(config, start):
        found.setdefault(topic, []).append(sample)
    return found


@pytest.mark.parametrize('speed, heading', [(60.0, 180.0), (60.0, 90.0), (20.0, 140.0)])
def test_surface_has_the_encounter_spectrum_by_its_definition(speed, heading):
    """Density by the paper's formula: S(w) / |1 - 2 w V cos(heading) / g| at the met frequency."""
    config = SkimmingSimulatorConfig(
        speed=speed, wave_heading_deg=heading, spreading=0.0, rate=10.0, waves=200)
    surface = DisturbanceSource(config, 5).take(9000).elevation
    frequency, density = welch(surface, fs=10.0, nperseg=1024, axis=0)
    measured, met = density.mean(axis=1) / (2 * pi), 2 * pi * frequency
    omega = np.geomspace(0.15, 2.2, 4000)
    along = speed * np.cos(np.radians(heading)) / GRAVITY
    expected = np.interp(met, omega - omega**2 * along, Bretschneider(7.5, 15.03).density(omega)
                         / np.abs(1 - 2 * omega * along))
    inside = expected > 0.15 * expected.max()
    assert inside.sum() > 5
    assert measured[inside] / expected[inside] == pytest.approx(1, abs=0.4)
    assert np.mean(measured[inside] / expected[inside]) == pytest.approx(1, abs=0.1)


def test_rate_of_the_surface_is_its_derivative():
    config = replace(CONFIG, rate_sees_waves=True)
    made = DisturbanceSource(config, 2).take(500)
    slope = (made.elevation[2:] - made.elevation[:-2]) * config.rate / 2
    assert made.elevation_rate[1:-1] == pytest.approx(slope, abs=0.15)


def test_footprint_takes_the_short_waves_away():
    point, wide = (DisturbanceSource(replace(CONFIG, footprint=radius), 3).take(2000).elevation
                   for radius in (0.0, 60.0))
    assert wide.std() < 0.8 * point.std()
    assert np.abs(np.diff(wide, 2, axis=0)).max() < 0.3 * np.abs(np.diff(point, 2, axis=0)).max()


def test_sensor_errors_are_as_large_and_as_slow_as_they_should_be():
    config = replace(CONFIG, waves=10, significant_wave_height=0.0)
    made = DisturbanceSource(config, 400).take(400)
    assert made.range.mean(axis=0).std() == pytest.approx(1.0, rel=0.12)
    assert (made.range - made.range.mean(axis=0)).std() == pytest.approx(0.5, rel=0.02)
    assert made.rate.mean(axis=0).std() == pytest.approx(0.2, rel=0.12)
    assert made.acceleration.std() == pytest.approx(0.05 * 3**0.5, rel=0.05)
    lagged = np.mean(made.acceleration[20:] * made.acceleration[:-20])  # 0.2 s = 1 / alpha
    assert lagged == pytest.approx(0.05**2 * (1 + np.exp(-1)), rel=0.1)


def test_a_run_depends_neither_on_the_others_nor_on_the_stretches():
    source = DisturbanceSource(CONFIG, 3)
    parts = [source.take(n) for n in (7, 93)]
    alone = DisturbanceSource(replace(CONFIG, seed=CONFIG.seed + 2)).take(100)
    for name in ('elevation', 'range', 'rate', 'acceleration'):
        together = np.concatenate([getattr(part, name) for part in parts])
        assert together[:, 2] == pytest.approx(getattr(alone, name)[:, 0], abs=1e-12)


def test_profile_is_the_integral_of_its_derivatives():
    profile = Profile((45.0, 8.0, 35.0), (2.0, 9.0), 4.0)
    times = np.arange(0.0, 16.0, 5e-3)
    values = np.array([profile.at(time) for time in times])
    for k in range(3):
        change = np.cumsum((values[1:, k + 1] + values[:-1, k + 1]) / 2) * 5e-3
        assert values[1:, k] - values[0, k] == pytest.approx(change, abs=0.2 if k == 2 else 1e-3)
    assert [profile.at(time)[0] for time in (0.0, 4.0, 7.0, 30.0)] == [45.0, 26.5, 8.0, 35.0]


def test_autopilot_flies_the_profile_and_turns_errors_into_heights():
    profile = Profile((45.0, 8.0, 35.0), (2.0, 9.0), 4.0)
    pilot = Autopilot(profile, 0.01)
    for k in range(1600):
        pilot.step(pilot.height, pilot.rate)
        assert pilot.height == pytest.approx(profile.at(0.01 * (k + 1))[0], abs=0.3)
    pilot = Autopilot(profile, 0.01, (2,))
    for _ in range(4000):
        pilot.step(pilot.height + [0.0, 1.5], pilot.rate)
    assert pilot.height == pytest.approx([35.0, 33.5], abs=1e-3)


def test_without_errors_the_sensors_say_the_truth():
    found = streams(QUIET)
    truth = found['altitude/truth']
    height = np.array([sample.position[2] for sample in truth])
    rate = np.array([sample.linear_velocity[2] for sample in truth])
    assert [sample.distance for sample in found['altimeter/range']] == pytest.approx(height)
    assert [sample.velocity[2] for sample in found['altimeter/rate']] == pytest.approx(rate)
    up = [rotated(sample.orientation, sample.specific_force) for sample in found['uav/imu']]
    assert np.array(up)[:, :2] == pytest.approx(0, abs=1e-9)
    assert np.diff(rate) == pytest.approx((np.array(up)[1:, 2] - GRAVITY) / 100, abs=1e-9)
    assert np.diff(height) == pytest.approx((rate[1:] + rate[:-1]) / 200, abs=1e-4)


def test_the_stream_is_the_first_of_the_arrays():
    found, made = streams(CONFIG, start=5), DisturbanceSource(CONFIG, 2).take(2000)
    height = np.array([sample.position[2] for sample in found['altitude/truth']])
    assert [sample.distance for sample in found['altimeter/range']] == pytest.approx(
        height - made.elevation[:, 0] + made.range[:, 0])
    assert found['uav/imu'][3].stamp == 5 + 3 * NANOSECONDS // 100


def test_topics_come_in_the_order_of_the_contract_and_at_their_rates():
    config = replace(CONFIG, altimeter_rate=25.0, duration=2.0)
    events = list(SkimmingSimulator(config))
    assert [event.topic for event in events[:4]] == [
        'altimeter/range', 'altimeter/rate', 'uav/imu', 'altitude/truth']
    counts = {topic: len(samples) for topic, samples in streams(config).items()}
    assert counts == {'altimeter/range': 50, 'altimeter/rate': 50, 'uav/imu': 200,
                      'altitude/truth': 200}
    assert events == list(SkimmingSimulator(config))
    delayed = list(SkimmingSimulator(replace(config, delay=(0.0, 0.05), dropout=(0.1, 0.1))))
    assert [event.time for event in delayed] == sorted(event.time for event in delayed)
    assert len(delayed) < len(events)


def test_what_the_altimeter_meets():
    found = streams(replace(QUIET, loss_of_lock=(3.0, 4.0), obstacle=(5.0, 6.0, 30.0)))
    distance = np.array([sample.distance for sample in found['altimeter/range']])
    height = np.array([sample.position[2] for sample in found['altitude/truth']])
    assert np.all(distance[300:400] == inf) and np.isfinite(np.delete(distance, range(300, 400))
                                                            ).all()
    assert height[500:600] - distance[500:600] == pytest.approx(30.0)
    assert len(found['altimeter/rate']) == 1900

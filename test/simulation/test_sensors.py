"""Sensors: the statistics of their errors, the order of their messages."""

from math import exp, sqrt

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from deck_motion_ros.simulation.sensors import AxisErrors, AxisSensor, Delivery


def errors_of(errors, times, seed=0, value=0.0):
    sensor = AxisSensor(errors, np.random.default_rng(seed))
    return np.array([sensor.measure(value, time) for time in times]) - value


def test_a_perfect_sensor_tells_the_truth():
    assert not errors_of(AxisErrors(), np.arange(10) * 0.1, value=1.234).any()


def test_white_noise_is_white_and_as_large_as_told():
    noise = errors_of(AxisErrors(white_sd=0.3), np.arange(20000) * 0.01)
    assert noise.std() == pytest.approx(0.3, rel=0.02)
    assert abs(noise.mean()) < 3 * 0.3 / sqrt(20000)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 3 / sqrt(20000)


def test_drift_keeps_its_size_and_forgets_at_uneven_times():
    times = np.array([0.0, 0.5, 3.0, 10.0, 10.01])
    runs = np.array([errors_of(AxisErrors(drift_sd=2.0, drift_time=5.0), times, seed)
                     for seed in range(3000)])
    np.testing.assert_allclose(runs.std(axis=0), 2.0, rtol=0.05)
    for k in range(1, 5):
        assert np.corrcoef(runs[:, 0], runs[:, k])[0, 1] == pytest.approx(
            exp(-times[k] / 5.0), abs=0.04)
    assert np.abs(runs[:, 4] - runs[:, 3]).max() < 1.0  # slow, not white


def test_bias_is_constant():
    np.testing.assert_allclose(errors_of(AxisErrors(bias=-0.7), np.arange(5.0), value=3.0), -0.7)


def test_resolution_rounds_to_its_steps():
    readings = errors_of(AxisErrors(white_sd=1.0, resolution=0.25), np.arange(8000.0), seed=1)
    assert not np.any(readings % 0.25)
    exact = errors_of(AxisErrors(white_sd=1.0), np.arange(8000.0), seed=1)
    rounding = readings - exact
    assert np.abs(rounding).max() <= 0.125 + 1e-12
    assert rounding.std() == pytest.approx(0.25 / sqrt(12), rel=0.03)


def test_told_variance_is_that_of_the_error():
    errors = AxisErrors(white_sd=0.5, drift_sd=0.8, drift_time=0.01, bias=3.0, resolution=1.0)
    assert errors_of(errors, np.arange(20000.0)).var() == pytest.approx(errors.var, rel=0.03)


def test_same_seed_same_noise():
    errors, times = AxisErrors(0.1, 0.2, 3.0), np.arange(50) * 0.02
    np.testing.assert_array_equal(errors_of(errors, times, 4), errors_of(errors, times, 4))
    assert np.all(errors_of(errors, times, 4) != errors_of(errors, times, 5))


@given(latency=st.floats(0, 1), jitter=st.floats(0, 1), delay=st.floats(0, 1),
       seed=st.integers(0, 1000))
def test_messages_keep_their_order_and_none_comes_before_its_stamp(latency, jitter, delay, seed):
    rng, delivery = np.random.default_rng(seed), Delivery(latency, jitter, delay)
    instants = [10**18 + k * 20_000_000 for k in range(40)]
    out = [delivery.deliver(instant, 0.02, rng) for instant in instants]
    stamps, arrivals = (np.array(part) for part in zip(*out, strict=True))
    assert np.all(np.diff(stamps) > 0) and np.all(np.diff(arrivals) > 0)
    assert np.all(arrivals >= np.maximum(stamps, instants))


def test_latency_jitter_and_losses_are_as_told():
    delivery = Delivery(latency=0.1, jitter=0.002, delay=0.05, dropout=0.2)
    rng = np.random.default_rng(8)
    out = [delivery.deliver(k * 20_000_000, 0.02, rng) for k in range(10000)]
    kept = [(stamp - k * 20_000_000, arrival - stamp)
            for k, (stamp, arrival) in ((k, pair) for k, pair in enumerate(out) if pair)]
    late, slow = np.array(kept).T * 1e-9
    assert late.mean() == pytest.approx(0.1, abs=1e-4)
    assert late.std() == pytest.approx(0.002, rel=0.03)
    np.testing.assert_allclose(slow, 0.05)
    assert len(kept) == pytest.approx(8000, abs=120)

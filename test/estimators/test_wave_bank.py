"""The bank of wave spectra: against Gaussian processes solved at once, pure waves, and drifts."""

import gc
import weakref

import numpy as np
import pytest

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.wave_bank import BANK, BankAxis, Certainty, WaveBank
from deck_motion_ros.samples import ROLL

PERIOD, WIDTH, NOISE, LEVEL_VAR, LEVEL_TIME = 9.0, 0.3, 1e-3, 0.3, 500.0
ONE = WaveBank([PERIOD], [WIDTH], [(NOISE, LEVEL_VAR, LEVEL_TIME)])


def covariance(lags):
    """Integrate the spectrum of the band-pass; add that of the level."""
    omega = np.linspace(0.0, 4.0, 2001)
    middle = 2 * np.pi / PERIOD
    circle = np.exp(1j * np.pi * np.array([4, 6, 8]) / 6)
    s = 1j * omega
    power = 1.0
    for pole in middle * (1j + WIDTH * circle):
        power = power / np.abs((s - pole) * (s - pole.conjugate()))**2
    power *= omega**4
    wave = np.cos(np.multiply.outer(np.abs(lags), omega)) @ power / power.sum()
    return wave + LEVEL_VAR * np.exp(-np.abs(lags) / LEVEL_TIME)


def drawn(rng, times, runs=1):
    cov = covariance(times[:, None] - times) + NOISE * np.eye(len(times))
    return rng.standard_normal((runs, len(times))) @ np.linalg.cholesky(cov).T


def feed(axis, times, values, var=0.0):
    for time, value in zip(times.tolist(), values.tolist()):
        axis.measure(time, value, var)
    return axis


def wave(times, period, size=1.0, phase=0.7):
    return size * np.cos(2 * np.pi * times / period + phase)


def test_equals_the_gaussian_process_solved_at_once():
    rng, horizons = np.random.default_rng(1), np.array([0.4, 1.0, 3.0, 8.0])
    times = np.cumsum(rng.uniform(0.6, 1.6, 30))  # uneven
    values, = drawn(rng, times)
    axis = feed(BankAxis(1.0, Certainty(ONE)), times, values)
    axis.usual = 0.0  # of this record alone
    outlook = axis.outlook()
    prior = covariance(times[:, None] - times) + NOISE * np.eye(len(times))
    ahead = times[-1] + horizons
    gain = np.linalg.solve(prior, covariance(times[:, None] - ahead)).T
    now = float(times[-1])
    value, rate = outlook.motion(now, horizons)
    np.testing.assert_allclose(value, gain @ values, atol=1e-4)
    step = 1e-4
    slope = (outlook.motion(now, horizons + step)[0] - outlook.motion(now, horizons - step)[0])
    np.testing.assert_allclose(rate, slope / (2 * step), rtol=1e-3)
    unit = covariance(np.zeros(1)) - np.einsum('ht,th->h', gain, covariance(
        times[:, None] - ahead))
    spread = outlook.spread(now, horizons)[0]
    np.testing.assert_allclose(spread / spread[-1], unit / unit[-1], rtol=1e-3)
    assert [outlook.mean(float(time)) for time in ahead] == pytest.approx(value)


def test_the_expected_value_is_the_outlook_now():
    times = np.arange(0.0, 30.0, 0.5)
    axis = feed(BankAxis(1.0, Certainty(BANK)), times, wave(times, 8.0))
    for time in (29.5, 29.6, 29.9, 30.2, 31.0, 40.0):
        assert axis.expected(time) == pytest.approx(axis.outlook().mean(time), abs=3e-3)


def test_between_two_groups_the_far_future_is_as_wide_as_the_motion_of_minutes():
    times = np.arange(0.0, 330.0, 0.5)
    values = np.where(times < 300, 1.0, 0.1) * wave(times, 8.0)
    axis = feed(BankAxis(1.0, Certainty(BANK)), times, values)
    near, far = np.sqrt(axis.outlook().spread(329.5, np.array([1.0, 120.0]))[0])
    assert near < 0.2
    assert axis.usual == pytest.approx(np.var(values), rel=0.1)
    assert 0.8 * np.std(values) < far < 1.3 * np.std(values)


@pytest.mark.parametrize('rate', [1.0, 2.0, 10.0, 1000.0])
@pytest.mark.parametrize('period', [5.0, 9.0, 18.0])
def test_a_pure_wave_is_foretold_after_two_periods(period, rate):
    times = np.arange(0.0, 2.2 * period, 1 / rate)
    axis = feed(BankAxis(1.0, Certainty(BANK)), times, 0.2 + wave(times, period, 0.2))
    now, horizons = float(times[-1]), np.array([1.0, 3.0])
    ahead = axis.outlook().motion(now, horizons)[0]
    np.testing.assert_allclose(ahead, 0.2 + wave(now + horizons, period, 0.2), atol=0.04)


def test_likelihood_finds_the_right_period():
    rng, times = np.random.default_rng(2), np.arange(0.0, 60.0, 0.5)
    periods = [6.0, PERIOD, 13.0]
    bank = WaveBank(periods, [WIDTH], [(NOISE, LEVEL_VAR, LEVEL_TIME)])
    found = []
    for values in drawn(rng, times, 10):
        errors = []
        for models in (bank, ONE):
            axis, error = BankAxis(1.0, Certainty(models)), []
            for time, value in zip(times.tolist(), values.tolist()):
                if time > 30:
                    error.append(axis.outlook().mean(time) - value)
                axis.measure(time, value, 0.0)
            errors.append(np.std(error))
        found.append(errors[0] / errors[1])
    assert np.mean(found) < 1.05  # as good as who knows


def test_is_as_sure_as_it_says():
    """From second 10 on, in seas that no model of the bank is, of any size."""
    rng, inside = np.random.default_rng(3), []
    for size in (1e-3, 0.1, 10.0):
        for _ in range(8):
            omega = rng.uniform(0.3, 1.4) * (1 + 0.15 * rng.standard_normal(200))
            phase = rng.uniform(0, 2 * np.pi, 200)
            times = np.arange(0.0, 60.0, 0.5)
            truth = size * np.cos(np.outer(times, omega) + phase).sum(axis=1) / 10
            noisy = truth + 0.01 * size * rng.standard_normal(len(times))
            axis = BankAxis(1.0, Certainty(BANK))
            for k, time in enumerate(times[:-6].tolist()):
                axis.measure(time, float(noisy[k]), 0.0)
                if time > 10:
                    outlook, three = axis.outlook(), np.array([3.0])
                    error = outlook.motion(time, three)[0, 0] - truth[k + 6]
                    inside.append(error**2 < 1.96**2 * outlook.spread(time, three)[0, 0])
    assert 0.90 < np.mean(inside) < 0.99


def test_a_drift_is_no_wave():
    """A random walk goes nowhere: nothing is better than its last value."""
    rng, times = np.random.default_rng(4), np.arange(0.0, 300.0, 0.5)
    walk = np.cumsum(rng.standard_normal(len(times)))
    axis, errors = BankAxis(1.0, Certainty(BANK)), []
    for k, time in enumerate(times[:-10].tolist()):
        axis.measure(time, float(walk[k]), 0.0)
        errors.append((axis.outlook().mean(time + 5.0) - walk[k + 10], walk[k] - walk[k + 10]))
    ours, last = np.sqrt(np.mean(np.square(errors[100:]), axis=0))
    assert ours < 1.25 * last


def test_before_anything_came_and_long_after():
    axis, times = BankAxis(0.3, Certainty(BANK)), np.arange(0.0, 60.0, 0.5)
    values, = 0.3 * drawn(np.random.default_rng(6), times)
    for outlook in (axis.outlook(), feed(axis, times, values).outlook()):
        (value,), (rate,) = outlook.motion(5.0e4, np.ones(1))
        (var,), (rate_var,) = outlook.spread(5.0e4, np.ones(1))
        assert abs(value) < 0.05 and abs(rate) < 0.05
        assert 0.2 < np.sqrt(var) < 2.0 and rate_var > 0


@pytest.mark.parametrize('var', [1e-6, 0.0])
def test_constant_input_leaves_a_doubt(var):
    times = np.arange(0.0, 600.0, 0.5)
    axis = feed(BankAxis(1.0, Certainty(BANK)), times, np.zeros(len(times)), var)
    var = axis.outlook().spread(600.0, np.array([0.0, 3.0]))
    assert np.all(var > 0) and np.all(np.isfinite(var))


def test_axes_in_step_share_and_even_steps_settle():
    start = Certainty(BANK)
    assert start.after(0.5) is start.after(0.5)
    here = start
    for _ in range(2000):
        here = here.after(0.5)
    assert here.after(0.5) is here
    assert here.after(0.6) is not here


def test_what_is_past_is_forgotten():
    """However uneven the stamps, and though one axis has never come."""
    rng, predictor = np.random.default_rng(5), AdaptivePredictor()
    alive = []
    for time in np.cumsum(rng.uniform(0.5, 0.7, 100)).tolist():
        predictor.measure(ROLL, time, float(rng.standard_normal()), 1e-6)
        predictor.outlook()
        alive.append(weakref.ref(predictor._filters[ROLL]._certainty))
    gc.collect()
    assert sum(item() is not None for item in alive) <= 3

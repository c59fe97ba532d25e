"""Filters that follow the ship: the fit, the score of realised forecasts, the axis as a whole."""

from math import isfinite, sqrt

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from deck_motion_ros.estimators.kalman import riccati_bound
from deck_motion_ros.estimators.shaping import (
    AxisFilter,
    fit_shaping_filter,
    ForecastScore,
    in_radians,
    ShapingPredictor,
    Slots,
    TunedAxis,
)
from deck_motion_ros.processes import LI2014_HEAVE, LI2014_PITCH, ShapingFilter, van_loan
from deck_motion_ros.samples import HEAVE, PITCH, ROLL


def record(process, rate, duration, seed, mean=0.0):
    """Simulate a process: times and values."""
    rng = np.random.default_rng(seed)
    dt, steps = 1 / rate, round(rate * duration)
    phi, mat_q = van_loan(process.mat_a, process.intensity * np.outer(
        process.vec_b, process.vec_b), dt)
    p11, p12, p22 = process.stationary
    x = np.linalg.cholesky([[p11, p12], [p12, p22]]) @ rng.normal(size=2)
    drive = np.linalg.cholesky(mat_q) @ rng.normal(size=(2, steps))
    values = np.empty(steps)
    for k in range(steps):
        values[k] = x[0] + mean
        x = phi @ x + drive[:, k]
    return dt * np.arange(steps), values


def fitted(times, values):
    """Fit a filter to a record."""
    slots = Slots()
    for time, value in zip(times.tolist(), values.tolist(), strict=True):
        slots.add(time, value)
    return fit_shaping_filter(slots)


def correlation_gap(process, other):
    """Return the rms difference of two autocorrelations over 8 s."""
    lags = np.linspace(0.25, 8.0, 32)
    return sqrt(np.mean((process.autocorrelation(lags) - other.autocorrelation(lags))**2))


TRUE = ShapingFilter.of_motion(0.8, 0.75, 0.12)


@pytest.mark.parametrize('rate', [1.0, 4.0, 10.0, 50.0])
def test_the_fit_recovers_a_known_process(rate):
    """Five minutes hold some 35 swings: the estimate itself scatters by about a tenth."""
    found = []
    for seed in range(6):
        process, mean, excess = fitted(*record(TRUE, rate, 300.0, seed, mean=5.0))
        assert mean == pytest.approx(5.0, abs=0.2)
        assert process.sd**2 + excess == pytest.approx(TRUE.sd**2, rel=0.75)
        assert correlation_gap(process, TRUE) < 0.35
        found.append((sqrt(process.stiffness), process.sd))
    peak, sd = np.mean(found, axis=0)
    assert peak == pytest.approx(0.75, rel=0.1)
    assert sd == pytest.approx(0.8, rel=0.15)


@pytest.mark.parametrize('peak', [0.35, 0.75, 1.5, 2.5])
def test_the_fit_finds_slow_and_fast_ships(peak):
    process, _, _ = fitted(*record(ShapingFilter.of_motion(1.0, peak, 0.08), 20.0, 300.0, 3))
    assert sqrt(process.stiffness) == pytest.approx(peak, rel=0.12)


def test_uneven_and_missing_samples_hardly_change_the_fit():
    times, values = record(TRUE, 20.0, 300.0, 1)
    whole, _, _ = fitted(times, values)
    keep = np.random.default_rng(5).uniform(size=len(times)) < 0.3
    keep[(times > 100) & (times < 130)] = False
    thinned, _, _ = fitted(times[keep], values[keep])
    assert correlation_gap(whole, thinned) < 0.12
    assert thinned.sd == pytest.approx(whole.sd, rel=0.15)


def test_white_noise_on_top_is_not_taken_for_motion():
    times, values = record(TRUE, 4.0, 300.0, 2)
    plain, _, _ = fitted(times, values)
    noisy = values + 0.4 * np.random.default_rng(1).normal(size=len(values))
    process, _, excess = fitted(times, noisy)
    assert correlation_gap(process, plain) < 0.15
    assert excess == pytest.approx(0.16, rel=0.5)


@pytest.mark.parametrize('values', [np.zeros(400), np.full(400, 3.0), np.eye(1, 400, 200).ravel(),
                                    np.arange(400.0), (-1.0)**np.arange(400),
                                    1e-12 * np.arange(400.0), 1e9 * np.sin(np.arange(400.0))])
def test_records_without_a_sea_give_a_filter_all_the_same(values):
    process, mean, excess = fitted(0.25 * np.arange(400), values)
    assert all(map(isfinite, (process.sd, mean, excess)))
    assert process.sd > 0 and excess >= 0


def test_only_the_last_five_minutes_count():
    times, values = record(TRUE, 4.0, 700.0, 4)
    forgotten = fitted(times, np.where(times < 300, 50 * np.sin(2.5 * times), values))
    never_there = fitted(times[times >= 300], values[times >= 300])
    assert forgotten[0] == never_there[0]
    assert forgotten[1] == pytest.approx(never_there[1])


def test_memory_of_slots_is_bounded():
    slots = Slots()
    for k in range(20_000):
        slots.add(0.3 * k, 1.0)
    assert len(slots._slots) <= Slots.WINDOW / Slots.SLOT + 2


def scored(process, model, seed, gain=1.0, rate=2.0, duration=700.0, noise=0.02, useless=False):
    """Score a filter of ``model`` on a motion of ``process``."""
    times, values = record(process, rate, duration, seed)
    rng = np.random.default_rng(seed + 1)
    measured = values + noise * rng.normal(size=len(values))
    came = record(process, rate, duration, seed + 100)[1] if useless else measured
    state, score = AxisFilter(model), ForecastScore()
    for time, value, true in zip(times.tolist(), measured.tolist(), came.tolist(), strict=True):
        score.compare(time, true, noise**2)
        state.measure(time, gain * value, noise**2)
        score.keep(time, state)
    return score


def test_right_forecasts_keep_slope_and_ratio_at_one():
    scores = [scored(LI2014_HEAVE, LI2014_HEAVE, seed) for seed in range(6)]
    slopes = np.mean([score.slopes for score in scores], axis=0)
    ratios = np.mean([score.ratios for score in scores], axis=0)
    assert (slopes[:5] > 0.9).all()
    assert ratios == pytest.approx(np.ones(8), abs=0.25)


def test_forecasts_of_something_else_are_given_no_weight():
    slopes = np.mean([scored(LI2014_HEAVE, LI2014_HEAVE, seed, useless=True).slopes
                      for seed in range(6)], axis=0)
    assert slopes[0] == 1.0
    assert (slopes[1:6] < 0.2).all()


def test_forecasts_twice_too_large_are_halved():
    twice = ShapingFilter(2 * LI2014_HEAVE.gain, LI2014_HEAVE.damping, LI2014_HEAVE.stiffness)
    slopes = np.mean([scored(LI2014_HEAVE, twice, seed, gain=2.0).slopes for seed in range(4)],
                     axis=0)
    assert slopes[1:5] == pytest.approx(0.5 * np.ones(4), abs=0.08)


def test_promises_twice_too_bold_are_widened():
    timid = ShapingFilter(LI2014_HEAVE.gain / 2, LI2014_HEAVE.damping, LI2014_HEAVE.stiffness)
    ratios = np.mean([scored(LI2014_HEAVE, timid, seed).ratios for seed in range(4)], axis=0)
    assert (ratios[2:6] > 2.2).all() and (ratios[2:6] < 6.0).all()


def promises(process, rate, seed, duration=420.0, noise=0.05, jitter=0.3, drop=0.1, horizon=3.0):
    """Feed a tuned axis with an uneven, gappy record; return errors and promised sds."""
    times, values = record(process, 100.0, duration, seed)
    rng = np.random.default_rng(seed)
    axis, errors, sds = TunedAxis(LI2014_HEAVE), [], []
    for k in range(1, round(duration * rate) - 1):
        if rng.uniform() < drop:
            continue
        n = round(100.0 / rate * (k + jitter * rng.uniform(-0.5, 0.5)))
        time = float(times[n])
        axis.measure(time, float(values[n]) + noise * rng.normal(), noise**2)
        due = n + round(100 * horizon)
        if time > 120 and due < len(times):
            mean, var, _, _ = axis.outlook().predict(time + horizon)
            errors.append(mean - float(values[due]))
            sds.append(sqrt(var))
    return np.array(errors), np.array(sds)


@pytest.mark.parametrize('rate', [1.0, 5.0])
@pytest.mark.parametrize('horizon', [1.0, 3.0, 10.0])
def test_a_tuned_axis_keeps_its_promises(rate, horizon):
    results = [promises(TRUE, rate, seed, horizon=horizon) for seed in range(3)]
    errors, sds = (np.concatenate(part) for part in zip(*results, strict=True))
    assert 0.90 <= np.mean(np.abs(errors) < 1.96 * sds) <= 0.99
    assert 0.75 < sqrt(np.mean(errors**2) / np.mean(sds**2)) < 1.25


def test_a_tuned_axis_comes_near_the_bound():
    errors = np.concatenate([promises(TRUE, 5.0, seed, jitter=0.0, drop=0.0)[0]
                             for seed in range(4)])
    bound = riccati_bound(TRUE, 0.2, 0.05**2, 3.0)
    assert bound * 0.9 < sqrt(np.mean(errors**2)) < 1.2 * bound


def test_when_a_calm_ends_the_promise_is_honest_within_a_minute():
    """Moored, then at sea: what the calm taught must not be felt for minutes."""
    times, values = record(LI2014_HEAVE, 10.0, 420.0, 3)
    rng = np.random.default_rng(1)
    axis, errors, sds = TunedAxis(LI2014_HEAVE), [], []
    for time, value in zip(times.tolist(), values.tolist(), strict=True):
        true = value if time >= 200 else 0.005 * value
        axis.measure(time, true + 0.01 * rng.normal(), 0.05**2)
        if 260 < time < 416:
            mean, var, _, _ = axis.outlook().predict(time + 3.0)
            errors.append(mean - values[round(10 * (time + 3.0))])
            sds.append(sqrt(var))
    assert sqrt(np.mean(np.square(errors))) < 1.25 * riccati_bound(LI2014_HEAVE, 0.1, 1e-4, 3.0)
    assert 0.7 < sqrt(np.mean(np.square(errors)) / np.mean(np.square(sds))) < 1.3


def test_refits_make_no_large_step():
    """At a refit the 3 s forecast moves little more than between any two samples."""
    times, values = record(TRUE, 10.0, 300.0, 8)
    axis = TunedAxis(LI2014_HEAVE)
    ordinary, at_refit, last, process = [], [], None, None
    for time, value in zip(times.tolist(), values.tolist(), strict=True):
        axis.measure(time, value, 1e-4)
        ahead = axis.outlook().mean(time + 3.0)
        if last is not None and time > 120:
            (ordinary if axis.filter.process is process else at_refit).append(abs(ahead - last))
        last, process = ahead, axis.filter.process
    assert len(at_refit) > 20
    assert np.median(at_refit) < 2.5 * np.median(ordinary)
    assert max(at_refit) < 0.75 * TRUE.sd


def test_same_input_same_bits():
    times, values = record(TRUE, 7.0, 200.0, 1)
    axes = TunedAxis(LI2014_HEAVE), TunedAxis(LI2014_HEAVE)
    for time, value in zip(times.tolist(), values.tolist(), strict=True):
        for axis in axes:
            axis.measure(time, value, 0.01)
    assert axes[0].outlook().predict(210.0) == axes[1].outlook().predict(210.0)


def test_an_outlook_is_frozen():
    times, values = record(TRUE, 7.0, 100.0, 1)
    axis = TunedAxis(LI2014_HEAVE)
    for time, value in zip(times[:350].tolist(), values[:350].tolist(), strict=True):
        axis.measure(time, value, 0.01)
    outlook = axis.outlook()
    before = outlook.predict(60.0)
    for time, value in zip(times[350:].tolist(), values[350:].tolist(), strict=True):
        axis.measure(time, value, 0.01)
    assert outlook.predict(60.0) == before


def joint(correlation, seed=1, duration=600.0):
    """Feed roll, pitch and heave of one sea; return the learned error correlation."""
    times, common = record(TRUE, 5.0, duration, seed)
    predictor = ShapingPredictor()
    scale = (0.02, 0.01, 1.0)
    own = [record(TRUE, 5.0, duration, seed + 1 + axis)[1] for axis in range(3)]
    for k, time in enumerate(times.tolist()):
        for axis in (ROLL, PITCH, HEAVE):
            value = sqrt(correlation) * common[k] + sqrt(1 - correlation) * own[axis][k]
            predictor.measure(axis, time, scale[axis] * float(value), (0.02 * scale[axis])**2)
    return predictor.outlook().forecast(duration, np.array([3.0])).cov[0]


@pytest.mark.parametrize('correlation', [0.0, 0.8])
def test_what_the_axes_errors_have_in_common_is_learned(correlation):
    cov = joint(correlation)
    sd = np.sqrt(np.diag(cov))
    found = (cov / np.outer(sd, sd))[np.triu_indices(3, 1)]
    assert found == pytest.approx(correlation * np.ones(3), abs=0.3)
    assert np.linalg.eigvalsh(cov / np.outer(sd, sd)).min() > 0


def test_a_mean_rate_is_a_difference_of_forecasts():
    state = AxisFilter(LI2014_PITCH, mean=3.0)
    times, values = record(LI2014_PITCH, 10.0, 30.0, 1, mean=3.0)
    for time, value in zip(times.tolist(), values.tolist(), strict=True):
        state.measure(time, value, 0.01)
    for ahead in (0.5, 2.0, 9.0):
        rate, var = state.mean_rate(ahead)
        late, early = state.deviation(ahead + 0.25)[0], state.deviation(ahead - 0.25)[0]
        assert rate == pytest.approx((late - early) / 0.5)
        assert var > 0
    far = state.mean_rate(500.0)[1]
    rho = float(LI2014_PITCH.autocorrelation(np.array(0.5)))
    assert far == pytest.approx(2 * LI2014_PITCH.sd**2 * (1 - rho) / 0.25, rel=1e-6)


@settings(max_examples=40)
@given(st.floats(1e-3, 50.0), st.floats(-20.0, 20.0))
def test_degrees_and_radians_are_the_same_filter(dt, value):
    deg, rad = AxisFilter(LI2014_PITCH), AxisFilter(in_radians(LI2014_PITCH))
    for k in range(1, 4):
        one = deg.measure(k * dt, value, 0.25)
        two = rad.measure(k * dt, np.radians(value), np.radians(0.5)**2)
        assert one == pytest.approx(two, rel=1e-9, abs=1e-12)
    assert np.radians(deg.deviation(3.0)[0]) == pytest.approx(rad.deviation(3.0)[0], abs=1e-12)

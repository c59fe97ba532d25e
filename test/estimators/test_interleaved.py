"""The interleaved pair: its taps, its promises, its thinning, and what ships make of it."""

from math import pi, radians, sqrt

import numpy as np
import pytest

from deck_motion_ros.estimators.interleaved import (
    AccelerationFilter,
    InterleavedAxis,
    InterleavedPredictor,
    jerk_covariance,
    transition,
)
from deck_motion_ros.estimators.shaping import LI2014
from deck_motion_ros.processes import van_loan
from deck_motion_ros.samples import HEAVE, PITCH, ROLL

VAR = 0.01


def taps(fading, horizon=1.0, number=60):
    """Return the weights of the newest samples, newest first, of the settled filter."""
    half = AccelerationFilter(0.0, VAR, 1.0, 1.0, fading=fading)
    for _ in range(40):
        half.step(1.0, 0.0, VAR)
    weights = []
    for k in range(number):
        half.step(1.0, float(k == 0), VAR)
        weights.append(float(half.ahead(horizon)))
    return np.array(weights), half


def test_fading_makes_it_a_parabola_through_three_points():
    weights, _ = taps(100.0)
    assert weights[:3] == pytest.approx([2.98, -2.95, 0.95], abs=0.005)
    assert np.abs(weights[3:]).max() < 0.03
    assert sqrt(weights @ weights) == pytest.approx(4.3, abs=0.05)


@pytest.mark.parametrize('fading', [1.0, 5.0, 100.0])
@pytest.mark.parametrize('horizon', [0.0, 1.0, 3.0])
def test_promised_noise_is_that_of_the_taps(fading, horizon):
    weights, half = taps(fading, horizon)
    row = transition(horizon)[0]
    assert row @ half.by_noise @ row / VAR == pytest.approx(weights @ weights, rel=1e-6)


@pytest.mark.parametrize('fading', [1.0, 100.0])
def test_a_parabola_is_followed_to_round_off(fading):
    half = AccelerationFilter(1.0, VAR, 1.0, 1.0, fading=fading)
    time = 0.0
    for step in np.random.default_rng(1).uniform(0.5, 2.0, 80):
        time += step
        half.step(step, 1.0 - 2.0 * time + 0.3 * time**2, VAR)
    expected = [1.0 - 2.0 * time + 0.3 * time**2, -2.0 + 0.6 * time, 0.6]
    assert half.vec_x == pytest.approx(expected, rel=1e-9)


def test_jerk_covariance_is_van_loans():
    mat_a = np.diag([1.0, 1.0], 1)
    phi, mat_q = van_loan(mat_a, np.diag([0.0, 0.0, 1.0]), 1.7)
    assert transition(1.7) == pytest.approx(phi)
    assert jerk_covariance(1.7) == pytest.approx(mat_q)


@pytest.mark.parametrize('fading', [1.0, 100.0])
def test_promises_hold_on_ideal_motion(fading):
    """White jerk, white noise, uneven steps: errors and innovations are of the promised size."""
    rng = np.random.default_rng(2)
    runs, psd, rate_sd, acceleration_sd = 4000, 0.02, 0.5, 0.4
    x = np.outer([0.0, rate_sd, acceleration_sd], np.ones(runs)) * rng.normal(size=(3, runs))
    half = AccelerationFilter(x[0] + sqrt(VAR) * rng.normal(size=runs), VAR, rate_sd,
                              acceleration_sd, psd, fading)
    for step in (1.0, 0.6, 1.4, 2.0, 1.0, 0.9):
        root = np.linalg.cholesky(psd * jerk_covariance(step))
        x = transition(step) @ x + root @ rng.normal(size=(3, runs))
        value = x[0] + sqrt(VAR) * rng.normal(size=runs)
        innovation, by_noise, by_jerk = half.step(step, value, VAR)
        assert np.var(innovation) == pytest.approx(by_noise + psd * by_jerk, rel=0.1)
        cov = half.by_noise + psd * half.by_jerk
        error = half.vec_x - x
        assert np.mean(error * np.linalg.solve(cov, error)) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize('fading', [1.0, 100.0])
def test_both_orders_of_the_flow_are_one_filter(fading):
    """Eq 3-8 (predict, put out, update) against eq 9-14 (update, predict, put out)."""
    values = np.random.default_rng(3).normal(size=200)
    half = AccelerationFilter(values[0], VAR, 1.0, 2.0, fading=fading)
    x, cov = np.array([values[0], 0.0, 0.0]), np.diag([VAR, 1.0, 4.0])
    mat_a, row_h = transition(1.0), np.array([1.0, 0.0, 0.0])
    for value in values[1:]:
        early = float(half.ahead(1.0))  # reordered: out as soon as the newest sample is used
        x, cov = mat_a @ x, fading * mat_a @ cov @ mat_a.T + 100 * VAR * np.eye(3)
        late = row_h @ x  # original: a sample later, before that one is used
        assert early == pytest.approx(late, rel=1e-12, abs=1e-12)
        gain = cov @ row_h / (row_h @ cov @ row_h + VAR)
        kept = np.eye(3) - np.outer(gain, row_h)
        x = x + gain * (value - late)
        cov = kept @ cov @ kept.T + VAR * np.outer(gain, gain)
        half.step(1.0, value, VAR)


def swell(times, size=1.0, period=9.0):
    """Return a sine, so slow that a parabola suits it for a second."""
    return size * np.sin(2 * pi / period * np.asarray(times))


def fed(axis, times, values, var=1e-6):
    """Measure one axis; return its outlook."""
    for time, value in zip(times, values, strict=True):
        axis.measure(float(time), float(value), var)
    return axis.outlook()


@pytest.mark.parametrize('rate', [2.0, 10.0, 50.0, 1000.0])
def test_faster_input_is_thinned_to_two_a_second(rate):
    times = np.arange(0.0, 30.0, 1 / rate)
    used = []
    axis = InterleavedAxis(LI2014[HEAVE])
    for time in times:
        axis.measure(float(time), float(swell(time)), 1e-6)
        if axis.outlook().time == time:
            used.append(time)
    assert np.diff(used)[1:] == pytest.approx(0.5, abs=1e-9 + 1 / rate)
    assert len(used) == pytest.approx(60, abs=2)


def test_uneven_two_hertz_is_used_whole():
    """What is passed over would show: the outlook is that of the newest sample."""
    rng = np.random.default_rng(4)
    times = 0.5 * np.arange(200) + rng.uniform(-0.05, 0.05, 200)
    axis = InterleavedAxis(LI2014[HEAVE])
    for time in times:
        assert fed(axis, [time], [swell(time)]).time == time
    error = axis.outlook().mean(times[-1] + 1.0) - swell(times[-1] + 1.0)
    assert abs(error) < 0.45  # (2 pi / 9)^3 and a little


def test_halves_do_not_know_each_other():
    """A jump in every other sample leaves the other half's forecasts alone."""
    times = 0.5 * np.arange(60)
    values = swell(times)
    shifted = values + 5.0 * (np.arange(60) % 2)
    plain, odd = InterleavedAxis(LI2014[HEAVE]), InterleavedAxis(LI2014[HEAVE])
    for k, time in enumerate(times):
        one, other = (fed(axis, [time], [series[k]]).mean(time + 1.0)
                      for axis, series in ((plain, values), (odd, shifted)))
        if k % 2:
            assert abs(other - one) > 1.0
        else:
            assert other == one


def test_units_do_not_matter():
    """Degrees and radians give the same forecasts and the same promises."""
    values = swell(np.arange(100)) + 0.01 * np.random.default_rng(5).normal(size=100)
    deg, rad = (AccelerationFilter(scale * values[0], VAR * scale**2, scale, scale)
                for scale in (1.0, radians(1.0)))
    for value in values[1:]:
        deg.step(1.0, value, VAR)
        rad.step(1.0, radians(value), VAR * radians(1.0)**2)
    assert rad.vec_x == pytest.approx(np.radians(deg.vec_x), rel=1e-9)
    assert rad.by_noise == pytest.approx(deg.by_noise * radians(1.0)**2, rel=1e-9)


@pytest.mark.parametrize('period', [0.1, 0.5, 1.0])
def test_jerk_is_learned_and_intervals_hold(period):
    """A calm ship and a lively one: 95 % intervals hold on both, 1 s ahead."""
    rng = np.random.default_rng(6)
    for size in (0.05, 4.0):
        omega = rng.normal(0.7, 0.06, 40)
        phase = rng.uniform(0, 2 * pi, 40)
        times = np.arange(0.0, 900.0, period)

        def motion(t):
            return size * sqrt(2 / 40) * np.cos(np.outer(t, omega) + phase).sum(axis=1)

        values, later = motion(times) + 0.005 * rng.normal(size=len(times)), motion(times + 1.0)
        axis, errors = InterleavedAxis(LI2014[HEAVE]), []
        for k, time in enumerate(times):
            mean, var, _, _ = fed(axis, [time], [values[k]], 0.005**2).table(time, np.ones(1))
            errors.append((mean[0] - later[k], sqrt(var[0])))
        error, sd = np.array(errors[len(times) // 10:]).T
        assert np.mean(np.abs(error) < 1.96 * sd) > 0.9
        assert 0.5 < sqrt(np.mean(error**2) / np.mean(sd**2)) < 1.1


def test_an_axis_that_never_came_is_at_rest_with_its_own_spread():
    predictor = InterleavedPredictor()
    predictor.measure(ROLL, 0.0, 0.1, 1e-6)
    outlook = predictor.outlook()
    ahead = outlook.forecast(0.0, np.array([0.0, 3.0]))
    assert outlook.mean(3.0)[1:] == (0.0, 0.0)
    assert np.sqrt(ahead.cov[:, HEAVE, HEAVE]) == pytest.approx(LI2014[HEAVE].sd)
    assert ahead.mean[:, ROLL] == pytest.approx(0.1)
    assert ahead.cov[0, ROLL, ROLL] == pytest.approx(1e-6)


def test_mean_and_forecast_agree_and_are_frozen():
    rng = np.random.default_rng(7)
    predictor = InterleavedPredictor()
    horizons = np.array([0.0, 0.5, 3.0, 10.0])

    def measure(time):
        for axis in (HEAVE, PITCH, ROLL):
            predictor.measure(axis, time, rng.normal(), 1e-4)

    for time in np.arange(0.0, 20.0, 0.5):
        measure(float(time))
    outlook = predictor.outlook()
    before = outlook.forecast(19.7, horizons)
    for time in np.arange(20.0, 30.0, 0.5):
        measure(float(time))
    after = outlook.forecast(19.7, horizons)
    for name in ('mean', 'cov', 'rate', 'rate_cov'):
        assert np.array_equal(getattr(before, name), getattr(after, name))
    for k, horizon in enumerate(horizons):
        assert before.mean[k] == pytest.approx(outlook.mean(19.7 + horizon))
    slope = (np.array(outlook.mean(22.701)) - outlook.mean(22.699)) / 0.002
    assert before.rate[2] == pytest.approx(slope, rel=1e-6)
    for cov in (*before.cov, *before.rate_cov):
        assert cov == pytest.approx(cov.T, rel=1e-12) and np.linalg.eigvalsh(cov)[0] > 0


def test_errors_that_go_together_are_found():
    """Pitch and heave of one wave: their errors, and so their forecasts' covariance, agree."""
    rng = np.random.default_rng(8)
    predictor = InterleavedPredictor()
    times = 0.5 * np.arange(800)
    common, other = (np.cumsum(np.cumsum(rng.normal(size=800))) for _ in range(2))
    for k, time in enumerate(times.tolist()):
        predictor.measure(ROLL, time, 1e-3 * other[k], 1e-8)
        predictor.measure(PITCH, time, -1e-3 * common[k], 1e-8)
        predictor.measure(HEAVE, time, 0.1 * common[k], 1e-4)
    cov = predictor.outlook().forecast(float(times[-1]), np.ones(1)).cov[0]
    sd = np.sqrt(np.diag(cov))
    assert cov[PITCH, HEAVE] / sd[PITCH] / sd[HEAVE] < -0.85
    assert abs(cov[ROLL, HEAVE]) < 0.3 * sd[ROLL] * sd[HEAVE]


def test_a_gap_is_survived_and_a_stuck_sensor_believed():
    axis = InterleavedAxis(LI2014[HEAVE])
    times = np.concatenate([np.arange(0.0, 60.0, 0.1), np.arange(180.0, 240.0, 0.1)])
    for time in times:
        outlook = fed(axis, [time], [swell(time)])
        assert np.isfinite(outlook.table(time, np.array([0.0, 3.0, 10.0]))).all()
        if time == 180.0:  # one sample after the gap: no rate, and it says so
            assert outlook.mean(181.0) == swell(180.0)
            assert sqrt(outlook.table(time, np.ones(1))[1, 0]) > 0.5
    stuck = np.arange(240.0, 1200.0, 0.5)
    table = fed(axis, stuck, np.full(len(stuck), 0.7)).table(1199.5, np.array([1.0, 10.0]))
    assert table[0] == pytest.approx(0.7, abs=1e-6)
    assert (table[1] > 0).all() and sqrt(table[1, 0]) < 0.1


def test_a_calm_that_ends_is_noticed_within_seconds():
    axis, sd = InterleavedAxis(LI2014[ROLL]), 0.0005
    rng = np.random.default_rng(10)

    def motion(time):
        return 0.05 * swell(time) if time > 300.0 else 0.0

    errors = []
    for time in (0.5 * np.arange(800)).tolist():
        outlook = fed(axis, [time], [motion(time) + sd * rng.normal()], sd**2)
        (mean,), (var,), _, _ = outlook.table(time, np.ones(1))
        errors.append((mean - motion(time + 1.0)) / sqrt(var))
    assert 0.9 < np.mean(np.abs(errors[200:598]) < 1.96) < 0.99
    assert sqrt(np.mean(np.square(errors[600:620]))) > 4.0  # nobody could know
    assert sqrt(np.mean(np.square(errors[620:700]))) < 2.5
    assert sqrt(np.mean(np.square(errors[700:]))) < 1.6


def test_one_outlier_does_not_widen_the_intervals_for_good():
    usual, hit = InterleavedAxis(LI2014[HEAVE]), InterleavedAxis(LI2014[HEAVE])
    times = 0.5 * np.arange(240)
    values = swell(times) + 0.01 * np.random.default_rng(9).normal(size=240)
    struck = values.copy()
    struck[200] += 50.0
    for series, axis in ((values, usual), (struck, hit)):
        fed(axis, times, series, 1e-4)
    assert hit.jerk_psd < 10 * usual.jerk_psd  # not 200 times, as its square would have it
    assert hit.outlook().mean(120.5) == pytest.approx(usual.outlook().mean(120.5), abs=0.1)

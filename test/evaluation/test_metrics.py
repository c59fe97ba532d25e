"""Metrics on cases that can be solved by hand or in closed form."""

from math import pi, radians, sin, sqrt

import numpy as np
import pytest

from deck_motion_ros.evaluation import metrics
from deck_motion_ros.evaluation.metrics import compared, Comparison, Series

SECOND = 1_000_000_000


def series(times, values):
    return Series.of([round(t * SECOND) for t in times], values)


def stamps(*times):
    return np.array([round(t * SECOND) for t in times], np.int64)


def test_series_keeps_what_is_finite_and_newer():
    kept = series([0, 1, 1, 0.5, 2, 3, 10, 4], [1, 2, 9, 9, np.nan, 4, np.inf, 5])
    assert (kept.stamps / SECOND).tolist() == [0, 1, 3, 4]
    assert kept.values.tolist() == [1, 2, 4, 5]


def test_interpolation_keeps_samples_and_is_exact_for_a_cubic():
    when = np.arange(12.0)
    cubic = series(when, when**3 - 4 * when)
    asked = np.array([0.5, 7.25, 11.0, 3.0])
    assert cubic.at(stamps(*asked)) == pytest.approx(asked**3 - 4 * asked, abs=1e-9)


@pytest.mark.parametrize(('wave', 'share'), [(10, 0.0005), (8, 0.0012), (6, 0.0042)])
def test_interpolation_error_at_1_hz_is_what_the_docstring_says(wave, share):
    when = np.arange(200.0)
    middle = when[50:150] + 0.5
    error = [series(when, np.cos(2 * pi * when / wave + phase)).at(stamps(*middle))
             - np.cos(2 * pi * middle / wave + phase) for phase in np.linspace(0, pi, 9)]
    assert 0.8 * share < sqrt(2) * metrics.rms(np.ravel(error)) < share


def test_nothing_is_made_up_outside_the_record_or_inside_a_gap():
    gappy = series([0, 1, 2, 3, 4, 7, 8, 9, 20], np.arange(9.0))
    asked = stamps(-0.1, 0, 3.5, 4, 4.5, 6.9, 7, 8.5, 9.01, 20, 20.1)
    assert np.isfinite(gappy.at(asked)).tolist() == [
        False, True, True, True, False, False, True, True, False, True, False]


def test_short_gaps_of_a_fast_sensor_are_bridged_and_long_ones_are_not():
    times = [k / 100 for k in range(1000) if not 300 <= k < 340 and not 600 <= k < 670]
    fast = series(times, np.sin(times))
    bridged, gap = fast.at(stamps(3.2, 6.3))
    assert bridged == pytest.approx(sin(3.2), abs=1e-4)
    assert np.isnan(gap)


@pytest.mark.parametrize('count', [0, 1, 2, 3])
def test_a_handful_of_samples_is_enough_or_says_so(count):
    few = series(range(count), [2.0] * count)
    inside = few.at(stamps(0, (count - 1) / 2))
    assert inside == pytest.approx([2.0, 2.0]) if count else np.isnan(inside).all()
    assert np.isnan(metrics.zero_crossing_period(few))
    assert not len(metrics.spectrum(few)[0])
    assert not len(metrics.crests(few))


def test_reference_heights_of_li2014():
    one = [series([0], [value]) for value in (radians(2), radians(-1), 0.5)]
    arm = (-67.97, 3.05, 19.5)
    assert metrics.touchdown_height(one, stamps(0, 1), arm)[0] == pytest.approx(
        -0.594660, abs=1e-6)
    assert np.isnan(metrics.touchdown_height(one, stamps(0, 1), arm)[1])
    heave_alone = (None, None, series([0], [0.7]))
    assert metrics.touchdown_height(heave_alone, stamps(0), arm) == pytest.approx([0.7])


def test_hand_solved_comparison():
    issued, valid = stamps(0, 1, 2, 3), stamps(2, 3, 4, 5)
    truth = series(range(5), [1.0, 2.0, 4.0, 0.0, -2.0])
    result = compared(2.0, issued, valid, np.array([5.0, 3.0, -2.0, 9.0]),
                      np.array([0.5, 3.0, 0.0, 1.0]), truth.at, truth.at)
    assert len(result) == 3  # nothing is known of t = 5
    assert result.error.tolist() == pytest.approx([1, 3, 0])
    assert result.rmse == pytest.approx(sqrt(10 / 3))
    assert result.bias == pytest.approx(4 / 3)
    assert result.persistence == pytest.approx(sqrt((9 + 4 + 36) / 3))
    assert result.zero == pytest.approx(sqrt((16 + 0 + 4) / 3))
    assert result.normalised.tolist() == pytest.approx([2, 1])  # sd 0 states nothing
    assert result.nis == pytest.approx(2.5)
    assert result.coverage(0.6827) == pytest.approx(0.5)
    late = result.issued_from(SECOND)
    assert (len(late), late.bias) == (2, pytest.approx(1.5))


def test_persistence_of_a_sine_in_closed_form():
    amplitude, period, horizon = 1.5, 8.0, 3.0
    times = np.arange(0, 400, 0.1)
    wave = series(times, amplitude * np.sin(2 * pi * times / period))
    issued = wave.stamps[:-200]
    valid = issued + round(horizon * SECOND)
    result = compared(horizon, issued, valid, wave.at(valid), np.full(len(issued), 0.1),
                      wave.at, wave.at)
    assert result.persistence == pytest.approx(
        sqrt(2) * amplitude * sin(pi * horizon / period), rel=1e-3)
    assert result.zero == pytest.approx(amplitude / sqrt(2), rel=1e-3)
    assert result.rmse == 0


def gaussian(stated, actual=0.4, count=40_000):
    rng = np.random.default_rng(5)
    came = rng.standard_normal(count)
    when = np.arange(count)
    return Comparison(3.0, when, when, came + actual * rng.standard_normal(count),
                      np.full(count, stated), came, came)


def test_honest_forecasts_are_called_honest():
    honest = gaussian(stated=0.4)
    assert honest.nis == pytest.approx(1, abs=0.02)
    for probability in (0.2, 0.5, 0.6827, 0.95):
        spread = sqrt(probability * (1 - probability) / len(honest))
        assert honest.coverage(probability) == pytest.approx(probability, abs=4 * spread)


def test_boasting_forecasts_are_found_out():
    boasting = gaussian(stated=0.2)
    assert boasting.nis == pytest.approx(4, abs=0.1)
    assert boasting.coverage(0.95) == pytest.approx(0.673, abs=0.01)  # P(|x| < 0.98)


@pytest.mark.parametrize('probability', [0, 1, 1.5, float('nan')])
def test_coverage_wants_a_probability(probability):
    with pytest.raises(ValueError, match='between 0 and 1'):
        gaussian(0.4, count=3).coverage(probability)


def test_no_forecast_at_all_gives_no_figure():
    nothing = gaussian(0.4, count=5).issued_from(99)
    assert len(nothing) == 0
    assert np.isnan([nothing.rmse, nothing.bias, nothing.nis, nothing.coverage(0.95),
                     nothing.persistence, nothing.zero]).all()


def test_statistics_of_a_sine():
    times = np.arange(0, 900, 0.25)
    wave = series(times, 0.5 + 2 * np.sin(2 * pi * times / 9.0 + 0.3))
    found = metrics.motion_statistics(wave)
    assert found.mean == pytest.approx(0.5, abs=1e-6)
    assert found.significant == pytest.approx(4 * sqrt(2), rel=1e-4)
    assert (found.low, found.high) == pytest.approx((-1.5, 2.5), abs=0.01)
    assert found.zero_crossing_period == pytest.approx(9.0, rel=1e-3)
    assert found.peak_period == pytest.approx(9.0, rel=0.03)


def test_sensor_noise_is_not_counted_as_waves():
    times = np.arange(0, 600, 0.01)
    noise = np.random.default_rng(1).normal(0, 0.03, len(times))
    wave = series(times, np.sin(2 * pi * times / 10) + noise)
    assert metrics.zero_crossing_period(wave) == pytest.approx(10, rel=0.01)


def test_waves_are_not_counted_across_a_gap():
    times = np.array([t for t in np.arange(0, 400, 0.5) if not 100.3 < t < 307.7])
    wave = series(times, np.sin(2 * pi * times / 8))
    assert metrics.zero_crossing_period(wave) == pytest.approx(8, rel=0.02)


def test_spectrum_has_the_area_of_the_variance_and_the_right_place():
    rng = np.random.default_rng(2)
    times = np.sort(np.arange(0, 1200, 0.5) + rng.uniform(-0.05, 0.05, 2400))
    wave = series(times, 1.2 * np.sin(2 * pi * times / 8) + 0.1 * rng.standard_normal(2400))
    frequency, density = metrics.spectrum(wave)
    assert np.sum(density) * frequency[1] == pytest.approx(1.2**2 / 2 + 0.01, rel=0.03)
    assert frequency[np.argmax(density)] == pytest.approx(1 / 8, abs=frequency[1])


def test_spectrum_uses_the_longest_run_without_a_gap():
    times = np.concatenate([np.arange(0, 100.0), np.arange(500, 900.0)])
    values = np.where(times < 200, 50 * np.sin(times), np.sin(2 * pi * times / 10))
    frequency, density = metrics.spectrum(series(times, values))
    assert np.sum(density) * frequency[1] == pytest.approx(0.5, rel=0.05)


def test_gaps_duplicates_and_steps_back_are_found():
    found = metrics.regularity(stamps(0, 0.1, 0.2, 0.2, 0.3, 0.1, 0.4, 1.4, 1.5, 1.6))
    assert found.rate == pytest.approx(10)
    assert found.gaps == ((round(0.4 * SECOND), 1.0),)
    assert (found.count, found.duplicates, found.backwards) == (10, 1, 1)


@pytest.mark.parametrize('count', [0, 1])
def test_no_rate_without_two_stamps(count):
    found = metrics.regularity(stamps(*range(count)))
    assert found.count == count
    assert np.isnan(found.rate)
    assert found.gaps == ()


def test_crests_of_a_noisy_sine():
    times = np.arange(0, 200, 0.5)
    noise = np.random.default_rng(3).normal(0, 0.02, len(times))
    found = metrics.crests(series(times + 50, np.cos(2 * pi * (times - 3.3) / 10) + noise))
    assert len(found) >= 18
    assert np.abs((found - 3.3 + 5) % 10 - 5).max() < 0.15


def test_crest_errors_are_announced_minus_came():
    ahead = np.arange(0.5, 10.1, 0.5)
    issued = np.arange(0, 100, 0.7)
    came = np.arange(2.0, 130, 8)
    late = np.cos(2 * pi * (issued[:, None] + ahead - 2.0 - 0.3) / 8)
    errors = metrics.crest_errors(issued, ahead, late, came)
    assert len(errors) > 20
    assert errors == pytest.approx(0.3, abs=0.02)
    assert not len(metrics.crest_errors(issued, ahead, 0 * late, came))
    assert not len(metrics.crest_errors(issued, ahead, late, came[:1]))

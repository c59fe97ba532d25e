"""Zhang2021: what its gain of a factor of three is made of, and where it ends."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from deck_motion_ros.estimators.interleaved import AccelerationFilter
from deck_motion_ros.evaluation.experiments import PAPERS
from deck_motion_ros.evaluation.interleaved import interleaved_forecasts, roll_records
from deck_motion_ros.scenarios import Zhang2021Scenario

AMPLITUDE, VAR = 0.62, 0.01  # deg, deg^2


@pytest.fixture(scope='module')
def figures():
    """Return all rows by name, with the scenario's own number of records."""
    return {row.name: row for row in PAPERS['Zhang2021'](None)}


@pytest.mark.parametrize('name, low, high, printed', [
    ('plain_late_rmse_1s', 0.39, 0.43, 0.3935), ('plain_rmse_1s', 0.20, 0.25, None),
    ('fading_rmse_1s', 0.115, 0.14, 0.1173)])
def test_figures(figures, name, low, high, printed):
    row = figures[name]
    assert low < row.value < high
    assert (row.unit, row.printed) == ('deg', printed)


def test_nothing_beats_the_floor(figures):
    floor = figures['fading_rmse_1s'].floor
    assert 0.0 < floor < 0.04
    for name, row in figures.items():
        assert row.floor in (None, floor)
        assert row.value > (floor if name.startswith('adaptive') else 3 * floor)


def test_adaptive_predictor_nears_the_floor(figures):
    assert figures['adaptive_rmse_1s'].value < 0.025
    assert figures['adaptive_after_60s_rmse_1s'].value < 0.02


def test_fading_pays_only_where_noise_is_small(figures):
    """With the 0.1 deg that R claims, its noise alone is 0.43 deg and the plain filter wins."""
    assert figures['fading_noisy_rmse_1s'].value > 0.43
    assert figures['fading_noisy_rmse_1s'].value > 1.2 * figures['plain_noisy_rmse_1s'].value
    assert figures['fading_rmse_1s'].value < 0.7 * figures['plain_rmse_1s'].value


def test_records_are_those_of_the_scenario():
    case = replace(Zhang2021Scenario(), runs=300)
    truth, noise = np.degrees(roll_records(case))
    assert sqrt(np.mean(truth**2)) == pytest.approx(AMPLITUDE / sqrt(2), rel=0.03)
    assert np.std(noise) == pytest.approx(np.degrees(1.0), rel=0.01)
    power = np.mean(np.abs(np.fft.rfft(truth * np.hanning(480)[:, None], axis=0))**2, axis=1)
    omega = 2 * pi * np.fft.rfftfreq(480, 0.5)
    mean = power @ omega / power.sum()
    assert 2 * pi / mean == pytest.approx(9.6, rel=0.01)
    assert sqrt(power @ (omega - mean)**2 / power.sum()) == pytest.approx(0.08 * mean, rel=0.1)


def test_a_record_does_not_depend_on_how_many_there_are():
    few, many = (roll_records(replace(Zhang2021Scenario(), runs=n)) for n in (2, 5))
    for ours, theirs in zip(few, many, strict=True):
        assert np.array_equal(ours, theirs[:, :2])
    assert PAPERS['Zhang2021'](2) == PAPERS['Zhang2021'](2)


def test_the_future_is_not_known():
    case = replace(Zhang2021Scenario(), runs=1)
    values, _ = roll_records(case)
    changed = values.copy()
    changed[301:] += 1.0
    ours, theirs = (interleaved_forecasts(case, item, 100.0) for item in (values, changed))
    assert np.array_equal(ours[:301], theirs[:301])
    assert not np.isclose(ours[301:], theirs[301:]).any()


def error_on_a_sine(fading, period, late=0.0):
    """RMS error 1 s ahead (and ``late`` seconds more) on a sine of the paper's amplitude."""
    omega = 2 * pi / period
    wave = AMPLITUDE * np.exp(1j * omega * np.arange(50))
    half = AccelerationFilter(np.array([wave[0].real, wave[0].imag]), VAR, 1.0, 1.0, fading=fading)
    for value in wave[1:]:
        half.step(1.0, np.array([value.real, value.imag]), VAR)
    came = wave[-1] * np.exp(1j * omega * (1.0 + late))
    return abs(complex(*half.ahead(1.0)) - came) / sqrt(2)


def test_the_printed_error_is_that_of_the_plain_filter_a_step_late():
    """On a sine of 9.7 s; there s = 100 on time gives the other printed figure, 0.1173 deg."""
    assert error_on_a_sine(1.0, 9.7, late=1.0) == pytest.approx(0.3935, rel=0.02)
    assert error_on_a_sine(1.0, 9.7) < 0.6 * 0.3935
    assert error_on_a_sine(100.0, 9.7) == pytest.approx(0.1173, rel=0.05)


def test_no_period_gives_both_printed_errors_on_time():
    """Where the plain filter errs by 0.3935 deg on time, s = 100 errs by far more than 0.1173."""
    plain = {period: error_on_a_sine(1.0, period) for period in np.arange(5.0, 16.0, 0.1)}
    assert max(plain.values()) > 0.3935 > min(plain.values())
    near = [period for period, error in plain.items() if 0.37 < error < 0.42]
    assert near and all(error_on_a_sine(100.0, period) > 1.8 * 0.1173 for period in near)

"""LiSkimming: what can be known, who knows it, and where the paper's claims end."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from deck_motion_ros.estimators.encounter import EncounterSea, wave_model
from deck_motion_ros.estimators.skimming_rivals import RIVALS
from deck_motion_ros.estimators.wave_filter import WaveFilter
from deck_motion_ros.evaluation.altitude import (
    adaptation_rows,
    closed_loop_rows,
    default_rows,
    disturbances,
    flight,
    guess_rows,
    long_rows,
    measured,
    observable_rank,
    optimal_error,
    sensor_errors,
    start_rows,
    starts,
    table_rows,
)
from deck_motion_ros.evaluation.altitude_floor import bound
from deck_motion_ros.evaluation.experiments import PAPERS
from deck_motion_ros.scenarios import LiSkimmingScenario

CASE = LiSkimmingScenario()
SHORT = replace(CASE, duration=15.0, times=(2.0, 9.0), low=(6.0, 9.0))
ERRORS = sensor_errors(CASE)
SEA = EncounterSea(7.5, 11.6, 60.0, pi)


def values(rows):
    return {row.name: row.value for row in rows}


def test_rank_and_null_vector():
    """Four of five: a higher aircraft with a lower altimeter bias looks the same."""
    rank, null = observable_rank(ERRORS)
    assert rank == 4
    assert null / null[0] == pytest.approx([1.0, 0.0, 0.0, 0.0, -1.0], abs=1e-9)


def test_published_sd_keeps_the_bias_where_the_start_is_unknown():
    rows = values(start_rows(CASE))
    assert rows['published_sd_start_unknown'] >= 0.9 * ERRORS.range_bias


@pytest.mark.parametrize('speed, heading, expected', [
    (60.0, pi, 0.277), (60.0, pi / 2, 0.677), (300.0, pi, 0.1347)])
def test_bound_of_the_three_cases(speed, heading, expected):
    """Fewer measurements, as much better each: nearly the same information."""
    fewer = replace(ERRORS, range_white=0.5 / sqrt(2), rate_white=0.2 / sqrt(2),
                    accel_white=0.05 / sqrt(2))
    made = bound(replace(SEA, speed=speed, heading=heading), fewer, (0.1, 0.1), 30.0, 50.0)
    assert made.rmse == pytest.approx(expected, rel=0.02)


def test_bound_without_waves_is_riccati():
    """No waves: the wave filter itself, waves of no height, is optimal then."""
    calm = replace(SEA, height=1e-4)
    made = bound(calm, ERRORS, (0.1, 0.1), 4.0, 100.0)
    riccati = WaveFilter(ERRORS, wave_model(calm))
    riccati.start(0.0, 0.1, 0.0, 0.1)
    sds = []
    for _ in range(400):
        riccati.step(0.01, 0.0, 0.0, 0.0)
        sds.append(sqrt(riccati.cov[0, 0]))
    assert made.sd == pytest.approx(sds[1::2], rel=0.01)


@pytest.mark.parametrize('use_rate', [True, False])
def test_nobody_beats_the_optimal_estimator(use_rate):
    made = bound(SEA, ERRORS, (0.1, 0.1), 10.0, 100.0, use_rate)
    riccati = WaveFilter(ERRORS, wave_model(SEA))
    riccati.start(0.0, 0.1, 0.0, 0.1)
    fitted = []
    for _ in range(1000):
        riccati.step(0.01, 0.0, 0.0, 0.0 if use_rate else None)
        fitted.append(riccati.cov[0, 0])
    assert made.rmse == pytest.approx(sqrt(np.mean(fitted)), rel=0.05)


def test_optimal_estimator_errs_by_its_bound():
    case = replace(CASE, duration=10.0)
    flown, start = flight(case, 10.0), starts(case, 150, 0.1)
    seen = measured(flown, disturbances(case, SEA, ERRORS, 150, 10.0, waves=100))
    made = bound(SEA, ERRORS, (0.1, 0.1), 10.0, case.rate)
    error = optimal_error(made, flown, seen, start, case.rate)
    assert np.mean(np.square(error / made.sd[:, None])) == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize('name', ['300_head', '60_beam', '60_head_rate_off',
                                  '60_head_short_crested'])
def test_default_is_near_the_optimal_estimator(name):
    rows = values(default_rows(SHORT, 4, name))
    assert rows[f'waves_ratio_{name}'] < 1.2
    assert 0.2 < rows[f'waves_nees_{name}'] < 2.5  # 4 runs: 40 are the experiment


def test_wrong_sea_state_is_found_out():
    rows = values(adaptation_rows(SHORT, 2))
    for name in ('7_under_4', '4_under_7'):
        assert rows[f'waves_ratio_{name}'] < 2.0
    assert rows['fixed_ratio_4_under_7'] > 2.0


def test_order_of_the_table_where_it_is_true_and_where_it_is_not():
    rows = values(table_rows(SHORT, 4))
    rivals = {name: {method: rows[f'{method}_{name}_rmse'] for method in RIVALS}
              for name in ('waves', 'altimeter', 'accel_bias')}
    assert min(rivals['waves'], key=rivals['waves'].get) == 'predictive'
    assert min(rivals['altimeter'], key=rivals['altimeter'].get) == 'predictive'
    assert max(rivals['accel_bias'], key=rivals['accel_bias'].get) == 'predictive'
    assert rows['eso_waves_rmse'] > 1.5  # the waves themselves: not robust
    assert rows['waves_all_rmse'] < 0.2 < 0.5 < min(
        rows['ekf_all_rmse'], rows['combined_all_rmse'])
    assert rows['combined_altimeter_rmse'] > 0.5  # the altimeter's bias is not removed


def test_closed_loop_needs_the_default():
    rows = values(closed_loop_rows(SHORT, 4))
    assert rows['waves_closed_loop_300'] < 0.15
    assert rows['ekf_closed_loop_300'] > 0.5
    assert rows['waves_closed_loop_60'] < 1.0 < rows['eso_closed_loop_60']


def test_default_does_not_grow_and_combined_does():
    rows = values(long_rows(replace(CASE, duration=12.0), 2))
    assert rows['waves_rmse_last_30s_of_300'] < 0.25
    assert rows['combined_rmse_last_30s_of_300'] > 20 * rows['combined_rmse_first_30s']


def test_ratio_to_the_ekf_depends_on_the_lost_table():
    rows = values(guess_rows(SHORT, 4))
    assert rows['combined_to_ekf_lowest_guess'] < 0.9 < 1.1 < rows['combined_to_ekf_highest_guess']


def test_it_is_among_the_papers():
    assert 'LiSkimming' in PAPERS

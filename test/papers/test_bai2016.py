"""Bai2016: the figures of the paper, explained, and the default filter against its bound."""

from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros.evaluation import alignment
from deck_motion_ros.evaluation.alignment import (
    cases,
    monte_carlo,
    OTHERS,
    Outcome,
    UNOBSERVABLE,
)
from deck_motion_ros.scenarios import Bai2016Scenario

SCENARIO = replace(Bai2016Scenario(), runs=100)
CASES = cases(SCENARIO)


@pytest.fixture(scope='module')
def outcome():
    """Return a function that runs a case once."""
    known = {}

    def run(name):
        if name not in known:
            known[name] = monte_carlo(CASES[name], SCENARIO.runs, SCENARIO.seed, SCENARIO)
        return known[name]
    return run


@pytest.mark.parametrize('size, printed', [('5', 1.83), ('10', 3.63), ('20', 7.25)])
def test_the_kalman_filter_errs_by_what_the_paper_prints(outcome, size, printed):
    assert outcome(f'paper_kalman_{size}').absolute[:, 1].mean() == pytest.approx(
        printed, rel=0.05)


@pytest.mark.parametrize('size, gain', [('5', 4.0), ('10', 8.0), ('20', 8.0)])
def test_fading_of_velocity_forgets_the_push(outcome, size, gain):
    tracking = outcome(f'paper_strong_tracking_{size}').rms[1]
    assert tracking < 0.5 and gain * tracking < outcome(f'paper_kalman_{size}').rms[1]


def test_fading_costs_nothing_without_vibration(outcome):
    assert outcome('paper_strong_tracking_0').rms[1] < 1.03 * outcome('paper_kalman_0').rms[1]


def test_the_single_factor_diverges(outcome):
    assert np.max(outcome('single_factor').rms) > 1000.0


def test_the_papers_disturbance_is_an_artefact_of_its_sampling(outcome):
    """Sampled in sine phase, or integrated, the same shaking does next to nothing."""
    cosine = outcome('paper_kalman_20').rms[1]
    assert outcome('aliasing_sine').rms[1] < 0.1 * cosine
    assert outcome('increments_kalman_20').rms[1] < 1.1 * outcome('increments_kalman_0').rms[1]


def test_without_a_window_the_filter_knows_what_it_cannot_know(outcome):
    found = outcome('window_0s_20')
    for index, expected in ((0, 14.5), (2, 7.25)):
        assert found.sd[index] == pytest.approx(expected, rel=0.02)
        assert found.rms[index] == pytest.approx(found.sd[index], rel=0.2)  # 100 runs
    _, vectors = np.linalg.eigh(found.cov)
    assert np.min(np.abs(vectors[..., 2] @ UNOBSERVABLE)) > np.cos(np.radians(2.0))


@pytest.mark.parametrize('name', ['default_0', 'default_20', 'default_skew_20', 'rolling_20',
                                  'dropout_20'])
def test_the_default_filter_is_near_its_bound_and_honest(outcome, name):
    found, bound = outcome(name), outcome('plain_0')
    assert np.all(found.rms < 1.2 * bound.rms)
    assert np.all(found.sd < (0.6, 0.25, 0.27))  # roll, pitch, heading
    # three angles, 100 runs: the sd of the mean of NEES / 3 is 0.08
    assert 0.7 < found.nees < 1.3


@pytest.mark.parametrize('name', ['0', '5', '20', 'skew_0', 'skew_20'])
def test_so_it_is_where_little_is_known_of_the_motion_across_the_track(outcome, name):
    found, bound = outcome(f'default_track_{name}'), outcome('plain_track_0')
    assert np.all(found.rms < 1.15 * bound.rms)
    assert np.all(found.rms < (0.82, 0.34, 0.51))
    assert np.all(found.sd < (0.82, 0.35, 0.51))
    assert 0.7 < found.nees < 1.3


def test_whoever_does_not_know_how_much_it_is_shaken_loses_a_line_not_a_plane(outcome):
    known, line, plane = (outcome(name).rms[1] for name in (
        'plain_track_0', 'lost_line_track', 'lost_plane_track'))
    assert line < 1.02 * known and 1.1 * known < plane
    assert outcome('default_track_20').rms[1] < plane


@pytest.mark.parametrize('name', OTHERS)
def test_it_is_honest_of_other_launches(name):
    assert_honest(CASES[f'other_{name}'], SCENARIO)


@pytest.mark.parametrize('frequency', [3.0, 100.0])
def test_it_is_honest_of_slow_shaking_and_of_the_papers(frequency):
    """At 100 Hz the samples see a push of one sign that only decays."""
    assert_honest(CASES['default_track_20'], replace(
        SCENARIO, lowest=frequency, highest=frequency))


def assert_honest(case, scenario):
    found = monte_carlo(case, scenario.runs, 5, scenario)
    assert np.all(found.rms < 1.3 * found.sd)
    assert 0.7 < found.nees < 1.3


def test_the_bound_is_that_of_the_covariance_analysis(outcome):
    """The undisturbed filter: bias of 112 ug over five times g^2, and velocity noise."""
    bound = outcome('plain_0')
    np.testing.assert_allclose(bound.sd, (0.50, 0.169, 0.233), rtol=0.02)
    assert bound.nees == pytest.approx(1.0, abs=0.25)


def test_every_figure_has_its_row(monkeypatch):
    rng = np.random.default_rng(1)
    monkeypatch.setattr(alignment, 'monte_carlo', lambda case, runs, *_: Outcome(
        rng.normal(size=(runs, 3)), np.tile(np.eye(3), (runs, 1, 1))))
    rows = {row.name: row for row in alignment.bai2016(50)}
    for size in ('0', '5', '10', '20'):
        for name in ('paper_kalman_pitch', 'paper_strong_tracking_pitch', 'default_pitch',
                     'default_roll', 'default_heading'):
            assert np.isfinite(rows[f'{name}_{size}'].value)
    assert all(row.paper == 'Bai2016' and np.isfinite(row.value) for row in rows.values())
    assert rows['paper_kalman_pitch_20'].printed == 7.25
    assert rows['default_nees_0'].value == pytest.approx(1.0, abs=0.4)

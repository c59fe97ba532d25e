"""Landing windows judged: hand-made decks and scores, and honest probabilities on known motion."""

from dataclasses import replace
from math import isnan, nan, pi

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from deck_motion_ros.estimators.window import Limits, quiet_probability, TIMES
from deck_motion_ros.evaluation.windows import (
    brier,
    Deck,
    pooled,
    scenario_scores,
    scored,
    since_nearest,
    WindowScores,
)
from deck_motion_ros.samples import LandingWindow, MotionForecast, TouchdownForecast
from deck_motion_ros.scenarios import PREDICTION_SCENARIOS

SECOND = 1_000_000_000
LIMITS = Limits(1.0, 2.0, 0.1, 0.05)
WIDE = Limits(1e3, 1e3, 1e3, 1e3)


def deck(height, start=0):
    rows = np.zeros((len(height), 4))
    rows[:, 0] = height
    return Deck(start, rows)


SINE = Deck(0, np.column_stack([np.sin(2 * pi * np.arange(601) / 80),
                                2 * pi / 8 * np.cos(2 * pi * np.arange(601) / 80),
                                np.zeros((601, 2))]))  # of 8 s


def window(stamp, state='go', probability=1.0, crest=(nan, nan), trough=(nan, nan)):
    return LandingWindow(stamp, state, 0.0, probability, *crest, *trough)


def test_stayed_counts_both_ends_of_the_window():
    high = np.zeros(201)
    high[100] = 1.5  # at 10 s
    stamps = np.array([4.8, 4.9, 5.0, 10.0, 10.1, 14.9, 15.0, 15.1, -0.1]) * SECOND
    found = deck(high).stayed(LIMITS, stamps.astype(np.int64), 5.0)
    assert found.tolist()[:7] == [1, 1, 0, 0, 1, 1, 1]
    assert np.isnan(found[7:]).all()  # not all of the window is known


@pytest.mark.parametrize('column', range(4))
def test_every_quantity_has_its_limit(column):
    bound = (LIMITS.height, LIMITS.rate, LIMITS.roll, LIMITS.pitch)[column]
    for value, expected in ((0.99 * bound, 1), (-1.01 * bound, 0), (nan, nan)):
        motion = np.zeros((51, 4))
        motion[20, column] = value
        found, = Deck(0, motion).stayed(LIMITS, np.array([0]), 5.0)
        assert found == pytest.approx(expected, nan_ok=True)


def test_a_deck_sampled_from_functions_knows_its_rate():
    def height(stamps):
        return 2 * np.sin(0.7 * stamps / SECOND)

    start = 1_700_000_000 * SECOND
    sampled = Deck.of((start, start + 30 * SECOND), lambda stamps: height(stamps - start),
                      lambda stamps: 0.1 + 0.0 * stamps, lambda stamps: np.full(len(stamps), nan))
    times = 0.1 * np.arange(301)
    assert sampled.motion[:, 0] == pytest.approx(2 * np.sin(0.7 * times), abs=1e-6)
    assert sampled.motion[5:-5, 1] == pytest.approx(1.4 * np.cos(0.7 * times[5:-5]), abs=0.03)
    assert np.isnan(sampled.motion[:5, 1]).all() and np.isnan(sampled.motion[:, 3]).all()


def test_crests_and_troughs_of_a_sine():
    assert SINE.crests(1) == pytest.approx(np.arange(2.0, 60.0, 8.0), abs=0.01)
    assert SINE.crests(-1) == pytest.approx(np.arange(6.0, 60.0, 8.0), abs=0.01)


def test_a_gap_and_ripples_are_no_crests():
    motion = SINE.motion.copy()
    motion[80:140] = nan  # holds one crest and one trough
    motion[:, 1] += 0.03 * np.where(np.arange(601) % 2, 1, -1)
    found = Deck(0, motion).crests(1)
    assert found == pytest.approx([2.0, *np.arange(18.0, 60.0, 8.0)], abs=0.2)


def test_since_nearest():
    assert since_nearest(np.array([0.9, 1.2, 6.1, 8.0]), np.array([1.0, 5.0, 7.0])) == (
        pytest.approx([-0.1, 0.2, -0.9, 1.0]))


def test_crest_times_are_set_beside_those_that_came():
    stamps = [16 * SECOND, 24 * SECOND, 59 * SECOND]
    said = [window(stamp, crest=(2.1, 0.2), trough=(5.7, 0.3)) for stamp in stamps]
    found = scored('', said, SINE, WIDE, 5.0).crests
    # what is announced beyond the last crest that came is not judged
    assert found[:, 1] == pytest.approx([0.1, 0.1, -0.3, -0.3], abs=0.01)
    assert found[:, 2].tolist() == [0.2, 0.2, 0.3, 0.3]
    scores = scored('', said, SINE, WIDE, 5.0)
    assert len(scores.timings(2.0, 4.0)) == 2 and len(scores.timings(0.0, 10.0)) == 4


def test_scores_by_hand():
    high = np.zeros(401)
    high[200:251] = 2.0  # 20 to 25 s
    said = [window(0, 'go', 0.9), window(10 * SECOND, 'go', 0.8), window(16 * SECOND, 'go', 0.6),
            window(22 * SECOND, 'no_go', 0.1), window(39 * SECOND, 'go', 0.0)]
    scores = scored('case', said, deck(high), LIMITS, 5.0)
    assert scores.quiet.tolist() == [1, 1, 0, 0]  # the last one is not known
    assert scores.share == 0.5
    assert scores.brier == pytest.approx((0.01 + 0.04 + 0.36 + 0.01) / 4)
    assert scores.skill == pytest.approx(1 - scores.brier / 0.25)
    assert scores.go_right == pytest.approx(2 / 3)
    assert sum(number for _, _, number in scores.reliability()) == 4
    both = pooled([scores, scores])
    assert (both.brier, len(both.quiet)) == (pytest.approx(scores.brier), 8)


def test_nothing_to_score_is_no_number():
    empty = scored('', [], deck(np.zeros(30)), LIMITS, 5.0)
    assert isnan(empty.share) and isnan(empty.brier) and isnan(empty.skill)
    assert isnan(empty.go_right) and empty.reliability() == [] and len(empty.crests) == 0
    always = scored('', [window(0)], deck(np.zeros(100)), LIMITS, 5.0)
    assert always.brier == 0.0 and isnan(always.skill)


def test_reliability_of_honest_and_of_bold_probabilities():
    rng = np.random.default_rng(4)
    honest = rng.random(20_000)
    came = (rng.random(20_000) < honest).astype(float)
    scores = WindowScores('', np.zeros(0, np.int64), np.zeros(0, str), honest, came,
                          np.empty((0, 3)))
    for said, share, number in scores.reliability():
        assert abs(said - share) < 4 * np.sqrt(0.25 / number)
    assert scores.skill == pytest.approx(1 / 3, abs=0.02)  # 1 - (1 / 6) / (1 / 4)
    bold = replace(scores, probability=np.round(honest))
    assert bold.brier > scores.brier == pytest.approx(1 / 6, abs=0.005)


def test_probabilities_are_honest_where_the_forecast_is_exact():
    """
    Two damped oscillators in a row, in white noise: their exact forecast, and what really came.

    The errors of the forecast grow from nothing and are not of the kind that the probabilities
    are made of.
    """
    frequency, damping = 2 * pi / 7, 0.15
    drift = np.zeros((4, 4))  # of height, its rate, force, its rate
    for k in (0, 2):
        drift[k, k + 1] = 1.0
        drift[k + 1, k:k + 2] = -frequency**2, -2 * damping * frequency
    drift[1, 2] = 1.0
    noise = np.diag([0.0, 0.0, 0.0, 1.0])
    total = solve_continuous_lyapunov(drift, -noise)
    total, noise = total / total[0, 0], noise / total[0, 0]
    big = expm(TIMES[1] * np.block([[-drift, noise], [np.zeros((4, 4)), drift.T]]))
    transition = big[4:, 4:].T
    step_cov = transition @ big[:4, 4:]
    covs = [np.zeros((4, 4))]
    for _ in TIMES[1:]:
        covs.append(transition @ covs[-1] @ transition.T + step_cov)
    sd, rate_sd = np.sqrt(np.array(covs)[:, [0, 1], [0, 1]]).T
    rng = np.random.default_rng(6)
    runs = 3000
    start = np.linalg.cholesky(total) @ rng.standard_normal((4, runs))
    mean, came = [start], [start]
    root = np.linalg.cholesky(step_cov)
    for _ in TIMES[1:]:
        mean.append(transition @ mean[-1])
        came.append(transition @ came[-1] + root @ rng.standard_normal((4, runs)))
    means, paths = np.array(mean)[:, :2], np.array(came)[:, :2]
    limits = replace(WIDE, height=1.2, rate=1.2 * frequency)
    nothing = np.zeros((len(TIMES), 3))
    still = MotionForecast(TIMES, nothing, np.zeros((len(TIMES), 3, 3)), nothing,
                           np.zeros((len(TIMES), 3, 3)))
    for duration in (2.0, 5.0):
        said = np.array([quiet_probability(TouchdownForecast(
            0, TIMES, height, sd, rate, rate_sd, nothing, nothing, still), limits, duration)[0]
            for height, rate in means.transpose(2, 1, 0)])
        inside = TIMES <= duration
        quiet = ((np.abs(paths[inside, 0]) <= limits.height)
                 & (np.abs(paths[inside, 1]) <= limits.rate)).all(axis=0).astype(float)
        scores = WindowScores('', np.zeros(0, np.int64), np.zeros(0, str), said, quiet,
                              np.empty((0, 3)))
        assert said.mean() == pytest.approx(quiet.mean(), abs=0.02)
        assert brier(said, quiet) < 1.1 * np.mean(said * (1 - said))
        for stated, share, number in scores.reliability():
            assert abs(stated - share) < 0.04 + 3 * np.sqrt(stated * (1 - stated) / number)


def test_a_scenario_from_the_start():
    """Only what is after 5 minutes counts."""
    case = replace(PREDICTION_SCENARIOS[0], duration=400.0, waves=300)
    helicopter, drone = scenario_scores(case)
    assert helicopter.name == f'{case.name} helicopter'
    assert helicopter.issued_at[0] == 300 * SECOND
    assert np.diff(helicopter.issued_at).tolist() == [SECOND // 2] * (len(helicopter.quiet) - 1)
    assert helicopter.share > drone.share
    assert helicopter.skill > 0.5
    timings = helicopter.timings(2.0, 4.0)
    assert np.median(np.abs(timings[:, 1])) < 0.15

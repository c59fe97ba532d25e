"""Running score against hand-made cases."""

from math import isnan, sin, sqrt

import pytest

from deck_motion_ros.estimators.scoring import RunningScore


def fed(forecast, seconds=30, window=60.0, gap=()):
    """Feed a sine at 10 Hz with a forecast for 3 s ahead at each sample; return the score."""
    running = RunningScore(window)
    for k in range(10 * seconds):
        time = k / 10
        if not gap or not gap[0] <= time < gap[1]:
            running.came(time, sin(time))
            running.forecast(time, time + 3.0, *forecast(time))
    return running.score()


def test_nothing_came_true_yet():
    score = RunningScore().score()
    assert score.number == 0 and isnan(score.rmse) and isnan(score.coverage)


def test_perfect_forecast():
    score = fed(lambda time: (sin(time + 3.0), 0.1))
    assert score.number == 270
    assert score.rmse == pytest.approx(0.0, abs=1e-12)
    assert score.coverage == 1.0


def test_persistence_of_a_sine_is_the_closed_form():
    score = fed(lambda time: (sin(time), 0.01), seconds=200, window=62.8)
    assert score.persistence_rmse == pytest.approx(sqrt(2) * abs(sin(1.5)), rel=0.01)
    assert score.rmse == pytest.approx(score.persistence_rmse, rel=1e-12)


def test_coverage_counts_the_95_percent_interval():
    score = fed(lambda time: (sin(time + 3.0) + 1.0, 0.5 if int(time * 10) % 2 else 0.6))
    assert score.coverage == pytest.approx(0.5)


def test_only_the_window_counts():
    score = fed(lambda time: (sin(time + 3.0) + (5.0 if time < 100 else 0.0), 1.0), seconds=200)
    assert score.number == pytest.approx(600, abs=2)
    assert score.rmse == pytest.approx(0.0, abs=1e-12)


def test_what_falls_into_a_gap_is_not_scored():
    score = fed(lambda time: (sin(time + 3.0), 1.0), gap=(10.0, 15.0))
    assert score.rmse < 1e-9
    assert score.number < 230


def test_older_times_are_left_out():
    running = RunningScore()
    for time in (0.0, 1.0, 0.5, 2.0):
        running.came(time, 100.0 if time == 0.5 else 0.0)
    running.forecast(0.0, 1.5, 0.0, 1.0)
    running.came(2.5, 0.0)
    assert running.score().rmse == 0.0

"""Running score against hand-solvable cases."""

from math import isnan, nan, pi, sin, sqrt
import pickle

import numpy as np
import pytest

from deck_motion_ros.estimators.scoring import RunningScore, useful_horizon
from deck_motion_ros.samples import HEAVE, NANOSECONDS, PITCH, ROLL

HERE = (0.0, 0.0, 0.0)
START = 1_800_000_000 * NANOSECONDS
HORIZONS = (1.0, 3.0)


def at(time):
    return START + round(time * NANOSECONDS)


def swell(time):
    return np.sin(time)


def fed(forecast, seconds=60.0, rate=10.0, came=swell, noise_var=0.0, gap=(0.0, 0.0), **kwargs):
    """Feed heave and, at each sample that is due, ``forecast(time) = mean, var``."""
    running = RunningScore(HERE, HORIZONS, **kwargs)
    ahead = np.array(HORIZONS)
    for time in (np.arange(round(seconds * rate)) / rate).tolist():
        if not gap[0] < time < gap[1]:
            running.measure(HEAVE, at(time), float(came(time)), noise_var)
            if running.is_due(at(time)):
                mean, var = forecast(time + ahead)
                running.forecast(at(time), mean, var + 0 * ahead)
    return running


def test_nothing_came_true_yet():
    scores = RunningScore(HERE, HORIZONS).scores()
    assert [score.horizon for score in scores] == [1.0, 3.0]
    for score in scores:
        assert score.number == 0
        assert all(map(isnan, (
            score.rmse, score.persistence, score.zero, score.motion, score.noise,
            score.coverage_68, score.coverage_95, score.over(score.zero))))


def test_perfect_forecast():
    for score in fed(lambda valid: (swell(valid), 0.01)).scores():
        assert score.rmse == pytest.approx(0.0, abs=1e-9)
        assert score.coverage_68 == score.coverage_95 == 1.0


@pytest.mark.parametrize(('sd', 'in_68', 'in_95'), [(0.31, 1, 1), (0.2, 0, 1), (0.15, 0, 0)])
def test_constant_offset(sd, in_68, in_95):
    for score in fed(lambda valid: (swell(valid) - 0.3, sd**2)).scores():
        assert score.rmse == pytest.approx(0.3)
        assert (score.coverage_68, score.coverage_95) == (in_68, in_95)


def test_simple_answers_to_a_sine_are_the_closed_form():
    """Half a second is no part of its period, so that the instants fall all over it."""
    running = fed(lambda valid: (swell(valid) + 0.1, 1.0), seconds=100 * pi, window=80 * pi,
                  came=lambda time: swell(time))
    for score in running.scores():
        assert score.persistence == pytest.approx(sqrt(2) * sin(score.horizon / 2), rel=0.01)
        assert score.zero == pytest.approx(sqrt(0.5), rel=0.01)
        assert score.motion == pytest.approx(sqrt(0.5), rel=0.01)
        assert score.over(score.motion) == pytest.approx(0.1 / sqrt(0.5), rel=0.01)


def test_trim_is_no_motion():
    for score in fed(lambda valid: (swell(valid) + 5, 1.0), seconds=200,
                     came=lambda time: swell(time) + 5).scores():
        assert score.motion == pytest.approx(sqrt(0.5), rel=0.02)
        assert score.zero == pytest.approx(sqrt(25.5), rel=0.01)


@pytest.mark.parametrize('noise_sd', [0.0, 0.5])
def test_honest_intervals_hold_as_often_as_they_say(noise_sd):
    """Noise of what is compared with is no fault of the forecast: its stated variance is added."""
    rng = np.random.default_rng(3)
    running = fed(lambda valid: (swell(valid) + 0.4 * rng.standard_normal(2), 0.16),
                  seconds=1500, window=1490.0, noise_var=noise_sd**2,
                  came=lambda time: swell(time) + noise_sd * rng.standard_normal())
    for score in running.scores():
        assert score.number > 2900
        assert score.noise == pytest.approx(noise_sd)
        for share, level in ((score.coverage_68, 0.6827), (score.coverage_95, 0.95)):
            assert abs(share - level) < 4 * sqrt(level * (1 - level) / score.number)


def test_two_in_a_second_are_scored_and_only_the_window_counts():
    running = fed(lambda valid: (swell(valid) + np.where(valid < 40, 5.0, 0.0), 1.0),
                  seconds=60, rate=100, window=15.0)
    for score in running.scores():
        assert score.number == pytest.approx(30, abs=1)
        assert score.rmse == pytest.approx(0.0, abs=1e-9)


def test_what_falls_into_a_gap_is_not_scored():
    whole = fed(lambda valid: (swell(valid), 1.0), seconds=40).scores()
    holed = fed(lambda valid: (swell(valid), 1.0), seconds=40, gap=(10, 15)).scores()
    for score, other in zip(holed, whole, strict=True):
        # neither what was issued nor what came true in the gap
        assert other.number - score.number == pytest.approx(
            2 * (5 + min(score.horizon, 5)), abs=2)
        assert score.rmse == pytest.approx(0.0, abs=1e-9)


def test_noise_is_that_of_the_point():
    running = RunningScore((-40.0, 5.0, 9.0), (1.0,))
    for k in range(100):
        for axis, var in ((ROLL, 0.002**2), (PITCH, 0.001**2), (HEAVE, 0.03**2)):
            running.measure(axis, at(k / 10), 0.0, var)
        if running.is_due(at(k / 10)):
            running.forecast(at(k / 10), np.zeros(1), np.ones(1))
    assert running.scores()[0].noise == pytest.approx(sqrt(0.01**2 + 0.04**2 + 0.03**2))


def test_height_is_that_of_the_point():
    """10 m to port on a ship that only rolls; pitch that comes and is 0 changes nothing."""
    running = RunningScore((0.0, 10.0, 0.0), (1.0,))
    for k in range(200):
        running.measure(ROLL, at(k / 10), 0.1, 0.0)
        running.measure(PITCH, at(k / 10), 0.0, 0.0)
        if running.is_due(at(k / 10)):
            running.forecast(at(k / 10), np.array([1.0]), np.array([1.0]))
    score, = running.scores()
    assert score.rmse == pytest.approx(1 - 10 * sin(0.1))
    assert score.motion == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('shift', [0.3, 0.5])
def test_streams_of_1_hz_without_shared_stamps(shift):
    """A wave of 10 s is interpolated to half a per cent; a straight line would be 5 % off."""
    def wave(time):
        return np.sin(2 * pi * time / 10)

    running = RunningScore((0.0, 10.0, 0.0), (2.0, 2.7))
    for time in range(200):
        running.measure(ROLL, at(time), 0.02 * wave(time), 0.0)
        running.measure(HEAVE, at(time + shift), wave(time + shift), 0.0)
        valid = time + np.array([2.0, 2.7])
        running.forecast(at(time), 10 * np.sin(0.02 * wave(valid)) + wave(valid), np.ones(2))
    for score in running.scores():
        assert score.number > 190
        assert score.rmse < 0.006


def test_order_of_arrival_changes_nothing():
    """Heave late by up to 3 s and in bursts, or first within its stamp: the same bits."""
    times = (np.arange(600) / 10).tolist()

    def scored(events):
        running = RunningScore((0.0, 5.0, 0.0), HORIZONS)
        for _, kind, time in sorted(events):
            if kind == 'forecast':
                if running.is_due(at(time)):
                    running.forecast(at(time), np.sin(time + np.array(HORIZONS)), np.ones(2))
            else:
                running.measure(HEAVE if kind == 'heave' else ROLL, at(time),
                                sin(time) if kind == 'heave' else 0.01, 0.0)
        return running.scores()

    rest = [(time, kind, time) for time in times for kind in ('forecast', 'roll')]
    rest.append((-1.0, 'heave', -1.0))
    early = scored(rest + [(time - 0.01, 'heave', time) for time in times])
    late = scored(rest + [(3 * (time // 3) + 3, 'heave', time) for time in times])
    assert early == late
    assert all(score.number > 100 for score in early)


def test_an_axis_that_comes_to_life_starts_anew():
    running = RunningScore((0.0, 5.0, 0.0), (1.0,))
    for k in range(600):
        time = k / 10
        running.measure(ROLL, at(time), 0.0, 0.0)
        if time > 30:
            running.measure(HEAVE, at(time), 2.0, 0.0)
        if running.is_due(at(time)):
            running.forecast(at(time), np.array([2.0 if time > 30 else 7.0]), np.ones(1))
    score, = running.scores()
    assert score.rmse == 0.0
    assert score.number == pytest.approx(2 * 29, abs=1)


def test_a_dead_axis_ends_the_scoring_and_its_return_resumes_it():
    running = RunningScore((0.0, 5.0, 0.0), (1.0,), window=60.0)
    numbers = []
    for k in range(2000):
        time = k / 10
        running.measure(ROLL, at(time), 0.01, 0.0)
        if not 50 < time < 150:
            running.measure(HEAVE, at(time), sin(time), 0.0)
        if running.is_due(at(time)):
            running.forecast(at(time), np.array([sin(time + 1)]), np.ones(1))
        if k % 490 == 489:
            numbers.append(running.scores()[0].number)
    assert numbers[0] > 90 and numbers[1] < 40 and numbers[2] == 0 and numbers[3] > 80


def test_repeated_and_older_stamps_are_left_out():
    running = RunningScore(HERE, (0.5,))
    for time in (0.0, 1.0, 0.5, 1.0, 2.0, 3.0, 4.0):
        running.measure(HEAVE, at(time), 100.0 if time == 0.5 else 0.0, 0.0)
        if time == 0.0:
            running.forecast(at(time), np.zeros(1), np.ones(1))
    score, = running.scores()
    assert score.number == 1 and score.rmse == 0.0


def test_memory_is_bounded_at_1_khz():
    sizes = [len(pickle.dumps(fed(lambda valid: (valid, 1.0), seconds=seconds, rate=1000,
                                  window=10.0))) for seconds in (20, 40)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.02)


@pytest.mark.parametrize(('ratios', 'useful'), [
    ((0.125, 0.25, 0.375, 0.625), 4.0), ((0.1, 0.2, 0.3, 0.4), 5.0), ((0.6, 0.4, 0.3, 0.2), 0.0),
    ((0.1, 0.7, 0.3, 0.9), 1 + 2 / 3), ((0.1, 0.2, nan, nan), 2.0), ((nan,) * 4, nan)])
def test_useful_horizon(ratios, useful):
    found = useful_horizon((1.0, 2.0, 3.0, 5.0), ratios)
    assert found == pytest.approx(useful, nan_ok=True)

"""The landing window: crests, probabilities and states against what can be solved by hand."""

from dataclasses import astuple, replace
from math import erf, isnan, nan, pi, radians, sqrt

import numpy as np
import pytest

from deck_motion_ros.estimators.window import (
    BAND,
    chosen_limits,
    landing_window,
    Limits,
    Lookout,
    next_crest,
    PAIRS,
    possible_errors,
    PRESETS,
    quiet_probability,
    TIMES,
)
from deck_motion_ros.samples import MotionForecast, TouchdownForecast

WIDE = Limits(1e3, 1e3, 1e3, 1e3)
PERIOD = 8.0
OMEGA = 2 * pi / PERIOD


def forecast(height=0.0, rate=0.0, height_sd=0.0, rate_sd=0.0, angles=(0.0, 0.0),
             angle_sd=(0.0, 0.0), angle_rate_sd=(0.0, 0.0), times=TIMES):
    """Make a forecast; every argument is a number or one for each time."""
    n = len(times)
    even = np.zeros(n)
    cov, rate_cov = (np.zeros((n, 3, 3)) for _ in range(2))
    for axis in (0, 1):
        cov[:, axis, axis] = np.square(angle_sd[axis])
        rate_cov[:, axis, axis] = np.square(angle_rate_sd[axis])
    mean = np.column_stack([even + angles[0], even + angles[1], even + height])
    motion = MotionForecast(times, mean, cov, np.zeros((n, 3)), rate_cov)
    return TouchdownForecast(7, times, even + height, even + height_sd, even + rate,
                             even + rate_sd, np.zeros((n, 3)), np.zeros((n, 3)), motion)


def wave(amplitude=1.0, phase=0.0, **uncertainty):
    """Make a sine of PERIOD that passes zero upwards at ``phase`` seconds."""
    angle = OMEGA * (TIMES - phase)
    return forecast(amplitude * np.sin(angle), amplitude * OMEGA * np.cos(angle), **uncertainty)


def chance(limit, sd, mean=0.0):
    """Return the closed form of the probability that a Gaussian stays within a limit."""
    return 0.5 * (erf((limit - mean) / sd / sqrt(2)) + erf((limit + mean) / sd / sqrt(2)))


@pytest.mark.parametrize('phase', [0.0, 0.3, 1.77, 3.1])
def test_crest_and_trough_of_a_sine(phase):
    window = landing_window(wave(phase=phase), WIDE)
    assert window.next_crest_in == pytest.approx((phase + PERIOD / 4) % PERIOD, abs=1e-3)
    assert window.next_trough_in == pytest.approx((phase + 3 * PERIOD / 4) % PERIOD, abs=1e-3)
    assert window.next_crest_sd == window.next_trough_sd == 0.0


def test_sd_of_a_crest_is_what_a_small_wave_on_top_does():
    """A wave of another phase, drawn with the sd stated, moves the crest by the sd stated."""
    rng = np.random.default_rng(5)
    sd = 0.05
    moved = []
    for a, b in sd * rng.standard_normal((400, 2)):
        extra = a * np.cos(OMEGA * TIMES) + b * np.sin(OMEGA * TIMES)
        slope = OMEGA * (b * np.cos(OMEGA * TIMES) - a * np.sin(OMEGA * TIMES))
        both = wave()
        moved.append(next_crest(replace(both, height=both.height + extra,
                                        rate=both.rate + slope))[0])
    stated = next_crest(wave(height_sd=sd, rate_sd=sd * OMEGA))[1]
    assert np.std(moved) == pytest.approx(stated, rel=0.1)


def test_no_crest_in_what_only_rises():
    window = landing_window(forecast(0.1 * TIMES, 0.1), WIDE)
    assert all(map(isnan, astuple(window)[4:]))


@pytest.mark.parametrize('limit', [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize('quantity', ['height', 'roll', 'pitch'])
def test_frozen_error_is_one_gaussian(quantity, limit):
    """An error that never changes is inside for all of the window or for none of it."""
    said = {'height': forecast(0.3, height_sd=1.0),
            'roll': forecast(angles=(0.3, 0.0), angle_sd=(1.0, 0.0)),
            'pitch': forecast(angles=(0.0, 0.3), angle_sd=(0.0, 1.0))}[quantity]
    quiet = quiet_probability(said, replace(WIDE, **{quantity: limit}), 5.0)
    assert quiet == pytest.approx(np.full(21, chance(limit, 1.0, 0.3)), abs=0.06)


def test_independent_quantities_multiply():
    said = forecast(height_sd=1.0, angle_sd=(1.0, 1.0))
    one = quiet_probability(said, replace(WIDE, height=1.0), 5.0)[0]
    three = quiet_probability(said, Limits(1.0, 1e3, 1.0, 1.0), 5.0)[0]
    assert three == pytest.approx(chance(1.0, 1.0)**3, abs=0.06)
    assert three < one


def test_rate_of_a_random_wave_at_one_moment():
    """Height and its rate of a stationary wave are independent at any one moment."""
    said = forecast(height_sd=1.0, rate_sd=OMEGA)
    got = quiet_probability(said, Limits(0.8, OMEGA, 1e3, 1e3), 0.0)
    assert len(got) == len(TIMES)
    assert got.mean() == pytest.approx(chance(0.8, 1.0) * chance(1.0, 1.0), abs=0.02)


@pytest.mark.parametrize('duration', [2.0, 5.0, 10.0])
def test_window_over_a_random_wave_as_drawn_from_its_covariance(duration):
    phase = OMEGA * np.subtract.outer(TIMES, TIMES)
    cov = np.exp(-BAND * phase**2 / 2) * np.cos(np.sqrt(1 - BAND) * phase)
    root = np.linalg.cholesky(cov + 1e-9 * np.eye(len(TIMES)))
    paths = 0.5 + root @ np.random.default_rng(3).standard_normal((len(TIMES), 20_000))
    expected = (np.abs(paths[TIMES <= duration]) <= 1.5).all(axis=0).mean()
    said = forecast(0.5, height_sd=1.0, rate_sd=OMEGA)
    got = quiet_probability(said, replace(WIDE, height=1.5), duration)
    assert got.mean() == pytest.approx(expected, abs=0.04)


def test_errors_are_gaussian_of_the_stated_size_and_rate():
    sd = np.column_stack([0.1 + 0.05 * TIMES, np.full(41, 0.2), 0.3 + 0.1 * np.sin(TIMES / 3)])
    rate_sd = np.full((41, 3), 0.3)
    fine = np.linspace(0.0, 10.0, 2001)
    u, error_rate = possible_errors(fine, *(np.column_stack([
        np.interp(fine, TIMES, column) for column in table.T]) for table in (sd, rate_sd)))
    assert u.shape == (2001, 3, PAIRS)
    u, error_rate = np.concatenate([u, -u], axis=2), np.hstack([error_rate, -error_rate])
    assert u.mean(axis=2) == pytest.approx(np.zeros((2001, 3)), abs=1e-9)
    assert u.var(axis=2) == pytest.approx(np.ones((2001, 3)), abs=1e-9)
    assert np.mean(np.abs(u) < 1.96) == pytest.approx(0.95, abs=0.01)
    spread = (0.1 + 0.05 * fine)[:, None]
    assert error_rate.std(axis=1) == pytest.approx(np.full(2001, 0.3), rel=1e-3)
    # the rate is the rate: its integral is the error
    total = np.sum((error_rate[1:] + error_rate[:-1]) / 2, axis=0) * fine[1]
    assert total == pytest.approx((spread * u[:, 0])[-1] - (spread * u[:, 0])[0], abs=0.02)


def test_without_uncertainty_it_is_certain():
    said = wave(1.0, angles=(0.02, 0.03))
    inside = Limits(1.001, OMEGA + 1e-3, 0.021, 0.031)
    assert quiet_probability(said, inside, 5.0).tolist() == [1.0] * 21
    for name, bound in (('height', 0.99), ('rate', 0.75), ('roll', 0.019), ('pitch', 0.029)):
        assert 0.0 in quiet_probability(said, replace(inside, **{name: bound}), 5.0).tolist()


def test_probability_rises_with_every_limit_and_falls_with_the_duration():
    said = wave(1.0, height_sd=0.1 + 0.05 * TIMES, rate_sd=0.1 + 0.04 * TIMES,
                angle_sd=(0.05, 0.05), angle_rate_sd=(0.05, 0.05))
    base = Limits(1.2, 1.0, 0.1, 0.1)
    for name in ('height', 'rate', 'roll', 'pitch'):
        rows = [quiet_probability(said, replace(base, **{
            name: factor * getattr(base, name)}), 5.0) for factor in (0.5, 0.8, 1.0, 1.3, 3.0)]
        assert (np.diff(rows, axis=0) >= 0).all()
        assert rows[-1].sum() > rows[0].sum()
    shares = [quiet_probability(said, base, duration)[0] for duration in (0.5, 2.0, 5.0, 10.0)]
    assert shares == sorted(shares, reverse=True)


def test_the_longest_window_is_the_forecast():
    assert len(quiet_probability(forecast(), WIDE, 10.0)) == 1
    assert landing_window(forecast(), WIDE, 10.0).state == 'go'


def burst(start, end):
    """Make a deck that is only between two times too high."""
    return forecast(np.where((TIMES >= start) & (TIMES <= end), 5.0, 0.0))


@pytest.mark.parametrize(('said', 'state', 'seconds'), [
    (forecast(), 'go', 5.0),
    (burst(7.0, 8.0), 'go', 1.75),  # a window that begins then ends at 6.75
    (burst(5.0, 6.0), 'no_go', nan),
    (burst(0.0, 1.0), 'wait', 1.25),
    (burst(2.0, 3.0), 'wait', 3.25),
    (burst(4.75, 20.0), 'no_go', nan),
    (burst(5.25, 9.0), 'go', 0.0)])
def test_state_and_its_seconds(said, state, seconds):
    window = landing_window(said, replace(WIDE, height=1.0))
    assert window.state == state
    assert window.seconds == pytest.approx(seconds, nan_ok=True)
    assert window.probability == float(state == 'go')
    assert window.issued_at == 7


def test_confidence_decides_between_go_and_wait():
    said = forecast(height_sd=1.0)
    limits = replace(WIDE, height=1.0)  # 68 %
    assert landing_window(said, limits, confidence=0.6).state == 'go'
    assert landing_window(said, limits, confidence=0.8).state == 'wait'
    assert landing_window(said, replace(WIDE, height=0.3), confidence=0.6).state == 'no_go'


def test_the_same_forecast_gives_the_same_bits():
    said = wave(height_sd=0.3, rate_sd=0.3, angle_sd=(0.05, 0.05))
    assert landing_window(said, PRESETS['helicopter']) == landing_window(
        said, PRESETS['helicopter'])


def test_growing_beyond_the_stated_rate_and_wild_sds_stay_probabilities():
    """The sd may grow faster than the rate's sd allows; or one of both may be absurd."""
    for uncertainty in ({'height_sd': TIMES, 'rate_sd': 0.01}, {'rate_sd': 50.0},
                        {'height_sd': 1e6, 'rate_sd': 1e6}):
        quiet = quiet_probability(wave(**uncertainty), PRESETS['helicopter'], 5.0)
        assert ((quiet >= 0) & (quiet <= 1)).all()


class Said:
    """A prediction that is always the same."""

    def __init__(self, issued_at):
        self.issued_at = issued_at

    def forecast(self, horizons):
        return replace(forecast(times=horizons), issued_at=self.issued_at)


def test_lookout_judges_the_first_prediction_of_each_period():
    lookout = Lookout(WIDE, 5.0, 0.9, 2.0)
    stamps = [round(1e9 * time) for time in (7.1, 7.2, 7.4, 7.5, 7.9, 9.2, 3.3, 3.4, 3.5)]
    made = [lookout.update(Said(stamp)) for stamp in stamps]
    assert [item.issued_at for item in made if item] == [  # at 3.3 s the clock was set anew
        round(1e9 * time) for time in (7.1, 7.5, 9.2, 3.3, 3.5)]
    assert all(item.state == 'go' for item in made if item)


def test_chosen_limits():
    assert chosen_limits('helicopter') == PRESETS['helicopter']
    own = chosen_limits('drone', height=1.0, rate=2.0, roll=3.0, pitch=4.0)
    assert astuple(own) == (1.0, 2.0, 3.0, 4.0)
    assert PRESETS['helicopter'].roll == pytest.approx(2 * radians(2.5))

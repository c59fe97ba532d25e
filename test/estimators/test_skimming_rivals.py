"""The paper's filters: what each is, and what each cannot do."""

from math import exp

from filterpy.kalman import KalmanFilter
import numpy as np
import pytest

from deck_motion_ros.estimators.skimming_rivals import (
    BiasFilter,
    CombinedFilter,
    ExtendedStateObserver,
    model_error,
    PredictiveFilter,
    RIVALS,
)
from deck_motion_ros.estimators.wave_filter import SensorErrors

ERRORS, DT = SensorErrors(), 0.01


def started(kind, runs=()):
    made = kind(ERRORS, runs)
    made.start(45.0, 0.1, 0.0, 0.1)
    return made


@pytest.mark.parametrize('kind', RIVALS.values())
def test_perfect_sensors_are_followed(kind):
    made = started(kind)
    for k in range(1, 500):
        time = k * DT
        made.step(DT, -np.sin(time - DT / 2), 45.0 - time + np.sin(time), np.cos(time) - 1.0)
    assert made.height == pytest.approx(45.0 - time + np.sin(time), abs=0.02)
    assert made.rate == pytest.approx(np.cos(time) - 1.0, abs=0.02)


@pytest.mark.parametrize('kind', RIVALS.values())
def test_runs_are_as_one_and_gaps_are_predicted(kind):
    many, one, rng = started(kind, (2,)), started(kind), np.random.default_rng(1)
    for k in range(60):
        values = rng.normal(size=(3, 2)) + [[0.0], [45.0], [0.0]]
        there = k % 7 > 2
        many.step(DT, values[0], values[1] if there else None, values[2] if there else None)
        one.step(DT, values[0, 1], values[1, 1] if there else None,
                 values[2, 1] if there else None)
    assert many.height[1] == pytest.approx(float(one.height))
    assert many.cov == pytest.approx(one.cov)


def test_model_error_is_the_least_of_its_cost():
    tried = np.linspace(-20, 20, 400001)
    cost = tried**2 * 3.0 * DT**2 + (0.8 - tried * DT**2 / 2)**2
    assert model_error(DT, 0.8, 3.0) == pytest.approx(tried[np.argmin(cost)], abs=1e-4)


def test_predictive_filter_swings_about_a_constant_error_of_the_altimeter():
    """No damping: height'' = (bias - height) / (2 W), by hand."""
    made = started(PredictiveFilter)
    for _ in range(3000):
        made.step(DT, 0.0, 46.0, None)
    assert made.height - 45.0 == pytest.approx(1 - np.cos(30 / (2 * 530)**0.5), abs=0.01)


def test_predictive_filter_believes_the_accelerometer():
    made = started(PredictiveFilter)
    for _ in range(1000):
        made.step(DT, 0.05, 45.0, None)
    assert made.height - 45.0 == pytest.approx(0.05 * 10**2 / 2, rel=0.03)


def test_observer_has_its_three_poles():
    columns = []
    for k in range(3):
        made = ExtendedStateObserver(ERRORS)
        made.state[k] = 1.0
        made.step(DT, 0.0, 0.0, None)
        columns.append(made.state)
    poles = np.linalg.eigvals(np.stack(columns, axis=1))
    assert np.sort_complex(poles) == pytest.approx([exp(-2)] * 3, abs=1e-4)


def test_observer_follows_the_waves():
    """The paper says it withstands them: not with these poles."""
    made, missed = started(ExtendedStateObserver), []
    for k in range(1, 2000):
        wave = np.sin(1.5 * k * DT)
        made.step(DT, 0.0, 45.0 + wave, None)
        missed.append(made.height - 45.0 - wave)
    assert np.abs(missed[100:]).max() < 1e-3


def test_bias_filter_agrees_with_filterpy():
    made, peer = started(BiasFilter), KalmanFilter(3, 1)
    push = np.array([DT**2 / 2, DT, 0.0])
    peer.F = np.array([[1, DT, -DT**2 / 2], [0, 1, -DT], [0, 0, 1]])
    peer.Q = np.outer(push, push) * (0.05**2 + 2 * 0.05**2 / 5 / DT)
    peer.B, peer.x = push[:, None], made.state[:, None].copy()
    peer.P = np.diag([0.01, 0.01, 0.0025])
    rng = np.random.default_rng(2)
    for _ in range(200):
        acceleration, height, rate = rng.normal(size=3) + (0.0, 45.0, 0.0)
        made.step(DT, acceleration, height, rate)
        peer.predict(u=np.array([[acceleration]]))
        for k, value, var in ((0, height, 0.25 + 1.0), (1, rate, 0.04 + 0.04)):
            peer.update(value, np.array([[var]]), np.eye(3)[[k]])
    assert made.state == pytest.approx(peer.x[:, 0])
    assert made.full_cov == pytest.approx(peer.P)


def test_bias_filter_is_off_by_the_altimeters_bias():
    made = started(BiasFilter)
    for _ in range(20000):
        made.step(DT, 0.0, 46.0, 0.0)
    assert made.height == pytest.approx(46.0, abs=0.1)
    assert made.cov[0, 0]**0.5 < 0.2  # and does not know


def test_combined_filter_becomes_unstable():
    """Errors of a single step, by its own gains: the same impulse grows once time has passed."""
    pair = started(CombinedFilter, (2,))
    grown = []
    for k in range(12001):
        if k in (0, 9000):
            pair.state[0] = 45.0 + np.array([0.0, 1.0])
            pair.state[1:] = 0.0
        pair.step(DT, np.zeros(2), np.array([45.0, 45.0]), np.zeros(2))
        if k in (3000, 12000):
            grown.append(abs(pair.height[1] - pair.height[0]))
    assert grown[0] < 2.0 < 5.0 < grown[1]
    assert pair.full_cov[0, 0]**0.5 > 100.0  # differences know nothing of the height


def test_all_are_named():
    assert set(RIVALS) == {'combined', 'predictive', 'eso', 'ekf'}

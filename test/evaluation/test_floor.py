"""The floor against closed forms and limits."""

import numpy as np
import pytest

from deck_motion_ros.estimators.kalman import riccati_bound
from deck_motion_ros.evaluation.floor import estimated_floor, SensorModel, wiener_predictors
from deck_motion_ros.processes import LI2014_HEAVE, LI2014_PITCH, LI2014_ROLL
from deck_motion_ros.simulation.sea import Bretschneider, dense_waves, WaveSystem
from deck_motion_ros.simulation.ship import HULLS, motion_lines

MODELS = (LI2014_ROLL, LI2014_PITCH, LI2014_HEAVE)
SENSOR = SensorModel((0.05, 0.05, 0.05))


def shaped(lags):
    """Give the covariances of Li2014's three independent axes (degrees, metres)."""
    cov = np.zeros((len(lags), 3, 3))
    for axis, model in enumerate(MODELS):
        cov[:, axis, axis] = model.stationary[0] * model.autocorrelation(lags)
    return cov


@pytest.mark.parametrize('axis', range(3))
def test_equals_the_riccati_bound_on_li2014(axis):
    lever = np.eye(3)[axis]
    for predictor in wiener_predictors(shaped, SENSOR, lever, (1.0, 3.0), axes=(axis,),
                                       dt=0.2,
                                       memory=200.0):
        bound = riccati_bound(MODELS[axis], 0.2, 0.05**2, predictor.horizon)
        assert predictor.error_sd == pytest.approx(bound, rel=1e-3)
        assert predictor.sd == pytest.approx(MODELS[axis].sd)


def test_independent_axes_tell_nothing_of_each_other():
    alone, = wiener_predictors(shaped, SENSOR, (0, 0, 1), (3.0,), axes=(2,), dt=0.5, memory=30.0)
    joint, = wiener_predictors(shaped, SENSOR, (0, 0, 1), (3.0,), dt=0.5, memory=30.0)
    assert joint.error_sd == pytest.approx(alone.error_sd, rel=1e-9)
    assert np.abs(joint.weights[:, :2]).max() < 1e-9


def test_runs_along_a_record_and_errs_as_it_says():
    rng, dt = np.random.default_rng(11), 0.1
    phi = np.reshape(LI2014_HEAVE.transition(dt), (2, 2))
    q11, q12, q22 = LI2014_HEAVE.step_noise(LI2014_HEAVE.transition(dt))
    root = np.linalg.cholesky([[q11, q12], [q12, q22]])
    states = np.zeros((60000, 2))
    for k, noise in enumerate(rng.standard_normal((len(states) - 1, 2)) @ root.T):
        states[k + 1] = phi @ states[k] + noise
    record = np.zeros((len(states), 3))
    record[:, 2] = states[:, 0] + 0.05 * rng.standard_normal(len(states))
    predictor, = wiener_predictors(shaped, SENSOR, (0, 0, 1), (3.0,), axes=(2,), memory=40.0)
    ahead = predictor.predict(record)
    assert np.isnan(ahead[398]) and np.isfinite(ahead[399])
    error = ahead[1000:-30] - states[1030:, 0]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(predictor.error_sd, rel=0.05)


def lines(spreading):
    sea = dense_waves(WaveSystem(Bretschneider(3.25, 9.7), 2.4, spreading), 200, 24)
    return motion_lines(HULLS['destroyer'], sea, 0.0, 7.5).covariance


FINE = SensorModel((5e-4 / 5**0.5, 5e-4 / 5**0.5, 0.05 / 5**0.5))  # 10 Hz averaged to 2 Hz
BOW = (0.0, 55.0, 1.0)


def floor(spreading, **options):
    return wiener_predictors(lines(spreading), FINE, BOW, (3.0,), dt=0.5,
                             **{'memory': 80.0, **options})[0].ratio


def test_a_long_crested_sea_is_more_predictable():
    assert floor(0.0) < 0.5 * floor(2.0)


def test_converges_with_memory_from_above():
    ratios = [floor(2.0, memory=memory) for memory in (10.0, 20.0, 40.0, 80.0, 100.0)]
    assert all(a > b for a, b in zip(ratios, ratios[1:]))
    assert ratios[0] > 1.2 * ratios[-1] and ratios[-2] < 1.02 * ratios[-1]


def test_every_axis_helps():
    assert floor(2.0) < floor(2.0, axes=(1, 2)) < floor(2.0, axes=(1,))


def test_drift_that_is_known_costs_less_than_as_much_white_noise():
    drifting = SensorModel(FINE.white_sd, (0, 0, 0.1), (1, 1, 60.0))
    white = SensorModel((*FINE.white_sd[:2], np.hypot(FINE.white_sd[2], 0.1)))
    ratios = [wiener_predictors(lines(2.0), sensor, BOW, (3.0,), dt=0.5, memory=60.0)[0].ratio
              for sensor in (FINE, drifting, white)]
    assert ratios[0] < ratios[1] < ratios[2]


def test_estimate_from_a_record_finds_the_bound_of_a_known_var():
    rng = np.random.default_rng(12)
    y = np.zeros((4000, 2))
    for t in range(2, len(y)):
        y[t] = (1.6 * y[t - 1] - 0.9 * y[t - 2]) * (1, 0.5) + rng.standard_normal(2)
    # by hand: psi_0 = 1, psi_1 = 1.6, psi_2 = 1.6^2 - 0.9
    by_hand = np.sqrt(np.cumsum(np.square([1.0, 1.6, 1.6**2 - 0.9])))
    found = estimated_floor(y, 1.0, (1.0, 0.0), (1.0, 2.0, 3.0), order=4)
    np.testing.assert_allclose(found, by_hand, rtol=0.05)
    with pytest.raises(ValueError, match='too few'):
        estimated_floor(y[:20], 1.0, (1.0, 0.0), (1.0,), order=10)

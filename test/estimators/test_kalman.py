"""The Kalman filter steps against filterpy, scipy's Riccati solver and their own promises."""

from math import sqrt

from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

from deck_motion_ros.estimators.kalman import (
    filtered_runs,
    gain_sequence,
    predicted,
    riccati_bound,
    step,
)
from deck_motion_ros.processes import (
    LI2014_HEAVE,
    LI2014_PITCH,
    LI2014_ROLL,
    ShapingFilter,
    van_loan,
)

PRESETS = [LI2014_PITCH, LI2014_HEAVE, LI2014_ROLL]
PROCESS = st.builds(ShapingFilter, st.floats(0.05, 5.0), st.floats(0.02, 2.0),
                    st.floats(0.05, 5.0))


def discretised(process, dt):
    """Phi and Q by Van Loan."""
    return van_loan(process.mat_a, process.intensity * np.outer(process.vec_b, process.vec_b), dt)


def stationary(process):
    """Covariance of the process, shape (2, 2)."""
    p11, p12, p22 = process.stationary
    return np.array([[p11, p12], [p12, p22]])


def simulated(process, steps, rng):
    """Run the process through time steps (s); return its states, shape (len(steps), 2)."""
    state = rng.multivariate_normal([0.0, 0.0], stationary(process))
    exact = {dt: discretised(process, dt) for dt in set(steps)}
    roots = {dt: np.linalg.cholesky(mat_q) for dt, (_, mat_q) in exact.items()}
    states = []
    for dt in steps:
        state = exact[dt][0] @ state + roots[dt] @ rng.normal(size=2)
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize('process', PRESETS)
def test_every_step_is_filterpys(process):
    rng = np.random.default_rng(5)
    theirs = KalmanFilter(dim_x=2, dim_z=1)
    theirs.H, theirs.P = np.array([[1.0, 0.0]]), stationary(process)
    state = (0.0, 0.0, *process.stationary)
    for _ in range(200):
        dt, value, var = rng.uniform(0.01, 3.0), rng.normal(), rng.uniform(0.01, 2.0)
        theirs.F, theirs.Q = discretised(process, dt)
        theirs.predict()
        theirs.update(value, R=var)
        phi = process.transition(dt)
        state, innovation = step(state, phi, process.step_noise(phi), value, var)
        assert np.allclose(state, [*theirs.x.ravel(), *theirs.P[0], theirs.P[1, 1]], atol=1e-9)
        assert innovation == pytest.approx(float(theirs.y[0, 0] / sqrt(theirs.S[0, 0])), abs=1e-9)


@given(PROCESS, st.lists(st.tuples(st.floats(1e-6, 50.0), st.floats(-1e3, 1e3),
                                   st.floats(1e-9, 1e6)), min_size=1, max_size=40))
def test_covariance_stays_one_and_below_the_motions(process, measurements):
    state = (0.0, 0.0, *process.stationary)
    for dt, value, var in measurements:
        phi = process.transition(dt)
        state, _ = step(state, phi, process.step_noise(phi), value, var)
        _, _, p11, p12, p22 = state
        assert p11 > 0 and p22 > 0 and p11 * p22 - p12 * p12 > -1e-12 * p11 * p22
        assert p11 <= min(process.stationary[0], var) * (1 + 1e-9)


@settings(max_examples=50)
@given(PROCESS, st.floats(1e-3, 600.0))
def test_without_measurements_the_estimate_relaxes_to_rest(process, gap):
    state = (1.0, -0.5, 1e-6, 0.0, 1e-6)
    phi = process.transition(gap)
    ahead = predicted(state, phi, process.step_noise(phi))
    assert ahead[2] <= process.stationary[0] * (1 + 1e-9)
    if gap > 40 / process.damping and process.damping**2 < 4 * process.stiffness:
        assert abs(ahead[0]) < 1e-3
        assert ahead[2] == pytest.approx(process.stationary[0], rel=1e-3)


def test_measuring_the_stationary_state_needs_no_special_first_step():
    process = LI2014_HEAVE
    phi = process.transition(7.3)
    start = (0.0, 0.0, *process.stationary)
    assert predicted(start, phi, process.step_noise(phi)) == pytest.approx(start)


@pytest.mark.parametrize('process', PRESETS)
def test_innovations_are_white_and_of_variance_one(process):
    """NIS, on uneven steps: the filter promises exactly what it keeps."""
    rng = np.random.default_rng(11)
    steps = rng.choice([0.05, 0.11, 0.4, 1.3], 4000).tolist()
    truth, var = simulated(process, steps, rng), 0.05 * process.stationary[0]
    state, innovations = (0.0, 0.0, *process.stationary), []
    for dt, x in zip(steps, truth, strict=True):
        phi = process.transition(dt)
        state, innovation = step(state, phi, process.step_noise(phi),
                                 x[0] + sqrt(var) * rng.normal(), var)
        innovations.append(innovation)
    e = np.array(innovations)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], len(e))
    assert low < e @ e < high
    for lag in (1, 2, 5, 20):
        assert abs(e[lag:] @ e[:-lag] / len(e)) < 4 / sqrt(len(e))


def test_errors_of_both_states_are_as_promised():
    """NEES over independent runs, now and 3 s ahead."""
    process, dt, var, runs = LI2014_PITCH, 0.2, 0.05, 300
    rng = np.random.default_rng(3)
    phi, mat_q = discretised(process, dt)
    ours = process.step(dt)
    ahead, ahead_q = discretised(process, 3.0)
    now, later = 0.0, 0.0
    for _ in range(runs):
        x = rng.multivariate_normal([0.0, 0.0], stationary(process))
        state = (0.0, 0.0, *process.stationary)
        for _ in range(60):
            x = phi @ x + rng.multivariate_normal([0.0, 0.0], mat_q)
            state, _ = step(state, *ours, x[0] + sqrt(var) * rng.normal(), var)
        _, _, p11, p12, p22 = state
        error = x - state[:2]
        now += error @ np.linalg.solve([[p11, p12], [p12, p22]], error)
        x = ahead @ x + rng.multivariate_normal([0.0, 0.0], ahead_q)
        y1, _, q11, _, _ = predicted(state, *process.step(3.0))
        later += (x[0] - y1)**2 / q11
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 2 * runs)
    assert low < now < high
    low, high = chi2.ppf([1e-3, 1 - 1e-3], runs)
    assert low < later < high


@pytest.mark.parametrize('process', PRESETS)
@pytest.mark.parametrize('dt, horizon', [(0.1, 3.0), (1.0, 3.0), (0.02, 10.0)])
@pytest.mark.parametrize('noise', [0.1, 1e-6])
def test_bound_is_the_riccati_equations(process, dt, horizon, noise):
    var = noise**2 * process.stationary[0]
    phi, mat_q = discretised(process, dt)
    before = solve_discrete_are(phi.T, np.array([[1.0], [0.0]]), mat_q, np.array([[var]]))
    after = before - np.outer(before[:, 0], before[0]) / (before[0, 0] + var)
    ahead, ahead_q = discretised(process, horizon)
    expected = sqrt((ahead @ after @ ahead.T + ahead_q)[0, 0])
    assert riccati_bound(process, dt, var, horizon) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize('process', PRESETS)
def test_many_runs_at_once_are_the_single_filter_many_times(process):
    dt, var, horizon = 0.13, 0.1, 2.4
    values = np.random.default_rng(2).normal(size=(150, 7))
    ahead = filtered_runs(process, dt, gain_sequence(process, dt, var, len(values)), values,
                          horizon)
    ours, far = process.step(dt), process.step(horizon)
    for run in range(values.shape[1]):
        state = (0.0, 0.0, *process.stationary)
        for k, value in enumerate(values[:, run].tolist()):
            state, _ = step(state, *ours, value, var)
            assert ahead[k, run] == pytest.approx(predicted(state, *far)[0], abs=1e-11)


def test_gains_settle_at_the_riccati_equations():
    process, dt, var = LI2014_ROLL, 0.1, 0.0025
    phi, mat_q = discretised(process, dt)
    before = solve_discrete_are(phi.T, np.array([[1.0], [0.0]]), mat_q, np.array([[var]]))
    gains = gain_sequence(process, dt, var, 12_000)
    assert gains[0, 0] == pytest.approx(process.stationary[0] / (process.stationary[0] + var))
    assert np.allclose(gains[-1], before[:, 0] / (before[0, 0] + var), rtol=1e-6)

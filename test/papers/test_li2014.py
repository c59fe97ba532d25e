"""Li2014: its figures in a small Monte Carlo, its misprints each shown to be one."""

from math import hypot, radians, sqrt

import numpy as np
import pytest
from scipy.linalg import expm

from deck_motion_ros.estimators.kalman import filtered_runs, gain_sequence, riccati_bound
from deck_motion_ros.geometry import from_starboard_forward_up, turned_arm
from deck_motion_ros.processes import (
    LI2014_HEAVE,
    LI2014_PITCH,
    LI2014_ROLL,
    van_loan,
)

DT, HORIZON, RUNS, STEPS, SETTLED = 0.1, 3.0, 200, 600, 200
AHEAD = round(HORIZON / DT)
PAPER_VAR, MRU_VAR = 0.49, 0.05**2


def truth_of(process, rng):
    """Simulate stationary runs, shape (STEPS, RUNS)."""
    phi, mat_q = van_loan(process.mat_a,
                          process.intensity * np.outer(process.vec_b, process.vec_b), DT)
    p11, p12, p22 = process.stationary
    x = np.linalg.cholesky([[p11, p12], [p12, p22]]) @ rng.normal(size=(2, RUNS))
    root = np.linalg.cholesky(mat_q)
    values = np.empty((STEPS, RUNS))
    for k in range(STEPS):
        values[k] = x[0]
        x = phi @ x + root @ rng.normal(size=(2, RUNS))
    return values


def error_of(truth, ahead):
    """RMS of the 3 s forecast once the filter has settled."""
    return sqrt(np.mean((truth[SETTLED + AHEAD:] - ahead[SETTLED:-AHEAD])**2))


def forecasts(process, truth, var, rng):
    """Forecasts from noisy measurements of the truth."""
    return filtered_runs(process, DT, gain_sequence(process, DT, var, STEPS),
                         truth + sqrt(var) * rng.normal(size=truth.shape), HORIZON)


@pytest.fixture(scope='module')
def runs():
    """Truth of pitch, heave and roll (degrees, metres) and a generator for the noise."""
    rng = np.random.default_rng(2014)
    return {process: truth_of(process, rng)
            for process in (LI2014_PITCH, LI2014_HEAVE, LI2014_ROLL)}


FIGURES = [(LI2014_PITCH, PAPER_VAR, 0.405, 0.4064), (LI2014_PITCH, MRU_VAR, 0.345, 0.3440),
           (LI2014_HEAVE, MRU_VAR, 0.548, 0.5473), (LI2014_ROLL, MRU_VAR, 1.728, 1.7306)]


@pytest.mark.parametrize('process, var, figure, bound', FIGURES)
def test_figures(runs, process, var, figure, bound):
    """200 runs instead of 1000: their mean square is good to about 2 %."""
    truth = runs[process]
    error = error_of(truth, forecasts(process, truth, var, np.random.default_rng(1)))
    assert riccati_bound(process, DT, var, HORIZON) == pytest.approx(bound, rel=1e-3)
    assert error == pytest.approx(figure, rel=0.03)
    assert error == pytest.approx(bound, rel=0.03)


@pytest.mark.parametrize('process, sd, persistence', [
    (LI2014_PITCH, 0.711, 1.124), (LI2014_HEAVE, 1.063, 1.679), (LI2014_ROLL, 4.29, 6.10)])
def test_the_motion_itself(runs, process, sd, persistence):
    truth = runs[process]
    assert truth.std() == pytest.approx(sd, rel=0.05)
    noisy = truth + 0.05 * np.random.default_rng(3).normal(size=truth.shape)
    assert error_of(truth, noisy) == pytest.approx(persistence, rel=0.05)


@pytest.mark.parametrize('process, floor', [
    (LI2014_PITCH, 0.47), (LI2014_HEAVE, 0.51), (LI2014_ROLL, 0.40)])
def test_even_without_noise_no_truth_leaks(runs, process, floor):
    bound = riccati_bound(process, DT, 1e-10, HORIZON)
    assert bound == pytest.approx(floor * process.sd, rel=0.02)
    truth = runs[process]
    error = error_of(truth, forecasts(process, truth, 1e-10, np.random.default_rng(4)))
    assert error > 0.97 * bound


def test_touchdown_height(runs):
    rng = np.random.default_rng(5)
    arm = (-67.97, 3.05, 19.5)
    true, ahead = [], []
    for process in (LI2014_ROLL, LI2014_PITCH, LI2014_HEAVE):
        true.append(runs[process])
        ahead.append(forecasts(process, runs[process], MRU_VAR, rng))

    def height(axes):
        roll, bow_up, heave = np.radians(axes[0]), np.radians(axes[1]), axes[2]
        return turned_arm(roll, -bow_up, arm)[0][..., 2] + heave - arm[2]

    truth = height(true)
    assert truth.std() == pytest.approx(1.376, rel=0.04)
    error = error_of(truth, height(ahead))
    assert error == pytest.approx(0.695, rel=0.03)
    # the bound, to first order in the angles and independent axes: arm times each axis's
    by_pitch = radians(1) * arm[0] * riccati_bound(LI2014_PITCH, DT, MRU_VAR, HORIZON)
    by_roll = radians(1) * arm[1] * riccati_bound(LI2014_ROLL, DT, MRU_VAR, HORIZON)
    bound = hypot(by_pitch, by_roll, riccati_bound(LI2014_HEAVE, DT, MRU_VAR, HORIZON))
    assert bound == pytest.approx(0.689, rel=0.01)
    assert error == pytest.approx(bound, rel=0.03)


def test_eq_11_as_printed_is_not_the_exponential():
    """It has theta^2 = d - a^2/2, and neither solves x' = A x nor composes with itself."""
    a, d = LI2014_PITCH.damping, LI2014_PITCH.stiffness

    def phi(theta, dt):
        c, s = np.cos(theta * dt), np.sin(theta * dt) / theta
        return np.exp(-a / 2 * dt) * np.array([[c + a / 2 * s, s], [-d * s, c - a / 2 * s]])

    printed, right = sqrt(d - a * a / 2), sqrt(d - a * a / 4)
    exact = expm(LI2014_PITCH.mat_a * HORIZON)
    assert np.abs(phi(right, HORIZON) - exact).max() < 1e-14
    assert np.abs(phi(printed, HORIZON) - exact).max() == pytest.approx(6.9e-3, rel=0.02)
    twice = phi(printed, HORIZON / 2) @ phi(printed, HORIZON / 2)
    assert np.abs(phi(printed, HORIZON) - twice).max() > 1e-3
    assert np.abs(np.reshape(LI2014_PITCH.transition(HORIZON), (2, 2)) - exact).max() < 1e-14


@pytest.mark.parametrize('dt, stable', [(0.27, True), (0.28, False), (0.5, False)])
def test_the_transition_after_eq_5_is_eulers_and_blows_up(dt, stable):
    """Stable only for Ts < a/d = 0.278 s; the exponential always is."""
    a, d = LI2014_PITCH.damping, LI2014_PITCH.stiffness
    euler = np.eye(2) + np.array([[0.0, 1.0], [-d, -a]]) * dt
    assert (np.abs(np.linalg.eigvals(euler)).max() < 1) == stable
    exact = np.reshape(LI2014_PITCH.transition(dt), (2, 2))
    assert np.abs(np.linalg.eigvals(exact)).max() < 1


@pytest.mark.parametrize('dt, sd', [(0.01, 0.07), (0.1, 0.28)])
def test_the_noise_of_eq_5_as_printed_depends_on_the_step(dt, sd):
    """Gamma = [g Ts, -a g Ts] with Q = 0.64: the motion's size then depends on Ts."""
    p = LI2014_PITCH
    euler = np.eye(2) + p.mat_a * dt
    gamma = p.vec_b * dt
    cov = np.zeros((2, 2))
    for _ in range(round(200 / dt)):
        cov = euler @ cov @ euler.T + 0.64 * np.outer(gamma, gamma)
    assert sqrt(cov[0, 0]) == pytest.approx(sd, abs=0.01)
    phi, noise = p.transition(dt), p.step_noise(p.transition(dt))
    mat_phi = np.reshape(phi, (2, 2))
    cov = np.zeros((2, 2))
    for _ in range(round(200 / dt)):
        cov = mat_phi @ cov @ mat_phi.T + [[noise[0], noise[1]], [noise[1], noise[2]]]
    assert sqrt(cov[0, 0]) == pytest.approx(p.sd, rel=1e-6)


def test_eq_8_as_printed_ruins_the_forecast(runs):
    """x(k|k) = Phi x(k|k-1) + K (...) propagates twice."""
    process, truth = LI2014_PITCH, runs[LI2014_PITCH]
    values = truth + sqrt(PAPER_VAR) * np.random.default_rng(6).normal(size=truth.shape)
    gains = gain_sequence(process, DT, PAPER_VAR, STEPS)
    phi = np.reshape(process.transition(DT), (2, 2))
    ahead_row = np.reshape(process.transition(HORIZON), (2, 2))[0]
    x = np.zeros((2, RUNS))
    ahead = np.empty_like(values)
    for k in range(STEPS):
        x = phi @ x
        x = phi @ x + np.outer(gains[k], values[k] - x[0])
        ahead[k] = ahead_row @ x
    assert 0.59 < error_of(truth, ahead) < 0.68
    right = filtered_runs(process, DT, gains, values, HORIZON)
    assert error_of(truth, right) < 0.42


def test_the_second_state_is_not_the_rate():
    """x2 = rate - g w: differencing x1 over ever shorter steps does not converge to it."""
    p = LI2014_PITCH
    mean_rate_var = []
    for dt in (0.1, 0.01, 0.001):
        rho = float(p.autocorrelation(np.array(dt)))
        mean_rate_var.append(2 * p.sd**2 * (1 - rho) / dt**2)
    assert mean_rate_var[1] > 5 * mean_rate_var[0] and mean_rate_var[2] > 5 * mean_rate_var[1]
    assert mean_rate_var[2] > 100 * p.stationary[2]


@pytest.mark.parametrize('process, memory', [
    (LI2014_PITCH, 48.5), (LI2014_HEAVE, 66.3), (LI2014_ROLL, 125.0)])
def test_initial_values_do_matter(process, memory):
    """With a real sensor's noise the settled filter forgets them slowly: 48-130 s to 1/e."""
    gain = gain_sequence(process, DT, MRU_VAR, 20_000)[-1]
    correct = np.eye(2) - np.outer(gain, [1.0, 0.0])
    phi = np.reshape(process.transition(DT), (2, 2))
    slowest = np.abs(np.linalg.eigvals(correct @ phi)).max()
    assert -DT / np.log(slowest) == pytest.approx(memory, rel=0.02)


def test_axes_of_the_paper():
    """Starboard, forward, up: 3.05 m to port, 67.97 m aft."""
    assert from_starboard_forward_up((-3.05, -67.97, 19.5)) == (-67.97, 3.05, 19.5)
    assert from_starboard_forward_up((1.0, 0.0, 0.0)) == (0.0, -1.0, 0.0)
    assert from_starboard_forward_up((0.0, 1.0, 0.0)) == (1.0, 0.0, 0.0)

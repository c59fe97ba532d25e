"""Shaping filters against expm, the Lyapunov equation, quadrature and simulated records."""

from math import exp, inf, nan, sqrt

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov

from deck_motion_ros.processes import (
    LI2014_HEAVE,
    LI2014_PITCH,
    LI2014_ROLL,
    propagated,
    ShapingFilter,
    van_loan,
)

PRESETS = [LI2014_PITCH, LI2014_HEAVE, LI2014_ROLL]
FILTERS = [*PRESETS, ShapingFilter(1.0, 3.0, 0.5), ShapingFilter(2.0, 1.2, 0.36)]
PROCESS = st.builds(ShapingFilter, st.floats(0.01, 10.0), st.floats(0.01, 3.0),
                    st.floats(0.01, 10.0), st.floats(0.01, 10.0))
DT = st.floats(1e-4, 20.0)


def phi_of(process: ShapingFilter, dt: float) -> np.ndarray:
    """Return the transition as a matrix."""
    return np.reshape(process.transition(dt), (2, 2))


def full(symmetric: tuple[float, float, float]) -> np.ndarray:
    """Return a covariance 11, 12, 22 as a matrix."""
    c11, c12, c22 = symmetric
    return np.array([[c11, c12], [c12, c22]])


@given(PROCESS, DT)
def test_transition_is_the_matrix_exponential(process, dt):
    assert np.allclose(phi_of(process, dt), expm(process.mat_a * dt), atol=1e-10, rtol=1e-9)


@given(PROCESS, DT)
def test_two_steps_are_one_of_twice_the_length(process, dt):
    once = phi_of(process, dt)
    assert np.allclose(phi_of(process, 2 * dt), once @ once, atol=1e-10, rtol=1e-9)


@pytest.mark.parametrize('damping', [2.0, 2.0 - 1e-9, 2.0 + 1e-9])
def test_critical_damping_is_no_special_place(damping):
    process = ShapingFilter(1.0, damping, 1.0)
    assert np.allclose(phi_of(process, 1.7), exp(-1.7) * np.array([[2.7, 1.7], [-1.7, -0.7]]),
                       atol=1e-8)


def test_an_overdamped_filter_survives_a_long_gap():
    phi = phi_of(ShapingFilter(1.0, 5.0, 1.0), 600.0)
    slow_pole = (-5.0 + sqrt(21.0)) / 2
    assert np.isfinite(phi).all()
    assert phi[0, 0] == pytest.approx(exp(slow_pole * 600.0) * 1.0455447, rel=1e-6)


@pytest.mark.parametrize('process', FILTERS)
def test_stationary_covariance_solves_the_lyapunov_equation(process):
    noise = process.intensity * np.outer(process.vec_b, process.vec_b)
    expected = solve_continuous_lyapunov(process.mat_a, -noise)
    assert np.allclose(full(process.stationary), expected, rtol=1e-12)
    assert process.sd == pytest.approx(sqrt(expected[0, 0]))


@pytest.mark.parametrize('process, sd', [
    (LI2014_PITCH, 0.7155), (LI2014_HEAVE, 1.061), (LI2014_ROLL, 4.243)])
def test_sizes_of_the_papers_motions(process, sd):
    assert process.sd == pytest.approx(sd, abs=6e-4)


@given(PROCESS, st.floats(0.01, 5.0))
def test_step_noise_is_van_loans(process, dt):
    noise = process.intensity * np.outer(process.vec_b, process.vec_b)
    phi, mat_q = van_loan(process.mat_a, noise, dt)
    scale = np.abs(full(process.stationary)).max()
    assert np.allclose(phi, phi_of(process, dt), atol=1e-8, rtol=1e-8)
    assert np.allclose(full(process.step_noise(process.transition(dt))), mat_q,
                       atol=1e-9 * scale, rtol=1e-7)


def test_van_loan_on_a_case_solved_by_hand():
    """A double integrator: dt, and q dt^3/3, q dt^2/2, q dt."""
    phi, mat_q = van_loan(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, 3.0]), 2.0)
    assert np.allclose(phi, [[1.0, 2.0], [0.0, 1.0]])
    assert np.allclose(mat_q, [[8.0, 6.0], [6.0, 6.0]])


@given(PROCESS, st.floats(1e-3, 5.0), st.floats(1e-3, 5.0))
def test_noise_of_a_step_is_that_of_its_parts(process, first, second):
    later = process.transition(second)
    parts = np.array(propagated(process.step_noise(process.transition(first)), later)
                     ) + process.step_noise(later)
    whole = process.step_noise(process.transition(first + second))
    assert np.allclose(parts, whole, rtol=1e-7, atol=1e-10 * max(map(abs, process.stationary)))


@given(PROCESS, st.floats(1e-4, 100.0))
def test_a_remembered_step_is_the_computed_one(process, dt):
    first = process.step(dt)
    assert process.step(dt) == first == (
        process.transition(dt), process.step_noise(process.transition(dt)))


def test_uneven_input_does_not_fill_the_memory():
    process = ShapingFilter(1.0, 0.1, 0.3)
    for k in range(5000):
        process.step(0.1 + 1e-6 * k)
    assert len(process._steps) < 1000


@pytest.mark.parametrize('process', FILTERS)
def test_spectrum_holds_the_variance(process):
    peak = sqrt(process.stiffness)
    pieces = [quad(process.spectrum, low, high, limit=500, epsabs=1e-12)[0]
              for low, high in ((0, peak), (peak, 10 * peak), (10 * peak, inf))]
    assert sum(pieces) == pytest.approx(process.sd**2, rel=1e-6)


@pytest.mark.parametrize('process', FILTERS)
def test_spectrum_peaks_at_the_root_of_the_stiffness(process):
    omega = np.linspace(0.01, 6.0, 6000)
    highest = omega[np.argmax(process.spectrum(omega))]
    assert highest == pytest.approx(sqrt(process.stiffness), abs=2e-3)


@pytest.mark.parametrize('process', FILTERS)
def test_autocorrelation_is_the_cosine_transform_of_the_spectrum(process):
    """Wiener and Khinchin; the spectrum falls only as 1/omega^2, hence the weight."""
    for lag in (0.5, 2.0, 7.0):
        expected, _ = quad(process.spectrum, 0.0, inf, weight='cos', wvar=lag, limlst=200)
        assert float(process.autocorrelation(np.array(lag))) * process.sd**2 == pytest.approx(
            expected, abs=2e-4 * process.sd**2)


def test_autocorrelation_of_a_simulated_record():
    process, dt, steps = LI2014_PITCH, 0.5, 80_000
    noise = process.intensity * np.outer(process.vec_b, process.vec_b)
    phi, mat_q = van_loan(process.mat_a, noise, dt)
    rng = np.random.default_rng(20261122)
    drive = rng.multivariate_normal([0.0, 0.0], mat_q, steps)
    state = rng.multivariate_normal([0.0, 0.0], full(process.stationary))
    record = np.empty(steps)
    for k in range(steps):
        record[k] = state[0]
        state = phi @ state + drive[k]
    assert record.std() == pytest.approx(process.sd, rel=0.05)
    lags = np.array([1, 4, 10, 20])
    measured = [record[:-lag] @ record[lag:] / (record @ record) for lag in lags]
    assert np.allclose(measured, process.autocorrelation(dt * lags), atol=0.05)
    assert process.autocorrelation(-dt * lags) == pytest.approx(
        process.autocorrelation(dt * lags))


def test_a_motion_has_the_size_peak_and_width_asked_for():
    process = ShapingFilter.of_motion(1.7, 0.8, 0.1)
    assert process.sd == pytest.approx(1.7)
    omega = np.linspace(0.01, 3.0, 30_000)
    density = process.spectrum(omega)
    assert omega[np.argmax(density)] == pytest.approx(0.8, abs=1e-3)
    high = omega[density > density.max() / 2]
    assert high[-1] - high[0] == pytest.approx(2 * 0.1 * 0.8, rel=0.01)  # half-power width is a


@pytest.mark.parametrize('bad', [
    (1.0, 0.0, 1.0, 1.0), (1.0, -0.1, 1.0, 1.0), (1.0, 0.1, 0.0, 1.0), (1.0, 0.1, 1.0, 0.0),
    (1.0, nan, 1.0, 1.0), (1.0, 0.1, nan, 1.0)])
def test_no_stationary_motion_no_filter(bad):
    with pytest.raises(ValueError, match='positive'):
        ShapingFilter(*bad)

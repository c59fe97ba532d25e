"""The filter of height, biases and waves against filterpy, Monte Carlo and hand calculations."""

from dataclasses import replace
from math import pi, sqrt

from filterpy.kalman import KalmanFilter
import numpy as np
import pytest

from deck_motion_ros.estimators.encounter import EncounterSea, wave_model
from deck_motion_ros.estimators.wave_filter import (
    HEIGHT,
    RANGE_BIAS,
    RATE,
    SensorErrors,
    STATES,
    WaveFilter,
    WAVES,
)
from deck_motion_ros.processes import van_loan

ERRORS = SensorErrors()
WAVE_MODEL = wave_model(EncounterSea(7.5, 11.6, 60.0, pi))
DT = 0.01


def made(runs=(), errors=ERRORS):
    ours = WaveFilter(errors, WAVE_MODEL, runs)
    ours.start(45.0, 0.1, 0.0, 0.1)
    return ours


def test_agrees_with_filterpy():
    ours, peer = made(), KalmanFilter(STATES, 1)
    mat_a, mat_w = ours.model()
    mat_w[RATE, RATE] = ERRORS.accel_white**2 * DT
    peer.F, peer.Q = van_loan(mat_a, mat_w, DT)
    peer.B = np.zeros((STATES, 1))
    peer.B[[HEIGHT, RATE], 0] = DT**2 / 2, DT
    peer.x, peer.P = ours.state[:, None].copy(), ours.full_cov.copy()
    rng = np.random.default_rng(1)
    for _ in range(300):
        push, height, rate = rng.normal(size=3) * (1.0, 2.0, 0.5) + (0.0, 45.0, 0.0)
        ours.step(DT, push, height, rate)
        peer.predict(u=np.array([[push]]))
        for row, value, sd in zip(ours.rows(), (height, rate), (0.5, 0.2), strict=True):
            peer.update(value, np.array([[sd**2]]), row[None])
    assert ours.state == pytest.approx(peer.x[:, 0], rel=1e-4, abs=1e-5)
    assert ours.full_cov == pytest.approx(peer.P, rel=1e-3, abs=1e-8)


def test_riccati_agrees_with_monte_carlo():
    """On its own model the published covariance is that of the errors: NEES 10, whiteness."""
    runs, steps, rng = 300, 600, np.random.default_rng(2)
    ours = made((runs,))
    mat_a, mat_w = ours.model()
    mat_w[RATE, RATE] = ERRORS.accel_white**2 * DT
    mat_phi, mat_q = van_loan(mat_a, mat_w, DT)
    value, basis = np.linalg.eigh((mat_q + mat_q.T) / 2)
    root = basis * np.sqrt(np.maximum(value, 0))
    start, turn = np.linalg.eigh(ours.full_cov)
    truth = turn * np.sqrt(np.maximum(start, 0)) @ rng.normal(size=(STATES, runs))
    truth[HEIGHT] += 45.0
    rows, innovations = ours.rows(), []
    for _ in range(steps):
        truth = mat_phi @ truth + root @ rng.normal(size=(STATES, runs))
        ours.predict(DT, 0.0, ERRORS.accel_white**2 * DT)
        seen = rows @ truth + np.array([[0.5], [0.2]]) * rng.normal(size=(2, runs))
        innovations.append(ours.use_range(seen[0], 0.25))
        ours.use_rate(seen[1], 0.04)
    error = ours.state - truth
    nees = np.einsum('ir,ij,jr->r', error, np.linalg.inv(ours.full_cov), error)
    assert nees.mean() == pytest.approx(STATES, rel=0.1)
    assert np.mean(error[HEIGHT]**2) == pytest.approx(ours.full_cov[HEIGHT, HEIGHT], rel=0.25)
    white = np.array(innovations)
    assert np.mean(white**2) == pytest.approx(1, abs=0.02)
    assert np.mean(white[1:] * white[:-1]) == pytest.approx(0, abs=0.01)


def test_runs_are_as_one_aircraft():
    rng = np.random.default_rng(3)
    many, values = made((3,)), rng.normal(size=(100, 3, 3)) + [[0.0], [45.0], [0.0]]
    single = [made() for _ in range(3)]
    for push, height, rate in values:
        many.step(DT, push, height, rate)
        for k, one in enumerate(single):
            one.step(DT, push[k], height[k], rate[k])
    assert many.height == pytest.approx([float(one.height) for one in single], abs=1e-9)
    assert many.full_cov == pytest.approx(single[0].full_cov)


def test_height_minus_bias_is_never_learnt():
    """The null vector of the observability matrix: no measurement moves its variance down."""
    ours = made()
    ours.start(0.0, 1e4, 0.0, 5.0)
    for _ in range(6000):
        ours.step(DT, 0.0, 0.0, 0.0)
    cov = ours.full_cov
    assert sqrt(cov[HEIGHT, HEIGHT]) >= 0.9 * ERRORS.range_bias
    assert sqrt(cov[RANGE_BIAS, RANGE_BIAS]) == pytest.approx(ERRORS.range_bias, rel=0.01)
    total = cov[HEIGHT, HEIGHT] + 2 * cov[HEIGHT, RANGE_BIAS] + cov[RANGE_BIAS, RANGE_BIAS]
    assert sqrt(total) < 0.2


def test_steps_of_any_length_are_exact():
    one, many = made(), made()
    one.predict(3.05, 0.7, 1e-4)
    for _ in range(61):
        many.predict(0.05, 0.7, 1e-4)
    assert one.state == pytest.approx(many.state, abs=1e-9)
    # noise on the rate alone in each piece leaves out its dt^3 / 3 on the height
    assert one.full_cov == pytest.approx(many.full_cov, rel=1e-3, abs=1e-5)


def test_an_old_range_counts_as_of_then():
    """Ballistic flight, waves and biases off: what was measured 0.2 s ago fits exactly."""
    quiet = WaveFilter(replace(ERRORS, range_bias=1e-6, rate_bias=1e-6, accel_bias=1e-9,
                               accel_drift=1e-9),
                       wave_model(EncounterSea(1e-3, 11.6, 60.0, pi)))
    quiet.start(100.0, 2.0, 3.0, 1.0)
    quiet.predict(0.2, -4.0, 0.0)
    assert quiet.height == pytest.approx(100 + 3 * 0.2 - 4 * 0.2**2 / 2)
    fits = quiet.use_range(100.0, 0.01, age=0.2)
    assert fits == pytest.approx(0, abs=1e-6)
    assert quiet.cov[0, 0] == pytest.approx(0.01 + 0.2**2, rel=0.01)  # of then, and 0.2 s of rate
    assert quiet.use_rate(3.0, 0.01, age=0.2) == pytest.approx(0, abs=1e-6)


def test_what_does_not_pass_the_gate_changes_nothing():
    ours = made()
    before = ours.state.copy(), ours.full_cov.copy()
    assert ours.use_range(90.0, 0.25, gate=5.0) > 5
    assert np.array_equal(ours.state, before[0]) and np.array_equal(ours.full_cov, before[1])


def test_higher_waves_make_what_was_learnt_worth_less():
    ours = made()
    low, high = (wave_model(EncounterSea(height, 11.6, 60.0, pi), 3) for height in (3.75, 7.5))
    ours.expect(low)
    before = ours.full_cov.copy()
    ours.expect(high)
    assert ours.full_cov[:WAVES, :WAVES] == pytest.approx(4 * before[:WAVES, :WAVES])
    ours.expect(low)
    assert ours.full_cov[:WAVES, :WAVES] == pytest.approx(4 * before[:WAVES, :WAVES])


def test_height_taken_from_the_range_anew():
    ours = made()
    ours.rest_on_range(70.0, 4.0, 30.0)
    pair = ours.full_cov[np.ix_([HEIGHT, RANGE_BIAS], [HEIGHT, RANGE_BIAS])]
    assert ours.height == 70.0 and ours.state[RANGE_BIAS] == 0.0
    assert pair.sum() == pytest.approx(4.0)
    assert np.sqrt(np.diag(pair)) == pytest.approx([np.hypot(2.0, 30.0), 30.0])


def test_covariance_stays_symmetric_and_positive():
    ours = made()
    for k in range(30000):
        ours.step(DT, 0.0, 45.0, 0.0 if k % 3 else None)
    assert ours.full_cov == pytest.approx(ours.full_cov.T, rel=1e-6, abs=1e-12)
    scale = np.sqrt(np.diag(ours.full_cov))
    assert np.linalg.eigvalsh(ours.full_cov / np.outer(scale, scale)).min() > -1e-9

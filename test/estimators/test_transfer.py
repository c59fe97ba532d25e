"""The filter of transfer alignment: bounds, directions and limits worked out elsewhere."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.fading import (
    faded,
    fading_factors,
    remembered,
    StrongTracking,
    surprise,
)
from deck_motion_ros.estimators.transfer import (
    ACROSS,
    ALL,
    BIAS,
    Disturbance,
    PHI,
    reference_velocity,
    TransferFilter,
    TransferModel,
    VEL,
)
from deck_motion_ros.geometry import matrix_from_rpy, rotation_matrix

EARTH, DT, THRUST = Earth(radians(40.0)), 0.01, 19.6
PLAIN = TransferModel(bias_sd=1e-3, drift_sd=0.0, turn_sd=0.0, push_sd=0.0)
SHAKEN = replace(PLAIN, push_sd=2e-4, disturbance=Disturbance())
FADING = StrongTracking((0.0,) * 3 + (1.0,) * 3)
PRIOR = (radians(0.2), radians(0.3), radians(0.5))
MAT_R = np.diag(np.square([0.01, 0.02, 0.05]))


def begun(model, prior=PRIOR, runs=(), bias=0.0):
    """Return a filter on a ship that heads east and stands still."""
    mat = np.broadcast_to(np.eye(3), (*runs, 3, 3))
    return TransferFilter(model, EARTH, mat, np.zeros((*runs, 3)), np.diag(np.square(prior)),
                          1e-4 * np.eye(3))


def fed(transfer, steps, thrust, error=(0.0, 0.0, 0.0), shake=None, rng=None, seen=ALL,
        mat_r=MAT_R):
    """Push the filter along its track; ``error``: attitude error of the true slave."""
    true = rotation_matrix(np.array(error))
    speed = getattr(transfer, 'true_speed', 0.0)
    for k in range(steps):
        mean = np.array([speed + thrust * DT / 2, 0.0, 0.0])
        transport = EARTH.transport_rate(mean)
        force = np.array([thrust, 0.0, 0.0]) - EARTH.gravity + np.cross(
            2 * EARTH.rate + transport, mean)
        transfer.integrate(true.T @ (EARTH.rate + transport),
                           true.T @ force + (shake(k + 1) if shake else 0.0), DT)
        speed += thrust * DT
        noise = 0.0 if rng is None else np.sqrt(np.diag(mat_r)) * rng.normal(size=3)
        transfer.step(np.array([speed, 0.0, 0.0]) + noise, np.eye(3), mat_r, seen)
    transfer.true_speed = speed


def test_the_turn_about_the_specific_force_is_not_observable():
    """A constant force leaves one direction as uncertain as it was: its own."""
    transfer = begun(PLAIN, prior=(0.01, 0.01, 0.01))
    fed(transfer, 300, THRUST)
    values, vectors = np.linalg.eigh(transfer.cov[PHI, PHI])
    force = np.array([THRUST, 0.0, -EARTH.gravity[2]])
    assert abs(vectors[:, 2] @ force) / np.linalg.norm(force) > 0.9999
    assert np.sqrt(values[2]) == pytest.approx(0.01, rel=1e-3)
    assert np.sqrt(values[1]) < 1e-3


def test_a_second_force_makes_it_observable():
    transfer = begun(PLAIN, prior=(0.01, 0.01, 0.01))
    fed(transfer, 200, 0.0)
    fed(transfer, 300, THRUST)
    assert np.sqrt(np.linalg.eigvalsh(transfer.cov[PHI, PHI])[2]) < 5e-4


def test_the_covariance_is_that_of_least_squares():
    """Pitch, its bias and two velocities from a constant push, solved as one regression."""
    transfer = begun(replace(PLAIN, bias_sd=1e-3), prior=(1e-9, 0.003, 1e-9))
    steps = 200
    fed(transfer, steps, THRUST)
    g = -EARTH.gravity[2]
    times = DT * np.arange(1, steps + 1)
    rows, weights = [], []
    for t in times:  # columns: pitch, velocity (x, z), bias (x, z)
        rows += [[g * t, 1, 0, t, 0], [-THRUST * t, 0, 1, 0, t]]
        weights += [1 / 0.01**2, 1 / 0.05**2]
    rows = np.array(rows)
    information = rows.T @ (np.array(weights)[:, None] * rows) + np.diag(
        [0.003**-2, 1e4, 1e4, 1e6, 1e6])
    expected = np.sqrt(np.linalg.inv(information)[0, 0])
    assert np.sqrt(transfer.cov[1, 1]) == pytest.approx(expected, rel=0.01)


def test_without_noise_it_finds_the_misalignment():
    error = np.array([radians(0.3), radians(-0.2), radians(0.6)])
    transfer = begun(replace(PLAIN, bias_sd=0.0))
    fed(transfer, 300, 0.0, error, mat_r=1e-4 * MAT_R)
    fed(transfer, 300, THRUST, error, mat_r=1e-4 * MAT_R)
    np.testing.assert_allclose(transfer.start, rotation_matrix(error), atol=3e-5)


@pytest.mark.parametrize('feedback', [True, False])
def test_errors_beside_the_navigator_and_taken_out_of_it_agree_for_small_ones(feedback):
    error = np.array([1e-4, -2e-4, 3e-4])
    transfer = begun(replace(PLAIN, feedback=feedback))
    fed(transfer, 200, 0.0, error)
    fed(transfer, 200, THRUST, error)
    expected = begun(PLAIN)
    fed(expected, 200, 0.0, error)
    fed(expected, 200, THRUST, error)
    np.testing.assert_allclose(transfer.mat, expected.mat, atol=2e-7)
    np.testing.assert_allclose(transfer.start, expected.start, atol=2e-7)


def test_many_runs_at_once_are_each_alone():
    rng = np.random.default_rng(3)
    many, alone = begun(SHAKEN, runs=(3,)), [begun(SHAKEN) for _ in range(3)]
    for k in range(80):
        if k == 30:
            for transfer in (many, *alone):
                transfer.launch()
        forces = np.array([THRUST * (k >= 30), 0.0, 9.8]) + 3 * rng.normal(size=(3, 3))
        references = rng.normal(size=(3, 3)) * 0.1
        rates = 0.01 * rng.normal(size=(3, 3))
        many.integrate(rates, forces, DT)
        many.step(references, np.eye(3), MAT_R, ACROSS if k % 7 == 0 else ALL)
        for transfer, rate, force, reference in zip(alone, rates, forces, references,
                                                    strict=True):
            transfer.integrate(rate, force, DT)
            transfer.step(reference, np.eye(3), MAT_R, ACROSS if k % 7 == 0 else ALL)
    for k, transfer in enumerate(alone):
        np.testing.assert_allclose(many.mat[k], transfer.mat, atol=1e-9)
        np.testing.assert_allclose(many.cov[k], transfer.cov, rtol=1e-6, atol=1e-12)


def test_fading_of_factor_one_is_the_kalman_filter():
    """A reference that is worse than it comes: nothing fades, and nothing differs."""
    plain, tracking = begun(PLAIN), begun(replace(PLAIN, tracking=FADING))
    for transfer in (plain, tracking):
        fed(transfer, 50, 0.0)
        fed(transfer, 100, THRUST)
    assert float(tracking.factor) == 1.0
    np.testing.assert_array_equal(tracking.mat, plain.mat)
    np.testing.assert_array_equal(tracking.cov, plain.cov)


def test_fading_of_velocity_forgets_a_push_and_that_of_all_states_diverges():
    """Bai2016's single factor inflates what no velocity shows."""
    def shake(k):
        return np.array([20.0, 0.0, 20.0]) * np.exp(-k * DT / 0.1)

    pitch, worst = {}, {}
    for name, weights in (('none', (0.0,) * 6), ('velocity', FADING.weights),
                          ('all', (1.0,) * 6)):
        model = replace(PLAIN, bias_sd=0.0, tracking=StrongTracking(weights) if any(weights)
                        else None)
        transfer = begun(model)
        fed(transfer, 300, THRUST, shake=shake, rng=np.random.default_rng(4),
            mat_r=1e-4 * np.eye(3))
        pitch[name] = abs(transfer.mat[0, 2])
        worst[name] = np.sqrt(np.linalg.eigvalsh(transfer.cov[PHI, PHI])[2])
    assert pitch['velocity'] < pitch['none'] / 8
    assert worst['velocity'] == pytest.approx(worst['none'], rel=0.01)
    assert worst['all'] > 10 * worst['none']


def launched(steps, shake=None):
    """Return a filter that has stood for two seconds and been launched."""
    transfer, rng = begun(SHAKEN), np.random.default_rng(8)
    fed(transfer, 200, 0.0, rng=rng)
    transfer.launch()
    fed(transfer, steps, THRUST, shake=shake, rng=rng)
    return transfer


@pytest.mark.parametrize('direction, most', [
    ((1.0, 0.0, 0.0), 1.02), ((0.0, 0.0, 1.0), 1.02), ((1.0, 0.0, 1.0), 1.3),
    ((-1.0, 1.0, 0.5), 1.3)])
def test_a_disturbance_is_forgotten_along_its_direction_alone(direction, most):
    """The plane across the shaking keeps what it knew."""
    shaken = launched(40, lambda k: 20.0 * np.array(direction) * np.exp(-k * DT / 0.1))
    quiet = launched(40)
    _, _, vectors = np.linalg.svd([direction])
    along, *across = (
        np.sqrt([vec @ transfer.cov[VEL, VEL] @ vec for transfer in (shaken, quiet)])
        for vec in vectors)
    assert along[0] > 1.5 * along[1]
    for sd in across:
        assert sd[1] / most < sd[0] < most * sd[1]
    assert abs(shaken.mat[0, 2]) < 3 * np.sqrt(shaken.cov[1, 1])


@pytest.mark.parametrize('direction', [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (-1.0, 1.0, 0.5)])
def test_what_the_thrust_hides_goes_with_what_shows_across_the_track(direction):
    def shake(k):
        return 20.0 * np.array(direction) * np.exp(-k * DT / 0.1)

    transfer = launched(3, shake)
    np.testing.assert_allclose(transfer.disturbance, shake(3), atol=0.05)


def test_a_shaking_along_the_track_alone_stays_in_doubt():
    transfer = launched(3, lambda k: np.array([20.0 * np.exp(-k * DT / 0.1), 0.0, 0.0]))
    error = transfer.disturbance[0] - 20.0 * np.exp(-0.3)
    assert 1.0 < np.sqrt(transfer.cov[9, 9]) and abs(error) < 3 * np.sqrt(transfer.cov[9, 9])


def test_a_push_that_no_change_of_the_force_shows_is_still_a_surprise():
    def push(k):  # 0.44 m/s
        return np.array([0.0, 0.0, 0.5 * np.exp(-((k * DT - 1) / 0.5)**2)])

    transfer, plain = launched(300, push), begun(PLAIN)
    fed(plain, 200, 0.0)
    fed(plain, 300, THRUST, shake=push)
    assert abs(transfer.mat[0, 2]) < abs(plain.mat[0, 2]) / 6


def test_without_velocimeter_speed_along_the_track_stays_unknown():
    transfer = begun(PLAIN)
    fed(transfer, 100, 0.0, seen=ACROSS)
    assert transfer.cov[3, 3] >= 1e-4 > 5 * transfer.cov[4, 4]


def test_doubt_is_variance_of_the_next_step():
    doubtful, sure = begun(PLAIN), begun(PLAIN)
    doubtful.doubt(turn=1e-3, push=0.5)
    for transfer in (doubtful, sure):
        transfer.integrate(EARTH.rate, -EARTH.gravity, DT)
        transfer.step(np.zeros(3), np.eye(3), 1e6 * np.eye(3))
    np.testing.assert_allclose(np.diagonal(doubtful.cov - sure.cov)[:6],
                               [1e-6] * 3 + [0.25] * 3, rtol=1e-3)


def test_a_known_bias_is_found_at_a_known_attitude():
    transfer = begun(replace(PLAIN, bias_sd=0.01), prior=(1e-9,) * 3)
    fed(transfer, 300, 0.0, shake=lambda k: np.array([0.0, 0.0, 0.007]),
        mat_r=1e-4 * MAT_R)
    assert transfer.bias[2] == pytest.approx(0.007, rel=0.03)
    assert np.sqrt(transfer.cov[BIAS, BIAS][2, 2]) < 0.004


def test_the_reference_by_hand():
    """A ship that rolls about her bow's axis throws a point above her sideways."""
    velocity = reference_velocity(
        matrix_from_rpy(0.0, 0.0, np.pi / 2), np.array([0.1, 0.0, 0.0]), np.array([1.0, 2, 3]),
        np.array([0.0, 0.0, 10.0]), np.array([1.0, 0.0, 0.0]), np.array(5.0))
    np.testing.assert_allclose(velocity, [1.0 + 1.0, 2.0 + 5.0, 3.0])


def test_factors_by_hand():
    """One state, one measurement: (V - beta R - Q) / (alpha M)."""
    one = np.ones((1, 1))
    for weakening, expected in ((1.0, (9 - 2 - 1) / 3), (5.0, 1.0)):
        factors = fading_factors(StrongTracking((1.0,), weakening=weakening), 9 * one, 2 * one,
                                 one, np.array([3.0]))
        np.testing.assert_allclose(factors, expected)
    np.testing.assert_allclose(faded(np.array([[4.0, 2.0], [2.0, 1.0]]), np.array([4.0, 1.0])),
                               [[16.0, 4.0], [4.0, 1.0]])


def test_the_memory_as_printed_is_unbiased_but_short():
    rng, mat = np.random.default_rng(5), None
    values = []
    for value in rng.normal(size=(20_000, 1)):
        mat = remembered(mat, value, 0.95)
        values.append(mat[0, 0])
    values = np.array(values[100:])
    assert np.mean(values) == pytest.approx(1.0, rel=0.03)
    assert 2 / np.var(values) == pytest.approx((1 + 0.95 / 1.95) / (1 - 0.95 / 1.95), rel=0.1)


def test_a_surprise_is_explained_and_no_more():
    rng = np.random.default_rng(6)
    root = rng.normal(size=(3, 3))
    mat_s, innovation = root @ root.T, np.array([5.0, 20.0, -10.0])
    share, size = surprise(innovation, np.linalg.inv(mat_s), gate=8.0)
    assert size == pytest.approx(innovation @ np.linalg.inv(mat_s) @ innovation / 3)
    _, left = surprise(
        innovation, np.linalg.inv(mat_s + share * np.outer(innovation, innovation)), gate=8.0)
    assert left == pytest.approx(1.0)
    assert surprise(innovation, np.linalg.inv(1e3 * mat_s), gate=8.0)[0] == 0.0

"""Positions from ranges: against scipy, hand-made cases, Monte Carlo and the mirror."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from deck_motion_ros.estimators.multilateration import (
    dilution,
    extents,
    gauss_newton,
    RangeErrors,
    weighted_least_squares,
)

PLATFORM = np.array([[1.5, 1.5, 0.5], [-1.5, 1.5, 1.0], [-1.5, -1.5, 0.5], [1.5, -1.5, 1.0]])
ABOVE = np.array([0.0, 0.0, 20.0])


def distances(points, position):
    return np.linalg.norm(points - position, axis=1)


@pytest.mark.parametrize('seed', range(10))
def test_gauss_newton_finds_scipys_minimum(seed):
    rng = np.random.default_rng(seed)
    points = PLATFORM if seed % 2 else rng.normal(size=(6, 3)) * 5
    position = rng.uniform([-10, -10, 4], [10, 10, 15])
    sd = rng.uniform(0.02, 0.1, len(points))
    ranges = distances(points, position) + sd * rng.normal(size=len(points))
    expected = least_squares(
        lambda x: (ranges - distances(points, x)) / sd, position, method='lm',
        xtol=1e-15, ftol=1e-15)
    fix = gauss_newton(points, ranges, sd, ABOVE)
    assert fix.position == pytest.approx(expected.x, abs=1e-5)
    assert fix.cov[:3, :3] == pytest.approx(np.linalg.inv(expected.jac.T @ expected.jac), rel=1e-3)
    assert fix.cost == pytest.approx(2 * expected.cost, rel=1e-6)


def test_of_two_mirrored_solutions_the_one_above_is_found():
    flat = PLATFORM * [1, 1, 0]
    for height in (0.5, 3.0, 15.0):
        position = np.array([2.0, -1.0, height])
        fix = gauss_newton(flat, distances(flat, position), np.full(4, 0.05), ABOVE)
        assert fix.position == pytest.approx(position, abs=1e-6)


def test_covariance_is_that_of_the_errors():
    rng = np.random.default_rng(1)
    position, sd = np.array([3.0, 2.0, 8.0]), np.full(4, 0.05)
    fixes = [gauss_newton(PLATFORM, distances(PLATFORM, position) + sd * rng.normal(size=4), sd,
                          ABOVE) for _ in range(600)]
    errors = np.array([fix.position for fix in fixes]) - position
    predicted = np.mean([fix.cov[:3, :3] for fix in fixes], axis=0)
    root = np.linalg.inv(np.linalg.cholesky(predicted))
    assert np.cov(root @ errors.T) == pytest.approx(np.eye(3), abs=0.2)
    assert 0.05 * dilution(PLATFORM, position) == pytest.approx(np.sqrt(np.diag(predicted)),
                                                                rel=0.1)


def test_dilution_straight_above_by_hand():
    # four corners of a square of half width a seen from height h: each unit vector is
    # (+-a, +-a, h) / r, so the information is diag(4 a^2, 4 a^2, 4 h^2) / r^2
    square = 2.0 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
    r = np.sqrt(2 * 2.0**2 + 6.0**2)
    assert dilution(square, np.array([0, 0, 6.0])) == pytest.approx([r / 4, r / 4, r / 12])
    assert np.isinf(dilution(square, np.array([1.0, 0, 0]))).all()  # all directions in one plane


def test_velocity_from_ranges_taken_in_turn():
    times = np.linspace(-1.0, 0.0, 21)
    position, velocity = np.array([2.0, 5.0, 10.0]), np.array([1.0, -2.0, -0.5])
    points = PLATFORM[np.arange(21) % 4]
    ranges = np.linalg.norm(points - position - np.outer(times, velocity), axis=1)
    fix = gauss_newton(points, ranges, np.full(21, 1e-3), ABOVE, times, velocity_sd=10.0)
    assert fix.position == pytest.approx(position, abs=1e-3)
    assert fix.velocity == pytest.approx(velocity, abs=1e-2)


def test_outliers_lose_their_weight():
    rng = np.random.default_rng(2)
    position, points = np.array([2.0, 5.0, 10.0]), np.tile(PLATFORM, (8, 1))
    ranges = distances(points, position) + 0.05 * rng.normal(size=32)
    bad = np.arange(0, 32, 5)
    ranges[bad] += rng.uniform(1.0, 8.0, len(bad))
    fix = gauss_newton(points, ranges, np.full(32, 0.05), ABOVE, robust=True)
    assert np.linalg.norm(fix.position - position) < 0.5
    assert (fix.weights[bad] == 0).all()
    assert np.count_nonzero(fix.weights) >= 24


def test_biases_and_scale_of_a_well_surrounded_target():
    corners = np.array([[0, 0, 0], [20, 0, 1], [0, 20, 2], [20, 20, 0.0]])
    rng, owners = np.random.default_rng(3), np.tile(np.arange(4), 100)
    times = np.linspace(-20, 0, 400)
    position, velocity = np.array([15.0, 12.0, 5.0]), np.array([0.6, 0.2, 0.0])
    true = np.linalg.norm(corners[owners] - position - np.outer(times, velocity), axis=1)
    bias = np.array([0.3, -0.2, 0.1, 0.0])
    ranges = 1.05 * true + bias[owners] + 0.01 * rng.normal(size=400)
    fix = gauss_newton(corners[owners], ranges, np.full(400, 0.01), ABOVE, times, 2.0, owners,
                       RangeErrors(4, 0.3, 0.1))
    error = fix.errors - [*bias, 0.05]
    assert np.abs(error / np.sqrt(np.diag(fix.cov)[6:])).max() < 4
    assert np.linalg.norm(fix.position - position) < 0.5


@pytest.mark.parametrize('points', [PLATFORM[:2], PLATFORM * [1, 0, 0]],
                         ids=['two anchors', 'a line'])
def test_no_fix_where_ranges_do_not_determine_one(points):
    ranges = distances(points, np.array([1.0, 2.0, 5.0]))
    assert gauss_newton(points, ranges, np.full(len(points), 0.05), ABOVE) is None


def test_extents_say_plane_and_line():
    line, plane, space = PLATFORM * [1, 0, 0], PLATFORM * [1, 1, 0], PLATFORM
    assert extents(line) == pytest.approx([1.5, 0, 0])
    assert extents(plane) == pytest.approx([1.5, 1.5, 0])
    assert extents(space)[2] == pytest.approx(0.25)
    assert extents(PLATFORM[:1]) == pytest.approx([0, 0, 0])


def test_linear_solution_is_exact_without_noise_and_poor_in_height_with_it():
    position = np.array([10.0, 20.0, 15.0])
    ranges = distances(PLATFORM, position)
    found, cov = weighted_least_squares(PLATFORM, ranges, 0.05)
    assert found == pytest.approx(position)
    best = 0.05 * dilution(PLATFORM, position)
    assert np.sqrt(cov[2, 2]) > 3 * best[2]
    rng = np.random.default_rng(4)
    errors = np.array([
        weighted_least_squares(PLATFORM, ranges + 0.05 * rng.normal(size=4), 0.05)[0]
        for _ in range(500)]) - position
    assert np.cov(errors.T).diagonal() / cov.diagonal() == pytest.approx(np.ones(3), abs=0.2)

"""The filters of ranges: closed forms, identities, outliers."""

import numpy as np
import pytest

from deck_motion_ros.estimators.multilateration import Fix, RangeErrors
from deck_motion_ros.estimators.ranging import JointFilter, PaperFilter, robust_weights

PLATFORM = np.array([[1.5, 1.5, 0.5], [-1.5, 1.5, 1.0], [-1.5, -1.5, 0.5], [1.5, -1.5, 1.0]])
POINTS = [tuple(row) for row in PLATFORM.tolist()]


def fix(position, sd=0.5, velocity_sd=1.0, errors=(), error_sds=()):
    cov = np.diag(np.square([sd] * 3 + [velocity_sd] * 3 + [*error_sds]))
    return Fix(np.array(position, float), np.zeros(3), np.array(errors), cov, np.ones(4), 0.0)


def test_one_range_by_hand():
    # prior sd 0.5 along the line of sight, noise 0.5: half of the innovation, var halved
    joint = JointFilter(fix([0, 0, 10]), 0.0, 100.0)
    expected, mat_h = joint.expected([(0.0, 0.0, 0.0)], 0.0, [0])
    joint.update(np.array([10.3]) - expected, mat_h, np.array([0.25]))
    assert joint.state[:3] == pytest.approx([0, 0, 10.15])
    assert np.diag(joint.cov)[:3] == pytest.approx([0.25, 0.25, 0.125])


def test_ranges_together_are_ranges_one_after_another():
    rng = np.random.default_rng(1)
    mat_h, residual, var = rng.normal(size=(4, 9)), 0.1 * rng.normal(size=4), np.full(4, 1.0)
    one, other = (JointFilter(fix([1, 2, 8]), 0.1, 100.0) for _ in range(2))
    one.update(residual, mat_h, var)
    for row, value in zip(mat_h, residual, strict=True):
        moved = other.state - np.concatenate([[1, 2, 8], np.zeros(6)])
        other.update(np.array([value - row @ moved]), row[None], np.ones(1))
    assert one.state == pytest.approx(other.state)
    assert one.cov == pytest.approx(other.cov)


def test_a_late_range_acts_as_if_it_had_come_in_time():
    # without process noise the order of measuring and moving does not matter
    in_time, late = (JointFilter(fix([3, -2, 9]), 0.0, 1e9) for _ in range(2))
    ranges, var, still = np.linalg.norm(PLATFORM - [3.1, -2.1, 9.1], axis=1), np.full(
        4, 0.0025), np.zeros(3)
    expected, mat_h = in_time.expected(POINTS, 0.0, range(4))
    in_time.update(ranges - expected, mat_h, var)
    in_time.advance(0.2, still)
    late.advance(0.2, still)
    expected, mat_h = late.expected(POINTS, 0.2, range(4))
    late.update(ranges - expected, mat_h, var)
    assert late.state == pytest.approx(in_time.state, abs=1e-9)
    assert late.cov == pytest.approx(in_time.cov, abs=1e-9)


def test_two_half_steps_are_one_step():
    one, other = (JointFilter(fix([0, 0, 5], errors=[0.1, 0.2, 0.0, 0.1], error_sds=[0.1] * 4),
                              0.1, 100.0, RangeErrors(4, 0.1), 50.0) for _ in range(2))
    psd = np.array([0.1, 0.2, 0.3])
    one.advance(0.2, psd)
    other.advance(0.1, psd)
    other.advance(0.1, psd)
    assert one.state == pytest.approx(other.state)
    assert one.cov == pytest.approx(other.cov, rel=1e-3, abs=1e-7)
    assert one.cov[3, 3] - 1.0 == pytest.approx(0.2 * 0.1, abs=1e-3)  # psd t, and the slow error


def test_weights_tell_the_one_bad_range_of_four():
    rng, rejected, harmed = np.random.default_rng(2), 0, 0
    for _ in range(200):
        joint = JointFilter(fix([0.1, 0.0, 8.0], sd=0.1), 0.0, 100.0)
        truth = np.array([0.1, 0.0, 8.0]) + 0.1 * rng.normal(size=3)
        ranges = np.linalg.norm(PLATFORM - truth, axis=1) + 0.05 * rng.normal(size=4)
        ranges[2] += 1.0
        expected, mat_h = joint.expected(POINTS, 0.0, range(4))
        weights = joint.update(ranges - expected, mat_h, np.full(4, 0.0025)).weights
        rejected += weights[2] == 0
        harmed += (weights[[0, 1, 3]] == 0).any()
    assert rejected >= 198
    assert harmed <= 2


def test_weights_leave_good_ranges_alone():
    assert (robust_weights(np.array([0.05, -0.08]), 0.01 * np.eye(2), np.full(2, 0.0025)) == 1
            ).all()


def test_everything_rejected_changes_nothing():
    joint = JointFilter(fix([0, 0, 10], sd=0.01), 0.0, 100.0)
    before = joint.state.copy(), joint.cov.copy()
    expected, mat_h = joint.expected(POINTS, 0.0, range(4))
    weights = joint.update(
        np.array([5.0, -7.0, 9.0, 6.0]), mat_h, np.full(4, 1e-4)).weights
    assert (weights == 0).all()
    assert joint.state == pytest.approx(before[0])
    assert joint.cov == pytest.approx(before[1])


def test_the_papers_filter_follows_without_noise():
    paper = PaperFilter(PLATFORM, 0.05, (0.0, 0.0, 1.0))
    for k in range(100):
        position = np.array([10.0, 20.0, 15.0]) - 0.05 * k * np.array([1.0, 2.0, 0.5])
        paper.update(0.05 if k else 0.0, np.linalg.norm(PLATFORM - position, axis=1))
    assert paper.state[:3] == pytest.approx(position, abs=0.02)
    assert paper.state[3:6] == pytest.approx([-1, -2, -0.5], abs=0.05)

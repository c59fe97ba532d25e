"""Which anchor is wrong: the plain filter while all is well, doubt while nobody can tell."""

import numpy as np
import pytest

from deck_motion_ros.estimators.multilateration import Fix
from deck_motion_ros.estimators.ranging import DOUBT_RATE, DOUBT_SD, JointFilter
from deck_motion_ros.estimators.suspicion import CheckedFilter, Epoch

PLATFORM = np.array([[1.5, 1.5, 0.5], [-1.5, 1.5, 1.0], [-1.5, -1.5, 0.5], [1.5, -1.5, 1.0]])
PLACE, SD = np.array([0.5, -0.3, 6.0]), 0.05


def joint():
    fix = Fix(PLACE, np.zeros(3), np.empty(0), np.diag([0.01] * 3 + [0.04] * 3), np.ones(4), 0.0)
    return JointFilter(fix, 0.0, 100.0)


def followed(points, psd, epochs, offset, seed=1, since=40):
    """Let an aircraft stand still while the ranges to the first anchor go wrong."""
    rng, checked = np.random.default_rng(seed), CheckedFilter(joint(), len(points))
    for k in range(epochs):
        distances = np.linalg.norm(PLACE - points, axis=1) + SD * rng.normal(size=len(points))
        distances[0] += offset * (k >= since)
        checked.advance(0.1, np.full(3, psd))
        checked.use(Epoch([tuple(row) for row in points.tolist()], range(len(points)), distances,
                          np.full(len(points), SD**2), 0.0))
    return checked


def test_while_all_is_well_it_is_the_plain_filter():
    rng, plain = np.random.default_rng(1), joint()
    checked = followed(PLATFORM, 0.01, 60, 0.0)
    for _ in range(60):
        measured = np.linalg.norm(PLACE - PLATFORM, axis=1) + SD * rng.normal(size=4)
        plain.advance(0.1, np.full(3, 0.01))
        expected, mat_h = plain.expected([*map(tuple, PLATFORM)], 0.0, range(4))
        plain.update(measured - expected, mat_h, np.full(4, SD**2))
    assert checked.doubts() == {}
    state, cov = checked.estimate()
    assert state.tolist() == plain.state[:6].tolist()
    assert cov.tolist() == plain.cov[:6, :6].tolist()


@pytest.mark.parametrize('offset', [0.6, -0.6, 2.0])
def test_a_steady_aircraft_tells_at_once_which_range_has_jumped(offset):
    checked = followed(PLATFORM, 1e-4, 60, offset)
    doubts = checked.doubts()
    assert max(doubts, key=doubts.get) == 0
    assert doubts[0] > 0.99
    state, cov = checked.estimate()
    assert np.all(np.abs(state[:3] - PLACE) < 4 * np.sqrt(np.diag(cov)[:3]))


def test_with_four_anchors_and_no_memory_nobody_can_tell():
    # one range to spare, and the aircraft may have jumped
    checked = followed(PLATFORM, 1e3, 60, 0.6)
    doubts = checked.doubts()
    assert [*doubts] == [0, 1, 2, 3]
    assert all(0.02 < value < 0.8 for value in doubts.values())
    state, cov = checked.estimate()
    error = state[:3] - PLACE
    assert error @ np.linalg.solve(cov[:3, :3], error) / 3 < 3.0
    assert np.trace(cov[:3, :3]) > 4 * np.trace(
        followed(PLATFORM, 1e3, 60, 0.0).estimate()[1][:3, :3])


def test_a_fifth_and_sixth_anchor_tell_without_memory():
    more = np.vstack([PLATFORM, [[4.0, 0.0, 3.0], [-4.0, 1.0, 2.0]]])
    checked = followed(more, 100.0, 80, 0.6)
    assert checked.doubts()[0] > 0.99


def test_who_comes_back_is_trusted_again():
    rng, checked = np.random.default_rng(4), CheckedFilter(joint(), 4)
    named = []
    for k in range(160):
        distances = np.linalg.norm(PLACE - PLATFORM, axis=1) + SD * rng.normal(size=4)
        distances[2] += 0.8 * (40 <= k < 80)
        checked.advance(0.1, np.full(3, 1e-4))
        checked.use(Epoch([*map(tuple, PLATFORM)], range(4), distances, np.full(4, SD**2), 0.0))
        named.append(checked.doubts().get(2, 0.0) > 0.5)
    assert named[79]
    assert not any(named[:40])
    assert not named[-1]


def test_a_doubt_forgets_and_trust_is_what_the_bias_would_have_been_worth():
    plain = joint()
    doubting = plain.doubting(1)
    assert doubting.doubted == (1,)
    assert doubting.biases() == {1: (0.0, DOUBT_SD)}
    doubting.advance(1.0, np.zeros(3))
    assert doubting.biases()[1][1] == pytest.approx(np.hypot(DOUBT_SD, DOUBT_RATE))
    # trusting at once is as if nothing had been doubted
    doubting = plain.doubting(1)
    residual = np.array([0.02, 0.05, -0.03, 0.01])
    for item in (plain, doubting):
        _, mat_h = item.expected([*map(tuple, PLATFORM)], 0.0, range(4))
        item.update(residual, mat_h, np.full(4, SD**2))
    assert np.max(np.abs(doubting.state[:9] - plain.state)) > 1e-3
    trusting = doubting.trusting(1)
    assert trusting.doubted == ()
    assert trusting.state == pytest.approx(plain.state, abs=1e-12)
    assert trusting.cov == pytest.approx(plain.cov, abs=1e-12)
    assert len(plain.doubting(0).doubting(2).doubting(0).state) == 11

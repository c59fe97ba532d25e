"""The array square root against filterpy, a hand-solved case, and float32."""

from filterpy.kalman import FadingKalmanFilter, KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from deck_motion_ros.estimators.interleaved import ROW_H, transition
from deck_motion_ros.estimators.square_root import predicted, triangular_root, updated

PAPER_SD = 0.1  # deg: R = 0.01 deg^2 beside Q = I


def random_model(rng, n=4):
    """Draw a transition that neither dies nor explodes, a root of Q, and H."""
    mat_a = rng.normal(size=(n, n))
    mat_a *= 1.05 / np.abs(np.linalg.eigvals(mat_a)).max()
    return mat_a, rng.normal(size=(n, n)), rng.normal(size=n)


@pytest.mark.filterwarnings('ignore:Use KalmanFilter')
@pytest.mark.parametrize('fading', [1.0, 1.3, 4.0, 100.0])
def test_every_step_is_filterpys(fading):
    """With s = 1 it is the plain filter, with s > 1 the fading-memory filter, both theirs."""
    rng = np.random.default_rng(1)
    mat_a, root_q, row_h = random_model(rng)
    theirs = (KalmanFilter(4, 1) if fading == 1.0
              else FadingKalmanFilter(fading ** 0.5, dim_x=4, dim_z=1))
    theirs.F, theirs.Q, theirs.H, theirs.R = mat_a, root_q @ root_q.T, row_h[None], 0.3**2
    x, root = rng.normal(size=4), 2.0 * np.eye(4)
    theirs.x, theirs.P = x[:, None], root @ root.T
    for _ in range(40):
        value = rng.normal()
        theirs.predict()
        theirs.update(value)
        x, root = predicted(x, root, mat_a, root_q, fading)
        expected, spread = row_h @ x, row_h @ root
        x, root, gain, innovation = updated(x, root, row_h, value, 0.3)
        assert x == pytest.approx(theirs.x[:, 0], rel=1e-8, abs=1e-8)
        assert root @ root.T == pytest.approx(theirs.P, rel=1e-7, abs=1e-9 * theirs.P.max())
        assert innovation == pytest.approx((value - expected) / np.hypot(
            0.3, np.linalg.norm(spread)), rel=1e-9)
        assert gain == pytest.approx(theirs.K[:, 0], rel=1e-7, abs=1e-9)


@given(arrays(float, (3, 5), elements=st.floats(-1e3, 1e3)))
def test_triangular_root(array):
    root = triangular_root(array)
    assert np.array_equal(root, np.tril(root)) and (np.diag(root) >= 0).all()
    product = array @ array.T
    assert root @ root.T == pytest.approx(product, abs=1e-12 * (1 + product.max()))


def test_a_constant_measured_many_times():
    """The variance of the mean of n values and a prior like them is R / (n + 1)."""
    x, root = np.zeros(1), np.array([[2.0]])
    values = np.arange(9.0)
    for value in values:
        x, root = predicted(x, root, np.eye(1), np.zeros((1, 1)))
        x, root, _, _ = updated(x, root, np.ones(1), value, 2.0)
    assert x[0] == pytest.approx(values.sum() / 10)
    assert root[0, 0] ** 2 == pytest.approx(4.0 / 10)


def test_runs_side_by_side_are_the_runs_one_by_one():
    rng = np.random.default_rng(2)
    mat_a, root_q, row_h = random_model(rng)
    values = rng.normal(size=(12, 3))
    many, root = np.zeros((4, 3)), np.eye(4)
    single, roots = [np.zeros(4)] * 3, np.eye(4)
    for row in values:
        many, root = predicted(many, root, mat_a, root_q)
        many, root, _, standardised = updated(many, root, row_h, row, 0.5)
        prior = [predicted(x, roots, mat_a, root_q) for x in single]
        each = [updated(*item, row_h, z, 0.5) for item, z in zip(prior, row, strict=True)]
        single, roots = [item.vec_x for item in each], each[0].root
        assert many.T == pytest.approx(np.array(single), abs=1e-12)
        assert standardised == pytest.approx([float(item.innovation) for item in each])


def single_precision(fading, sd, start_sd):
    """Run the array form in float32 at steps of 1 s, yielding the root after each."""
    x, root = np.zeros(3, np.float32), start_sd * np.eye(3, dtype=np.float32)
    mat_a, row_h = transition(1.0).astype(np.float32), ROW_H.astype(np.float32)
    while True:
        x, root = predicted(x, root, mat_a, np.eye(3, dtype=np.float32), fading)
        x, root, _, _ = updated(x, root, row_h, np.float32(0.0), sd)
        yield root


def printed_form(fading, sd, start_sd, steps):
    """Run eq 9-20 as printed in float32; return the smallest eigenvalue of any P on the way."""
    mat_a, row_h = transition(1.0).astype(np.float32), ROW_H.astype(np.float32)
    eye = np.eye(3, dtype=np.float32)
    cov, smallest = np.float32(start_sd)**2 * eye, np.inf
    for _ in range(steps):
        try:
            delta = np.linalg.cholesky(cov)
        except np.linalg.LinAlgError:
            break
        product = delta @ delta.T
        gain = product @ row_h / (row_h @ product @ row_h + np.float32(sd)**2)
        kept = (eye - np.outer(gain, row_h)) @ product
        cov = np.float32(fading) * (mat_a @ kept @ mat_a.T) + eye
        for item in (kept, cov):
            symmetric = (item + item.T).astype(float) / 2
            smallest = min(smallest, np.linalg.eigvalsh(symmetric)[0])
    return smallest


@pytest.mark.parametrize('start_sd', [1.0, 1e2, 1e3])
@pytest.mark.parametrize('sd', [PAPER_SD, 0.01, 0.001])
@pytest.mark.parametrize('fading', [1.0, 100.0])
def test_float32_stays_positive_definite_for_ever(fading, sd, start_sd):
    """
    Within 1e6 steps, and within any number.

    The root depends on the root before it alone: once its 36 bytes return, all else returns too.
    """
    seen = set()
    for root in single_precision(fading, sd, start_sd):
        assert root.dtype == np.float32 and (np.diag(root) > 0).all()
        wide = root.astype(float)
        assert np.linalg.eigvalsh(wide @ wide.T)[0] > 0
        assert len(seen) < 1_000_000
        if root.tobytes() in seen:
            break
        seen.add(root.tobytes())


def test_the_printed_form_does_not():
    """Cholesky factors of a P that has been formed: "any nonzero" start, or a better sensor."""
    assert printed_form(100.0, PAPER_SD, 1e2, 10) < -5.0
    assert printed_form(100.0, PAPER_SD, 1e3, 10) < -500.0
    assert printed_form(100.0, 0.01, 1.0, 10) <= 0.0


def test_float32_does_not_drift_at_uneven_steps():
    rng = np.random.default_rng(3)
    narrow, wide = np.eye(3, dtype=np.float32), np.eye(3)
    for k in range(4000):
        mat_a, fading = transition(rng.uniform(0.5, 2.0)), rng.choice([1.0, 100.0])
        _, wide = predicted(np.zeros(3), wide, mat_a, np.eye(3), fading)
        wide = updated(np.zeros(3), wide, ROW_H, 0.0, PAPER_SD).root
        _, narrow = predicted(np.zeros(3, np.float32), narrow, mat_a.astype(np.float32),
                              np.eye(3, dtype=np.float32), fading)
        narrow = updated(np.zeros(3, np.float32), narrow, ROW_H.astype(np.float32),
                         np.float32(0.0), PAPER_SD).root
        assert narrow.dtype == np.float32
        assert np.abs(narrow - wide).max() < 2e-4 * np.abs(wide).max(), k

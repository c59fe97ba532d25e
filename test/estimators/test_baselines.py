"""The peers do what they are peers for: a fair match needs them at their best."""

import numpy as np
import pytest

from deck_motion_ros.estimators.baselines import (
    AutoregressiveAxis,
    HarmonicAxis,
    PerAxis,
    PersistentAxis,
    StillAxis,
)
from deck_motion_ros.samples import HEAVE, PITCH


def sine(axis, period, omega, duration, var, mean=0.0):
    for time in np.arange(0.0, duration, period).tolist():
        axis.measure(time, mean + np.cos(omega * time), var)
    ahead = time + np.array([0.5, 1.0, 3.0, 10.0])
    outlook = axis.outlook()
    return [outlook(then) for then in ahead], mean + np.cos(omega * ahead)


def test_ar_predicts_a_known_ar_like_its_conditional_mean():
    rng, values = np.random.default_rng(1), [0.0, 0.0]
    for noise in rng.standard_normal(3000):
        values.append(1.6 * values[-1] - 0.9 * values[-2] + noise)
    axis, said, best = AutoregressiveAxis(), [], []
    for time, value in enumerate(values):
        axis.measure(float(time), value, 0.0)
        if time > 2500:
            outlook = axis.outlook()
            said.append([outlook(time + 1.0), outlook(time + 2.0)])
            first = 1.6 * value - 0.9 * values[time - 1]
            best.append([first, 1.6 * first - 0.9 * value])
    missed = np.sqrt(np.mean(np.square(np.subtract(said, best)), axis=0))
    # 30 weights from 600 remembered samples cost about sqrt(30 / 1200) = 0.16 of the noise
    assert np.all(missed < np.array([0.25, 0.25 * np.hypot(1, 1.6)]))


@pytest.mark.parametrize('period', [0.02, 0.1, 0.5, 1.0])
def test_ar_follows_a_sine_of_any_rate_about_any_mean(period):
    said, came = sine(AutoregressiveAxis(), period, 0.7, 300.0, 1e-6, mean=0.2)
    np.testing.assert_allclose(said, came, atol=0.05)


def test_ar_says_the_mean_before_it_can_be_fitted():
    axis = AutoregressiveAxis()
    assert axis.outlook()(1.0) == 0.0
    for time in range(10):
        axis.measure(float(time), 3.0 + (-1.0)**time, 0.0)
    assert axis.outlook()(20.0) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize('which', [0, 7, 31])
def test_harmonic_bank_follows_one_of_its_sines_to_round_off(which):
    class Everlasting(HarmonicAxis):
        COHERENCE = 1e9

    said, came = sine(Everlasting(), 0.5, float(HarmonicAxis.OMEGA[which]), 200.0, 1e-12)
    np.testing.assert_allclose(said, came, atol=1e-6)


def test_harmonic_bank_follows_a_sine_between_two_of_its_own():
    said, came = sine(HarmonicAxis(), 0.1, float(HarmonicAxis.OMEGA[8:10].mean()), 300.0, 1e-4)
    np.testing.assert_allclose(said, came, atol=0.2)


def test_axes_are_apart_and_rest_before_they_come():
    for make in (StillAxis, PersistentAxis, AutoregressiveAxis, HarmonicAxis):
        peer = PerAxis(make)
        assert peer.outlook().mean(5.0) == (0.0, 0.0, 0.0)
        for time in range(100):
            peer.measure(HEAVE, float(time), 1.0, 0.01)
        _, pitch, heave = peer.outlook().mean(102.0)
        assert pitch == 0.0 and heave == pytest.approx(float(make is not StillAxis), abs=0.1)
        peer.measure(PITCH, 100.0, -1.0, 0.01)
        assert peer.outlook().mean(102.0)[HEAVE] == heave

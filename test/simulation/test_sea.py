"""The sea against integrals, waveresponse and its own records."""

from functools import cache
from math import pi, sqrt

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.signal import welch
import waveresponse

from deck_motion_ros.simulation.sea import (
    Bretschneider,
    dense_waves,
    joined,
    Jonswap,
    Pan2020,
    random_waves,
    Waves,
    WaveSystem,
)

SPECTRA = [Bretschneider(3.25, 9.7), Jonswap(2.0, 7.0), Pan2020(1.875)]


@cache
def hours_of(spectrum, count=4, rate=2.0):
    """Return the times and ``count`` different hours of one kind of sea."""
    times = np.arange(3600 * rate) / rate
    system, still = WaveSystem(spectrum, 0.3), np.zeros((len(times), 2))
    return times, np.array([
        random_waves(system, 400, np.random.default_rng(seed)).elevation(times, still)
        for seed in range(count)])


def zero_crossing_period(times, record):
    upward = np.flatnonzero((record[:-1] < 0) & (record[1:] >= 0))
    return (times[upward[-1]] - times[upward[0]]) / (len(upward) - 1)


@pytest.mark.parametrize('spectrum', [*SPECTRA, Jonswap(4.0, 12.0, 6.0)])
def test_spectrum_integrates_to_the_significant_height(spectrum):
    peak = spectrum.peak
    m0 = sum(quad(spectrum.density, a * peak, b * peak, limit=200)[0]
             for a, b in ((0.1, 0.8), (0.8, 1.2), (1.2, 5), (5, 200)))
    share = 1.870 / 1.875 if isinstance(spectrum, Pan2020) else 1.0  # the paper's own figure
    assert 4 * sqrt(m0) == pytest.approx(share * spectrum.height, rel=5e-4)


@pytest.mark.parametrize('spectrum', SPECTRA)
def test_density_is_highest_at_the_peak(spectrum):
    omega = spectrum.peak * np.linspace(0.5, 2, 3001)
    assert omega[np.argmax(spectrum.density(omega))] == pytest.approx(spectrum.peak, rel=2e-3)


def test_spectra_agree_with_waveresponse():
    omega = np.linspace(0.2, 3, 500)
    _, pm = waveresponse.ModifiedPiersonMoskowitz(omega)(3.25, 9.7)
    np.testing.assert_allclose(Bretschneider(3.25, 9.7).density(omega), pm, rtol=1e-9, atol=1e-12)
    _, jonswap = waveresponse.JONSWAP(omega)(2.0, 7.0, 3.3)
    ours = Jonswap(2.0, 7.0, 3.3).density(omega)
    np.testing.assert_allclose(ours, jonswap, rtol=0.02, atol=1e-9)  # its scale is a fit to ours
    tall = jonswap > 1e-6
    assert np.ptp(ours[tall] / jonswap[tall]) < 1e-6


@pytest.mark.parametrize('exponent', [1, 4])
def test_spreading_agrees_with_waveresponse(exponent):
    angle = np.linspace(-1.2, 1.2, 41)
    density = waveresponse.CosineHalfSpreading(exponent)
    share = np.array([quad(lambda a: density(0.1, a), -pi / 2, x)[0] for x in angle])
    turned = WaveSystem(SPECTRA[0], 1.0, 2.0 * exponent).directions(share)
    np.testing.assert_allclose(turned - 1.0, angle, atol=1e-4)


def test_long_crested_waves_have_one_direction():
    waves = random_waves(WaveSystem(SPECTRA[0], 0.7, 0.0), 50, np.random.default_rng(0))
    assert set(waves.direction) == {0.7}
    assert set(dense_waves(WaveSystem(SPECTRA[0], 0.7, 0.0), 20).direction) == {0.7}


@pytest.mark.parametrize('spectrum', SPECTRA)
def test_record_has_height_and_zero_crossing_period(spectrum):
    times, records = hours_of(spectrum)
    assert 4 * records.std() == pytest.approx(spectrum.height, rel=0.03)
    omega = spectrum.peak * np.linspace(0.3, 6, 20001)  # the band a sea is made of
    density = spectrum.density(omega)
    period = 2 * pi * sqrt(density.sum() / (density * omega**2).sum())
    measured = [zero_crossing_period(times, record) for record in records]
    assert np.mean(measured) == pytest.approx(period, rel=0.03)


@pytest.mark.parametrize('spectrum', SPECTRA)
def test_record_has_the_spectrum(spectrum):
    frequency, density = welch(hours_of(spectrum)[1], fs=2.0, nperseg=512)
    measured, omega = density.mean(axis=0) / (2 * pi), 2 * pi * frequency
    expected = spectrum.density(omega[1:])
    inside = expected > 0.1 * expected.max()
    ratio = measured[1:][inside] / expected[inside]
    assert len(ratio) > 10
    assert ratio.mean() == pytest.approx(1, abs=0.06)
    assert ratio.std() < 0.2  # what 108 overlapping stretches leave, and the window's leakage


def test_phases_are_uniform_on_the_whole_circle():
    waves = random_waves(WaveSystem(SPECTRA[0], 0.0), 4000, np.random.default_rng(5))
    assert stats.kstest(waves.phase / (2 * pi), 'uniform').pvalue > 0.01


def test_directions_are_spread_at_every_frequency():
    waves = random_waves(WaveSystem(SPECTRA[0], 0.0), 600, np.random.default_rng(6))
    for first in range(0, 600, 50):  # E[cos^2] under cos^2 is 3/4
        assert np.mean(np.cos(waves.direction[first:first + 50])**2) == pytest.approx(
            0.75, abs=0.03)


def test_nothing_repeats_within_an_hour():
    record = hours_of(Bretschneider(3.25, 9.7), 1)[1][0]
    spectrum = np.abs(np.fft.rfft(record, 2 * len(record)))**2
    lagged = np.fft.irfft(spectrum)[:len(record)]
    lagged /= lagged[0] * (1 - np.arange(len(record)) / len(record))
    assert np.abs(lagged[2 * 120:2 * 2700]).max() < 0.3  # a repetition would show as 1


def test_sea_has_height_whatever_the_number_of_waves():
    for count in (10, 100, 2000):
        waves = random_waves(WaveSystem(SPECTRA[0], 0.0), count, np.random.default_rng(7))
        assert 4 * sqrt(np.sum(waves.amplitude**2) / 2) == pytest.approx(3.25, rel=1e-3)


def test_swell_adds_its_energy():
    rng = np.random.default_rng(8)
    sea = joined([random_waves(WaveSystem(Bretschneider(3.0, 8.0), 0.0), 300, rng),
                  random_waves(WaveSystem(Jonswap(4.0, 14.0, 6.0), 2.0, 20.0), 300, rng)])
    assert 4 * sqrt(np.sum(sea.amplitude**2) / 2) == pytest.approx(5.0, rel=1e-3)


def test_random_and_dense_waves_agree():
    system = WaveSystem(SPECTRA[0], 0.4)
    moments = []
    for waves in (random_waves(system, 600, np.random.default_rng(9)), dense_waves(system)):
        power = waves.amplitude**2 / 2
        moments.append([power @ waves.omega, power @ np.cos(waves.direction),
                        power @ np.sin(waves.direction)])
    np.testing.assert_allclose(moments[0], moments[1], rtol=0.02)


@pytest.mark.parametrize('heading, expected', [
    (180.0, 0.628319 + 0.402570), (0.0, 0.628319 - 0.402570), (90.0, 0.628319)])
def test_moving_observer_meets_waves_at_the_encounter_frequency(heading, expected):
    # by hand: T = 10 s, k = omega^2 / g = 0.0402570 rad/m; 10 m/s northwards
    towards = pi / 2 + np.radians(heading)
    waves = Waves(np.array([1.0]), np.array([2 * pi / 10]), np.array([towards]), np.array([0.4]))
    times = np.arange(0, 4000, 0.25)
    record = waves.elevation(times, np.stack([0 * times, 10 * times], axis=1))
    assert 2 * pi / zero_crossing_period(times, record) == pytest.approx(expected, rel=1e-4)


def test_crests_travel_where_they_are_said_to():
    waves = Waves(np.ones(1), np.ones(1), np.array([pi / 2]), np.zeros(1))  # crest at the origin
    later = np.array([0.1])
    ahead, behind = (float(waves.elevation(later, np.array([[0.0, y]]))[0]) for y in (1.0, -1.0))
    assert ahead > behind  # a moment later the crest lies to the north

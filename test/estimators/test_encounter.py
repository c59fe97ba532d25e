"""The encounter spectrum and the wave states against the ITTC form and hand calculations."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

from deck_motion_ros.estimators.encounter import EncounterSea, wave_model
from deck_motion_ros.simulation.sea import Bretschneider, dense_waves, WaveSystem

SEA = EncounterSea(7.5, 11.6, 60.0, pi)


def test_at_rest_it_is_the_spectrum_of_the_ittc():
    """Against the simulator's own form, by peak period instead of mean period."""
    edges = np.linspace(0.15, 2.0, 120)
    centres = (edges[1:] + edges[:-1]) / 2
    ours = replace(SEA, speed=0.0).density(edges)
    theirs = Bretschneider(7.5, 2 * pi / SEA.peak).density(centres)
    assert ours == pytest.approx(theirs, abs=0.02 * theirs.max())
    assert SEA.peak == pytest.approx(2 * pi / (1.2958 * 11.6), rel=1e-4)


@pytest.mark.parametrize('heading, expected', [
    (pi, 0.41804 + 1.06926), (pi / 2, 0.41804), (0.0, 1.06926 - 0.41804)])
def test_the_peak_is_met_where_it_should_be(heading, expected):
    """By hand: w = 0.41804 rad/s, w^2 V / g = 1.06926 rad/s."""
    narrow = EncounterSea(7.5, 11.6, 60.0, heading)
    omega, var = narrow.lines
    at_peak = omega[np.argmin(np.abs(narrow.peak * np.geomspace(0.3, 6, len(omega)) - 0.41804))]
    assert at_peak == pytest.approx(expected, rel=2e-3)
    assert var.sum() == pytest.approx(7.5**2 / 16)


@pytest.mark.parametrize('spreading', [0.0, 2.0])
def test_autocovariance_is_that_of_the_simulated_sea(spreading):
    sea = EncounterSea(4.0, 8.0, 30.0, 2.0, spreading)
    waves = dense_waves(WaveSystem(Bretschneider(4.0, 2 * pi / sea.peak), 2.0, spreading), 400, 60)
    met = waves.omega - 30.0 * waves.vectors[0]
    lags = np.linspace(0.0, 20.0, 60)
    expected = np.cos(np.outer(lags, met)) @ (waves.amplitude**2 / 2)
    assert sea.autocovariance(lags) == pytest.approx(expected, abs=0.012)


def test_correlation_time_is_the_integral_over_the_lags():
    lags = np.arange(0.0, 100.0, 0.05)
    rho = SEA.autocovariance(lags) / SEA.var
    integral = 2 * 0.05 * (np.sum(rho**2) - 0.5)
    assert SEA.correlation_time == pytest.approx(integral, rel=0.03)


@pytest.mark.parametrize('sea', [
    SEA, replace(SEA, heading=pi / 2), replace(SEA, speed=300.0),
    EncounterSea(1.88, 6.8, 60.0, pi, 2.0), EncounterSea(3.25, 7.5, 0.0, pi)])
def test_wave_states_have_the_spectrum(sea):
    model = wave_model(sea, 3)
    edges = sea.middle * np.geomspace(0.3, 3.0, 60)
    centres, true = np.sqrt(edges[1:] * edges[:-1]), sea.density(edges)
    inside = true > 0.2 * true.max()
    apart = np.log(model.spectrum(centres)[inside] / true[inside])
    assert np.mean(apart) == pytest.approx(0, abs=0.15)
    assert np.std(apart) < 0.5
    total = sum(quad(model.spectrum, a * sea.middle, b * sea.middle, limit=300)[0]
                for a, b in ((0, 0.5), (0.5, 1), (1, 2), (2, 2000)))
    assert total == pytest.approx(sea.var, rel=2e-3)


def test_wave_states_have_the_autocovariance():
    model, k = wave_model(SEA), wave_model(SEA).order
    lags = np.linspace(0.0, 4.0, 30)
    ours = [(expm(model.mat_a * lag) @ model.stationary)[k, k] for lag in lags]
    assert ours == pytest.approx(SEA.autocovariance(lags), abs=0.12 * SEA.var)


def test_stationary_covariance_solves_the_lyapunov_equation():
    model = wave_model(SEA)
    drift = model.mat_a @ model.stationary
    noise = np.zeros((4, 4))
    noise[3, 3] = model.intensity
    assert drift + drift.T == pytest.approx(-noise, abs=1e-9 * np.abs(drift).max())
    assert sqrt(model.stationary[model.order, model.order]) == pytest.approx(7.5 / 4)


def test_a_sea_met_at_all_frequencies_has_another_order():
    """Abeam and short-crested, half of the waves run ahead: the density does not fall at 0."""
    assert wave_model(SEA).order == 3
    assert wave_model(EncounterSea(7.5, 11.6, 60.0, pi / 2, 2.0)).order < 3

"""Ship and sea fitted to their motion: against the simulator's hull, known seas and turns."""

import numpy as np
import pytest

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.resampling import Grid
from deck_motion_ros.estimators.seakeeping import (
    BELIEF,
    block_toeplitz,
    HEADING,
    LENGTH,
    PERIOD,
    responses,
    SeakeepingFit,
    SPEED,
)
from deck_motion_ros.samples import HEAVE, PITCH, ROLL
from deck_motion_ros.simulation.ship import Hull, transfer_functions
from deck_motion_ros.simulation.simulator import ship_in_waves, SimulatorConfig

AXES = (ROLL, PITCH, HEAVE)
SHIP = [3, 4, 2]  # the same in what the simulator gives
NOISE_SD = np.array([5e-4, 5e-4, 0.05])
GRID = Grid(0.5, 1, 0.0)


def sailed(seconds, rate, seed=1, **config):
    """Return times, measured and true roll, pitch, heave, and yaw of a destroyer at sea."""
    times = np.arange(0, seconds, 1 / rate)
    motion = ship_in_waves(SimulatorConfig(
        hull='destroyer', significant_wave_height=3.25, peak_period=9.7, speed=7.5, seed=seed,
        **config)).motion(times)
    truth = motion.value[:, SHIP]
    noise = NOISE_SD * np.random.default_rng(seed).standard_normal(truth.shape)
    return times, truth + noise, truth, motion.track.yaw + motion.value[:, 5]


def fitted(record, grid=GRID, axes=AXES):
    fit = SeakeepingFit(axes, grid)
    record = record[:, list(axes)] - record[:, list(axes)].mean(axis=0)
    for end in range(fit.order + 3, len(record) + 1, 3):
        fit.learn(record[end - 3 - fit.order:end], np.ones(3, bool))
        fit.improve(NOISE_SD[list(axes)]**2)
    return fit


@pytest.fixture(scope='module')
def bow_sea():
    return fitted(sailed(240, 2)[1])


def test_responses_are_those_of_a_hull_of_usual_proportions():
    params = BELIEF[None, :, 0] + 0.0
    params[0, [LENGTH, HEADING, SPEED]] = np.log(200.0), 2.5, 9.0
    omega, response = responses(params, 6, 5)
    hull = Hull(200.0, 200 / 7.3, 200 / 23.5, 0.53, 11 * (200 / 130)**0.7, 0.07)
    wave = np.repeat(2 * np.pi / 9 * np.geomspace(0.45, 4, 6), 5)
    heading = 2.5 + np.tile(np.array([-0.4, -0.2, 0, 0.2, 0.4]) * np.pi, 6)
    exact = transfer_functions(hull, wave, heading, np.array(9.0))[SHIP]
    np.testing.assert_allclose(omega[0], wave - wave**2 / 9.80665 * 9 * np.cos(heading))
    np.testing.assert_allclose(response[0] / response[0, HEAVE], exact / exact[HEAVE])


def test_finds_ship_and_sea(bow_sea):
    params = bow_sea.params
    assert np.exp(params[LENGTH]) == pytest.approx(142, rel=0.2)
    assert np.exp(params[PERIOD]) == pytest.approx(9.7, rel=0.15)
    off = np.degrees(params[HEADING]) - 135  # the simulator's default: from the starboard bow
    assert abs((off + 180) % 360 - 180) < 30


def test_expects_what_comes(bow_sea):
    record = sailed(240, 2)[1]
    expected = bow_sea.expected(1, samples=10.0)
    assert expected.shape == (7, 6)
    np.testing.assert_array_equal(expected[-1], 10.0)
    np.testing.assert_allclose(expected[:-1], expected[:-1].T, atol=1e-12)
    assert np.linalg.eigvalsh(expected[:-1]).min() > 0
    sd = np.sqrt(np.diag(expected)[:3] / 10)
    np.testing.assert_allclose(sd, record.std(axis=0), rtol=0.3)


def test_block_toeplitz_by_hand():
    covs = np.arange(8.0).reshape(1, 2, 2, 2)  # E[y(t) y(t)'], E[y(t + 1) y(t)']
    now, later = covs[0]
    np.testing.assert_array_equal(block_toeplitz(covs)[0],
                                  np.block([[now, later], [later.T, now]]))


def test_a_turn_of_the_ship_turns_the_sea_the_other_way(bow_sea):
    before = bow_sea.params[HEADING]
    for heading in (1.0, 1.2, 1.5):
        bow_sea.head(heading)
    assert bow_sea.params[HEADING] == pytest.approx(before - 0.5)


def test_a_turn_counts_alike_however_slow_and_swinging_counts_nothing():
    def kept(headings):
        fit = SeakeepingFit(AXES, GRID)
        return np.prod([fit.head(heading) for heading in headings])

    quarter = np.pi / 2
    quick, slow = (kept(np.append(np.linspace(0, quarter, steps), np.full(20, quarter)))
                   for steps in (3, 20))
    assert quick < 1e-3 and slow < 1e-3
    assert kept(0.04 * np.sin(np.arange(100))) == 1


@pytest.mark.parametrize('axes', [(HEAVE,), (ROLL, PITCH)])
def test_is_content_with_the_axes_that_come(axes):
    assert np.isfinite(fitted(sailed(120, 2)[1], axes=axes).expected(4, 1.0)).all()


@pytest.mark.parametrize('record', [
    np.zeros((200, 3)),
    np.tile([0.0, 0.0, 3.0], (200, 1)) * (np.arange(200)[:, None] > 100),
    np.random.default_rng(5).standard_normal((200, 3)) * (10.0, 1e-9, 1e3),
], ids=['dead', 'step', 'noise'])
def test_what_is_no_motion_does_no_harm(record):
    expected = fitted(record).expected(4, 1.0)
    assert expected is None or np.isfinite(expected).all()


def test_knows_the_sea_after_a_turn():
    times, measured, truth, yaw = sailed(540, 4, course_deg=90.0, turn_to_deg=180.0,
                                         turn_time=240.0)

    def rms_after(heading_known):
        predictor, errors = AdaptivePredictor(), []
        for k, time in enumerate(times.tolist()):
            if heading_known:
                predictor.head(time, float(yaw[k]))
            for axis in AXES:
                predictor.measure(axis, time, float(measured[k, axis]), float(NOISE_SD[axis]**2))
            if time > 375 and k % 4 == 0 and k + 12 < len(times):
                errors.append(np.array(predictor.outlook().mean(time + 3)) - truth[k + 12])
        return np.sqrt(np.mean(np.square(errors), axis=0)) / truth.std(axis=0)

    known, unknown = rms_after(True), rms_after(False)
    assert known.sum() < unknown.sum()
    assert known.max() < 0.3

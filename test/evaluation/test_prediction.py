"""The match of predictors and floor: fair, the same for all, and frozen."""

from dataclasses import replace
from zlib import crc32

import numpy as np
import pytest

from deck_motion_ros.evaluation import prediction
from deck_motion_ros.evaluation.prediction import (
    HORIZONS,
    METHODS,
    recording_scores,
    scenario_scores,
    simulated,
    simulator_config,
)
from deck_motion_ros.geometry import rpy_from_quaternion
from deck_motion_ros.scenarios import PREDICTION_SCENARIOS
from deck_motion_ros.simulation.simulator import ShipSimulator

BY_NAME = {case.name: case for case in PREDICTION_SCENARIOS}
# five minutes to score, then a change of speed; shorter ones favour anybody by chance
SHORT = replace(BY_NAME['destroyer_ss5_slowing'], dt=0.5, duration=750.0, manoeuvre_at=600.0,
                speed_to=7.0)


def test_the_scenarios_are_frozen():
    assert len(BY_NAME) == len(PREDICTION_SCENARIOS) == 12
    # never edited, only succeeded: another sea goes by another name
    assert crc32(repr(PREDICTION_SCENARIOS).encode()) == 2367879526


def test_the_scenarios_are_what_the_match_asks_for():
    steady = [case for case in PREDICTION_SCENARIOS if case.stationary]
    assert {case.hull for case in steady} == {'destroyer', 'cvn65', 'patrol'}
    assert {case.sea_state for case in steady} == {3, 4, 5, 6}
    assert len({case.heading_deg for case in steady}) >= 5
    assert len({case.seed for case in PREDICTION_SCENARIOS}) == len(PREDICTION_SCENARIOS)
    others = [case for case in PREDICTION_SCENARIOS if not case.stationary]
    assert sorted((case.turn_deg or 0.0, case.speed_to or 0.0, case.noise, case.spreading)
                  for case in others) == [
        (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 10.0, 2.0), (0.0, 2.5, 1.0, 2.0), (90.0, 0.0, 1.0, 2.0)]


@pytest.mark.parametrize('name', ['destroyer_ss5_turn_90', 'destroyer_ss5_slowing'])
def test_a_record_is_what_the_simulators_sensors_say(name):
    case = replace(BY_NAME[name], duration=40.0, manoeuvre_at=10.0, noise=0.0, waves=50)
    times, truth, measured, yaw = simulated(case)
    np.testing.assert_array_equal(truth, measured)
    said = {topic: [] for topic in ('ship/imu', 'ship/heave', 'ship/truth')}
    for event in ShipSimulator(simulator_config(case)):
        said[event.topic].append(event.sample)
    assert len(said['ship/imu']) == len(times) == 400
    attitude = np.array([rpy_from_quaternion(sample.orientation) for sample in said['ship/imu']])
    np.testing.assert_allclose(measured[:, :2], attitude[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * yaw), np.exp(1j * attitude[:, 2]), atol=0.01)  # noisy
    np.testing.assert_allclose(measured[:, 2], [item.height for item in said['ship/heave']],
                               atol=1e-9)


def test_noise_is_white_and_as_large_as_the_scenario_says():
    case = replace(BY_NAME['destroyer_ss5_noise_x10'], duration=400.0, waves=20)
    _, truth, measured, _ = simulated(case)
    noise = measured - truth
    np.testing.assert_allclose(noise.std(axis=0), 10 * np.array(case.white_sd), rtol=0.05)
    assert abs(np.corrcoef(noise[1:, 2], noise[:-1, 2])[0, 1]) < 0.05


@pytest.fixture(scope='module')
def short():
    """Score a few minutes at 2 Hz with a change of speed on the way."""
    return scenario_scores(SHORT)


def test_nobody_beats_the_floor(short):
    before = short.windows.index('before')
    for method in METHODS:
        if method != 'zero':  # at 10 s a short record may by chance favour it
            assert np.all(short.rmse[method][before, :4] > 0.97 * short.floor[before, :4]), method


def test_windows_follow_the_manoeuvre(short):
    assert short.windows == ('before', 'during', 'first 2 min after', '2-5 min after', 'later')
    known = np.isfinite(short.floor)
    assert known[[0, 2]].all() and not known[[1, 4]].any()  # it ends after 750 s
    assert np.isfinite(short.rmse['adaptive'][:3]).all()


def test_scores_are_those_of_the_truth(short):
    times, truth, measured, _ = simulated(SHORT)
    lever = np.array([0.0, 55.0, 1.0])
    chosen = (times >= 615.0) & (times < 735.0)  # 1.5 * 0.5 / 0.05 s long
    for column, steps in enumerate((2, 4, 6)):
        there = np.flatnonzero(chosen[:-steps])
        there = there[there + steps < len(times)]
        stay = measured[there] @ lever - truth[there + steps] @ lever
        assert short.rmse['persistence'][2, column] == pytest.approx(np.sqrt(np.mean(stay**2)))
        zero = np.sqrt(np.mean((truth[there + steps] @ lever)**2))
        assert short.rmse['zero'][2, column] == pytest.approx(zero)
    assert short.sd == pytest.approx(np.std(truth @ lever))


def test_coverage_grows_with_the_interval_and_costs_are_those_of_every_method(short):
    assert np.all(short.coverage[1, :3] >= short.coverage[0, :3])
    assert np.all((short.coverage[:, 0] > 0.3) & (short.coverage[:, 0] <= 1.0))
    assert short.cost.keys() == short.rmse.keys() == METHODS.keys()
    assert all(0 < mean <= worst for mean, worst in short.cost.values())


def test_nobody_sees_the_future():
    times = np.arange(0.0, 100.0, 0.5)
    record = np.random.default_rng(1).standard_normal((200, 3)).cumsum(axis=0) / 30
    due = [time in (60.0, 80.0) for time in times]
    changed = record.copy()
    changed[times > 60.0] += 1.0
    for method in METHODS:
        one, other = (prediction.followed(method, times, values, (1e-4,) * 3, due).mean
                      for values in (record, changed))
        np.testing.assert_array_equal(one[0], other[0])
        assert method == 'zero' or np.abs(one[1] - other[1]).max() > 0.01


def test_a_recording_is_scored_by_itself(data_dir):
    file = data_dir / 'ship' / 'nbp_20140801_seapath330.csv'
    scores = {item.quantity: item for item in recording_scores('palmer', file)}
    assert list(scores) == ['roll', 'pitch', 'heave', '35 m aft']
    rows = np.genfromtxt(file, delimiter=',', names=True)
    heave, pitch = rows['heave_m'], -np.radians(rows['pitch_deg'])
    aft = heave + 35 * pitch  # bow down lifts the stern
    begun = rows['t_s'] - rows['t_s'][0] >= 120.0
    for name, values in (('heave', heave), ('35 m aft', aft)):
        item = scores[name]
        assert item.sd == pytest.approx(values[begun].std(), rel=1e-3)
        stay = (values[3:] - values[:-3])[begun[:-3]]
        assert item.rmse['persistence'][0, HORIZONS.index(3.0)] == pytest.approx(
            np.sqrt(np.mean(stay**2)), rel=1e-2)
        assert np.all(np.diff(item.floor[0]) > 0)
        assert np.all(item.floor < item.rmse['adaptive'])

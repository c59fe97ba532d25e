"""What bad input does to the adaptive predictor: some faults of the table, a shorter voyage."""

from math import inf, isnan

import numpy as np
import pytest

from deck_motion_ros.evaluation.recovery import faults, recoveries, RecoveryScenario, voyage
from deck_motion_ros.samples import HEAVE, PITCH

CASE = RecoveryScenario(duration=420.0, start=270.0, passing=30.0)


@pytest.fixture(scope='module')
def found():
    names = ('outliers, 1 % at 10 sd', 'all axes constant', 'no roll and pitch')
    return {item.fault: item for item in recoveries(CASE, names)}


def test_outliers_are_hardly_felt(found):
    fault = found['outliers, 1 % at 10 sd']
    assert fault.seconds < 5 and fault.worst < 6


@pytest.mark.parametrize('name', ['all axes constant', 'no roll and pitch'])
def test_what_passes_is_over_soon_and_the_promise_said_so(found, name):
    assert found[name].seconds < 60
    assert found[name].covered > 0.75 and not isnan(found[name].worst)


def test_the_sensor_measures_the_truth_until_it_fails():
    case = RecoveryScenario(duration=60.0)
    times, measured, truth = voyage(case)
    assert len(times) == 240 and np.isfinite(truth).all()
    assert np.all((measured - truth).std(axis=0) < 0.1 * truth.std(axis=0))
    rng = np.random.default_rng(1)
    for name, fault in faults(case).items():
        bad, true = measured.copy(), truth.copy()
        fault.spoil(bad, true, rng)
        rests = fault.duration == inf and 'outliers' not in name
        assert np.array_equal(true, truth) != rests, name
        assert not np.array_equal(bad, measured), name
    bad, true = measured.copy(), truth.copy()
    faults(case)['sign of pitch flipped'].spoil(bad, true, rng)
    np.testing.assert_array_equal(bad[:, PITCH], -measured[:, PITCH])
    np.testing.assert_array_equal(bad[:, HEAVE], measured[:, HEAVE])

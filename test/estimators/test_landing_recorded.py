"""The landing estimator on recorded ranges: better than those who recorded them."""

import pytest

from deck_motion_ros.evaluation.recorded_ranges import recorded_ranges


@pytest.fixture(scope='module')
def figures(data_dir):
    return {(row.paper, row.name): row.value for row in recorded_ranges(data_dir / 'uwb')}


@pytest.mark.parametrize('case', ['a', 'b'])
def test_hanyang_line_of_sight(figures, case):
    error, said = (figures['Hanyang', f'{what}_{case}'] for what in ('rmse', 'sd'))
    assert error < 1.4
    assert 0.5 < said / error < 2.0


@pytest.mark.parametrize(('case', 'limit'), [('a', 1.1), ('b', 0.6)])
def test_hanyang_with_the_radio_above_the_truth(figures, case, limit):
    error, said = (figures['Hanyang', f'{what}_{case}_radio'] for what in ('rmse', 'sd'))
    assert error < limit
    assert 0.5 < said / error < 2.0


def test_plaza_with_scale_and_bias(figures):
    error, said = (figures['Plaza1', f'{what}_after_300s'] for what in ('rmse', 'sd'))
    assert error < 1.0
    assert 0.5 < said / error < 2.0

"""The bench of predictors: every method on every record, sums that are those of the scores."""

from dataclasses import replace
import sys

import numpy as np
import pytest

from deck_motion_ros.bench.prediction import figures, scored, tables
from deck_motion_ros.evaluation.prediction import (
    AFTER,
    HORIZONS,
    METHODS,
    scenario_scores,
    Scores,
    STEADY,
)
from deck_motion_ros.scenarios import PREDICTION_SCENARIOS


def made(rng, record, windows, stationary, quantity='height'):
    shape = (len(windows), len(HORIZONS))
    return Scores(
        record, quantity, stationary, tuple(windows), 2.0,
        {method: rng.uniform(1, 2, shape) for method in METHODS}, rng.uniform(0.5, 1, shape),
        rng.uniform(0.9, 1, (2, *shape)), rng.normal(size=10),
        dict.fromkeys(METHODS, (1e-4, 1e-3)))


@pytest.fixture
def scores():
    rng = np.random.default_rng(1)
    return [
        *(made(rng, case.name, ['before', 'during', *AFTER] if case.turn_deg or case.speed_to
               else STEADY, case.stationary) for case in PREDICTION_SCENARIOS),
        *(made(rng, 'palmer_seapath330', ['from minute 2 on'], False, quantity)
          for quantity in ('roll', 'pitch', 'heave', '35 m aft'))]


def test_figures_are_those_of_the_scores(scores):
    by_name = {figure.name: figure for figure in figures(scores)}
    assert len(by_name) == len(list(figures(scores)))  # every name once
    assert all(np.isfinite(figure.value) for figure in by_name.values())
    steady = [item for item in scores if item.stationary]
    by_hand = np.mean([item.rmse['adaptive'][2, 2] / item.floor[2, 2] for item in steady])
    figure = by_name['adaptive ratio to floor 3 s, minutes 5-10, mean of stationary scenarios']
    assert figure.value == pytest.approx(by_hand) and figure.goal == '<= 1.3'
    by_hand = np.mean([np.sqrt((item.rmse['AR(30)'][3:, 4]**2).sum()
                               / (item.floor[3:, 4]**2).sum()) for item in steady])
    figure = by_name['AR(30) ratio to floor 8 s, minutes 10-30, mean of stationary scenarios']
    assert figure.value == pytest.approx(by_hand) and not figure.headline
    aft = scores[-1]
    figure = by_name['adaptive error 3 s, palmer_seapath330 35 m aft']
    assert figure.value == aft.rmse['adaptive'][0, 2] and figure.goal == '<= 0.36'
    turn = by_name['adaptive ratio to floor 3 s, first 2 min after, destroyer_ss5_turn_90']
    assert turn.goal == '<= 1.35'


def test_tables_hold_everybody(scores):
    text = tables(scores)
    parts = text.split('\n\n')
    for part in parts:
        lines = part.splitlines()
        assert len({len(line) for line in lines}) == 1  # columns stand below each other
        assert lines[0].startswith('| adaptive') or all(f' {method} |' in lines[0]
                                                         for method in METHODS)
    assert all(case.name in text for case in PREDICTION_SCENARIOS)
    assert 'palmer_seapath330 35 m aft' in text and 'estimated floor' in text
    assert 'estimated' not in tables(scores[:-4])


def test_says_so_where_there_are_no_recordings(monkeypatch, tmp_path, scores):
    module = sys.modules[figures.__module__]
    monkeypatch.setenv('DECK_MOTION_DATA', str(tmp_path / 'nowhere'))
    monkeypatch.setattr(module, 'scored', lambda folder: iter([1.0, scores[:-4]]))
    remark, share, text, *found = module.prediction()
    assert 'no recordings' in remark and 'nowhere' in remark and share == 1.0
    assert text == tables(scores[:-4]) and found == list(figures(scores[:-4]))


def test_runs_on_all_cores_and_gives_what_one_gives_alone():
    case = replace(PREDICTION_SCENARIOS[0], duration=130.0, dt=0.5, waves=100)
    *shares, (there, again) = scored([case, replace(case, name='again')])
    assert shares == [0.5, 1.0]
    assert (there.record, again.record) == (case.name, 'again')
    alone = scenario_scores(case)
    for method in METHODS:
        np.testing.assert_allclose(there.rmse[method], alone.rmse[method], rtol=1e-6)
        np.testing.assert_array_equal(there.rmse[method], again.rmse[method])

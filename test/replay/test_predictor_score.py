"""The predictor's score on /diagnostics: against the metrics, in any order, in plain words."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deck_motion_ros.config import configured
from deck_motion_ros.estimators.scoring import Score
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.messages import heave_message, imu_message
from deck_motion_ros.params_file import read_params_file
from deck_motion_ros.pipelines import PredictorPipeline
from deck_motion_ros.pipelines.score import score_status
from deck_motion_ros.recording import BagReader, BagTypes
from deck_motion_ros.replaying import replay
from deck_motion_ros.samples import HeaveSample, ImuSample, NANOSECONDS

BAGS = Path(__file__).resolve().parents[2] / 'bags'
START = 1_800_000_000 * NANOSECONDS
TYPES = BagTypes()
ZERO = (0.0, 0.0, 0.0)


def score_in(bag):
    """Return level, message and values of the last score in a bag."""
    reader = BagReader(bag)
    *_, last = (status for name, _, data in reader.messages(['/diagnostics'])
                for status in reader.decode(name, data).status
                if status.name == 'predictor: score')
    return last.level, last.message, {pair.key: pair.value for pair in last.values}


@pytest.mark.parametrize(('name', 'horizon'), [('destroyer_202611B', 3.0),
                                               ('patrol_202611D', 2.7)])
def test_score_in_a_replay_is_that_of_the_metrics(name, horizon, tmp_path):
    """The same horizons judged from the bag's messages, against measurements too."""
    params = read_params_file(BAGS / f'{name}.yaml', 'predictor') | {'horizon': horizon}
    replay(BAGS / name, tmp_path / 'out', 'predictor', params)
    level, message, values = score_in(tmp_path / 'out')
    assert level == 0 and f'{horizon:g} s ahead wrong by' in message
    assert values['window'] == '300 s' and 'noise' in values['compared_with']
    record = read_record(tmp_path / 'out')
    measured = record.was()
    checked = [*record.forecast['height'].against(measured, measured),
               *record.height.against(measured, measured)]
    for ahead in (1.0, 2.0, 3.0, 5.0, 8.0, 10.0, horizon):
        judged = next(item for item in checked if item.horizon == ahead)
        key = f'{ahead:g}s'
        assert int(values[f'forecasts_{key}']) == pytest.approx(
            len(np.unique(judged.issued_at // (NANOSECONDS // 2))), rel=0.05)
        assert float(values[f'rmse_{key}']) == pytest.approx(judged.rmse, rel=0.04)
        for rival, figure in (('persistence', judged.persistence), ('zero', judged.zero),
                              ('motion', judged.motion)):
            assert float(values[f'ratio_to_{rival}_{key}']) == pytest.approx(
                judged.rmse / figure, rel=0.04)
        # the noise of the sensor is allowed for, so that a little more is held
        assert -0.02 < float(values[f'coverage_95_{key}']) - judged.coverage(0.95) < 0.06
    assert 0 < float(values['useful_horizon']) < 10


def voyage(seconds, start=START, rate=10):
    """Give pairs of messages of one stamp."""
    rng = np.random.default_rng(4)
    for k in range(round(seconds * rate)):
        time, stamp = k / rate, start + k * NANOSECONDS // rate
        roll, pitch, heave = (np.sin(np.array([0.6, 0.7, 0.65]) * time) * (0.05, 0.02, 1.0)
                              + rng.normal(0, (0.0005, 0.0005, 0.02))).tolist()
        yield [('ship/imu', imu_message(TYPES, ImuSample(
            stamp, 'ship_base_link', quaternion_from_rpy(roll, pitch, 0.0), ZERO, ZERO, ZERO))),
            ('ship/heave', heave_message(TYPES, HeaveSample(stamp, 'ship_level', heave)))]


def fed(messages, pipeline=None, **params):
    """Feed a pipeline; return it and its score."""
    pipeline = pipeline or PredictorPipeline(
        configured(PredictorConfig, params), TYPES, lambda text: None)
    for topic, msg in messages:
        list(pipeline.take(topic, msg))
    return pipeline, next(status for status in pipeline.diagnostics()
                          if status[0] == 'predictor: score')


def test_order_within_a_stamp_changes_nothing():
    pairs = list(voyage(40))
    _, forwards = fed([item for pair in pairs for item in pair])
    _, backwards = fed([item for pair in pairs for item in pair[::-1]])
    assert forwards == backwards
    assert int(forwards[3]['forecasts_3s']) > 60


def test_a_clock_set_anew_starts_the_score_anew():
    pipeline, (_, _, _, values) = fed([item for pair in voyage(40) for item in pair])
    assert int(values['forecasts_1s']) > 60
    back = START - 3600 * NANOSECONDS
    _, (_, _, text, values) = fed([item for pair in voyage(10, back) for item in pair], pipeline)
    assert 0 < int(values['forecasts_1s']) < 20
    assert 'too early' in text


def test_one_axis_alone_is_scored_too():
    _, (_, _, _, values) = fed([pair[1] for pair in voyage(40)], lever_arm=[0.0, 0.0, 0.0])
    assert int(values['forecasts_10s']) > 50
    assert float(values['motion_sd']) == pytest.approx(0.7, rel=0.1)


def test_before_anything_came_true_nothing_is_claimed():
    level, text, values = fed([])[1][1:]
    assert level == 0 and 'too early' in text
    assert values['useful_horizon'] == values['rmse_3s'] == values['coverage_95_3s'] == ''


GOOD = Score(3.0, 600, rmse=0.2, persistence=1.5, zero=1.1, motion=1.0, noise=0.05,
             coverage_68=0.68, coverage_95=0.95)
FAR = replace(GOOD, horizon=10.0, rmse=0.8)


@pytest.mark.parametrize(('own', 'level', 'words'), [
    (GOOD, 0, '3 s ahead wrong by 0.20 m rms, the motion is 1.00 m; 95 % interval held 95 %; '
     'useful 6.5 s ahead'),
    (replace(GOOD, coverage_95=0.79), 1, 'allow a wider margin'),
    (replace(GOOD, rmse=1.11), 1, 'do not rely on the forecast'),
    (replace(GOOD, rmse=1.05), 0, 'not useful as far as 3 s ahead'),
    (replace(GOOD, rmse=2.0, coverage_95=0.1, number=59), 0, 'too early'),
    (replace(GOOD, rmse=0.06, motion=0.02), 0, 'calm: the motion is 0.02 m'),
    (replace(GOOD, rmse=0.0, motion=0.0, noise=0.0), 0, '95 % interval held 95 %')])
def test_words(own, level, words):
    name, found, text, values = score_status([own, FAR], 3.0, 300.0)
    assert (name, found) == ('predictor: score', level)
    assert words in text
    assert values['rmse_10s'] == '0.8'


def test_useful_at_every_horizon():
    text = score_status([GOOD, replace(FAR, rmse=0.4)], 3.0, 300.0)[2]
    assert 'useful 10.0 s ahead and beyond' in text

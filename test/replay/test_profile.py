"""A ship profile kept by one run warms the start of the next."""

import numpy as np
import pytest

from deck_motion_ros import messages
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.pipelines import PredictorPipeline
from deck_motion_ros.profile_file import load_profile
from deck_motion_ros.recording import BagTypes, BagWriter, encode
from deck_motion_ros.replaying import replay
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.simulator import ShipSimulator, SimulatorConfig
from deck_motion_ros.topics import BY_NAME

START = 10**18
TYPES = BagTypes()
BUILDERS = {'ship/imu': messages.imu_message, 'ship/heave': messages.heave_message}


def sailed(seed, duration, rate=5.0):
    """List (time, topic, message) of a simulated destroyer."""
    config = SimulatorConfig(seed=seed, rate=rate, duration=duration)
    return [(time, topic, BUILDERS[topic](TYPES, sample))
            for time, topic, sample in ShipSimulator(config, START) if topic in BUILDERS]


def predicted(voyage, warnings=None, **params):
    """Run the pipeline; return it and the heights by the time they are valid for."""
    warnings = [] if warnings is None else warnings
    pipeline = PredictorPipeline(PredictorConfig(lever_arm=(0.0, 0.0, 0.0), **params), TYPES,
                                 warnings.append)
    heights = {}
    for _, topic, msg in voyage:
        for out, made in pipeline.take(topic, msg):
            if out == 'touchdown/height':
                stamp = made.header.stamp
                heights[stamp.sec * NANOSECONDS + stamp.nanosec] = made.point.z
    return pipeline, heights


@pytest.fixture(scope='module')
def kept(tmp_path_factory):
    """Return the profile of five minutes."""
    path = tmp_path_factory.mktemp('ship') / 'ship.npz'
    pipeline, _ = predicted(sailed(1, 300.0), save_profile=str(path))
    pipeline.close()
    return path


def test_a_warm_start_is_better_than_a_cold_one(kept):
    voyage = sailed(2, 100.0)
    heave = {time: msg.point.z for time, topic, msg in voyage if topic == 'ship/heave'}
    error = {}
    for name, params in (('cold', {}), ('warm', {'profile': str(kept)})):
        _, heights = predicted(voyage, **params)
        missed = [height - heave[time] for time, height in heights.items()
                  if time in heave and time > START + 30 * NANOSECONDS]
        assert len(missed) > 300
        error[name] = np.sqrt(np.mean(np.square(missed)))
    assert error['warm'] < 0.7 * error['cold']


def test_it_is_saved_every_minute_of_stamps_and_at_the_end(tmp_path):
    path = tmp_path / 'ship.npz'
    params = {'save_profile': str(path), 'profile': str(path)}  # not there yet: a cold start
    voyage = sailed(1, 70.0)
    before = [item for item in voyage if item[0] < START + 59 * NANOSECONDS]
    predicted(before, **params)
    assert not path.exists()
    pipeline, _ = predicted(voyage, **params)
    at_sixty = load_profile(path)
    pipeline.close()
    at_the_end = load_profile(path)
    assert at_sixty['rival0'][-1, 0] < at_the_end['rival0'][-1, 0]


def test_replay_with_a_profile_gives_the_same_bits(kept, tmp_path):
    with BagWriter(tmp_path / 'in') as writer:
        for topic in BUILDERS:
            writer.add_topic(f'/{topic}', BY_NAME[topic].type)
        for time, topic, msg in sailed(3, 40.0):
            writer.write(f'/{topic}', time, encode(BY_NAME[topic].type, msg))
    kinds = {}
    for name, params in (('one', {'profile': str(kept)}), ('two', {'profile': str(kept)}),
                         ('cold', {})):
        saved = tmp_path / f'{name}.npz'
        replay(tmp_path / 'in', tmp_path / name, 'predictor',
               {**params, 'save_profile': str(saved)})
        kinds[name] = saved.read_bytes()
    assert kinds['one'] == kinds['two'] != kinds['cold']


def test_wrong_files_are_named(tmp_path):
    for params, words in (({'profile': 'nowhere.npz'}, 'nowhere.npz: there is no such'),
                          ({'save_profile': str(tmp_path / 'no' / 'x')}, 'no such folder')):
        with pytest.raises(ValueError, match=words):
            predicted([], **params)
    warnings = []
    pipeline, _ = predicted(sailed(1, 2.0), warnings, method='shaping', save_profile='x.npz')
    pipeline.close()
    assert warnings == ['method shaping has no ship profile: none is loaded or saved']


def test_a_full_disk_is_a_warning(tmp_path):
    path = tmp_path / 'ship'
    warnings = []
    pipeline, _ = predicted(sailed(1, 15.0), warnings, save_profile=str(path))
    path.mkdir()  # a folder cannot be replaced by a file
    pipeline.close()
    assert len(warnings) == 1 and 'not saved' in warnings[0]

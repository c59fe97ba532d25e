"""Replay: names, parameters, what is copied, what is refused."""

from math import radians

import pytest

from deck_motion_ros import messages
from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.names import absolute, remappings
from deck_motion_ros.recording import BagError, BagReader, BagTypes, BagWriter, encode
from deck_motion_ros.replaying import replay
from deck_motion_ros.samples import HeaveSample, ImuSample
from deck_motion_ros.topics import BY_NAME


def write_bag(folder, names=('/ship/imu', '/ship/heave'), seconds=10):
    """Write a calm ship at 10 Hz, bow 1 deg down, 0.5 m up."""
    types = BagTypes()
    level = quaternion_from_rpy(0.0, radians(1.0), 0.0)
    with BagWriter(folder) as writer:
        for name, kind in zip(names, ('ship/imu', 'ship/heave'), strict=True):
            writer.add_topic(name, BY_NAME[kind].type)
        for k in range(10 * seconds):
            stamp = 10**18 + k * 10**8
            imu = ImuSample(stamp, 'ship_base_link', level, (0.0,) * 3, (0.0,) * 3, (0, 0, 9.8))
            heave = HeaveSample(stamp, 'ship_level', 0.5)
            writer.write(names[0], stamp, encode(
                BY_NAME['ship/imu'].type, messages.imu_message(types, imu)))
            writer.write(names[1], stamp, encode(
                BY_NAME['ship/heave'].type, messages.heave_message(types, heave)))
    return folder


def last(bag, topic):
    reader = BagReader(bag)
    *_, (name, _, data) = reader.messages([topic])
    return reader.decode(name, data)


def test_bag_holds_inputs_and_outputs(tmp_path):
    done = replay(write_bag(tmp_path / 'in'), tmp_path / 'out', 'predictor',
                  {'lever_arm': [10.0, 0.0, 0.0]})
    counts = BagReader(tmp_path / 'out').counts
    assert counts['/ship/imu'] == counts['/ship/heave'] == counts['/touchdown/height'] == 100
    assert (done.inputs, done.outputs) == (200, 420)  # a window every 0.5 s
    assert done.seconds == pytest.approx(9.9)
    height = last(tmp_path / 'out', '/touchdown/height')
    assert height.point.z == pytest.approx(0.5 - 10 * radians(1.0), abs=0.02)  # bow down
    assert height.header.frame_id == 'touchdown_rest'


def test_replaying_a_replay_replaces_the_outputs(tmp_path):
    replay(write_bag(tmp_path / 'in'), tmp_path / 'out', 'predictor', {})
    replay(tmp_path / 'out', tmp_path / 'again', 'predictor', {'horizon': 5.0})
    first, second = BagReader(tmp_path / 'out'), BagReader(tmp_path / 'again')
    assert first.counts == second.counts
    stamp = last(tmp_path / 'again', '/touchdown/height').header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == 10**18 + 99 * 10**8 + 5 * 10**9


def test_namespace_and_remapping(tmp_path):
    write_bag(tmp_path / 'in', ('/palmer/ship/imu', '/mru/heave'))
    replay(tmp_path / 'in', tmp_path / 'out', 'predictor', {}, namespace='palmer',
           remap=['ship/heave:=/mru/heave', 'touchdown/height:=deck'])
    counts = BagReader(tmp_path / 'out').counts
    assert counts['/palmer/deck'] == counts['/palmer/touchdown/forecast'] == 100
    heard = last(tmp_path / 'out', '/diagnostics').status[0].values
    assert {'accepted ship/imu': '100', 'accepted ship/heave': '100'}.items() <= {
        pair.key: pair.value for pair in heard}.items()


def test_names_resolve_as_in_ros():
    assert remappings(['a:=b', '/c:=d'], '/ns') == {'/ns/a': '/ns/b', '/c': '/ns/d'}
    assert absolute('ship/imu') == '/ship/imu'
    with pytest.raises(ValueError, match='old:=new'):
        remappings(['a=b'])


@pytest.mark.parametrize('params, words', [
    ({'horizon': 99.0}, 'horizon'), ({'lever_arm': [1.0]}, 'lever_arm'),
    ({'method': 'x'}, 'method')])
def test_wrong_parameters_leave_nothing(tmp_path, params, words):
    write_bag(tmp_path / 'in')
    with pytest.raises(ValueError, match=words):
        replay(tmp_path / 'in', tmp_path / 'out', 'predictor', params)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['in']


def test_unknown_parameter_is_named_and_ignored(tmp_path):
    said = []
    replay(write_bag(tmp_path / 'in'), tmp_path / 'out', 'predictor',
           {'horizn': 3.0, 'use_sim_time': True}, warn=said.append)
    assert said == ["unknown parameter 'horizn' ignored"]


def test_bag_without_the_inputs_is_refused(tmp_path):
    write_bag(tmp_path / 'in', ('/a', '/b'))
    with pytest.raises(BagError, match='holds none of /ship/imu, /ship/heave'):
        replay(tmp_path / 'in', tmp_path / 'out', 'predictor', {})


def test_input_of_another_type_is_refused(tmp_path):
    write_bag(tmp_path / 'in', ('/ship/heave', '/ship/imu'))
    with pytest.raises(BagError, match='PointStamped, not sensor_msgs/msg/Imu'):
        replay(tmp_path / 'in', tmp_path / 'out', 'predictor', {})
    assert not (tmp_path / 'out').exists()

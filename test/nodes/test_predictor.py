"""The predictor node on real ROS 2: parameters, topics, numbers, diagnostics, its end."""

from collections import Counter
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from math import isnan
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402

from deck_motion_ros import messages  # noqa: E402
from deck_motion_ros.config import parameter, parameters  # noqa: E402
from deck_motion_ros.estimators.touchdown import PredictorConfig  # noqa: E402
from deck_motion_ros.geometry import quaternion_from_rpy  # noqa: E402
from deck_motion_ros.nodes.parameters import configuration  # noqa: E402
from deck_motion_ros.nodes.predictor import PredictorNode  # noqa: E402
from deck_motion_ros.nodes.shell import RclTypes  # noqa: E402
from deck_motion_ros.pipelines import PredictorPipeline  # noqa: E402
from deck_motion_ros.recording import BagTypes  # noqa: E402
from deck_motion_ros.samples import HeaveSample, ImuSample, OdometrySample  # noqa: E402
from deck_motion_ros.topics import inputs, outputs  # noqa: E402

RCL = RclTypes()
ZERO = (0.0, 0.0, 0.0)
START = 1_406_851_200_170_000_000
BUILDERS = {'ship/imu': messages.imu_message, 'ship/heave': messages.heave_message,
            'ship/odometry': messages.odometry_message}


def content(msg):
    """Turn a message of either backend into plain values, field by field."""
    if hasattr(msg, 'get_fields_and_field_types'):
        return {name: content(getattr(msg, name)) for name in msg.get_fields_and_field_types()}
    if is_dataclass(msg):
        return {item.name: content(getattr(msg, item.name)) for item in fields(msg)
                if item.name[0].islower()}  # neither type nor constants
    if isinstance(msg, (list, np.ndarray)) or type(msg).__name__ == 'array':
        return [content(item) for item in list(msg)]
    if isinstance(msg, bytes):
        return msg[0]
    return msg.item() if isinstance(msg, np.generic) else msg


def voyage(seed, seconds=40, rate=5):
    """Give (topic, sample) pairs of a ship at sea, the two topics of a stamp in any order."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 6, 3)
    for k in range(seconds * rate):
        t, stamp = k / rate, START + k * 10**9 // rate
        roll, pitch, heave = np.sin(np.array([0.5, 0.6, 0.55]) * t + phases) * (0.06, 0.02, 0.9)
        pair = [('ship/imu', ImuSample(stamp, 'ship_base_link', quaternion_from_rpy(
            float(roll), float(pitch), 1.0), ZERO, ZERO, (0.0, 0.0, 9.8))),
                ('ship/heave', HeaveSample(stamp, 'ship_level', float(heave)))]
        yield from pair[::int(rng.choice([-1, 1]))]


def with_trouble(samples):
    """Weave bad messages in, ones that are to be rejected and odd ones that are to be used."""
    samples = list(samples)
    late = samples[10][1].stamp
    bad = [
        ('ship/imu', ImuSample(late, 'ship_base_link', (0.0, 0.0, 0.0, 1.0), ZERO, ZERO, ZERO)),
        ('ship/heave', HeaveSample(samples[-1][1].stamp, 'ship_level', float('nan'))),
        ('ship/heave', HeaveSample(START + 3600 * 10**9, 'ship_level', 0.0)),
        ('ship/imu', ImuSample(samples[81][1].stamp, 'ship_base_link', None, ZERO, ZERO, ZERO)),
        ('ship/imu', ImuSample(samples[81][1].stamp, 'ship_base_link', (0.0, 0.0, 0.0, 7.0),
                               ZERO, ZERO, ZERO)),
        ('ship/heave', HeaveSample(samples[90][1].stamp, 'elsewhere', 5000.0))]
    mixed = samples[:80] + bad + samples[80:]
    topic, sample = mixed[100]
    frame = {'frame_id': 'elsewhere'}
    mixed[100] = topic, type(sample)(**{name: frame.get(name, getattr(sample, name))
                                        for name in sample.__slots__})
    return mixed


@pytest.fixture
def predictor(context, executor):
    """Return a function that makes a predictor node with the parameters given."""
    def make(namespace=None, cli_args=None, **values):
        node = PredictorNode(
            context=context, namespace=namespace, cli_args=cli_args, parameter_overrides=[
                Parameter(name.replace('__', '.'), value=value) for name, value in values.items()])
        executor.add_node(node)
        return node
    return make


class Sea:
    """A node that feeds one predictor step by step and hears what it says."""

    def __init__(self, context, executor, spin_until, node, prefix='/', names=None):
        self._node = rclpy.create_node(f'sea_{id(self)}', context=context)
        self._spin_until, self._predictor, self.heard, self.fed = spin_until, node, [], 0
        names = names or {}
        qos = QoSProfile(depth=1000)
        self._publishers = {topic.name: self._node.create_publisher(
            RCL[topic.type], prefix + names.get(topic.name, topic.name), qos)
            for topic in inputs('predictor')}
        for topic in outputs('predictor'):
            self._node.create_subscription(
                RCL[topic.type], prefix + names.get(topic.name, topic.name),
                partial(self._hear, topic.name), qos)
        executor.add_node(self._node)
        own = self._node
        spin_until(lambda: all(
            publisher.get_subscription_count() == 1 for publisher in self._publishers.values())
            and all(own.count_publishers(subscription.topic_name) == 1
                    for subscription in own.subscriptions))

    def _hear(self, topic, msg):
        self.heard.append((topic, content(msg)))

    def feed(self, topic, sample):
        """Publish one message and step until the predictor has taken it."""
        self._publishers[topic].publish(BUILDERS[topic](RCL, sample))
        self.fed += 1
        self._spin_until(lambda: taken(self._predictor) == self.fed)

    def hear_all(self, count):
        """Step until as many messages have come."""
        self._spin_until(lambda: len(self.heard) >= count)


@pytest.fixture
def sea(context, executor, spin_until):
    """Return a function that makes the :class:`Sea` round a predictor."""
    return partial(Sea, context, executor, spin_until)


def taken(node):
    """Count the messages that a predictor has accepted or rejected."""
    values = node.pipeline.diagnostics()[0][3]
    return sum(int(value) for key, value in values.items()
               if key.startswith(('accepted', 'rejected')))


def expected(samples, **values):
    """Give what the pure pipeline gives for the same messages in the same order."""
    pipeline = PredictorPipeline(PredictorConfig(**values), BagTypes(), lambda text: None)
    return [(name, content(msg)) for topic, sample in samples
            for name, msg in pipeline.take(topic, BUILDERS[topic](BagTypes(), sample))]


def by_topic(heard):
    """Order messages by topic; within one they keep their order."""
    return sorted(heard, key=lambda item: item[0])


def test_the_live_node_is_the_pure_pipeline_bit_for_bit(predictor, sea):
    samples = with_trouble(voyage(1))
    node = predictor(horizon=2.5)
    around = sea(node)
    for topic, sample in samples:
        around.feed(topic, sample)
    wanted = expected(samples, horizon=2.5)
    around.hear_all(len(wanted))
    assert len(wanted) == 4 * 200 + 80  # a window every 0.5 s
    assert by_topic(around.heard) == by_topic(wanted)


def test_the_height_is_published_first(predictor, sea):
    order = []
    node = predictor(window_output_rate=1000.0)
    for topic, publisher in node._publishers_by_topic.items():
        publisher.publish = partial(lambda topic, publish, msg: (order.append(topic),
                                                                 publish(msg)),
                                    topic, publisher.publish)
    around = sea(node)
    for topic, sample in voyage(2, seconds=1):
        around.feed(topic, sample)
    assert order == [topic.name for topic in outputs('predictor')] * 5
    assert order[0] == 'touchdown/height'


def test_odometry_alone(predictor, sea):
    samples = [('ship/odometry', OdometrySample(
        START + k * 10**8, 'ship_level', 'ship_base_link', (0.0, 0.0, 0.1 * k),
        quaternion_from_rpy(0.01 * k, 0.0, 0.0), ZERO, ZERO, (0.0,) * 6)) for k in range(10)]
    around = sea(predictor())
    for topic, sample in samples:
        around.feed(topic, sample)
    wanted = expected(samples)
    around.hear_all(len(wanted))
    assert by_topic(around.heard) == by_topic(wanted)
    assert len(wanted) == 4 * 10 + 3


def test_stamps_and_frames_of_the_contract(predictor, sea):
    around = sea(predictor(touchdown_frame='spot', touchdown_rest_frame='spot_rest',
                           window_output_rate=5.0))
    for topic, sample in voyage(3, seconds=1):
        around.feed(topic, sample)
    around.hear_all(25)
    headers = {(name, msg['header']['frame_id'], 10**9 * msg['header']['stamp']['sec']
                + msg['header']['stamp']['nanosec'] - START) for name, msg in around.heard}
    assert headers == {item for k in range(5) for item in (
        ('touchdown/height', 'spot_rest', k * 200_000_000 + 3 * 10**9),
        ('touchdown/prediction', 'ship_level', k * 200_000_000 + 3 * 10**9),
        ('touchdown/forecast', 'ship_level', k * 200_000_000),
        ('touchdown/forecast_sd', 'ship_level', k * 200_000_000),
        ('touchdown/window', '', k * 200_000_000))}
    assert {msg['child_frame_id'] for name, msg in around.heard
            if name == 'touchdown/prediction'} == {'spot'}


def test_two_ships_in_one_process_do_not_hear_each_other(predictor, sea):
    ships = {}
    for name, seed in (('palmer', 4), ('sikuliaq', 5)):
        ships[name] = sea(predictor(namespace=name), f'/{name}/'), list(voyage(seed, seconds=10))
    (one, first), (two, second) = ships.values()
    for (topic, sample), (other_topic, other_sample) in zip(first, second, strict=True):
        one.feed(topic, sample)
        two.feed(other_topic, other_sample)
    for around, samples in ships.values():
        wanted = expected(samples)
        around.hear_all(len(wanted))
        assert by_topic(around.heard) == by_topic(wanted)


def test_remapping(predictor, sea):
    node = predictor(namespace='palmer', window_output_rate=1000.0, cli_args=[
        '--ros-args', '-r', 'ship/imu:=mru/imu', '-r', 'touchdown/height:=/deck/height'])
    around = sea(node, '', {
        'ship/imu': '/palmer/mru/imu', 'ship/heave': '/palmer/ship/heave',
        'ship/odometry': '/palmer/ship/odometry', 'touchdown/height': '/deck/height',
        'touchdown/prediction': '/palmer/touchdown/prediction',
        'touchdown/forecast': '/palmer/touchdown/forecast',
        'touchdown/forecast_sd': '/palmer/touchdown/forecast_sd',
        'touchdown/window': '/palmer/touchdown/window'})
    for topic, sample in voyage(6, seconds=1):
        around.feed(topic, sample)
    around.hear_all(25)
    assert Counter(name for name, _ in around.heard) == {
        topic.name: 5 for topic in outputs('predictor')}


def test_every_parameter_is_declared_described_and_read_only(predictor):
    node = predictor()
    for name, rule in parameters(PredictorConfig).items():
        value = node.get_parameter(name).value
        value = tuple(value) if isinstance(rule.default, tuple) else value
        assert repr(value) == repr(rule.default)  # nan too
        about = node.describe_parameter(name)
        assert rule.meaning in about.description and rule.unit in about.description
        assert about.read_only
        if isinstance(rule.default, float) and not isnan(rule.default):
            limits, = about.floating_point_range
            assert (limits.from_value, limits.to_value) == (rule.low, rule.high)
        for choice in rule.choices:
            assert choice in about.additional_constraints
    result, = node.set_parameters([Parameter('horizon', value=5.0)])
    assert not result.successful


@pytest.mark.parametrize('name, value, words', [
    ('horizon', 20.0, '0.1 to 10 s'), ('horizon', 'three', 'decimal'),
    ('horizon', True, 'decimal'), ('horizon', float('nan'), '0.1 to 10 s'),
    ('method', 'magic', 'adaptive'),
    ('lever_arm', [1.0, 2.0], '3 numbers'), ('lever_arm', 1.0, 'list'),
    ('lever_arm', [1.0, 2.0, 5000.0], '-1000 to 1000 m'), ('output_rate', 0, '0.01 to 1000 Hz'),
    ('ship_level_frame', 3, 'text')])
def test_wrong_values_are_named(context, name, value, words):
    with pytest.raises(ValueError) as error:
        PredictorNode(context=context, parameter_overrides=[Parameter(name, value=value)])
    assert f"'{name}'" in str(error.value) and words in str(error.value)


def test_whole_numbers_are_taken_for_decimals(predictor):
    node = predictor(horizon=5, lever_arm=[-35, 0, 6], output_rate=20)
    assert node.pipeline.config == PredictorConfig(
        horizon=5.0, lever_arm=(-35.0, 0.0, 6.0), output_rate=20.0)
    assert node.get_parameter('horizon').value == 5.0


def test_an_empty_list_in_a_parameter_file_is_an_empty_list(tmp_path, domain_id):
    @dataclass(frozen=True)
    class Config:
        topics: tuple = parameter((), 'which; none = all')

    path = tmp_path / 'params.yaml'
    path.write_text('/**:\n  ros__parameters: {topics: []}\n')
    own = rclpy.Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=own, domain_id=domain_id)
    try:
        node = rclpy.create_node('any', context=own)
        assert configuration(node, Config).topics == ()
        node.destroy_node()
    finally:
        own.try_shutdown()


def test_unknown_parameters_are_named_in_a_warning(predictor, capfd):
    predictor(horizont=3.0, leverarm=[1.0], use_sim_time=True)
    text = capfd.readouterr().err
    assert 'horizont, leverarm' in text and 'WARN' in text
    assert 'use_sim_time' not in text


def test_trouble_is_warned_of_once_and_counted(predictor, sea, capfd):
    samples = with_trouble(voyage(1, seconds=25))
    node = predictor()
    around = sea(node)
    for topic, sample in samples:
        around.feed(topic, sample)
    again = samples[80:86]
    for topic, sample in again:
        around.feed(topic, sample)
    name, _, text, values = node.pipeline.diagnostics()[0]
    rejected = {key: int(value) for key, value in values.items() if key.startswith('rejected')}
    assert rejected == {
        'rejected ship/imu: older stamp': 2, 'rejected ship/heave: not finite': 2,
        'rejected ship/heave: stamp far ahead': 2, 'rejected ship/imu: no attitude': 2,
        'rejected ship/imu: quaternion not normalised': 2,
        'rejected ship/heave: implausible heave': 2}
    assert '12 messages rejected' in text
    odd = {key: value for key, value in values.items() if key.startswith('odd')}
    assert list(odd.values()) == ['1'] and 'unexpected frame_id' in next(iter(odd))
    logged = capfd.readouterr().err
    for reason in ('older stamp', 'not finite', 'stamp far ahead', 'no attitude',
                   'not normalised', 'implausible heave', "'elsewhere'"):
        assert logged.count(reason) == 1


@pytest.fixture
def reports(context, executor):
    """Return what arrives on /diagnostics."""
    node, heard = rclpy.create_node('watch', context=context), []
    node.create_subscription(DiagnosticArray, '/diagnostics', heard.append, QoSProfile(depth=100))
    executor.add_node(node)
    return heard


def test_diagnostics_come_by_themselves_and_are_absolute(predictor, reports, spin_until):
    predictor(namespace='palmer', lever_arm=[-35.0, 0.0, 6.0])
    spin_until(lambda: reports)
    source, score, settings = reports[0].status
    assert score.name == 'predictor: score'
    assert source.hardware_id == settings.hardware_id == '/palmer/predictor'
    assert source.level == b'\1' and 'no usable message' in source.message
    values = {pair.key: pair.value for pair in settings.values}
    assert values['lever_arm'] == '-35.0, 0.0, 6.0' and values['method'] == 'adaptive'
    assert set(values) == set(parameters(PredictorConfig))


def test_a_silent_input_is_seen_even_while_the_other_goes_on(predictor, sea):
    node = predictor()
    around = sea(node)
    samples = list(voyage(1, seconds=20))
    report = node._diagnostics._report

    def levels(pairs):
        """Report once after every five of the samples, as if they were a second's."""
        found = []
        for k, (topic, sample) in enumerate(pairs):
            around.feed(topic, sample)
            if k % 5 == 4:
                found.append(report()[0][1:3])
        return found

    assert {level for level, _ in levels(samples[:60])} == {0}
    alone = levels([item for item in samples[60:] if item[0] == 'ship/imu'])
    assert [level for level, _ in alone[2:]] == [1] * (len(alone) - 2)
    assert all('ship/heave' in text and 'ship/imu' not in text for _, text in alone[2:])
    report(), report()
    assert 'ship/imu' in report()[0][2]


def test_input_at_one_hertz_is_not_silent(predictor, sea):
    """Every second report may just miss its message."""
    node = predictor()
    around = sea(node)
    found = []
    for topic, sample in voyage(1, seconds=5, rate=1):
        around.feed(topic, sample)
        found += [node._diagnostics._report()[0][1] for _ in range(topic == 'ship/imu')]
    assert set(found) == {0}


def test_quality_of_service(predictor, sea):
    node = predictor()
    sea(node)
    for topic in inputs('predictor'):
        ours, = node.get_subscriptions_info_by_topic('/' + topic.name)
        assert ours.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    for topic in outputs('predictor'):
        ours, = node.get_publishers_info_by_topic('/' + topic.name)
        assert ours.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_quality_of_service_can_be_overridden(predictor, sea, capfd):
    node = predictor(**{
        'qos_overrides./ship/imu.subscription.reliability': 'reliable',
        'qos_overrides./touchdown/height.publisher.reliability': 'best_effort'})
    node_info, = node.get_subscriptions_info_by_topic('/ship/imu')
    assert node_info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    node_info, = node.get_publishers_info_by_topic('/touchdown/height')
    assert node_info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert 'unknown parameter' not in capfd.readouterr().err


def started(domain_id, *args):
    """Start the node as a process of its own."""
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}
    return subprocess.Popen(
        [sys.executable, '-c', 'from deck_motion_ros.nodes.predictor import main; main()', *args],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_status_0(context, domain_id, executor, spin_until, number):
    process = started(domain_id)
    try:
        node = rclpy.create_node('watch', context=context)
        executor.add_node(node)
        heard = []
        node.create_subscription(DiagnosticArray, '/diagnostics', heard.append, 10)
        spin_until(lambda: heard or process.poll() is not None)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert 'Traceback' not in errors


def test_wrong_parameters_end_it_with_status_2_and_one_line(domain_id):
    process = started(domain_id, '--ros-args', '-p', 'horizon:=20.0')
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert errors.strip() == "error: parameter 'horizon' must be within 0.1 to 10 s, not 20.0"

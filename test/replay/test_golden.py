"""The golden bags: pure replay, the live node, and player, predictor and recorder together."""

from dataclasses import fields, is_dataclass
from importlib import import_module
import os
from pathlib import Path
import signal
import subprocess
import sys

import numpy as np
import pytest

from deck_motion_ros.params_file import read_params_file
from deck_motion_ros.recording import BagReader
from deck_motion_ros.replaying import replay
from deck_motion_ros.topics import BY_NAME, inputs, outputs

BAGS = Path(__file__).resolve().parents[2] / 'bags'
NAMES = sorted(path.stem for path in BAGS.glob('*.yaml'))
OUTPUTS = ('/touchdown/height', '/touchdown/prediction', '/touchdown/forecast',
           '/touchdown/forecast_sd', '/touchdown/window')  # of the predictor


def node_of(golden):
    """Name the node whose parameters lie beside a golden bag."""
    return Path(f'{golden}.yaml').read_text().partition(':')[0]


def settings_of(golden):
    return read_params_file(Path(f'{golden}.yaml'), node_of(golden))


def topics(golden, of):
    """List the topics of the bag's node that are in it: its ``inputs`` or ``outputs``."""
    return [f'/{topic.name}' for topic in of(node_of(golden))
            if f'/{topic.name}' in BagReader(golden).topics]


def flat(msg):
    """List a message's content, depth first: texts as they are, numbers as floats."""
    if isinstance(msg, str):
        return [msg]
    if hasattr(msg, '__slots__') and hasattr(msg, 'get_fields_and_field_types'):  # rclpy
        return [leaf for name in msg.get_fields_and_field_types()
                for leaf in flat(getattr(msg, name))]
    if is_dataclass(msg):  # rosbags
        return [leaf for item in fields(msg) if item.name[0].islower()  # no constants
                for leaf in flat(getattr(msg, item.name))]
    if hasattr(msg, '__len__'):
        return [leaf for item in msg for leaf in flat(item)]
    return [float(msg)]


def track(bag, topic):
    """List the flat messages of one topic."""
    reader = BagReader(bag)
    return [flat(reader.decode(name, data)) for name, _, data in reader.messages([topic])]


def assert_close(ours, golden):
    """Compare two tracks: texts equal, numbers within 1e-9."""
    assert len(ours) == len(golden) > 0
    for mine, theirs in zip(ours, golden, strict=True):
        texts = [leaf for leaf in mine if isinstance(leaf, str)]
        assert texts == [leaf for leaf in theirs if isinstance(leaf, str)]
        np.testing.assert_allclose([leaf for leaf in mine if not isinstance(leaf, str)],
                                   [leaf for leaf in theirs if not isinstance(leaf, str)],
                                   rtol=0, atol=1e-9)


@pytest.fixture(scope='module', params=NAMES)
def replayed(request, tmp_path_factory):
    """Replay the inputs of a golden bag; return its folder and the new one."""
    golden = BAGS / request.param
    out = tmp_path_factory.mktemp('replayed') / request.param
    replay(golden, out, node_of(golden), settings_of(golden))
    return golden, out


def test_replay_gives_the_golden_outputs(replayed):
    golden, out = replayed
    assert len(topics(golden, outputs)) == len(outputs(node_of(golden)))
    for topic in topics(golden, outputs):
        assert_close(track(out, topic), track(golden, topic))


def test_replay_twice_gives_the_same_bits(replayed, tmp_path):
    golden, out = replayed
    replay(golden, tmp_path / 'again', node_of(golden), settings_of(golden))
    for topic in topics(golden, outputs):
        assert track(tmp_path / 'again', topic) == track(out, topic)


def test_live_node_is_bit_equal_to_replay(replayed, context, executor, spin_until):
    from rclpy.node import Node
    from rclpy.serialization import deserialize_message

    from deck_motion_ros.nodes.shell import output_qos, RclTypes

    golden, out = replayed
    name = node_of(golden)
    live = getattr(import_module(f'deck_motion_ros.nodes.{name}'), f'{name.capitalize()}Node')(
        context=context, cli_args=['--ros-args', '--params-file', f'{golden}.yaml'])
    driver = Node('driver', context=context)
    types, heard = RclTypes(), {topic: [] for topic in topics(golden, outputs)}
    for topic, messages in heard.items():
        driver.create_subscription(types[BY_NAME[topic[1:]].type], topic,
                                   lambda msg, to=messages: to.append(flat(msg)), output_qos())
    sent = {topic: driver.create_publisher(types[BY_NAME[topic[1:]].type], topic, output_qos())
            for topic in topics(golden, inputs)}
    for node in (live, driver):
        executor.add_node(node)
    spin_until(lambda: all(publisher.get_subscription_count() for publisher in sent.values()))
    spin_until(lambda: all(len(live.get_subscriptions_info_by_topic(topic)) for topic in heard))
    taken = []
    take = live.pipeline.take

    def counted(topic, msg):
        taken.append(topic)
        return take(topic, msg)

    live.pipeline.take = counted
    for count, (topic, _, data) in enumerate(BagReader(golden).messages(list(sent)), start=1):
        sent[topic].publish(deserialize_message(data, types[BY_NAME[topic[1:]].type]))
        spin_until(lambda upto=count: len(taken) == upto)
    expected = {topic: track(out, topic) for topic in heard}
    spin_until(lambda: all(len(heard[topic]) >= len(expected[topic]) for topic in heard))
    assert heard == expected


def run_node(name, domain_id, log, *args):
    """Start a node as a process of its own session."""
    return subprocess.Popen(
        [sys.executable, '-c', f'from deck_motion_ros.nodes.{name} import main; main()',
         '--ros-args', *args],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, stdin=subprocess.DEVNULL,
        stdout=log, stderr=log, start_new_session=True)


def test_player_predictor_recorder(tmp_path, domain_id, context, executor, spin_until):
    from rclpy.node import Node

    golden = BAGS / 'shaping_202611B'  # whole: with drop-outs a backlog may join otherwise
    observer = Node('observer', context=context)
    executor.add_node(observer)
    with (tmp_path / 'log').open('wb') as log:
        predictor = run_node('predictor', domain_id, log, '--params-file', f'{golden}.yaml')
        recorder = run_node('recorder', domain_id, log, '-p', f'output:={tmp_path / "bag"}', '-p',
                            f'topics:=[{", ".join(OUTPUTS)}]')
        try:
            spin_until(lambda: all(observer.count_subscribers(topic) for topic in OUTPUTS))
            player = run_node(
                'player', domain_id, log, '-p', f'bag:={golden}', '-p', 'rate:=20.0', '-p',
                'topics:=[/ship/imu, /ship/heave]', '-p',
                'wait_for_subscribers:=[/ship/imu, /ship/heave]', '-p', 'wait_timeout:=60.0')
            assert player.wait(120) == 0, (tmp_path / 'log').read_text()
        finally:
            statuses = []
            for process in (predictor, recorder):
                os.killpg(process.pid, signal.SIGINT)
                statuses.append(process.wait(30))
    assert statuses == [0, 0], (tmp_path / 'log').read_text()
    for topic in OUTPUTS:
        assert_close(track(tmp_path / 'bag', topic), track(golden, topic))

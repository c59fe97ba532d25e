"""The alignment node: what it says of itself; its numbers are checked with the golden bags."""

import os
import subprocess
import sys

from geometry_msgs.msg import Vector3Stamped
import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from deck_motion_ros import messages
from deck_motion_ros.nodes.alignment import AlignmentNode
from deck_motion_ros.nodes.shell import RclTypes
from deck_motion_ros.simulation.catapult import CatapultSimulator, CatapultSimulatorConfig
from deck_motion_ros.topics import BY_NAME

ARCMIN = np.radians(1 / 60)
LAUNCH = CatapultSimulatorConfig(deck='steady', rate=50.0, hold=1.0, duration=2.5, stroke=1.2)


@pytest.fixture
def node(context, executor):
    """Return a function that makes the node."""
    def make(**values):
        made = AlignmentNode(context=context, parameter_overrides=[
            Parameter(name, value=value) for name, value in values.items()])
        executor.add_node(made)
        return made
    return make


def sent(node, events):
    """Hand samples to the node as messages; return the truth."""
    types, truth = RclTypes(), None
    for _, topic, sample in events:
        if topic == 'alignment/truth':
            truth = np.array(sample.vector)
        else:
            node._on_message(topic, messages.message(types, sample))
    return truth


def values(status):
    return status[3]


def test_a_launch_comes_in_and_misalignment_and_phases_go_out(
        node, context, executor, spin_until):
    heard = []
    watch = rclpy.create_node('watch', context=context)
    watch.create_subscription(Vector3Stamped, 'alignment/misalignment', heard.append,
                              QoSProfile(depth=1000))
    executor.add_node(watch)
    aligner = node()
    spin_until(lambda: aligner.count_subscribers('alignment/misalignment'))
    truth = sent(aligner, CatapultSimulator(LAUNCH, 10**18))
    spin_until(lambda: len(heard) > 100)
    last = heard[-1].vector
    assert heard[-1].header.frame_id == 'uav_base_link'
    assert abs(last.y - truth[1]) < 3 * ARCMIN
    status, health, settings = aligner.pipeline.diagnostics()
    assert status[1] == 0 and status[2] == 'done'
    assert {'phase', 'innovations, mean square', 'largest fading factor', 'skew (ms)',
            'least observable direction', 'least observable sd (arcmin)',
            'sd forward, left, up (arcmin)', 'stamp jitter (ms)'} <= set(values(health))
    assert values(status)['join drops'] == '0' and settings[2] == 'strong_tracking'


def test_it_says_what_it_waits_for_and_why_it_refuses(node):
    aligner = node()
    status, *_ = aligner.pipeline.diagnostics()
    assert status[1] == 1 and 'no master/imu, slave/imu' in status[2]
    events = list(CatapultSimulator(LAUNCH, 10**18))
    sent(aligner, [
        event._replace(sample=type(event.sample)(
            event.sample.stamp + 4 * 10**9, *[getattr(event.sample, name) for name in
                                              event.sample.__slots__[1:]]))
        if event.topic == 'master/velocity' else event for event in events])
    status, *_ = aligner.pipeline.diagnostics()
    assert status[1] == 2
    assert 'clocks differ' in status[2] and 'master/velocity +4.0 s' in status[2]
    assert values(status)['outputs'] == '0'


def test_a_launch_without_a_window_is_a_warning(node):
    aligner = node()
    sent(aligner, [event for event in CatapultSimulator(LAUNCH, 10**18)
                   if event.time >= 10**18 + 10**9])
    status, *_ = aligner.pipeline.diagnostics()
    assert status[1] == 1 and 'after 0.0 s of velocity matching' in status[2]


def test_fading_of_the_attitude_ends_it_with_status_2_and_one_line(domain_id):
    process = subprocess.run(
        [sys.executable, '-c', 'from deck_motion_ros.nodes.alignment import main; main()',
         '--ros-args', '-p', 'fading_weights:=[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]'],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, capture_output=True, text=True,
        timeout=60)
    assert process.returncode == 2
    line, = process.stderr.strip().splitlines()
    assert line.startswith("error: parameter 'fading_weights'") and 'not observable' in line


def test_topics_are_those_of_the_contract(node):
    aligner = node()
    kinds = dict(aligner.get_publisher_names_and_types_by_node('alignment', '/'))
    assert '/alignment/misalignment' in kinds and '/alignment/attitude' in kinds
    for name in ('slave/imu', 'master/imu', 'master/velocity', 'ldv/velocity'):
        info, = aligner.get_subscriptions_info_by_topic(f'/{name}')
        assert info.topic_type == BY_NAME[name].type

"""The altitude node on real ROS 2, fed step by step: numbers, frames, diagnostics, parameters."""

from functools import partial

import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from deck_motion_ros import messages
from deck_motion_ros.estimators.altitude import AltitudeConfig
from deck_motion_ros.nodes.altitude import AltitudeNode
from deck_motion_ros.nodes.shell import RclTypes
from deck_motion_ros.pipelines.altitude import AltitudePipeline
from deck_motion_ros.recording import BagTypes
from deck_motion_ros.samples import OdometrySample
from deck_motion_ros.simulation.sea_skimming import (
    SkimmingSimulator,
    SkimmingSimulatorConfig,
)
from deck_motion_ros.topics import BY_NAME, inputs

RCL, BAG = RclTypes(), BagTypes()
FLIGHT = SkimmingSimulatorConfig(
    duration=6.0, rate=25.0, altimeter_rate=25.0, waves=50, loss_of_lock=(2.0, 3.0),
    obstacle=(4.0, 4.5, 20.0))


def events():
    """Give (topic, sample) pairs of a flight; every tenth range comes twice."""
    for number, event in enumerate(SkimmingSimulator(FLIGHT)):
        if not isinstance(event.sample, OdometrySample):
            yield event.topic, event.sample
            if event.topic == 'altimeter/range' and number % 40 == 0:
                yield event.topic, event.sample


def content(msg):
    pose, twist = msg.pose, msg.twist
    return (msg.header.stamp.sec, msg.header.stamp.nanosec, msg.header.frame_id,
            msg.child_frame_id, pose.pose.position.z, twist.twist.linear.z,
            list(pose.covariance), list(twist.covariance))


def rounded(sample):
    """Give the message as it comes off the wire, where a range is a float32."""
    msg = messages.message(BAG, sample)
    if hasattr(msg, 'range'):
        msg.range = float(np.float32(msg.range))
    return msg


@pytest.fixture
def fly(context, executor, spin_until):
    """Return a function that flies a node through the events: messages heard, last status."""
    def run(**values):
        node = AltitudeNode(context=context, parameter_overrides=[
            Parameter(name, value=value) for name, value in values.items()])
        driver, qos, heard = rclpy.create_node('aircraft', context=context), QoSProfile(
            depth=1000), []
        for item in (node, driver):
            executor.add_node(item)
        sent = {topic.name: driver.create_publisher(RCL[topic.type], topic.name, qos)
                for topic in inputs('altitude')}
        name = 'altitude/odometry'
        driver.create_subscription(RCL[BY_NAME[name].type], name, heard.append, qos)
        spin_until(lambda: all(item.get_subscription_count() for item in sent.values())
                   and driver.count_publishers(name))
        taken, take = [], node.pipeline.take
        node.pipeline.take = lambda topic, msg: (taken.append(topic), take(topic, msg))[1]
        for count, (topic, sample) in enumerate(events(), start=1):
            sent[topic].publish(messages.message(RCL, sample))
            spin_until(partial(lambda upto: len(taken) == upto, count))
        expected = pure(**values)
        spin_until(lambda: len(heard) >= len(expected))
        assert [content(msg) for msg in heard] == expected
        return heard, {status[0]: status[1:] for status in node.pipeline.diagnostics()}
    return run


def pure(warnings=None, **values):
    """Give what the pipeline gives for the same messages in the same order, without ROS."""
    pipeline = AltitudePipeline(AltitudeConfig(**values), BAG,
                                (warnings if warnings is not None else []).append)
    return [content(msg) for topic, sample in events()
            for _, msg in pipeline.take(topic, rounded(sample))]


def test_live_node_is_the_pure_pipeline_bit_for_bit(fly):
    heard, found = fly(initial_height=45.0, initial_height_sd=0.1)
    assert len(heard) == 150
    assert heard[0].header.frame_id == 'mean_sea' and heard[0].child_frame_id == 'uav_level'
    assert heard[-1].pose.covariance[14] > 0 and heard[-1].pose.covariance[0] == 1e6
    _, sentence, values = found['altitude: input']
    assert 'rejected' in sentence
    assert values['altimeter drop-outs'] == '26'  # one of them twice
    assert values['rejected altimeter/range: duplicate stamp'] == '5'
    assert int(values['ranges that do not fit']) == 13
    _, _, values = found['altitude: filter']
    assert float(values['significant wave height (m)']) == pytest.approx(7.5, abs=0.01)
    assert float(values['unobservable sd (m)']) > 0


def test_frames_are_parameters(fly):
    heard, _ = fly(mean_sea_frame='sea', uav_level_frame='level', method='ekf')
    assert (heard[0].header.frame_id, heard[0].child_frame_id) == ('sea', 'level')


def test_combined_warns_that_it_is_unsafe():
    warnings = []
    pure(warnings, method='combined')
    assert any('unsafe' in text and '30 s' in text for text in warnings)
    pipeline = AltitudePipeline(AltitudeConfig(method='combined'), BAG, warnings.append)
    for topic, sample in events():
        list(pipeline.take(topic, rounded(sample)))
    level, sentence, _ = pipeline.diagnostics()[0][1:]
    assert level == 1 and 'unsafe' in sentence


def test_silence_and_missing_start_are_said():
    pipeline = AltitudePipeline(AltitudeConfig(), BAG, lambda text: None)
    level, sentence, _ = pipeline.diagnostics()[0][1:]
    assert level == 1 and 'needs uav/imu' in sentence
    silent = [(topic, sample) for topic, sample in events() if topic == 'uav/imu']
    pipeline = AltitudePipeline(AltitudeConfig(initial_height=45.0), BAG, lambda text: None)
    for topic, sample in silent:
        list(pipeline.take(topic, rounded(sample)))
    level, sentence, _ = pipeline.diagnostics()[0][1:]
    assert level == 1 and 'no range' in sentence

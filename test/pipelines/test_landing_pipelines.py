"""Landing and guidance between their topics: what they say of bad input and of themselves."""

from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros import messages
from deck_motion_ros.estimators.guidance import GuidanceConfig
from deck_motion_ros.estimators.landing import LandingConfig
from deck_motion_ros.pipelines import GuidancePipeline, LandingPipeline, WARN
from deck_motion_ros.recording import BagTypes
from deck_motion_ros.samples import NANOSECONDS, OdometrySample, RangeSample
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig
from deck_motion_ros.topics import BY_NAME

TYPES = BagTypes()
ARM = (0.0, 0.0, 0.0)
SCENE = LandingSimulatorConfig(duration=20.0, seed=4, deck='pan2020', deck_lever_arm=ARM,
                               approach_time=8.0, hold_time=6.0, descent_time=6.0, uav_rate=50.0)
INPUTS = ('ship/imu', 'uav/imu', 'uwb/range')


def run(scene):
    warnings, out = [], []
    pipeline = LandingPipeline(LandingConfig(deck_lever_arm=ARM), TYPES, warnings.append)
    for event in LandingSimulator(scene, truth=False):
        if event.topic in INPUTS:
            out += pipeline.take(event.topic, messages.message(TYPES, event.sample))
    return pipeline, warnings, out


@pytest.fixture(scope='module')
def landed():
    return run(SCENE)


def test_messages_say_where_and_how_sure(landed):
    _, warnings, out = landed
    assert warnings == []
    (first, odometry), (second, pose) = out[-2:]
    assert (first, second) == ('landing/odometry', 'landing/pose')
    assert (odometry.header.frame_id, odometry.child_frame_id) == ('deck', 'uav_deck')
    assert pose.header == odometry.header
    assert pose.pose.pose == odometry.pose.pose
    truth, rate = LandingSimulator(SCENE).scene.over_deck(
        np.array([odometry.header.stamp.sec + 1e-9 * odometry.header.stamp.nanosec]))
    for value, true, cov in ((odometry.pose.pose.position, truth, odometry.pose.covariance),
                             (odometry.twist.twist.linear, rate, odometry.twist.covariance)):
        error = np.array([value.x, value.y, value.z]) - true[0]
        assert np.all(np.abs(error) < 4 * np.sqrt(cov.reshape(6, 6).diagonal()[:3]))


def test_diagnostics_name_accuracy_and_geometry(landed):
    pipeline, _, _ = landed
    status, geometry, settings = pipeline.diagnostics()
    assert status[1:3] == (0, 'inertial: both accelerations are measured')
    assert status[3]['starts'] == '1'
    assert geometry[0] == 'landing: geometry'
    assert 0.5 < float(geometry[3]['dilution x']) < 10
    assert settings[2] == 'joint'


def test_moved_anchor_is_named():
    pipeline, _, _ = run(replace(SCENE, moved_anchor='anchor_2', moved_time=14.0,
                               moved_by=(0.0, 0.0, 1.0)))
    assert pipeline.diagnostics()[0][1:3] == (
        WARN, 'ranges of anchor_2 (100 %) contradict the others')


def test_bad_messages_are_counted_by_reason():
    warnings = []
    pipeline = LandingPipeline(LandingConfig(deck_static=True), TYPES, warnings.append)
    for k, (frame, distance) in enumerate((('elsewhere', 5.0), ('anchor_1', -1.0), (
            'anchor_1', float('nan')), ('anchor_1', float('inf')), ('anchor_1', 5.0))):
        msg = messages.message(TYPES, RangeSample(k * NANOSECONDS, frame, distance, 0.0))
        assert list(pipeline.take('uwb/range', msg)) == []
    values = pipeline.diagnostics()[0][3]
    assert values['rejected uwb/range: unknown anchor'] == '1'
    assert values['rejected uwb/range: not finite'] == '2'
    assert values['rejected uwb/range: outside min_range and max_range'] == '1'
    assert values['accepted uwb/range'] == '1'
    assert len(warnings) == 3


def test_other_frame_is_used_and_counted():
    pipeline, warnings, out = run(replace(SCENE, duration=3.0, uav_base_link_frame='other'))
    assert out
    assert pipeline.diagnostics()[0][3]['odd uav/imu: unexpected frame_id'] == '150'
    assert len(warnings) == 1


def test_anchors_in_a_plane_are_warned_of():
    warnings = []
    LandingPipeline(LandingConfig(anchor_positions=(
        1.5, 1.5, 0.5, -1.5, 1.5, 0.5, -1.5, -1.5, 0.5, 1.5, -1.5, 0.5)), TYPES, warnings.append)
    assert 'one plane' in warnings[0]


def test_guidance_says_its_phase_and_survives_empty_forecasts():
    pipeline = GuidancePipeline(GuidanceConfig(), TYPES, lambda text: None)
    assert pipeline.diagnostics()[0][2] == 'no position of the aircraft yet'
    here = OdometrySample(NANOSECONDS, 'deck', 'uav_deck', (10.0, 0.0, 15.0),
                          (0.0, 0.0, 0.0, 1.0), ARM, ARM, (0.0,) * 6)
    (topic, msg), = pipeline.take('landing/odometry', messages.message(TYPES, here))
    assert topic == 'landing/cmd_vel'
    assert msg.header.frame_id == 'deck'
    assert msg.twist.linear.x == -2.5
    assert pipeline.diagnostics()[0][2] == 'approach, without a forecast of the deck'
    kind = TYPES[BY_NAME['touchdown/forecast'].type]
    assert list(pipeline.take('touchdown/forecast', kind(
        header=msg.header, joint_names=['touchdown'], points=[]))) == []
    assert pipeline.diagnostics()[0][3]['rejected touchdown/forecast: no forecast'] == '1'

"""Message <-> sample with rclpy's classes and rosbags' classes: the same content either way."""

from math import inf, nan

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')

from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from rosbags.typesys import get_typestore, Stores  # noqa: E402

from deck_motion_ros import messages  # noqa: E402
from deck_motion_ros.geometry import quaternion_from_rpy  # noqa: E402
from deck_motion_ros.nodes.shell import RclTypes  # noqa: E402
from deck_motion_ros.recording import BagTypes, encode  # noqa: E402
from deck_motion_ros.samples import (  # noqa: E402
    HeaveSample,
    ImuSample,
    MotionForecast,
    OdometrySample,
    RangeSample,
    Rejected,
    TouchdownForecast,
    TouchdownPose,
    VectorSample,
    VelocitySample,
)
from deck_motion_ros.topics import (  # noqa: E402
    BY_NAME,
    IMU,
    inputs,
    ODOMETRY,
    outputs,
    POINT,
    POSE,
    TOPICS,
    TWIST,
)
from deck_motion_ros.topics import VECTOR as VECTOR_STAMPED  # noqa: E402

RCL, BAG = RclTypes(), BagTypes()
STORE = get_typestore(Stores.ROS2_JAZZY)

NUMBER = st.floats(-1e6, 1e6)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
ANGLE = st.floats(-3.0, 3.0)
STAMP = st.integers(0, 2**31 * 10**9 - 1)
FRAME = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=12)
ATTITUDE = st.builds(quaternion_from_rpy, ANGLE, st.floats(-1.5, 1.5), ANGLE)
VARIANCE = st.floats(0.0, 1e3)
IMU_SAMPLE = st.builds(ImuSample, STAMP, FRAME, ATTITUDE,
                       st.tuples(VARIANCE, VARIANCE, VARIANCE), VECTOR, VECTOR)
HEAVE_SAMPLE = st.builds(HeaveSample, STAMP, FRAME, NUMBER)
ODOMETRY_SAMPLE = st.builds(OdometrySample, STAMP, FRAME, FRAME, VECTOR, ATTITUDE, VECTOR,
                            VECTOR, st.tuples(*[VARIANCE] * 6))


def content(msg):
    """Turn a message of either backend into plain values, field by field."""
    if hasattr(msg, 'get_fields_and_field_types'):
        return {name: content(getattr(msg, name)) for name in msg.get_fields_and_field_types()}
    if hasattr(msg, '__dataclass_fields__'):
        return {name: content(getattr(msg, name)) for name in msg.__dataclass_fields__
                if name != '__msgtype__' and not name.isupper()}
    if isinstance(msg, (list, tuple, np.ndarray)) or type(msg).__name__ == 'array':
        return [content(item) for item in list(msg)]
    if isinstance(msg, bytes):
        return msg[0]
    return msg.item() if isinstance(msg, np.generic) else msg


def assert_alike(kind, build):
    """Build with both backends, send each through its own CDR and read it with the other's."""
    ours, theirs = build(RCL), build(BAG)
    assert content(ours) == content(theirs)
    cdr = encode(kind, theirs)
    # serialize_message reserves too much for empty lists and leaves that at the end
    by_rcl = STORE.deserialize_cdr(serialize_message(ours)[:len(cdr)], kind)
    by_bag = deserialize_message(cdr, RCL[kind])
    assert content(by_rcl) == content(by_bag) == content(ours)
    return ours, theirs, by_rcl, by_bag


def approximately(sample):
    """Let a quaternion be normalised once more."""
    return {name: pytest.approx(value, abs=1e-15) if name == 'orientation' and value else value
            for name, value in ((name, getattr(sample, name)) for name in sample.__slots__)}


def assert_same(sample, other):
    """Compare two samples."""
    assert approximately(sample) == {name: getattr(other, name) for name in other.__slots__}


@settings(max_examples=40)
@given(IMU_SAMPLE)
def test_imu_there_and_back(sample):
    for msg in assert_alike(IMU, lambda types: messages.imu_message(types, sample)):
        assert_same(sample, messages.imu_sample(msg))
        assert messages.stamp_of(msg) == sample.stamp


@settings(max_examples=40)
@given(HEAVE_SAMPLE)
def test_heave_there_and_back(sample):
    for msg in assert_alike(POINT, lambda types: messages.heave_message(types, sample)):
        assert messages.heave_sample(msg) == sample


@settings(max_examples=40)
@given(ODOMETRY_SAMPLE)
def test_odometry_there_and_back(sample):
    for msg in assert_alike(ODOMETRY, lambda types: messages.odometry_message(types, sample)):
        assert_same(sample, messages.odometry_sample(msg))


RANGE_SAMPLE = st.builds(RangeSample, STAMP, FRAME, st.floats(0.0, 1e4, width=32),
                         st.floats(0.0, 1e3, width=32))
VELOCITY_SAMPLE = st.builds(VelocitySample, STAMP, FRAME, VECTOR,
                            st.tuples(VARIANCE, VARIANCE, VARIANCE))


@settings(max_examples=40)
@given(st.one_of(RANGE_SAMPLE, VELOCITY_SAMPLE))
def test_range_and_velocity_there_and_back(sample):
    kind, _ = messages.BUILDERS[type(sample)]
    for msg in assert_alike(kind, lambda types: messages.message(types, sample)):
        assert messages.CONVERTERS[kind](msg) == sample


@pytest.mark.parametrize('types', [RCL, BAG])
def test_range_without_an_echo_or_outside_its_limits(types):
    """REP-117: NaN is an error, +inf no echo, -inf too near."""
    for distance, words in ((nan, 'not finite'), (inf, 'not finite'), (-inf, 'not finite'),
                            (600.0, 'outside min_range'), (0.1, 'outside min_range')):
        msg = messages.range_message(types, RangeSample(5, 'radar', distance, 0.0))
        msg.min_range, msg.max_range = 0.5, 500.0
        with pytest.raises(Rejected, match=words):
            messages.range_sample(msg)


def test_full_covariances_stand_row_by_row():
    pose_cov, twist_cov = np.arange(36.0).reshape(6, 6), np.arange(36.0, 72.0).reshape(6, 6)
    level = (0.0, 0.0, 0.0, 1.0)
    for msg in assert_alike(ODOMETRY, lambda types: messages.estimate_message(
            types, 7, 'deck', 'uav_deck', (1.0, 2.0, 3.0), level, pose_cov, (4.0, 5.0, 6.0),
            (0.1, 0.2, 0.3), twist_cov)):
        assert msg.pose.covariance[6:12].tolist() == [6.0, 7.0, 8.0, 9.0, 10.0, 11.0]
        assert msg.twist.covariance[35] == 71.0 and msg.twist.twist.linear.z == 6.0
        assert msg.twist.twist.angular.y == 0.2 and msg.child_frame_id == 'uav_deck'
    for msg in assert_alike(POSE, lambda types: messages.pose_message(
            types, 7, 'deck', (1.0, 2.0, 3.0), level, pose_cov)):
        assert msg.pose.covariance[6:12].tolist() == [6.0, 7.0, 8.0, 9.0, 10.0, 11.0]
        assert msg.pose.pose.position.z == 3.0 and messages.stamp_of(msg) == 7


def test_vectors_alone():
    for msg in assert_alike(VECTOR_STAMPED, lambda types: messages.message(
            types, VectorSample(7, 'slave', (1.0, 2.0, 3.0)))):
        assert content(msg.vector) == {'x': 1.0, 'y': 2.0, 'z': 3.0}
    for msg in assert_alike(TWIST, lambda types: messages.twist_message(
            types, 7, 'deck', (1.0, 2.0, 3.0))):
        assert content(msg.twist.linear) == {'x': 1.0, 'y': 2.0, 'z': 3.0}
        assert content(msg.twist.angular) == {'x': 0.0, 'y': 0.0, 'z': 0.0}


SAMPLE = ImuSample(10**18 + 7, 'mru', (0.0, 0.0, 0.0, 1.0), (1e-6, 2e-6, 3e-6), (1.0, 2.0, 3.0),
                   (4.0, 5.0, 9.8))


@pytest.mark.parametrize('types', [RCL, BAG])
class TestWhatIsMissing:
    """Absent fields, by REP-145 and by the contract."""

    def test_no_attitude_by_covariance(self, types):
        msg = messages.imu_message(types, SAMPLE)
        covariance = np.zeros(9)
        covariance[0] = -1.0
        msg.orientation_covariance = covariance
        msg.orientation = messages._quaternion(types, (9.0, nan, 0.0, 0.0))
        assert messages.imu_sample(msg).orientation is None

    def test_no_attitude_by_zero_quaternion(self, types):
        msg = messages.imu_message(types, SAMPLE)
        msg.orientation = messages._quaternion(types, None)
        assert messages.imu_sample(msg).orientation is None
        assert messages.imu_sample(msg).angular_velocity == (1.0, 2.0, 3.0)

    def test_a_sample_without_attitude_says_so(self, types):
        bare = ImuSample(5, 'mru', None, (0.0,) * 3, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
        msg = messages.imu_message(types, bare)
        assert msg.orientation_covariance[0] == -1
        assert messages.imu_sample(msg) == bare

    def test_no_rates(self, types):
        msg = messages.imu_message(types, SAMPLE, rates=False)
        assert msg.angular_velocity_covariance[0] == msg.linear_acceleration_covariance[0] == -1
        back = messages.imu_sample(msg)
        assert back.angular_velocity == back.specific_force == (0.0, 0.0, 0.0)

    def test_a_slightly_long_quaternion_is_normalised(self, types):
        msg = messages.imu_message(types, SAMPLE)
        msg.orientation = messages._quaternion(types, (0.0, 0.0, 0.6005, 0.8))
        assert np.linalg.norm(messages.imu_sample(msg).orientation) == pytest.approx(1.0)

    @pytest.mark.parametrize('quaternion', [(0.0, 0.0, 0.0, 0.5), (2.0, 0.0, 0.0, 0.0),
                                            (1e-12, 0.0, 0.0, 0.0), (0.7, 0.7, 0.7, 0.7)])
    def test_any_other_length_is_no_attitude_at_all(self, types, quaternion):
        msg = messages.imu_message(types, SAMPLE)
        msg.orientation = messages._quaternion(types, quaternion)
        with pytest.raises(Rejected, match='not normalised'):
            messages.imu_sample(msg)

    @pytest.mark.parametrize('field, axis', [
        ('orientation', 'w'), ('angular_velocity', 'x'), ('linear_acceleration', 'z')])
    @pytest.mark.parametrize('value', [nan, inf, -inf])
    def test_what_is_no_number(self, types, field, axis, value):
        msg = messages.imu_message(types, SAMPLE)
        setattr(getattr(msg, field), axis, value)
        with pytest.raises(Rejected, match='not finite'):
            messages.imu_sample(msg)

    @pytest.mark.parametrize('value', [nan, inf, -inf])
    def test_heave_that_is_no_number(self, types, value):
        msg = messages.point_message(types, 5, 'ship_level', value)
        with pytest.raises(Rejected, match='not finite'):
            messages.heave_sample(msg)

    @pytest.mark.parametrize('field', ['pose', 'twist'])
    def test_odometry_that_is_no_number(self, types, field):
        sample = OdometrySample(5, 'a', 'b', (0.0,) * 3, (0.0, 0.0, 0.0, 1.0), (0.0,) * 3,
                                (0.0,) * 3, (0.0,) * 6)
        msg = messages.odometry_message(types, sample)
        if field == 'pose':
            msg.pose.pose.position.z = nan
        else:
            msg.twist.twist.angular.y = inf
        with pytest.raises(Rejected, match='not finite'):
            messages.odometry_sample(msg)

    @pytest.mark.parametrize('covariance', [0, 7, 14])
    def test_what_filters_cannot_compute_with(self, types, covariance):
        msg = messages.velocity_message(types, VelocitySample(5, 'map', (0.0,) * 3, (0.0,) * 3))
        msg.twist.covariance[covariance] = 1e300
        with pytest.raises(Rejected, match='implausible number'):
            messages.velocity_sample(msg)
        msg.twist.covariance[covariance] = 1e9  # a usual way to say "not known"
        assert messages.velocity_sample(msg).var[covariance // 7] == 1e9

    def test_stamps_to_the_last_nanosecond(self, types):
        for stamp in (0, 1, 999_999_999, 10**9, 1_406_851_200_170_000_001, 2**31 * 10**9 - 1):
            assert messages.stamp_of(messages.point_message(types, stamp, '', 0.0)) == stamp


def forecast(seed=1):
    """Make some forecast, every number different."""
    rng = np.random.default_rng(seed)
    horizons = np.array([0.5, 3.0, 10.0])

    def covariances():
        roots = rng.normal(size=(3, 3, 3))
        return roots @ roots.transpose(0, 2, 1)

    motion = MotionForecast(horizons, 0.1 * rng.normal(size=(3, 3)), covariances(),
                            rng.normal(size=(3, 3)), covariances())
    return TouchdownForecast(10**18 + 5, horizons, *rng.uniform(1, 2, (4, 3)),
                             rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), motion)


def test_forecast_message():
    made = forecast()
    kind = BY_NAME['touchdown/forecast'].type
    msg, *_ = assert_alike(kind, lambda types: messages.forecast_message(
        types, made, 'ship_level', 'touchdown'))
    assert messages.stamp_of(msg) == made.issued_at
    assert (msg.header.frame_id, list(msg.joint_names)) == ('ship_level', ['touchdown'])
    assert [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
            for point in msg.points] == [0.5, 3.0, 10.0]
    for point, position, velocity, mean in zip(
            msg.points, made.position, made.velocity, made.motion.mean, strict=True):
        moved, turn = point.transforms[0].translation, point.transforms[0].rotation
        assert (moved.x, moved.y, moved.z) == tuple(position)
        assert (turn.x, turn.y, turn.z, turn.w) == quaternion_from_rpy(mean[0], mean[1], 0.0)
        linear = point.velocities[0].linear
        assert (linear.x, linear.y, linear.z) == tuple(velocity)
        assert len(point.accelerations) == 0


def test_forecast_sd_message():
    made = forecast()
    kind = BY_NAME['touchdown/forecast_sd'].type
    msg, *_ = assert_alike(kind, lambda types: messages.forecast_sd_message(
        types, made, 'ship_level'))
    assert list(msg.joint_names) == ['height', 'roll', 'pitch']
    for k, point in enumerate(msg.points):
        assert list(point.positions) == pytest.approx([
            made.height_sd[k], *np.sqrt(np.diag(made.motion.cov[k]))[:2]])
        assert list(point.velocities) == pytest.approx([
            made.rate_sd[k], *np.sqrt(np.diag(made.motion.rate_cov[k]))[:2]])
        assert point.time_from_start.sec == int(made.horizons[k])


def test_prediction_message():
    rng = np.random.default_rng(4)
    pose = TouchdownPose(10**18, rng.normal(size=3), (0.0, 0.0, 0.6, 0.8),
                         rng.normal(size=(6, 6)), rng.normal(size=6), rng.normal(size=(6, 6)))
    msg, *_ = assert_alike(ODOMETRY, lambda types: messages.touchdown_message(
        types, pose, 'ship_level', 'touchdown'))
    assert (msg.header.frame_id, msg.child_frame_id) == ('ship_level', 'touchdown')
    assert list(msg.pose.covariance) == pose.pose_cov.ravel().tolist()
    assert list(msg.twist.covariance) == pose.twist_cov.ravel().tolist()
    twist = msg.twist.twist
    assert [twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y,
            twist.angular.z] == pose.twist.tolist()


@given(st.lists(st.tuples(FRAME, st.sampled_from([0, 1, 2]), FRAME,
                          st.dictionaries(FRAME, FRAME, max_size=3)), max_size=3))
def test_diagnostics_message(statuses):
    msg, *_ = assert_alike(BY_NAME['/diagnostics'].type, lambda types:
                           messages.diagnostics_message(types, 5, '/predictor', statuses))
    assert [(status.name, content(status.level), status.message,
             {pair.key: pair.value for pair in status.values})
            for status in msg.status] == statuses
    assert {status.hardware_id for status in msg.status} <= {'/predictor'}


def test_the_table_of_topics_is_the_contracts():
    assert [(topic.name, topic.type) for topic in inputs('predictor')] == [
        ('ship/imu', 'sensor_msgs/msg/Imu'), ('ship/heave', 'geometry_msgs/msg/PointStamped'),
        ('ship/odometry', 'nav_msgs/msg/Odometry')]
    assert {topic.name: (topic.type, topic.frame) for topic in outputs('predictor')} == {
        'touchdown/height': ('geometry_msgs/msg/PointStamped', 'touchdown_rest'),
        'touchdown/prediction': ('nav_msgs/msg/Odometry', 'ship_level'),
        'touchdown/forecast': ('trajectory_msgs/msg/MultiDOFJointTrajectory', 'ship_level'),
        'touchdown/forecast_sd': ('trajectory_msgs/msg/JointTrajectory', 'ship_level'),
        'touchdown/window': ('diagnostic_msgs/msg/DiagnosticArray', '')}
    assert len(BY_NAME) == len(TOPICS)
    assert [topic.name for topic in TOPICS if topic.name.startswith('/')] == ['/diagnostics']

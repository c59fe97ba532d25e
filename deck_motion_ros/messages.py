"""
Message <-> sample by attribute names: serves rclpy's classes and rosbags' alike.

``types`` gives the classes of one of the two by ROS type name, ``types.floats`` what it takes
for a ``float64[]`` and ``types.byte`` what it takes for a ``byte``.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import lru_cache
from math import inf, isfinite, sqrt
from typing import Any, Protocol

import numpy as np

from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.samples import (
    Array,
    DeckForecast,
    HeaveSample,
    ImuSample,
    LandingWindow,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
    Quaternion,
    RangeSample,
    Rejected,
    TouchdownForecast,
    TouchdownPose,
    Vector3,
    VectorSample,
    VelocitySample,
    WINDOW_STATES,
)
from deck_motion_ros.topics import (
    DIAGNOSTICS,
    IMU,
    MULTI_DOF_TRAJECTORY,
    ODOMETRY,
    POINT,
    POSE,
    RANGE,
    TRAJECTORY,
    TWIST,
    VECTOR,
    VELOCITY,
)

LARGEST = 1e12  # of any number that is used, in SI: beyond, filters lose their digits
WINDOW = 'landing window'  # name of the status
WINDOW_KEYS = ('seconds', 'probability', 'next_crest_in', 'next_crest_sd', 'next_trough_in',
               'next_trough_sd')


class Types(Hashable, Protocol):
    """Message classes of rclpy or rosbags."""

    def __getitem__(self, name: str) -> Any:
        """Return the class of a ROS type such as ``std_msgs/msg/Header``."""

    def floats(self, values: Iterable[float]) -> Any:
        """Return what a float64[] field takes."""

    def byte(self, value: int) -> Any:
        """Return what a byte field takes."""


def stamp_of(msg: Any) -> int:
    """Return the header's stamp in nanoseconds."""
    stamp = msg.header.stamp
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def _finite(*values: float) -> None:
    for value in values:
        if not -LARGEST < value < LARGEST:
            raise Rejected('not finite' if not isfinite(value) else 'implausible number')


def _vector(xyz: Any) -> Vector3:
    return (xyz.x, xyz.y, xyz.z)


def _attitude(msg_quaternion: Any) -> Quaternion | None:
    """Return the unit quaternion, ``None`` for the all-zero one; reject any other length."""
    quaternion = (msg_quaternion.x, msg_quaternion.y, msg_quaternion.z, msg_quaternion.w)
    _finite(*quaternion)
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if square == 0:
        return None
    if not 0.98 < square < 1.02:
        raise Rejected('quaternion not normalised')
    scale = 1 / sqrt(square)
    return (x * scale, y * scale, z * scale, w * scale)


def imu_sample(msg: Any) -> ImuSample:
    """
    Convert a ``sensor_msgs/Imu``.

    A covariance whose first element is -1 says that the field is not there: no attitude then,
    zeros for rate and specific force.

    Raises
    ------
    Rejected
        ``not finite`` or ``quaternion not normalised``.

    """
    cov = msg.orientation_covariance.tolist()
    orientation, attitude_var = None, (0.0, 0.0, 0.0)
    if cov[0] != -1:
        orientation = _attitude(msg.orientation)
        attitude_var = (cov[0], cov[4], cov[8])
    rate = force = (0.0, 0.0, 0.0)
    if msg.angular_velocity_covariance[0] != -1:
        rate = _vector(msg.angular_velocity)
    if msg.linear_acceleration_covariance[0] != -1:
        force = _vector(msg.linear_acceleration)
    _finite(*attitude_var, *rate, *force)
    return ImuSample(stamp_of(msg), msg.header.frame_id, orientation, attitude_var, rate, force)


def heave_sample(msg: Any) -> HeaveSample:
    """Convert a ``geometry_msgs/PointStamped``: z is the heave; ``Rejected`` if not finite."""
    _finite(msg.point.z)
    return HeaveSample(stamp_of(msg), msg.header.frame_id, msg.point.z)


def odometry_sample(msg: Any) -> OdometrySample:
    """Convert a ``nav_msgs/Odometry``; ``Rejected`` as for :func:`imu_sample`."""
    pose, twist = msg.pose.pose, msg.twist.twist
    position, linear, angular = (_vector(pose.position), _vector(twist.linear),
                                 _vector(twist.angular))
    x, y, z, about_x, about_y, about_z = msg.pose.covariance.tolist()[::7]
    pose_var = (x, y, z, about_x, about_y, about_z)
    _finite(*position, *linear, *angular, *pose_var)
    return OdometrySample(stamp_of(msg), msg.header.frame_id, msg.child_frame_id, position,
                          _attitude(pose.orientation), linear, angular, pose_var)


def range_sample(msg: Any) -> RangeSample:
    """
    Convert a ``sensor_msgs/Range``.

    Raises
    ------
    Rejected
        ``not finite``, which REP-117 gives for no echo (NaN, +inf) and too near (-inf); ``outside
        min_range and max_range``, where the message states them.

    """
    _finite(msg.range, msg.variance)
    if msg.max_range > msg.min_range and not msg.min_range <= msg.range <= msg.max_range:
        raise Rejected('outside min_range and max_range')
    return RangeSample(stamp_of(msg), msg.header.frame_id, msg.range, max(msg.variance, 0.0))


def velocity_sample(msg: Any) -> VelocitySample:
    """Convert a ``geometry_msgs/TwistWithCovarianceStamped``; ``Rejected`` if not finite."""
    velocity = _vector(msg.twist.twist.linear)
    x, y, z = msg.twist.covariance.tolist()[:15:7]
    _finite(*velocity, x, y, z)
    return VelocitySample(stamp_of(msg), msg.header.frame_id, velocity, (x, y, z))


def forecast_sample(msg: Any) -> DeckForecast:
    """
    Convert a ``trajectory_msgs/MultiDOFJointTrajectory`` of one joint.

    Raises
    ------
    Rejected
        ``not finite``, or ``no forecast`` where a point has no transform or no velocity.

    """
    times, positions, velocities = [], [], []
    for point in msg.points:
        if not (point.transforms and point.velocities):
            raise Rejected('no forecast')
        ahead = point.time_from_start
        times.append(ahead.sec + ahead.nanosec / NANOSECONDS)
        positions.append(_vector(point.transforms[0].translation))
        velocities.append(_vector(point.velocities[0].linear))
        _finite(*positions[-1], *velocities[-1])
    return DeckForecast(stamp_of(msg), msg.header.frame_id, np.array(times),
                        np.reshape(positions, (-1, 3)), np.reshape(velocities, (-1, 3)))


def _time(types: Types, stamp: int) -> Any:
    return types['builtin_interfaces/msg/Time'](
        sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


def _durations(types: Types, forecast: TouchdownForecast) -> tuple[Any, ...]:
    return _durations_of(types, tuple(forecast.horizons.tolist()))


@lru_cache(maxsize=4)
def _durations_of(types: Types, times: tuple[float, ...]) -> tuple[Any, ...]:
    """Make the durations, which are the same in every forecast."""
    duration = types['builtin_interfaces/msg/Duration']
    return tuple(duration(sec=total // NANOSECONDS, nanosec=total % NANOSECONDS)
                 for total in map(nanoseconds, times))


def _header(types: Types, stamp: int, frame_id: str) -> Any:
    return types['std_msgs/msg/Header'](stamp=_time(types, stamp), frame_id=frame_id)


def _xyz(types: Types, name: str, vec: Sequence[float] | Array) -> Any:
    x, y, z = vec
    return types['geometry_msgs/msg/' + name](x=float(x), y=float(y), z=float(z))


def _quaternion(types: Types, quaternion: Quaternion | None) -> Any:
    x, y, z, w = quaternion or (0.0, 0.0, 0.0, 0.0)
    return types['geometry_msgs/msg/Quaternion'](x=x, y=y, z=z, w=w)


def _twist(types: Types, linear: Sequence[float] | Array,
           angular: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Any:
    return types['geometry_msgs/msg/Twist'](
        linear=_xyz(types, 'Vector3', linear), angular=_xyz(types, 'Vector3', angular))


def _diagonal(variances: Sequence[float]) -> Array:
    return np.diag(np.array(variances, dtype=float)).ravel()


def imu_message(types: Types, sample: ImuSample, rates: bool = True) -> Any:
    """
    Build a ``sensor_msgs/Imu``.

    Parameters
    ----------
    types : Types
        Message classes.
    sample : ImuSample
        What to say.
    rates : bool
        False where the sensor gives neither turn rate nor specific force.

    """
    absent = np.array([-1.0] + [0.0] * 8)
    return types[IMU](
        header=_header(types, sample.stamp, sample.frame_id),
        orientation=_quaternion(types, sample.orientation),
        orientation_covariance=(_diagonal(sample.attitude_var)
                                if sample.orientation is not None else absent),
        angular_velocity=_xyz(types, 'Vector3', sample.angular_velocity),
        angular_velocity_covariance=np.zeros(9) if rates else absent,
        linear_acceleration=_xyz(types, 'Vector3', sample.specific_force),
        linear_acceleration_covariance=np.zeros(9) if rates else absent)


def point_message(types: Types, stamp: int, frame_id: str, height: float) -> Any:
    """Build a ``geometry_msgs/PointStamped`` with ``height`` (m) in z; stamp in ns."""
    return types[POINT](header=_header(types, stamp, frame_id),
                        point=_xyz(types, 'Point', (0.0, 0.0, height)))


def heave_message(types: Types, sample: HeaveSample) -> Any:
    """Build the ``geometry_msgs/PointStamped`` of a heave."""
    return point_message(types, sample.stamp, sample.frame_id, sample.height)


def _odometry(types: Types, header: Any, child: str, position: Any, orientation: Quaternion | None,
              pose_cov: Array, linear: Any, angular: Any, twist_cov: Array) -> Any:
    pose = types['geometry_msgs/msg/Pose'](
        position=_xyz(types, 'Point', position), orientation=_quaternion(types, orientation))
    twist = _twist(types, linear, angular)
    return types[ODOMETRY](
        header=header, child_frame_id=child,
        pose=types['geometry_msgs/msg/PoseWithCovariance'](pose=pose, covariance=pose_cov),
        twist=types['geometry_msgs/msg/TwistWithCovariance'](twist=twist, covariance=twist_cov))


def odometry_message(types: Types, sample: OdometrySample) -> Any:
    """Build a ``nav_msgs/Odometry``."""
    return _odometry(types, _header(types, sample.stamp, sample.frame_id), sample.child_frame_id,
                     sample.position, sample.orientation, _diagonal(sample.pose_var),
                     sample.linear_velocity, sample.angular_velocity, np.zeros(36))


def range_message(types: Types, sample: RangeSample) -> Any:
    """Build a ``sensor_msgs/Range`` without limits."""
    return types[RANGE](
        header=_header(types, sample.stamp, sample.frame_id), radiation_type=0,
        field_of_view=0.0, min_range=0.0, max_range=inf, range=sample.distance,
        variance=sample.var)


def velocity_message(types: Types, sample: VelocitySample) -> Any:
    """Build a ``geometry_msgs/TwistWithCovarianceStamped`` of a velocity alone."""
    return types[VELOCITY](
        header=_header(types, sample.stamp, sample.frame_id),
        twist=types['geometry_msgs/msg/TwistWithCovariance'](
            twist=_twist(types, sample.velocity),
            covariance=_diagonal((*sample.var, 0.0, 0.0, 0.0))))


def twist_message(types: Types, stamp: int, frame_id: str, velocity: Sequence[float]) -> Any:
    """Build a ``geometry_msgs/TwistStamped`` of a velocity (m/s) alone; stamp in ns."""
    return types[TWIST](header=_header(types, stamp, frame_id), twist=_twist(types, velocity))


def vector_message(types: Types, sample: VectorSample) -> Any:
    """Build a ``geometry_msgs/Vector3Stamped``."""
    return types[VECTOR](header=_header(types, sample.stamp, sample.frame_id),
                         vector=_xyz(types, 'Vector3', sample.vector))


def pose_message(types: Types, stamp: int, frame_id: str, position: Sequence[float],
                 orientation: Quaternion, cov: Array) -> Any:
    """
    Build a ``geometry_msgs/PoseWithCovarianceStamped``.

    Parameters
    ----------
    types : Types
        Message classes.
    stamp : int
        Nanoseconds.
    frame_id : str
        Frame of the pose.
    position, orientation
        Metres; unit quaternion x, y, z, w.
    cov : ndarray, shape (6, 6)
        Of x, y, z (m^2) and the turns about them (rad^2).

    """
    pose = types['geometry_msgs/msg/Pose'](
        position=_xyz(types, 'Point', position), orientation=_quaternion(types, orientation))
    return types[POSE](
        header=_header(types, stamp, frame_id),
        pose=types['geometry_msgs/msg/PoseWithCovariance'](pose=pose, covariance=cov.ravel()))


def estimate_message(types: Types, stamp: int, frame_id: str, child: str,
                     position: Sequence[float], orientation: Quaternion, pose_cov: Array,
                     linear: Sequence[float], angular: Sequence[float], twist_cov: Array) -> Any:
    """
    Build a ``nav_msgs/Odometry`` with full covariances.

    Parameters
    ----------
    types : Types
        Message classes.
    stamp : int
        Nanoseconds.
    frame_id, child : str
        Frame of the pose; of the twist.
    position, orientation
        Metres; unit quaternion x, y, z, w.
    linear, angular
        m/s, rad/s, in the axes of ``child``.
    pose_cov, twist_cov : ndarray, shape (6, 6)
        Linear before angular.

    """
    return _odometry(types, _header(types, stamp, frame_id), child, position, orientation,
                     pose_cov.ravel(), linear, angular, twist_cov.ravel())


def touchdown_message(types: Types, pose: TouchdownPose, frame_id: str, child: str) -> Any:
    """Build the ``nav_msgs/Odometry`` of a predicted touchdown point."""
    return _odometry(types, _header(types, pose.valid_at, frame_id), child, pose.position,
                     pose.orientation, pose.pose_cov.ravel(), pose.twist[:3], pose.twist[3:],
                     pose.twist_cov.ravel())


def forecast_message(types: Types, forecast: TouchdownForecast, frame_id: str,
                     joint: str) -> Any:
    """Build the ``trajectory_msgs/MultiDOFJointTrajectory`` of a forecast."""
    point_class = types['trajectory_msgs/msg/MultiDOFJointTrajectoryPoint']
    transform, twist = types['geometry_msgs/msg/Transform'], types['geometry_msgs/msg/Twist']
    vector, rotation = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Quaternion']
    zero = vector(x=0.0, y=0.0, z=0.0)
    points = [
        point_class(
            transforms=[transform(
                translation=vector(x=x, y=y, z=z), rotation=rotation(x=a, y=b, z=c, w=d))],
            velocities=[twist(linear=vector(x=u, y=v, z=w), angular=zero)],
            accelerations=[], time_from_start=duration)
        for duration, (x, y, z), (u, v, w), (a, b, c, d) in zip(
            _durations(types, forecast), forecast.position.tolist(), forecast.velocity.tolist(),
            (quaternion_from_rpy(roll, pitch, 0.0)
             for roll, pitch, _ in forecast.motion.mean.tolist()), strict=True)]
    return types[MULTI_DOF_TRAJECTORY](
        header=_header(types, forecast.issued_at, frame_id), joint_names=[joint], points=points)


def forecast_sd_message(types: Types, forecast: TouchdownForecast, frame_id: str) -> Any:
    """Build the ``trajectory_msgs/JointTrajectory`` of a forecast's standard deviations."""
    point_class = types['trajectory_msgs/msg/JointTrajectoryPoint']
    motion, nothing = forecast.motion, types.floats(())
    columns = [np.column_stack([sd, np.sqrt(cov[:, 0, 0]), np.sqrt(cov[:, 1, 1])])
               for sd, cov in ((forecast.height_sd, motion.cov),
                               (forecast.rate_sd, motion.rate_cov))]
    points = [
        point_class(positions=types.floats(sd), velocities=types.floats(rate_sd),
                    accelerations=nothing, effort=nothing, time_from_start=duration)
        for duration, sd, rate_sd in zip(_durations(types, forecast), *columns, strict=True)]
    return types[TRAJECTORY](
        header=_header(types, forecast.issued_at, frame_id),
        joint_names=['height', 'roll', 'pitch'], points=points)


def diagnostics_message(types: Types, stamp: int, hardware_id: str,
                        statuses: Iterable[tuple[str, int, str, Mapping[str, str]]]) -> Any:
    """
    Build a ``diagnostic_msgs/DiagnosticArray``.

    Parameters
    ----------
    types : Types
        Message classes.
    stamp : int
        Nanoseconds.
    hardware_id : str
        Full name of the node.
    statuses : iterable of (name, level, message, values)
        Level 0 ok, 1 warning, 2 error.

    """
    pair = types['diagnostic_msgs/msg/KeyValue']
    return types[DIAGNOSTICS](
        header=_header(types, stamp, ''),
        status=[types['diagnostic_msgs/msg/DiagnosticStatus'](
            level=types.byte(level), name=name, message=message, hardware_id=hardware_id,
            values=[pair(key=key, value=value) for key, value in values.items()])
            for name, level, message, values in statuses])


def window_message(types: Types, window: LandingWindow) -> Any:
    """Build the ``diagnostic_msgs/DiagnosticArray`` of a landing window; go, wait, no_go = 0-2."""
    values = {'state': window.state} | {
        name: f'{getattr(window, name):.3f}' for name in WINDOW_KEYS}
    level = WINDOW_STATES.index(window.state)
    return diagnostics_message(types, window.issued_at, '', [
        (WINDOW, level, window.state, values)])


def window_sample(msg: Any) -> LandingWindow:
    """
    Convert the ``diagnostic_msgs/DiagnosticArray`` of a landing window.

    Raises
    ------
    Rejected
        ``no landing window`` if it has no such status with all keys, a state and numbers.

    """
    values = {pair.key: pair.value for status in msg.status if status.name == WINDOW
              for pair in status.values}
    try:
        state = WINDOW_STATES[WINDOW_STATES.index(values['state'])]
        return LandingWindow(stamp_of(msg), state, *(float(values[key]) for key in WINDOW_KEYS))
    except (KeyError, ValueError):
        raise Rejected('no landing window') from None


CONVERTERS: Mapping[str, Callable[[Any], Any]] = {
    IMU: imu_sample, POINT: heave_sample, ODOMETRY: odometry_sample, RANGE: range_sample,
    VELOCITY: velocity_sample, MULTI_DOF_TRAJECTORY: forecast_sample, DIAGNOSTICS: window_sample}

BUILDERS: Mapping[type, tuple[str, Callable[[Types, Any], Any]]] = {
    ImuSample: (IMU, imu_message), HeaveSample: (POINT, heave_message),
    OdometrySample: (ODOMETRY, odometry_message), RangeSample: (RANGE, range_message),
    VelocitySample: (VELOCITY, velocity_message), VectorSample: (VECTOR, vector_message)}


def message(types: Types, sample: Any) -> Any:
    """Build the message of a sample, by its type."""
    _, build = BUILDERS[type(sample)]
    return build(types, sample)

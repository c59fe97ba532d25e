"""
Message <-> sample by attribute names: serves rclpy's classes and rosbags' alike.

``types`` gives the classes of one of the two by ROS type name, ``types.floats`` what it takes
for a ``float64[]`` and ``types.byte`` what it takes for a ``byte``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite, sqrt
from typing import Any, Protocol

import numpy as np

from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.samples import (
    Array,
    HeaveSample,
    ImuSample,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
    Quaternion,
    Rejected,
    TouchdownForecast,
    TouchdownPose,
    Vector3,
)
from deck_motion_ros.topics import (
    DIAGNOSTICS,
    IMU,
    MULTI_DOF_TRAJECTORY,
    ODOMETRY,
    POINT,
    TRAJECTORY,
)


class Types(Protocol):
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
    if not isfinite(sum(values)):  # not a number and infinity stay so in a sum
        raise Rejected('not finite')


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


def _time(types: Types, stamp: int) -> Any:
    return types['builtin_interfaces/msg/Time'](
        sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


def _durations(types: Types, forecast: TouchdownForecast) -> list[Any]:
    duration = types['builtin_interfaces/msg/Duration']
    totals = map(nanoseconds, forecast.horizons.tolist())
    return [duration(sec=total // NANOSECONDS, nanosec=total % NANOSECONDS) for total in totals]


def _header(types: Types, stamp: int, frame_id: str) -> Any:
    return types['std_msgs/msg/Header'](stamp=_time(types, stamp), frame_id=frame_id)


def _xyz(types: Types, name: str, vec: Sequence[float] | Array) -> Any:
    x, y, z = vec
    return types['geometry_msgs/msg/' + name](x=float(x), y=float(y), z=float(z))


def _quaternion(types: Types, quaternion: Quaternion | None) -> Any:
    x, y, z, w = quaternion or (0.0, 0.0, 0.0, 0.0)
    return types['geometry_msgs/msg/Quaternion'](x=x, y=y, z=z, w=w)


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
    twist = types['geometry_msgs/msg/Twist'](
        linear=_xyz(types, 'Vector3', linear), angular=_xyz(types, 'Vector3', angular))
    return types[ODOMETRY](
        header=header, child_frame_id=child,
        pose=types['geometry_msgs/msg/PoseWithCovariance'](pose=pose, covariance=pose_cov),
        twist=types['geometry_msgs/msg/TwistWithCovariance'](twist=twist, covariance=twist_cov))


def odometry_message(types: Types, sample: OdometrySample) -> Any:
    """Build a ``nav_msgs/Odometry``."""
    return _odometry(types, _header(types, sample.stamp, sample.frame_id), sample.child_frame_id,
                     sample.position, sample.orientation, _diagonal(sample.pose_var),
                     sample.linear_velocity, sample.angular_velocity, np.zeros(36))


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
    columns = [np.column_stack([sd, np.sqrt(cov[:, 0, 0]), np.sqrt(cov[:, 1, 1])]).tolist()
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

"""Name, type, frame and direction of every topic: one table for nodes, bags and documentation."""

from __future__ import annotations

from dataclasses import dataclass

IMU = 'sensor_msgs/msg/Imu'
POINT = 'geometry_msgs/msg/PointStamped'
ODOMETRY = 'nav_msgs/msg/Odometry'
MULTI_DOF_TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'


@dataclass(frozen=True, slots=True)
class Topic:
    """
    One topic of the contract.

    Attributes
    ----------
    name : str
        Relative name; ``/diagnostics`` alone is absolute.
    type : str
        ROS message type.
    frame : str
        Name of the frame in the header, by its default; ``''`` where there is none.
    publisher : str
        Node that publishes it; ``''`` where it comes from a sensor or a simulator.
    subscribers : tuple of str
        Nodes of this package that use it.
    meaning : str
        One sentence.

    """

    name: str
    type: str
    frame: str
    publisher: str
    subscribers: tuple[str, ...]
    meaning: str


TOPICS = (
    Topic('ship/imu', IMU, 'ship_base_link', 'simulator', ('predictor',),
          'Attitude body to ENU, turn rate, specific force.'),
    Topic('ship/heave', POINT, 'ship_level', 'simulator', ('predictor',),
          'Height of the reference point above its rest in z, up.'),
    Topic('ship/odometry', ODOMETRY, 'ship_level', '', ('predictor',),
          'Instead of the two above: attitude and heave (z) in one message.'),
    Topic('ship/truth', ODOMETRY, 'ship_level', 'simulator', (),
          'True motion of the reference point, without noise and delay.'),
    Topic('touchdown/height', POINT, 'touchdown_rest', 'predictor', (),
          'Height of the touchdown point above its rest; the stamp is the time it is valid for.'),
    Topic('touchdown/prediction', ODOMETRY, 'ship_level', 'predictor', (),
          'Pose and twist of the touchdown point with covariances, at the same stamp.'),
    Topic('touchdown/forecast', MULTI_DOF_TRAJECTORY, 'ship_level', 'predictor', (),
          'The same 0.5, 1.0 ... 10 s after the newest measurement, which is the stamp.'),
    Topic('touchdown/forecast_sd', TRAJECTORY, 'ship_level', 'predictor', (),
          'Standard deviations of the forecast: joints height, roll, pitch; velocities: of the '
          'rates.'),
    Topic('/diagnostics', DIAGNOSTICS, '', 'every node', (),
          'State, counts of accepted and rejected messages, by wall clock once a second.'),
)

BY_NAME = {topic.name: topic for topic in TOPICS}


def inputs(node: str) -> tuple[Topic, ...]:
    """List the topics a node subscribes to, in the order in which one stamp's messages act."""
    return tuple(topic for topic in TOPICS if node in topic.subscribers)


def outputs(node: str) -> tuple[Topic, ...]:
    """List the topics a node publishes, ``/diagnostics`` aside."""
    return tuple(topic for topic in TOPICS if topic.publisher == node)

"""Name, type, frame and direction of every topic: one table for nodes, bags and documentation."""

from __future__ import annotations

from dataclasses import dataclass

IMU = 'sensor_msgs/msg/Imu'
POINT = 'geometry_msgs/msg/PointStamped'
ODOMETRY = 'nav_msgs/msg/Odometry'
MULTI_DOF_TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
RANGE = 'sensor_msgs/msg/Range'
VELOCITY = 'geometry_msgs/msg/TwistWithCovarianceStamped'
TWIST = 'geometry_msgs/msg/TwistStamped'
VECTOR = 'geometry_msgs/msg/Vector3Stamped'
POSE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
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
    Topic('ship/imu', IMU, 'ship_base_link', 'simulator', ('predictor', 'landing'),
          'Attitude body to ENU, turn rate, specific force.'),
    Topic('ship/heave', POINT, 'ship_level', 'simulator', ('predictor',),
          'Height of the reference point above its rest in z, up.'),
    Topic('ship/odometry', ODOMETRY, 'ship_level', '', ('predictor',),
          'Instead of the two above: attitude and heave (z) in one message.'),
    Topic('ship/truth', ODOMETRY, 'ship_level', 'simulator', (),
          'True motion of the reference point, without noise and delay.'),
    Topic('touchdown/height', POINT, 'touchdown_rest', 'predictor', (),
          'Height of the touchdown point above its rest; the stamp is the time it is valid for.'),
    Topic('touchdown/prediction', ODOMETRY, 'ship_level', 'predictor', ('guidance',),
          'Pose and twist of the touchdown point with covariances, at the same stamp.'),
    Topic('touchdown/forecast', MULTI_DOF_TRAJECTORY, 'ship_level', 'predictor', ('guidance',),
          'The same 0.5, 1.0 ... 10 s after the newest measurement, which is the stamp.'),
    Topic('touchdown/forecast_sd', TRAJECTORY, 'ship_level', 'predictor', (),
          'Standard deviations of the forecast: joints height, roll, pitch; velocities: of the '
          'rates.'),
    Topic('touchdown/window', DIAGNOSTICS, '', 'predictor', ('guidance',),
          'Landing window: state (go, wait, no_go) with seconds left or until clear, probability '
          'that the deck stays within limits, next crest and trough.'),
    Topic('master/imu', IMU, 'ship_base_link', 'simulator', ('alignment',),
          "The ship's inertial unit: attitude body to ENU, turn rate, specific force."),
    Topic('slave/imu', IMU, 'uav_base_link', 'simulator', ('alignment',),
          "The aircraft's inertial unit: turn rate, specific force."),
    Topic('master/velocity', VELOCITY, 'map', 'simulator', ('alignment',),
          "Velocity of the ship's inertial unit, east, north, up."),
    Topic('ldv/velocity', VELOCITY, 'track', 'simulator', ('alignment',),
          'Laser Doppler velocimeter: speed of the aircraft along the catapult in x.'),
    Topic('alignment/truth', VECTOR, 'uav_base_link', 'simulator', (),
          'True misalignment, as in alignment/misalignment.'),
    Topic('alignment/misalignment', VECTOR, 'uav_base_link', 'alignment', (),
          'Misalignment mu, C_slave = C_master Exp(mu) at the first joined stamp, about forward, '
          'left, up (rad).'),
    Topic('alignment/attitude', POSE, 'map', 'alignment', (),
          'Attitude of the slave, body to ENU; covariance about the axes of map; no position.'),
    Topic('uwb/range', RANGE, '', 'simulator', ('landing',),
          'Distance to the anchor that frame_id names, each with its own stamp.'),
    Topic('uav/imu', IMU, 'uav_base_link', 'simulator', ('landing', 'altitude'),
          "The aircraft's inertial unit: attitude body to ENU, turn rate, specific force."),
    Topic('landing/truth', ODOMETRY, 'deck', 'simulator', (),
          'True position and velocity of the aircraft, as in landing/odometry.'),
    Topic('landing/odometry', ODOMETRY, 'deck', 'landing', ('guidance',),
          'Position of the aircraft over the deck and its rate of change, with covariances.'),
    Topic('landing/pose', POSE, 'deck', 'landing', (),
          'The same position alone.'),
    Topic('landing/cmd_vel', TWIST, 'deck', 'guidance', (),
          'Velocity command over the deck.'),
    Topic('altimeter/range', RANGE, 'uav_level', 'simulator', ('altitude',),
          'Vertical height above the water.'),
    Topic('altimeter/rate', VELOCITY, 'uav_level', 'simulator', ('altitude',),
          'Rate of that height in z, up.'),
    Topic('altitude/truth', ODOMETRY, 'mean_sea', 'simulator', (),
          'True height above mean sea level and its rate, as in altitude/odometry.'),
    Topic('altitude/odometry', ODOMETRY, 'mean_sea', 'altitude', (),
          'Height above mean sea level (z) and its rate, with covariances.'),
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

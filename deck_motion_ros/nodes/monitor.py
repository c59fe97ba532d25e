"""The demo's observer: what the ship does now, what is forecast, how good that has been."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from deck_motion_ros.config import parameter
from deck_motion_ros.geometry import height_above_rest, rpy_from_quaternion
from deck_motion_ros.messages import odometry_sample
from deck_motion_ros.nodes.parameters import configuration
from deck_motion_ros.nodes.shell import sensor_qos
from deck_motion_ros.samples import Vector3


@dataclass(frozen=True, slots=True)
class MonitorConfig:
    """Parameters of the demo's observer."""

    horizon: float = parameter(3.0, 'Horizon of the predictor that is watched', 's', 0.1, 10.0)
    lever_arm: Vector3 = parameter((-67.97, 3.05, 19.5), 'Touchdown point in ship_base_link', 'm',
                                   length=3)


class MonitorNode(Node):
    """
    Watch ``ship/truth`` and ``touchdown/*``.

    Attributes
    ----------
    motion : tuple of 3 float
        True roll, pitch (rad), heave (m) now; NaN before the first message.
    height, predicted, predicted_sd : float
        Of the touchdown point: now, ahead (m).
    score : str
        What the predictor says of its forecasts.
    rejected : int
        Messages that the predictor could not use.

    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('monitor', **kwargs)
        self._config = configuration(self, MonitorConfig)
        self.motion: Vector3 = (nan, nan, nan)
        self.height = self.predicted = self.predicted_sd = nan
        self.score = '-'
        self.rejected = 0
        for kind, topic, act in ((Odometry, 'ship/truth', self._on_truth),
                                 (PointStamped, 'touchdown/height', self._on_height),
                                 (JointTrajectory, 'touchdown/forecast_sd', self._on_sd),
                                 (DiagnosticArray, '/diagnostics', self._on_diagnostics)):
            self.create_subscription(kind, topic, act, sensor_qos())

    def _on_truth(self, msg: Any) -> None:
        sample = odometry_sample(msg)
        if sample.orientation is None:
            return
        roll, pitch, _ = rpy_from_quaternion(sample.orientation)
        self.motion = (roll, pitch, sample.position[2])
        self.height = height_above_rest(*self.motion, self._config.lever_arm)

    def _on_height(self, msg: Any) -> None:
        self.predicted = msg.point.z

    def _on_sd(self, msg: Any) -> None:
        times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9
                 for point in msg.points]
        nearest = min(range(len(times)), key=lambda k: abs(times[k] - self._config.horizon))
        self.predicted_sd = msg.points[nearest].positions[0]

    def _on_diagnostics(self, msg: Any) -> None:
        for status in msg.status:
            if status.name == 'predictor: input':
                self.rejected = sum(int(pair.value) for pair in status.values
                                    if pair.key.startswith('rejected '))
            elif status.name == 'predictor: score':
                self.score = status.message

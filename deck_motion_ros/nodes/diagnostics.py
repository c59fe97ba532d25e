"""What a node says of itself on ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from deck_motion_ros.messages import diagnostics_message
from deck_motion_ros.nodes.shell import output_qos, RclTypes


class DiagnosticsPublisher:
    """
    Publish ``/diagnostics`` once a second of wall time, whatever the input does.

    Parameters
    ----------
    node : Node
        Its full name is the ``hardware_id``.
    report : callable
        Returns statuses as (name, level, message, {key: text}); level 0 ok, 1 warning, 2 error.

    """

    def __init__(self, node: Node,
                 report: Callable[[], Iterable[tuple[str, int, str, dict[str, str]]]]) -> None:
        self._node, self._report, self._types = node, report, RclTypes()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', output_qos())
        self._timer = node.create_timer(
            1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self) -> None:
        """Publish one array now."""
        self._publisher.publish(diagnostics_message(
            self._types, self._node.get_clock().now().nanoseconds,
            self._node.get_fully_qualified_name(), self._report()))

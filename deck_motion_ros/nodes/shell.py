"""What every node shares: start and end, parameters, quality of service, diagnostics."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from importlib import import_module
import signal
import sys
from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions

from deck_motion_ros.config import configured, Parameter, parameters, unknown_names
from deck_motion_ros.messages import diagnostics_message

T = TypeVar('T')


class Stop(Exception):
    """Raised in a callback to end the node; ``status`` is the exit status, text the reason."""

    def __init__(self, text: str = '', status: int = 0) -> None:
        super().__init__(text)
        self.status = status


def run(node_class: Callable[[], Node], args: list[str] | None = None) -> None:
    """
    Run one node until SIGINT, SIGTERM or its own :class:`Stop`, then end the process.

    Status 0 after a clean end, 2 after wrong parameters (one line says which). A signal never
    breaks into a callback: the node ends between two.
    """
    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: ended.append(number))
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    node, status = None, 0
    try:
        node = node_class()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not ended:
            executor.spin_once(timeout_sec=0.1)
    except ExternalShutdownException:
        pass
    except Stop as stop:
        status = _said(stop)
    except ValueError as error:
        if node is not None:
            raise
        status = _said(Stop(f'error: {error}', 2))
    finally:
        try:
            if node is not None:
                node.destroy_node()
        except Stop as stop:
            status = _said(stop)
        rclpy.try_shutdown()
    sys.exit(status)


def _said(stop: Stop) -> int:
    if str(stop):
        print(stop, file=sys.stderr if stop.status else sys.stdout, flush=True)
    return stop.status


def configuration(node: Node, kind: type[T]) -> T:
    """
    Declare every parameter of ``kind`` on the node and return the configuration.

    Parameters are read only: a node's set-up does not change under way. Overrides that no
    parameter takes are named in a warning.

    Raises
    ------
    ValueError
        If a value breaks its parameter's rule; the text names the parameter.

    """
    values, overrides = {}, node._parameter_overrides
    for name, rule in parameters(kind).items():
        if rule.default == () and name in overrides and overrides[name].value is None:
            del overrides[name]  # what rcl makes of [] in a parameter file
        if name in overrides:  # checked in our words, and 3 taken where 3.0 is meant
            value = rule.check(overrides[name].value)
            overrides[name] = RosParameter(
                name, value=list(value) if isinstance(value, tuple) else value)
        default = list(rule.default) if isinstance(rule.default, tuple) else rule.default
        declared = node.declare_parameter(
            name, RosParameter.Type.STRING_ARRAY if default == [] else default,
            _descriptor(rule))
        values[name] = declared.value if declared.value is not None else []
    unknown = unknown_names(kind, overrides)
    if unknown:
        node.get_logger().warning(
            f"unknown parameter{'s' * (len(unknown) > 1)} {', '.join(unknown)} ignored")
    return configured(kind, values)


def _descriptor(rule: Parameter) -> ParameterDescriptor:
    limits = rule.span() or '|'.join(rule.choices)
    text = ParameterDescriptor(
        description=f'{rule.meaning} ({limits})' if limits else rule.meaning,
        additional_constraints=', '.join(rule.choices), read_only=True)
    if rule.low is not None and rule.high is not None:
        if isinstance(rule.default, float) and rule.default == rule.default:
            text.floating_point_range = [FloatingPointRange(
                from_value=float(rule.low), to_value=float(rule.high))]
        elif type(rule.default) is int:
            text.integer_range = [IntegerRange(
                from_value=int(rule.low), to_value=int(rule.high), step=1)]
    return text


def sensor_qos(depth: int = 1000) -> QoSProfile:
    """Return the quality of service of sensor subscriptions: best effort, keep last 1000."""
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST,
                      reliability=ReliabilityPolicy.BEST_EFFORT)


def output_qos(depth: int = 100) -> QoSProfile:
    """Return the quality of service of publishers: reliable, keep last 100."""
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST,
                      reliability=ReliabilityPolicy.RELIABLE)


def overridable() -> QoSOverridingOptions:
    """Let parameters ``qos_overrides.<topic>.publisher.depth`` and the like win."""
    return QoSOverridingOptions.with_default_policies()


class RclTypes:
    """rclpy's message classes by ROS type name, for :mod:`deck_motion_ros.messages`."""

    def __init__(self) -> None:
        self._classes: dict[str, type] = {}

    def __getitem__(self, name: str) -> type:
        if name not in self._classes:
            package, _, kind = name.split('/')
            self._classes[name] = getattr(import_module(f'{package}.msg'), kind)
        return self._classes[name]

    def floats(self, values: Iterable[float]) -> array[float]:
        """Return what rclpy takes for a float64[] field."""
        return array('d', values)

    def byte(self, value: int) -> bytes:
        """Return what rclpy takes for a byte field."""
        return bytes([value])


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

"""What every node shares: start and end, quality of service, message classes."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from importlib import import_module
import signal
import sys

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

USAGE = ('a node takes --ros-args [-p NAME:=VALUE] [--params-file FILE] [-r OLD:=NEW] and nothing '
         'else; its parameters with units, ranges and defaults are in doc/interfaces.md')


class Stop(Exception):
    """Raised in a callback to end the node; ``status`` is the exit status, text the reason."""

    def __init__(self, text: str = '', status: int = 0) -> None:
        super().__init__(text)
        self.status = status


def run(node_class: Callable[[], Node]) -> None:
    """
    Run one node until SIGINT, SIGTERM or its own :class:`Stop`, then end the process.

    Status 0 after a clean end, 2 after wrong arguments or parameters (one line says which). A
    signal never breaks into a callback: the node ends between two.
    """
    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: ended.append(number))
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # followed by places in the sources of rcl
        sys.exit(_said(Stop(f'error: ROS arguments: {error}'.partition(', at /')[0], 2)))
    words = remove_ros_args()[1:]  # a parameter without -p would be lost in silence
    if words:
        asked = words[0] in ('-h', '--help')
        sys.exit(_said(Stop(USAGE if asked else f'error: {words[0]}: {USAGE}', 0 if asked else 2)))
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
    for number in (signal.SIGINT, signal.SIGTERM):  # a second one must not kill what has ended
        signal.signal(number, signal.SIG_IGN)
    sys.exit(status)


def _said(stop: Stop) -> int:
    if str(stop):
        print(stop, file=sys.stderr if stop.status else sys.stdout, flush=True)
    return stop.status


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

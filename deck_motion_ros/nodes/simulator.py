"""The simulator node: sensors and true motion, by the clock or as fast as it goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage

from deck_motion_ros import messages
from deck_motion_ros.nodes.diagnostics import DiagnosticsPublisher
from deck_motion_ros.nodes.parameters import configuration
from deck_motion_ros.nodes.shell import output_qos, overridable, RclTypes, run, Stop
from deck_motion_ros.pipelines import OK, settings, Status, WARN
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.runs import scenario
from deck_motion_ros.simulation.simulator import Event, SimulatorConfig
from deck_motion_ros.topics import BY_NAME

BURST = 60  # messages at most in one callback when catching up
SETTLED = NANOSECONDS // 2  # no new subscriber for this long: all that were coming are there
FAST_START = NANOSECONDS  # first stamp as fast as possible: every run alike, and not 0


class SimulatorNode(Node):
    """
    Publish what a scenario of :mod:`deck_motion_ros.simulation.runs` gives.

    In real time a sample is published when the node's clock reaches it: at start + k / rate, so
    that nothing drifts; after a hold-up it catches up in bounded bursts. Otherwise ``/clock`` goes
    ahead of each sample, ``fast_rate`` samples a second: nothing tells a publisher what a slow
    reader has lost.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('simulator', **kwargs)
        chosen = self._parameter_overrides.get('scenario')
        self._scenario = scenario(chosen.value if chosen else SimulatorConfig().scenario)
        self._config = config = configuration(self, self._scenario.config)
        self._types = RclTypes()
        self._outputs = {
            name: self.create_publisher(
                self._types[BY_NAME[name].type], name, output_qos(),
                qos_overriding_options=overridable())
            for name in self._scenario.topics}
        self._ahead = None if config.realtime else self.create_publisher(
            ClockMessage, '/clock', output_qos())
        self._events: Iterator[Event] | None = None
        self._next: Event | None = None
        self._counts: Counter[str] = Counter()
        self._diagnostics = DiagnosticsPublisher(self, self._report)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._readers, self._changed = [], 0
        self._alarm = self.create_timer(0.05, self._wait, clock=self._steady)

    def _wait(self) -> None:
        """Begin once the clock runs and the wanted subscribers are there, the last a while ago."""
        config, steady = self._config, self._steady.now().nanoseconds
        now = self.get_clock().now().nanoseconds if config.realtime else FAST_START
        readers = [output.get_subscription_count() for output in self._outputs.values()]
        if readers != self._readers:
            self._readers, self._changed = readers, steady
        settled = not config.subscribers or steady - self._changed >= SETTLED
        if now == 0 or readers[0] < config.subscribers or not settled:
            return
        self.destroy_timer(self._alarm)
        self._events = iter(self._scenario.source(config, now))
        self._next = next(self._events, None)
        self._alarm = self.create_timer(
            0.0, self._follow_clock) if config.realtime else self.create_timer(
            1 / config.fast_rate, self._lead_clock, clock=self._steady)

    def _follow_clock(self) -> None:
        now = self.get_clock().now().nanoseconds
        for _ in range(BURST):
            if self._upcoming().time > now:
                break
            self._publish()
        ahead = self._next.time - self.get_clock().now().nanoseconds if self._next else 0
        self._alarm.timer_period_ns = max(ahead, 0)
        self._alarm.reset()

    def _lead_clock(self) -> None:
        now = self._upcoming().time
        self._ahead.publish(ClockMessage(clock=Time(nanoseconds=now).to_msg()))
        while self._next is not None and self._next.time == now:
            self._publish()

    def _upcoming(self) -> Event:
        if self._next is None:
            self._alarm.cancel()
            for publisher in self._outputs.values():
                publisher.wait_for_all_acked(Duration(seconds=1))
            raise Stop(f'{max(self._counts.values(), default=0)} samples published')
        return self._next

    def _publish(self) -> None:
        _, topic, sample = self._next
        self._outputs[topic].publish(messages.message(self._types, sample))
        self._counts[topic] += 1
        self._next = next(self._events, None)

    def _report(self) -> list[Status]:
        values = {f'published {topic}': str(count) for topic, count in self._counts.items()}
        level, text = OK, 'publishing'
        if self._events is None:
            level, text = WARN, 'waiting for the clock or for subscribers'
        elif self._config.realtime and self._next is not None:
            behind = self.get_clock().now().nanoseconds - self._next.time
            if behind > NANOSECONDS:
                level, text = WARN, f'{behind / NANOSECONDS:.1f} s behind: the rate is too high'
        return [('simulator: output', level, text, values),
                ('simulator: settings', OK, self._config.scenario, settings(self._config))]


def main() -> None:
    """Run the node."""
    run(SimulatorNode)


if __name__ == '__main__':
    main()

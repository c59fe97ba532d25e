"""The player: a bag's messages as they were, at any speed, none before there is a listener."""

from __future__ import annotations

from collections import Counter

from builtin_interfaces.msg import Time
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from deck_motion_ros.nodes.diagnostics import DiagnosticsPublisher
from deck_motion_ros.nodes.parameters import configuration
from deck_motion_ros.nodes.raw_topics import offer
from deck_motion_ros.nodes.shell import output_qos, RclTypes, run, Stop
from deck_motion_ros.recording import BagReader, PlayerConfig, schedule
from deck_motion_ros.samples import NANOSECONDS, nanoseconds

LOOK_PERIOD = 0.05  # s
SETTLED = NANOSECONDS // 2  # no new subscriber for this long: all that were coming are there
SHORTEST = 1000  # ns: period of a timer whose time has come


class PlayerNode(Node):
    """Play a bag once, or over and over, and end."""

    def __init__(self, **kwargs):
        super().__init__('player', **kwargs)
        self._config = config = configuration(self, PlayerConfig)
        if not config.bag:
            raise ValueError("parameter 'bag' is not set: the folder of the bag to play")
        self._bag = BagReader(config.bag)
        self._outputs = self._publish_topics()
        self._events = schedule(
            self._bag, [name for name in self._outputs if name], config)
        self._next = next(self._events)
        self._played = Counter()
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._opened = self._changed = self._now()
        self._matched = {}
        self._timer = self.create_timer(LOOK_PERIOD, self._wait, clock=self._clock)
        self._diagnostics = DiagnosticsPublisher(self, self._report)

    def _publish_topics(self):
        """Make a publisher for each topic that is wanted, under its new name, and /clock."""
        config, topics, types = self._config, self._bag.bag_topics, RclTypes()
        renamed = dict(self._rule(text) for text in config.remap)
        wanted = [self.resolve_topic_name(name) for name in config.topics] or list(topics)
        missing = [name for name in (*wanted, *renamed) if name not in topics]
        if missing:
            raise ValueError(f"{config.bag} has no topic {', '.join(missing)}")
        outputs = {}
        for name in wanted:
            if name == '/clock' and config.clock:
                continue
            try:
                outputs[name] = self.create_publisher(
                    types[topics[name].type], renamed.get(name, name), offer(topics[name].qos))
            except (ImportError, AttributeError, ValueError) as error:
                self.get_logger().error(f'{name} is not played: {error}')
        if config.clock:
            outputs[''] = self.create_publisher(ClockMessage, '/clock', output_qos())
        return outputs

    def _rule(self, text):
        old, arrow, new = text.partition(':=')
        if not (old and arrow and new):
            raise ValueError(f"parameter 'remap' takes old:=new, not '{text}'")
        return self.resolve_topic_name(old), new

    def _now(self):
        return self._clock.now().nanoseconds

    def _wait(self):
        """Begin once the subscribers are there."""
        now, config = self._now(), self._config
        matched = {output.topic_name: output.get_subscription_count()
                   for name, output in self._outputs.items() if name}
        if matched != self._matched:
            self._matched, self._changed = matched, now
        needed = [self.resolve_topic_name(name) for name in config.wait_for_subscribers]
        alone = [name for name in needed or matched if not matched.get(name)]
        found = not alone if needed else len(alone) < len(matched)
        late = now - self._opened >= nanoseconds(config.wait_timeout)
        if late or (found and now - self._changed >= SETTLED):
            if config.wait_timeout and not found:
                self.get_logger().warning(f"no subscriber of {', '.join(alone)}: playing anyway")
            self._begun = now
            self._timer.callback = self._play
            self._play()

    def _play(self):
        """Publish what is due and set the timer to what comes next."""
        while (left := self._begun + self._next.due - self._now()) <= 0:
            _, time, topic, data = self._next
            self._outputs[topic].publish(data if topic else ClockMessage(clock=Time(
                sec=time // NANOSECONDS, nanosec=time % NANOSECONDS)))
            self._played[topic] += 1
            self._next = next(self._events, None)
            if self._next is None:
                self._end()
        self._timer.timer_period_ns = max(left, SHORTEST)
        self._timer.reset()

    def _end(self):
        self._timer.cancel()
        for output in self._outputs.values():
            output.wait_for_all_acked(Duration(seconds=2))
        ticks = self._played.pop('', 0)
        raise Stop(f'{self._played.total()} messages of {len(self._played)} topics played'
                   + (f', {ticks} ticks of /clock' if ticks else ''))

    def _report(self):
        yield ('player', 0, f'playing {self._config.bag}' if self._played else 'waiting',
               {'played': str(self._played.total()), 'topics': str(len(self._outputs))})


def main():
    """Run the player."""
    run(PlayerNode)


if __name__ == '__main__':
    main()

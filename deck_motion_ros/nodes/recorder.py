"""The recorder: topics as they come, raw, into a bag that the real ``ros2 bag`` reads."""

from __future__ import annotations

from datetime import datetime
from functools import partial

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from deck_motion_ros.nodes.diagnostics import DiagnosticsPublisher
from deck_motion_ros.nodes.parameters import configuration
from deck_motion_ros.nodes.raw_topics import Polled, request, stored_qos, waiting
from deck_motion_ros.nodes.shell import RclTypes, run, Stop
from deck_motion_ros.recording import (
    BackgroundWriter,
    BagWriter,
    describe,
    RecorderConfig,
    SequenceGaps,
    TopicChoice,
)

LOOK_PERIOD = 0.1  # s: how soon a new topic is seen
TAKE_PERIOD = 0.02  # s: the middleware stamps messages as they come, taking them can wait


class RecorderNode(Node):
    """Record topics, those that appear later too."""

    def __init__(self, **kwargs):
        super().__init__('recorder', **kwargs)
        config = configuration(self, RecorderConfig)
        self._choice = TopicChoice([self.resolve_topic_name(name) for name in config.topics],
                                   config.pattern, config.exclude)
        self._depth = config.queue
        self._simulated = self.get_parameter('use_sim_time').value
        self._types = RclTypes()
        self._folder = config.output or datetime.now().strftime('rosbag2_%Y_%m_%d-%H_%M_%S')
        self._writer = BackgroundWriter(BagWriter(
            self._folder, compression=config.compression, max_size=config.max_size,
            max_duration=config.max_duration))
        self._topics = {}  # subscription by name; None where there cannot be one
        self._gaps = SequenceGaps()
        self._unheard = set()  # topics with a publisher that offers too little
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers = [self.create_timer(LOOK_PERIOD, self._look, clock=steady)]
        self._group = None  # simulated time is that of the moment when a message comes
        if not self._simulated:
            self._group = Polled()
            self._timers.append(self.create_timer(TAKE_PERIOD, self._take_all, clock=steady))
        self._diagnostics = DiagnosticsPublisher(self, self._report)
        self.get_logger().info(f'recording to {self._folder}')

    @property
    def recorded(self):
        """Return how many messages have come."""
        return self._writer.taken

    def _look(self):
        """Subscribe to what is new, or end if the bag cannot be written."""
        if self._writer.error:
            raise Stop(f'error: {self._writer.error}', status=1)
        for name, kinds in self.get_topic_names_and_types():
            if name not in self._topics and name in self._choice:
                publishers = self.get_publishers_info_by_topic(name)
                if publishers:
                    self._topics[name] = self._subscribe(name, kinds, publishers)

    def _subscribe(self, name, kinds, publishers):
        try:
            if len(kinds) > 1:
                raise ValueError(f"it has the types {', '.join(kinds)}")
            message_class = self._types[kinds[0]]
        except (ImportError, AttributeError, ValueError) as error:
            self.get_logger().error(f'{name} is not recorded: {error}')
            return None
        offers = [stored_qos(publisher.qos_profile) for publisher in publishers]
        hashes = {str(publisher.topic_type_hash) for publisher in publishers} - {'INVALID'}
        self._writer.add_topic(
            name, kinds[0], hashes.pop() if len(hashes) == 1 else None, offers)
        if not describe(kinds[0])[0]:
            self.get_logger().warning(f'{name}: no definition of {kinds[0]} found, none stored')
        qos, mixed = request(offers, self._depth)
        if mixed:
            self.get_logger().warning(
                f'{name}: its publishers differ, so it is recorded {qos.reliability.name} and '
                f'{qos.durability.name}: messages may be missing')
        return self.create_subscription(
            message_class, name, partial(self._take, name), qos, raw=True,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))

    def _take_all(self):
        for name, subscription in self._subscribed():
            for data, info in waiting(subscription, self._depth):
                self._take(name, data, info)

    def _take(self, name, data, info):
        received, sent = info['received_timestamp'], info['source_timestamp']
        self._gaps.note(name, info['publication_sequence_number'])
        time = self.get_clock().now().nanoseconds if self._simulated else received
        (self._writer.write if time else self._writer.hold)(name, time or received, data, sent)

    def _subscribed(self):
        return ((name, item) for name, item in self._topics.items() if item is not None)

    def _report(self):
        unheard = {name for name, subscription in self._subscribed()
                   if self.count_publishers(name) > subscription.get_publisher_count()}
        lasting, self._unheard = sorted(unheard & self._unheard), unheard
        error, missing = self._writer.error, self._gaps.missing.total()
        yield ('recorder', 2 if error else 1 if missing or lasting else 0,
               str(error or f'recording to {self._folder}'),
               {'received': str(self._writer.taken),
                'on disk': str(self._writer.saved), 'missing': str(missing),
                'topics': str(len(self._topics)), 'incompatible publishers': ', '.join(lasting)})

    def destroy_node(self):
        """Write the rest, finish the bag and say what it holds."""
        writer, told = self._writer, self._writer.error
        if not self._simulated:
            self._take_all()
        writer.close()
        missing = self._gaps.missing.total() + writer.taken - writer.saved
        self.get_logger().info(
            f'{writer.saved} messages of {len(self._topics)} topics in {self._folder}'
            + (f', {missing} missing' if missing else ''))
        super().destroy_node()
        if writer.error is not told:
            raise Stop(f'error: {writer.error}', status=1)


def main():
    """Run the recorder."""
    run(RecorderNode)


if __name__ == '__main__':
    main()

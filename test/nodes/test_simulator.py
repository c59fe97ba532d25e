"""The simulator node: what it publishes is what the pure simulator gives, by whatever clock."""

from functools import partial
import itertools

import pytest

rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

from deck_motion_ros import messages  # noqa: E402
from deck_motion_ros.config import configured  # noqa: E402
from deck_motion_ros.nodes.shell import RclTypes, Stop  # noqa: E402
from deck_motion_ros.nodes.simulator import FAST_START, SimulatorNode  # noqa: E402
from deck_motion_ros.simulation.simulator import ShipSimulator, SimulatorConfig  # noqa: E402
from deck_motion_ros.topics import BY_NAME  # noqa: E402

SAMPLES = {'ship/imu': (Imu, messages.imu_message, messages.imu_sample),
           'ship/heave': (PointStamped, messages.heave_message, messages.heave_sample),
           'ship/truth': (Odometry, messages.odometry_message, messages.odometry_sample)}
SMALL = {'waves': 20, 'duration': 0.5, 'rate': 100.0, 'subscribers': 1}


@pytest.fixture
def simulator(context, executor):
    """Return a function that makes a simulator node with the parameters given."""
    def make(**values):
        node = SimulatorNode(context=context, parameter_overrides=[
            Parameter(name, value=value) for name, value in values.items()])
        executor.add_node(node)
        return node
    return make


@pytest.fixture
def listener(context, executor):
    """Return a node and what arrives at it, as (topic, sample or message)."""
    node, heard = rclpy.create_node('listener', context=context), []

    def hear(topic, sample, msg):
        heard.append((topic, sample(msg)))

    for topic, (kind, _, sample) in SAMPLES.items():
        node.create_subscription(kind, topic, partial(hear, topic, sample), QoSProfile(depth=1000))
    executor.add_node(node)
    return node, heard


def spin_to_the_end(executor):
    """Step until the simulator ends; return its last words."""
    with pytest.raises(Stop) as stop:
        for _ in range(20000):
            executor.spin_once(timeout_sec=0.1)
    assert stop.value.status == 0
    return str(stop.value)


def of(heard, topic):
    return [sample for name, sample in heard if name == topic]


def expected(start, **values):
    """Return the samples of the pure simulator by topic, through a message and back."""
    events = list(ShipSimulator(configured(SimulatorConfig, values), start))
    return {topic: [sample(message(RclTypes(), event.sample))
                    for event in events if event.topic == topic]
            for topic, (_, message, sample) in SAMPLES.items()}


@pytest.mark.parametrize('values', [
    {}, {'scenario': 'shaping', 'rate': 20.0, 'duration': 3.0},
    {'delay': [0.0, 0.05], 'jitter': [0.002, 0.0], 'dropout': [0.3, 0.0]}])
def test_fast_run_is_the_pure_run_with_the_clock_ahead(
        simulator, listener, executor, spin_until, values):
    values = {**SMALL, 'realtime': False, **values}
    node, heard = listener
    node.create_subscription(Clock, '/clock', lambda msg: heard.append(
        ('/clock', Time.from_msg(msg.clock).nanoseconds)), QoSProfile(depth=1000))
    simulator(**values)
    count = round(values['rate'] * values['duration'])
    assert spin_to_the_end(executor) == f'{count} samples published'
    pure = expected(FAST_START, **values)
    spin_until(lambda: len(heard) >= len(set(of(heard, '/clock'))) + sum(map(len, pure.values())))
    assert {topic: of(heard, topic) for topic in SAMPLES} == pure
    ticks = of(heard, '/clock')
    assert ticks == sorted(set(ticks)) and ticks[0] == FAST_START


def test_live_run_is_the_pure_run_from_the_clock_on(simulator, listener, executor, spin_until):
    node, heard = listener
    before = node.get_clock().now().nanoseconds
    simulator(**SMALL)
    spin_to_the_end(executor)
    spin_until(lambda: len(heard) >= 150)
    start = heard[0][1].stamp
    assert before < start <= node.get_clock().now().nanoseconds - 490_000_000
    assert {topic: of(heard, topic) for topic in SAMPLES} == expected(start, **SMALL)
    assert node.count_publishers('/clock') == 0


def test_follows_a_clock_that_is_given(simulator, listener, context, spin_until):
    node, heard = listener
    clock = node.create_publisher(Clock, '/clock', 10)
    ship = simulator(**{**SMALL, 'duration': 0.0}, use_sim_time=True)
    spin_until(lambda: clock.get_subscription_count() == 1 and all(
        output.get_subscription_count() for output in ship._outputs.values()))

    calls = itertools.count()
    for second, count in ((5, 1), (6, 101), (9, 401)):  # late at last: caught up, none left out
        def arrived(second=second, count=count):
            if next(calls) % 20 == 0:  # /clock is best effort: a tick may be missed
                clock.publish(Clock(clock=Time(seconds=second).to_msg()))
            return len(of(heard, 'ship/truth')) >= count

        spin_until(arrived)
        stamps = [sample.stamp for sample in of(heard, 'ship/truth')]
        assert stamps == [5_000_000_000 + 10_000_000 * k for k in range(count)]


def test_waits_for_subscribers(simulator, executor, context, spin_until):
    node = simulator(**SMALL, realtime=False)
    for _ in range(50):
        executor.spin_once(timeout_sec=0.01)
    assert node._report()[0][1:3] == (1, 'waiting for the clock or for subscribers')
    late = rclpy.create_node('late', context=context)
    executor.add_node(late)
    stamps = []
    late.create_subscription(
        Imu, 'ship/imu', lambda msg: stamps.append(messages.stamp_of(msg)), QoSProfile(depth=100))
    spin_to_the_end(executor)
    spin_until(lambda: len(stamps) == 50)
    assert stamps[0] == FAST_START


def test_frames_and_topics_are_parameters_and_remappings(context, executor, spin_until):
    node = SimulatorNode(context=context, namespace='north', parameter_overrides=[
        Parameter(name, value=value) for name, value in {
            **SMALL, 'subscribers': 0, 'ship_level_frame': 'level',
            'ship_base_link_frame': 'hull'}.items()], cli_args=['--ros-args', '-r',
                                                              'ship/heave:=mru/heave'])
    executor.add_node(node)
    frames = set()
    for name, kind in (('/north/ship/imu', Imu), ('/north/mru/heave', PointStamped)):
        node.create_subscription(
            kind, name, lambda msg: frames.add(msg.header.frame_id), QoSProfile(depth=10))
    node.create_subscription(Odometry, '/north/ship/truth', lambda msg: frames.add(
        (msg.header.frame_id, msg.child_frame_id)), QoSProfile(depth=10))
    spin_until(lambda: len(frames) == 3)
    assert frames == {'hull', 'level', ('level', 'hull')}


def test_diagnostics_count_and_list_the_settings(simulator, listener, executor, spin_until):
    node = simulator(**SMALL, realtime=False, seed=7)
    arrays = []
    node.create_subscription(DiagnosticArray, '/diagnostics', arrays.append, QoSProfile(depth=10))
    spin_to_the_end(executor)
    node._diagnostics.publish()
    counts = {f'published {topic}': '50' for topic in SAMPLES}
    spin_until(lambda: any(
        {item.key: item.value for item in array.status[0].values} == counts for array in arrays))
    settings = arrays[-1].status[1]
    assert ('seed', '7') in [(item.key, item.value) for item in settings.values]


@pytest.mark.parametrize('values, words', [
    ({'scenario': 'submarine'}, "'scenario' must be one of sea, shaping"),
    ({'rate': 1000.0}, "'rate' must be within 1 to 200 Hz"),
    ({'white_sd': [0.1]}, "'white_sd' needs 3 numbers")])
def test_wrong_parameters_are_named(simulator, values, words):
    with pytest.raises(ValueError, match=words):
        simulator(**values)


def test_publishes_what_the_table_of_topics_says(simulator, spin_until, listener):
    node = simulator(duration=0.0)
    published = dict(node.get_publisher_names_and_types_by_node('simulator', '/'))
    for topic in SAMPLES:
        assert published[f'/{topic}'] == [BY_NAME[topic].type]

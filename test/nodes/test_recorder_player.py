"""Recorder and player: what is published is in the bag, what is in the bag is published."""

from array import array
from itertools import count
import json
import os
import signal
import subprocess
import sys

import pytest

rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped  # noqa: E402
from rclpy.duration import Duration  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import Float64MultiArray, String  # noqa: E402

from deck_motion_ros.nodes.player import PlayerNode  # noqa: E402
from deck_motion_ros.nodes.raw_topics import stored_qos  # noqa: E402
from deck_motion_ros.nodes.recorder import RecorderNode  # noqa: E402
from deck_motion_ros.nodes.shell import Stop  # noqa: E402
from deck_motion_ros.recording import BagReader, BagWriter, recover  # noqa: E402

SECOND = 1_000_000_000
RELIABLE = QoSProfile(depth=1000)
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def add(context, executor):
    """Return a function that makes a node with parameters and gives it to the executor."""
    def make(kind, **parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = kind(context=context, parameter_overrides=overrides)
        executor.add_node(node)
        return node
    return make


@pytest.fixture
def ship(context, executor):
    """Return a bare node, to publish and to listen with."""
    node = Node('ship', context=context)
    executor.add_node(node)
    return node


def end(executor, node):
    executor.remove_node(node)
    node.destroy_node()


def heard(publishers):
    return lambda: all(publisher.get_subscription_count() for publisher in publishers)


def messages(count):
    """Make messages whose every field differs."""
    made = []
    for k in range(count):
        imu = Imu()
        imu.header.stamp.sec, imu.header.frame_id = k, f'frame {k}' * (k % 5)
        imu.orientation.w, imu.linear_acceleration.z = 1.0 / (k + 1), 9.8 + k
        imu.angular_velocity_covariance[k % 9] = k * 0.1
        made.append(imu)
    return made


def write_bag(folder, count, topics=('/a',), step=SECOND // 100, qos=()):
    with BagWriter(folder) as bag:
        for topic in topics:
            bag.add_topic(topic, 'std_msgs/msg/String', qos=qos)
        for k in range(count):
            bag.write(topics[k % len(topics)], 1000 * SECOND + k * step,
                      bytes(serialize_message(String(data=str(k)))))
    return folder


def play(executor, spin_until):
    """Step until the player ends; return what it says."""
    with pytest.raises(Stop) as stopped:
        spin_until(lambda: False, spins=20_000)
    assert stopped.value.status == 0
    return str(stopped.value)


# recorder


def test_every_topic_is_recorded_as_it_was_published(tmp_path, add, ship, executor, spin_until):
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'))
    sent = messages(200)
    imu = ship.create_publisher(Imu, 'ship/imu', RELIABLE)
    fast = ship.create_publisher(Float64MultiArray, 'fast', BEST_EFFORT)
    spin_until(heard([imu, fast]))
    for k, message in enumerate(sent):
        imu.publish(message)
        if k % 10 == 0:
            fast.publish(Float64MultiArray(data=array('d', [k, 2.5])))
            executor.spin_once(timeout_sec=0)
    late = ship.create_publisher(PointStamped, 'late', RELIABLE)  # discovered on the way
    spin_until(heard([late]))
    late.publish(PointStamped())
    spin_until(lambda: recorder.recorded >= 221)
    end(executor, recorder)
    reader = BagReader(tmp_path / 'bag')
    seen = list(reader.messages(['/ship/imu']))
    assert [deserialize_message(data, Imu) for *_, data in seen] == sent
    values = [reader.decode(*item[::2]).data[0] for item in reader.messages(['/fast'])]
    assert values == [float(k) for k in range(0, 200, 10)]
    assert reader.counts['/late'] == 1
    times = [(time, sent) for time, _, sent, _ in reader.records(['/ship/imu'])]
    assert all(0 <= time - sent < SECOND for time, sent in times)
    stored = {name: topic.qos[0] for name, topic in reader.bag_topics.items()}
    assert stored['/ship/imu'].reliability.name == 'RELIABLE'
    assert stored['/fast'].reliability.name == 'BEST_EFFORT'
    assert stored['/rosout'].durability.name == 'TRANSIENT_LOCAL'
    assert stored['/rosout'].lifespan == (10, 0)


def test_the_hash_of_a_type_is_that_of_its_publisher(tmp_path, add, ship, executor, spin_until):
    publisher = ship.create_publisher(PoseWithCovarianceStamped, 'pose', RELIABLE)
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'), topics=['pose'])
    spin_until(heard([publisher]))
    info, = ship.get_publishers_info_by_topic('/pose')
    publisher.publish(PoseWithCovarianceStamped())
    spin_until(lambda: recorder.recorded == 1)
    end(executor, recorder)
    assert BagReader(tmp_path / 'bag').bag_topics['/pose'].type_hash == str(info.topic_type_hash)
    with BagWriter(tmp_path / 'own') as bag:  # looked up without ROS: must be the same
        own = bag.add_topic('/pose', 'geometry_msgs/msg/PoseWithCovarianceStamped')
    assert own.type_hash == str(info.topic_type_hash)


def test_what_was_latched_before_the_recorder_came_is_recorded(
        tmp_path, add, ship, executor, spin_until):
    publisher = ship.create_publisher(String, 'hull', LATCHED)
    publisher.publish(String(data='destroyer'))
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'), topics=['hull'])
    spin_until(lambda: recorder.recorded == 1)
    end(executor, recorder)
    reader = BagReader(tmp_path / 'bag')
    assert [reader.decode(*item[::2]).data for item in reader.messages()] == ['destroyer']
    assert reader.bag_topics['/hull'].qos[0].durability.name == 'TRANSIENT_LOCAL'


def test_publishers_that_differ_are_all_recorded(tmp_path, add, ship, executor, spin_until):
    strong = ship.create_publisher(String, 'mixed', RELIABLE)
    weak = ship.create_publisher(String, 'mixed', BEST_EFFORT)
    spin_until(lambda: ship.count_publishers('/mixed') == 2)
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'), topics=['mixed'])
    spin_until(heard([strong, weak]))
    strong.publish(String(data='strong'))
    weak.publish(String(data='weak'))
    spin_until(lambda: recorder.recorded == 2)
    end(executor, recorder)
    reader = BagReader(tmp_path / 'bag')
    assert {reader.decode(*item[::2]).data for item in reader.messages()} == {'strong', 'weak'}
    assert len(reader.bag_topics['/mixed'].qos) == 2


def test_topics_are_chosen(tmp_path, add, ship, executor, spin_until):
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'), topics=['one'],
                   pattern='^/ship/', exclude='heave$')
    publishers = {name: ship.create_publisher(String, name, RELIABLE)
                  for name in ('one', 'two', 'ship/imu', 'ship/heave')}
    spin_until(heard([publishers['one'], publishers['ship/imu']]))
    for publisher in publishers.values():
        publisher.publish(String(data='x'))
    spin_until(lambda: recorder.recorded == 2)
    end(executor, recorder)
    assert BagReader(tmp_path / 'bag').counts == {'/one': 1, '/ship/imu': 1}


def test_simulated_time_is_the_log_time(tmp_path, add, ship, executor, spin_until):
    clock = ship.create_publisher(Clock, '/clock', RELIABLE)
    publisher = ship.create_publisher(String, 'a', RELIABLE)
    recorder = add(RecorderNode, output=str(tmp_path / 'bag'), topics=['a'], use_sim_time=True)
    spin_until(heard([clock, publisher]))
    publisher.publish(String(data='before there was any time'))
    spin_until(lambda: recorder.recorded == 1)
    for second in (5, 6):
        tick = Clock()
        tick.clock.sec = second
        clock.publish(tick)
        spin_until(lambda second=second: recorder.get_clock().now().nanoseconds == second * SECOND)
        publisher.publish(String(data=str(second)))
        spin_until(lambda second=second: recorder.recorded == second - 3)
    end(executor, recorder)
    assert [time for _, time, _ in BagReader(tmp_path / 'bag').messages()] == [
        5 * SECOND, 5 * SECOND, 6 * SECOND]


def test_a_publisher_that_offers_too_little_later_is_reported(
        tmp_path, add, ship, spin_until):
    strong = ship.create_publisher(String, 'a', RELIABLE)
    add(RecorderNode, output=str(tmp_path / 'bag'), topics=['a'])
    spin_until(heard([strong]))
    reports = []
    ship.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda message: reports.append({item.key: item.value
                                        for item in message.status[0].values}), 10)
    ship.create_publisher(String, 'a', BEST_EFFORT)
    spin_until(lambda: reports and reports[-1]['incompatible publishers'] == '/a')


@pytest.mark.parametrize('parameters, words', [
    ({'compression': 'gzip'}, 'compression'),
    ({'max_size': 100}, 'max_size must be 0 or at least 1024'),
    ({'pattern': '('}, "'pattern' is not a regular expression"),
    ({'output': '/proc/bag'}, '/proc/bag: cannot be made'),
])
def test_wrong_parameters_of_the_recorder(tmp_path, add, parameters, words):
    with pytest.raises(ValueError, match=words):
        add(RecorderNode, **{'output': str(tmp_path / 'bag'), **parameters})
    assert not (tmp_path / 'bag').exists()


# player


@pytest.mark.parametrize('offered', [RELIABLE, BEST_EFFORT])
def test_not_even_the_first_message_is_lost(tmp_path, add, ship, executor, spin_until, offered):
    bag = write_bag(tmp_path / 'bag', 50, ('/a', '/b'), qos=[stored_qos(offered)])
    add(PlayerNode, bag=str(bag), rate=10.0, wait_for_subscribers=['a', 'b'])
    executor.spin_once(timeout_sec=0)  # it waits
    seen = {'a': [], 'b': []}
    for topic, texts in seen.items():  # they come later than the player
        ship.create_subscription(
            String, topic, lambda message, texts=texts: texts.append(message.data), BEST_EFFORT)
    assert play(executor, spin_until) == '50 messages of 2 topics played'
    spin_until(lambda: len(seen['a']) == len(seen['b']) == 25)
    assert seen == {'a': [str(k) for k in range(0, 50, 2)], 'b': [str(k) for k in range(1, 50, 2)]}


def test_topics_can_be_left_out_and_renamed(tmp_path, add, ship, executor, spin_until):
    bag = write_bag(tmp_path / 'bag', 20, ('/a', '/b'))
    seen = {name: [] for name in ('a', 'b', 'c')}
    for name in seen:
        ship.create_subscription(
            String, name, lambda message, name=name: seen[name].append(message.data), RELIABLE)
    add(PlayerNode, bag=str(bag), rate=0.0, topics=['b'], remap=['b:=c'])
    play(executor, spin_until)
    spin_until(lambda: len(seen['c']) == 10)
    assert seen == {'a': [], 'b': [], 'c': [str(k) for k in range(1, 20, 2)]}


def test_start_and_clock(tmp_path, add, ship, executor, spin_until):
    bag = write_bag(tmp_path / 'bag', 101)  # 1 s
    seen, ticks = [], []
    ship.create_subscription(String, 'a', lambda message: seen.append(message.data), RELIABLE)
    ship.create_subscription(
        Clock, '/clock', lambda m: ticks.append(m.clock.sec * SECOND + m.clock.nanosec), RELIABLE)
    add(PlayerNode, bag=str(bag), rate=5.0, start=0.5, clock=20.0)
    assert play(executor, spin_until) == '51 messages of 1 topics played, 11 ticks of /clock'
    spin_until(lambda: len(seen) == 51 and len(ticks) == 11)
    assert seen == [str(k) for k in range(50, 101)]
    assert ticks == [1000 * SECOND + SECOND // 2 + k * SECOND // 20 for k in range(11)]


def test_a_loop_begins_again(tmp_path, add, ship, spin_until):
    bag = write_bag(tmp_path / 'bag', 10)
    seen = []
    ship.create_subscription(String, 'a', lambda message: seen.append(message.data), RELIABLE)
    add(PlayerNode, bag=str(bag), rate=10.0, loop=True)
    spin_until(lambda: len(seen) >= 25)
    assert seen[:25] == ([str(k) for k in range(10)] * 3)[:25]


def test_a_player_without_subscribers_plays_in_the_end(tmp_path, add, executor, spin_until):
    bag = write_bag(tmp_path / 'bag', 10)
    add(PlayerNode, bag=str(bag), rate=0.0, wait_timeout=0.2)
    assert play(executor, spin_until) == '10 messages of 1 topics played'


@pytest.mark.parametrize('parameters, words', [
    ({'bag': 'none'}, 'none: does not exist'),
    ({'topics': ['b']}, 'has no topic /b'),
    ({'remap': ['a->b']}, "'remap' takes old:=new, not 'a->b'"),
    ({'start': 5.0}, "'start' is 5 s, the bag is 0.09 s long"),
])
def test_wrong_parameters_of_the_player(tmp_path, add, parameters, words):
    bag = write_bag(tmp_path / 'bag', 10)
    with pytest.raises(ValueError, match=words):
        add(PlayerNode, **{'bag': str(bag), **parameters})


def test_a_bag_played_and_recorded_is_the_same_bag(tmp_path, add, executor, spin_until):
    source = tmp_path / 'source'
    sent = messages(300)
    with BagWriter(source) as bag:
        bag.add_topic('/ship/imu', 'sensor_msgs/msg/Imu')
        for k, message in enumerate(sent):
            bag.write('/ship/imu', k * SECOND // 100, bytes(serialize_message(message)))
    recorder = add(RecorderNode, output=str(tmp_path / 'copy'), topics=['ship/imu'])
    add(PlayerNode, bag=str(source), rate=3.0)
    play(executor, spin_until)
    spin_until(lambda: recorder.recorded == 300)
    end(executor, recorder)
    seen = [data for *_, data in BagReader(tmp_path / 'copy').messages()]
    assert [deserialize_message(data, Imu) for data in seen] == sent


# as processes


@pytest.fixture
def start(domain_id, project):
    """Return a function that starts a node's executable and ends it with the test."""
    started = []

    def run(node, *, prelude='', **parameters):
        arguments = [word for name, value in parameters.items()
                     for word in ('-p', f'{name}:={json.dumps(value)}')]
        process = subprocess.Popen(
            [sys.executable, '-c',
             f'{prelude}\nfrom deck_motion_ros.nodes.{node} import main\nmain()',
             '--ros-args', *arguments],
            cwd=project, env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        started.append(process)
        return process

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def reports(ship):
    """Collect what the recorder says of itself."""
    said = []

    def take(message):
        for status in message.status:
            if status.name == 'recorder':
                said.append({item.key: item.value for item in status.values})

    ship.create_subscription(DiagnosticArray, '/diagnostics', take, 10)
    return said


@pytest.fixture
def publish_until(ship, spin_until):
    """Return a function that publishes numbers, one per step, until a predicate holds."""
    publisher = ship.create_publisher(String, 'a', RELIABLE)
    numbers = count()

    def publish(predicate, pad=''):
        spin_until(heard([publisher]))

        def step():
            publisher.publish(String(data=f'{next(numbers)}{pad}'))
            return predicate()

        spin_until(step, spins=5000)

    return publish


def test_kill_9_costs_less_than_a_second(tmp_path, start, reports, publish_until):
    process = start('recorder', output=str(tmp_path / 'bag'), topics=['a'], compression='zstd')
    publish_until(lambda: reports and int(reports[-1]['received']) > 0)
    old, received = len(reports), int(reports[-1]['received'])
    publish_until(lambda: len(reports) == old + 1)  # one report later is one second later
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert os.listdir(tmp_path / 'bag') == ['bag_0.mcap']
    recovered = recover(tmp_path / 'bag')
    assert recovered.messages >= received > 0
    reader = BagReader(tmp_path / 'bag')
    assert [reader.decode(*item[::2]).data for item in reader.messages()] == [
        str(k) for k in range(recovered.messages)]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_recording_whole(tmp_path, start, ship, spin_until, number):
    publisher = ship.create_publisher(String, 'a', RELIABLE)
    process = start('recorder', output=str(tmp_path / 'bag'), topics=['a'])
    spin_until(heard([publisher]))
    for k in range(500):
        publisher.publish(String(data=str(k)))
    publisher.wait_for_all_acked(Duration(seconds=60))  # they are there, but hardly on the disk
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert BagReader(tmp_path / 'bag').counts == {'/a': 500}
    assert f'500 messages of 1 topics in {tmp_path / "bag"}\n' in said
    assert (tmp_path / 'bag/metadata.yaml').exists()


def test_a_full_disk_ends_a_recording_with_a_clear_word(tmp_path, start, publish_until):
    limit = 'import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))'
    process = start('recorder', prelude=limit, output=str(tmp_path / 'bag'), topics=['a'])
    publish_until(lambda: process.poll() is not None, ' ' * 2000)
    _, said = process.communicate()
    assert process.returncode == 1
    errors = [line for line in said.splitlines() if line.startswith('error:')]
    assert len(errors) == 1 and 'Traceback' not in said
    assert 'bag: cannot be written: File too large; what was written before is safe' in errors[0]
    saved = recover(tmp_path / 'bag').messages
    reader = BagReader(tmp_path / 'bag')
    assert saved >= 40 and [reader.decode(*item[::2]).data.strip()
                            for item in reader.messages()] == [str(k) for k in range(saved)]


def test_an_existing_output_is_one_line_and_status_2(tmp_path, start):
    process = start('recorder', output=str(tmp_path))
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (2, f'error: {tmp_path}: already exists\n')


def test_a_player_without_a_bag_is_one_line_and_status_2(start):
    process = start('player')
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (
        2, "error: parameter 'bag' is not set: the folder of the bag to play\n")


def test_the_player_ends_with_status_0(tmp_path, start, ship, spin_until):
    seen = []
    ship.create_subscription(String, 'a', lambda message: seen.append(message.data), RELIABLE)
    process = start('player', bag=str(write_bag(tmp_path / 'bag', 500)), rate=0.0)
    spin_until(lambda: len(seen) == 500)
    assert seen == [str(k) for k in range(500)]
    said, _ = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, '500 messages of 1 topics played\n')

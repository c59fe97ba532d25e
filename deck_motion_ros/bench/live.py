"""Live nodes in processes of their own: how late the predictor is, what the recorder takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import sin
import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.bench.figures import compared, Figure
from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.samples import HeaveSample, ImuSample, NANOSECONDS
from deck_motion_ros.simulation.simulator import Event
from deck_motion_ros.topics import IMU, inputs, POINT

PERIOD = 0.01  # s: 100 Hz
FIRST_STAMP = 10**18  # ns
PATIENCE = 30.0  # s that a node may take to start


def ship_at(stamp: int) -> tuple[ImuSample, HeaveSample]:
    """Give attitude and heave of a swinging ship at ``FIRST_STAMP + stamp`` (ns)."""
    time = stamp / NANOSECONDS
    attitude = quaternion_from_rpy(0.05 * sin(0.7 * time), 0.02 * sin(0.8 * time + 1.0), 0.0)
    nothing = (0.0, 0.0, 0.0)
    return (ImuSample(FIRST_STAMP + stamp, 'ship_base_link', attitude, nothing, nothing,
                      (0.0, 0.0, 9.8)),
            HeaveSample(FIRST_STAMP + stamp, 'ship_level', 1.5 * sin(0.6 * time)))


def latency(phases: int = 40, per_phase: int = 30) -> Iterator[Figure]:
    """
    Measure the time from input to output of the live predictor, against an echo.

    This process is the driver: 100 times a second it publishes ``ship/imu`` and ``ship/heave`` of
    one stamp, and spins until ``touchdown/height`` is back. The clock runs from just before the
    first of the two is published until the callback with the answer. Predictor and echo run all
    the time, each in its process and namespace, and are driven in turn, a phase each, so that
    both see the same machine; the first five messages of a phase wake the node and do not count.

    Parameters
    ----------
    phases : int
        Of each of the two.
    per_phase : int
        Messages in one, above 5.

    """
    place = f'/bench_{os.getpid()}'
    with running('deck_motion_ros.nodes.predictor', f'{place}/predictor',
                 output_rate=1 / PERIOD), running(
                'deck_motion_ros.bench.echo', f'{place}/echo'), Driver() as driver:
        rivals = [_Rival(driver, f'{place}/{name}') for name in ('predictor', 'echo')]
        for rival in rivals:
            until(lambda: rival.time() is not None, 'a node did not answer')
        rounds = [[[rival.time() for _ in range(per_phase)][5:] for rival in rivals]
                  for _ in range(phases)]
    ours, echo = (
        [1e3 * np.array([answer for answer in phase if answer is not None]) for phase in side]
        for side in zip(*rounds, strict=True))
    yield compared('latency', 'median', 'ms', [float(np.median(phase)) for phase in ours],
                   'echo', [float(np.median(phase)) for phase in echo], '<= 1.5')
    yield compared('latency', 'p99', 'ms', [float(np.percentile(np.concatenate(ours), 99))],
                   'echo', [float(np.percentile(np.concatenate(echo), 99))])
    in_time = sum(int(np.sum(phase <= 1e3 * PERIOD)) for phase in ours)
    yield Figure('latency', 'not_within_10_ms', phases * (per_phase - 5) - in_time, 'messages')


class _Rival:
    """One of the two nodes, as the driver sees it."""

    def __init__(self, driver: Driver, place: str) -> None:
        self._driver = driver
        self._imu = driver.publisher(IMU, f'{place}/ship/imu')
        self._heave = driver.publisher(POINT, f'{place}/ship/heave')
        driver.subscribe(POINT, f'{place}/touchdown/height', self._answered)
        self._stamp = 0
        self._due = 0.0
        self._answer: float | None = None

    def _answered(self, msg: Any) -> None:
        self._answer = perf_counter()

    def time(self) -> float | None:
        """Send the next stamp when it is due; return the seconds until the answer came."""
        self._stamp += round(PERIOD * NANOSECONDS)
        attitude, heave = ship_at(self._stamp)
        imu_msg = messages.imu_message(self._driver.types, attitude)
        heave_msg = messages.heave_message(self._driver.types, heave)
        self._due = max(self._due + PERIOD, perf_counter())
        sleep(max(self._due - perf_counter(), 0.0))
        self._answer = None
        start = perf_counter()
        self._imu.publish(imu_msg)
        self._heave.publish(heave_msg)
        while self._answer is None and perf_counter() < start + 1.0:
            self._driver.spin_once(PERIOD)
        return None if self._answer is None else self._answer - start


def played(node: str, events: Sequence[Event], kind: str, output: str) -> tuple[int, float]:
    """
    Play events to a live node in real time.

    Parameters
    ----------
    node : str
        Which.
    events : sequence of Event
        Of its input topics; times (ns) from 0.
    kind, output : str
        Type and name of the topic that is counted.

    Returns
    -------
    int
        Messages on ``output``.
    float
        Share of a core that the node took.

    """
    place = f'/bench_{os.getpid()}'
    with Driver() as driver, running(f'deck_motion_ros.nodes.{node}', place) as process:
        sent = {topic.name: driver.publisher(topic.type, f'{place}/{topic.name}', depth=1000)
                for topic in inputs(node)}
        heard: list[object] = []
        driver.subscribe(kind, f'{place}/{output}', heard.append)
        until(lambda: all(publisher.get_subscription_count() for publisher in sent.values()),
              'the node did not subscribe')
        built = [(event, messages.message(driver.types, event.sample)) for event in events]
        cpu, start = cpu_seconds(process.pid), perf_counter()
        for event, msg in built:
            sleep(max(start + event.time / NANOSECONDS - perf_counter(), 0.0))
            sent[event.topic].publish(msg)
            driver.spin_once(0.0)
        end = perf_counter() + 0.5
        while perf_counter() < end:
            driver.spin_once(0.05)
        load = (cpu_seconds(process.pid) - cpu) / (perf_counter() - start)
    return len(heard), load


def recorder(rate: int = 3000, duration: float = 20.0) -> Iterator[Figure]:
    """
    Send the recorder Imu messages at a steady rate and count what is in its bag.

    Parameters
    ----------
    rate : int
        Messages per second.
    duration : float
        Seconds.

    """
    from rclpy.duration import Duration

    from deck_motion_ros.recording import BagReader

    topic = f'/bench_{os.getpid()}/ship/imu'
    number = round(rate * duration)
    with TemporaryDirectory() as folder, Driver() as driver:
        bag = Path(folder, 'bag')
        publisher = driver.publisher(IMU, topic, depth=5000)
        msg = messages.imu_message(driver.types, ship_at(0)[0])
        with running('deck_motion_ros.nodes.recorder', '/', output=bag, topics=[topic]) as process:
            until(publisher.get_subscription_count, 'the recorder did not subscribe')
            cpu, start = cpu_seconds(process.pid), perf_counter()
            for k in range(number):
                if k % 10 == 0:
                    sleep(max(start + k / rate - perf_counter(), 0.0))
                msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(
                    FIRST_STAMP + k * NANOSECONDS // rate, NANOSECONDS)
                publisher.publish(msg)
            publisher.wait_for_all_acked(Duration(seconds=PATIENCE))
            elapsed = perf_counter() - start
            cpu = cpu_seconds(process.pid) - cpu
        counts = BagReader(bag).counts
    yield Figure('recorder', 'lost', number - counts[topic], f'of {number} messages', goal='<= 0')
    yield Figure('recorder', 'rate', number / elapsed, 'messages/s', goal=f'>= {0.99 * rate:g}')
    yield Figure('recorder', 'cpu', 100 * cpu / elapsed, '% of a core')


def cpu_seconds(pid: int) -> float:
    """Return the CPU time that a process has used so far (s)."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


class Driver:
    """A ROS node in this process."""

    def __enter__(self) -> Driver:
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        from deck_motion_ros.nodes.shell import output_qos, RclTypes

        self.types, self._qos, self._context = RclTypes(), output_qos, Context()
        self._context.init()
        self._node = Node('bench', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.spin_once = self._executor.spin_once
        return self

    def __exit__(self, *error: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def publisher(self, kind: str, topic: str, depth: int = 100) -> Any:
        return self._node.create_publisher(self.types[kind], topic, self._qos(depth))

    def subscribe(self, kind: str, topic: str, callback: Callable[[Any], None]) -> None:
        self._node.create_subscription(self.types[kind], topic, callback, self._qos())


@contextmanager
def running(module: str, namespace: str, **params: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node in a process and a session of its own, and end it with SIGINT."""
    command = [sys.executable, '-c', f'from {module} import main; main()',
               '--ros-args', '--log-level', 'WARN', '-r', f'__ns:={namespace}']
    for name, value in params.items():
        command += ['-p', f'{name}:={value}']
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               start_new_session=True)
    try:
        yield process
    finally:
        for number in (signal.SIGINT, signal.SIGKILL):
            if process.poll() is None:
                os.killpg(process.pid, number)
                try:
                    process.wait(10.0)
                except subprocess.TimeoutExpired:
                    continue


def until(happened: Callable[[], object], complaint: str) -> None:
    end = perf_counter() + PATIENCE
    while not happened():
        if perf_counter() > end:
            raise RuntimeError(f'{complaint} within {PATIENCE:g} s')
        sleep(PERIOD)

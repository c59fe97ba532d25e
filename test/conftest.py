"""What the tests share: recorded data, ROS contexts of their own, bounded stepping."""

import os
from pathlib import Path
import socket

from hypothesis import settings
import pytest

from deck_motion_ros.blas import use_one_thread

ROOT = Path(__file__).resolve().parent.parent

# Before anything imports rclpy: nothing leaves this host, whatever the shell says.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
for name in ('ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS', 'ROS_DISCOVERY_SERVER'):
    os.environ.pop(name, None)

# A killed process leaves its shared memory behind locked, which can hang whoever comes next.
os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')

use_one_thread()
settings.register_profile('repeatable', derandomize=True, deadline=None)
settings.load_profile('repeatable')


@pytest.fixture(scope='session')
def project():
    """Return the project's root folder."""
    return ROOT


@pytest.fixture(scope='session')
def data_dir():
    """Return the folder of recorded data, or skip."""
    folder = Path(os.environ.get('DECK_MOTION_DATA') or ROOT / '../shared/data').resolve()
    if not folder.is_dir():
        pytest.skip(f'no recorded data: {folder} is no folder (DECK_MOTION_DATA names another)')
    return folder


@pytest.fixture
def domain_id():
    """Return a ROS domain that no other test on this machine uses while this one runs."""
    first = os.getpid() % 100
    for k in range(100):
        domain = 1 + (first + k) % 100
        with socket.socket() as lock:
            try:
                lock.bind(('127.0.0.1', 7400 + 250 * domain))  # TCP; DDS takes UDP ports there
            except OSError:
                continue
            yield domain
            return
    pytest.fail('no ROS domain is free')


@pytest.fixture
def context(domain_id):
    """Return an rclpy context of the test's own, in a domain of its own."""
    rclpy = pytest.importorskip('rclpy', reason='no ROS 2 here')
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    yield context
    context.try_shutdown()


@pytest.fixture
def executor(context):
    """Return an executor; the nodes that it holds at the end are destroyed."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=context)
    yield executor
    for node in list(executor.get_nodes()):
        node.destroy_node()
    executor.shutdown()


@pytest.fixture
def spin_until(executor):
    """Return a function that steps the executor until a predicate holds, or fails."""
    def spin(predicate, spins=2000, timeout_sec=0.01):
        for _ in range(spins):
            if predicate():
                return
            executor.spin_once(timeout_sec=timeout_sec)
        assert predicate(), f'it did not come true within {spins} spins'
    return spin

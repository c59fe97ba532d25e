"""The alignment: cost of a step, and the live node at 400 Hz of both units."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
import os
from time import perf_counter, process_time, sleep

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.bench.figures import Figure
from deck_motion_ros.bench.live import cpu_seconds, Driver, FIRST_STAMP, running, until
from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.alignment import Aligner, AlignmentConfig, transfer_model
from deck_motion_ros.estimators.transfer import TransferFilter
from deck_motion_ros.samples import ImuSample, NANOSECONDS, VelocitySample
from deck_motion_ros.simulation.catapult import CatapultSimulator, CatapultSimulatorConfig
from deck_motion_ros.simulation.simulator import Event
from deck_motion_ros.topics import BY_NAME, VECTOR

INPUTS = ('slave/imu', 'master/imu', 'master/velocity', 'ldv/velocity')
DT = 0.01  # s


def alignment(rounds: int = 5, rate: float = 400.0, hold: float = 4.0) -> Iterator[Figure]:
    """
    Measure a filter step alone, the whole aligner, and the live node.

    Parameters
    ----------
    rounds : int
        Of the cost of a sample, of which the median counts.
    rate : float
        Of both units (Hz); the velocimeter has 100 Hz.
    hold : float
        Seconds before the launch.

    """
    yield Figure('alignment', 'step', 1e6 * float(np.median(step_costs())), 'us', goal='<= 150')
    config = CatapultSimulatorConfig(
        deck='steady', rate=rate, hold=hold, duration=hold + 3.0, vibration=20.0,
        ldv_every=round(rate / 100))
    events = [event for event in CatapultSimulator(config, FIRST_STAMP)
              if event.topic in INPUTS]
    costs, outputs = [], 0
    for _ in range(rounds):
        aligner, outputs = Aligner(AlignmentConfig()), 0
        start = process_time()
        for _, topic, sample in events:
            assert isinstance(sample, ImuSample | VelocitySample)
            outputs += len(aligner.update(topic, sample))
        costs.append((process_time() - start) / (rate * config.duration))
    yield Figure('alignment', 'sample', 1e6 * float(np.median(costs)),
                 'us for each of the slave')
    yield from _live(events, outputs)


def step_costs(steps: int = 3000) -> list[float]:
    """Return CPU seconds of single steps of the default filter, each with one interval."""
    earth, rng = Earth(radians(40.0)), np.random.default_rng(1)
    transfer = TransferFilter(transfer_model(AlignmentConfig()), earth, np.eye(3), np.zeros(3),
                              1e-4 * np.eye(3), 1e-4 * np.eye(3))
    mat_r, push = np.diag([1e-4, 4e-4, 25e-4]), np.array([20.0, 0.0, 0.0])
    transfer.launch()
    costs = []
    for k in range(steps):
        force = push - earth.gravity + 2e-3 * rng.normal(size=3)
        reference = DT * (k + 1) * push + np.sqrt(np.diag(mat_r)) * rng.normal(size=3)
        start = process_time()
        transfer.integrate(earth.rate, force, DT)
        transfer.step(reference, np.eye(3), mat_r)
        costs.append(process_time() - start)
    return costs


def _live(events: list[Event], expected: int) -> Iterator[Figure]:
    """Send a launch in real time; count the answers and the CPU time."""
    place = f'/bench_{os.getpid()}'
    heard: list[object] = []
    with running('deck_motion_ros.nodes.alignment', place) as process, Driver() as driver:
        publishers = {topic: driver.publisher(BY_NAME[topic].type, f'{place}/{topic}')
                      for topic in INPUTS}
        driver.subscribe(VECTOR, f'{place}/alignment/misalignment', heard.append)
        ready = [(event.time, publishers[event.topic],
                  messages.message(driver.types, event.sample)) for event in events]
        until(lambda: all(publisher.get_subscription_count()
                          for publisher in publishers.values()), 'the node did not subscribe')
        sleep(1.0)  # whether the node has matched us too cannot be seen from here
        cpu, start = cpu_seconds(process.pid), perf_counter()
        for time, publisher, msg in ready:
            due = start + (time - FIRST_STAMP) / NANOSECONDS
            while (ahead := due - perf_counter()) > 0:
                driver.spin_once(ahead)
            publisher.publish(msg)
        end = perf_counter()
        while len(heard) < expected and perf_counter() < end + 2.0:
            driver.spin_once(0.01)
        cpu = cpu_seconds(process.pid) - cpu
    yield Figure('alignment', 'live_lost', expected - len(heard), f'of {expected} estimates',
                 goal='<= 0')
    yield Figure('alignment', 'live_cpu', 100 * cpu / (end - start), '% of a core',
                 goal='<= 100')

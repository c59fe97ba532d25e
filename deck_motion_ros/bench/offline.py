"""Without a live node: replay, the predictor's memory, the simulator."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import count
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.bench.figures import alternated, compared, Figure
from deck_motion_ros.bench.live import FIRST_STAMP, ship_at
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.pipelines import PredictorPipeline
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.simulator import ShipSimulator, SimulatorConfig
from deck_motion_ros.topics import BY_NAME

RATE = 100.0  # Hz
BUILDERS: Mapping[str, Callable[[Any, Any], Any]] = {
    'ship/imu': messages.imu_message, 'ship/heave': messages.heave_message}


def replay(duration: float = 600.0, rounds: int = 3) -> Iterator[Figure]:
    """
    Replay a bag of 100 Hz through the predictor, against reading and decoding it with rosbags.

    Parameters
    ----------
    duration : float
        Of the bag (s).
    rounds : int
        Of both.

    """
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import get_typestore, Stores

    from deck_motion_ros.replaying import replay as replay_bag

    store, runs = get_typestore(Stores.ROS2_JAZZY), count()

    def read() -> None:
        with Reader(bag) as reader:
            for connection, _, data in reader.messages():
                store.deserialize_cdr(data, connection.msgtype)

    def run() -> None:
        replay_bag(bag, Path(folder, f'out{next(runs)}'), 'predictor', {})

    with TemporaryDirectory() as folder:
        bag = Path(folder, 'in')
        write_ship(bag, duration)
        ours, theirs = ([duration / seconds for seconds in times]
                        for times in alternated(rounds, run, read))
    yield compared('replay', 'speed', 'x real time', ours, 'rosbags, read and decode only',
                   theirs, '>= 0.1')


def write_ship(bag: Path, duration: float) -> None:
    """Write ``/ship/imu`` and ``/ship/heave`` of a simulated ship, 100 Hz."""
    from deck_motion_ros.recording import BagTypes, BagWriter, encode

    types, config = BagTypes(), SimulatorConfig(rate=RATE, duration=duration)
    with BagWriter(bag, atomic=True) as writer:
        for name in BUILDERS:
            writer.add_topic(f'/{name}', BY_NAME[name].type)
        for time, name, sample in ShipSimulator(config, FIRST_STAMP):
            if name in BUILDERS:
                msg = BUILDERS[name](types, sample)
                writer.write(f'/{name}', time, encode(BY_NAME[name].type, msg))


def simulator(duration: float = 60.0, rounds: int = 5) -> Iterator[Figure]:
    """
    Time the simulator with its default ship at 50 Hz.

    Parameters
    ----------
    duration : float
        Simulated in a round (s).
    rounds : int
        How many.

    """
    config = SimulatorConfig(duration=duration)

    def run() -> None:
        for _ in ShipSimulator(config, FIRST_STAMP):
            pass

    times, = alternated(rounds, run)
    seconds = float(np.median(times))
    yield Figure('simulator', 'speed', duration / seconds, 'x real time')
    yield Figure('simulator', 'sample', 1e6 * seconds / (duration * config.rate), 'us')


def memory(first: float = 60.0, last: float = 3600.0) -> Iterator[Figure]:
    """
    Feed the predictor 100 Hz as fast as it takes them; watch its memory.

    The process is this one: run by itself, as ``deck_motion bench`` does.

    Parameters
    ----------
    first, last : float
        When to look (s of input).

    """
    types = _node_types()
    pipeline = PredictorPipeline(PredictorConfig(), types, lambda text: None)
    resident = []
    for start, end in ((0.0, first), (first, last)):
        feed(pipeline, types, start, end)
        resident.append(_resident())
    yield compared('memory', 'resident', 'MB', resident[1:], f'after {first:g} s', resident[:1])
    yield Figure('memory', 'growth', resident[1] - resident[0], 'MB', goal='<= 5')


def feed(pipeline: PredictorPipeline, types: Any, start: float, end: float) -> None:
    """Give a pipeline imu and heave from ``start`` to ``end`` (s) and use up what it says."""
    for k in range(round(start * RATE), round(end * RATE)):
        for name, sample in zip(BUILDERS, ship_at(round(k * NANOSECONDS / RATE)), strict=True):
            for _ in pipeline.take(name, BUILDERS[name](types, sample)):
                pass


def _node_types() -> Any:
    """Return the message classes of the live node, or of bags where there is no ROS."""
    try:
        from deck_motion_ros.nodes.shell import RclTypes
    except ImportError:
        from deck_motion_ros.recording import BagTypes

        return BagTypes()
    return RclTypes()


def _resident() -> float:
    """Return this process's resident memory now (MB)."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6

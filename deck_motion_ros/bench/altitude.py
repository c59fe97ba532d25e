"""The altitude estimator: a step against filterpy, and the live node at 100 Hz."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from importlib import import_module

import numpy as np

from deck_motion_ros.bench.figures import alternated, compared, Figure
from deck_motion_ros.bench.live import played
from deck_motion_ros.estimators.altitude import AltitudeConfig, AltitudeEstimator
from deck_motion_ros.estimators.encounter import wave_model
from deck_motion_ros.estimators.wave_filter import HEIGHT, RATE, STATES, WaveFilter
from deck_motion_ros.processes import van_loan
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    OdometrySample,
    RangeSample,
    VelocitySample,
)
from deck_motion_ros.simulation.sea_skimming import SkimmingSimulator, SkimmingSimulatorConfig
from deck_motion_ros.simulation.simulator import Event
from deck_motion_ros.topics import ODOMETRY

RATE_HZ, HEIGHT_M = 100, 30.0
DT = 1 / RATE_HZ
CONFIG = AltitudeConfig()
AGREEMENT = 0.01  # m: filterpy is given the accelerometer's noise once more exactly


def altitude(steps: int = 2000, rounds: int = 9, live: float = 10.0) -> Iterator[Figure]:
    """
    Measure a step: acceleration, range and rate in, height out; then the live node.

    Parameters
    ----------
    steps : int
        In a round; filterpy does a quarter of them.
    rounds : int
        Of everything but the live node.
    live : float
        Seconds of the live node.

    Raises
    ------
    RuntimeError
        If filterpy computes anything else than we do.

    """
    values = np.random.default_rng(1).normal(size=(steps, 3)) * (0.1, 2.0, 0.3)
    fewer = values[:steps // 4]
    tasks, peer = [partial(wave_filter, values)], 'filterpy'
    try:
        difference = float(np.max(np.abs(wave_filter(fewer) - filterpy_filter(fewer))))
        if not difference < AGREEMENT:
            raise RuntimeError(f'{peer} computes something else: difference {difference:g} m')
        tasks.append(partial(filterpy_filter, fewer))
    except ImportError:
        peer += ' (not installed)'
    ours, *theirs = [[1e6 * second / count for second in seconds] for seconds, count in zip(
        alternated(rounds, *tasks), (steps, len(fewer)), strict=False)]
    yield compared('altitude', 'filter_step', 'us', ours, peer, theirs[0] if theirs else [])

    events = flown(steps / RATE_HZ)
    whole, = alternated(rounds, partial(estimator, events))
    # the least disturbed round: without a peer beside it a median tells how busy the machine is
    yield Figure('altitude', 'step', 1e6 * min(whole) / steps, 'us', goal='<= 40')
    yield from _live(flown(live), live)


def flown(seconds: float) -> list[Event]:
    """Simulate a flight; return what the sensors say."""
    config = SkimmingSimulatorConfig(rate=RATE_HZ, duration=seconds, waves=100,
                                     profile_heights=(HEIGHT_M,) * 3)
    return [event for event in SkimmingSimulator(config)
            if not isinstance(event.sample, OdometrySample)]


def wave_filter(values: Array) -> Array:
    """Filter acceleration, height and rate, (steps, 3); return the heights."""
    ours = WaveFilter(CONFIG.errors(), wave_model(CONFIG.sea()))
    ours.start(0.0, 1.0, 0.0, 1.0)
    heights = np.empty(len(values))
    for k, (push, height, rate) in enumerate(values.tolist()):
        ours.step(DT, push, height, rate)
        heights[k] = ours.height
    return heights


def filterpy_filter(values: Array) -> Array:
    """Do as :func:`wave_filter` with filterpy's ``KalmanFilter``."""
    ours = WaveFilter(CONFIG.errors(), wave_model(CONFIG.sea()))
    ours.start(0.0, 1.0, 0.0, 1.0)
    peer = import_module('filterpy.kalman').KalmanFilter(dim_x=STATES, dim_z=1)
    mat_a, mat_w = ours.model()
    mat_w[RATE, RATE] = CONFIG.accel_white_sd**2 * DT
    peer.F, peer.Q = van_loan(mat_a, mat_w, DT)
    peer.x, peer.P, peer.B = ours.state[:, None], ours.full_cov, np.zeros((STATES, 1))
    peer.B[[HEIGHT, RATE], 0] = DT * DT / 2, DT
    rows = [(row[None], np.array([[sd**2]])) for row, sd in zip(
        ours.rows(), (CONFIG.altimeter_sd, CONFIG.rate_sd), strict=True)]
    heights = np.empty(len(values))
    for k, (push, *measured) in enumerate(values.tolist()):
        peer.predict(u=np.array([[push]]))
        for value, (row, var) in zip(measured, rows, strict=True):
            peer.update(value, var, row)
        heights[k] = peer.x[HEIGHT, 0]
    return heights


def estimator(events: list[Event]) -> int:
    """Let the whole estimator follow a flight; return the number of estimates."""
    followed = AltitudeEstimator(CONFIG)
    count = 0
    for event in events:
        if isinstance(event.sample, (ImuSample, RangeSample, VelocitySample)):
            count += len(followed.update(event.sample))
    return count


def _live(events: list[Event], duration: float) -> Iterator[Figure]:
    heard, load = played('altitude', events, ODOMETRY, 'altitude/odometry')
    yield Figure('altitude', 'live_rate', heard / duration, 'estimates/s',
                 goal=f'>= {0.98 * RATE_HZ:g}')
    yield Figure('altitude', 'live_load', 100 * load, '% of a core')

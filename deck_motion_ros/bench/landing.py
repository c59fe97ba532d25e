"""The landing estimator: an epoch of ranges against filterpy, and the live node's load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib import import_module

import numpy as np

from deck_motion_ros.bench.figures import alternated, compared, Figure
from deck_motion_ros.bench.live import played
from deck_motion_ros.estimators.landing import LandingConfig, LandingEstimator
from deck_motion_ros.estimators.multilateration import Fix
from deck_motion_ros.estimators.ranging import JointFilter
from deck_motion_ros.samples import Array, ImuSample, NANOSECONDS, RangeSample
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig
from deck_motion_ros.simulation.simulator import Event
from deck_motion_ros.topics import ODOMETRY

DT, SD = 0.1, 0.05  # s, m
POINTS = LandingConfig().points()
START = np.array([10.0, 20.0, 15.0])
INPUTS = ('ship/imu', 'uav/imu', 'uwb/range')
SCENE = LandingSimulatorConfig(seed=1, uav_rate=200.0, range_rate=50.0, range_spacing=0.005)


def landing(epochs: int = 400, rounds: int = 9, live: float = 10.0) -> Iterator[Figure]:
    """
    Measure an epoch of four ranges, a whole second of the estimator, and the live node.

    Parameters
    ----------
    epochs : int
        Of the filter alone, in a round.
    rounds : int
        Of everything but the live node.
    live : float
        Seconds of the live node, at 4 x 50 ranges and 200 samples of ``uav/imu`` per second.

    Raises
    ------
    RuntimeError
        If filterpy computes anything else than we do.

    """
    rng = np.random.default_rng(1)
    path = START - np.outer(np.arange(epochs) * DT, START / (epochs * DT + 5.0))
    # noise so small that no range loses weight: filterpy is not robust
    values = np.linalg.norm(POINTS - path[:, None], axis=2) + SD / 4 * rng.normal(
        size=(epochs, 4))
    tasks = [partial(joint_filter, values)]
    peer = 'filterpy'
    try:
        difference = float(np.max(np.abs(joint_filter(values) - filterpy_filter(values))))
        if not difference < 1e-6:
            raise RuntimeError(f'{peer} computes something else: difference {difference:g} m')
        tasks.append(partial(filterpy_filter, values))
    except ImportError:
        peer += ' (not installed)'
    ours, *theirs = [[1e6 * second / epochs for second in seconds]
                     for seconds in alternated(rounds, *tasks)]
    yield compared('landing', 'filter_epoch', 'us', ours, peer, theirs[0] if theirs else [])

    ranges = [RangeSample(round((k + 1) * DT * NANOSECONDS), f'anchor_{owner + 1}', value, 0.0)
              for k, row in enumerate(values.tolist()) for owner, value in enumerate(row)]
    still = LandingConfig(deck_static=True, target_acceleration_psd=0.1)
    whole, = alternated(rounds, partial(estimator, still, [
        Event(item.stamp, 'uwb/range', item) for item in ranges]))
    yield Figure('landing', 'estimator_epoch', 1e6 * float(np.median(whole)) / epochs, 'us',
                 goal='<= 120')
    full = [event for event in LandingSimulator(replace(SCENE, duration=5.0), truth=False)
            if event.topic in INPUTS]
    whole, = alternated(rounds, partial(estimator, LandingConfig(), full))
    yield Figure('landing', 'estimator_load', 100 * float(np.median(whole)) / 5.0, '% of a core')
    yield from _live(live)


def joint_filter(values: Array) -> Array:
    """Follow ranges, (epochs, 4), by the product's filter; return the positions."""
    joint = JointFilter(Fix(START, np.zeros(3), np.empty(0), np.eye(6), np.ones(4), 0.0),
                        0.05, 1e9)
    points, psd, var = [tuple(row) for row in POINTS.tolist()], np.full(3, 0.1), np.full(4, SD**2)
    positions = np.empty((len(values), 3))
    for row, ranges in zip(positions, values, strict=True):
        joint.advance(DT, psd)
        expected, mat_h = joint.expected(points, 0.0, range(4))
        joint.update(ranges - expected, mat_h, var)
        row[:] = joint.state[:3]
    return positions


def filterpy_filter(values: Array) -> Array:
    """Do as :func:`joint_filter` with filterpy's ``ExtendedKalmanFilter``."""
    peer = import_module('filterpy.kalman').ExtendedKalmanFilter(dim_x=9, dim_z=4)
    ours = JointFilter(Fix(START, np.zeros(3), np.empty(0), np.eye(6), np.ones(4), 0.0),
                       0.05, 1e9)
    before = ours.cov.copy()
    ours.advance(DT, np.full(3, 0.1))
    mat_phi = np.kron([[1.0, DT, DT * DT / 2], [0.0, 1.0, DT], [0.0, 0.0, 1.0]], np.eye(3))
    peer.F, peer.Q, peer.P = mat_phi, ours.cov - mat_phi @ before @ mat_phi.T, before
    peer.R, peer.x = SD**2 * np.eye(4), np.concatenate([START, np.zeros(6)])[:, None]

    def expected(state: Array) -> Array:
        return np.asarray(np.linalg.norm(POINTS - state[:3, 0], axis=1)[:, None])

    def jacobian(state: Array) -> Array:
        away = state[:3, 0] - POINTS
        return np.hstack([away / np.linalg.norm(away, axis=1)[:, None], np.zeros((4, 6))])

    positions = np.empty((len(values), 3))
    for row, ranges in zip(positions, values, strict=True):
        peer.predict()
        peer.update(ranges[:, None], jacobian, expected)
        row[:] = peer.x[:3, 0]
    return positions


def estimator(config: LandingConfig, events: list[Event]) -> int:
    """Let the whole estimator follow a landing; return the number of estimates."""
    followed = LandingEstimator(config)
    count = 0
    for event in events:
        if isinstance(event.sample, (ImuSample, RangeSample)):
            count += len(followed.update(event.topic, event.sample))
    return count


def _live(duration: float) -> Iterator[Figure]:
    events = [event for event in LandingSimulator(replace(SCENE, duration=duration), truth=False)
              if event.topic in INPUTS]
    heard, load = played('landing', events, ODOMETRY, 'landing/odometry')
    yield Figure('landing', 'live_rate', heard / (duration - 1.0), 'estimates/s')
    yield Figure('landing', 'live_load', 100 * load, '% of a core')

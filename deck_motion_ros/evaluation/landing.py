"""Pan2020's experiment, and what the landing filters reach of the best that is possible."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import hypot
from typing import Any

import numpy as np

from deck_motion_ros.estimators.landing import LandingConfig, LandingEstimate, LandingEstimator
from deck_motion_ros.estimators.multilateration import Fix
from deck_motion_ros.estimators.ranging import JointFilter
from deck_motion_ros.evaluation.parallel import results
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.samples import Array, ImuSample, nanoseconds, RangeSample, seconds
from deck_motion_ros.scenarios import Pan2020Scenario
from deck_motion_ros.simulation.landing import (
    LandingSimulator,
    LandingSimulatorConfig,
    NLOS_LEAST,
)
from deck_motion_ros.simulation.sea import GRAVITY
from deck_motion_ros.simulation.simulator import Event

START_SPEED = LandingConfig().start_velocity_sd
INPUTS = ('ship/imu', 'uav/imu', 'uwb/range')
WORTHWHILE = 20  # runs from which on more processes pay


@dataclass(frozen=True, eq=False)
class Scored:
    """
    Estimates of many runs against the truth, at some times of each.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Seconds from the start.
    error : ndarray, shape (runs, n, 3)
        Of the position in deck (m); NaN where there is no estimate.
    cov : ndarray, shape (runs, n, 3, 3)
        What the estimator says of it.
    bound : ndarray, shape (runs, n, 3)
        Smallest possible standard deviation.

    """

    times: Array
    error: Array
    cov: Array
    bound: Array

    def during(self, start: float, end: float = np.inf) -> Scored:
        """Return a part of the time."""
        part = (self.times >= start) & (self.times < end)
        return Scored(self.times[part], self.error[:, part], self.cov[:, part],
                      self.bound[:, part])

    @property
    def rmse(self) -> Array:
        """Root mean square error of each axis (m)."""
        return np.asarray(np.sqrt(np.nanmean(np.square(self.error), axis=(0, 1))))

    @property
    def floor(self) -> Array:
        """Root mean square bound of each axis (m)."""
        return np.asarray(np.sqrt(np.mean(np.square(self.bound), axis=(0, 1))))

    @property
    def ratio(self) -> float:
        """Error over bound, all axes together."""
        return float(np.linalg.norm(self.rmse) / np.linalg.norm(self.floor))

    @property
    def nees(self) -> float:
        """Mean squared error by the estimator's covariance, per axis: 1 where it is honest."""
        flat, cov = self.error.reshape(-1, 3), self.cov.reshape(-1, 3, 3)
        there = np.isfinite(flat[:, 0])
        flat, cov = flat[there], cov[there]
        return float(np.mean(np.einsum('ni,ni->n', flat, np.linalg.solve(
            cov, flat[..., None])[..., 0])) / 3)

    @property
    def run_rms(self) -> Array:
        """Three-dimensional rms error of each run (m)."""
        return np.asarray(np.sqrt(np.nanmean(np.square(self.error).sum(axis=2), axis=1)))


def as_it_is(event: Event) -> Event | None:
    """Let an estimator see an event."""
    return event


@dataclass(frozen=True)
class Entrant:
    """
    An estimator in a comparison.

    Attributes
    ----------
    config : LandingConfig
        Its parameters.
    adapt : callable
        What is made of each event before it sees it; ``None`` = nothing. A function by name:
        it goes to other processes.

    """

    config: LandingConfig
    adapt: Callable[[Event], Event | None] = as_it_is


def without_aircraft(event: Event) -> Event | None:
    """Drop the aircraft's inertial data."""
    return None if event.topic == 'uav/imu' else event


def attitude_only(event: Event) -> Event | None:
    """Leave the ship's attitude and turn rate of all inertial data."""
    if event.topic == 'uav/imu':
        return None
    if isinstance(event.sample, ImuSample):
        return event._replace(sample=replace(event.sample, specific_force=(0.0, 0.0, 0.0)))
    return event


def fly(config: LandingSimulatorConfig, entrants: Mapping[str, Entrant], runs: int,
        times: Array) -> dict[str, Scored]:
    """
    Let estimators follow the same landings.

    Parameters
    ----------
    config : LandingSimulatorConfig
        The landing; run k has the seed + k.
    entrants : mapping
        Estimators by name.
    runs : int
        Number of landings.
    times : ndarray, shape (n,)
        When they are scored (s): with the first estimate from then on.

    """
    tasks = [partial(_landing, config, dict(entrants), times, run) for run in range(runs)]
    landed = [task() for task in tasks] if runs < WORTHWHILE else list(results(tasks))
    bounds = np.array([bound for bound, _ in landed])
    return {name: Scored(times, np.array([table[name][0] for _, table in landed]),
                         np.array([table[name][1] for _, table in landed]), bounds)
            for name in entrants}


def _landing(config: LandingSimulatorConfig, entrants: Mapping[str, Entrant], times: Array,
             run: int) -> tuple[Array, dict[str, tuple[Array, Array]]]:
    """Return the bound of one landing, and each estimator's errors and covariances."""
    flown = replace(config, seed=config.seed + run)
    simulator = LandingSimulator(flown, truth=False)
    events = [event for event in simulator if event.topic in INPUTS]
    table = {}
    for name, entrant in entrants.items():
        estimates = followed(entrant, events)
        stamps = np.array([item.stamp for item in estimates], dtype=np.int64)
        rows = np.searchsorted(stamps, [nanoseconds(time) for time in times.tolist()])
        there = rows < len(stamps)
        picked = [estimates[row] for row in rows[there]]
        truth, _ = simulator.scene.over_deck(np.array([seconds(item.stamp) for item in picked]))
        error, cov = np.full((len(times), 3), np.nan), np.tile(np.eye(3), (len(times), 1, 1))
        error[there] = np.array([item.position for item in picked]) - truth
        cov[there] = [item.cov[:3, :3] for item in picked]
        table[name] = error, cov
    return bound(simulator, flown, events, times), table


def followed(entrant: Entrant, events: list[Event]) -> list[LandingEstimate]:
    """Let an estimator follow a landing."""
    estimator = LandingEstimator(entrant.config)
    estimates: list[LandingEstimate] = []
    for event in events:
        seen = entrant.adapt(event)
        if seen is not None and isinstance(seen.sample, (ImuSample, RangeSample)):
            estimates += estimator.update(seen.topic, seen.sample)
    return estimates


def bound(simulator: LandingSimulator, config: LandingSimulatorConfig, events: list[Event],
          times: Array) -> Array:
    """
    Return the posterior Cramer-Rao bound of a landing.

    That is the covariance of a filter that knows the truth: where the ranges' derivatives are
    taken, which ranges have line of sight, and the noise of both inertial units.

    Parameters
    ----------
    simulator : LandingSimulator
        Of the landing.
    config : LandingSimulatorConfig
        Its parameters.
    events : list of Event
        What it gave.
    times : ndarray, shape (n,)
        Seconds, rising.

    Returns
    -------
    ndarray, shape (n, 3)
        Standard deviation in deck axes (m).

    """
    scene, names = simulator.scene, {name: k for k, name in enumerate(config.anchor_frames)}
    ranges = [event.sample for event in events if isinstance(event.sample, RangeSample)]
    stamps = np.array([seconds(item.stamp) for item in ranges])
    aircraft, (origin, _, turn) = scene.aircraft(stamps), scene.deck(stamps)
    anchors = turn.apply(simulator.anchors[[names[item.frame_id] for item in ranges]])
    away = aircraft.position + aircraft.turn.apply(config.antenna_lever_arm) - origin - anchors
    distance = np.linalg.norm(away, axis=1)
    measured = np.array([item.distance for item in ranges])
    direct = np.abs(measured - distance) < NLOS_LEAST / 2
    stamps, units = stamps[direct], (away / distance[:, None])[direct]
    epochs, first = np.unique(stamps, return_index=True)
    groups = np.split(units, first[1:])

    best = JointFilter(
        Fix(np.zeros(3), np.zeros(3), np.empty(0), np.diag([1e8] * 3 + [START_SPEED**2] * 3),
            np.empty(0), 0.0),
        hypot(config.uav_accel_drift_sd, GRAVITY * config.uav_attitude_drift_sd),
        config.uav_drift_time)
    # without uav/imu the aircraft may do anything
    psd = np.full(3, config.uav_accel_white_sd**2 / (config.uav_rate or 1e-3))
    covs = np.empty((len(times), 3, 3))
    now, k = 0.0, 0
    for row, time in enumerate(times.tolist()):
        while k < len(epochs) and epochs[k] <= time:
            best.advance(float(epochs[k]) - now, psd)
            now, group = float(epochs[k]), groups[k]
            mat_h = np.zeros((len(group), 9))
            mat_h[:, :3] = group
            best.update(np.zeros(len(group)), mat_h,
                        np.full(len(group), config.range_white_sd**2))
            k += 1
        best.advance(time - now, psd)
        now, covs[row] = time, best.cov[:3, :3]
    _, _, turn = scene.deck(times)
    to_deck = turn.inv().as_matrix()
    return np.asarray(np.sqrt(np.einsum('nij,njk,nik->ni', to_deck, covs, to_deck)))


def _cm(name: str, values: Array, printed: tuple[float, ...] | None = None,
        floor: Array | None = None) -> list[Row]:
    """Give a row for each axis."""
    return [Row('Pan2020', f'{name}_{axis}', 100 * float(values[k]), 'cm',
                printed[k] if printed else None,
                100 * float(floor[k]) if floor is not None else None)
            for k, axis in enumerate('xyz')]


def _ratio(name: str, value: float) -> Row:
    return Row('Pan2020', name, value, '')


def paper_scene(case: Pan2020Scenario) -> list[Row]:
    """Let the paper's filter and the joint one fly the paper's scene: ranges alone."""
    step, phase = case.paper_step, 200 * case.paper_step
    config = LandingSimulatorConfig(
        seed=case.seed, duration=3 * phase, deck='pan2020', boat_rotation=0.0, rate=1 / step,
        uav_rate=0.0, range_rate=1 / step, uav_start=case.start, approach_time=phase,
        hold_time=phase, descent_time=phase, deck_lever_arm=(0.0, 0.0, 0.0))
    told = LandingConfig(deck_lever_arm=(0.0, 0.0, 0.0))
    flown = fly(config, {
        'paper': Entrant(replace(told, method='paper', paper_noise=case.paper_noise)),
        'joint': Entrant(told)}, case.runs, np.linspace(0.0, 3 * phase - step, 600))
    paper, joint = (flown[name].during(case.settle) for name in ('paper', 'joint'))
    return [*_cm('paper_rmse', paper.rmse, printed=(12.54, 12.02, 9.02)),
            _ratio('paper_nees', paper.nees),
            *_cm('joint_paper_scene_rmse', joint.rmse)]


def rolling_scene(case: Pan2020Scenario) -> list[Row]:
    """Let the filters fly to the boat that rolls as the paper says."""
    phase, end = case.phase, 3 * case.phase
    level = (0.0, 0.0, 0.0)
    config = LandingSimulatorConfig(
        seed=case.seed, duration=end, deck='pan2020', uav_start=case.start, deck_lever_arm=level,
        approach_time=phase, hold_time=phase, descent_time=phase, uav_rate=case.uav_rate,
        range_rate=case.range_rate)
    told = LandingConfig(deck_lever_arm=level)
    default = {'joint': Entrant(told)}

    def flown(entrants: Mapping[str, Entrant], runs: int = case.runs,
              **changes: Any) -> dict[str, Scored]:
        changed = replace(config, **changes)
        period = 1 / changed.range_rate
        times = np.arange(case.settle, end - period, period) + 1 / case.uav_rate
        return fly(changed, entrants, runs, times)

    clean = flown({
        'joint': Entrant(told), 'no_aircraft': Entrant(told, without_aircraft),
        'attitude_only': Entrant(told, attitude_only),
        'paper': Entrant(replace(told, method='paper', paper_noise=case.paper_noise))})
    joint = clean['joint']
    rows = [*_cm('joint_rmse', joint.rmse, floor=joint.floor),
            _ratio('joint_ratio', joint.ratio), _ratio('joint_nees', joint.nees)]
    for name, start in (('approach', 0.0), ('hold', phase), ('descent', 2 * phase)):
        part = joint.during(start, start + phase)
        rows += [_ratio(f'joint_ratio_{name}', part.ratio),
                 _ratio(f'joint_nees_{name}', part.nees)]
    last = joint.during(end - 1.0)
    rows += _cm('joint_last_second_rmse', last.rmse, floor=last.floor)
    for name in ('attitude_only', 'no_aircraft', 'paper'):
        rows += [*_cm(f'{name}_rolling_rmse', clean[name].rmse),
                 _ratio(f'{name}_rolling_nees', clean[name].nees)]

    faster = flown(default, range_rate=2 * case.range_rate)['joint']
    rows += _cm('joint_20hz_rmse', faster.rmse, floor=faster.floor)
    in_turn = flown(default, range_spacing=1 / case.range_rate / 4)['joint']
    rows += [*_cm('in_turn_rmse', in_turn.rmse, floor=in_turn.floor),
             _ratio('in_turn_to_at_once', float(
                 np.linalg.norm(in_turn.rmse) / np.linalg.norm(joint.rmse)))]
    lost: dict[str, Any] = {'lost_anchor': 'anchor_2', 'lost_time': phase}
    for name, hurt in (
            ('nlos', flown(default, nlos_share=0.1)['joint']),
            ('nlos_lost', flown(default, 2 * case.runs, nlos_share=0.1, **lost)['joint'])):
        rows += [_ratio(f'{name}_ratio', hurt.ratio), _ratio(f'{name}_nees', hurt.nees),
                 _ratio(f'{name}_to_clean', float(
                     np.linalg.norm(hurt.rmse) / np.linalg.norm(joint.rmse))),
                 Row('Pan2020', f'{name}_worst_run_rms', 100 * float(hurt.run_rms.max()), 'cm')]
    gap = phase + phase / 2
    few = -(-case.runs // 4)
    out = flown(default, few, outage_start=gap, outage_duration=5.0)['joint']
    rows += [_ratio('outage_nees', out.during(gap, gap + 5.0).nees)]
    for name, start in (('outage_end', gap + 4.5), ('after_outage', gap + 6.0)):
        part = out.during(start, start + 0.5)
        rows += _cm(f'{name}_rmse', part.rmse, floor=part.floor)
    rows += _cm('survey_2cm_rmse', flown(default, few, survey_sd=0.02)['joint'].rmse)
    rows += _cm('bias_5cm_rmse', flown(default, few, range_bias_sd=0.05)['joint'].rmse)
    return rows


def pan2020(runs: int | None = None) -> list[Row]:
    """
    Run Pan2020's experiment and what goes beyond it.

    Parameters
    ----------
    runs : int, optional
        Instead of the scenario's.

    """
    case = Pan2020Scenario() if runs is None else replace(Pan2020Scenario(), runs=runs)
    return [*paper_scene(case), *rolling_scene(case)]

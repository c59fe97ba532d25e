"""
All predictors side by side on the same records, from a cold start, causally.

What is predicted is linear in the axes (the touchdown height to first order in the angles), so
that the floor predicts exactly the same. A scenario is scored against the truth, a recording
against what was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from typing import Any, Protocol

import numpy as np
from scipy.special import ndtri

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.baselines import (
    AutoregressiveAxis,
    HarmonicAxis,
    PerAxis,
    PersistentAxis,
    StillAxis,
)
from deck_motion_ros.estimators.interleaved import InterleavedPredictor
from deck_motion_ros.estimators.shaping import ShapingPredictor
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.evaluation.floor import estimated_floor, SensorModel, wiener_predictors
from deck_motion_ros.evaluation.metrics import crest_errors, crests, rms, Series
from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.importers import import_file
from deck_motion_ros.samples import Array, NANOSECONDS, Vector3
from deck_motion_ros.scenarios import LANDING_POINTS, PredictionScenario, SEA_STATES
from deck_motion_ros.simulation.sea import dense_waves, joined
from deck_motion_ros.simulation.ship import HEAVE, HULLS, motion_lines, PITCH, ROLL, YAW
from deck_motion_ros.simulation.simulator import ship_in_waves, SimulatorConfig, wave_systems


class Predictor(Protocol):
    """What every predictor offers here."""

    def measure(self, axis: int, time: float, value: float, var: float) -> None:
        """Use a measurement."""

    def outlook(self) -> Any:
        """Return what is known now: ``mean(time)`` predicts roll, pitch, heave."""


ADAPTIVE, FIXED = 'adaptive', 'Li2014 fixed'
METHODS: Mapping[str, Callable[[], Predictor]] = {
    'persistence': partial(PerAxis, PersistentAxis),
    'zero': partial(PerAxis, StillAxis),
    FIXED: partial(ShapingPredictor, tuned=False),
    'Li2014 tuned': ShapingPredictor,
    'Zhang2021': InterleavedPredictor,
    'AR(30)': partial(PerAxis, AutoregressiveAxis),
    'harmonic bank': partial(PerAxis, HarmonicAxis),
    ADAPTIVE: AdaptivePredictor}

# the fixed filter has its noise as published
ANGLE_VAR, HEAVE_VAR = PredictorConfig(shaping_preset='mru').noise()
HORIZONS = (1.0, 2.0, 3.0, 5.0, 8.0, 10.0)  # s
PROBABILITIES = (0.68, 0.95)
STEADY = {'minutes 1-2': (60.0, 120.0), 'minutes 2-5': (120.0, 300.0),
          'minutes 5-10': (300.0, 600.0), 'minutes 10-20': (600.0, 1200.0),
          'minutes 20-30': (1200.0, 1800.0)}
AFTER = {'first 2 min after': (0.0, 120.0), '2-5 min after': (120.0, 300.0),
         'later': (300.0, inf)}  # s after the end of a manoeuvre
WARM = 300.0  # s: from then on crests are judged, and what is before a manoeuvre
START = 120.0  # s: from then on a recording is judged
CREST_TIMES = np.arange(1.5, 4.75, 0.25)  # s ahead
EVERY = 0.7  # s between forecasts, so that all phases of anybody's grid have their turn
RECORDING_VAR = (0.0005**2, 0.0005**2, 0.05**2)  # where nobody says how good the sensor is
AFT = {'roll': (1.0, 0.0, 0.0), 'pitch': (0.0, 1.0, 0.0), 'heave': (0.0, 0.0, 1.0),
       '35 m aft': (0.0, 35.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Scores:
    """
    All predictors on one quantity of one record.

    Attributes
    ----------
    record, quantity : str
        What was predicted.
    stationary : bool
        One of the scenarios over which means are taken.
    windows : tuple of str
        Spans of the time of issue.
    sd : float
        Of the quantity.
    rmse : mapping of str to ndarray, shape (windows, horizons)
        By method.
    floor : ndarray, shape (windows, horizons)
        Rms error of the floor predictor on the same record, NaN during a manoeuvre; of a
        recording an estimate.
    coverage : ndarray, shape (2, windows, horizons)
        Share of what came within the intervals of PROBABILITIES, of method ``adaptive``.
    crest_errors : ndarray
        Announced minus real time of crests 2-4 s ahead (s), of method ``adaptive``.
    cost : mapping of str to (float, float)
        CPU seconds for a sample of all axes by method: mean, worst.

    """

    record: str
    quantity: str
    stationary: bool
    windows: tuple[str, ...]
    sd: float
    rmse: Mapping[str, Array]
    floor: Array
    coverage: Array
    crest_errors: Array
    cost: Mapping[str, tuple[float, float]]

    def ratio(self, method: str, *windows: str) -> Array:
        """Return error / floor over some windows of equal length, shape (horizons,)."""
        rows = [self.windows.index(window) for window in windows]
        power = [np.square(table[rows]).mean(axis=0) for table in (self.rmse[method], self.floor)]
        return np.asarray(np.sqrt(power[0] / power[1]))

    def share(self, method: str, window: str) -> Array:
        """Return error / sd of the motion, shape (horizons,)."""
        return np.asarray(self.rmse[method][self.windows.index(window)] / self.sd)


@dataclass(frozen=True, eq=False)
class Followed:
    """
    What one predictor said along a record.

    Attributes
    ----------
    mean : ndarray, shape (n, horizons, 3)
        At HORIZONS, from each of n samples.
    cov : ndarray, shape (n, horizons, 3, 3)
        Its error covariance; NaN but for method ``adaptive``.
    ahead : ndarray, shape (n, times, 3)
        Mean at CREST_TIMES; no times but for method ``adaptive``.
    cost : tuple of 2 float
        CPU seconds for a sample: mean, worst.

    """

    mean: Array
    cov: Array
    ahead: Array
    cost: tuple[float, float]


def followed(method: str, times: Array, measured: Array, var: Vector3, due: Sequence[bool],
             yaw: Array | None = None) -> Followed:
    """
    Take a predictor along a record.

    Parameters
    ----------
    method : str
        In METHODS.
    times : ndarray, shape (n,)
        Seconds, rising.
    measured : ndarray, shape (n, 3)
        Roll, pitch (rad), heave (m); NaN where an axis was not measured.
    var : tuple of 3 float
        Of the measurements.
    due : sequence of n bool
        After which samples to forecast.
    yaw : ndarray, shape (n,), optional
        Heading (rad), for the predictor that uses it.

    """
    predictor = METHODS[method]()
    headings = repeat(None) if yaw is None else yaw.tolist()
    if method == FIXED:
        var = ANGLE_VAR, ANGLE_VAR, HEAVE_VAR
    number, h = int(np.sum(due)), len(HORIZONS)
    detailed = np.concatenate([HORIZONS, CREST_TIMES if method == ADAPTIVE else ()])
    mean = np.empty((number, len(detailed), 3))
    cov = np.full((number, h, 3, 3), nan)
    said, total, worst = 0, 0.0, 0.0
    for time, row, forecast, heading in zip(times.tolist(), measured.tolist(), due, headings):
        start = thread_time()
        if heading is not None and isinstance(predictor, AdaptivePredictor):
            predictor.head(time, heading)
        for axis, value in enumerate(row):
            if value == value:
                predictor.measure(axis, time, value, var[axis])
        spent = thread_time() - start
        total, worst = total + spent, max(worst, spent)
        if not forecast:
            continue
        outlook = predictor.outlook()
        if method == ADAPTIVE:
            motion = outlook.forecast(time, detailed)
            mean[said], cov[said] = motion.mean, motion.cov[:h]
        else:
            mean[said] = [outlook.mean(time + horizon) for horizon in HORIZONS]
        said += 1
    return Followed(mean[:, :h], cov, mean[:, h:], (total / len(times), worst))


def simulator_config(case: PredictionScenario) -> SimulatorConfig:
    """Set the simulator for a scenario: no slow errors, since the floor knows white noise."""
    height, period = SEA_STATES[case.sea_state]
    course = 90.0
    return SimulatorConfig(
        seed=case.seed, rate=1 / case.dt, duration=case.duration, hull=case.hull,
        course_deg=course, speed=case.speed,
        turn_to_deg=nan if case.turn_deg is None else course - case.turn_deg,
        turn_time=case.manoeuvre_at, speed_to=nan if case.speed_to is None else case.speed_to,
        speed_change_time=case.manoeuvre_at, significant_wave_height=height, peak_period=period,
        wave_heading_deg=case.heading_deg, spreading=case.spreading, waves=case.waves,
        white_sd=noise_sd(case), drift_sd=(0.0, 0.0, 0.0))


def noise_sd(case: PredictionScenario) -> Vector3:
    """Return the noise of roll, pitch (rad) and heave (m)."""
    roll, pitch, heave = case.white_sd
    return case.noise * roll, case.noise * pitch, case.noise * heave


def simulated(case: PredictionScenario) -> tuple[Array, Array, Array, Array]:
    """
    Give a scenario's record: what the simulator's motion sensor measures of its motion.

    Returns
    -------
    times : ndarray, shape (n,)
        Seconds.
    truth, measured : ndarray, shape (n, 3)
        Roll, pitch (rad), heave (m).
    yaw : ndarray, shape (n,)
        True heading (rad), swinging in the waves.

    """
    times = case.dt * np.arange(round(case.duration / case.dt), dtype=float)
    motion = ship_in_waves(simulator_config(case)).motion(times)
    truth = motion.value[:, [ROLL, PITCH, HEAVE]]
    noise = np.random.default_rng([case.seed, 2]).standard_normal(truth.shape)
    return times, truth, truth + noise * noise_sd(case), motion.track.yaw + motion.value[:, YAW]


def floor_forecasts(case: PredictionScenario, measured: Array, end: bool = False) -> Array:
    """
    Run the floor predictors along a scenario's record.

    Parameters
    ----------
    case : PredictionScenario
        Its spectra and noise are what the floor predictors know.
    measured : ndarray, shape (n, 3)
        The record.
    end : bool
        Know the course and speed after the manoeuvre, not before.

    Returns
    -------
    ndarray, shape (n, horizons)
        The height (m) predicted at each sample; NaN while the history is too short.

    """
    config = simulator_config(case)
    track = ship_in_waves(config).course.at(np.array([case.duration if end else 0.0]))
    sea = joined(dense_waves(system, 300, 24) for system in wave_systems(config))
    lines = motion_lines(HULLS[case.hull], sea, float(track.yaw[0]), float(track.speed[0]))
    return np.stack([predictor.predict(measured) for predictor in wiener_predictors(
        lines.covariance, SensorModel(noise_sd(case)), height_lever(LANDING_POINTS[case.hull]),
        HORIZONS, dt=case.dt)], axis=-1)


def height_lever(point: Vector3) -> Vector3:
    """Return the height of a point (m, ship axes) as a combination of roll, pitch, heave."""
    return point[1], -point[0], 1.0


def scenario_scores(case: PredictionScenario) -> Scores:
    """Run all predictors and the floor over one scenario."""
    times, truth, measured, yaw = simulated(case)
    lever = np.array(height_lever(LANDING_POINTS[case.hull]))
    height = truth @ lever
    rows = np.arange(0, len(times), round(EVERY / case.dt))
    leads = np.array([round(horizon / case.dt) for horizon in HORIZONS])
    came = np.append(height, np.full(leads[-1], nan))[rows[:, None] + leads]
    due = np.isin(np.arange(len(times)), rows)
    var = np.square(noise_sd(case))
    runs = {method: followed(method, times, measured, var.tolist(), due.tolist(), yaw)
            for method in METHODS}
    floor = floor_forecasts(case, measured)[rows]
    windows = dict(STEADY)
    if edges := ship_in_waves(simulator_config(case)).course.edges.tolist():
        start, stop = edges
        after = floor_forecasts(case, measured, end=True)[rows]
        floor[times[rows] >= start] = nan
        floor[times[rows] >= stop] = after[times[rows] >= stop]
        windows = {'before': (WARM, start), 'during': (start, stop)} | {
            name: (stop + first, stop + last) for name, (first, last) in AFTER.items()}
    adaptive = runs[ADAPTIVE]
    warm = times[rows] >= WARM
    return Scores(
        case.name, 'height', case.stationary, tuple(windows), float(np.std(height)),
        {method: _by_window(run.mean @ lever - came, times[rows], windows)
         for method, run in runs.items()},
        _by_window(floor - came, times[rows], windows),
        _coverage(adaptive, lever, came, times[rows], windows),
        crest_errors(times[rows][warm], CREST_TIMES, adaptive.ahead[warm] @ lever,
                     crests(Series(_stamps(times), height))),
        {method: run.cost for method, run in runs.items()})


def recording_scores(name: str, path: Path) -> list[Scores]:
    """
    Run all predictors over one recording, a log that can be imported.

    Parameters
    ----------
    name : str
        Of the recording, in the scores.
    path : Path
        The log.

    Returns
    -------
    list of Scores
        For each axis, and for the height of a point 35 m aft if all axes were measured.

    """
    with TemporaryDirectory() as work:
        import_file(path, Path(work, 'bag'))
        axes = read_record(Path(work, 'bag')).measured
    known = [axis for axis in axes if axis is not None]
    stamps = np.unique(np.concatenate([axis.stamps for axis in known]))
    measured = np.full((len(stamps), 3), nan)
    for column, axis in zip(measured.T, axes, strict=True):
        if axis is not None:
            column[np.searchsorted(stamps, axis.stamps)] = axis.values
    times = (stamps - stamps[0]) / NANOSECONDS
    rows = np.arange(0, len(times), max(round(EVERY / known[0].period), 1))
    due = np.isin(np.arange(len(times)), rows)
    runs = {method: followed(method, times, measured, RECORDING_VAR, due.tolist())
            for method in METHODS}
    later = stamps[rows, None] + _stamps(np.array(HORIZONS))
    there = [i for i, axis in enumerate(axes) if axis is not None]
    came = np.stack([axis.at(later.ravel()).reshape(later.shape) for axis in known], axis=-1)
    window = {'from minute 2 on': (START, inf)}
    even, dt = _even(known)
    scores = []
    for quantity, weights in AFT.items():
        lever = np.array(weights)
        if np.any(np.delete(lever, there)):
            continue
        what = came @ lever[there]
        adaptive = runs[ADAPTIVE]
        height = measured[times >= START][:, there] @ lever[there]
        scores.append(Scores(
            name, quantity, False, tuple(window), float(np.nanstd(height)),
            {method: _by_window(run.mean @ lever - what, times[rows], window)
             for method, run in runs.items()},
            estimated_floor(even, dt, lever[there].tolist(), HORIZONS)[None],
            _coverage(adaptive, lever, what, times[rows], window), np.empty(0),
            {method: run.cost for method, run in runs.items()}))
    return scores


def _stamps(times: Array) -> Any:
    return np.round(times * NANOSECONDS).astype(np.int64)


def _even(axes: Sequence[Series]) -> tuple[Array, float]:
    """Bring axes to even steps of at least 0.5 s, in the longest part without a gap."""
    runs = [axis.longest_run() for axis in axes]
    start, end = max(run.stamps[0] for run in runs), min(run.stamps[-1] for run in runs)
    dt = max(axes[0].period, 0.5)
    stamps = start + _stamps(np.arange(0.0, (end - start) / NANOSECONDS, dt))
    return np.stack([run.at(stamps) for run in runs], axis=-1), dt


def _by_window(error: Array, times: Array, windows: Mapping[str, tuple[float, float]]) -> Array:
    """Return the rms of errors (n, horizons) in each window, where they are known."""
    return np.array([[rms(column[np.isfinite(column)]) for column in error[part].T]
                     for part in ((times >= start) & (times < end)
                                  for start, end in windows.values())])


def _coverage(run: Followed, lever: Array, came: Array, times: Array,
              windows: Mapping[str, tuple[float, float]]) -> Array:
    sd = np.sqrt(np.einsum('nhij,i,j->nh', run.cov, lever, lever))
    size = np.abs(run.mean @ lever - came) / sd
    held = [np.where(np.isfinite(size), size <= ndtri((1 + probability) / 2), nan)
            for probability in PROBABILITIES]
    return np.square([_by_window(item, times, windows) for item in held])

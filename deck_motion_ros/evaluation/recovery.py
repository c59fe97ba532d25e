"""What bad input does to the adaptive predictor, and after how many seconds that is over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, nan

import numpy as np

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.geometry import height_above_rest, rpy_from_quaternion, turned_arm
from deck_motion_ros.samples import (
    Array,
    HEAVE,
    HeaveSample,
    ImuSample,
    NANOSECONDS,
    OdometrySample,
    PITCH,
    ROLL,
    Vector3,
)
from deck_motion_ros.simulation.simulator import ShipSimulator, SimulatorConfig


@dataclass(frozen=True)
class RecoveryScenario:
    """
    A destroyer in a stationary sea whose sensors fail.

    Attributes
    ----------
    seed : int
        Of the sea and of the outliers.
    rate, duration : float
        Of the samples (Hz), of a run (s).
    start : float
        Second at which the fault begins.
    passing : float
        How long a fault that passes lasts (s); a gap lasts two minutes.
    lever_arm : tuple of 3 float
        Touchdown point (m).
    horizon : float
        Seconds ahead.
    factor, window : float
        Recovered is who errs by less than ``factor`` times the undisturbed run's rms error over
        the next ``window`` seconds. 1.2 of 30 s: between stretches so short the undisturbed
        error itself wanders by 20 %.

    """

    seed: int = 202611
    rate: float = 4.0
    duration: float = 1200.0
    start: float = 300.0
    passing: float = 60.0
    lever_arm: Vector3 = (-60.0, 2.0, 6.0)
    horizon: float = 3.0
    factor: float = 1.2
    window: float = 30.0


@dataclass(frozen=True)
class Recovery:
    """
    What one fault did.

    Attributes
    ----------
    fault : str
        In words.
    seconds : float
        From the end of the fault, or the start of one that stays, until the error is as before;
        infinite if it never was.
    worst : float
        Largest error / promised sd from the start of the fault on.
    covered : float
        Share of what came within the 95 % interval from the start of the fault until recovery,
        and for one window at least.

    """

    fault: str
    seconds: float
    worst: float
    covered: float


@dataclass(frozen=True)
class Fault:
    """
    How the input goes wrong.

    Attributes
    ----------
    spoil : callable
        Changes measured and true motion (n, 3) from the start on in place, where the truth is
        what a perfect sensor so mounted would say; NaN is no message. The generator is for noise.
    duration : float
        Seconds; infinite if it stays.

    """

    spoil: Callable[[Array, Array, np.random.Generator], None]
    duration: float


def _outliers(measured: Array, truth: Array, rng: np.random.Generator) -> None:
    hit = rng.random(measured.shape) < 0.01
    measured += hit * rng.choice([-10.0, 10.0], measured.shape) * truth.std(axis=0)


def _held(*axes: int) -> Callable[[Array, Array, np.random.Generator], None]:
    def spoil(measured: Array, truth: Array, rng: np.random.Generator) -> None:
        measured[:, axes] = measured[0, axes]

    return spoil


def _silent(*axes: int) -> Callable[[Array, Array, np.random.Generator], None]:
    def spoil(measured: Array, truth: Array, rng: np.random.Generator) -> None:
        measured[:, axes] = nan

    return spoil


def _flip(measured: Array, truth: Array, rng: np.random.Generator) -> None:
    measured[:, PITCH] *= -1
    truth[:, PITCH] *= -1


def _swap(measured: Array, truth: Array, rng: np.random.Generator) -> None:
    offset = (0.03, 0.01, 0.5)
    measured += offset
    truth += offset


def faults(case: RecoveryScenario) -> Mapping[str, Fault]:
    """Return the faults of a scenario by name."""
    return {
        'outliers, 1 % at 10 sd': Fault(_outliers, inf),
        'all axes constant': Fault(_held(ROLL, PITCH, HEAVE), case.passing),
        'heave stuck': Fault(_held(HEAVE), case.passing),
        'no roll and pitch': Fault(_silent(ROLL, PITCH), case.passing),
        'no heave': Fault(_silent(HEAVE), case.passing),
        'gap of two minutes': Fault(_silent(ROLL, PITCH, HEAVE), 120.0),
        'sign of pitch flipped': Fault(_flip, inf),
        'sensor swapped, 1.7 and 0.6 deg and 0.5 m off': Fault(_swap, inf)}


def voyage(case: RecoveryScenario) -> tuple[Array, Array, Array]:
    """
    Simulate the ship.

    Returns
    -------
    times : ndarray, shape (n,)
        Seconds.
    measured, truth : ndarray, shape (n, 3)
        Roll, pitch (rad), heave (m).

    """
    config = SimulatorConfig(seed=case.seed, rate=case.rate, duration=case.duration)
    steps = round(case.rate * case.duration)
    measured, truth = np.full((2, steps, 3), nan)
    for _, _, sample in ShipSimulator(config, 0):
        k = round(sample.stamp * case.rate / NANOSECONDS)
        if k >= steps:
            continue
        if isinstance(sample, ImuSample) and sample.orientation:
            measured[k, :HEAVE] = rpy_from_quaternion(sample.orientation)[:HEAVE]
        elif isinstance(sample, HeaveSample):
            measured[k, HEAVE] = sample.height
        elif isinstance(sample, OdometrySample) and sample.orientation:
            roll, pitch, _ = rpy_from_quaternion(sample.orientation)
            truth[k] = roll, pitch, sample.position[2]
    return np.arange(steps) / case.rate, measured, truth


def forecast_errors(case: RecoveryScenario, times: Array, measured: Array,
                    truth: Array) -> tuple[Array, Array]:
    """
    Let the predictor forecast the height of the touchdown point once a second.

    Returns
    -------
    errors, sds : ndarray, shape (n,)
        By the time of issue; NaN where nothing was forecast.

    """
    angle_var, heave_var = PredictorConfig().noise()
    predictor, lead = AdaptivePredictor(), round(case.horizon * case.rate)
    errors, sds = np.full((2, len(times)), nan)
    every = round(case.rate)

    def height(motion: Array) -> float:
        roll, pitch, heave = motion.tolist()
        return height_above_rest(roll, pitch, heave, case.lever_arm)

    for k, time in enumerate(times.tolist()):
        there = np.flatnonzero(np.isfinite(measured[k])).tolist()
        for axis in there:
            predictor.measure(axis, time, float(measured[k, axis]),
                              heave_var if axis == HEAVE else angle_var)
        if there and k % every == 0 and k + lead < len(times):
            ahead = predictor.outlook().forecast(time, np.array([case.horizon]))
            _, by_roll, by_pitch = turned_arm(ahead.mean[:, 0], ahead.mean[:, 1], case.lever_arm)
            gradient = np.array([by_roll[0, 2], by_pitch[0, 2], 1.0])
            errors[k] = height(ahead.mean[0]) - height(truth[k + lead])
            sds[k] = np.sqrt(gradient @ ahead.cov[0] @ gradient)
    return errors, sds


def recoveries(case: RecoveryScenario | None = None,
               names: tuple[str, ...] | None = None) -> list[Recovery]:
    """
    Let every fault happen to the same voyage.

    Parameters
    ----------
    case : RecoveryScenario, optional
        Another than the frozen one.
    names : tuple of str, optional
        Of ``faults``; all if not given.

    """
    case = case or RecoveryScenario()
    times, measured, truth = voyage(case)
    usual, _ = forecast_errors(case, times, measured, truth)
    every = faults(case)
    found = []
    for name in names or tuple(every):
        fault, bad, true = every[name], measured.copy(), truth.copy()
        span = (times >= case.start) & (times < case.start + fault.duration)
        first, last = np.flatnonzero(span)[[0, -1]]
        during = slice(first, last + 1)
        fault.spoil(bad[during], true[during], np.random.default_rng(case.seed))
        errors, sds = forecast_errors(case, times, bad, true)
        over = case.start + (fault.duration if fault.duration < inf else 0.0)
        seconds = _seconds(case, times, errors, usual, over)
        since = (times >= case.start) & np.isfinite(errors)
        ratio = np.abs(errors) / sds
        until = since & (times < max(over + seconds, case.start + case.window))
        found.append(Recovery(
            name, seconds, float(ratio[since].max()), float(np.mean(ratio[until] < 1.96))))
    return found


def _seconds(case: RecoveryScenario, times: Array, errors: Array, usual: Array,
             over: float) -> float:
    """Find when the errors of a window from there on are as usual again."""
    starts = times[(times >= over) & np.isfinite(usual) & (times <= times[-1] - case.window)]
    for start in starts.tolist():
        window = (times >= start) & (times < start + case.window) & np.isfinite(usual + errors)
        if window.any() and (np.square(errors[window]).mean()
                             < case.factor**2 * np.square(usual[window]).mean()):
            return float(start - over)
    return inf

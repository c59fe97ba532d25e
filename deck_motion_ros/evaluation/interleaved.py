"""Zhang2021's experiment: what its gain is made of."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi

import numpy as np

from deck_motion_ros.estimators.adaptive import AdaptivePredictor
from deck_motion_ros.estimators.interleaved import AccelerationFilter, FADING
from deck_motion_ros.evaluation.floor import SensorModel, wiener_predictors
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.samples import Array, ROLL
from deck_motion_ros.scenarios import Zhang2021Scenario


def _waves(case: Zhang2021Scenario) -> tuple[Array, Array]:
    """Return frequencies (rad/s) and variances of the cosines that make the roll."""
    omega = np.linspace(case.lowest, case.highest, case.waves)
    power = np.exp(-np.square((omega / case.peak - 1) / case.bandwidth) / 2)
    return omega, power * case.sd**2 / power.sum()


def roll_records(case: Zhang2021Scenario) -> tuple[Array, Array]:
    """
    Draw Zhang2021's records: true roll, and white noise of unit variance to measure it with.

    Returns
    -------
    truth, noise : ndarray, shape (points, runs)

    """
    omega, var = _waves(case)
    angle = np.outer(case.dt * np.arange(case.points), omega)
    even, odd = np.sqrt(2 * var) * np.cos(angle), np.sqrt(2 * var) * np.sin(angle)
    truth, noise = np.empty((2, case.points, case.runs))
    for k in range(case.runs):
        rng = np.random.default_rng(case.seed + k)
        phases = rng.uniform(0.0, 2 * pi, case.waves)
        truth[:, k] = even @ np.cos(phases) - odd @ np.sin(phases)
        noise[:, k] = rng.normal(size=case.points)
    return truth, noise


def interleaved_forecasts(case: Zhang2021Scenario, values: Array, fading: float) -> Array:
    """
    Predict ``horizon`` seconds ahead of every point by the two halves' filters.

    Parameters
    ----------
    case : Zhang2021Scenario
        Step, horizon, noise that the filters believe in.
    values : ndarray, shape (points, runs)
        Measured roll (rad).
    fading : float
        s; 1 is the plain filter.

    Returns
    -------
    ndarray, shape (points, runs)
        Row k: from point k and those before it in its half.

    """
    ahead, var = np.empty_like(values), case.filter_sd**2
    for first in (0, 1):
        half = AccelerationFilter(values[first], var, case.sd * case.peak,
                                  case.sd * case.peak**2, fading=fading)
        ahead[first] = half.ahead(case.horizon)
        for k in range(first + 2, case.points, 2):
            half.step(2 * case.dt, values[k], var)
            ahead[k] = half.ahead(case.horizon)
    return ahead


def adaptive_forecasts(case: Zhang2021Scenario, values: Array) -> Array:
    """
    Let the adaptive predictor, which knows nothing of this sea, forecast roll alone.

    Parameters
    ----------
    case : Zhang2021Scenario
        The experiment.
    values : ndarray, shape (n, runs)
        Measured roll (rad).

    Returns
    -------
    ndarray, shape (n, runs)
        Row k: roll (rad) predicted at point k, ``case.horizon`` ahead.

    """
    ahead = np.empty_like(values)
    for column, series in zip(ahead.T, values.T, strict=True):
        predictor = AdaptivePredictor()
        for k, value in enumerate(series.tolist()):
            time = k * case.dt
            predictor.measure(ROLL, time, value, case.noise_sd**2)
            column[k] = predictor.outlook().mean(time + case.horizon)[ROLL]
    return ahead


def roll_floor(case: Zhang2021Scenario) -> float:
    """Return the error of the best linear predictor of that roll (rad), which knows its sea."""
    omega, var = _waves(case)
    roll = np.diag([1.0, 0.0, 0.0])
    best, = wiener_predictors(
        lambda lags: (np.cos(np.outer(lags, omega)) @ var)[:, None, None] * roll,
        SensorModel((case.noise_sd, 0.0, 0.0)), (1.0, 0.0, 0.0), [case.horizon], [0], case.dt)
    return best.error_sd


def zhang2021(runs: int | None = None) -> list[Row]:
    """
    Run Zhang2021's experiment: mean of the records' rms errors 1 s ahead against the truth.

    What the paper's gain is made of: its plain filter is scored one step late, since it puts out
    what it predicted before it uses the newest point. On time it errs by half as much, and with
    fading memory by little more than half of that, if noise is far below the 0.1 deg of R.

    Parameters
    ----------
    runs : int, optional
        Instead of the scenario's.

    """
    case = Zhang2021Scenario() if runs is None else replace(Zhang2021Scenario(), runs=runs)
    truth, noise = roll_records(case)
    measured, noisy = (truth + sd * noise for sd in (case.noise_sd, case.filter_sd))
    plain, fading = (interleaved_forecasts(case, measured, s) for s in (1.0, FADING))
    plain_noisy, fading_noisy = (interleaved_forecasts(case, noisy, s) for s in (1.0, FADING))
    adaptive = adaptive_forecasts(case, measured)
    lead = round(case.horizon / case.dt)
    floor = degrees(roll_floor(case))

    def row(name: str, ahead: Array, age: int = lead, printed: float | None = None,
            floor: float | None = floor, first: int = case.first_scored) -> Row:
        error = ahead[first - age:case.points - age] - truth[first:]
        value = float(np.sqrt(np.mean(np.square(error), axis=0)).mean())
        return Row('Zhang2021', name, degrees(value), 'deg', printed, floor)

    return [
        row('plain_late_rmse_1s', plain, 2 * lead, printed=0.3935),
        row('plain_rmse_1s', plain),
        row('fading_rmse_1s', fading, printed=0.1173),
        row('adaptive_rmse_1s', adaptive),
        row('adaptive_after_60s_rmse_1s', adaptive, first=round(60 / case.dt)),
        row('persistence_rmse_1s', measured),
        row('sd', np.zeros_like(truth), floor=None),
        row('plain_noisy_rmse_1s', plain_noisy, floor=None),
        row('fading_noisy_rmse_1s', fading_noisy, floor=None)]

"""The papers' experiments: what each prints, what ours gives, and the best that theory allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import degrees, hypot

import numpy as np

from deck_motion_ros.estimators.kalman import filtered_runs, gain_sequence, riccati_bound
from deck_motion_ros.estimators.shaping import LI2014
from deck_motion_ros.evaluation.alignment import bai2016
from deck_motion_ros.evaluation.altitude import li_skimming
from deck_motion_ros.evaluation.interleaved import zhang2021
from deck_motion_ros.evaluation.landing import pan2020
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.geometry import turned_arm
from deck_motion_ros.processes import ShapingFilter
from deck_motion_ros.samples import Array
from deck_motion_ros.scenarios import Li2014Scenario


def simulate_runs(process: ShapingFilter, dt: float, steps: int, runs: int,
                  rng: np.random.Generator) -> Array:
    """
    Draw many stationary runs of a shaping filter's output.

    Parameters
    ----------
    process : ShapingFilter
        What is drawn.
    dt : float
        Seconds between samples.
    steps, runs : int
        Size of the answer.
    rng : Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (steps, runs)

    """
    mat_phi, (q11, q12, q22) = np.reshape(process.transition(dt), (2, 2)), process.step_noise(
        process.transition(dt))
    p11, p12, p22 = process.stationary
    root = np.linalg.cholesky(np.array([[q11, q12], [q12, q22]]))
    state = np.linalg.cholesky(np.array([[p11, p12], [p12, p22]])) @ rng.normal(size=(2, runs))
    output = np.empty((steps, runs))
    for row in output:
        row[:] = state[0]
        state = mat_phi @ state + root @ rng.normal(size=(2, runs))
    return output


def li2014(runs: int | None = None) -> list[Row]:
    """
    Run Li2014's Monte Carlo: rms errors 3 s ahead against the noise-free truth.

    Parameters
    ----------
    runs : int, optional
        Instead of the scenario's.

    """
    case = Li2014Scenario() if runs is None else replace(Li2014Scenario(), runs=runs)
    rng = np.random.default_rng(case.seed)
    settle, scored, lead = (round(time / case.dt)
                            for time in (case.settle, case.duration, case.horizon))
    steps = settle + scored
    truth = [simulate_runs(process, case.dt, steps, case.runs, rng) for process in LI2014]

    def forecast(axis: int, sd: float) -> tuple[Array, Array, float]:
        """Return measurements, forecasts and the bound of one axis."""
        measured = truth[axis] + sd * rng.normal(size=truth[axis].shape)
        gains = gain_sequence(LI2014[axis], case.dt, sd**2, steps)
        return (measured,
                filtered_runs(LI2014[axis], case.dt, gains, measured, case.horizon),
                riccati_bound(LI2014[axis], case.dt, sd**2, case.horizon))

    def rmse(ahead: Array, came: Array, start: int = settle) -> float:
        error = ahead[start:start + scored - lead] - came[start + lead:start + scored]
        return float(np.sqrt(np.mean(np.square(error))))

    rows = []
    cases = (('pitch_paper', 1, case.paper_sd), ('pitch_mru', 1, case.mru_sd),
             ('roll_mru', 0, case.mru_sd), ('heave_mru', 2, case.heave_sd))
    ahead, noisy, bounds = {}, {}, {}
    for name, axis, sd in cases:
        noisy[name], ahead[name], bounds[name] = forecast(axis, sd)
        scale, unit = (1.0, 'm') if axis == 2 else (degrees(1.0), 'deg')
        rows += [
            Row('Li2014', f'{name}_rmse_3s', scale * rmse(ahead[name], truth[axis]), unit,
                floor=scale * bounds[name]),
            Row('Li2014', f'{name}_persistence_3s', scale * rmse(noisy[name], truth[axis]), unit),
            Row('Li2014', f'{name}_sd', scale * float(np.std(truth[axis])), unit)]

    def height(roll: Array, pitch: Array, heave: Array) -> Array:
        arm = turned_arm(roll, pitch, case.lever_arm)[0]
        return np.asarray(arm[..., 2] + heave - case.lever_arm[2])

    came = height(*truth)
    now, then = (height(table['roll_mru'], table['pitch_mru'], table['heave_mru'])
                 for table in (noisy, ahead))
    aft, left, _ = case.lever_arm
    floor = hypot(left * bounds['roll_mru'], aft * bounds['pitch_mru'], bounds['heave_mru'])
    return [*rows, Row('Li2014', 'touchdown_rmse_3s', rmse(then, came), 'm', floor=floor),
            Row('Li2014', 'touchdown_first_57s_rmse_3s', rmse(then, came, 0), 'm', floor=floor),
            Row('Li2014', 'touchdown_persistence_3s', rmse(now, came), 'm'),
            Row('Li2014', 'touchdown_sd', float(np.std(came)), 'm')]


PAPERS: dict[str, Callable[[int | None], list[Row]]] = {
    'Li2014': li2014, 'Zhang2021': zhang2021, 'Bai2016': bai2016, 'Pan2020': pan2020,
    'LiSkimming': li_skimming}

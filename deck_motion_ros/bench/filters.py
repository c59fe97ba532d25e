"""The Kalman filters against filterpy and simdkalman: the same numbers, faster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from deck_motion_ros.bench.figures import alternated, compared, Figure
from deck_motion_ros.estimators.kalman import (
    filtered_runs,
    gain_sequence,
    predicted_output,
    State,
    step,
)
from deck_motion_ros.evaluation.experiments import simulate_runs
from deck_motion_ros.processes import LI2014_HEAVE, LI2014_PITCH, LI2014_ROLL, ShapingFilter
from deck_motion_ros.samples import Array

DT, HORIZON = 0.1, 3.0  # s
SD = 0.05  # deg, m: a real motion sensor's noise
AXES = (LI2014_ROLL, LI2014_PITCH, LI2014_HEAVE)
AGREEMENT = 1e-9


def kalman(steps: int = 20_000, runs: int = 1000, run_steps: int = 600,
           rounds: int = 9) -> Iterator[Figure]:
    """
    Measure one filter step by step, without and with a prediction 3 s ahead, and a Monte Carlo.

    The Monte Carlo predicts at every step too.

    Parameters
    ----------
    steps : int
        Of the single filter in a round; filterpy does a twentieth of them.
    runs, run_steps : int
        Size of the Monte Carlo, for each of three axes.
    rounds : int
        Of the single filter; the Monte Carlo has half as many.

    Raises
    ------
    RuntimeError
        If a peer computes anything else than we do.

    """
    rng = np.random.default_rng(1)

    def measured(process: ShapingFilter, steps: int, runs: int) -> Array:
        truth = simulate_runs(process, DT, steps, runs, rng)
        return truth + SD * rng.normal(size=truth.shape)

    values = measured(LI2014_PITCH, steps, 1)[:, 0].tolist()
    for name, goal, predict in (('step', '>= 30', False), ('step_and_prediction', '', True)):
        yield _against(name, 'filterpy', goal, rounds, partial(single_filter, predict=predict),
                       values, partial(filterpy_filter, predict=predict),
                       values[:max(steps // 20, 1)])
    tables = [measured(process, run_steps, runs) for process in AXES]
    yield _against('monte_carlo', 'simdkalman', '>= 50', rounds // 2 + 1, many_filters, tables,
                   simdkalman_filters, tables)


def _against(name: str, peer: str, goal: str, rounds: int, ours: Callable[[Any], Any], values: Any,
             theirs: Callable[[Any], Any], fewer: Any) -> Figure:
    """Compare two ways to the same answer, of which the peer's may be given fewer values."""
    tasks = [(ours, values)]
    try:
        check(ours(fewer), theirs(fewer), peer)
        tasks.append((theirs, fewer))
    except ImportError:
        peer += ' (not installed)'
    times = alternated(rounds, *(partial(task, given) for task, given in tasks))
    rates = [[np.size(given) / second for second in seconds]
             for (_, given), seconds in zip(tasks, times, strict=True)]
    return compared('kalman', name, 'steps/s', rates[0], peer, rates[1] if rates[1:] else [], goal)


def check(ours: Any, theirs: Any, peer: str) -> None:
    """Raise ``RuntimeError`` if two answers are not the same."""
    difference = float(np.max(np.abs(np.subtract(ours, theirs))))
    if not difference <= AGREEMENT * float(np.max(np.abs(theirs))):
        raise RuntimeError(f'{peer} computes something else: difference {difference:g}')


def single_filter(values: list[float], predict: bool = True) -> tuple[float, float]:
    """Filter measurements of pitch one by one; return the last prediction (estimate), its var."""
    process, var = LI2014_PITCH, SD**2
    transition, noise = process.step(DT)
    far, far_noise = process.step(HORIZON)
    state: State = (0.0, 0.0, *process.stationary)
    for value in values:
        state, _ = step(state, transition, noise, value, var)
        if predict:
            ahead = predicted_output(state, far, far_noise)
    return ahead if predict else (state[0], state[2])


def filterpy_filter(values: list[float], predict: bool = True) -> tuple[float, float]:
    """Do as :func:`single_filter` with filterpy's ``KalmanFilter``."""
    peer = import_module('filterpy.kalman').KalmanFilter(dim_x=2, dim_z=1)
    peer.F, peer.Q, peer.P = _matrices(LI2014_PITCH, DT)
    peer.H, peer.R = np.array([[1.0, 0.0]]), np.array([[SD**2]])
    far, far_noise, _ = _matrices(LI2014_PITCH, HORIZON)
    for value in values:
        peer.predict()
        peer.update(value)
        if predict:
            mean, cov = peer.get_prediction(F=far, Q=far_noise)
    if not predict:
        mean, cov = peer.x, peer.P
    return mean[0, 0], cov[0, 0]


def many_filters(tables: list[Array]) -> list[Array]:
    """Filter three axes' measurements, (steps, runs) each; return the predictions."""
    return [filtered_runs(process, DT, gain_sequence(process, DT, SD**2, len(values)), values,
                          HORIZON)
            for process, values in zip(AXES, tables, strict=True)]


def simdkalman_filters(tables: list[Array]) -> list[Array]:
    """Do as :func:`many_filters` with simdkalman, spared its smoother and covariances."""
    kind, ahead = import_module('simdkalman').KalmanFilter, []
    for process, values in zip(AXES, tables, strict=True):
        mat_phi, mat_q, stationary = _matrices(process, DT)
        done = kind(mat_phi, mat_q, np.array([[1.0, 0.0]]), SD**2).compute(
            values.T, 0, np.zeros(2), stationary, smoothed=False, filtered=True,
            covariances=False, observations=False)
        ahead.append((done.filtered.states.mean @ process.transition(HORIZON)[:2]).T)
    return ahead


def _matrices(process: ShapingFilter, dt: float) -> tuple[Array, Array, Array]:
    """Return transition, noise and stationary covariance as the peers take them."""
    transition, noise = process.step(dt)
    mat_q, stationary = (np.array([[a, b], [b, c]]) for a, b, c in (noise, process.stationary))
    return np.reshape(transition, (2, 2)), mat_q, stationary

"""
Landings in closed loop: what a forecast of the deck is worth.

``python -m deck_motion_ros.evaluation.guidance [PICTURE.png]`` prints the figures and draws them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, hypot, sqrt
from pathlib import Path
import sys

import numpy as np

from deck_motion_ros.estimators.guidance import DESCENT, Guidance, GuidanceConfig, HOLD
from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.evaluation.prediction import noise_sd, simulator_config
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.geometry import quaternion_from_rpy, turned_arm
from deck_motion_ros.samples import (
    Array,
    DeckForecast,
    LandingWindow,
    nanoseconds,
    OdometrySample,
    seconds,
    TouchdownForecast,
    TouchdownPose,
)
from deck_motion_ros.scenarios import LANDING_POINTS, PredictionScenario
from deck_motion_ros.simulation.ship import HEAVE, PITCH, ROLL
from deck_motion_ros.simulation.simulator import ship_in_waves

STEP = 0.05  # s of the aircraft's motion
CASES = (
    PredictionScenario('destroyer_ss5', 'destroyer', 5, 135.0, 7.5, 501, duration=1500.0),
    PredictionScenario('patrol_ss4', 'patrol', 4, 135.0, 6.0, 401, duration=1500.0))
METHODS = {
    'plain': GuidanceConfig(method='plain'),
    'plain_slow': GuidanceConfig(method='plain', descent_speed=0.3),
    'forecast': GuidanceConfig()}


@dataclass(frozen=True)
class Aircraft:
    """
    A helicopter and what it knows of its place.

    Attributes
    ----------
    start : tuple of 3 float
        Over the deck (m).
    response_time : float
        With which it takes a velocity (s).
    gust_sd, gust_time : float
        Of the speed at which gusts carry it: horizontal; half of it vertical (m/s, s).
    error_sd : tuple of 3 float
        Of the landing estimator near the deck: forward, left, up (m).
    error_time : float
        Correlation time of these errors (s).
    rate_error_sd : float
        Of its velocities (m/s).

    """

    start: tuple[float, float, float] = (10.0, 20.0, 15.0)
    response_time: float = 0.5
    gust_sd: float = 0.2
    gust_time: float = 1.5
    error_sd: tuple[float, float, float] = (0.05, 0.05, 0.03)
    error_time: float = 2.0
    rate_error_sd: float = 0.04


@dataclass(frozen=True, eq=False)
class DeckRecord:
    """
    A deck at sea, and what the predictor said of it meanwhile.

    Attributes
    ----------
    position, velocity : ndarray, shape (n, 3)
        Of the touchdown point in ``ship_level``, every ``STEP`` (m, m/s).
    roll, pitch : ndarray, shape (n,)
        rad.
    said : list of (TouchdownForecast, TouchdownPose, LandingWindow or None)
        With each output: forecast, pose 3 s ahead, window if there was a new one.

    """

    position: Array
    velocity: Array
    roll: Array
    pitch: Array
    said: list[tuple[TouchdownForecast, TouchdownPose, LandingWindow | None]]


@dataclass(frozen=True)
class Landing:
    """
    How a landing ended.

    Attributes
    ----------
    closing : float
        Speed of aircraft and deck towards one another at touchdown (m/s).
    horizontal : float
        Distance from the platform's centre (m).
    roll, pitch : float
        Of the deck (rad).
    hold : float
        Seconds from the first hold to the last descent.
    aborts : int
        Descents that were broken off.

    """

    closing: float
    horizontal: float
    roll: float
    pitch: float
    hold: float
    aborts: int


def deck_record(case: PredictionScenario, output_rate: float = 10.0) -> DeckRecord:
    """Sail a scenario with the default predictor on board, ``output_rate`` forecasts a second."""
    arm = LANDING_POINTS[case.hull]
    times = STEP * np.arange(round(case.duration / STEP), dtype=float)
    motion = ship_in_waves(simulator_config(case)).motion(times)
    roll, pitch = motion.value[:, ROLL], motion.value[:, PITCH]
    vec, by_roll, by_pitch = turned_arm(roll, pitch, arm)
    velocity = (motion.rate[:, :3] + by_roll * motion.rate[:, [ROLL]]
                + by_pitch * motion.rate[:, [PITCH]])
    config = PredictorConfig(lever_arm=arm, output_rate=output_rate)
    predictor, lookout = TouchdownPredictor(config), config.lookout()
    rng, sd = np.random.default_rng([case.seed, 2]), np.array(noise_sd(case))
    every = round(case.dt / STEP)
    measured = motion.value[::every, [ROLL, PITCH, HEAVE]]
    said: list[tuple[TouchdownForecast, TouchdownPose, LandingWindow | None]] = []
    none = (0.0, 0.0, 0.0)
    for k, values in enumerate((measured + sd * rng.normal(size=measured.shape)).tolist()):
        sample = OdometrySample(
            nanoseconds(k * case.dt), 'ship_level', 'ship_base_link', (0.0, 0.0, values[2]),
            quaternion_from_rpy(values[0], values[1], 0.0), none, none, (0.0,) * 6)
        for prediction in predictor.update(sample):
            said.append((prediction.forecast(), prediction.pose(), lookout.update(prediction)))
    return DeckRecord(motion.value[:, :3] + vec, velocity, roll, pitch, said)


def land(record: DeckRecord, start: float, config: GuidanceConfig, aircraft: Aircraft,
         rng: np.random.Generator, longest: float = 240.0,
         hear: Callable[[OdometrySample], None] = lambda sample: None) -> Landing | None:
    """
    Fly one landing.

    Parameters
    ----------
    record : DeckRecord
        The deck.
    start : float
        When the approach begins (s).
    config : GuidanceConfig
        Of the guidance.
    aircraft : Aircraft
        What is flown.
    rng : Generator
        Of gusts and errors.
    longest : float
        Seconds after which it is given up.
    hear : callable
        Takes each sample of ``landing/odometry``.

    Returns
    -------
    Landing or None
        ``None`` if it did not touch down.

    """
    guidance = Guidance(config)
    first = round(start / STEP)
    deck, deck_rate = record.position.tolist(), record.velocity.tolist()
    rest = record.position.mean(axis=0)
    place = [value + away for value, away in zip(rest.tolist(), aircraft.start, strict=True)]
    velocity, command = [0.0] * 3, (0.0, 0.0, 0.0)
    steps = min(round(longest / STEP), len(deck) - first)
    gust = _wander(aircraft.gust_sd * np.array([1.0, 1.0, 0.5]), aircraft.gust_time, steps, rng)
    error = _wander(np.array(aircraft.error_sd), aircraft.error_time, steps, rng)
    rate_error = (aircraft.rate_error_sd * rng.normal(size=(steps, 3))).tolist()
    keep = exp(-STEP / aircraft.response_time)
    held_from = descended = None
    number, first_stamp = 0, nanoseconds(first * STEP)
    for k in range(steps):
        stamp = nanoseconds((first + k) * STEP)
        now, rate = deck[first + k], deck_rate[first + k]
        over = [a - b for a, b in zip(place, now, strict=True)]
        moving = [a + b for a, b in zip(velocity, gust[k], strict=True)]
        relative = [a - b for a, b in zip(moving, rate, strict=True)]
        if k and over[2] <= config.contact_height:
            hold = seconds((descended or stamp) - (held_from or stamp))
            return Landing(-relative[2], hypot(over[0], over[1]), float(record.roll[first + k]),
                           float(record.pitch[first + k]), hold, guidance.aborts)
        while number < len(record.said) and record.said[number][0].issued_at <= stamp:
            said, pose, window = record.said[number]
            number += 1
            if said.issued_at < first_stamp:
                continue
            guidance.update('touchdown/prediction', _prediction(pose))
            guidance.update('touchdown/forecast', DeckForecast(
                said.issued_at, 'ship_level', said.horizons, said.position, said.velocity))
            if window is not None:
                guidance.update('touchdown/window', window)
        x, y, z = (a + b for a, b in zip(over, error[k], strict=True))
        u, v, w = (a + b for a, b in zip(relative, rate_error[k], strict=True))
        seen = OdometrySample(stamp, 'deck', 'uav_deck', (x, y, z), (0.0, 0.0, 0.0, 1.0),
                              (u, v, w), (0.0, 0.0, 0.0), (0.0,) * 6)
        hear(seen)
        for order in guidance.update('landing/odometry', seen):
            command = order.velocity
            if order.phase == HOLD:
                held_from, descended = held_from or stamp, None
            elif order.phase == DESCENT:
                descended = descended or stamp
        velocity = [wanted + keep * (value - wanted)
                    for value, wanted in zip(velocity, command, strict=True)]
        place = [a + STEP * b for a, b in zip(place, moving, strict=True)]
    return None


def _prediction(pose: TouchdownPose) -> OdometrySample:
    x, y, z, about_x, about_y, about_z = np.diag(pose.pose_cov).tolist()
    a, b, c = pose.position.tolist()
    return OdometrySample(pose.valid_at, 'ship_level', 'touchdown', (a, b, c), pose.orientation,
                          (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (x, y, z, about_x, about_y, about_z))


def _wander(sd: Array, time: float, steps: int, rng: np.random.Generator) -> list[list[float]]:
    """Draw Gauss-Markov processes, (steps, 3)."""
    keep = exp(-STEP / time)
    values = sd * rng.normal(size=(steps, 3))
    for k in range(1, steps):
        values[k] = keep * values[k - 1] + sqrt(1 - keep * keep) * values[k]
    table: list[list[float]] = values.tolist()
    return table


def landings(record: DeckRecord, config: GuidanceConfig, runs: int, seed: int,
             settle: float = 300.0) -> list[Landing | None]:
    """Fly landings one after another along a record, the same gusts whatever the guidance."""
    last = len(record.position) * STEP - 250.0
    return [land(record, settle + (last - settle) * k / runs, config, Aircraft(),
                 np.random.default_rng([seed, k])) for k in range(runs)]


def closed_loop(runs: int | None = None) -> dict[str, dict[str, list[Landing | None]]]:
    """Fly ``runs`` (200) landings with and without forecast on the deck of each case."""
    flown = {}
    for case in CASES:
        records = [deck_record(replace(case, seed=case.seed + k)) for k in range(2)]
        flown[case.name] = {method: [
            landing for k, record in enumerate(records)
            for landing in landings(record, config, (runs or 200) // 2, case.seed + k)]
            for method, config in METHODS.items()}
    return flown


def rows(flown: dict[str, dict[str, list[Landing | None]]]) -> list[Row]:
    """Give the figures of flown landings."""
    table = []
    for case, methods in flown.items():
        for method, ends in methods.items():
            down = [end for end in ends if end is not None]
            closing, horizontal, hold = (np.array([getattr(end, name) for end in down])
                                         for name in ('closing', 'horizontal', 'hold'))
            tilt = np.degrees([hypot(end.roll, end.pitch) for end in down])
            name = f'{case}_{method}'
            table += [
                Row('Guidance', f'{name}_closing_median', float(np.median(closing)), 'm/s'),
                Row('Guidance', f'{name}_closing_p95', float(np.quantile(closing, 0.95)), 'm/s'),
                Row('Guidance', f'{name}_horizontal_median', float(np.median(horizontal)), 'm'),
                Row('Guidance', f'{name}_tilt_median', float(np.median(tilt)), 'deg'),
                Row('Guidance', f'{name}_hold_median', float(np.median(hold)), 's'),
                Row('Guidance', f'{name}_hold_p95', float(np.quantile(hold, 0.95)), 's'),
                Row('Guidance', f'{name}_aborts', float(sum(end.aborts for end in down)), ''),
                Row('Guidance', f'{name}_not_down', float(len(ends) - len(down)), '')]
        medians = {method: float(np.median([end.closing for end in ends if end]))
                   for method, ends in methods.items()}
        table += [Row('Guidance', f'{case}_closing_to_{method}',
                      medians['forecast'] / medians[method], '') for method in METHODS
                  if method != 'forecast']
    return table


def draw(flown: dict[str, dict[str, list[Landing | None]]], path: Path) -> None:
    """Draw how fast the landings closed, with and without forecast."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(flown), figsize=(9, 3.4), sharey=True,
                                layout='constrained')
    for ax, (case, methods) in zip(np.atleast_1d(axes), flown.items(), strict=True):
        for method, words, colour in (
                ('plain', 'at once, 0.7 m/s', 'tab:orange'),
                ('plain_slow', 'at once, 0.3 m/s', 'tab:olive'),
                ('forecast', 'when the forecast says', 'tab:blue')):
            closing = np.sort([end.closing for end in methods[method] if end])
            ax.plot(closing, np.linspace(0, 100, len(closing)), color=colour,
                    label=f'{words}: median {np.median(closing):.2f} m/s')
        ax.set(xlabel='vertical speed towards the deck at touchdown (m/s)',
               title=case.replace('_ss', ', sea state '), xlim=(0, None))
        ax.grid(alpha=0.3)
        ax.legend(loc='lower right', fontsize='small')
    np.atleast_1d(axes)[0].set_ylabel('share of landings (%)')
    figure.savefig(path, dpi=150)
    plt.close(figure)


if __name__ == '__main__':
    results = closed_loop()
    for figure in rows(results):
        print(f'{figure.name:42s} {figure.value:8.3f} {figure.unit}')
    if sys.argv[1:]:
        draw(results, Path(sys.argv[1]))

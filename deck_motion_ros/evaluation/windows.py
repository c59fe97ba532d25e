"""Landing windows judged by what came: whether it was quiet, and when the crests came."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.estimators.window import Limits, PRESETS
from deck_motion_ros.evaluation.metrics import rms, Stamps
from deck_motion_ros.evaluation.prediction import noise_sd, simulated
from deck_motion_ros.geometry import quaternion_from_rpy, turned_arm
from deck_motion_ros.samples import (
    Array,
    GO,
    LandingWindow,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
)
from deck_motion_ros.scenarios import LANDING_POINTS, PREDICTION_SCENARIOS, PredictionScenario

STEP = 0.1  # s
SMOOTHED = 11  # steps, for the vertical rate: 1 s
CLEARLY = 0.1
APART = 2.0  # s: more is a gap
BINS = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
WARM_UP = 300.0  # s
SCENARIOS = tuple(case for case in PREDICTION_SCENARIOS if case.stationary)
Timings = Array  # shape (n, 3): seconds ahead that a crest was announced, error, sd stated


@dataclass(frozen=True, eq=False)
class Deck:
    """
    What the touchdown point did, every ``STEP``.

    Attributes
    ----------
    start : int
        Nanoseconds.
    motion : ndarray, shape (n, 4)
        Height (m), vertical rate (m/s), roll, pitch (rad); NaN where unknown.

    """

    start: int
    motion: Array

    @classmethod
    def of(cls, span: tuple[int, int], height: Callable[[Stamps], Array],
           roll: Callable[[Stamps], Array], pitch: Callable[[Stamps], Array]) -> Deck:
        """
        Sample it.

        Parameters
        ----------
        span : tuple of 2 int
            First and last stamp (ns).
        height, roll, pitch : callable
            Value at stamps (ns), NaN where unknown. The rate is the slope of a parabola through
            half a second of heights to either side, so that noise does not decide.

        """
        stamps = np.arange(span[0], span[1] + 1, nanoseconds(STEP))
        came = height(stamps)
        rate = np.full(len(came), np.nan)
        if len(came) >= SMOOTHED:
            edge = SMOOTHED // 2
            rate[edge:-edge] = savgol_filter(came, SMOOTHED, 2, 1, STEP, mode='constant')[
                edge:-edge]
        return cls(span[0], np.column_stack([came, rate, roll(stamps), pitch(stamps)]))

    def stayed(self, limits: Limits, stamps: Stamps, duration: float) -> Array:
        """
        Say whether it stayed within limits for ``duration`` (s) after some stamps.

        Returns
        -------
        ndarray, shape (n,)
            1 or 0; NaN where that is not known.

        """
        bounds = np.array([limits.height, limits.rate, limits.roll, limits.pitch])
        size = np.abs(self.motion) / bounds
        count = round(duration / STEP) + 1
        if len(size) < count:
            return np.full(len(stamps), np.nan)
        views = np.lib.stride_tricks.sliding_window_view(size.max(axis=1), count)
        stayed = np.where(np.isnan(views).any(axis=1), np.nan, views.max(axis=1) <= 1)
        at = np.round((stamps - self.start) / nanoseconds(STEP)).astype(int)
        known = (at >= 0) & (at < len(stayed))
        return np.where(known, stayed[np.where(known, at, 0)], np.nan)

    def crests(self, side: int) -> Array:
        """
        Return when the crests (1) or troughs (-1) came, in seconds after ``start``.

        That is where the rate fell (rose) through 0, from ``CLEARLY`` of its rms above to as much
        below.
        """
        rate = side * self.motion[:, 1]
        known = rate[np.isfinite(rate)]
        clear = np.flatnonzero(np.abs(rate) > CLEARLY * rms(known))
        before, after = rate[clear[:-1]], rate[clear[1:]]
        falls = (before > 0) & (after < 0) & (np.diff(clear) * STEP <= APART)
        way = before[falls] / (before[falls] - after[falls])
        return np.asarray(STEP * (clear[:-1][falls] + way * np.diff(clear)[falls]))


@dataclass(frozen=True, eq=False)
class WindowScores:
    """
    What was said of landing windows beside what came.

    Attributes
    ----------
    name : str
        Of scenario and limits.
    issued_at : ndarray of int64, shape (n,)
        Nanoseconds; only those of which it is known what came.
    state : ndarray of str, shape (n,)
    probability, quiet : ndarray, shape (n,)
        Said, and whether it came (1 or 0).
    crests : ndarray, shape (m, 3)
        Of each crest and trough: seconds ahead that it was announced, announced minus real time,
        sd stated.

    """

    name: str
    issued_at: Stamps
    state: np.ndarray[tuple[int], np.dtype[np.str_]]
    probability: Array
    quiet: Array
    crests: Timings

    @property
    def share(self) -> float:
        """Share of the windows that were quiet: the climate."""
        return float(np.mean(self.quiet)) if len(self.quiet) else np.nan

    @property
    def brier(self) -> float:
        """Mean square of probability minus what came."""
        return brier(self.probability, self.quiet)

    @property
    def skill(self) -> float:
        """1 - Brier score over that of always saying the climate; NaN if that never errs."""
        climate = self.share * (1 - self.share)
        return 1 - self.brier / climate if climate > 0 else np.nan

    @property
    def go_right(self) -> float:
        """Share of ``go`` that was followed by a quiet window."""
        went = self.quiet[self.state == GO]
        return float(np.mean(went)) if len(went) else np.nan

    def reliability(self) -> list[tuple[float, float, int]]:
        """Return mean probability, share that was quiet, and number, for each of ``BINS``."""
        number = np.clip(np.searchsorted(BINS, self.probability, side='right') - 1,
                         0, len(BINS) - 2)
        return [(float(np.mean(self.probability[number == k])),
                 float(np.mean(self.quiet[number == k])), int(np.sum(number == k)))
                for k in range(len(BINS) - 1) if np.any(number == k)]

    def timings(self, nearest: float, farthest: float) -> Timings:
        """Return those crests and troughs that were announced so far ahead (s)."""
        ahead = self.crests[:, 0]
        return self.crests[(ahead >= nearest) & (ahead <= farthest)]


def brier(probability: Array, came: Array) -> float:
    """Return the mean square of probability minus what came (1 or 0); NaN for none."""
    return float(np.mean(np.square(probability - came))) if len(came) else np.nan


def scored(name: str, windows: Sequence[LandingWindow], deck: Deck, limits: Limits,
           duration: float) -> WindowScores:
    """Set landing windows beside what came."""
    stamps = np.array([item.issued_at for item in windows], np.int64)
    quiet = deck.stayed(limits, stamps, duration)
    known = np.isfinite(quiet)
    said = [item for item, used in zip(windows, known.tolist(), strict=True) if used]
    timings = [_timings(deck, stamps, [(item.next_crest_in, item.next_crest_sd)
                                       for item in windows], 1),
               _timings(deck, stamps, [(item.next_trough_in, item.next_trough_sd)
                                       for item in windows], -1)]
    return WindowScores(
        name, stamps[known], np.array([item.state for item in said]),
        np.array([item.probability for item in said]), quiet[known], np.concatenate(timings))


def _timings(deck: Deck, stamps: Stamps, said: Sequence[tuple[float, float]],
             side: int) -> Timings:
    ahead, sd = np.array(said).reshape(-1, 2).T
    came = deck.crests(side)
    if len(came) < 2:
        return np.empty((0, 3))
    announced = (stamps - deck.start) / NANOSECONDS + ahead
    known = (announced >= came[0]) & (announced <= came[-1])  # which NaN is not
    error = since_nearest(announced[known], came)
    return np.column_stack([ahead[known], error, sd[known]])


def since_nearest(times: Array, came: Array) -> Array:
    """Return times minus the nearest of at least two ``came``, which increase."""
    right = np.clip(np.searchsorted(came, times), 1, len(came) - 1)
    before, after = times - came[right - 1], times - came[right]
    return np.where(np.abs(before) < np.abs(after), before, after)


def scenario_scores(case: PredictionScenario, presets: Sequence[str] = tuple(PRESETS),
                    method: str = 'adaptive') -> list[WindowScores]:
    """
    Run the predictor from a cold start over a scenario and judge its windows after 5 minutes.

    Parameters
    ----------
    case : PredictionScenario
        Hull, sea, noise.
    presets : sequence of str
        Limits, each judged by itself.
    method : str
        Of the predictor.

    Returns
    -------
    list of WindowScores
        One for each of ``presets``; quiet windows last 5 s.

    """
    arm = LANDING_POINTS[case.hull]
    times, truth, measured, headings = simulated(case)
    configs = [PredictorConfig(method=method, lever_arm=arm, window_preset=name)
               for name in presets]
    lookouts = [config.lookout() for config in configs]
    said: list[list[LandingWindow]] = [[] for _ in presets]
    predictor = TouchdownPredictor(configs[0])
    roll_var, pitch_var, heave_var = np.square(noise_sd(case)).tolist()
    pose_var = 0.0, 0.0, heave_var, roll_var, pitch_var, 0.0
    for time, (roll, pitch, heave), yaw in zip(
            times.tolist(), measured.tolist(), headings.tolist(), strict=True):
        sample = OdometrySample(
            nanoseconds(time), 'ship_level', 'ship_base_link', (0.0, 0.0, heave),
            quaternion_from_rpy(roll, pitch, yaw), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), pose_var)
        for prediction in predictor.update(sample):
            for lookout, windows in zip(lookouts, said, strict=True):
                window = lookout.update(prediction)
                if window and time >= WARM_UP:
                    windows.append(window)
    roll_came, pitch_came, heave_came = truth.T
    height = turned_arm(roll_came, pitch_came, arm)[0][:, 2] + heave_came - arm[2]
    deck = Deck(0, np.column_stack([
        height, np.gradient(height, case.dt), roll_came, pitch_came]))
    return [scored(f'{case.name} {name}', windows, deck, config.limits(), config.window_duration)
            for name, config, windows in zip(presets, configs, said, strict=True)]


def pooled(scores: Sequence[WindowScores]) -> WindowScores:
    """Put scores together, for a reliability curve of many windows."""
    return WindowScores('all', *(np.concatenate([getattr(item, name) for item in scores])
                                 for name in ('issued_at', 'state', 'probability', 'quiet',
                                              'crests')))

"""Each paper's experiment as a frozen record: parameters and seed."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, sqrt

from deck_motion_ros.samples import Vector3


@dataclass(frozen=True)
class Li2014Scenario:
    """
    Li2014: shaping-filter motion of CVN-65, its touchdown point predicted 3 s ahead.

    The paper gives no sampling period, and no coefficients for heave and roll; sampling period,
    seed and the sensor of today (``mru``) are ours.

    Attributes
    ----------
    runs, seed : int
        Of the Monte Carlo.
    settle : float
        Seconds that the filters run before the score begins: from a stationary start they are
        still up to 9 % above their bound over the first minute (``touchdown_first_57s_rmse_3s``).
    duration, dt, horizon : float
        Seconds.
    lever_arm : tuple of 3 float
        Touchdown point in ship axes (m).
    paper_sd, mru_sd : float
        Noise of measured angles (rad): the paper's R = 0.49 deg^2, and a motion sensor's.
    heave_sd : float
        Noise of measured heave (m).

    """

    runs: int = 1000
    seed: int = 2014
    settle: float = 180.0
    duration: float = 57.0
    dt: float = 0.1
    horizon: float = 3.0
    lever_arm: Vector3 = (-67.97, 3.05, 19.5)
    paper_sd: float = radians(0.7)
    mru_sd: float = radians(0.05)
    heave_sd: float = 0.05


@dataclass(frozen=True)
class Zhang2021Scenario:
    """
    Zhang2021: a roll record sampled every 0.5 s, each interleaved half predicted 1 s ahead.

    The paper's record is not published (its text has lost even the first 40 points). Ours is a
    narrow swell of the size and period at which the plain filter, scored one step late, errs by
    what the paper prints.

    Attributes
    ----------
    runs, seed : int
        Number of records; run k is drawn from seed + k.
    points, first_scored : int
        Of a record; index of the first point that is a score's target.
    dt, horizon : float
        Seconds between points; seconds ahead, the step of each half.
    sd, noise_sd : float
        Of the roll, and of the white noise of its measurements (rad).
    filter_sd : float
        What the filters take that noise for (rad): the paper's R = 0.01 deg^2.
    peak, bandwidth : float
        Of the spectrum: rad/s, and the relative sd of its Gaussian power.
    waves, lowest, highest : int, float, float
        Cosines of random phase, evenly spaced between two frequencies (rad/s).

    """

    runs: int = 10
    seed: int = 2021
    points: int = 480
    first_scored: int = 11
    dt: float = 0.5
    horizon: float = 1.0
    sd: float = radians(0.62) / sqrt(2)
    noise_sd: float = radians(0.01)
    filter_sd: float = radians(0.1)
    peak: float = 2 * pi / 9.6
    bandwidth: float = 0.08
    waves: int = 400
    lowest: float = 0.2
    highest: float = 2.2

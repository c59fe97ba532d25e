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


# significant wave height (m), peak period (s): what is usual in the open North Atlantic
SEA_STATES = {3: (0.88, 7.5), 4: (1.88, 8.8), 5: (3.25, 9.7), 6: (5.0, 12.4)}
LANDING_POINTS: dict[str, Vector3] = {
    'cvn65': (-67.97, 3.05, 19.5), 'destroyer': (-55.0, 0.0, 6.0), 'patrol': (-20.0, 0.0, 4.0)}


@dataclass(frozen=True)
class PredictionScenario:
    """
    Half an hour at sea that predictors who know nothing of it are judged by.

    Attributes
    ----------
    name : str
        What outside programs read its figures by.
    hull, sea_state
        Keys of the hulls, of SEA_STATES; the point that is predicted is in LANDING_POINTS.
    heading_deg : float
        Direction the waves travel towards, counter-clockwise from the bow: 180 = head sea.
    speed : float
        m/s.
    seed : int
        Of sea and noise.
    turn_deg, speed_to : float or None
        A manoeuvre: turn to port, speed to change to (m/s).
    noise : float
        Times the usual noise.
    spreading : float
        n of the spreading cos^n; 0 = long-crested.
    duration, manoeuvre_at, dt : float
        Seconds.
    white_sd : tuple of 3 float
        The usual noise of roll, pitch (rad: 0.03 deg), heave (m), new at every sample.
    waves : int
        Regular waves in the sea.

    """

    name: str
    hull: str
    sea_state: int
    heading_deg: float
    speed: float
    seed: int
    turn_deg: float | None = None
    speed_to: float | None = None
    noise: float = 1.0
    spreading: float = 2.0
    duration: float = 1810.0
    manoeuvre_at: float = 800.0
    dt: float = 0.1
    white_sd: Vector3 = (radians(0.03), radians(0.03), 0.05)
    waves: int = 1500

    @property
    def stationary(self) -> bool:
        """Say whether it is one of those over which means are taken."""
        return (self.turn_deg is None and self.speed_to is None and self.noise == 1.0
                and self.spreading > 0)


PREDICTION_SCENARIOS = (
    PredictionScenario('destroyer_ss5_135', 'destroyer', 5, 135.0, 7.5, 1),
    PredictionScenario('cvn65_ss5_135', 'cvn65', 5, 135.0, 7.5, 2),
    PredictionScenario('patrol_ss4_135', 'patrol', 4, 135.0, 6.0, 3),
    PredictionScenario('destroyer_ss6_090', 'destroyer', 6, 90.0, 7.5, 4),
    PredictionScenario('cvn65_ss6_160', 'cvn65', 6, 160.0, 10.0, 5),
    PredictionScenario('patrol_ss3_045', 'patrol', 3, 45.0, 5.0, 6),
    PredictionScenario('destroyer_ss4_030', 'destroyer', 4, 30.0, 9.0, 7),
    PredictionScenario('patrol_ss5_180', 'patrol', 5, 180.0, 6.0, 8),
    PredictionScenario('destroyer_ss5_turn_90', 'destroyer', 5, 135.0, 7.5, 9, turn_deg=90.0),
    PredictionScenario('destroyer_ss5_slowing', 'destroyer', 5, 135.0, 7.5, 10, speed_to=2.5),
    PredictionScenario('destroyer_ss5_noise_x10', 'destroyer', 5, 135.0, 7.5, 11, noise=10.0),
    PredictionScenario('destroyer_ss5_long_crested', 'destroyer', 5, 135.0, 7.5, 12,
                       spreading=0.0))


@dataclass(frozen=True)
class Pan2020Scenario:
    """
    Pan2020: a helicopter comes to a small boat in sea state 4 by ranges to four radios.

    Not in the paper, and ours: time step, process noise, the helicopter's dynamics, and whether
    the deck's rotation counts. The paper's figures come with a platform that only translates
    (``paper_*``); ``joint_*`` is scored on one that rolls as the paper says, in deck axes.

    Attributes
    ----------
    runs, seed : int
        Number of landings; run k is drawn from seed + k.
    start : tuple of 3 float
        Of the helicopter, over the deck (m).
    paper_step : float
        Seconds between the steps of the paper's scene; each phase has 200.
    paper_noise : tuple of 3 float
        What a second adds to the sd of position, velocity, acceleration in its filters.
    phase, range_rate, uav_rate : float
        Of the rotating deck: seconds of each phase, rounds of ranges and samples of the
        aircraft's inertial unit per second.
    settle : float
        Seconds from the first range to the first score.

    """

    runs: int = 100
    seed: int = 2020
    start: Vector3 = (10.0, 20.0, 15.0)
    paper_step: float = 0.05
    paper_noise: Vector3 = (0.0, 0.0, 1.0)
    phase: float = 20.0
    range_rate: float = 10.0
    uav_rate: float = 50.0
    settle: float = 2.0


@dataclass(frozen=True)
class LiSkimmingScenario:
    """
    LiSkimming: 45 m, down to 8 m, up to 35 m in 30 s over sea state 7, every sensor with errors.

    The paper's table of sensor errors is lost; these values, speed, heading and seed are ours.

    Attributes
    ----------
    runs, seed : int
        Of the Monte Carlo; run k is drawn from seed + k.
    rate, duration : float
        Samples per second; seconds.
    heights, times, transition
        Of the flight: m, s at which descent and climb begin, s that each takes.
    low : tuple of 2 float
        From when to when the flight at 8 m is scored (s).
    wave_height, mean_period : float
        Sea state 7: significant height (m), T1 (s).
    calm_height, calm_period : float
        Sea state 4.
    fast, slow : float
        Speeds (m/s): the paper's kind of vehicle, and a helicopter that comes to its ship.
    start_sd : float
        How well height (m) and rate (m/s) at the start are known.
    range_bias, range_white, rate_bias, rate_white : float
        Altimeter (m, m/s).
    accel_bias, accel_drift, accel_white, drift_rate : float
        Accelerometer (m/s^2), and the paper's alpha (1/s).

    """

    runs: int = 40
    seed: int = 2022
    rate: float = 100.0
    duration: float = 30.0
    heights: Vector3 = (45.0, 8.0, 35.0)
    times: tuple[float, float] = (3.0, 17.0)
    transition: float = 4.0
    low: tuple[float, float] = (8.0, 17.0)
    wave_height: float = 7.5
    mean_period: float = 11.6
    calm_height: float = 1.88
    calm_period: float = 6.8
    fast: float = 300.0
    slow: float = 60.0
    start_sd: float = 0.1
    range_bias: float = 1.0
    range_white: float = 0.5
    rate_bias: float = 0.2
    rate_white: float = 0.2
    accel_bias: float = 0.05
    accel_drift: float = 0.05
    accel_white: float = 0.05
    drift_rate: float = 5.0


@dataclass(frozen=True)
class Bai2016Scenario:
    """
    Bai2016: an aircraft's inertial unit aligned on the catapult while its nose gear shakes.

    The paper's table is in arcminutes. It gives neither the decay of the vibration nor the
    filters' first covariance nor alpha, beta and Q of the fading: ours are those with which the
    Kalman filter errs by what it prints. Axes forward, left, up.

    Attributes
    ----------
    runs, seed : int
        Of the Monte Carlo.
    amplitudes : tuple of float
        Of the vibration (m/s^2).
    hold : float
        Seconds on deck before the launch, for the default filter; the paper has none.
    stroke, dt : float
        Seconds.
    misalignment_arcmin : tuple of 3 float
        The paper's, which happens to be observable.
    misalignment_sd_arcmin : tuple of 3 float
        Of random ones.
    lowest, highest : float
        Frequencies between which the default filter is shaken, at a random phase (Hz).
    skew : float
        Seconds by which the reference is late where it is.
    paper_misalignment_sd_arcmin, paper_velocity_sd : float
        First covariance of the paper's filters (each axis; m/s).

    """

    runs: int = 500
    seed: int = 2016
    amplitudes: tuple[float, ...] = (0.0, 5.0, 10.0, 20.0)
    hold: float = 2.0
    stroke: float = 3.0
    dt: float = 0.01
    misalignment_arcmin: Vector3 = (15.0, -10.0, -30.0)
    misalignment_sd_arcmin: Vector3 = (15.0, 10.0, 30.0)
    lowest: float = 90.0
    highest: float = 110.0
    skew: float = 0.005
    paper_misalignment_sd_arcmin: float = 10.0
    paper_velocity_sd: float = 0.1

"""LiSkimming's experiment: what can be known of the height over the waves, and who knows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import degrees, pi, sqrt

import numpy as np

from deck_motion_ros.estimators.altitude import AltitudeConfig, AltitudeEstimator
from deck_motion_ros.estimators.encounter import EncounterSea, GRAVITY, wave_model
from deck_motion_ros.estimators.skimming_rivals import HeightFilter, RIVALS
from deck_motion_ros.estimators.wave_filter import SensorErrors, WaveFilter
from deck_motion_ros.evaluation.altitude_floor import Bound, bound, PAIR
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.samples import Array, ImuSample, RangeSample, Rejected, VelocitySample
from deck_motion_ros.scenarios import LiSkimmingScenario
from deck_motion_ros.simulation.sea_skimming import (
    Autopilot,
    Disturbances,
    DisturbanceSource,
    Profile,
    SkimmingSimulatorConfig,
)

HEAD, BEAM = pi, pi / 2
EXACT = 1e-3  # m, m/s: sd of a start that is known exactly
GUESSES: tuple[dict[str, float], ...] = (
    {}, {'range_bias': 0.3}, {'range_bias': 0.5}, {'range_bias': 2.0}, {'rate_bias': 0.05},
    {'accel_bias': 0.2}, {'accel_drift': 0.2})  # at the paper's lost table, beside ours
FRAME = 'uav_level'
LEVEL = (0.0, 0.0, 0.0, 1.0)
NOTHING = (0.0, 0.0, 0.0)


def sensor_errors(case: LiSkimmingScenario) -> SensorErrors:
    """Return the sensors of the experiment."""
    return SensorErrors(**{name: getattr(case, name) for name in SensorErrors.__slots__})


def disturbances(case: LiSkimmingScenario, sea: EncounterSea, errors: SensorErrors, runs: int,
                 seconds: float, waves: int = 300, rate_sees_waves: bool = False) -> Disturbances:
    """
    Draw waves and sensor errors, (steps, runs).

    Parameters
    ----------
    case : LiSkimmingScenario
        Seed and sampling rate.
    sea : EncounterSea
        What is flown over, and how.
    errors : SensorErrors
        Of the sensors.
    runs : int
        How many.
    seconds : float
        How long.
    waves : int
        Regular waves in each sea.
    rate_sees_waves : bool
        Whether the altimeter's rate is that of the range.

    """
    config = SkimmingSimulatorConfig(
        seed=case.seed, rate=case.rate, speed=sea.speed, waves=waves,
        significant_wave_height=sea.height, peak_period=2 * pi / sea.peak,
        wave_heading_deg=degrees(sea.heading), spreading=sea.spreading,
        rate_sees_waves=rate_sees_waves, altimeter_bias_sd=errors.range_bias,
        altimeter_sd=errors.range_white, rate_bias_sd=errors.rate_bias,
        rate_sd=errors.rate_white, accel_bias_sd=errors.accel_bias,
        accel_drift_sd=errors.accel_drift, accel_white_sd=errors.accel_white,
        inertial_drift_time=1 / errors.drift_rate)
    return DisturbanceSource(config, runs).take(round(seconds * case.rate))


@dataclass(frozen=True, eq=False)
class Flight:
    """The true flight: height (m), rate (m/s), mean acceleration of each step, shape (steps,)."""

    height: Array
    rate: Array
    acceleration: Array


def flight(case: LiSkimmingScenario, seconds: float) -> Flight:
    """Fly the profile with an autopilot that knows the truth."""
    pilot = Autopilot(Profile(case.heights, case.times, case.transition), 1 / case.rate)
    rows = [(float(pilot.height), 0.0, 0.0)]
    for _ in range(round(seconds * case.rate) - 1):
        mean = float(pilot.step(pilot.height, pilot.rate))
        rows.append((float(pilot.height), float(pilot.rate), mean))
    return Flight(*np.array(rows).T)


@dataclass(frozen=True, eq=False)
class Measured:
    """Range (m), rate (m/s) and acceleration (m/s^2) as measured, shape (steps, runs)."""

    range: Array
    rate: Array
    acceleration: Array


def measured(flown: Flight, disturbed: Disturbances) -> Measured:
    """Put truth and disturbances together."""
    return Measured(
        flown.height[:, None] - disturbed.elevation + disturbed.range,
        flown.rate[:, None] - disturbed.elevation_rate + disturbed.rate,
        flown.acceleration[:, None] + disturbed.acceleration)


def starts(case: LiSkimmingScenario, runs: int, sd: float) -> Array:
    """Draw errors of height (m) and rate (m/s) at the start, shape (2, runs)."""
    return sd * np.array([np.random.default_rng([case.seed + k, 3]).normal(size=2)
                          for k in range(runs)]).T


def optimal_error(best: Bound, flown: Flight, seen: Measured, start: Array, rate: float,
                  use_rate: bool = True) -> Array:
    """
    Let the optimal estimator correct dead reckoning.

    Parameters
    ----------
    best : Bound
        The estimator.
    flown : Flight
        The truth.
    seen : Measured
        What was measured of it.
    start : ndarray, shape (2, runs)
        Errors of height and rate at the start (m, m/s).
    rate : float
        Samples per second.
    use_rate : bool
        As for the bound.

    Returns
    -------
    ndarray, shape (steps / PAIR, runs)
        Its error after every ``PAIR`` samples (m).

    """
    dt = 1 / rate
    step = seen.acceleration.copy()
    step[0] = 0.0
    reckoned_rate = flown.rate[0] + start[1] + np.cumsum(step * dt, axis=0)
    reckoned = flown.height[0] + start[0] + np.cumsum(
        np.concatenate([0 * step[:1], reckoned_rate[:-1] * dt]) + step * (dt * dt / 2), axis=0)
    missed = best.estimate(seen.range - reckoned,
                           seen.rate - reckoned_rate if use_rate else None)
    return np.asarray(reckoned[PAIR - 1::PAIR] + missed - flown.height[PAIR - 1::PAIR, None])


@dataclass(frozen=True, eq=False)
class Streamed:
    """Error (m) and published variance (m^2) of the height, shape (steps, runs)."""

    error: Array
    var: Array

    def rmse(self, first: int = 0) -> float:
        """Root mean square of the error from a step on (m)."""
        return float(np.sqrt(np.mean(self.error[first:]**2)))

    @property
    def nees(self) -> float:
        """Mean of error^2 / variance; 1 = honest."""
        return float(np.mean(self.error**2 / self.var))


def streamed(config: AltitudeConfig, flown: Flight, seen: Measured, start: Array, sd: float,
             rate: float) -> Streamed:
    """
    Run the product's estimator, sample by sample, on every run.

    Parameters
    ----------
    config : AltitudeConfig
        Of the estimator; its start is that of each run.
    flown, seen, start, rate
        See :func:`optimal_error`.
    sd : float
        How well height (m) and rate (m/s) at the start are said to be known.

    """
    error, var = np.empty((2, *seen.range.shape))
    for run, (height, climb) in enumerate(start.T):
        estimator = AltitudeEstimator(replace(
            config, initial_height=flown.height[0] + height, initial_height_sd=sd,
            initial_rate=flown.rate[0] + climb, initial_rate_sd=sd))
        columns = np.stack([seen.range[:, run], seen.rate[:, run], seen.acceleration[:, run]])
        for k, (distance, speed, push) in enumerate(columns.T.tolist()):
            stamp = round(k * 1e9 / rate)
            try:
                estimator.update(RangeSample(stamp, FRAME, distance, 0.0))
            except Rejected:  # the sensor's errors made it negative
                pass
            estimator.update(VelocitySample(stamp, FRAME, (0.0, 0.0, speed), NOTHING))
            made, = estimator.update(ImuSample(
                stamp, FRAME, LEVEL, NOTHING, NOTHING, (0.0, 0.0, push + GRAVITY)))
            error[k, run], var[k, run] = made.height, made.cov[0, 0]
    error -= flown.height[:, None]
    return Streamed(error, var)


FILTERS = ('waves', *RIVALS)


def height_filter(method: str, errors: SensorErrors, sea: EncounterSea,
                  runs: int) -> HeightFilter:
    """Make a filter of many runs; ``waves`` does not adapt here: all runs share a covariance."""
    if method == 'waves':
        return WaveFilter(errors, wave_model(sea), (runs,))
    return RIVALS[method](errors, (runs,))


def filtered(method: str, errors: SensorErrors, sea: EncounterSea, flown: Flight,
             seen: Measured, start: Array, sd: float, rate: float,
             use_rate: bool = True) -> Array:
    """
    Run a filter on all runs at once; return the error of its height (m), (steps, runs).

    Parameters
    ----------
    method, errors, sea
        The filter, and what it believes; see :func:`height_filter`.
    flown, seen, start, sd, rate
        See :func:`streamed`.
    use_rate : bool
        Whether it gets the altimeter's rate.

    """
    made = height_filter(method, errors, sea, seen.range.shape[1])
    made.start(flown.height[0], sd, flown.rate[0], sd)
    _place(made, start)
    error = np.empty_like(seen.range)
    for k, out in enumerate(error):
        if k:
            made.step(1 / rate, seen.acceleration[k], seen.range[k],
                      seen.rate[k] if use_rate else None)
        out[:] = made.height - flown.height[k]
    return error


def _place(made: HeightFilter, start: Array) -> None:
    """Give each run its own error of height and rate at the start, shape (2, runs)."""
    made.state[:2] += start


def closed_loop(case: LiSkimmingScenario, method: str, errors: SensorErrors, sea: EncounterSea,
                disturbed: Disturbances, start: Array, sd: float) -> Array:
    """
    Let an autopilot fly the profile by a filter; return the true height (m), (steps, runs).

    What the paper's fig 6 shows: the filter's error becomes the aircraft's.

    Parameters
    ----------
    case : LiSkimmingScenario
        The flight.
    method, errors, sea
        The filter, and what it believes; see :func:`height_filter`.
    disturbed : Disturbances
        Waves and sensor errors, (steps, runs).
    start, sd
        See :func:`streamed`.

    """
    steps, runs = disturbed.range.shape
    made = height_filter(method, errors, sea, runs)
    made.start(case.heights[0], sd, 0.0, sd)
    _place(made, start)
    pilot = Autopilot(Profile(case.heights, case.times, case.transition), 1 / case.rate, (runs,))
    height = np.empty((steps, runs))
    height[0] = pilot.height
    for k in range(1, steps):
        mean = pilot.step(made.height, made.rate)
        made.step(1 / case.rate, mean + disturbed.acceleration[k],
                  pilot.height - disturbed.elevation[k] + disturbed.range[k],
                  pilot.rate + disturbed.rate[k])
        height[k] = pilot.height
    return height


def observable_rank(errors: SensorErrors) -> tuple[int, Array]:
    """
    Return the rank of the observability matrix without waves, and its null vector.

    States: height, rate, accelerometer's bias and drift, altimeter's bias; measured: the range.
    """
    mat_a = np.zeros((5, 5))
    mat_a[0, 1] = 1.0
    mat_a[1, 2:4] = -1.0
    mat_a[3, 3] = -errors.drift_rate
    rows = [np.array([1.0, 0.0, 0.0, 0.0, 1.0])]
    for _ in range(4):
        rows.append(rows[-1] @ mat_a)
    _, singular, basis = np.linalg.svd(np.array(rows))
    return int(np.sum(singular > 1e-9 * singular[0])), np.asarray(basis[-1])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _row(name: str, value: float, unit: str = 'm', floor: float | None = None) -> Row:
    return Row('LiSkimming', name, value, unit, floor=floor)


# name: fast or slow, heading, spreading, whether the rate sees the waves
DEFAULT_CASES = {
    '300_head': (True, HEAD, 0.0, False), '60_head': (False, HEAD, 0.0, False),
    '60_beam': (False, BEAM, 0.0, False), '60_head_rate_off': (False, HEAD, 0.0, True),
    '60_head_short_crested': (False, HEAD, 2.0, False),
    '60_beam_short_crested': (False, BEAM, 2.0, False)}


def default_rows(case: LiSkimmingScenario, runs: int, name: str) -> Iterable[Row]:
    """
    Score the default against the optimal estimator, on the same runs, start known to 0.1 m.

    The filter knows whether the sea is long-crested, as the paper's. Where the rate sees the
    waves, it is not used, and in one more row used, as if nobody had said so.
    """
    fast, heading, spreading, rate_sees_waves = DEFAULT_CASES[name]
    errors, sd = sensor_errors(case), case.start_sd
    sea = EncounterSea(case.wave_height, case.mean_period, case.fast if fast else case.slow,
                       heading, spreading)
    flown, start = flight(case, case.duration), starts(case, runs, sd)
    seen = measured(flown, disturbances(case, sea, errors, runs, case.duration,
                                        rate_sees_waves=rate_sees_waves))
    best = bound(sea, errors, (sd, sd), case.duration, case.rate, not rate_sees_waves)
    optimal = _rms(optimal_error(best, flown, seen, start, case.rate, not rate_sees_waves))
    config = AltitudeConfig(speed=sea.speed, wave_heading_deg=degrees(heading),
                            wave_spreading=spreading, use_rate=not rate_sees_waves)
    ours = streamed(config, flown, seen, start, sd, case.rate)
    yield _row(f'waves_ratio_{name}', ours.rmse() / optimal, '', 1.0)
    yield _row(f'waves_rmse_{name}', ours.rmse(), floor=best.rmse)
    yield _row(f'optimal_rmse_{name}', optimal, floor=best.rmse)
    yield _row(f'waves_nees_{name}', ours.nees, '', 1.0)
    if rate_sees_waves:
        trusting = streamed(replace(config, use_rate=True), flown, seen, start, sd, case.rate)
        yield _row('waves_rmse_60_head_rate_sees_waves', trusting.rmse(), floor=best.rmse)


def adaptation_rows(case: LiSkimmingScenario, runs: int) -> Iterable[Row]:
    """Assume a wrong sea state; score from second 30 on against the bound of the true one."""
    errors, sd, seconds = sensor_errors(case), case.start_sd, 2 * case.duration
    first = round(case.duration * case.rate)
    flown, start = flight(case, seconds), starts(case, runs, sd)
    high, calm = ((case.wave_height, case.mean_period), (case.calm_height, case.calm_period))
    for name, true, assumed in (('7_under_4', calm, high), ('4_under_7', high, calm)):
        sea = EncounterSea(*true, case.slow, HEAD)
        seen = measured(flown, disturbances(case, sea, errors, runs, seconds))
        best = bound(sea, errors, (sd, sd), seconds, case.rate / PAIR)
        late = _rms(best.sd[first // PAIR // PAIR:])
        config = AltitudeConfig(
            speed=case.slow, wave_spreading=0.0, significant_wave_height=assumed[0],
            mean_wave_period=assumed[1])
        ours = streamed(config, flown, seen, start, sd, case.rate)
        fixed = filtered('waves', errors, EncounterSea(*assumed, case.slow, HEAD), flown, seen,
                         start, sd, case.rate)
        yield _row(f'waves_ratio_{name}', ours.rmse(first) / late, '', 1.0)
        yield _row(f'waves_nees_{name}', ours.nees, '', 1.0)
        yield _row(f'fixed_ratio_{name}', _rms(fixed[first:]) / late, '', 1.0)


def table_rows(case: LiSkimmingScenario, runs: int) -> Iterable[Row]:
    """Score every filter under each disturbance, at 300 m/s, the start known exactly."""
    full = sensor_errors(case)
    sea = EncounterSea(case.wave_height, case.mean_period, case.fast, HEAD)
    none = replace(full, **{name: 0.0 for name in SensorErrors.__slots__ if name != 'drift_rate'})
    flown, start = flight(case, case.duration), np.zeros((2, runs))
    cases = {
        'waves': none,
        'altimeter': replace(full, accel_bias=0.0, accel_drift=0.0, accel_white=0.0),
        'accel_bias': replace(none, accel_bias=full.accel_bias, accel_white=full.accel_white),
        'accel_drift': replace(none, accel_drift=full.accel_drift, accel_white=full.accel_white),
        'all': full}
    for name, errors in cases.items():
        still = name not in ('waves', 'all')
        seen = measured(flown, disturbances(case, replace(sea, height=0.0) if still else sea,
                                            errors, runs, case.duration))
        for method in FILTERS:
            error = filtered(method, full, sea, flown, seen, start, EXACT, case.rate)
            yield _row(f'{method}_{name}_rmse', _rms(error))


def closed_loop_rows(case: LiSkimmingScenario, runs: int) -> Iterable[Row]:
    """Fly 8 m by each filter: 300 m/s, start known exactly; 60 m/s, start known to 0.1 m."""
    errors = sensor_errors(case)
    low = slice(*(round(time * case.rate) for time in case.low))
    for speed, sd in ((case.fast, EXACT), (case.slow, case.start_sd)):
        sea = EncounterSea(case.wave_height, case.mean_period, speed, HEAD)
        disturbed = disturbances(case, sea, errors, runs, case.duration)
        start = starts(case, runs, sd)
        best = bound(sea, errors, (sd, sd), case.duration, case.rate)
        floor = _rms(best.sd[low.start // PAIR:low.stop // PAIR])
        for method in FILTERS:
            height = closed_loop(case, method, errors, sea, disturbed, start, sd)
            yield _row(f'{method}_closed_loop_{speed:g}', _rms(height[low] - case.heights[1]),
                       floor=floor)


def long_rows(case: LiSkimmingScenario, runs: int) -> Iterable[Row]:
    """Run 300 s and see who grows."""
    errors, seconds = sensor_errors(case), 10 * case.duration
    sea = EncounterSea(case.wave_height, case.mean_period, case.fast, HEAD)
    flown, start = flight(case, seconds), np.zeros((2, runs))
    seen = measured(flown, disturbances(case, sea, errors, runs, seconds))
    part = round(case.duration * case.rate)
    for method in ('waves', 'combined', 'ekf'):
        error = filtered(method, errors, sea, flown, seen, start, EXACT, case.rate)
        yield _row(f'{method}_rmse_first_30s', _rms(error[:part]))
        yield _row(f'{method}_rmse_last_30s_of_300', _rms(error[-part:]))


def guess_rows(case: LiSkimmingScenario, runs: int) -> Iterable[Row]:
    """Compare combined and EKF for several guesses of the lost sensor table."""
    full = sensor_errors(case)
    sea = EncounterSea(case.wave_height, case.mean_period, case.fast, HEAD)
    flown, start = flight(case, case.duration), np.zeros((2, runs))
    ratios = []
    for guess in GUESSES:
        errors = replace(full, **guess)
        seen = measured(flown, disturbances(case, sea, errors, runs, case.duration))
        combined, ekf = (_rms(filtered(method, errors, sea, flown, seen, start, EXACT, case.rate))
                         for method in ('combined', 'ekf'))
        ratios.append(combined / ekf)
    yield _row('combined_to_ekf_lowest_guess', min(ratios), '')
    yield _row('combined_to_ekf_highest_guess', max(ratios), '')


def start_rows(case: LiSkimmingScenario) -> Iterable[Row]:
    """Say what is published when only the altimeter tells the height."""
    errors = sensor_errors(case)
    rank, _ = observable_rank(errors)
    yield _row('observable_rank_of_5', rank, '')
    sea = EncounterSea(case.wave_height, case.mean_period, case.slow, HEAD)
    made = WaveFilter(errors, wave_model(sea))
    made.start(0.0, 1e4, 0.0, 5.0)
    for _ in range(round(10 * case.duration * case.rate)):
        made.step(1 / case.rate, 0.0, 0.0, 0.0)
    yield _row('published_sd_start_unknown', sqrt(float(made.cov[0, 0])), floor=errors.range_bias)


def li_skimming(runs: int | None = None) -> list[Row]:
    """
    Run LiSkimming's experiments, on the product's estimator and on the paper's filters.

    The paper's order holds where it says that the predictive filter withstands waves and the
    altimeter's bias and fails with the accelerometer's, and that the EKF is off by about the
    altimeter's bias. It does not where it says that the observer with poles at -200 withstands
    waves (it follows them), and that the combined filter removes the altimeter's bias: nothing
    can; it lives on the known start, and diverges after that.

    Parameters
    ----------
    runs : int, optional
        Instead of the scenario's.

    """
    case = LiSkimmingScenario() if runs is None else replace(LiSkimmingScenario(), runs=runs)
    few = max(case.runs // 4, 1)
    default = [row for name in DEFAULT_CASES for row in default_rows(case, case.runs, name)]
    return [*default, *adaptation_rows(case, max(case.runs // 2, 1)),
            *table_rows(case, case.runs), *closed_loop_rows(case, case.runs),
            *long_rows(case, few), *guess_rows(case, case.runs), *start_rows(case)]

"""Height above mean sea level, not above the crest: altimeter and accelerometer joined."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import exp, hypot, isfinite, isnan, nan, radians, sqrt
from operator import itemgetter
from typing import NamedTuple

from deck_motion_ros.config import parameter
from deck_motion_ros.estimators.encounter import EncounterSea, GRAVITY
from deck_motion_ros.estimators.sea_belief import SeaBelief
from deck_motion_ros.estimators.skimming_rivals import HeightFilter, RIVALS
from deck_motion_ros.estimators.strapdown import check_plausible, MAX_FORCE
from deck_motion_ros.estimators.wave_filter import (
    ACCEL_BIAS,
    HEIGHT,
    RANGE_BIAS,
    RATE_BIAS,
    SensorErrors,
    WaveFilter,
)
from deck_motion_ros.geometry import rotated
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    NANOSECONDS,
    RangeSample,
    Rejected,
    VelocitySample,
)
from deck_motion_ros.streams import StampGate

Sample = RangeSample | VelocitySample | ImuSample

TICK = 100_000  # ns: time is counted in these, so that few different steps occur
SECOND = NANOSECONDS // TICK
ANYWHERE = 1e4  # m: sd of the height before the first range, and the largest that is plausible
FASTEST = 1e3  # m/s: the largest rate that is plausible
UNKNOWN_RATE = 5.0  # m/s: sd of the rate at the start, where it is not given
GATE = 5.0  # standard deviations
PATIENCE = 20 * SECOND  # of ranges that do not fit: then the filter is wrong, not the altimeter
LATEST = SECOND // 4  # a measurement older than the newest step by more is not used
MOST_WAITING = 500  # measurements for the next uav/imu
GAP = 2.5  # intervals without uav/imu: the acceleration in between is not known
UNKNOWN_ACCELERATION = 3.0  # m/s^2: sd of it then, with a correlation time of 1 s
SATURATED = 0.5  # of the limit, and s: sd and correlation time of what is cut off
RESTART = 60 * SECOND  # without uav/imu: begin anew
FIT_MEMORY = 2.0  # s
RATE_BAN = 60 * SECOND  # rates are not used for so long if they do not fit
RATE_DOUBT = 1.5  # m/s: sd of what they have done to the rate before
HARM = 10.0  # s: for so long at most


@dataclass(frozen=True, slots=True)
class AltitudeConfig:
    """Parameters of the altitude node."""

    method: str = parameter(
        'waves', 'waves: Kalman filter of motion, biases and waves. For comparison, as in '
        'LiSkimming: combined (unsafe beyond 30 s: its height is not tied to any measurement), '
        'predictive, eso, ekf', choices=('waves', 'combined', 'predictive', 'eso', 'ekf'))
    significant_wave_height: float = parameter(
        7.5, 'Expected; the filter begins with the higher of this and 7.5 m and adapts', 'm',
        0.05, 16.0)
    mean_wave_period: float = parameter(
        11.6, 'Mean period T1 of such waves: the peak period / 1.296', 's', 1.0, 30.0)
    speed: float = parameter(60.0, 'Speed of the aircraft; 0 = hover', 'm/s', 0.0, 400.0)
    wave_heading_deg: float = parameter(
        180.0, "Direction the waves travel towards, from the aircraft's course: 0 = following, "
        '90 = beam, 180 = head sea', 'deg', -360.0, 360.0)
    wave_spreading: float = parameter(
        2.0, 'n of the spreading cos^n about that direction; 0 = long-crested, which is not safe '
        'to believe of a wind sea abeam', '', 0.0, 200.0)
    adapt_sea_state: bool = parameter(
        True, 'Adapt the height of the waves; false = as given from the start')
    initial_height: float = parameter(
        nan, 'Height above mean sea level at the start; unset = from the first range', 'm',
        0.0, 1e4)
    initial_height_sd: float = parameter(
        nan, 'How well that is known; unset = as well as altimeter_bias_sd', 'm', 0.0, 1e4)
    initial_rate: float = parameter(nan, 'Height rate at the start; unset = 0', 'm/s', -1e3, 1e3)
    initial_rate_sd: float = parameter(
        nan, 'How well that is known; unset = 0.1 m/s with initial_rate, else 5 m/s', 'm/s',
        0.0, 1e3)
    altimeter_bias_sd: float = parameter(
        1.0, 'Constant error of altimeter/range: no measurement tells it from the height', 'm',
        0.0, 100.0)
    altimeter_sd: float = parameter(
        0.5, 'Noise of altimeter/range, where the message does not say', 'm', 1e-3, 100.0)
    use_rate: bool = parameter(
        True, 'Use altimeter/rate; false where it sees the waves. Rates that do not fit are left '
        'out in any case')
    rate_bias_sd: float = parameter(0.2, 'Constant error of altimeter/rate', 'm/s', 0.0, 100.0)
    rate_sd: float = parameter(
        0.2, 'Noise of altimeter/rate, where the message does not say', 'm/s', 1e-3, 100.0)
    accel_bias_sd: float = parameter(
        0.05, 'Error of the specific force from one switching on to the next', 'm/s^2', 0.0, 10.0)
    accel_drift_sd: float = parameter(
        0.05, 'Its slow error, a Markov process', 'm/s^2', 0.0, 10.0)
    accel_drift_rate: float = parameter(
        5.0, 'Inverse correlation time of the slow error', '1/s', 1e-4, 100.0)
    accel_white_sd: float = parameter(0.05, 'Noise of a sample', 'm/s^2', 1e-6, 10.0)
    accel_limit: float = parameter(
        156.9, 'Specific force along an axis at which the accelerometer is at its end', 'm/s^2',
        10.0, MAX_FORCE)
    mean_sea_frame: str = parameter('mean_sea', 'Level frame, z up from mean sea level')
    uav_level_frame: str = parameter('uav_level', 'Level frame at the aircraft')
    uav_base_link_frame: str = parameter('uav_base_link', "The aircraft's body frame")

    def errors(self) -> SensorErrors:
        """Return what is wrong with the sensors."""
        return SensorErrors(
            self.altimeter_bias_sd, self.altimeter_sd, self.rate_bias_sd, self.rate_sd,
            self.accel_bias_sd, self.accel_drift_sd, self.accel_white_sd, self.accel_drift_rate)

    def sea(self) -> EncounterSea:
        """Return the sea that is expected."""
        return EncounterSea(self.significant_wave_height, self.mean_wave_period, self.speed,
                            radians(self.wave_heading_deg), self.wave_spreading)

    def start(self) -> tuple[float, float, float, float]:
        """Return height, its sd, rate, its sd at the start; the height may be unset."""
        height_sd, rate, rate_sd = (
            self.initial_height_sd, self.initial_rate, self.initial_rate_sd)
        return (self.initial_height, self.altimeter_bias_sd if isnan(height_sd) else height_sd,
                0.0 if isnan(rate) else rate,
                (UNKNOWN_RATE if isnan(rate) else 0.1) if isnan(rate_sd) else rate_sd)


class AltitudeEstimate(NamedTuple):
    """
    The aircraft over the sea.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    height, rate : float
        Above mean sea level (m), up (m/s).
    cov : ndarray, shape (2, 2)
        Of their error; 0 = unknown.

    """

    stamp: int
    height: float
    rate: float
    cov: Array


class Misfit:
    """
    How standardised innovations of the last seconds differ from white noise of variance 1.

    Parameters
    ----------
    memory : float
        Time constant (s).

    """

    TYPICAL = 5.0  # squares of 1 that it begins with
    LARGEST = 16.0  # what a single outlier counts
    LARGE, SLOW = 6.0, 10.0  # standard deviations: of mean square, of mean

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self._weight = self._total = self._square = self._time = 0.0

    def add(self, time: float, innovation: float) -> None:
        """Take a standardised innovation of a time (s), not before the one before."""
        keep = exp((self._time - time) / self._memory)
        self._time = time
        self._weight = self._weight * keep + 1.0
        self._total = self._total * keep + innovation
        self._square = self._square * keep + min(innovation * innovation, self.LARGEST)

    @property
    def mean(self) -> float:
        """The mean square; 1 = as expected."""
        return (self._square + self.TYPICAL) / (self._weight + self.TYPICAL)

    @property
    def bad(self) -> bool:
        """Say whether they are larger, or more alike from one to the next, than by chance."""
        weight = self._weight + self.TYPICAL
        return (self.mean > 1 + self.LARGE * sqrt(2 / weight)
                or abs(self._total) > self.SLOW * sqrt(weight / 2))


class AltitudeEstimator:
    """
    Altimeter and accelerometer in, height above mean sea level out.

    Measurements act at their stamps: one newer than the newest ``uav/imu`` waits for the next
    one, one that is a little older acts on what is known now of then. There is one estimate for
    each ``uav/imu`` from the start on: the first of them where the initial height is given, else
    the first range. What does not fit is left out and counted.

    Parameters
    ----------
    config : AltitudeConfig
        Parameters.

    Attributes
    ----------
    counts : Counter
        What happened, by name: ranges and rates that did not fit, saturated accelerations, gaps,
        recoveries, restarts.
    ranges, rates : Misfit
        How well either fits.

    """

    def __init__(self, config: AltitudeConfig) -> None:
        self.config = config
        self._sea, self._errors = config.sea(), config.errors()
        self.counts: Counter[str] = Counter()
        self._begin(config.start())

    def _begin(self, start: tuple[float, float, float, float]) -> None:
        config = self.config
        self._start = start
        waves = config.method == 'waves'
        self.belief = SeaBelief(self._sea, waves and config.adapt_sea_state)
        self._waves = WaveFilter(self._errors, self.belief.waves) if waves else None
        self._filter: HeightFilter = self._waves or RIVALS[config.method](self._errors, ())
        self._gates = {kind: StampGate() for kind in (RangeSample, VelocitySample, ImuSample)}
        self._waiting: list[tuple[int, RangeSample | VelocitySample]] = []
        self._running = False
        self._time = 0  # ticks that the filter has reached
        self._imu: int | None = None  # of the newest uav/imu
        self._interval = 0.0  # between two of them, usually
        self._started = 0
        self._ranged = 0  # of the newest range used
        self._misfit_since: int | None = None
        self._judged = 0  # when the sea state was judged last
        self._doubt = self._errors.range_bias  # sd of what range and height differ by for good
        self.ranges, self.rates = Misfit(FIT_MEMORY), Misfit(FIT_MEMORY)
        self._banned = 0  # rates are not used until then

    def update(self, sample: Sample) -> list[AltitudeEstimate]:
        """
        Use one sample; return the estimate that it completes, if any.

        Raises
        ------
        Rejected
            If the sample's stamp or content cannot be used.

        """
        _check(sample)
        gate = self._gates[type(sample)]
        others = None if gate.newest is not None else max(
            (other.newest for other in self._gates.values() if other.newest is not None),
            default=None)
        anew = gate.admit(sample.stamp, others)
        now = (sample.stamp + TICK // 2) // TICK
        if isinstance(sample, ImuSample):
            # the first one may be far from the range that the flight began with: another clock
            since = now - (self._time if self._imu is None else self._imu)
            if anew or (self._running and not -LATEST <= since <= RESTART):
                self._restart()
                self._gates[ImuSample].admit(sample.stamp)
            return self._advance(sample, now)
        if self._running:
            if self._time - now > LATEST:
                raise Rejected('too late')
        elif isnan(self._start[0]):
            if isinstance(sample, VelocitySample):
                return []
            self._set_out(now, sample.distance, ANYWHERE)
        self._waiting.append((now, sample))
        if len(self._waiting) > MOST_WAITING:
            del self._waiting[0]
            raise Rejected('no uav/imu of its time')
        return []

    def _restart(self) -> None:
        """Begin anew, at the next range: the initial height was that of the first start."""
        self.counts['restarts'] += 1
        self._begin((nan, nan, 0.0, UNKNOWN_RATE))

    def _set_out(self, now: int, height: float, height_sd: float) -> None:
        _, _, rate, rate_sd = self._start
        self._filter.start(height, height_sd, rate, rate_sd)
        self._waiting = [item for item in self._waiting if now - item[0] <= LATEST]
        self._running = True
        self._time = self._started = self._ranged = self._judged = now

    def _advance(self, sample: ImuSample, now: int) -> list[AltitudeEstimate]:
        """Go ahead to an Imu sample by way of what was measured until then."""
        interval = 0 if self._imu is None else now - self._imu
        self._imu = now
        height, height_sd, _, _ = self._start
        if not self._running and not isnan(height):
            self._set_out(now, height, height_sd)
        if not self._running or now < self._time:
            return []
        acceleration, density = self._acceleration(sample, interval)
        ready = [item for item in self._waiting if item[0] <= now]
        self._waiting = [item for item in self._waiting if item[0] > now]
        ready.sort(key=itemgetter(0))
        if self._waves is not None:
            self._step_waves(self._waves, ready, now, acceleration, density)
        else:
            self._step_rival(ready, now, acceleration)
        done = self._filter
        return [AltitudeEstimate(sample.stamp, float(done.height), float(done.rate),
                                 done.cov.copy())]

    def _acceleration(self, sample: ImuSample, interval: int) -> tuple[float, float]:
        """Return vertical acceleration and the density of its white error."""
        assert sample.orientation is not None
        limit = self.config.accel_limit
        acceleration = rotated(sample.orientation, sample.specific_force)[2] - GRAVITY
        if max(map(abs, sample.specific_force)) >= limit:
            self.counts['saturated accelerations'] += 1
            return acceleration, (SATURATED * limit)**2 * SATURATED
        usual = self._interval or interval
        self._interval = usual + (min(interval, 2 * usual) - usual) / 8
        if interval > GAP * usual:
            self.counts['gaps of uav/imu'] += 1
            return acceleration, UNKNOWN_ACCELERATION**2
        return acceleration, self._errors.accel_white**2 * interval / SECOND

    def _step_waves(self, waves: WaveFilter, ready: list[tuple[int, RangeSample | VelocitySample]],
                    now: int, acceleration: float, density: float) -> None:
        for ticks, sample in ready:
            self._reach(waves, ticks, acceleration, density)
            age = (self._time - ticks) / SECOND
            if isinstance(sample, RangeSample):
                self._use_range(waves, ticks, sample, age)
            elif self.config.use_rate:
                self._use_rate(waves, ticks, sample, age)
        self._reach(waves, now, acceleration, density)
        if now - self._judged >= SECOND:
            self._judged = now
            waves.symmetrise()
            if abs(waves.state[RANGE_BIAS]) > GATE * self._doubt:
                pair = [HEIGHT, RANGE_BIAS]
                self._recover(waves, float(waves.state[pair].sum()),
                              float(waves.full_cov[pair][:, pair].sum()))
            if self.belief.decide():
                waves.expect(self.belief.waves)

    def _reach(self, waves: WaveFilter, ticks: int, acceleration: float, density: float) -> None:
        if ticks > self._time:
            waves.predict((ticks - self._time) / SECOND, acceleration, density)
            self._time = ticks

    def _use_range(self, waves: WaveFilter, ticks: int, sample: RangeSample, age: float) -> None:
        var = sample.var if sample.var > 0 else self._errors.range_white**2
        innovation = float(waves.use_range(sample.distance, var, age, GATE))
        self.ranges.add(ticks / SECOND, innovation)
        if abs(innovation) <= GATE:
            self.belief.observe(min(ticks - self._ranged, SECOND) / SECOND, waves.wave_power)
            self._ranged, self._misfit_since = ticks, None
            return
        self.counts['ranges that do not fit'] += 1
        if self._misfit_since is None:
            self._misfit_since = ticks
        elif ticks - self._misfit_since > PATIENCE:
            self._recover(waves, sample.distance, self.belief.waves.sea.var + var)
            self._ranged, self._misfit_since = ticks, None

    def _use_rate(self, waves: WaveFilter, ticks: int, sample: VelocitySample, age: float) -> None:
        var = sample.var[2] if sample.var[2] > 0 else self._errors.rate_white**2
        banned = ticks < self._banned
        innovation = float(waves.use_rate(
            sample.velocity[2], var, age, -1.0 if banned else GATE))
        self.rates.add(ticks / SECOND, innovation)
        if banned or abs(innovation) > GATE:
            self.counts['rates not used'] += 1
        if self.rates.bad and not banned:
            if not self._banned:
                self._undo_rates(waves, (ticks - self._started) / SECOND)
            self._banned = ticks + RATE_BAN

    def _recover(self, waves: WaveFilter, total: float, var: float) -> None:
        """
        Take the height from the altimeter: both do not fit together.

        Either the height was wrong, or what the altimeter sees is not the sea: nothing tells
        which, so that the published sd is as large as the disagreement.

        Parameters
        ----------
        waves : WaveFilter
            The filter.
        total, var : float
            Height and altimeter bias together, as the altimeter has it (m, m^2).

        """
        self.counts['recoveries'] += 1
        self._doubt = hypot(self._errors.range_bias, total - float(waves.height))
        waves.rest_on_range(total, var, self._doubt)

    def _undo_rates(self, waves: WaveFilter, seconds: float) -> None:
        """Doubt what rates, used for so long, may have done to the motion."""
        waves.widen(RATE_DOUBT * min(seconds, HARM), RATE_DOUBT)
        waves.forget({ACCEL_BIAS: self._errors.accel_bias, RATE_BIAS: self._errors.rate_bias})

    def _step_rival(self, ready: list[tuple[int, RangeSample | VelocitySample]], now: int,
                    acceleration: float) -> None:
        height = rate = None
        for _, sample in ready:
            if isinstance(sample, RangeSample):
                height, self._ranged = sample.distance, now
            elif self.config.use_rate:
                rate = sample.velocity[2]
        if now > self._time:
            self._filter.step((now - self._time) / SECOND, acceleration, height, rate)
            self._time = now

    @property
    def height_sd(self) -> float:
        """Standard deviation of the height (m) as the filter has it."""
        return sqrt(float(self._filter.cov[0, 0]))

    @property
    def unobservable_sd(self) -> float:
        """
        Standard deviation of height minus altimeter bias, over 2 (m).

        No measurement tells what both have in common with opposite sign; NaN for the methods that
        do not know of it.
        """
        if self._waves is None:
            return nan
        cov = self._waves.full_cov
        return sqrt(cov[HEIGHT, HEIGHT] - 2 * cov[HEIGHT, RANGE_BIAS]
                    + cov[RANGE_BIAS, RANGE_BIAS]) / 2

    @property
    def uses_rates(self) -> bool:
        """Say whether rates are used now."""
        return self.config.use_rate and self._time >= self._banned

    @property
    def silence(self) -> float:
        """Time since the newest range that was used (s); NaN before the first."""
        return (self._time - self._ranged) / SECOND if self._running else nan


def _check(sample: Sample) -> None:
    """Raise ``Rejected`` if the content of a sample cannot be."""
    if isinstance(sample, RangeSample):
        if not isfinite(sample.distance):
            raise Rejected('no echo')
        if sample.distance < 0:
            raise Rejected('negative range')
        if sample.distance > ANYWHERE:
            raise Rejected('implausible range')
    elif isinstance(sample, VelocitySample):
        if not abs(sample.velocity[2]) <= FASTEST:
            raise Rejected('implausible rate')
    elif sample.orientation is None:
        raise Rejected('no attitude')
    elif not isfinite(sum(sample.specific_force)):
        raise Rejected('not finite')
    else:
        check_plausible(sample)

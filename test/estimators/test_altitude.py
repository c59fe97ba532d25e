"""The altitude estimator on its stream: honesty, adaptation, bad input, order of arrival."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from deck_motion_ros.estimators.altitude import AltitudeConfig, AltitudeEstimator, Misfit
from deck_motion_ros.estimators.sea_belief import SeaBelief
from deck_motion_ros.samples import (
    ImuSample,
    NANOSECONDS,
    OdometrySample,
    RangeSample,
    Rejected,
    VelocitySample,
)
from deck_motion_ros.simulation.sea_skimming import SkimmingSimulator, SkimmingSimulatorConfig

FLIGHT = SkimmingSimulatorConfig(duration=30.0, waves=80, rate=50.0, altimeter_rate=50.0,
                                 profile_heights=(45.0, 25.0, 35.0))
KNOWN = AltitudeConfig(initial_height=45.0, initial_height_sd=0.1, initial_rate=0.0,
                       initial_rate_sd=0.1)
LEVEL, ZERO = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
G = 9.80665


def imu(stamp, up=G, orientation=LEVEL):
    return ImuSample(stamp, 'uav_base_link', orientation, ZERO, ZERO, (0.0, 0.0, up))


def ranged(stamp, distance=45.0):
    return RangeSample(stamp, 'uav_level', distance, 0.0)


def rated(stamp, rate=0.0):
    return VelocitySample(stamp, 'uav_level', (0.0, 0.0, rate), ZERO)


class Run:
    """An estimator over a simulated flight; errors and published deviations by second."""

    def __init__(self, flight=FLIGHT, config=KNOWN, samples=None):
        self.estimator = AltitudeEstimator(config)
        self.rejected, truth, made = [], [], []
        for sample in samples or (event.sample for event in SkimmingSimulator(flight)):
            if isinstance(sample, OdometrySample):
                truth.append((sample.stamp, sample.position[2], sample.linear_velocity[2]))
                continue
            try:
                made += [(item.stamp, item.height, item.rate, *np.diag(item.cov))
                         for item in self.estimator.update(sample)]
            except Rejected as rejection:
                self.rejected.append(rejection.reason)
        stamp, height, rate, self.var, self.rate_var = np.array(made, dtype=float).T
        when, true_height, true_rate = np.array(truth, dtype=float).T
        self.time = stamp / NANOSECONDS
        self.error = height - np.interp(stamp, when, true_height)
        self.rate_error = rate - np.interp(stamp, when, true_rate)

    def worst(self, first=0.0, last=inf):
        """Return the largest error, in published standard deviations."""
        inside = (self.time >= first) & (self.time < last)
        return np.max(np.abs(self.error[inside]) / np.sqrt(self.var[inside]))

    def rms(self, first=0.0, last=inf):
        inside = (self.time >= first) & (self.time < last)
        return np.sqrt(np.mean(self.error[inside]**2))


def test_default_is_honest_and_finds_the_sea():
    """Six flights over sea state 5, of which nothing is told: NEES of height and rate."""
    sea = replace(FLIGHT, significant_wave_height=3.25, peak_period=9.7)
    runs = [Run(replace(sea, seed=seed)) for seed in range(6)]
    height = np.mean([run.error**2 / run.var for run in runs])
    rate = np.mean([run.rate_error**2 / run.rate_var for run in runs])
    assert 0.15 < height < 1.5 and 0.6 < rate < 1.5  # it begins in sea state 7
    found = [run.estimator.belief.waves.sea.height for run in runs]
    assert np.mean(found) == pytest.approx(3.75, abs=1.0)
    assert max(found) < 6.0
    assert np.mean([run.estimator.ranges.mean for run in runs]) == pytest.approx(1, abs=0.15)


def test_unknown_start_says_so():
    run = Run(config=AltitudeConfig())
    waves_and_bias = np.hypot(7.5 / 4, 1.0)
    assert run.time[0] == 0.0
    assert np.sqrt(run.var[0]) >= waves_and_bias
    assert np.sqrt(run.var).min() >= 0.9
    assert run.worst() < 4
    assert run.estimator.unobservable_sd >= 0.9


def test_one_estimate_for_each_imu_from_the_start_on():
    estimator = AltitudeEstimator(AltitudeConfig())
    assert estimator.update(imu(0)) == []
    assert estimator.update(rated(5_000_000)) == []
    assert estimator.update(ranged(12_000_000)) == []
    assert estimator.update(imu(10_000_000)) == []  # older than the start
    made, = estimator.update(imu(20_000_000))
    assert (made.stamp, made.cov.shape) == (20_000_000, (2, 2))
    assert made.height == pytest.approx(45.0, abs=0.1)
    known = AltitudeEstimator(KNOWN)
    made, = known.update(imu(0))
    assert made.height == 45.0 and made.cov[0, 0] == pytest.approx(0.01)


@pytest.mark.parametrize('delay', [(0.0, 0.0), (0.03, 0.0), (0.0, 0.06)])
def test_lateness_of_a_topic_costs_little(delay):
    on_time, late = Run(), Run(replace(FLIGHT, delay=delay))
    assert late.rms(10.0) < on_time.rms(10.0) + 0.05
    assert not [reason for reason in late.rejected if reason != 'negative range']


def test_order_of_arrival_within_a_stamp_does_not_matter_where_imu_is_last():
    samples = [event.sample for event in SkimmingSimulator(replace(FLIGHT, duration=5.0))]
    swapped = samples.copy()
    for k in range(0, len(swapped), 4):
        swapped[k:k + 2] = swapped[k + 1], swapped[k]
    ours, theirs = Run(samples=samples), Run(samples=swapped)
    assert ours.error == pytest.approx(theirs.error, abs=1e-6)


@pytest.mark.parametrize('changes', [
    {'rate': 20.0, 'altimeter_rate': 5.0}, {'jitter': (0.002, 0.002)},
    {'dropout': (0.1, 0.3)}, {'rate': 200.0, 'duration': 20.0}])
def test_other_rates_uneven_stamps_and_losses(changes):
    run = Run(replace(FLIGHT, **changes))
    assert run.worst() < 4
    assert run.rms(15.0) < 0.8


def test_loss_of_lock_over_a_steep_sea():
    """5 s of +inf: counted, honest meanwhile, and as good as before within 1 s."""
    run = Run(replace(FLIGHT, loss_of_lock=(20.0, 25.0)))
    assert run.rejected.count('no echo') == 250
    assert run.worst(20.0, 30.0) < 3.5
    grown = np.sqrt(run.var[(run.time > 24.9) & (run.time < 25.0)])
    assert np.all(grown > 1.2 * np.sqrt(run.var[run.time < 20.0][-1]))
    assert np.sqrt(run.var[run.time < 26.0][-1]) < 0.4
    assert run.rms(26.0) < 0.6


def test_deck_that_passes_is_left_out():
    run = Run(replace(FLIGHT, profile_heights=(45.0, 45.0, 45.0), obstacle=(15.0, 18.0, 30.0)))
    assert run.estimator.counts['ranges that do not fit'] == 150
    assert run.worst() < 3.5
    assert run.rms(18.0, 19.0) < 0.6  # at once


def test_surface_that_stays_elsewhere_is_believed_after_20_s_with_an_honest_sd():
    run = Run(replace(FLIGHT, profile_heights=(45.0, 45.0, 45.0), obstacle=(5.0, 1e6, 30.0)))
    assert run.worst() < 3.5
    assert run.rms(7.0, 24.0) < 1.5  # not believed yet
    assert run.estimator.counts['recoveries'] == 1
    assert np.sqrt(run.var[-1]) > 20.0


@pytest.mark.parametrize('height', [145.0, 58.0, 33.0])
def test_wrong_start_is_put_right_within_25_s_with_an_honest_sd(height):
    """Waves hide 12 m for a while; the altimeter's bias would have to be 5 sd."""
    run = Run(replace(FLIGHT, profile_heights=(height,) * 3))
    assert run.estimator.counts['recoveries'] == 1
    late = run.time > 25.0
    assert np.all(np.abs(run.error[late]) < 4.0)
    assert np.all(np.sqrt(run.var[late]) > 1.0)


def test_rate_that_sees_the_waves_is_not_used_and_does_little_harm():
    flight = replace(FLIGHT, rate_sees_waves=True)
    run, without = Run(flight), Run(flight, replace(KNOWN, use_rate=False))
    assert not run.estimator.uses_rates
    assert run.estimator.counts['rates not used'] > 1450
    assert run.worst() < 4
    assert run.rms(15.0) < without.rms(15.0) + 0.5
    assert without.estimator.counts['rates not used'] == 0


def test_saturated_accelerometer():
    """A pull-up of 1.5 s beyond the limit: counted, honest, and within 1 m again 5 s later."""
    flight = replace(FLIGHT, profile_heights=(45.0, 120.0, 35.0), profile_times=(10.0, 90.0),
                     transition_time=4.0)
    run = Run(flight, replace(KNOWN, accel_limit=25.0))
    assert run.estimator.counts['saturated accelerations'] > 25
    assert run.worst() < 4
    assert np.abs(run.error[run.time > 20.0]).max() < 1.5
    unaware = Run(flight)
    assert unaware.estimator.counts['saturated accelerations'] == 0


def test_gap_of_the_accelerometer():
    """Half a second of her manoeuvre is not measured: honest, and good again within 5 s."""
    samples = [event.sample for event in SkimmingSimulator(FLIGHT)]
    kept = [sample for sample in samples if not (
        isinstance(sample, ImuSample) and 10.0 < sample.stamp / NANOSECONDS < 10.5)]
    run = Run(samples=kept)
    assert run.estimator.counts['gaps of uav/imu'] == 1
    assert run.worst() < 4
    assert run.rms(16.0) < 0.7


def test_minute_of_silence_begins_anew_at_the_next_range():
    estimator = AltitudeEstimator(KNOWN)
    for k in range(100):
        estimator.update(ranged(k * 10_000_000))
        estimator.update(imu(k * 10_000_000))
    later = 100 * NANOSECONDS
    assert estimator.update(imu(later)) == []
    estimator.update(ranged(later + 10_000_000, 80.0))
    made, = estimator.update(imu(later + 10_000_000))
    assert made.height == pytest.approx(80.0, abs=0.1) and made.cov[0, 0] > 4
    assert estimator.counts['restarts'] == 1


@pytest.mark.parametrize('sample, reason', [
    (ranged(NANOSECONDS, nan), 'no echo'), (ranged(NANOSECONDS, inf), 'no echo'),
    (ranged(NANOSECONDS, -inf), 'no echo'), (ranged(NANOSECONDS, -0.5), 'negative range'),
    (ranged(NANOSECONDS, 1e30), 'implausible range'),
    (rated(NANOSECONDS, nan), 'implausible rate'), (rated(NANOSECONDS, 1e5), 'implausible rate'),
    (imu(NANOSECONDS, nan), 'not finite'),
    (imu(NANOSECONDS, 2e4), 'implausible specific force'),
    (imu(NANOSECONDS, G, None), 'no attitude'), (imu(490_000_000), 'older stamp'),
    (imu(500_000_000), 'duplicate stamp'), (ranged(100_000_000), 'older stamp'),
    (imu(5000 * NANOSECONDS), 'stamp far ahead')])
def test_what_cannot_be_is_rejected_and_changes_nothing(sample, reason):
    ours, theirs = AltitudeEstimator(KNOWN), AltitudeEstimator(KNOWN)
    for k in range(51):
        for estimator in (ours, theirs):
            estimator.update(ranged(k * 10_000_000))
            estimator.update(imu(k * 10_000_000))
    with pytest.raises(Rejected, match=reason):
        ours.update(sample)
    for estimator in (ours, theirs):
        estimator.update(ranged(510_000_000))
    (one,), (other,) = (estimator.update(imu(510_000_000)) for estimator in (ours, theirs))
    assert one.height == other.height and np.array_equal(one.cov, other.cov)


def test_range_too_late_is_rejected():
    estimator = AltitudeEstimator(KNOWN)
    for k in range(100):
        estimator.update(imu(k * 10_000_000))
    with pytest.raises(Rejected, match='too late'):
        estimator.update(ranged(500_000_000))
    assert estimator.update(ranged(900_000_000)) == []


def test_clock_set_anew_begins_anew():
    estimator = AltitudeEstimator(KNOWN)
    for k in range(100):
        estimator.update(imu(50 * NANOSECONDS + k * 10_000_000))
    for k in range(20):
        try:
            made = estimator.update(imu(k * 10_000_000))
        except Rejected:
            continue
    assert made == [] and estimator.counts['restarts'] == 1
    estimator.update(ranged(200_000_000, 30.0))
    made, = estimator.update(imu(200_000_000))
    assert made.height == pytest.approx(30.0, abs=0.1)


@pytest.mark.parametrize('ranges', [1, 50])
def test_an_imu_that_first_comes_after_the_clock_was_set_back_is_believed(ranges):
    estimator, made = AltitudeEstimator(AltitudeConfig()), []
    for k in range(ranges):
        estimator.update(ranged((3600 + k) * NANOSECONDS, 80.0))
    for k in range(200):
        made += estimator.update(imu(k * 10_000_000))
        try:
            estimator.update(ranged(k * 10_000_000, 30.0))
        except Rejected:
            pass
    assert estimator.counts['restarts'] == 1
    assert len(made) >= 195 and made[-1].height == pytest.approx(30.0, abs=0.1)


def test_a_first_range_without_a_stamp_is_not_predicted_from_for_years():
    estimator, made = AltitudeEstimator(AltitudeConfig()), []
    estimator.update(ranged(0, 80.0))
    for k in range(200):
        for sample in (ranged(10**18 + k * 10_000_000, 30.0), imu(10**18 + k * 10_000_000)):
            try:
                made += estimator.update(sample)
            except Rejected:
                pass
    assert estimator.counts['restarts'] == 1
    assert len(made) >= 180 and made[-1].height == pytest.approx(30.0, abs=0.1)


def test_clock_of_the_altimeter_alone_does_no_harm():
    ours = AltitudeEstimator(KNOWN)
    for k in range(2000):
        for sample in (ranged(3600 * NANOSECONDS + k * 10_000_000), imu(k * 10_000_000)):
            try:
                made = ours.update(sample)
            except Rejected:
                continue
    assert made[0].height == pytest.approx(45.0, abs=0.1) and made[0].cov[0, 0] > 0.5
    assert ours.counts['restarts'] == 0


def test_variance_of_the_message_wins():
    precise, coarse = AltitudeEstimator(KNOWN), AltitudeEstimator(KNOWN)
    for k in range(200):
        stamp = k * 10_000_000
        precise.update(RangeSample(stamp, '', 45.0, 0.0001))
        coarse.update(RangeSample(stamp, '', 45.0, 25.0))
        (fine,), (rough,) = precise.update(imu(stamp)), coarse.update(imu(stamp))
    assert fine.cov[0, 0] < rough.cov[0, 0]


def test_attitude_turns_the_specific_force():
    """Banked by 60 deg in a level turn of 2 g: nothing happens to the height."""
    bank = (np.sin(np.pi / 6), 0.0, 0.0, np.cos(np.pi / 6))
    estimator = AltitudeEstimator(KNOWN)
    for k in range(100):
        made, = estimator.update(imu(k * 10_000_000, 2 * G, bank))
    assert made.height == pytest.approx(45.0, abs=1e-6)
    assert made.rate == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('method', ['combined', 'predictive', 'eso', 'ekf'])
def test_reproductions_run_on_the_same_stream(method):
    run = Run(replace(FLIGHT, duration=10.0), replace(KNOWN, method=method))
    assert len(run.error) == 500
    assert np.all(np.isfinite(run.error)) and run.rms() < 12.0
    known = np.any(run.var > 0)
    assert known == (method in ('combined', 'ekf'))


def test_misfit_tells_large_and_slow_innovations_from_chance():
    rng = np.random.default_rng(4)
    fits, large, slow = Misfit(2.0), Misfit(2.0), Misfit(2.0)
    alarms = 0
    for k in range(20000):
        draw = rng.normal()
        fits.add(k * 0.01, draw)
        alarms += fits.bad
        large.add(k * 0.01, 2 * draw)
        slow.add(k * 0.01, draw + np.sin(0.005 * k))
    assert alarms == 0 and large.bad
    assert large.mean == pytest.approx(4, rel=0.3)
    assert slow.bad or abs(np.sin(0.005 * k)) < 0.6


def test_belief_starts_high_and_needs_evidence():
    """A chi-square by hand: after T seconds of mean square m the level is about 4 sqrt(m)."""
    sea = AltitudeConfig(significant_wave_height=1.88, mean_wave_period=6.8).sea()
    belief = SeaBelief(sea)
    assert belief.waves.sea.height == pytest.approx(7.5, rel=0.15)
    assert not belief.decide()
    for _ in range(50):
        belief.observe(0.01, (1.88 / 4)**2)
    assert not belief.decide()  # half a second is no evidence
    for _ in range(6000):
        belief.observe(0.01, (1.88 / 4)**2)
    assert belief.decide()
    assert belief.waves.sea.height == pytest.approx(1.88, rel=0.5)
    assert sum(belief.probabilities()) == pytest.approx(1)
    for _ in range(30000):
        belief.observe(0.01, (6.0 / 4)**2)
    assert belief.decide() and belief.waves.sea.height == pytest.approx(6.0, rel=0.4)
    fixed = SeaBelief(sea, adapt=False)
    fixed.observe(100.0, 9.0)
    assert not fixed.decide() and fixed.waves.sea == sea

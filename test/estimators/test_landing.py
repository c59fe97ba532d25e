"""The landing estimator: exact without noise, honest with it, unmoved by bad input."""

from collections import Counter
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from deck_motion_ros.estimators.landing import LandingConfig, LandingEstimator
from deck_motion_ros.samples import ImuSample, NANOSECONDS, RangeSample, Rejected, seconds
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig

INPUTS = ('ship/imu', 'uav/imu', 'uwb/range')
ARM = (-20.0, 1.0, 4.0)
TOLD = LandingConfig(deck_lever_arm=ARM)
SCENE = LandingSimulatorConfig(
    duration=30.0, seed=11, deck='pan2020', deck_lever_arm=ARM, boat_rotation=0.5,
    approach_time=8.0, hold_time=12.0, descent_time=9.0, uav_rate=50.0)
QUIET = replace(
    SCENE, white_sd=(0.0,) * 3, drift_sd=(0.0,) * 3, heading_sd=0.0, gyro_white_sd=0.0,
    gyro_drift_sd=0.0, accel_white_sd=0.0, accel_drift_sd=0.0, range_white_sd=0.0,
    uav_attitude_sd=0.0, uav_attitude_drift_sd=0.0, uav_gyro_white_sd=0.0, uav_gyro_drift_sd=0.0,
    uav_accel_white_sd=0.0, uav_accel_drift_sd=0.0)
SHIP = replace(SCENE, deck='hull', waves=50, significant_wave_height=2.0)
ZERO, LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


class Flight:
    """A landing through an estimator: times, errors and covariances of its estimates."""

    def __init__(self, scene, told=TOLD, adapt=lambda event: event):
        simulator = LandingSimulator(scene, truth=False)
        self.estimator, self.rejected = LandingEstimator(told), Counter()
        estimates = []
        for event in simulator:
            event = adapt(event) if event.topic in INPUTS else None
            if event is not None:
                try:
                    estimates += self.estimator.update(event.topic, event.sample)
                except Rejected as rejection:
                    self.rejected[rejection.reason] += 1
        self.stamps = [item.stamp for item in estimates]
        self.times = np.array([seconds(stamp) for stamp in self.stamps])
        truth, rate = simulator.scene.over_deck(self.times)
        self.error = np.array([item.position for item in estimates]) - truth
        self.rate_error = np.array([item.velocity for item in estimates]) - rate
        self.cov = np.array([item.cov for item in estimates])

    def rms(self, start, end=inf):
        part = (self.times >= start) & (self.times < end)
        return np.sqrt(np.mean(np.sum(np.square(self.error[part]), axis=1)))

    def sd(self, time):
        return np.sqrt(np.trace(self.cov[np.searchsorted(self.times, time), :3, :3]))

    def nees(self, start=2.0, end=inf):
        part = (self.times >= start) & (self.times < end)
        error = np.hstack([self.error, self.rate_error])[part]
        whole = np.linalg.solve(self.cov[part], error[..., None])[..., 0]
        return np.mean(np.sum(error * whole, axis=1)) / 6


@pytest.fixture(scope='module')
def flight():
    return Flight(SCENE)


@pytest.mark.parametrize('changes', [
    {}, {'range_spacing': 0.02}, {'deck': 'hull', 'waves': 50}, {
        'antenna_lever_arm': (0.5, 0.2, -0.6)}, {'turn_to_deg': 100.0, 'deck': 'hull', 'waves': 9,
                                                 'turn_time': 5.0}],
    ids=['at once', 'in turn', 'hull', 'antenna', 'turning ship'])
def test_exact_without_noise(changes):
    scene = replace(QUIET, **changes)
    flight = Flight(scene, replace(TOLD, antenna_lever_arm=scene.antenna_lever_arm))
    assert flight.times[0] == pytest.approx(1.0, abs=0.11)
    assert np.abs(flight.error[flight.times > 5]).max() < 0.01
    assert np.abs(flight.rate_error[flight.times > 5]).max() < 0.03
    assert flight.rejected == {}


def test_mounted_sensors_and_a_fast_gyro():
    mount = (5.0, -10.0, 30.0)
    from deck_motion_ros.geometry import conjugate, multiply, quaternion_from_rpy, rotated
    turn = quaternion_from_rpy(*np.radians(mount).tolist())

    def mounted(event):
        sample = event.sample
        if event.topic != 'uav/imu':
            return event
        return event._replace(sample=replace(
            sample, orientation=multiply(sample.orientation, turn),
            angular_velocity=rotated(conjugate(turn), sample.angular_velocity),
            specific_force=rotated(conjugate(turn), sample.specific_force)))

    flight = Flight(QUIET, replace(TOLD, uav_sensor_rpy_deg=mount), mounted)
    assert np.abs(flight.error[flight.times > 5]).max() < 0.01


def test_honest_and_as_good_as_promised():
    flights = [Flight(replace(SCENE, seed=seed)) for seed in range(6)]
    assert np.mean([flight.nees() for flight in flights]) == pytest.approx(1.0, abs=0.25)
    assert np.sqrt(np.mean([flight.rms(3.0)**2 for flight in flights])) < 0.14
    assert max(flight.rms(28.5) for flight in flights) < 0.12


def test_one_estimate_for_each_stamp_of_aircraft_and_ranges():
    flight = Flight(replace(SCENE, range_spacing=0.013))
    stamps = {event.sample.stamp for event in LandingSimulator(replace(
        SCENE, range_spacing=0.013)) if event.topic in ('uav/imu', 'uwb/range')}
    assert flight.stamps == sorted(stamp for stamp in stamps if stamp >= flight.stamps[0])


def test_without_the_aircrafts_inertial_unit():
    flight = Flight(SHIP, adapt=lambda event: None if event.topic == 'uav/imu' else event)
    assert 'no acceleration of the aircraft' in flight.estimator.accuracy()
    assert flight.rms(3.0) < 0.25
    assert flight.nees() < 1.6


def test_without_the_ship_nothing_is_said():
    estimator, rejected = LandingEstimator(TOLD), Counter()
    for event in LandingSimulator(replace(SHIP, duration=3.0), truth=False):
        if event.topic in ('uav/imu', 'uwb/range'):
            try:
                assert estimator.update(event.topic, event.sample) == []
            except Rejected as rejection:
                rejected[rejection.reason] += 1
    assert rejected == {'no ship attitude': 120}


def test_ship_attitude_alone():
    def bare(event):
        if event.topic == 'uav/imu':
            return None
        if event.topic == 'ship/imu':
            return event._replace(sample=replace(event.sample, specific_force=ZERO))
        return event

    flight = Flight(SHIP, TOLD, bare)
    assert flight.estimator.accuracy().startswith('attitude only')
    assert flight.rms(3.0) < 0.3


def test_no_estimate_while_the_ships_attitude_is_missing_and_recovery():
    flight = Flight(SCENE, adapt=lambda event: None if (
        event.topic == 'ship/imu' and 15 <= seconds(event.time) < 17) else event)
    assert not np.any((flight.times > 15.6) & (flight.times < 16.9))
    assert flight.rejected['no ship attitude'] > 40
    assert flight.rms(18.0, 20.0) < 0.25
    assert flight.nees(17.0, 22.0) < 2.0


def test_five_seconds_without_ranges():
    flights = [Flight(replace(SCENE, seed=seed, outage_start=12.0, outage_duration=5.0))
               for seed in range(4)]
    for flight in flights:
        assert flight.sd(16.9) > 3 * flight.sd(11.9)
        assert flight.sd(18.0) < 1.3 * flight.sd(11.9)
        assert flight.rms(18.0) < 0.2
    assert np.mean([flight.nees(12.0, 17.0) for flight in flights]) < 2.0


def test_nlos_and_a_lost_anchor():
    flight = Flight(replace(SCENE, nlos_share=0.1, lost_anchor='anchor_2', lost_time=10.0))
    assert flight.rms(3.0) < 0.2
    assert sum(flight.estimator.outliers.values()) == pytest.approx(100, abs=35)


@pytest.mark.parametrize('moved_by', [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)],
                         ids=['ahead', 'aside', 'down'])
def test_moved_anchor_is_named_and_the_covariance_honest(moved_by):
    late, squares = 23.0, []
    for k in range(4):
        flight = Flight(replace(SCENE, seed=40 + k, moved_anchor=f'anchor_{k + 1}',
                                moved_time=20.0, moved_by=moved_by))
        doubts = flight.estimator.doubts()
        assert max(doubts, key=doubts.get) == f'anchor_{k + 1}'
        assert flight.estimator.opened == 1
        assert flight.rms(22.0) < 0.3
        squares.append(flight.nees(late))
    assert 0.5 < np.mean(squares) < 2.0
    assert max(squares) < 4.0


def test_shaded_anchor_is_trusted_again():
    def shaded(event):
        if (event.topic != 'uwb/range' or event.sample.frame_id != 'anchor_2'
                or not 10 <= seconds(event.time) < 15):
            return event
        excess = 0.3 + rng.exponential(1.0)
        return event._replace(sample=replace(event.sample, distance=event.sample.distance
                                             + excess))

    rng = np.random.default_rng(3)
    flight = Flight(SCENE, adapt=shaded)
    assert flight.estimator.doubts() == {}
    assert flight.nees(10.0, 15.0) < 2.0
    assert flight.nees(15.0) < 2.0
    assert flight.sd(29.0) < 1.2 * Flight(SCENE).sd(29.0)


def test_no_anchor_is_named_without_reason(flight):
    assert flight.estimator.doubts() == {}


def test_when_most_ranges_contradict_the_filter_it_starts_again():
    # the aircraft is carried 30 m aside, in level axes, and no inertial unit saw it
    def carried(event):
        if event.topic != 'uwb/range' or event.time < 15 * NANOSECONDS:
            return event
        time = np.array([seconds(event.time)])
        anchor = anchors[int(event.sample.frame_id[-1]) - 1]
        return event._replace(sample=replace(event.sample, distance=float(np.linalg.norm(
            place(time)[0] - anchor))))

    def place(times):
        origin, _, turn = scene.deck(times)
        return turn.inv().apply(scene.aircraft(times).position + [30.0, 0.0, 0.0] - origin)

    simulator = LandingSimulator(SCENE)
    scene, anchors = simulator.scene, simulator.anchors
    flight = Flight(SCENE, adapt=carried)
    late = flight.times > 20
    truth, _ = scene.over_deck(flight.times)
    moved = truth + flight.error - place(flight.times)
    assert 2 <= flight.estimator.opened <= 4
    assert np.sqrt(np.mean(np.sum(np.square(moved[late]), axis=1))) < 1.5


@pytest.mark.parametrize(('sample', 'reason'), [
    (RangeSample(30 * NANOSECONDS, 'elsewhere', 5.0, 0.0), 'unknown anchor'),
    *((RangeSample(30 * NANOSECONDS, 'anchor_1', value, 0.0), 'range not above 0')
      for value in (0.0, -1.0, nan, inf)),
    (RangeSample(28 * NANOSECONDS, 'anchor_1', 5.0, 0.0), 'older stamp'),
    (RangeSample(3000 * NANOSECONDS, 'anchor_1', 5.0, 0.0), 'stamp far ahead'),
    (RangeSample(31 * NANOSECONDS, 'anchor_1', 5.0, 0.0), 'no ship attitude'),
    (ImuSample(30 * NANOSECONDS, 'uav', None, ZERO, ZERO, ZERO), 'no attitude'),
    (ImuSample(30 * NANOSECONDS, 'uav', LEVEL, ZERO, (0.0, 1e4, 0.0), ZERO),
     'implausible turn rate'),
    (ImuSample(30 * NANOSECONDS, 'uav', LEVEL, ZERO, ZERO, (0.0, -1e9, 0.0)),
     'implausible specific force')])
def test_bad_input_is_rejected_by_name(flight, sample, reason):
    topic = 'uwb/range' if isinstance(sample, RangeSample) else 'uav/imu'
    with pytest.raises(Rejected) as caught:
        flight.estimator.update(topic, sample)
    assert caught.value.reason == reason


def test_ranges_that_come_too_late():
    silent = replace(TOLD, anchor_frames=(*TOLD.anchor_frames, 'anchor_5'),
                     anchor_positions=(*TOLD.anchor_positions, 0.0, 0.0, 2.0))
    estimator = Flight(replace(SCENE, duration=5.0), silent).estimator
    with pytest.raises(Rejected, match='too late'):
        estimator.update('uwb/range', RangeSample(4 * NANOSECONDS, 'anchor_5', 5.0, 0.0))


def test_late_ranges_are_used_at_their_stamps():
    scene = replace(SCENE, seed=12)
    events = [event for event in LandingSimulator(scene, truth=False) if event.topic in INPUTS]
    late = sorted(events, key=lambda event: event.time + (
        70_000_000 if event.topic == 'uwb/range' else 0))
    results = []
    for sequence in (events, late):
        estimator, estimates = LandingEstimator(TOLD), []
        for event in sequence:
            estimates += estimator.update(event.topic, event.sample)
        results.append(estimates)
    in_time = {item.stamp: item for item in results[0]}
    gaps = [np.linalg.norm(item.position - in_time[item.stamp].position)
            for item in results[1] if item.stamp > 5 * NANOSECONDS]
    assert np.sqrt(np.mean(np.square(gaps))) < 0.05


def test_clock_set_back_starts_anew():
    def set_back(event):
        if event.time < 15 * NANOSECONDS:
            return event
        stamp = event.sample.stamp - 3600 * NANOSECONDS
        return event._replace(sample=replace(event.sample, stamp=stamp))

    events = [set_back(event) for event in LandingSimulator(SCENE, truth=False)
              if event.topic in INPUTS]
    estimator, estimates, rejected = LandingEstimator(TOLD), [], Counter()
    for event in events:
        try:
            estimates += estimator.update(event.topic, event.sample)
        except Rejected as rejection:
            rejected[rejection.reason] += 1
    assert estimator.restarts == 1
    assert sum(rejected.values()) < 60
    assert estimates[-1].stamp == pytest.approx((30 - 3600) * NANOSECONDS, abs=NANOSECONDS / 10)
    assert np.sqrt(np.trace(estimates[-1].cov[:3, :3])) < 0.3


def jolted(topic, field, axis, size, seconds_long):
    """Fly while a sensor errs from second 10 on."""
    def adapt(event):
        if event.topic != topic or not 10 <= seconds(event.time) < 10 + seconds_long:
            return event
        values = [*getattr(event.sample, field)]
        values[axis] += size
        return event._replace(sample=replace(event.sample, **{field: tuple(values)}))

    flight = Flight(SHIP, adapt=adapt)
    return flight.times, np.abs(flight.error).max(axis=1), flight


@pytest.mark.parametrize('topic, worst', [('uav/imu', 0.6), ('ship/imu', 2.0)])
def test_a_gyro_that_the_attitude_contradicts_does_not_move_the_aircraft(topic, worst):
    times, error, _ = jolted(topic, 'angular_velocity', 0, 1.0, 0.3)
    assert error[times > 10].max() < worst
    assert error[times > 12].max() < 0.6


def test_where_most_anchors_are_in_doubt_the_motion_was_wrong():
    """A jolt of the ship's accelerometer, not three radios that were moved at once."""
    times, error, flight = jolted('ship/imu', 'specific_force', 1, 20.0, 0.1)
    assert flight.estimator.opened == 2
    assert error[times > 27].max() < 0.3


@pytest.mark.parametrize('before', [
    {'ship/imu'}, {'uav/imu'}, {'ship/imu', 'uav/imu'}, {'anchor_1'}])
def test_topics_that_first_come_after_the_clock_was_set_back_are_believed(before):
    """Whatever has spoken before is silent from then on; the deck does not move."""
    after = {'uav/imu', *TOLD.anchor_frames} - before
    estimator, estimates = LandingEstimator(replace(TOLD, deck_static=True)), []
    for event in LandingSimulator(replace(SCENE, duration=25.0), truth=False):
        source = event.sample.frame_id if event.topic == 'uwb/range' else event.topic
        early = event.time < 2 * NANOSECONDS
        if source in (before if early else after):
            sample = replace(event.sample, stamp=event.sample.stamp + early * 10**12)
            try:
                estimates += estimator.update(event.topic, sample)
            except Rejected:
                pass
    assert estimator.restarts == 1
    assert 1 < len({item.stamp for item in estimates if item.stamp > 15 * NANOSECONDS})


def test_static_deck_needs_ranges_only():
    rng = np.random.default_rng(1)
    config = LandingConfig(deck_static=True)
    estimator, errors = LandingEstimator(config), []
    for k in range(600):
        stamp = k * 25_000_000
        position = np.array([4 - 0.1 * k / 40, 2.0, 8.0])
        anchor = k % 4
        distance = np.linalg.norm(position - config.points()[anchor]) + 0.05 * rng.normal()
        errors += [item.position - position for item in estimator.update(
            'uwb/range', RangeSample(stamp, f'anchor_{anchor + 1}', distance, 0.0))]
    assert len(errors) == 560
    assert np.sqrt(np.mean(np.square(errors[100:]))) < 0.2
    assert estimator.dilution(position)[0] == pytest.approx(8 / (2 * 1.5), abs=0.2)


def test_variance_of_the_message_wins():
    def first(var):
        estimator, estimates = LandingEstimator(LandingConfig(deck_static=True)), []
        for k in range(60):
            distance = np.linalg.norm(np.array([0, 0, 8.0]) - estimator.config.points()[k % 4])
            estimates += estimator.update('uwb/range', RangeSample(
                k * 25_000_000, f'anchor_{k % 4 + 1}', distance, var))
        return estimates[-1]
    assert first(0.25).cov[0, 0] > 5 * first(0.0).cov[0, 0]
    assert first(0.0025).cov == pytest.approx(first(0.0).cov)


def test_method_paper_follows_on_a_still_deck():
    scene = replace(SCENE, boat_rotation=0.0, uav_rate=0.0, range_rate=20.0)
    flight = Flight(scene, replace(TOLD, method='paper'))
    assert flight.estimator.accuracy() == 'ranges alone'
    assert flight.rms(2.0) < 0.4


@pytest.mark.parametrize(('changes', 'words'), [
    ({'anchor_positions': (1.0,)}, 'anchor_positions'),
    ({'anchor_frames': ('a', 'a', 'b', 'c')}, 'twice'),
    ({'anchor_frames': ('a', 'b'), 'anchor_positions': (0.0,) * 6}, '3 anchors'),
    ({'anchor_positions': (0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0)}, 'line'),
    ({'anchor_positions': (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0),
      'method': 'paper'}, 'one plane')])
def test_anchors_that_cannot_work_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        LandingEstimator(replace(TOLD, **changes))


def test_three_anchors_in_a_plane_work_from_above():
    three = replace(TOLD, anchor_frames=TOLD.anchor_frames[:3],
                    anchor_positions=TOLD.anchor_positions[:9])
    assert three.is_flat()
    flight = Flight(replace(SCENE, lost_anchor='anchor_4', lost_time=0.0), three)
    assert flight.rms(3.0) < 0.3

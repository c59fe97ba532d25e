"""The aligner on streams: joining, phases, honest refusals."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros.estimators.alignment import Aligner, AlignmentConfig, ARCMIN
from deck_motion_ros.geometry import matrix_from_quaternion, rotation_matrix
from deck_motion_ros.samples import Rejected
from deck_motion_ros.simulation.catapult import CatapultSimulator, CatapultSimulatorConfig

START = 1_793_491_200_000_000_000
LAUNCH = CatapultSimulatorConfig(deck='steady', hold=2.0, duration=5.3, vibration=20.0, seed=3,
                                 rate=50.0)
CONFIG = AlignmentConfig(misalignment_sd_arcmin=(15.0, 10.0, 30.0))


class Fed:
    """What an aligner made of a launch."""

    def __init__(self, config, events):
        self.aligner, self.estimates, self.rejected = Aligner(config), [], Counter()
        for _, topic, sample in events:
            if topic == 'alignment/truth':
                self.truth = np.array(sample.vector)
                continue
            try:
                self.estimates += self.aligner.update(topic, sample)
            except Rejected as rejection:
                self.rejected[f'{topic}: {rejection.reason}'] += 1

    @property
    def error(self):
        """Of the last misalignment, in its sd."""
        last = self.estimates[-1]
        return (last.misalignment - self.truth) / np.sqrt(np.diagonal(last.misalignment_cov))

    @property
    def sd(self):
        return np.sqrt(np.diagonal(self.estimates[-1].misalignment_cov)) / ARCMIN


def events(config=LAUNCH):
    return list(CatapultSimulator(config, START))


def changed(found, topic, change):
    """Let ``change(index within the topic, sample)`` give the samples instead."""
    counts = Counter()
    out = []
    for event in found:
        if event.topic != topic:
            out.append(event)
            continue
        out += [event._replace(sample=sample)
                for sample in change(counts[topic], event.sample)]
        counts[topic] += 1
    return out


@pytest.fixture(scope='module')
def launch():
    return events()


@pytest.fixture(scope='module')
def usual(launch):
    return Fed(CONFIG, launch)


def test_a_launch_is_aligned_and_its_phases_are_known(usual):
    assert usual.aligner.phase == 'done' and not usual.rejected
    assert np.max(np.abs(usual.error)) < 3.5
    assert usual.sd[1] < 0.6 and usual.sd[0] < 1.3
    assert usual.aligner.window == pytest.approx(2.0) and usual.aligner.stroke == pytest.approx(
        3.0, abs=0.03)
    assert usual.estimates[0].stamp == START
    assert abs(usual.aligner.skew) < 0.005
    assert usual.aligner.jitter == pytest.approx(0.0, abs=1e-6)


def test_the_attitude_is_the_masters_turned_by_the_misalignment(usual, launch):
    last = usual.estimates[-1]
    master = [event.sample for event in launch
              if event.topic == 'master/imu' and event.time == last.stamp]
    mat = matrix_from_quaternion(master[0].orientation) @ rotation_matrix(usual.truth)
    np.testing.assert_allclose(matrix_from_quaternion(last.orientation), mat, atol=2 * ARCMIN)


def test_the_order_across_topics_does_not_matter(usual, launch):
    """Streams late by up to a fifth of a second give the same numbers."""
    late = {'slave/imu': 0, 'master/imu': 40_000_000, 'master/velocity': 200_000_000,
            'ldv/velocity': 30_000_000}
    mixed = sorted(launch, key=lambda event: event.time + late.get(event.topic, 0))
    other = Fed(CONFIG, mixed)
    assert len(other.estimates) == len(usual.estimates)
    np.testing.assert_array_equal([item.misalignment for item in other.estimates],
                                  [item.misalignment for item in usual.estimates])


@pytest.mark.parametrize('change', [
    {'rate': 200.0, 'ldv_every': 4, 'master_every': 10}, {'rate': 40.0, 'ldv_every': 4},
    {'deck': 'sea', 'hull': 'patrol', 'lever_arm': (10.0, 4.0, 3.0)},
    {'track_rpy_deg': (0.0, 1.0, 8.0)}, {'skew': 0.005, 'ldv_dropout': (0.5, 0.8)}])
def test_rates_seas_and_tracks(change):
    told = {name: value for name, value in change.items()
            if name in ('lever_arm', 'track_rpy_deg')}
    fed = Fed(replace(CONFIG, **told), events(replace(LAUNCH, **change)))
    assert np.max(np.abs(fed.error)) < 3.5
    assert fed.aligner.surprise < 1.6 and fed.aligner.phase == 'done'


def test_interpolated_masters_agree_with_exact_ones():
    """On a rolling ship, half the master's samples gone."""
    rolling = replace(LAUNCH, deck_roll_deg=3.0, deck_roll_period=12.0, lever_arm=(0.0, 15.0, 3.0),
                      track_lateral_sd=1e-3, track_vertical_sd=1e-3)
    config = replace(CONFIG, lever_arm=(0.0, 15.0, 3.0))
    exact, interpolated = Fed(config, events(rolling)), Fed(
        config, events(replace(rolling, master_every=2)))
    difference = exact.estimates[-1].misalignment - interpolated.estimates[-2].misalignment
    assert np.max(np.abs(difference)) < 0.5 * ARCMIN


def test_without_a_window_the_worst_direction_is_named():
    fed = Fed(CONFIG, events(replace(LAUNCH, hold=0.0, duration=3.3)))
    direction, sd = fed.aligner.least_observable()
    assert np.degrees(np.arccos(abs(direction @ [2, 0, 1]) / np.sqrt(5))) < 3.0
    assert sd / ARCMIN == pytest.approx(np.hypot(14.5, 7.3), rel=0.1)
    assert fed.aligner.window == 0.0


def test_a_mounted_slave_is_turned_back(launch):
    """A unit turned by 90 deg about up, and told so, gives the same alignment."""
    def turn(_, sample):
        def turned(vec):
            return (vec[1], -vec[0], vec[2])
        return [replace(sample, specific_force=turned(sample.specific_force),
                        angular_velocity=turned(sample.angular_velocity))]

    mounted = Fed(replace(CONFIG, slave_sensor_rpy_deg=(0.0, 0.0, 90.0)),
                  changed(launch, 'slave/imu', turn))
    assert np.max(np.abs(mounted.error)) < 3.5


def test_kalman_and_paper_are_what_their_names_say(launch):
    quiet = events(replace(LAUNCH, vibration=0.0))
    for method in ('kalman', 'paper'):
        fed = Fed(replace(CONFIG, method=method), quiet)
        error = (fed.estimates[-1].misalignment - fed.truth) / ARCMIN
        assert np.max(np.abs(error)) < 4.0
    assert fed.sd[1] < 0.2  # without bias states it believes too much


def test_fading_of_the_attitude_is_refused():
    with pytest.raises(ValueError, match='fading_weights.*not observable'):
        AlignmentConfig(method='paper', fading_weights=(1.0,) * 6)


def test_one_clock_seconds_off_is_refused(launch):
    for offset in (5_000_000_000, -5_000_000_000):
        moved = [event._replace(sample=replace(event.sample, stamp=event.sample.stamp + offset))
                 if event.topic.startswith('master') else event for event in launch]
        fed = Fed(CONFIG, moved)
        assert not fed.estimates
        assert f'master/imu {offset / 1e9:+.1f} s' in fed.aligner.refused


def test_a_missing_master_gives_nothing_and_a_missing_velocimeter_something(launch, usual):
    for missing in ('master/imu', 'master/velocity'):
        fed = Fed(CONFIG, [event for event in launch if event.topic != missing])
        assert not fed.estimates and fed.aligner.dropped > 100
    blind = Fed(CONFIG, [event for event in launch if event.topic != 'ldv/velocity'])
    assert np.max(np.abs(blind.error)) < 3.5
    assert np.max(blind.sd) > np.max(usual.sd)


def test_a_master_that_falls_silent_is_carried_over(launch):
    silent = [event for event in launch if not (
        event.topic.startswith('master') and 0.5e9 < event.time - START < 1.4e9)]
    gone = Fed(CONFIG, silent)
    assert np.max(np.abs(gone.error)) < 3.5
    longer = [event for event in launch if not (
        event.topic.startswith('master') and 0.2e9 < event.time - START < 1.9e9)]
    fed = Fed(CONFIG, longer)
    assert fed.aligner.dropped > 20 and np.max(np.abs(fed.error)) < 3.5


def test_duplicates_and_reordered_stamps_are_counted_and_change_nothing(launch, usual):
    for topic in ('slave/imu', 'master/imu', 'master/velocity', 'ldv/velocity'):
        seen = []

        def again(k, sample, seen=seen):
            seen.append(sample)
            return [sample, sample] if k % 50 == 10 else [
                sample, seen[-5]] if k % 50 == 20 else [sample]

        fed = Fed(CONFIG, changed(launch, topic, again))
        assert fed.rejected[f'{topic}: duplicate stamp'] >= 3
        assert fed.rejected[f'{topic}: older stamp'] >= 3
        np.testing.assert_array_equal(fed.estimates[-1].misalignment,
                                      usual.estimates[-1].misalignment)


def test_lost_samples_of_the_slave_are_gaps_and_honest(launch):
    lossy = changed(launch, 'slave/imu',
                    lambda k, sample: [] if k % 40 == 25 else [sample])
    fed = Fed(CONFIG, lossy)
    assert fed.aligner.gaps == 6
    assert np.max(np.abs(fed.error)) < 3.5


def test_saturation_is_counted_and_honest():
    """What a clipped launch adds to the velocity is not believed."""
    def clip(_, sample):
        return [replace(sample, specific_force=tuple(
            np.clip(sample.specific_force, -25.0, 25.0).tolist()))]

    clipped = Fed(replace(CONFIG, accel_range=25.0), changed(
        events(replace(LAUNCH, vibration=40.0, sampling='points')), 'slave/imu', clip))
    assert clipped.aligner.saturated > 2
    assert np.max(np.abs(clipped.error)) < 4.0


def test_a_wrong_latitude_is_seen_in_the_bias(launch, usual):
    wrong = Fed(replace(CONFIG, latitude_deg=60.0), launch)
    assert wrong.aligner.bias_excess() > 4.0 > usual.aligner.bias_excess()


def test_an_aborted_launch_is_reported_and_the_next_begins_anew():
    fed = Fed(CONFIG, events(replace(LAUNCH, abort_after=1.0, duration=7.0)))
    assert fed.aligner.aborts == 1 and fed.aligner.restarts == 1
    assert fed.aligner.phase == 'hold'


def test_a_second_launch_has_an_alignment_of_its_own(launch):
    later = 10_000_000_000
    second = [event._replace(time=event.time + later, sample=replace(
        event.sample, stamp=event.sample.stamp + later)) for event in launch]
    fed = Fed(CONFIG, launch + second)
    assert fed.aligner.restarts == 1 and fed.aligner.phase == 'done'
    assert np.max(np.abs(fed.error)) < 3.5


def test_nothing_comes_out_after_the_stroke():
    fed = Fed(CONFIG, events(replace(LAUNCH, duration=8.0)))
    assert fed.estimates[-1].stamp - START <= 5_000_000_001


def test_a_velocimeter_out_of_the_question_is_left_out_and_believed_again_in_the_end(launch):
    zeroed = changed(launch, 'ldv/velocity', lambda k, sample: [
        replace(sample, velocity=(0.0,) * 3) if 150 <= k < 160 else sample])
    fed = Fed(CONFIG, zeroed)
    assert fed.aligner.jumps == 10 and np.max(np.abs(fed.error)) < 3.5
    offset = changed(launch, 'ldv/velocity', lambda k, sample: [
        replace(sample, velocity=(sample.velocity[0] + 8.0 * (k >= 50), 0.0, 0.0))])
    stubborn = Fed(CONFIG, offset)
    assert 10 <= stubborn.aligner.jumps < 30


@pytest.mark.parametrize('topic, change, reason', [
    ('master/imu', {'orientation': None}, 'no attitude'),
    ('master/imu', {'angular_velocity': (0.0, 99.0, 0.0)}, 'implausible turn rate'),
    ('slave/imu', {'specific_force': (0.0, 0.0, 0.0)}, 'no specific force'),
    ('slave/imu', {'specific_force': (0.0, 0.0, 9e4)}, 'implausible specific force'),
    ('master/velocity', {'velocity': (0.0, 999.0, 0.0)}, 'implausible velocity'),
    ('ldv/velocity', {'velocity': (999.0, 0.0, 0.0)}, 'implausible velocity')])
def test_samples_that_cannot_be_are_rejected(launch, topic, change, reason):
    sample = next(event.sample for event in launch if event.topic == topic)
    with pytest.raises(Rejected, match=reason):
        Aligner(CONFIG).update(topic, replace(sample, **change))


def test_a_variance_below_0_is_unknown(usual, launch):
    strange = changed(launch, 'master/imu', lambda k, sample: [
        replace(sample, attitude_var=(0.0, -1.0, 0.0))])
    np.testing.assert_array_equal(Fed(CONFIG, strange).estimates[-1].misalignment_cov,
                                  usual.estimates[-1].misalignment_cov)


def test_a_velocimeter_that_comes_too_late_is_counted(launch):
    late = sorted(launch, key=lambda event: event.time + 150_000_000 * (
        event.topic == 'ldv/velocity'))
    fed = Fed(CONFIG, late)
    assert fed.rejected['ldv/velocity: too late'] > 100
    assert np.max(np.abs(fed.error)) < 3.5


def test_a_clock_set_anew_begins_a_new_alignment(launch):
    back = [event._replace(sample=replace(event.sample, stamp=event.sample.stamp - 3600 * 10**9))
            for event in launch]
    fed = Fed(CONFIG, launch + back)
    assert fed.aligner.restarts >= 1
    assert fed.estimates[-1].stamp < START

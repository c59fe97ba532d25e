"""The join of the predictor's inputs: which outputs there are, when, and from what."""

from dataclasses import replace
from itertools import permutations
from math import cos, inf, nan, sin

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.geometry import quaternion_from_rpy
from deck_motion_ros.samples import (
    HeaveSample,
    ImuSample,
    NANOSECONDS,
    OdometrySample,
    Rejected,
    seconds,
)

HOUR = 3600 * NANOSECONDS
MS = NANOSECONDS // 1000
IMU, HEAVE, ODOMETRY = 'imu', 'heave', 'odometry'


def sample(kind, stamp):
    """Make a sample of a ship that swings; the same motion on every topic."""
    t = seconds(stamp % (1000 * NANOSECONDS))
    attitude = quaternion_from_rpy(0.05 * sin(0.5 * t), 0.02 * cos(0.6 * t), 1.0)
    height = 0.8 * sin(0.62 * t)
    if kind == HEAVE:
        return HeaveSample(stamp, 'ship_level', height)
    zero = (0.0, 0.0, 0.0)
    if kind == IMU:
        return ImuSample(stamp, 'ship_base_link', attitude, zero, zero, zero)
    return OdometrySample(stamp, 'ship_level', 'ship_base_link', (0.0, 0.0, height), attitude,
                          zero, zero, (0.0,) * 6)


def fed(messages, predictor=None, **config):
    """Feed (kind, stamp) pairs; return per message its outputs or the reason it was rejected."""
    predictor = predictor or TouchdownPredictor(PredictorConfig(**config))
    answers = []
    for kind, stamp in messages:
        try:
            answers.append([(made.issued_at, made.height) for made in
                            predictor.update(sample(kind, stamp))])
        except Rejected as rejection:
            answers.append(rejection.reason)
    return answers


def outputs(answers):
    """Flatten the outputs of :func:`fed`."""
    return [made for answer in answers if isinstance(answer, list) for made in answer]


def stamps(answers):
    """Stamps of the outputs of :func:`fed`."""
    return [stamp for stamp, _ in outputs(answers)]


def grid(kinds, rate, count, start=0):
    """List messages of one stamp after the other, in the order of ``kinds`` within a stamp."""
    return [(kind, start + round(k * NANOSECONDS / rate)) for k in range(count) for kind in kinds]


def test_an_output_needs_both_of_one_stamp():
    answers = fed(grid([IMU, HEAVE], 10, 5))
    assert [len(answer) for answer in answers] == [0, 1] * 5
    assert stamps(answers) == [k * 100 * MS for k in range(5)]


def test_order_of_arrival_within_a_stamp_changes_nothing():
    forward = outputs(fed(grid([IMU, HEAVE], 10, 600)))
    assert len(forward) == 600
    assert outputs(fed(grid([HEAVE, IMU], 10, 600))) == forward
    rng = np.random.default_rng(1)
    mixed = [message for k in range(600) for message in grid(
        rng.permutation([IMU, HEAVE]).tolist(), 10, 1, k * 100 * MS)]
    assert outputs(fed(mixed)) == forward


@given(st.lists(st.sampled_from(['b', 'bb', 'ib', 'hb', 'iib', 'hhb', 'ihb', 'iiiiib']),
                max_size=40).map(lambda parts: 'bb' + ''.join(parts)),
       st.integers(0, 2**32), st.sampled_from([1.0, 10.0, 50.0]))
def test_dropped_messages_do_not_make_order_matter(pattern, seed, rate):
    """Each stamp has both messages (b) or lost one; one of the two orders swaps some stamps."""
    kinds = {'b': [IMU, HEAVE], 'i': [IMU], 'h': [HEAVE]}
    swaps = np.random.default_rng(seed).integers(0, 2, len(pattern))
    straight, swapped = [], []
    for k, (what, swap) in enumerate(zip(pattern, swaps, strict=True)):
        group = grid(kinds[what], 1, 1, round(k * NANOSECONDS / rate))
        straight += group
        swapped += group[::-1] if swap else group
    one, other = (outputs(fed(messages, output_rate=1000.0)) for messages in (straight, swapped))
    assert one == other
    assert [stamp for stamp, _ in one] == sorted({stamp for _, stamp in straight})


@pytest.mark.parametrize('fast, slow, output_rate', [
    (100, 10, 10), (100, 10, 100), (200, 10, 200), (500, 10, 500), (100, 1, 10), (100, 1, 100),
    (50, 1, 20), (25, 5, 25)])
@pytest.mark.parametrize('fast_kind', [IMU, HEAVE])
def test_streams_of_two_rates_share_the_slow_ones_stamps(fast, slow, output_rate, fast_kind):
    slow_kind = HEAVE if fast_kind == IMU else IMU
    shared = [], []
    for k in range(4 * fast):
        stamp = round(k * NANOSECONDS / fast)
        group = [(fast_kind, stamp)] + [(slow_kind, stamp)] * (k % (fast // slow) == 0)
        shared[0].extend(group)
        shared[1].extend(group[::-1])
    one, other = (fed(messages, output_rate=float(output_rate)) for messages in shared)
    assert outputs(one) == outputs(other)
    assert len(outputs(one)) >= 4 * min(output_rate, fast) - 1
    assert len(set(stamps(one))) == len(stamps(one))


@pytest.mark.parametrize('kind', [IMU, HEAVE])
def test_one_stream_alone_waits_once(kind):
    answers = fed(grid([kind], 10, 50))
    assert answers[0] == []
    assert [stamp for stamp, _ in answers[1]] == [0, 100 * MS]
    assert all(len(answer) == 1 for answer in answers[2:])


def test_odometry_alone_never_waits():
    answers = fed(grid([ODOMETRY], 10, 50))
    assert all(len(answer) == 1 for answer in answers)


def test_odometry_is_imu_and_heave_in_one():
    apart = outputs(fed(grid([IMU, HEAVE], 10, 900)))
    together = outputs(fed(grid([ODOMETRY], 10, 900)))
    assert together == apart


@pytest.mark.parametrize('offset', [1, 20, 50, 80])
def test_interleaved_streams_do_not_wait(offset):
    """Never a shared stamp: after the first output every one comes with its own message."""
    messages = sorted(grid([IMU], 10, 100) + grid([HEAVE], 10, 100, offset * MS),
                      key=lambda message: message[1])
    answers = fed(messages, output_rate=1000.0)
    for (_, stamp), answer in list(zip(messages, answers, strict=True))[2:]:
        assert [made for made, _ in answer] == [stamp]


def test_a_stream_that_dies_is_not_waited_for_for_ever():
    both = grid([IMU, HEAVE], 10, 50)
    alone = grid([IMU], 10, 100, 5 * NANOSECONDS)
    answers = fed(both + alone)[len(both):]
    assert all(answer and answer[-1][0] == stamp
               for (_, stamp), answer in list(zip(alone, answers, strict=True))[20:])
    assert len(outputs(answers)) == len(alone)


def test_a_stream_that_comes_back_is_joined_again():
    messages = grid([IMU, HEAVE], 10, 50) + grid([IMU], 10, 100, 5 * NANOSECONDS)
    again = grid([IMU, HEAVE], 10, 50, 15 * NANOSECONDS)
    answers = fed(messages + again)[len(messages):]
    assert [len(answer) for answer in answers[2:]] == [0, 1] * 49


def test_heave_that_starts_late_is_joined():
    messages = grid([IMU], 10, 30)
    both = grid([HEAVE, IMU], 10, 30, 3 * NANOSECONDS)
    answers = fed(messages + both)
    assert stamps(answers) == [k * 100 * MS for k in range(60)]
    assert [len(answer) for answer in answers[32:]] == [0, 1] * 29


def test_a_message_that_comes_late_but_in_its_own_order_counts():
    """Heave with 0.25 s of transport behind the attitude changes what comes after it."""
    messages = sorted([(stamp, 0, IMU, stamp) for _, stamp in grid([IMU], 10, 200)]
                      + [(stamp + 250 * MS, 1, HEAVE, stamp)
                         for _, stamp in grid([HEAVE], 10, 200)])
    late = fed([(kind, stamp) for _, _, kind, stamp in messages])
    alone = fed(grid([IMU], 10, 200))
    assert not any(isinstance(answer, str) for answer in late)
    assert sorted(set(stamps(late))) == stamps(late)
    assert len(outputs(late)) == 200
    assert all(abs(a[1] - b[1]) > 1e-9 for a, b in zip(
        outputs(late)[10:], outputs(alone)[10:], strict=True))


@given(st.lists(st.tuples(st.sampled_from([IMU, HEAVE, ODOMETRY]),
                          st.integers(0, 40).map(lambda k: k * 50 * MS)), max_size=60),
       st.sampled_from([1.0, 10.0, 100.0]))
def test_whatever_comes_no_stamp_has_two_outputs_and_they_rise(messages, rate):
    made = stamps(fed(messages, output_rate=rate))
    assert all(a < b for a, b in zip(made, made[1:], strict=False))
    assert set(made) <= {stamp for _, stamp in messages}


@pytest.mark.parametrize('rate, expected', [(1, 60), (10, 600), (12.5, 600), (100, 600)])
def test_ten_outputs_per_second_of_stamp_time(rate, expected):
    answers = fed(grid([IMU, HEAVE], rate, round(60 * rate)))
    assert len(outputs(answers)) == pytest.approx(expected, abs=1)


def test_valid_at_is_the_newest_stamp_and_the_horizon():
    for horizon in (0.1, 3.0, 10.0):
        predictor = TouchdownPredictor(PredictorConfig(horizon=horizon))
        for kind, stamp in grid([IMU, HEAVE], 10, 20, 1_406_851_200_170_000_001):
            for made in predictor.update(sample(kind, stamp)):
                assert made.issued_at == stamp
                assert made.valid_at == stamp + round(horizon * 1000) * MS
                assert made.pose().valid_at == made.valid_at
                assert made.forecast().issued_at == stamp


def test_older_and_equal_stamps_are_rejected_and_change_nothing():
    messages = grid([IMU, HEAVE], 10, 100)
    bad = fed(messages[:120] + [(IMU, 0), (HEAVE, 0), messages[119], messages[118]]
              + messages[120:])
    assert bad[120:124] == ['older stamp', 'older stamp', 'duplicate stamp', 'duplicate stamp']
    assert outputs(bad) == outputs(fed(messages))


@pytest.mark.parametrize('kind', [IMU, HEAVE])
@pytest.mark.parametrize('jump', [HOUR, -HOUR])
def test_a_single_message_an_hour_off_changes_nothing(kind, jump):
    messages = grid([IMU, HEAVE], 10, 100)
    answers = fed(messages[:100] + [(kind, 5 * NANOSECONDS + jump)] + messages[100:])
    assert isinstance(answers[100], str)
    assert outputs(answers) == outputs(fed(messages))


@pytest.mark.parametrize('kind, other', [(IMU, HEAVE), (HEAVE, IMU)])
def test_a_first_message_an_hour_ahead_does_not_silence_the_other_topic(kind, other):
    """The gate of its own topic does not know it for wild, the other topic does."""
    messages = grid([kind], 10, 100)
    answers = fed(messages[:50] + [(other, HOUR)] + messages[50:])
    assert answers[50] == 'stamp far ahead'
    assert len(outputs(answers)) == 100


@pytest.mark.parametrize('jump', [HOUR, -HOUR, 24 * HOUR])
@pytest.mark.parametrize('kinds', [[IMU, HEAVE], [HEAVE, IMU], [ODOMETRY], [IMU]])
def test_a_clock_set_anew_for_good_is_followed(jump, kinds):
    before, after = grid(kinds, 10, 100), grid(kinds, 10, 300, 10 * NANOSECONDS + jump)
    predictor = TouchdownPredictor(PredictorConfig())
    answers = fed(before + after, predictor)
    lost = [answer for answer in answers[len(before):] if isinstance(answer, str)]
    assert 0 < len(lost) <= 10 * len(kinds)
    assert predictor.restarts == 1
    tail = stamps(answers[-200:])
    assert len(tail) >= 95 and tail[-1] == after[-1][1]


@pytest.mark.parametrize('before, after', [
    ([ODOMETRY], [IMU]), ([ODOMETRY], [IMU, HEAVE]), ([HEAVE], [IMU]), ([IMU], [HEAVE])])
@pytest.mark.parametrize('jump', [30 * NANOSECONDS, HOUR])
def test_a_topic_that_first_comes_after_the_clock_was_set_back_is_believed(before, after, jump):
    """Its own gate knows no older stamp: that nothing newer comes any more is what tells."""
    predictor = TouchdownPredictor(PredictorConfig())
    answers = fed(grid(before, 10, 400, jump) + grid(after, 10, 300), predictor)
    assert predictor.restarts == 1
    assert len(set(stamps(answers[400:]))) >= 195


def test_a_topic_that_lags_is_no_clock_set_back():
    predictor = TouchdownPredictor(PredictorConfig())
    messages = [(kind, round(k * NANOSECONDS / 100) + lag) for k in range(6000)
                for kind, every, lag in ((HEAVE, 100, 0), (IMU, 1, -2 * NANOSECONDS))
                if k % every == 0]
    fed(messages, predictor)
    assert predictor.restarts == 0


def test_a_gap_of_half_a_minute_is_no_restart():
    predictor = TouchdownPredictor(PredictorConfig())
    messages = grid([IMU, HEAVE], 10, 100) + grid([IMU, HEAVE], 10, 100, 40 * NANOSECONDS)
    answers = fed(messages, predictor)
    assert predictor.restarts == 0
    assert len(outputs(answers)) == 200


@pytest.mark.parametrize('bad, reason', [
    ({'orientation': None}, 'no attitude'), ({'height': 1e6}, 'implausible heave'),
    ({'height': nan}, 'implausible heave'), ({'height': -inf}, 'implausible heave')])
def test_content_that_cannot_be_used_changes_nothing(bad, reason):
    predictor, other = (TouchdownPredictor(PredictorConfig()) for _ in range(2))
    for k, message in enumerate(grid([IMU, HEAVE], 10, 100)):
        good = sample(*message)
        if k > 10 and all(hasattr(good, name) for name in bad):
            with pytest.raises(Rejected, match=reason):
                predictor.update(replace(good, stamp=good.stamp, **bad))
        one, two = predictor.update(good), other.update(good)
        assert [made.height for made in one] == [made.height for made in two]


@settings(max_examples=30)
@given(st.integers(0, 2**40), st.permutations(range(2)))
def test_numbers_do_not_depend_on_the_date(start, order):
    """Times are counted from the first stamp, whichever message it came with."""
    kinds = [(IMU, HEAVE)[k] for k in order]
    shifted = outputs(fed([(kind, stamp - stamp % 1000 + start * 1000 * NANOSECONDS)
                           for kind, stamp in grid(kinds, 10, 60)]))
    expected = outputs(fed(grid([IMU, HEAVE], 10, 60)))
    assert [height for _, height in shifted] == [height for _, height in expected]


def test_three_topics_of_one_stamp_in_any_order_do_not_fail():
    for order in permutations([IMU, HEAVE, ODOMETRY]):
        answers = fed(grid(order, 10, 30))
        assert stamps(answers) == [k * 100 * MS for k in range(30)]

"""The gate for stamps and the schedule of outputs, on stamps worked out by hand."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from deck_motion_ros.samples import NANOSECONDS, nanoseconds, Rejected, seconds
from deck_motion_ros.streams import OutputSchedule, Rewind, StampGate

HOUR = 3600 * NANOSECONDS


def admitted(gate, stamps):
    """Offer stamps; return for each True (restart), False (admitted) or the reason."""
    answers = []
    for stamp in stamps:
        try:
            answers.append(gate.admit(stamp))
        except Rejected as rejection:
            answers.append(rejection.reason)
    return answers


def taken(rate, stamps):
    """Offer stamps to a schedule and return those at which it gives an output."""
    schedule, outputs = OutputSchedule(rate), []
    for stamp in stamps:
        if schedule.is_due(stamp):
            schedule.take(stamp)
            outputs.append(stamp)
    return outputs


def test_order_duplicates_and_age():
    assert admitted(StampGate(), [10, 20, 20, 15, 10, 21]) == [
        False, False, 'duplicate stamp', 'older stamp', 'older stamp', False]


@given(st.lists(st.integers(-10**18, 10**18), max_size=60))
def test_what_is_admitted_rises_between_restarts(stamps):
    gate, newest = StampGate(), None
    for stamp in stamps:
        answer, = admitted(gate, [stamp])
        if answer is False:
            assert newest is None or newest < stamp <= newest + 600 * NANOSECONDS
        if answer in (True, False):
            newest = stamp
        assert gate.newest == newest


@pytest.mark.parametrize('jump, reason', [(HOUR, 'stamp far ahead'), (-HOUR, 'older stamp')])
def test_one_wild_stamp_changes_nothing(jump, reason):
    gate = StampGate()
    stamps = [k * NANOSECONDS for k in range(20)]
    answers = admitted(gate, [*stamps[:10], stamps[9] + jump, *stamps[10:]])
    assert answers == [False] * 10 + [reason] + [False] * 10


@pytest.mark.parametrize('jump', [HOUR, -HOUR])
def test_a_clock_set_anew_is_believed_after_ten(jump):
    gate = StampGate()
    before = [k * NANOSECONDS for k in range(5)]
    after = [jump + k * NANOSECONDS for k in range(5, 20)]
    answers = admitted(gate, before + after)
    assert answers[:5] == [False] * 5
    assert set(answers[5:14]) == {'stamp far ahead' if jump > 0 else 'older stamp'}
    assert answers[14] is True
    assert answers[15:] == [False] * 5


def test_wild_stamps_that_do_not_run_on_are_never_believed():
    gate = StampGate()
    gate.admit(0)
    falling = [2 * HOUR - k * NANOSECONDS for k in range(50)]
    assert set(admitted(gate, falling)) == {'stamp far ahead'}
    assert gate.admit(NANOSECONDS) is False


def test_stamps_of_a_late_clock_between_good_ones_are_never_believed():
    gate = StampGate()
    for k in range(50):
        assert gate.admit((k + 2000) * NANOSECONDS) is False
        with pytest.raises(Rejected, match='older stamp'):
            gate.admit(k * NANOSECONDS)


@pytest.mark.parametrize('input_rate, per_second', [
    (1.0, 1), (5.0, 5), (10.0, 10), (12.5, 10), (20.0, 10), (25.0, 10), (33.0, 10), (50.0, 10),
    (100.0, 10), (500.0, 10), (1000.0, 10)])
@pytest.mark.parametrize('start', [0, 1_406_851_200_170_000_000, 123_456_789])
def test_ten_per_second_of_any_input(input_rate, per_second, start):
    stamps = [start + round(k * NANOSECONDS / input_rate) for k in range(round(60 * input_rate))]
    outputs = taken(10.0, stamps)
    assert len(outputs) == pytest.approx(60 * per_second, abs=1)
    if input_rate <= 10:
        assert outputs == stamps


def test_exact_ten_hertz_in_floats_loses_nothing():
    """Stamps that went through float seconds are a few nanoseconds off."""
    stamps = [int(1.4068512e9 * 1e9) + int(k * 0.1 * 1e9) for k in range(3000)]
    assert taken(10.0, stamps) == stamps


def test_jitter_of_a_tenth_of_the_period_loses_nothing():
    rng = np.random.default_rng(1)
    stamps = [NANOSECONDS * k // 10 + int(rng.integers(-4_500_000, 4_500_000))
              for k in range(1, 3000)]
    assert len(taken(10.0, stamps)) == len(stamps)


def test_schedule_runs_on_and_does_not_drift():
    """12.5 Hz: every output is the first stamp from 10 ms before its due time on."""
    stamps = [80_000_000 * k for k in range(2500)]
    due = [next(s for s in stamps if s >= k * 100_000_000 - 10_000_000) for k in range(1900)]
    assert taken(10.0, stamps)[:1900] == due


def test_restart_after_a_gap_makes_up_for_nothing():
    stamps = [k * 10_000_000 for k in range(100)]
    late = [30 * NANOSECONDS + 3_000_000 + s for s in stamps]
    outputs = [stamp for stamp in taken(10.0, stamps + late) if stamp >= late[0]]
    assert outputs == [late[0]] + [late[10 * k - 1] for k in range(1, 11)]  # 10 ms before due


@given(st.lists(st.integers(0, 10**10), max_size=100), st.floats(0.01, 1000.0))
def test_never_two_outputs_of_one_stamp_nor_more_than_the_rate(steps, rate):
    stamps = sorted(steps)
    outputs = taken(rate, stamps)
    assert all(a < b for a, b in zip(outputs, outputs[1:], strict=False))
    if outputs:
        assert outputs[0] == stamps[0]
        assert len(outputs) <= (outputs[-1] - outputs[0]) / NANOSECONDS * rate + 1.2


@given(st.integers(-10**15, 10**15))
def test_nanoseconds_survive_float_seconds_for_days(stamp):
    assert nanoseconds(seconds(stamp)) == stamp


def rewound(stamps):
    """List the seconds at which a clock is found set back, of stamps (s) of all topics."""
    rewind, newest, found = Rewind(patience=10.0), None, []
    for stamp in stamps:
        if rewind.is_over(stamp * NANOSECONDS, newest and newest * NANOSECONDS):
            found.append(stamp)
        newest = max(stamp, newest or stamp)
    return found


def test_a_clock_is_set_back_when_nothing_new_comes_for_ten_seconds():
    assert rewound([*range(100, 120), *range(50, 62)]) == [61]
    assert rewound([*range(100, 120), 0, *range(50, 61)]) == []
    lagging = [stamp for k in range(100, 160) for stamp in (k, k - 30, k - 30)]
    assert rewound(lagging) == []

"""The message of a landing window: there and back, and what is no window."""

from dataclasses import astuple
from math import nan

import pytest

from deck_motion_ros.messages import diagnostics_message, window_message, window_sample
from deck_motion_ros.recording import BagTypes
from deck_motion_ros.samples import LandingWindow, Rejected

TYPES = BagTypes()
KEYS = ['state', 'seconds', 'probability', 'next_crest_in', 'next_crest_sd', 'next_trough_in',
        'next_trough_sd']


@pytest.mark.parametrize(('state', 'level'), [('go', 0), ('wait', 1), ('no_go', 2)])
def test_there_and_back(state, level):
    window = LandingWindow(1_700_000_000_123_456_789, state, nan, 0.625, 2.5, 0.125, nan, nan)
    msg = window_message(TYPES, window)
    status, = msg.status
    assert (status.name, status.message, status.level) == ('landing window', state, level)
    assert [pair.key for pair in status.values] == KEYS
    assert status.values[3].value == '2.500'
    assert astuple(window_sample(msg)) == pytest.approx(astuple(window), nan_ok=True)


@pytest.mark.parametrize('wrong', [
    {'state': 'perhaps'}, {'seconds': 'soon'}, {'probability': ''}])
def test_what_is_no_window(wrong):
    values = dict.fromkeys(KEYS, '1.0') | {'state': 'go'}
    statuses = [('landing window', 0, '', values | wrong)]
    with pytest.raises(Rejected, match='no landing window'):
        window_sample(diagnostics_message(TYPES, 0, '', statuses))


def test_missing_key_or_status():
    values = dict.fromkeys(KEYS[:-1], '1.0') | {'state': 'go'}
    for statuses in ([], [('landing window', 0, '', values)], [('other', 0, '', values)]):
        with pytest.raises(Rejected, match='no landing window'):
            window_sample(diagnostics_message(TYPES, 0, '', statuses))

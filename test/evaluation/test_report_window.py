"""The report's section on landing windows, from a replayed bag."""

from math import nan, radians
from pathlib import Path
import re

import numpy as np
import pytest

from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.evaluation.report.drawing import Clock
from deck_motion_ros.evaluation.report.window import landing_windows, stated_limits
from deck_motion_ros.replaying import replay

BAGS = Path(__file__).resolve().parents[2] / 'bags'
SECOND = 1_000_000_000


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a bag with a minute of landing windows and the truth."""
    inputs = next(path for path in BAGS.glob('shaping_*') if path.is_dir())
    out = tmp_path_factory.mktemp('windows') / 'bag'
    replay(inputs, out, 'predictor', {'method': 'shaping', 'window_rate': 0.8,
                                      'window_duration': 3.0})
    return out


@pytest.fixture(scope='module')
def record(bag):
    return read_record(bag)


def test_windows_of_a_bag(record):
    stamps = [item.issued_at for item in record.windows]
    assert len(stamps) > 100 and stamps == sorted(set(stamps))
    assert {item.state for item in record.windows} <= {'go', 'wait', 'no_go'}


def test_shares_are_those_of_what_came(record):
    html = landing_windows(record, 20.0, Clock.of(*record.span))
    text = re.sub(r'<svg.*?</svg>|<[^>]*>', ' ', html, flags=re.DOTALL)
    assert 'Landing windows' in text and 'nan' not in text
    assert 'A window is 3 s' in text and 'vertical rate within 0.8 m/s' in text
    # again, from the truth alone
    stamps = np.arange(record.span[0], record.span[1], SECOND // 50)
    height, roll, pitch = (record.came(axis)(stamps) for axis in (None, 0, 1))
    rate = np.gradient(height, 0.02)
    inside = ((np.abs(height) <= 2.5) & (np.abs(rate) <= 0.8)
              & (np.abs(roll) <= radians(5)) & (np.abs(pitch) <= radians(3)))
    quiet = [inside[k:k + 151].all() for item in record.windows
             for k in [np.searchsorted(stamps, item.issued_at)]
             if item.issued_at >= record.span[0] + 20 * SECOND and k + 151 < len(stamps)]
    shown, = re.findall(r'altogether\s+100\.0 %\s+([\d.]+) %', text)
    assert float(shown) == pytest.approx(100 * np.mean(quiet), abs=5.0)


def test_the_page_has_the_section_after_the_calibration(bag, tmp_path):
    write_report(bag, tmp_path / 'page.html', warm_up=20.0)
    page = (tmp_path / 'page.html').read_text()
    headings = re.findall('<h2>(.*?)</h2>', page)
    assert headings.index('Landing windows') > headings.index('Forecast against what came')


def test_nothing_to_judge_gives_no_section(record):
    assert landing_windows(record, 1e6, Clock.of(*record.span)) == ''


def test_limits_as_the_settings_state_them():
    said = {'window_preset': 'helicopter', 'window_height': 'nan', 'window_rate': '0.8',
            'window_roll_deg': '4.0', 'window_pitch_deg': 'nan', 'window_duration': '6.0'}
    limits, duration = stated_limits(said)
    assert (limits.height, limits.rate, duration) == (2.5, 0.8, 6.0)
    assert limits.roll == pytest.approx(radians(4))
    assert stated_limits(said | {'window_height': str(nan)}) == (limits, duration)
    for missing in said:
        assert stated_limits({key: text for key, text in said.items() if key != missing}) is None
    assert stated_limits(said | {'window_preset': 'other'}) is None

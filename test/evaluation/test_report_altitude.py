"""The report's chapter on the height over the sea, from the golden bags."""

from pathlib import Path
import re

import numpy as np
import pytest

from deck_motion_ros.evaluation import report
from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.evaluation.report.altitude import AltitudeView, HeightErrors
from deck_motion_ros.recording import BagReader, BagWriter

BAGS = Path(__file__).resolve().parents[2] / 'bags'


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    """Show this chapter, whatever others there are."""
    monkeypatch.setattr(report, 'VIEWS', (AltitudeView,))


def text_of(path):
    source = path.read_text(encoding='utf-8')
    assert 'nan' not in source
    return re.sub(r'<svg.*?</svg>|<style.*?</style>|<[^>]*>', ' ', source, flags=re.DOTALL)


def test_errors_are_those_of_the_bag(tmp_path):
    bag = next(BAGS.glob('skimming_2*A'))
    headline = write_report(bag, tmp_path / 'page.html')
    reader = BagReader(bag)
    found = {}
    for topic, _, data in reader.messages(['/altitude/odometry', '/altitude/truth']):
        msg = reader.decode(topic, data)
        found.setdefault(topic, {})[msg.header.stamp.sec, msg.header.stamp.nanosec] = msg
    pairs = [(msg, found['/altitude/truth'][stamp])
             for stamp, msg in found['/altitude/odometry'].items()]
    error = np.array([a.pose.pose.position.z - b.pose.pose.position.z for a, b in pairs])
    var = np.array([a.pose.covariance[14] for a, _ in pairs])
    page = text_of(tmp_path / 'page.html')
    rmse = np.sqrt(np.mean(error**2))
    assert f'off by {rmse:.2f} m RMS' in headline[0]
    assert f'{np.mean(error**2 / var):.2f}' in page
    assert 'significant wave height (m)' in page and 'unobservable sd (m)' in page
    assert (tmp_path / 'page.html').read_text().count('<figure>') >= 2


def test_drop_outs_are_counted(tmp_path):
    write_report(next(BAGS.glob('skimming_dropouts_*A')), tmp_path / 'page.html')
    assert re.search(r'ranges without an echo\s+[1-9]', text_of(tmp_path / 'page.html'))


def test_without_truth_nothing_is_judged(tmp_path):
    reader = BagReader(next(BAGS.glob('skimming_dropouts_*A')))
    with BagWriter(tmp_path / 'bag') as writer:
        for name in ('/altitude/odometry', '/altimeter/range'):
            writer.add(reader.bag_topics[name])
        for topic, time, data in reader.messages(['/altitude/odometry', '/altimeter/range']):
            writer.write(topic, time, data)
    headline = write_report(tmp_path / 'bag', tmp_path / 'page.html')
    assert 'known to' in headline[0] and 'RMS' not in headline[0]
    assert 'RMS error' not in text_of(tmp_path / 'page.html')


def test_honesty_by_hand():
    found = HeightErrors.of(np.array([0.5, -1.5, 2.5, np.nan]), np.ones(4))
    assert found.rmse == pytest.approx((8.75 / 3)**0.5)
    assert (found.worst, found.nees) == (2.5, pytest.approx(8.75 / 3))
    assert found.within == (pytest.approx(1 / 3), pytest.approx(2 / 3))
    assert np.isnan(HeightErrors.of(np.array([np.nan]), np.ones(1)).rmse)

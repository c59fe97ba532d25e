"""The report of a landing: way, judgement, ranges that cannot be right, and bags without truth."""

from pathlib import Path
import re

import pytest

from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.recording import BagReader, BagWriter

BAGS = Path(__file__).resolve().parents[2] / 'bags'


def without(bag, out, *dropped):
    """Copy a bag but for some topics."""
    reader = BagReader(bag)
    kept = [name for name in reader.topics if name not in dropped]
    with BagWriter(out) as writer:
        for name in kept:
            writer.add_topic(name, reader.topics[name])
        for name, time, data in reader.messages(kept):
            writer.write(name, time, data)
    return out


@pytest.fixture(scope='module')
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp('report') / 'page.html'
    return write_report(BAGS / 'landing_stressed_202611B', path), path.read_text()


def test_headline_and_judgement(page):
    headline, text = page
    across, height = map(float, re.search(
        r'off by ([\d.]+) m across and ([\d.]+) m in height', headline[0]).groups())
    assert 0.05 < across < 0.4 and 0.02 < height < 0.3
    assert 'within 2 sd' in text
    assert 'nan' not in re.sub(r'<svg.*?</svg>', '', text, flags=re.DOTALL)


def test_long_ranges_are_counted(page):
    count, total = map(int, re.search(r'(\d+) of (\d+) are more than', page[1]).groups())
    assert total > 400
    assert count / total == pytest.approx(0.1, abs=0.05)  # the share without line of sight


def test_without_truth_and_settings_it_says_less(tmp_path):
    bag = without(BAGS / 'landing_202611A', tmp_path / 'bare', '/landing/truth', '/diagnostics')
    path = tmp_path / 'page.html'
    headline = write_report(bag, path)
    assert any(line.startswith('The aircraft was followed from') for line in headline)
    assert 'within 2 sd' not in path.read_text()
    assert 'No ranges of known anchors' in path.read_text()

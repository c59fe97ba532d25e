"""The alignment's chapter of the report, from a golden bag."""

from pathlib import Path
import re

import numpy as np
import pytest

from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.recording import BagReader

BAGS = Path(__file__).resolve().parents[2] / 'bags'
ARCMIN = 60 * np.degrees(1)


@pytest.fixture(scope='module')
def bag():
    """Return the newest golden bag of a launch."""
    return sorted(BAGS.glob('launch_2*'))[0].with_suffix('')


@pytest.fixture(scope='module')
def page(bag, tmp_path_factory):
    path = tmp_path_factory.mktemp('report') / 'page.html'
    write_report(bag, path)
    return path.read_text()


def last(bag, topic):
    reader = BagReader(bag)
    found = [reader.decode(name, data).vector for name, _, data in reader.messages([topic])][-1]
    return ARCMIN * np.array([found.x, found.y, found.z])


def test_its_numbers_are_those_of_the_bag(bag, page):
    text = re.sub(r'<svg.*?</svg>|<[^>]*>', ' ', page, flags=re.DOTALL).replace('\u2212', '-')
    estimate, truth = last(bag, '/alignment/misalignment'), last(bag, '/alignment/truth')
    rows = re.findall(r'(forward|left|up)\s+(-?[\d.]+)&#x27;\s+([\d.]+)&#x27;\s+(-?[\d.]+)&#x27;',
                      text)
    assert [name for name, *_ in rows] == ['forward', 'left', 'up']
    np.testing.assert_allclose([float(row[1]) for row in rows], estimate, atol=0.006)
    np.testing.assert_allclose([float(row[3]) for row in rows], estimate - truth, atol=0.011)
    assert all(0.1 < float(row[2]) < 2.0 for row in rows)


def test_phases_innovations_and_the_worst_direction_are_shown(page):
    text = re.sub(r'<svg.*?</svg>|<[^>]*>', ' ', page, flags=re.DOTALL)
    assert 'hold at' in text and 'stroke at' in text and 'done at' in text
    assert 'Worst known is the turn about' in text and 'nan' not in text
    assert 'aria-label="Innovations and fading over time"' in page
    assert 'Launched after 2.0 s' in text and 'took 3.0 s' in text


def test_the_same_bag_gives_the_same_bytes(bag, page, tmp_path):
    write_report(bag, tmp_path / 'again.html')
    assert (tmp_path / 'again.html').read_text() == page

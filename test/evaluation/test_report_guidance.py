"""The report of a guided landing: phases, commands, and how it ended."""

from pathlib import Path
import re

import pytest

from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.recording import BagReader

BAGS = Path(__file__).resolve().parents[2] / 'bags'
GUIDED, = BAGS.glob('guidance_*[A-Z]')


@pytest.fixture(scope='module')
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp('report') / 'page.html'
    return write_report(GUIDED, path), path.read_text()


def test_phases_and_the_end_are_said(page):
    headline, text = page
    assert 'The guidance went through 3 phases with 0 aborts; the last was descent.' in headline
    phases = re.findall(r'<td[^>]*>(approach|hold|descent)</td><td[^>]*>([\d.]+) s</td>', text)
    assert [name for name, _ in phases] == ['approach', 'hold', 'descent']
    reader = BagReader(GUIDED)
    stamps = [time for topic, time, _ in reader.messages() if topic == '/landing/cmd_vel']
    assert sum(float(length) for _, length in phases) == pytest.approx(
        (stamps[-1] - stamps[0]) / 1e9, abs=1.5)  # the phase is said once a second


def test_an_estimate_without_variance_is_not_called_exact(page):
    assert not any('known to' in line for line in page[0])
    assert 'Way of the aircraft' in page[1] and 'Error over the deck' not in page[1]


def test_a_bag_of_another_node_is_not_said_to_lack_a_forecast(tmp_path):
    bag, = BAGS.glob('landing_2*[A-Z]')
    headline = write_report(bag, tmp_path / 'page.html')
    assert any('of ship motion' in line for line in headline)
    assert not any('forecast' in line for line in headline)

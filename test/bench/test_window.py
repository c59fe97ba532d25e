"""The bench of landing windows sums up what the scenarios gave."""

from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros.bench.window import figures
from deck_motion_ros.evaluation.windows import WindowScores


def test_figures():
    quiet = np.array([1.0, 0.0, 1.0, 0.0])
    sure = WindowScores('sure', np.arange(4), np.array(['go', 'no_go', 'go', 'wait']), quiet,
                        quiet, np.array([[2.5, 0.1, 0.2], [3.0, -0.3, 0.2], [6.0, 9.0, 0.1]]))
    unsure = replace(sure, name='unsure', probability=np.full(4, 0.5))
    always = replace(sure, name='always', quiet=np.ones(4))
    found = {item.name: item for item in figures([sure, unsure, always])}
    assert found['Brier skill of quiet for 5 s, mean of scenarios'].value == 0.5
    assert found['Brier skill of quiet for 5 s, mean of scenarios'].met is False
    assert found['Brier skill, sure'].value == 1.0
    assert 'Brier skill, always' not in found
    assert found['quiet after go'].value == 100.0
    assert found['quiet where 0.50 was promised, 4 windows'].value == 0.5
    assert found['crest and trough timing 2-4 s ahead, median error'].value == pytest.approx(0.2)
    assert found['coverage of the 68 % interval of these times'].value == 50.0
    assert found['coverage of the 95 % interval of these times'].value == 100.0

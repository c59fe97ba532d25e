"""The alignment's bench: what it drives is the filter and the node that it says."""

import numpy as np

from deck_motion_ros.bench.alignment import alignment, step_costs


def test_every_step_is_timed():
    costs = step_costs(20)
    assert len(costs) == 20 and np.all(np.array(costs) >= 0)


def test_the_live_node_answers_a_whole_launch(monkeypatch, domain_id):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain_id))
    figures = {item.name: item for item in alignment(1, rate=100.0, hold=0.5)}
    assert figures['live_lost'].value == 0
    assert 0 < figures['live_cpu'].value < 100 and figures['sample'].value > 0

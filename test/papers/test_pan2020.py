"""Pan2020: its figures, the bound, and what lies between the two."""

from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros.estimators.landing import LandingConfig
from deck_motion_ros.evaluation.landing import bound, Entrant, fly, paper_scene, Scored
from deck_motion_ros.scenarios import Pan2020Scenario
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig

LEVEL = (0.0, 0.0, 0.0)
ROLLING = LandingSimulatorConfig(
    seed=2020, duration=30.0, deck='pan2020', deck_lever_arm=LEVEL, uav_rate=50.0,
    approach_time=10.0, hold_time=10.0, descent_time=10.0)


def test_the_papers_figures():
    rows = {row.name: row for row in paper_scene(replace(Pan2020Scenario(), runs=8))}
    for axis in 'xyz':
        row = rows[f'paper_rmse_{axis}']
        assert row.value == pytest.approx(row.printed, rel=0.25)
    assert rows['paper_nees'].value > 1.0


def test_near_the_bound_and_honest():
    times = np.arange(3.0, 29.9, 0.1) + 0.02
    scored = fly(ROLLING, {'joint': Entrant(LandingConfig(deck_lever_arm=LEVEL))}, 8,
                 times)['joint']
    assert scored.ratio < 1.12
    assert scored.nees == pytest.approx(1.0, abs=0.25)
    assert np.isfinite(scored.error).all()


def test_bound_of_a_still_scene_by_hand():
    # nothing moves and nothing disturbs: n rounds are worth one with noise sd / sqrt(n)
    still = replace(ROLLING, duration=20.0, boat_rotation=0.0, uav_start=(0.0, 0.0, 8.0),
                    final_height=8.0, wander_sd=LEVEL, uav_accel_white_sd=0.0,
                    uav_attitude_drift_sd=0.0, uav_accel_drift_sd=0.0, follow_lag=0.0)
    simulator = LandingSimulator(still, truth=False)
    simulator.scene._motion_at = steady(simulator.scene._motion_at)
    events = [event for event in simulator if event.topic == 'uwb/range']
    first = bound(simulator, still, events, np.array([0.0]))
    after = bound(simulator, still, events, np.array([19.9]))
    # position at the end of n = 200 rounds with unknown constant velocity: sd 2 / sqrt(n)
    assert after / first == pytest.approx(np.full((1, 3), 2 / np.sqrt(200)), rel=0.03)


def steady(motion_at):
    def at(times):
        motion = motion_at(times)
        motion.value[:], motion.rate[:] = 0.0, 0.0
        return motion
    return at


def test_score_of_known_errors():
    rng = np.random.default_rng(1)
    error = rng.normal(size=(50, 40, 3)) * [0.1, 0.2, 0.3]
    cov = np.tile(np.diag([0.01, 0.04, 0.09]), (50, 40, 1, 1))
    scored = Scored(np.arange(40.0), error, cov, np.tile([0.1, 0.2, 0.3], (50, 40, 1)))
    assert scored.rmse == pytest.approx([0.1, 0.2, 0.3], rel=0.05)
    assert scored.ratio == pytest.approx(1.0, abs=0.03)
    assert scored.nees == pytest.approx(1.0, abs=0.03)
    assert scored.during(10, 20).error.shape == (50, 10, 3)

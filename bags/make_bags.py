"""
Make the golden bags of this folder: ``python bags/make_bags.py [FOLDER]``.

A golden bag is never made anew under its old name: a change of the numbers that is wanted gets the
next letter, and the old bag goes.
"""

from pathlib import Path
import sys
import tempfile
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.estimators.guidance import GuidanceConfig
from deck_motion_ros.evaluation.guidance import Aircraft, deck_record, land
from deck_motion_ros.params_file import read_params_file
from deck_motion_ros.recording import BagTypes, BagWriter, encode
from deck_motion_ros.replaying import replay
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.scenarios import PredictionScenario
from deck_motion_ros.simulation.catapult import CatapultSimulatorConfig
from deck_motion_ros.simulation.landing import LandingSimulatorConfig
from deck_motion_ros.simulation.runs import SCENARIOS
from deck_motion_ros.simulation.sea_skimming import SkimmingSimulatorConfig
from deck_motion_ros.simulation.simulator import SimulatorConfig
from deck_motion_ros.topics import BY_NAME

HERE = Path(__file__).parent
START = 1_793_491_200 * NANOSECONDS  # 2026-11-01 00:00 UTC

# name: the node, what is simulated and the seconds in which nothing was received
BAGS = {
    'carrier_202611C': (
        'predictor', SimulatorConfig(
            seed=2612, rate=4.0, duration=150.0, hull='cvn65', dropout=(0.01, 0.02)), (0.0, 0.0)),
    'destroyer_202611B': (
        'predictor', SimulatorConfig(seed=202611, rate=10.0, duration=120.0, dropout=(0.02, 0.03)),
        (70.0, 82.0)),
    'patrol_202611D': (
        'predictor', SimulatorConfig(
            seed=2611, rate=5.0, duration=120.0, hull='patrol', turn_to_deg=180.0,
            significant_wave_height=1.88, peak_period=8.8, turn_time=80.0, turn_rate_deg=3.0,
            dropout=(0.02, 0.02)), (0.0, 0.0)),
    'landing_202611A': (
        'landing', LandingSimulatorConfig(
            seed=202611, rate=10.0, duration=24.0, hull='patrol', significant_wave_height=1.88,
            peak_period=8.8, deck_lever_arm=(-20.0, 0.0, 4.0), uav_rate=20.0, range_rate=5.0,
            approach_time=8.0, hold_time=8.0, descent_time=8.0), (0.0, 0.0)),
    'landing_stressed_202611B': (
        'landing', LandingSimulatorConfig(
            seed=2611, rate=10.0, duration=30.0, deck='pan2020', deck_lever_arm=(0.0, 0.0, 0.0),
            uav_rate=20.0, range_rate=5.0, range_spacing=0.04, nlos_share=0.1,
            range_dropout=0.05, lost_anchor='anchor_3', lost_time=22.0, outage_start=12.0,
            outage_duration=3.0, survey_sd=0.02, approach_time=10.0, hold_time=10.0,
            descent_time=10.0, dropout=(0.02, 0.0)), (0.0, 0.0)),
    'launch_202611B': (
        'alignment', CatapultSimulatorConfig(
            seed=202611, deck='steady', hold=2.0, duration=5.3, vibration=20.0,
            vibration_frequency=97.0, sampling='points'), (0.0, 0.0)),
    'launch_quiet_202611A': (
        'alignment', CatapultSimulatorConfig(
            seed=2611, rate=50.0, deck='steady', hold=2.0, duration=5.3), (0.0, 0.0)),
    'launch_cold_202611B': (
        'alignment', CatapultSimulatorConfig(
            seed=2612, rate=50.0, deck='steady', hold=0.0, duration=3.3, vibration=20.0),
        (0.0, 0.0)),
    'launch_rolling_202611B': (
        'alignment', CatapultSimulatorConfig(
            seed=2613, rate=50.0, hull='patrol', hold=3.0, duration=6.3, vibration=10.0,
            lever_arm=(12.0, 5.0, 3.0), track_rpy_deg=(0.0, 0.0, 4.0)), (0.0, 0.0)),
    'launch_skewed_202611B': (
        'alignment', CatapultSimulatorConfig(
            seed=2614, rate=100.0, deck='steady', hold=1.0, duration=4.3, vibration=20.0,
            skew=0.005, master_every=2, ldv_every=2, ldv_dropout=(0.4, 0.7)), (0.0, 0.0)),
    'shaping_202611B': (
        'predictor', SimulatorConfig(scenario='shaping', seed=2014, rate=10.0, duration=80.0),
        (0.0, 0.0)),
    'skimming_202611A': (
        'altitude', SkimmingSimulatorConfig(
            seed=202611, rate=20.0, altimeter_rate=10.0, duration=60.0, profile_times=(8.0, 42.0),
            significant_wave_height=3.25, peak_period=9.7), (0.0, 0.0)),
    'skimming_dropouts_202611A': (
        'altitude', SkimmingSimulatorConfig(
            seed=2611, rate=20.0, altimeter_rate=20.0, duration=40.0,
            profile_heights=(60.0, 45.0, 60.0), dropout=(0.02, 0.05), delay=(0.0, 0.06),
            jitter=(0.001, 0.002), loss_of_lock=(14.0, 19.0), obstacle=(27.0, 30.0, 30.0)),
        (0.0, 0.0)),
    'skimming_long_202611A': (
        'altitude', SkimmingSimulatorConfig(
            seed=2612, rate=5.0, altimeter_rate=2.5, duration=300.0, speed=30.0,
            wave_heading_deg=150.0, profile_heights=(60.0, 30.0, 45.0),
            profile_times=(60.0, 200.0)), (0.0, 0.0)),
}


# a landing in closed loop: the deck, and when the approach begins (s)
CLOSED_LOOP = 'guidance_202611A'
DECK = PredictionScenario('patrol_ss4', 'patrol', 4, 135.0, 6.0, 202611, duration=260.0)
APPROACH_AT = 180.0


def make_closed_loop(name: str, folder: Path) -> None:
    """Land on a simulated deck; replay the guidance over what it was told."""
    types, record = BagTypes(), deck_record(DECK, output_rate=2.0)
    heard: list[tuple[int, str, Any]] = []
    land(record, APPROACH_AT, GuidanceConfig(command_rate=5.0), Aircraft(),
         np.random.default_rng(DECK.seed), hear=lambda sample: heard.append(
             (sample.stamp, 'landing/odometry', messages.message(types, sample))))
    first, last = heard[0][0], heard[-1][0]
    for forecast, pose, window in record.said:
        if first <= forecast.issued_at <= last:
            said = [('prediction', messages.touchdown_message(
                types, pose, 'ship_level', 'touchdown')), ('forecast', messages.forecast_message(
                    types, forecast, 'ship_level', 'touchdown'))]
            if window is not None:
                said.append(('window', messages.window_message(types, window)))
            heard += [(forecast.issued_at, f'touchdown/{what}', msg) for what, msg in said]
    heard.sort(key=lambda item: (item[0], item[1] == 'landing/odometry'))
    with tempfile.TemporaryDirectory() as work:
        inputs = Path(work, 'inputs')
        with BagWriter(inputs) as writer:
            for topic in sorted({topic for _, topic, _ in heard}):
                writer.add_topic(f'/{topic}', BY_NAME[topic].type)
            for time, topic, msg in heard:
                writer.write(f'/{topic}', time, encode(BY_NAME[topic].type, msg))
        replay(inputs, folder / name, 'guidance', read_params_file(
            HERE / f'{name}.yaml', 'guidance'))


def make(name: str, folder: Path) -> None:
    """Simulate the inputs and replay the node with ``NAME.yaml`` over them."""
    if name == CLOSED_LOOP:
        make_closed_loop(name, folder)
        return
    node, config, (silent_from, silent_to) = BAGS[name]
    types, played = BagTypes(), SCENARIOS[config.scenario]
    with tempfile.TemporaryDirectory() as work:
        inputs = Path(work, 'inputs')
        with BagWriter(inputs) as writer:
            for topic in played.topics:
                writer.add_topic(f'/{topic}', BY_NAME[topic].type)
            for time, topic, sample in played.source(config, START):
                if not silent_from <= (time - START) / NANOSECONDS < silent_to:
                    writer.write(f'/{topic}', time, encode(
                        BY_NAME[topic].type, messages.message(types, sample)))
        replay(inputs, folder / name, node, read_params_file(HERE / f'{name}.yaml', node))


if __name__ == '__main__':
    for bag in (*BAGS, CLOSED_LOOP):
        make(bag, Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)

"""
Make the golden bags of this folder: ``python bags/make_bags.py [FOLDER]``.

A golden bag is never made anew under its old name: a change of the numbers that is wanted gets the
next letter, and the old bag goes.
"""

from pathlib import Path
import sys
import tempfile

from deck_motion_ros import messages
from deck_motion_ros.params_file import read_params_file
from deck_motion_ros.recording import BagTypes, BagWriter, encode
from deck_motion_ros.replaying import replay
from deck_motion_ros.samples import NANOSECONDS
from deck_motion_ros.simulation.simulator import ShipSimulator, SimulatorConfig
from deck_motion_ros.topics import BY_NAME

HERE = Path(__file__).parent
START = 1_793_491_200 * NANOSECONDS  # 2026-11-01 00:00 UTC
BUILDERS = {'ship/imu': messages.imu_message, 'ship/heave': messages.heave_message,
            'ship/truth': messages.odometry_message}

# name: the simulated ship and the seconds in which nothing was received
BAGS = {
    'destroyer_202611A': (
        SimulatorConfig(seed=202611, rate=10.0, duration=120.0, dropout=(0.02, 0.03)),
        (70.0, 82.0)),
    'patrol_202611A': (
        SimulatorConfig(seed=2611, rate=5.0, duration=120.0, hull='patrol', turn_to_deg=180.0,
                        significant_wave_height=1.88, peak_period=8.8, turn_time=80.0,
                        turn_rate_deg=3.0, dropout=(0.02, 0.02)), (0.0, 0.0)),
    'shaping_202611A': (
        SimulatorConfig(scenario='shaping', seed=2014, rate=10.0, duration=80.0), (0.0, 0.0)),
}


def make(name: str, folder: Path) -> None:
    """Simulate the inputs and replay the predictor with ``NAME.yaml`` over them."""
    config, (silent_from, silent_to) = BAGS[name]
    types = BagTypes()
    with tempfile.TemporaryDirectory() as work:
        inputs = Path(work, 'inputs')
        with BagWriter(inputs) as writer:
            for topic in BUILDERS:
                writer.add_topic(f'/{topic}', BY_NAME[topic].type)
            for time, topic, sample in ShipSimulator(config, START):
                if not silent_from <= (time - START) / NANOSECONDS < silent_to:
                    writer.write(f'/{topic}', time, encode(
                        BY_NAME[topic].type, BUILDERS[topic](types, sample)))
        params = read_params_file(HERE / f'{name}.yaml', 'predictor')
        replay(inputs, folder / name, 'predictor', params)


if __name__ == '__main__':
    for bag in BAGS:
        make(bag, Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)

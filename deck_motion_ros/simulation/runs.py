"""The simulator's scenarios by name: parameters, source of samples, topics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from deck_motion_ros.simulation.catapult import CatapultSimulator, CatapultSimulatorConfig
from deck_motion_ros.simulation.landing import LandingSimulator, LandingSimulatorConfig
from deck_motion_ros.simulation.sea_skimming import SkimmingSimulator, SkimmingSimulatorConfig
from deck_motion_ros.simulation.simulator import Event, ShipSimulator, SimulatorConfig


class Scenario(NamedTuple):
    """
    What the simulator can play.

    Attributes
    ----------
    config : type
        Its parameters: ``SimulatorConfig`` or a subclass with more.
    source : callable
        Takes configuration and first stamp (ns); gives the events in the order of their arrival.
    topics : tuple of str
        What is published; the first is the one that subscribers are waited for.

    """

    config: type[SimulatorConfig]
    source: Callable[[Any, int], Iterable[Event]]
    topics: tuple[str, ...]


SHIP = ('ship/imu', 'ship/heave', 'ship/truth')
SCENARIOS: Mapping[str, Scenario] = {
    'sea': Scenario(SimulatorConfig, ShipSimulator, SHIP),
    'shaping': Scenario(SimulatorConfig, ShipSimulator, SHIP),
    'catapult': Scenario(CatapultSimulatorConfig, CatapultSimulator, (
        'slave/imu', 'master/imu', 'master/velocity', 'ldv/velocity', 'alignment/truth')),
    'landing': Scenario(LandingSimulatorConfig, LandingSimulator, (
        'ship/imu', 'ship/heave', 'uav/imu', 'uwb/range', 'ship/truth', 'landing/truth')),
    'altitude': Scenario(SkimmingSimulatorConfig, SkimmingSimulator, (
        'uav/imu', 'altimeter/range', 'altimeter/rate', 'altitude/truth')),
}


def scenario(name: str) -> Scenario:
    """
    Find a scenario.

    Raises
    ------
    ValueError
        If there is none of that name.

    """
    if name not in SCENARIOS:
        raise ValueError(
            f"parameter 'scenario' must be one of {', '.join(SCENARIOS)}, not {name!r}")
    return SCENARIOS[name]

"""Write ``doc/interfaces.md`` from the tables that the nodes themselves use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
import sys
from typing import Any

from deck_motion_ros.config import Parameter, parameters
from deck_motion_ros.estimators.alignment import AlignmentConfig
from deck_motion_ros.estimators.altitude import AltitudeConfig
from deck_motion_ros.estimators.guidance import GuidanceConfig
from deck_motion_ros.estimators.landing import LandingConfig
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.recording import PlayerConfig, RecorderConfig
from deck_motion_ros.simulation.runs import SCENARIOS, SHIP
from deck_motion_ros.simulation.simulator import SimulatorConfig
from deck_motion_ros.topics import BY_NAME, inputs, outputs, Topic, TOPICS

CONFIGS: Mapping[str, type] = {
    'simulator': SimulatorConfig,
    'predictor': PredictorConfig,
    'alignment': AlignmentConfig,
    'altitude': AltitudeConfig,
    'landing': LandingConfig,
    'guidance': GuidanceConfig,
    'recorder': RecorderConfig,
    'player': PlayerConfig,
}

TRAFFIC = {'recorder': 'Records any topics.', 'player': "Publishes the bag's topics and `/clock`."}

OPENING = """\
# Interfaces

Written by `make docs` from the tables in the code; a test compares the two.

Units are SI and radians; axes follow REP-103 (body x forward, y left, z up; pitch positive bow
**down**), IMU data REP-145. All names are relative, so namespaces and remappings work;
`/diagnostics` alone is absolute. The frame of a topic is the default of the parameter named
after it: frame `ship_level` is the parameter `ship_level_frame`.
"""

REMARKS = """\
Values are checked at the start (`3` is taken for `3.0`), and a name that no parameter has is
named in a warning. Besides its own, each node takes
`use_sim_time` and, for its publishers and subscriptions, `qos_overrides`.
"""


def interfaces() -> str:
    """Return the text of ``doc/interfaces.md``."""
    return '\n'.join([
        OPENING, '## Topics\n',
        *_table(('topic', 'type', 'frame', 'published by', 'used by', 'meaning'),
                map(_topic_row, TOPICS)),
        '\n## Nodes and their parameters\n', REMARKS,
        *(line for node, kind in CONFIGS.items() for line in _section(node, kind))]) + '\n'


def _section(node: str, kind: type) -> list[str]:
    def names(topics: Iterable[Topic]) -> str:
        return ', '.join(f'`{topic.name}`' for topic in topics)

    both = (('Subscribes to', inputs(node)), ('Publishes', _published(node)))
    traffic = [f'{verb} {names(topics)}.' for verb, topics in both if topics]
    return [f'### {node}\n', TRAFFIC.get(node) or ' '.join(traffic), '',
            *_parameters(parameters(kind).values()), '',
            *(line for line in _scenarios() if node == 'simulator')]


def _parameters(rules: Iterable[Parameter]) -> list[str]:
    return _table(('parameter', 'type', 'default', 'allowed', 'meaning'),
                  map(_parameter_row, rules))


def _scenarios() -> Iterator[str]:
    """Tell how each scenario with parameters of its own differs from the ship alone."""
    common = parameters(SimulatorConfig)
    for name, scenario in SCENARIOS.items():
        own = [rule for rule in parameters(scenario.config).values()
               if rule != common.get(rule.name)]
        if own:
            topics = ', '.join(f'`{topic}`' for topic in scenario.topics)
            yield from (f'#### simulator, scenario {name}\n', f'Publishes {topics}.', '',
                        *_parameters(own), '')


def _published(node: str) -> tuple[Topic, ...]:
    return tuple(BY_NAME[name] for name in SHIP) if node == 'simulator' else outputs(node)


def _topic_row(topic: Topic) -> tuple[str, ...]:
    return (f'`{topic.name}`', topic.type.replace('/msg/', '/'), _code(topic.frame),
            topic.publisher or 'a sensor', ', '.join(topic.subscribers), topic.meaning.rstrip('.'))


def _parameter_row(rule: Parameter) -> tuple[str, ...]:
    return (f'`{rule.name}`', _type(rule.default), f'`{_literal(rule.default)}`',
            ', '.join(map(_code, rule.choices)) or rule.span(), rule.meaning.rstrip('.'))


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return ['| ' + ' | '.join(cell.replace('|', '\\|') for cell in row) + ' |'
            for row in (head, ('---',) * len(head), *rows)]


def _code(text: str) -> str:
    return f'`{text}`' if text else ''


def _type(default: Any) -> str:
    if isinstance(default, tuple):
        return (_type(default[0]) if default else 'string') + '[]'
    return {float: 'double', int: 'integer', bool: 'bool', str: 'string'}[type(default)]


def _literal(default: Any) -> str:
    """
    Write a value as ROS takes it on the command line and in YAML.

    >>> _literal((0.5, -1.0)), _literal(True), _literal(float('nan')), _literal('')
    ('[0.5, -1.0]', 'true', '.nan', "''")
    """
    if isinstance(default, tuple):
        return f"[{', '.join(map(_literal, default))}]"
    if isinstance(default, bool):
        return str(default).lower()
    if default != default:
        return '.nan'
    return str(default) or "''"


if __name__ == '__main__':
    Path(sys.argv[1]).write_text(interfaces(), encoding='utf-8')

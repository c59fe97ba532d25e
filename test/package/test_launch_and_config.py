"""Launch files and parameter files against the nodes they are for; `launch` is not on PyPI."""

from pathlib import Path
import re
from xml.etree import ElementTree

import pytest
from ruamel.yaml import YAML

from deck_motion_ros.config import configured, parameters
from deck_motion_ros.documentation import CONFIGS
from deck_motion_ros.simulation.runs import scenario
from deck_motion_ros.topics import BY_NAME

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted((ROOT / 'launch').iterdir())
CONFIG_FILES = sorted((ROOT / 'config').iterdir())
SHARE = '$(find-pkg-share deck_motion_ros)/'
LAUNCH_TYPES = {str: 'str', bool: 'bool', int: 'int', float: 'float'}


def by_name(path):
    return path.name


@pytest.fixture(params=LAUNCH_FILES, ids=by_name)
def launch(request):
    return ElementTree.parse(request.param).getroot()


@pytest.fixture(params=CONFIG_FILES, ids=by_name)
def sections(request):
    """Return the file as {node: {parameter: value}}."""
    tree = YAML(typ='safe').load(request.param)
    assert all(list(branch) == ['ros__parameters'] for branch in tree.values())
    return {key.removeprefix('/**/'): branch['ros__parameters'] for key, branch in tree.items()}


def test_there_is_something_to_check():
    assert len(LAUNCH_FILES) >= 3
    assert len(CONFIG_FILES) >= 4
    assert all(path.name.endswith('.launch.xml') for path in LAUNCH_FILES)
    assert all(path.suffix == '.yaml' for path in CONFIG_FILES)


def test_launch_files_start_our_executables(launch):
    nodes = launch.findall('node')
    assert nodes
    for node in nodes:
        assert node.get('pkg') == 'deck_motion_ros'
        assert node.get('exec') in CONFIGS


def test_launch_arguments_are_declared_described_and_used(launch):
    arguments = {arg.get('name'): arg for arg in launch.findall('arg')}
    assert all(arg.get('description') for arg in arguments.values())
    text = ElementTree.tostring(launch, encoding='unicode')
    assert set(re.findall(r'\$\(var (\w+)\)', text)) == set(arguments)
    assert set(re.findall(r'\$\(([\w-]+)', text)) <= {'var', 'find-pkg-share'}


def test_files_named_in_launch_files_exist(launch):
    for path in (arg.get('default', '') for arg in launch.findall('arg')):
        if path.startswith(SHARE):
            assert (ROOT / path.removeprefix(SHARE)).is_file(), path
    text = ElementTree.tostring(launch, encoding='unicode')
    assert text.count('find-pkg-share') == text.count(SHARE)


def test_launch_parameters_are_declared_with_their_type(launch):
    for node in launch.findall('node'):
        known = {name: type(rule.default) for name, rule in
                 parameters(CONFIGS[node.get('exec')]).items()} | {'use_sim_time': bool}
        for param in node.findall('param'):
            if 'from' not in param.attrib:
                assert param.get('type') == LAUNCH_TYPES[known[param.get('name')]]


def test_launch_remaps_topics_of_the_contract(launch):
    for remap in launch.iter('remap'):
        assert remap.get('from') in BY_NAME


def config_class(node, values):
    """Return what the node's parameters are; those of the simulator depend on its scenario."""
    return scenario(values['scenario']).config if 'scenario' in values else CONFIGS[node]


def test_config_files_hold_valid_values_of_declared_parameters(sections):
    for node, values in sections.items():
        configured(config_class(node, values), values)


def test_config_files_write_values_in_the_type_ros_insists_on(sections):
    for node, values in sections.items():
        table = parameters(config_class(node, values))
        for name, value in values.items():
            assert kinds(value) == kinds(table[name].default), f'{node} {name}'


def kinds(value):
    if isinstance(value, (list, tuple)):
        return list, {type(item) for item in value} or {str}
    return type(value)


def test_config_files_give_each_node_of_the_launch_file_something(launch):
    """A key that is no node's name would be ignored without a word."""
    default = next(arg.get('default') for arg in launch.findall('arg')
                   if arg.get('name') == 'params')
    tree = YAML(typ='safe').load(ROOT / default.removeprefix(SHARE))
    started = {node.get('exec') for node in launch.findall('node')}
    assert {key.removeprefix('/**/') for key in tree} <= started

"""package.xml, setup.py, the changelog and the imports tell one story."""

import ast
import re
import sys
from xml.etree import ElementTree

import pytest

import deck_motion_ros
from deck_motion_ros.topics import TOPICS

PEERS = {'filterpy', 'simdkalman'}  # what `deck_motion bench` measures against


@pytest.fixture
def manifest(project):
    return ElementTree.parse(project / 'package.xml').getroot()


@pytest.fixture
def imported(project):
    """Return the top-level names that the package imports, ours and Python's own aside."""
    names = set()
    for path in (project / 'deck_motion_ros').rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module)
    return {name.split('.')[0] for name in names} - set(sys.stdlib_module_names) \
        - {'deck_motion_ros'}


def is_ros(name):
    return name == 'rclpy' or name.endswith(('_msgs', '_interfaces'))


def test_manifest_is_one_that_colcon_takes_for_ament_python(manifest):
    assert manifest.get('format') == '3'
    assert manifest.findtext('name') == 'deck_motion_ros'
    assert manifest.findtext('export/build_type') == 'ament_python'
    # catkin_pkg's own expression: with any other address colcon silently ignores the manifest
    assert re.fullmatch(r'[-\w%+]+(\.[-\w%+]+)*@[-\w%]+(\.[-\w%]+)*\.[a-zA-Z]{2,}',
                        manifest.find('maintainer').get('email'))


def test_one_version(project, manifest):
    version = manifest.findtext('version')
    changelog = (project / 'CHANGELOG.rst').read_text(encoding='utf-8')
    assert version == deck_motion_ros.__version__
    assert re.search(r'^(\d+\.\d+\.\d+) ', changelog, re.M)[1] == version


def test_licence_is_the_one_that_is_named(project, manifest):
    text = (project / 'LICENSE').read_text(encoding='utf-8')
    assert manifest.findtext('license') == 'Apache-2.0'
    assert 'Apache License' in text
    assert 'Version 2.0, January 2004' in text
    assert 'END OF TERMS AND CONDITIONS' in text


def test_ros_imports_are_in_the_manifest(manifest, imported):
    used = imported | {topic.type.split('/')[0] for topic in TOPICS}
    depends = {item.text for item in manifest.findall('exec_depend')}
    assert set(filter(is_ros, used)) == set(filter(is_ros, depends))


def test_other_imports_are_in_setup(imported, installed):
    required = {re.match(r'[\w.-]+', text)[0].lower() for text in installed.requires
                if 'extra ==' not in text}
    modules = {'ruamel.yaml': 'ruamel'}
    assert {name for name in imported if not is_ros(name)} - PEERS <= {
        modules.get(name, name) for name in required}

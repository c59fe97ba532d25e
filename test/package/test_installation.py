"""What pip installed, as ``ros2 run``, ``ros2 launch`` and a shell look for it."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

from deck_motion_ros.documentation import CONFIGS

PREFIX = Path(sys.prefix)
EXECUTABLES = ('deck_motion', *CONFIGS)


def test_entry_points_are_the_nodes_and_the_command_line(installed):
    scripts = [point for point in installed.entry_points if point.group == 'console_scripts']
    assert {point.name for point in scripts} == set(EXECUTABLES)
    assert all(callable(point.load()) for point in scripts)


@pytest.mark.parametrize('name', EXECUTABLES)
def test_ros2_run_finds_each_executable(installed, name):
    assert os.access(PREFIX / 'lib/deck_motion_ros' / name, os.X_OK)


def test_share_holds_manifest_marker_launch_and_config(installed, project):
    share = PREFIX / 'share/deck_motion_ros'
    assert (PREFIX / 'share/ament_index/resource_index/packages/deck_motion_ros').is_file()
    for path in ('package.xml', *(str(path.relative_to(project)) for folder in ('launch', 'config')
                                  for path in (project / folder).iterdir())):
        assert (share / path).read_text() == (project / path).read_text()


def test_ament_index_finds_the_share(installed, monkeypatch):
    packages = pytest.importorskip('ament_index_python.packages', reason='no ROS 2 here')
    monkeypatch.setenv('AMENT_PREFIX_PATH', sys.prefix)
    assert packages.get_package_share_directory('deck_motion_ros') == str(
        PREFIX / 'share/deck_motion_ros')


@pytest.mark.parametrize('command', [
    [PREFIX / 'bin/deck_motion'],
    [PREFIX / 'lib/deck_motion_ros/deck_motion'],
    [sys.executable, '-m', 'deck_motion_ros'],
], ids=['bin', 'lib', 'module'])
def test_command_line_runs_with_nothing_activated(installed, command, bare_environment, tmp_path):
    result = subprocess.run([*command, '--help'], env=bare_environment, cwd=tmp_path,
                            stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    for word in ('demo', 'replay', 'import', 'report', 'recover', 'papers', 'bench'):
        assert f' {word} ' in result.stdout

"""``colcon build`` in a workspace of its own, then the predictor it installed, asked over ROS."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

from deck_motion_ros.config import parameters
from deck_motion_ros.documentation import CONFIGS

COLCON = Path(sys.prefix, 'bin/colcon')
PARTS = ('package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'LICENSE', 'resource',
         'config', 'launch', 'deck_motion_ros')
ENVIRONMENT = {name: value for name, value in os.environ.items()
               if name not in ('PYTHONPATH', 'AMENT_PREFIX_PATH', 'COLCON_PREFIX_PATH')}


@pytest.fixture(scope='module')
def workspace(tmp_path_factory, project):
    """Return a workspace that has been built."""
    if not COLCON.exists():
        pytest.skip('no colcon here: use make test')
    folder = tmp_path_factory.mktemp('workspace')
    source = folder / 'src/deck_motion_ros'
    source.mkdir(parents=True)
    for part in PARTS:
        path = project / part
        if path.is_dir():
            shutil.copytree(path, source / part, ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(path, source)
    result = subprocess.run([COLCON, 'build'], cwd=folder, env=ENVIRONMENT,
                            stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder


def test_colcon_takes_it_for_a_ros_package(workspace):
    share = workspace / 'install/deck_motion_ros/share'
    assert (share / 'ament_index/resource_index/packages/deck_motion_ros').is_file()
    assert (share / 'deck_motion_ros/hook/ament_prefix_path.sh').is_file()
    assert (share / 'deck_motion_ros/launch/demo.launch.xml').is_file()


def test_executables_are_scripts_of_the_python_that_built(workspace):
    folder = workspace / 'install/deck_motion_ros/lib/deck_motion_ros'
    assert {path.name for path in folder.iterdir()} == {'deck_motion', *CONFIGS}
    for path in folder.iterdir():
        assert path.read_text().splitlines()[0] == f'#!{sys.executable}'


def test_predictor_answers_its_parameters(workspace, context, executor, spin_until, domain_id):
    from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
    from rclpy.node import Node

    node = Node('asker', context=context)
    executor.add_node(node)
    run = ('. install/setup.sh && exec install/deck_motion_ros/lib/deck_motion_ros/predictor '
           '--ros-args -p horizon:=4.5')
    predictor = subprocess.Popen(
        ['sh', '-c', run], cwd=workspace, env={**ENVIRONMENT, 'ROS_DOMAIN_ID': str(domain_id)},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        start_new_session=True)

    def ask(kind, service, **request):
        client = node.create_client(kind, f'/predictor/{service}')
        spin_until(lambda: client.service_is_ready() or predictor.poll() is not None)
        future = client.call_async(kind.Request(**request))
        spin_until(lambda: future.done() or predictor.poll() is not None)
        return future.result()

    try:
        expected = parameters(CONFIGS['predictor'])
        listed = ask(ListParameters, 'list_parameters').result.names
        assert set(expected) <= set(listed)
        values = ask(GetParameters, 'get_parameters', names=['horizon', 'lever_arm']).values
        assert values[0].double_value == 4.5
        assert tuple(values[1].double_array_value) == expected['lever_arm'].default
        described = ask(DescribeParameters, 'describe_parameters', names=list(expected))
        for descriptor, rule in zip(described.descriptors, expected.values(), strict=True):
            assert descriptor.description.startswith(rule.meaning)
    finally:
        predictor.terminate()
        print(predictor.communicate(timeout=30)[0].decode())
    assert predictor.returncode == 0

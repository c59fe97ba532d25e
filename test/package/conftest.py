"""The installed package."""

from importlib.metadata import distribution, PackageNotFoundError
import os

import pytest


@pytest.fixture(scope='session')
def installed():
    """Return the metadata of the installed package, or skip."""
    try:
        return distribution('deck_motion_ros')
    except PackageNotFoundError:
        pytest.skip('the package is not installed here: use make test')


@pytest.fixture
def bare_environment():
    """Return an environment without what activates this one: its PATH, its Python, its ROS."""
    gone = ('VIRTUAL_ENV', 'PYTHONPATH', 'AMENT_PREFIX_PATH', 'COLCON_PREFIX_PATH',
            'LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE')
    kept = {name: value for name, value in os.environ.items() if name not in gone}
    return {**kept, 'PATH': '/usr/bin:/bin'}

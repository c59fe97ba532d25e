"""Install the package: by colcon as ament_python, or by plain pip without any ROS."""

from pathlib import Path
import xml.etree.ElementTree as ElementTree

from setuptools import Distribution, find_packages, setup

NAME = 'deck_motion_ros'
NODES = ('simulator', 'predictor', 'recorder', 'player', 'alignment', 'altitude', 'landing',
         'guidance')
EXECUTABLES = {
    'deck_motion': f'{NAME}.cli:main',
    **{node: f'{NAME}.nodes.{node}:main' for node in NODES},
}

WRAPPER = """\
#!/bin/sh
# `ros2 run` and `ros2 launch` look here; pip knows the interpreter and puts the command into bin/.
here=$(dirname "$(readlink -f "$0")")
exec "$here/../../bin/$(basename "$0")" "$@"
"""


class InstallData(Distribution().get_command_class('install_data')):
    """Put a wrapper under lib/<package> for each executable that is not there already."""

    def run(self):
        """Install the data files, then the wrappers (under colcon the real scripts are there)."""
        super().run()
        folder = Path(self.install_dir, 'lib', NAME)
        folder.mkdir(parents=True, exist_ok=True)
        for name in EXECUTABLES:
            script = folder / name
            if not script.exists():
                script.write_text(WRAPPER)
                script.chmod(0o755)
                self.outfiles.append(str(script))


ROOT = Path(__file__).resolve().parent
about = ElementTree.parse(ROOT / 'package.xml').getroot()


def share(folder, pattern):
    """List the files of one folder for the package's share."""
    return (f'share/{NAME}/{folder}', sorted(
        str(path.relative_to(ROOT)) for path in (ROOT / folder).glob(pattern)))


setup(
    name=NAME,
    version=about.findtext('version'),
    description=about.findtext('description'),
    maintainer=about.findtext('maintainer'),
    maintainer_email=about.find('maintainer').get('email'),
    license=about.findtext('license'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        share('config', '*.yaml'),
        share('launch', '*.launch.xml'),
    ],
    cmdclass={'install_data': InstallData},
    entry_points={'console_scripts': [f'{name} = {main}' for name, main in EXECUTABLES.items()]},
    python_requires='>=3.10',
    install_requires=[
        'numpy', 'scipy', 'rosbags>=0.11', 'mcap>=1.6', 'lz4', 'zstandard', 'ruamel.yaml',
        'matplotlib', 'rich',
    ],
    extras_require={
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'test': [
            'pytest', 'hypothesis', 'filterpy>=2', 'python-ins', 'simdkalman', 'waveresponse',
            'ruff', 'mypy', 'import-linter',
            'colcon-core', 'colcon-ros', 'setuptools<80',
        ],
    },
    zip_safe=False,
)

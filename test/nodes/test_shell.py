"""The shell of every node: how a process begins and ends."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import signal
from rclpy.node import Node
from deck_motion_ros.nodes.shell import run, Stop

class Tested(Node):
    def __init__(self):
        super().__init__('tested')
        {init}
        self.create_timer(0.01, self.act)

    def act(self):
        {act}

    def destroy_node(self):
        print('destroyed', flush=True)
        super().destroy_node()

run(Tested)
"""

# a second Ctrl-C while Python clears up
LATE = "type('Late', (), {'__del__': lambda self, act=signal.raise_signal: act(2)})()"


@pytest.mark.parametrize('init, act, status, out, err', [
    ('', "signal.raise_signal(signal.SIGINT); print('whole')", 0, 'whole\ndestroyed\n', ''),
    ('', "signal.raise_signal(signal.SIGTERM); print('whole')", 0, 'whole\ndestroyed\n', ''),
    ('signal.raise_signal(signal.SIGINT)', "print('never')", 0, 'destroyed\n', ''),
    ('', "raise Stop('done')", 0, 'done\ndestroyed\n', ''),
    ('', "raise Stop('error: disk', 1)", 1, 'destroyed\n', 'error: disk\n'),
    ("raise ValueError('no such bag')", '', 2, '', 'error: no such bag\n'),
    (f'import __main__; __main__.late = {LATE}', 'raise Stop()', 0, 'destroyed\n', ''),
])
def test_how_a_node_ends(domain_id, init, act, status, out, err):
    script = SCRIPT.format(init=init or 'pass', act=act or 'pass')
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (status, out, err)


@pytest.mark.parametrize('arguments, words', [
    (['--params-file', 'nowhere.yaml'], "'--params-file nowhere.yaml'. Error: Error opening"),
    (['-p', 'horizon=3.0'], "'-p horizon=3.0'"), (['--unheard'], '--unheard')])
def test_arguments_that_ros_cannot_read(domain_id, arguments, words):
    script = SCRIPT.format(init='pass', act='pass')
    done = subprocess.run([sys.executable, '-c', script, '--ros-args', *arguments], text=True,
                          capture_output=True,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, timeout=60)
    *_, last = done.stderr.splitlines()  # rcl writes a line of its own
    assert done.returncode == 2 and not done.stdout
    assert last.startswith('error: ROS arguments: ') and words in last


@pytest.mark.parametrize('argument, status', [('--help', 0), ('horizon:=2.0', 2)])
def test_what_is_no_ros_argument_is_not_lost(domain_id, argument, status):
    script = SCRIPT.format(init='pass', act='pass')
    done = subprocess.run(
        [sys.executable, '-c', script, argument, '--ros-args', '-p', 'a:=1'], text=True,
        capture_output=True, env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, timeout=60)
    assert done.returncode == status
    assert '--ros-args [-p NAME:=VALUE]' in (done.stderr if status else done.stdout)
    assert status == 0 or done.stderr.startswith('error: horizon:=2.0: ')


def test_a_failing_callback_is_not_hidden(domain_id):
    script = SCRIPT.format(init='pass', act="raise ValueError('bug')")
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, timeout=60)
    assert done.returncode == 1 and 'Traceback' in done.stderr
    assert done.stdout == 'destroyed\n'


@pytest.mark.parametrize('node', ['alignment', 'altitude', 'guidance', 'landing', 'player',
                                  'predictor', 'recorder', 'simulator'])
def test_every_node_runs_as_a_module(domain_id, node):
    done = subprocess.run([sys.executable, '-m', f'deck_motion_ros.nodes.{node}', '--help'],
                          capture_output=True, text=True, timeout=60,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)})
    assert done.returncode == 0 and 'a node takes' in done.stdout + done.stderr

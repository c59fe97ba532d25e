"""``deck_motion demo``: simulator, predictor and recorder as ROS 2 processes, and a live table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees, isnan
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

STARTING = 20.0  # s that the nodes may take to find each other


class DemoFailed(RuntimeError):
    """A node of the demo ended before its time; the text holds its last words."""


def run_demo(duration: float, output: Path, console: Console) -> None:
    """
    Run the demo.

    Parameters
    ----------
    duration : float
        Seconds of simulated ship, in real time.
    output : Path
        Folder for the bag and the report; must not exist.
    console : Console
        Where the table goes.

    Raises
    ------
    FileExistsError
        If the folder exists.
    DemoFailed
        If ROS 2 is missing or a node ends early.

    """
    from deck_motion_ros.evaluation.report import write_report

    # on this host only, in a domain where nobody else is
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(random.SystemRandom().randint(1, 100)))
    try:
        import rclpy
    except ImportError as error:
        raise DemoFailed(
            f"the demo needs ROS 2 ({error}): source /opt/ros/jazzy/setup.bash, or "
            "pip install 'deck_motion_ros[ros]'") from None
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from deck_motion_ros.nodes.monitor import MonitorNode

    output.mkdir(parents=True)
    bag = output / 'bag'
    console.print(f'Simulated destroyer in sea state 5 for {duration:g} s; everything is '
                  f'recorded to {bag}')
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        monitor = MonitorNode()
        executor = SingleThreadedExecutor()
        executor.add_node(monitor)
        with _nodes(output, ('recorder', {'output': str(bag)}), ('predictor', {})) as running:
            _await_nodes(executor, monitor, running, output)
            with _nodes(output, ('simulator', {'duration': float(duration),
                                                'subscribers': 2})) as ship:
                _watch(executor, monitor, {**running, **ship}, duration, output, console)
        monitor.destroy_node()
    except KeyboardInterrupt:
        console.print(f'Bag     {bag}')
        raise
    finally:
        rclpy.try_shutdown()
    report = output / 'report.html'
    for sentence in write_report(bag, report, title='Demo: a simulated destroyer'):
        console.print(sentence, markup=False)
    console.print(f'Bag     {bag}\nReport  {report}')


@contextmanager
def _nodes(output: Path, *table: tuple[str, dict[str, Any]]
           ) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Run nodes, each in a session of its own, and end them with SIGINT."""
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, params in table:
            command = [sys.executable, '-c',
                       f'from deck_motion_ros.nodes.{name} import main; main()', '--ros-args']
            for key, value in params.items():
                command += ['-p', f'{key}:={value}']
            with (output / f'{name}.log').open('wb') as log:
                running[name] = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                    start_new_session=True)
        yield running
    finally:
        for name in reversed(running):
            _end(running[name])
        for name, process in running.items():
            if process.returncode == 0:
                (output / f'{name}.log').unlink(missing_ok=True)
    _check(running, output)


def _end(process: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                continue


def _last_words(output: Path, name: str) -> str:
    lines = (output / f'{name}.log').read_text(errors='replace').strip().splitlines()
    return lines[-1] if lines else 'it said nothing'


def _await_nodes(executor: Any, monitor: Any, running: dict[str, subprocess.Popen[bytes]],
                 output: Path) -> None:
    """Spin until the nodes are there, so that the first message finds them."""
    end = time.monotonic() + STARTING
    while not set(running) <= set(monitor.get_node_names()):
        executor.spin_once(timeout_sec=0.1)
        _check(running, output)
        if time.monotonic() > end:
            raise DemoFailed(f"{' and '.join(running)} did not appear within {STARTING:g} s")


def _check(running: dict[str, subprocess.Popen[bytes]], output: Path) -> None:
    for name, process in running.items():
        if process.poll():
            raise DemoFailed(f'{name} ended with status {process.returncode}: '
                             f'{_last_words(output, name)}')


def _watch(executor: Any, monitor: Any, running: dict[str, subprocess.Popen[bytes]],
           duration: float, output: Path, console: Console) -> None:
    """Show the table until the simulator has ended; one line in ten seconds without a terminal."""
    start = time.monotonic()
    limit = start + 2 * duration + STARTING
    with Live(console=console, refresh_per_second=4, transient=not console.is_terminal,
              auto_refresh=False) as live:
        next_show = begun = start
        while running['simulator'].poll() is None:
            executor.spin_once(timeout_sec=0.05)
            _check(running, output)
            now = time.monotonic()
            if isnan(monitor.motion[0]):
                begun = now
            if now > limit:
                raise DemoFailed('the simulator did not end')
            if now >= next_show and console.is_terminal:
                live.update(_table(monitor, duration, now - begun), refresh=True)
                next_show = now + 0.25
            elif now >= next_show + 10.0:
                console.print(_line(monitor, min(now - begun, duration)))
                next_show = now
    if not console.is_terminal:
        console.print(_line(monitor, duration))


def _line(monitor: Any, elapsed: float) -> str:
    return (f'{elapsed:4.0f} s: touchdown height {monitor.height:+.2f} m, in 3 s '
            f'{monitor.predicted:+.2f} +- {monitor.predicted_sd:.2f} m; score: {monitor.score}')


def _table(monitor: Any, duration: float, elapsed: float) -> Table:
    def number(value: float, form: str = '+.2f') -> str:
        return '-' if isnan(value) else format(value, form)

    roll, pitch, heave = monitor.motion
    table = Table(title=f'{min(elapsed, duration):.0f} of {duration:g} s', title_justify='left',
                  box=None, pad_edge=False, show_header=False)
    for _ in range(2):
        table.add_column()
    table.add_row('Motion now', f'roll {number(degrees(roll))} deg   '
                  f'pitch {number(degrees(pitch))} deg   heave {number(heave)} m')
    table.add_row('Touchdown height now', f'{number(monitor.height)} m')
    table.add_row('  in 3 s', f'[bold]{number(monitor.predicted)} m[/bold] '
                  f'+- {number(monitor.predicted_sd, ".2f")} m (1 sd)')
    table.add_row('Score', f'[bold]{monitor.score}[/bold]')
    table.add_row('', f'{monitor.rejected} messages rejected')
    return table

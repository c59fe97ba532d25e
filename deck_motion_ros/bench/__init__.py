"""
``deck_motion bench``: speed, memory and accuracy against peers measured in the same run.

Each bench runs in a process of its own, linear algebra on one thread, ROS on this host only.
On a busy machine the CPU times still hold, the latencies do not: ``chrt -f 10 deck_motion bench
latency`` helps there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import json
import os
from pathlib import Path
import random
import subprocess
import sys
from tempfile import TemporaryFile

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from deck_motion_ros.bench.alignment import alignment
from deck_motion_ros.bench.altitude import altitude
from deck_motion_ros.bench.figures import Figure
from deck_motion_ros.bench.filters import kalman
from deck_motion_ros.bench.landing import landing
from deck_motion_ros.bench.live import latency, recorder
from deck_motion_ros.bench.offline import memory, replay, simulator
from deck_motion_ros.bench.prediction import prediction
from deck_motion_ros.bench.window import window
from deck_motion_ros.blas import VARIABLES

# what they give: figures, the share that is done (float), remarks (str)
BENCHES: Mapping[str, Callable[[], Iterator[Figure | float | str]]] = {
    'kalman': kalman, 'latency': latency, 'replay': replay, 'recorder': recorder,
    'memory': memory, 'simulator': simulator, 'prediction': prediction, 'landing': landing,
    'altitude': altitude, 'alignment': alignment, 'window': window}
LONG = ('prediction', 'window')  # minutes: only if named
HEAD = ('figure', 'ours', 'unit', 'reference', 'its figure', 'ratio', 'quartiles', 'goal', '')
WIDE = 100  # columns of a terminal that shows all of them


def run(names: Sequence[str], json_path: Path | None, console: Console) -> int:
    """
    Run benches, print their figures and write them to a file.

    Parameters
    ----------
    names : sequence of str
        In ``BENCHES``; all but those in ``LONG`` if none.
    json_path : Path or None
        File to write.
    console : Console
        Where table and progress go.

    Returns
    -------
    int
        0, or 1 if a bench could not run; a missed goal is not an error.

    Raises
    ------
    ValueError
        If a name is unknown or the file's folder does not exist.

    """
    for name in names:
        if name not in BENCHES:
            raise ValueError(f"unknown bench '{name}'; there are {', '.join(BENCHES)}")
    if json_path and not json_path.parent.is_dir():
        raise ValueError(f'{json_path}: there is no such folder')
    chosen = names or [name for name in BENCHES if name not in LONG]
    figures: list[Figure] = []
    lines: list[str] = []
    failed = False
    with Progress(TextColumn('{task.description}'), BarColumn(), TimeElapsedColumn(),
                  console=console, transient=True, refresh_per_second=1) as progress:
        task = progress.add_task('', total=len(chosen))
        for done, name in enumerate(chosen):
            progress.update(task, description=name, completed=done)
            try:
                for item in in_own_process(name):
                    if isinstance(item, Figure):
                        figures.append(item)
                    elif isinstance(item, str):
                        lines.append(item)
                    else:
                        progress.update(task, completed=done + item)
            except RuntimeError as error:
                lines.append(f'{name}: {error}')
                failed = True
    headlines = [figure for figure in figures if figure.headline]
    console.print(_table(headlines, console.width))
    if headlines != figures:
        lines.append(f'{len(figures) - len(headlines)} more figures: --json')
    for line in lines + remarks(figures):
        console.print(line, markup=False, soft_wrap=True)
    if json_path:
        rows = [figure.as_dict() for figure in figures]
        json_path.write_text(json.dumps(rows, indent=1) + '\n')
    return 1 if failed else 0


def in_own_process(name: str) -> Iterator[Figure | float | str]:
    """
    Run one bench alone; give what it gives as it comes.

    Raises
    ------
    RuntimeError
        If it fails; the text holds its last words.

    """
    settings = dict.fromkeys(VARIABLES, '1') | {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(random.SystemRandom().randint(1, 100))}
    with TemporaryFile('w+') as words, subprocess.Popen(
            [sys.executable, '-m', 'deck_motion_ros.bench', name], env={**os.environ, **settings},
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=words, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:  # after Ctrl-C the process ends its nodes by itself
            item = json.loads(line)
            yield Figure(**item) if isinstance(item, dict) else item
        process.wait()
        words.seek(0)
        last = words.read().strip().splitlines()[-1:]
    if process.returncode:
        raise RuntimeError(last[0] if last else f'ended with status {process.returncode}')


def remarks(figures: Sequence[Figure]) -> list[str]:
    """Say which peers were missing and whether the machine was too busy to trust latencies."""
    lines = [f'{figure.reference}: no ratio for {figure.bench} {figure.name}'
             for figure in figures if figure.reference and figure.reference_value is None]
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if load > cores:
        lines.append(f'the machine is busy ({load:.1f} processes on {cores} cores): '
                     'latencies are not to be trusted')
    return lines


def cells(figure: Figure) -> tuple[str, ...]:
    """Write a figure as the texts of one row under ``HEAD``."""
    spread = figure.spread and '{:.3g} to {:.3g}'.format(*figure.spread)
    verdict = {None: '', True: 'met', False: 'missed'}[figure.met]
    return (f'{figure.bench} {figure.name}'.replace('_', ' '), _text(figure.value), figure.unit,
            figure.reference or '', _text(figure.reference_value), _text(figure.ratio),
            spread or '', figure.goal, verdict)


def _text(number: float | None) -> str:
    if number is None:
        return ''
    return f'{number:,.0f}' if abs(number) >= 1000 or number == int(number) else f'{number:.3g}'


def _table(figures: Sequence[Figure], width: int) -> Table:
    shown = [k for k, name in enumerate(HEAD)
             if width >= WIDE or name not in ('its figure', 'quartiles')]
    table = Table(*(HEAD[k] for k in shown), box=None)
    for k, column in zip(shown, table.columns, strict=True):
        if k in (1, 4, 5):
            column.justify, column.no_wrap = 'right', True
    for figure in figures:
        style = {None: '', True: 'green', False: 'red'}[figure.met]
        *texts, verdict = cells(figure)
        texts.append(f'[{style}]{verdict}[/]' if style else verdict)
        table.add_row(*(texts[k] for k in shown))
    return table

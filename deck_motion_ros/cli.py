"""The command line: ``deck_motion``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
import json
from pathlib import Path
import signal
import sys
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from deck_motion_ros import __version__
from deck_motion_ros.blas import use_one_thread
from deck_motion_ros.topics import TOPICS

use_one_thread()

# tables keep their width where nobody looks at them
console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 120)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


def main(argv: Sequence[str] | None = None) -> None:
    """
    Run one command and end the process.

    Status 0 when all went well, 1 when a node of the demo failed, 2 for wrong input (one line
    says what and where), 130 after Ctrl-C.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        arguments = parser().parse_args(argv)
        sys.exit(arguments.act(arguments))
    except KeyboardInterrupt:
        errors.print('interrupted')
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    except (ValueError, OSError) as error:
        errors.print(f'error: {_one_line(error)}', markup=False)
        sys.exit(2)
    except RuntimeError as error:
        errors.print(f'error: {_one_line(error)}', markup=False)
        sys.exit(1)


def _interrupt(number: int, frame: Any) -> None:
    """End at the first Ctrl-C; no second one breaks into what clears up."""
    signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename:
        return f'{error.filename}: {error.strerror}'
    return ' '.join(str(error).split())


def parser() -> argparse.ArgumentParser:
    """Build the parser of all commands."""
    top = argparse.ArgumentParser(
        prog='deck_motion', description='Know where the deck will be: forecasts of the height '
        'of a touchdown point on a moving ship.')
    top.add_argument('--version', action='version', version=__version__)
    top.set_defaults(act=lambda arguments: top.print_help())
    commands = top.add_subparsers(metavar='COMMAND')

    def command(name: str, act: Any, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + '.')
        sub.set_defaults(act=act)
        return sub

    def remappable(sub: argparse.ArgumentParser) -> None:
        sub.add_argument('--remap', action='append', default=[], metavar='OLD:=NEW',
                         help="another name for one of the contract's topics; repeatable")

    sub = command('demo', _demo, 'run a simulated ship, the predictor and the recorder on ROS 2')
    sub.add_argument('--duration', type=float, default=60.0, metavar='S',
                     help='seconds of ship, in real time (default 60)')
    sub.add_argument('--output', type=Path, metavar='DIR',
                     help='folder for bag and report, must not exist (default: by date and time)')

    sub = command('replay', _replay, 'run a node over a recorded bag, without ROS')
    sub.add_argument('in_bag', type=Path, metavar='IN_BAG', help='bag to read')
    sub.add_argument('out_bag', type=Path, metavar='OUT_BAG',
                     help='bag to write, must not exist: the inputs and what the node says')
    sub.add_argument('--node', required=True, help='which node',
                     choices=sorted({node for topic in TOPICS for node in topic.subscribers}))
    sub.add_argument('--params-file', type=Path, metavar='F', help='ROS 2 parameter file')
    sub.add_argument('-p', '--param', action='append', default=[], metavar='NAME:=VALUE',
                     help='one parameter, after the file; repeatable')
    remappable(sub)
    sub.add_argument('--namespace', default='/', metavar='NS',
                     help='of the node and its topics (default: /)')

    sub = command('import', _import, 'make a bag of a CSV file or a raw NMEA log')
    sub.add_argument('file', type=Path, metavar='FILE', help='CSV file or NMEA 0183 log')
    sub.add_argument('out_bag', type=Path, metavar='OUT_BAG', help='bag to write, must not exist')
    sub.add_argument('--time-column', default='', metavar='NAME',
                     help='CSV column with the seconds (default: t_s)')

    sub = command('recover', _recover, 'repair a bag whose recorder was killed')
    sub.add_argument('bag', type=Path, metavar='BAG', help='bag to repair, in place')

    sub = command('report', _report, 'write a bag as one HTML page')
    sub.add_argument('bag', type=Path, metavar='BAG', help='bag to read')
    sub.add_argument('-o', '--output', type=Path, default=Path('report.html'), metavar='FILE',
                     help='page to write (default report.html)')
    sub.add_argument('--lever-arm', type=float, nargs=3, metavar=('X', 'Y', 'Z'),
                     help='touchdown point from the sensor, metres forward, left, up '
                     "(default: what the bag's predictor had)")
    sub.add_argument('--warm-up', type=float, metavar='S',
                     help='seconds at the start that are not scored (default: 120, or 20 of a '
                     'record below 5 minutes)')
    remappable(sub)
    sub.add_argument('--namespace', metavar='NS', help='of the ship, if the bag holds several')

    sub = command('papers', _papers, "run the papers' experiments beside their figures")
    sub.add_argument('keys', nargs='*', metavar='KEY', help='which papers (default: all)')
    sub.add_argument('--runs', type=int, metavar='N', help='Monte-Carlo runs')
    sub.add_argument('--json', type=Path, metavar='FILE', help='write the figures there too')

    sub = command('bench', _bench, 'measure speed, memory, accuracy against peers')
    sub.add_argument('names', nargs='*', metavar='NAME',
                     help='which benches (default: all but prediction and window, which take '
                     'minutes)')
    sub.add_argument('--json', type=Path, metavar='FILE', help='write the figures there too')
    return top


def _demo(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.demo import run_demo

    if not 1 <= arguments.duration <= 86400:
        raise ValueError('--duration must be 1 to 86400 s')
    name = f'deck_motion_demo_{datetime.now():%Y%m%d_%H%M%S}'
    run_demo(arguments.duration, arguments.output or Path(name), console)
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.params_file import parse_assignments, read_params_file
    from deck_motion_ros.replaying import replay

    params: dict[str, Any] = {}
    if arguments.params_file:
        params = read_params_file(arguments.params_file, arguments.node, arguments.namespace)
    params |= parse_assignments(arguments.param)
    with Progress(console=errors, transient=True, disable=not errors.is_terminal) as progress:
        task = progress.add_task('replaying', total=1.0)
        done = replay(
            arguments.in_bag, arguments.out_bag, arguments.node, params,
            remap=arguments.remap, namespace=arguments.namespace,
            warn=lambda text: errors.print(f'warning: {text}', markup=False),
            progress=lambda fraction: progress.update(task, completed=fraction))
    console.print(f'{arguments.out_bag}: {done.inputs} messages in, {done.outputs} out, '
                  f'{done.seconds:.0f} s of record')
    return 0


def _import(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.importers import import_file

    console.print(str(import_file(arguments.file, arguments.out_bag, arguments.time_column)),
                  markup=False)
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.recording import recover

    console.print(str(recover(arguments.bag)), markup=False)
    return 0


def _report(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.evaluation.report import write_report

    lever_arm = arguments.lever_arm and tuple(arguments.lever_arm)
    with console.status('drawing'):
        headline = write_report(arguments.bag, arguments.output, lever_arm=lever_arm,
                                warm_up=arguments.warm_up, namespace=arguments.namespace,
                                remap=arguments.remap)
    for sentence in headline:
        console.print(sentence, markup=False)
    console.print(f'{arguments.output}')
    return 0


def _papers(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.evaluation.experiments import PAPERS

    unknown = [key for key in arguments.keys if key not in PAPERS]
    if unknown:
        raise ValueError(f"unknown paper '{unknown[0]}'; there are {', '.join(PAPERS)}")
    if arguments.runs is not None and not 1 <= arguments.runs <= 100_000:
        raise ValueError('--runs must be 1 to 100000')
    if arguments.json and not arguments.json.parent.is_dir():
        raise ValueError(f'{arguments.json}: there is no such folder')
    rows = []
    for key in arguments.keys or PAPERS:
        with console.status(f'{key} ...'):
            rows += PAPERS[key](arguments.runs)
    table = Table('figure', 'ours', 'unit', 'printed', 'floor', 'ours / floor', box=None)
    for row in rows:
        table.add_row(
            f'{row.paper} {row.name}', f'{row.value:.4g}', row.unit,
            '' if row.printed is None else f'{row.printed:.4g}',
            '' if row.floor is None else f'{row.floor:.4g}',
            '' if row.floor is None else f'{row.value / row.floor:.3f}')
    console.print(table)
    if arguments.json:
        _write_json(arguments.json, [row.as_dict() for row in rows])
    return 0


def _bench(arguments: argparse.Namespace) -> int:
    from deck_motion_ros.bench import run

    return run(arguments.names, arguments.json, console)


def _write_json(path: Path, rows: list[dict[str, Any]]) -> None:
    path.write_text(json.dumps(rows, indent=1) + '\n')

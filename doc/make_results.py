"""
Write doc/results.md: ``python doc/make_results.py [FILE]``, some ten minutes.

Recordings of real ships are scored if DECK_MOTION_DATA (default ../shared/data from the project's
root) names their folder.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
import platform
import sys
import tempfile

import numpy as np
from rich.console import Console

from deck_motion_ros import bench
from deck_motion_ros.evaluation.experiments import PAPERS
from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.evaluation.report import assessed
from deck_motion_ros.importers import import_file
from deck_motion_ros.replaying import replay

ROOT = Path(__file__).resolve().parents[1]
METHODS = ('shaping', 'adaptive')
DATA = Path(os.environ.get('DECK_MOTION_DATA') or ROOT / '../shared/data').resolve()
POINTS = {'reference point': [0.0, 0.0, 0.0], '35 m aft': [-35.0, 0.0, 0.0],
          '10 m to port': [0.0, 10.0, 0.0]}
RECORDS = (
    ('R/V Nathaniel B. Palmer (94 m), Seapath 330, 1 Hz', 'nmea/NBP1406_s330-2014-08-01', POINTS),
    ('the same ship and time, Seapath 200', 'nmea/NBP1406_seap-2014-08-01', POINTS),
    ('R/V Sikuliaq, flat calm, 1 Hz', 'nmea/SKQ201822S_ins_seapath_position-2018-12-06', POINTS),
    ('sailing yacht, attitude alone, 10 Hz', 'ship/yacht_piran_n2k.csv',
     {'5 m aft': [-5.0, 0.0, 0.0], '5 m to port': [0.0, 5.0, 0.0]}),
    ('float, attitude alone, 8 Hz', 'ship/sig1000_float_20170724.csv',
     {'5 m aft': [-5.0, 0.0, 0.0], '5 m to port': [0.0, 5.0, 0.0]}),
    ('Waverider buoy, heave alone, 1.28 Hz, 12 h', 'ship/waverider_2005-07-01_first12h.csv',
     {'reference point': [0.0, 0.0, 0.0]}))
HEAD = ('# Results\n\nWritten by `python doc/make_results.py` on {machine}. Speeds are ratios '
        'measured side by side in one run, so that they carry over to other machines.')


def table(head: list[str], rows: list[list[str]]) -> str:
    """Format a Markdown table."""
    return '\n'.join(f"| {' | '.join(row)} |" for row in [head, ['---'] * len(head), *rows])


def papers() -> str:
    """Run the papers' experiments."""
    rows = [[row.paper, row.name, f'{row.value:.4g} {row.unit}',
             '' if row.printed is None else f'{row.printed:.4g}',
             '' if row.floor is None else f'{row.floor:.4g}',
             '' if row.floor is None else f'{row.value / row.floor:.3f}']
            for key in PAPERS for row in PAPERS[key](None)]
    return ('## The papers\n\n`deck_motion papers`: what they are is in [papers.md](papers.md). '
            'The floor is the Riccati bound for Li2014, the Wiener predictor for Zhang2021.\n\n'
            + table(['paper', 'figure', 'ours', 'printed', 'floor', 'ours / floor'], rows))


def recordings() -> str:
    """Replay and score the recordings."""
    rows = []
    for name, file, points in RECORDS:
        for point, arm in points.items():
            judged = {}
            with tempfile.TemporaryDirectory() as work:
                import_file(DATA / file, Path(work, 'bag'))
                for method in METHODS:
                    out = Path(work, method)
                    replay(Path(work, 'bag'), out, 'predictor',
                           {'lever_arm': arm, 'method': method})
                    judged[method] = assessed(read_record(out)).judged
            any_method = judged[METHODS[0]]
            sd = float(np.std(any_method.came))
            unit, scale = ('m', 1.0) if sd > 0.1 else ('cm', 100.0)
            rows.append([
                name, point, *(f'{scale * value:.2f} {unit}' for value in (
                    *(judged[method].rmse for method in METHODS), any_method.persistence, sd)),
                *(f'{judged[method].rmse / sd:.2f}' for method in METHODS),
                *(f'{100 * judged[method].coverage(0.95):.0f} %' for method in METHODS)])
            name = ''
    return ('## Recordings of real ships\n\nNobody simulated these. '
            '`deck_motion import FILE bag`, `deck_motion replay bag out --node predictor '
            '-p lever_arm:="[-35.0, 0.0, 0.0]" -p method:=adaptive`, `deck_motion report out`: '
            'rms errors of the height 3 s ahead, cold start, causal, scored against the '
            'measurements from second 120 on (20 on if the record is shorter than five minutes). '
            'Persistence is "it stays as it is".\n\n' + table(
                ['record', 'point', *METHODS, 'persistence', 'sd of the motion',
                 *(f'{method} / sd' for method in METHODS),
                 *(f'within the 95 % interval, {method}' for method in METHODS)], rows))


def speeds() -> str:
    """Run the benches."""
    with tempfile.TemporaryDirectory() as work:
        path = Path(work, 'bench.json')
        bench.run([], path, Console(stderr=True))
        figures = json.loads(path.read_text())
    rows = [[row['bench'], row['name'], f"{row['value']:.4g} {row['unit']}",
             row['reference'] or '',
             '' if row['reference_value'] is None else f"{row['reference_value']:.4g}",
             '' if row['ratio'] is None else f"{row['ratio']:.3g}"] for row in figures]
    return '## Speed and memory\n\n`deck_motion bench`\n\n' + table(
        ['bench', 'figure', 'ours', 'reference', 'its figure', 'ratio'], rows)


def main() -> None:
    """Write the document; without the recordings' folder their section says so."""
    machine = f'{os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}'
    parts = [HEAD.format(machine=machine), papers(),
             recordings() if DATA.is_dir() else '## Recordings of real ships\n\nNot at hand.',
             speeds()]
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'doc' / 'results.md'
    target.write_text('\n\n'.join(part.strip() for part in parts) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()

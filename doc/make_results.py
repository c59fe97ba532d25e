"""
Write doc/results.md, prediction.png, landing.png: ``python doc/make_results.py [FOLDER]``.

Some twenty minutes on two cores.

Recordings of real ships are scored if DECK_MOTION_DATA (default ../shared/data from the project's
root) names their folder.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
import os
from pathlib import Path
import platform
import sys
import tempfile

import matplotlib
import numpy as np
from rich.console import Console

from deck_motion_ros import bench
from deck_motion_ros.bench.prediction import figures, scored, SETTLED, tables
from deck_motion_ros.blas import use_one_thread
from deck_motion_ros.evaluation.assessment import assessed
from deck_motion_ros.evaluation.experiments import PAPERS
from deck_motion_ros.evaluation.guidance import closed_loop, rows
from deck_motion_ros.evaluation.guidance import draw as draw_landings
from deck_motion_ros.evaluation.prediction import HORIZONS, Scores
from deck_motion_ros.evaluation.record import read_record
from deck_motion_ros.evaluation.recovery import recoveries
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
PANELS = {
    'destroyer_ss5_135': 'destroyer, sea state 5, bow sea',
    'cvn65_ss5_135': 'CVN-65, sea state 5, bow sea',
    'patrol_ss4_135': 'patrol vessel, sea state 4, bow sea',
    'destroyer_ss6_090': 'destroyer, sea state 6, beam sea',
    'destroyer_ss5_noise_x10': 'destroyer, ten times the noise',
    'destroyer_ss5_long_crested': 'destroyer, long-crested sea'}
TICKS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
LINES = {  # in the order of the legend
    'persistence': ('#6e7781', ':'), 'zero': ('#6e7781', '--'), 'Li2014 tuned': ('#cc79a7', '-'),
    'harmonic bank': ('#e69f00', '-'), 'AR(30)': ('#00795a', '-'), 'adaptive': ('#0072b2', '-')}
DETAILS = ('_95', '_sd', '_rms', '_ratio')
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
            for key in PAPERS for row in PAPERS[key](None)
            if row.paper != 'Bai2016' or row.printed or not row.name.endswith(DETAILS)]
    return ('## The papers\n\n`deck_motion papers`: what they are is in [papers.md](papers.md). '
            'The floor is the Riccati bound for Li2014, the Wiener predictor for Zhang2021, the '
            'filter without disturbance for Bai2016, the posterior Cramer-Rao bound for Pan2020, '
            'the optimal estimator for the true sea for LiSkimming. Of Bai2016 stated sds, 95 % '
            'bounds and ratios to undisturbed runs are left out.\n\n'
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


def prediction(picture: Path) -> str:
    """Run all predictors over scenarios and recordings; draw them."""
    use_one_thread()  # in the processes that it starts
    *_, scores = scored(folder=DATA / 'ship' if DATA.is_dir() else None)
    draw([item for item in scores if item.record in PANELS], picture)
    headlines = [[figure.name, f'{figure.value:.3g} {figure.unit}', figure.goal,
                  {None: '', True: 'met', False: 'missed'}[figure.met]]
                 for figure in figures(scores) if figure.headline]
    return (
        '## Predictors side by side\n\n`deck_motion bench prediction`: half-hour scenarios '
        '(`PREDICTION_SCENARIOS`: 10 Hz, noise of 0.03 deg and 5 cm, short-crested but for one) '
        'and recordings, all from a cold start, causally. A scenario is scored against the '
        'truth. The floor is the causal Wiener predictor, which knows spectra and noise exactly, '
        'run on the same record; after a manoeuvre it knows the new course and speed (in the '
        'first half minute its memory is still of the old). Below the recordings of ships nobody '
        'knows the spectra: the floor is an estimate from a VAR fitted to the whole record. '
        '"Zero" is the rest position, so that list and trim count as error; Zhang2021 is made '
        'for up to 1 s.\n\n'
        f'![Error by horizon of all predictors, and the floor]({picture.name})\n\n'
        f"{tables(scores)}\n\n{table(['figure', 'ours', 'goal', ''], headlines)}")


def draw(scores: list[Scores], picture: Path) -> None:
    """Draw error / sd over the horizon, minutes 10-30, a panel for each scenario."""
    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(9.6, 5.6), sharex=True, sharey=True,
                                layout='constrained')
    for panel, item in zip(axes.flat, scores, strict=True):
        rows = [item.windows.index(window) for window in SETTLED]

        def share(rmse: np.ndarray) -> np.ndarray:
            return np.sqrt(np.mean(np.square(rmse[rows]), axis=0)) / item.sd

        for method, (colour, style) in LINES.items():
            panel.plot(HORIZONS, share(item.rmse[method]), style, color=colour, label=method,
                       linewidth=2.0 if method == 'adaptive' else 1.2)
        panel.plot(HORIZONS, share(item.floor), color='black', label='floor', linewidth=1.2)
        panel.set_title(PANELS[item.record], fontsize=10)
        panel.set(yscale='log', ylim=(0.007, 3.0), xticks=HORIZONS)
        panel.set_yticks(TICKS, [f'{tick:g}' for tick in TICKS])
        panel.grid(color='#e6e8eb')
        panel.spines[['top', 'right']].set_visible(False)
    figure.supxlabel('seconds ahead', fontsize=10)
    figure.supylabel('rms error / sd of the touchdown height', fontsize=10)
    handles, names = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, names, loc='outside upper center', ncols=len(names), frameon=False)
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def landings(picture: Path) -> str:
    """Fly the landings with and without forecast; draw them."""
    flown = closed_loop()
    draw_landings(flown, picture)
    figures = [[row.name, f'{row.value:.3g} {row.unit}'] for row in rows(flown)]
    return (
        '## What a forecast is worth: landings in closed loop\n\n'
        '`python -m deck_motion_ros.evaluation.guidance`: 200 landings each, with the same gusts. '
        '`forecast` touches down when the deck is about to move with the aircraft, `plain` '
        'descends as soon as it is above the deck, at 0.7 m/s, `plain_slow` at 0.3 m/s. Closing '
        'is the vertical speed of aircraft and deck towards one another at touchdown.\n\n'
        f'![Closing speeds of all landings]({picture.name})\n\n{table(["figure", ""], figures)}')


def faults() -> str:
    """Run the adaptive predictor on bad input."""
    found = [[item.fault, f'{item.seconds:.0f} s', f'{item.worst:.1f}',
              f'{100 * item.covered:.0f} %'] for item in recoveries()]
    return ('## Bad input\n\n`deck_motion_ros.evaluation.recovery.recoveries()`: sensors of a '
            'destroyer fail in minute 5. Recovered is the adaptive predictor when it errs by less '
            'than 1.2 times the undisturbed run over the next 30 s, counted from the end of a '
            'fault that passes and from the beginning of one that stays. Worst and coverage are '
            'those of the 95 % interval meanwhile.\n\n' + table(
                ['fault', 'recovered after', 'worst error / sd', 'within the 95 % interval'],
                found))


def measured(heading: str, names: list[str], words: str) -> str:
    """Run benches."""
    with tempfile.TemporaryDirectory() as work:
        path = Path(work, 'bench.json')
        bench.run(names, path, Console(stderr=True))
        figures = json.loads(path.read_text())
    found = [[row['bench'], row['name'], f"{row['value']:.4g} {row['unit']}",
              row['reference'] or '',
              '' if row['reference_value'] is None else f"{row['reference_value']:.4g}",
              '' if row['ratio'] is None else f"{row['ratio']:.3g}"] for row in figures]
    return f'## {heading}\n\n{words}\n\n' + table(
        ['bench', 'figure', 'ours', 'reference', 'its figure', 'ratio'], found)


def sections(folder: Path) -> Iterator[str]:
    """Give the document's parts; without the recordings' folder theirs says so."""
    machine = f'{os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}'
    yield HEAD.format(machine=machine)
    yield papers()
    yield prediction(folder / 'prediction.png')
    yield recordings() if DATA.is_dir() else '## Recordings of real ships\n\nNot at hand.'
    yield measured('The landing window', ['window'], '`deck_motion bench window`: quiet for 5 s '
                   'within the limits of a preset, on the stationary scenarios from minute 5 on.')
    yield landings(folder / 'landing.png')
    yield faults()
    yield measured('Speed and memory', [], '`deck_motion bench`')


def main() -> None:
    """Write the document."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'doc'
    text = '\n\n'.join(part.strip() for part in sections(folder)) + '\n'
    (folder / 'results.md').write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()

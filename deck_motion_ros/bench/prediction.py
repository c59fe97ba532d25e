"""Every predictor and the floor over the frozen scenarios and the recordings, side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
import os
from pathlib import Path

import numpy as np

from deck_motion_ros.bench.figures import Figure
from deck_motion_ros.evaluation.parallel import results
from deck_motion_ros.evaluation.prediction import (
    ADAPTIVE,
    AFTER,
    HORIZONS,
    METHODS,
    recording_scores,
    scenario_scores,
    Scores,
    STEADY,
)
from deck_motion_ros.samples import Array
from deck_motion_ros.scenarios import PREDICTION_SCENARIOS, PredictionScenario

# the longest first: they decide how long all take on several cores
RECORDINGS = {
    'waverider': 'waverider_2005-07-01_first12h.csv',
    'yacht': 'yacht_piran_n2k.csv',
    'float': 'sig1000_float_20170724.csv',
    'palmer_merged_2hz': 'nbp_20140801_merged_2hz.csv',
    'palmer_seapath200': 'nbp_20140801_seapath200.csv',
    'palmer_seapath330': 'nbp_20140801_seapath330.csv',
    'sikuliaq': 'sikuliaq_20181206_seapath.csv'}
FIRST, *WINDOWS = STEADY
SETTLED = ('minutes 10-20', 'minutes 20-30')
COSTS = ('mean', 'worst call, median of scenarios')
AT_3 = HORIZONS.index(3.0)
STEADY_GOALS = dict(zip(WINDOWS, ('<= 1.5', '<= 1.3', '<= 1.13', '<= 1.08'), strict=True))
GOALS = {'destroyer_ss5_turn_90': dict(zip(AFTER, ('<= 1.35', '<= 1.35', '<= 1.1'), strict=True)),
         'destroyer_ss5_noise_x10': dict.fromkeys(WINDOWS[1:], '<= 1.4')}
RECORDING_GOALS = {
    'palmer_seapath330 heave': '<= 0.28', 'palmer_seapath330 pitch': '<= 0.32',
    'palmer_seapath330 roll': '<= 0.65', 'waverider heave': '<= 0.53',
    'sikuliaq roll': '<= 1', 'sikuliaq pitch': '<= 1', 'sikuliaq heave': '<= 1',
    'yacht roll': '<= 1', 'yacht pitch': '<= 1'}


def recordings_folder() -> Path:
    """Return where the recordings are looked for."""
    return Path(os.environ.get('DECK_MOTION_DATA') or '../shared/data', 'ship')


def scored(scenarios: Sequence[PredictionScenario] = PREDICTION_SCENARIOS,
           folder: Path | None = None) -> Iterator[float | list[Scores]]:
    """
    Run everything on all cores.

    Parameters
    ----------
    scenarios : sequence of PredictionScenario
        Which.
    folder : Path, optional
        Of the recordings; without it there are none.

    Yields
    ------
    float or list of Scores
        After each run the share that is done; last, the scores in the order of the scenarios.

    """
    tasks = [partial(_scenario, case) for case in scenarios]
    if folder:
        tasks = [*(partial(recording_scores, name, folder / file)
                   for name, file in RECORDINGS.items()), *tasks]
    found: list[list[Scores]] = []
    for scores in results(tasks):
        found.append(scores)
        yield len(found) / len(tasks)
    first = len(tasks) - len(scenarios)
    yield [item for scores in found[first:] + found[:first] for item in scores]


def _scenario(case: PredictionScenario) -> list[Scores]:
    return [scenario_scores(case)]


def prediction() -> Iterator[Figure | float | str]:
    """Run scenarios and recordings; give what share is done, remarks, and the figures."""
    folder = recordings_folder()
    if not folder.is_dir():
        yield f'prediction: no recordings, {folder} is no folder (DECK_MOTION_DATA names another)'
    for item in scored(folder=folder if folder.is_dir() else None):
        if isinstance(item, float):
            yield item
        else:
            yield tables(item)
            yield from figures(item)


def figures(scores: Sequence[Scores]) -> Iterator[Figure]:
    """Sum up scores as figures: first those with a goal, then all methods."""
    scenarios = [item for item in scores if item.quantity == 'height']
    steady = [item for item in scenarios if item.stationary]
    named = partial(Figure, 'prediction')
    mean = 'mean of stationary scenarios'
    first = [float(item.share(ADAPTIVE, FIRST)[AT_3]) for item in steady]
    yield named(f'adaptive error / sd 3 s, {FIRST}, {mean}', float(np.mean(first)), 'sd',
                goal='<= 0.6')
    yield named(f'adaptive error / sd 3 s, {FIRST}, worst stationary scenario', max(first), 'sd')
    for window, goal in STEADY_GOALS.items():
        yield named(f'adaptive ratio to floor 3 s, {window}, {mean}',
                    float(_mean_ratio(steady, ADAPTIVE, window)[AT_3]), 'x floor', goal=goal)
    for item in scenarios:
        if not item.stationary:
            yield from _special(item)
    settled = [item.coverage[:, [item.windows.index(window) for window in WINDOWS[1:]], AT_3]
               .mean(axis=1) for item in steady]
    for probability, goal, value in zip((68, 95), ('', '93 to 97'),
                                        np.mean(settled, axis=0).tolist(), strict=True):
        yield named(f'adaptive coverage of the {probability} % interval 3 s, after minute 5, '
                    f'{mean}', 100 * value, '%', goal=goal)
    late = np.abs(np.concatenate([item.crest_errors for item in steady]))
    yield named('adaptive crest timing 2-4 s ahead, median error, stationary scenarios',
                float(np.median(late)), 's', goal='<= 0.15')
    for method in METHODS:
        costs, ours = _costs(scenarios, method), method == ADAPTIVE
        for what, cost, goal in zip(COSTS, costs, ('<= 0.3', '<= 20'), strict=True):
            yield named(f'{method} cost per input triple, {what}', cost, 'ms',
                        goal=goal if ours else '', headline=ours)
    for method in METHODS:
        for horizon, ratio in zip(HORIZONS, _mean_ratio(steady, method, *SETTLED).tolist(),
                                  strict=True):
            yield named(f'{method} ratio to floor {horizon:g} s, minutes 10-30, {mean}', ratio,
                        'x floor', headline=False)
    yield from _each(scores)


def _mean_ratio(scores: Sequence[Scores], method: str, *windows: str) -> Array:
    return np.asarray(np.mean([item.ratio(method, *windows) for item in scores], axis=0))


def _costs(scores: Sequence[Scores], method: str) -> tuple[float, float]:
    """Return COSTS (ms); a scenario is typical of the worst call, hiccups of the machine not."""
    mean, worst = 1e3 * np.array([item.cost[method] for item in scores]).T
    return float(mean.mean()), float(np.median(worst))


def _special(item: Scores) -> Iterator[Figure]:
    """Give what ``adaptive`` does in one scenario that is no part of the means."""
    goals = GOALS.get(item.record, {})
    for row, window in enumerate(item.windows):
        name = f'3 s, {window}, {item.record}'
        if window in (FIRST, 'during'):
            yield Figure('prediction', f'adaptive error / sd {name}',
                         float(item.share(ADAPTIVE, window)[AT_3]), 'sd')
        else:
            yield Figure('prediction', f'adaptive ratio to floor {name}',
                         float(item.ratio(ADAPTIVE, window)[AT_3]), 'x floor',
                         goal=goals.get(window, ''))
        if window == 'during':
            yield Figure('prediction', f'adaptive coverage of the 95 % interval {name}',
                         100 * float(item.coverage[1, row, AT_3]), '%',
                         goal='>= 90' if 'turn' in item.record else '')


def _each(scores: Sequence[Scores]) -> Iterator[Figure]:
    """Give every method on every record 3 s ahead; ``adaptive`` on recordings as headlines."""
    for item in scores:
        where = item.record if item.quantity == 'height' else f'{item.record} {item.quantity}'
        if item.quantity != 'height':
            window, = item.windows
            floor = float(item.floor[0, AT_3] / item.sd)
            yield Figure('prediction', f'estimated floor / sd 3 s, {where}', floor, 'sd',
                         headline=False)
            for method in METHODS:
                yield Figure('prediction', f'{method} error / sd 3 s, {where}',
                             float(item.share(method, window)[AT_3]), 'sd',
                             goal=RECORDING_GOALS.get(where, '') if method == ADAPTIVE else '',
                             headline=method == ADAPTIVE)
            if item.quantity == '35 m aft':
                yield Figure('prediction', f'{ADAPTIVE} error 3 s, {where}',
                             float(item.rmse[ADAPTIVE][0, AT_3]), 'm',
                             goal='<= 0.36' if item.record == 'palmer_seapath330' else '')
        elif 'during' not in item.windows:
            yield Figure('prediction', f'floor / sd 3 s, minutes 10-30, {where}',
                         _floor_share(item), 'sd', headline=False)
            for method in METHODS:
                yield Figure('prediction', f'{method} ratio to floor 3 s, minutes 10-30, {where}',
                             float(item.ratio(method, *SETTLED)[AT_3]), 'x floor',
                             headline=False)


def _floor_share(item: Scores) -> float:
    """Return floor / sd of the motion 3 s ahead, minutes 10-30."""
    rows = [item.windows.index(window) for window in SETTLED]
    return float(np.sqrt(np.mean(np.square(item.floor[rows, AT_3]))) / item.sd)


def tables(scores: Sequence[Scores]) -> str:
    """Write all methods side by side as Markdown."""
    scenarios = [item for item in scores if item.quantity == 'height']
    steady = [item for item in scenarios if item.stationary]
    calm = [item for item in scenarios if 'during' not in item.windows]
    methods = tuple(METHODS)
    parts = [_table(
        ('error / floor, mean of the stationary scenarios', *methods),
        [(f'{horizon:g} s ahead, minutes 10-30', [
            _mean_ratio(steady, method, *SETTLED)[column] for method in METHODS])
         for column, horizon in enumerate(HORIZONS)]
        + [(f'3 s ahead, {window}', [_mean_ratio(steady, method, window)[AT_3]
                                     for method in METHODS]) for window in WINDOWS])]
    parts.append(_table(
        ('error / floor 3 s ahead, minutes 10-30', *methods, 'floor / sd'),
        [(item.record, [*(item.ratio(method, *SETTLED)[AT_3] for method in METHODS),
                        _floor_share(item)]) for item in calm]))
    parts.append(_table(
        ('adaptive, 3 s ahead', f'error / sd, {FIRST}',
         *(f'error / floor, {window}' for window in WINDOWS), 'within 95 %, minutes 20-30'),
        [(item.record, [item.share(ADAPTIVE, FIRST)[AT_3],
                        *(item.ratio(ADAPTIVE, window)[AT_3] for window in WINDOWS),
                        item.coverage[1, -1, AT_3]]) for item in calm]))
    for item in scenarios:
        if 'during' in item.windows:
            parts.append(_table(
                (f'{item.record}, 3 s ahead', *methods),
                [(f"error / {'sd' if window == 'during' else 'floor'}, {window}", [
                    (item.share if window == 'during' else item.ratio)(method, window)[AT_3]
                    for method in METHODS]) for window in item.windows]))
    parts.append(_table(
        ('CPU time for a sample of all axes (ms)', *methods),
        [(what, [_costs(scenarios, method)[k] for method in METHODS])
         for k, what in enumerate(COSTS)]))
    recorded = [item for item in scores if item.quantity != 'height']
    if recorded:
        parts.append(_table(
            ('error / sd 3 s ahead, from minute 2 on', *methods, 'estimated floor'),
            [(f'{item.record} {item.quantity}', [
                *(item.share(method, item.windows[0])[AT_3] for method in METHODS),
                item.floor[0, AT_3] / item.sd]) for item in recorded]))
    return '\n\n'.join(parts)


def _table(head: Sequence[str], rows: Sequence[tuple[str, Sequence[float]]]) -> str:
    cells = [[*head], *([name, *(f'{value:.3g}' for value in values)] for name, values in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    cells.insert(1, ['-' * widths[0], *('-' * (width - 1) + ':' for width in widths[1:])])
    return '\n'.join('| ' + ' | '.join(
        cell.rjust(width) if k else cell.ljust(width)
        for k, (cell, width) in enumerate(zip(row, widths, strict=True))) + ' |' for row in cells)

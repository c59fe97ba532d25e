"""The predictor's landing windows: what was said, what came, and how far to rely on it."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, radians

from matplotlib.axes import Axes
import numpy as np
from numpy.typing import NDArray

from deck_motion_ros.estimators.window import chosen_limits, Limits
from deck_motion_ros.evaluation.metrics import Stamps
from deck_motion_ros.evaluation.record import Record
from deck_motion_ros.evaluation.report.drawing import (
    BLUE,
    canvas,
    Clock,
    GREEN,
    ORANGE,
    QUIET,
    SKY,
    ticks,
)
from deck_motion_ros.evaluation.report.page import figure, fixed, note, percent, section, table
from deck_motion_ros.evaluation.windows import Deck, scored, WindowScores
from deck_motion_ros.samples import Array, GO, nanoseconds, NO_GO, WAIT

COLOURS = {GO: GREEN, WAIT: SKY, NO_GO: ORANGE}
ZOOM = 180.0  # s
NEAREST, FARTHEST = 2.0, 4.0  # s ahead, of the crests that are judged
FEWEST = 20  # windows to judge


def landing_windows(record: Record, warm_up: float, clock: Clock) -> str:
    """
    Say what became of the landing windows.

    Parameters
    ----------
    record : Record
        With windows, and with motion to judge them by.
    warm_up : float
        Seconds at the start that are not judged.
    clock : Clock
        Time axis.

    Returns
    -------
    str
        A section; empty where there is nothing to judge.

    """
    stated = stated_limits(record.contents.settings.get('predictor', {}))
    if stated is None or len(record.windows) < FEWEST:
        return ''
    limits, duration = stated
    start, end = record.span
    judged_from = start + nanoseconds(warm_up)
    deck = Deck.of((start, end), record.came(), record.came(0), record.came(1))
    scores = scored('', [item for item in record.windows if item.issued_at >= judged_from],
                    deck, limits, duration)
    if len(scores.quiet) < FEWEST:
        return ''
    timings = scores.timings(NEAREST, FARTHEST)
    rows = [(word, percent(float(np.mean(scores.state == state))), percent(_quiet(scores, state)))
            for word, state in (('go', GO), ('wait', WAIT), ('no go', NO_GO))]
    parts = [
        figure(_over_time(scores, clock),
               'What was said (go green, wait light blue, no go orange) above what came: green '
               f'where the deck then stayed within limits for {duration:g} s. The line is the '
               'probability stated for that.'),
        table(('said', 'of the time', 'then quiet'),
              [*rows, ('altogether', percent(1.0), percent(scores.share))]),
        figure(_reliability(scores, timings),
               'Left: how often the deck stayed quiet when so much was promised; on the dashed '
               'line the promise is honest. Larger dots stand for more windows. Right: announced '
               f'minus real time of crests and troughs {NEAREST:g} to {FARTHEST:g} s ahead; what '
               'was off by more than 1 s stands at the edge.'),
        table(('Brier score', 'skill', 'crests: median error', 'in 68 %', 'in 95 %'), [(
            fixed(scores.brier, 3, ''), _skill(scores), *_crests(timings))], texts=0)]
    return section('Landing windows', *parts, note(
        f'A window is {duration:g} s with the height within {limits.height:g} m of rest, the '
        f'vertical rate within {limits.rate:g} m/s, roll within {np.degrees(limits.roll):g}° and '
        f'pitch within {np.degrees(limits.pitch):g}°. Skill: 1 is perfect, 0 is to say '
        f'{percent(scores.share)} at all times.'))


def stated_limits(settings: Mapping[str, str]) -> tuple[Limits, float] | None:
    """Read limits and duration (s) from the predictor's settings; ``None`` if not stated."""
    try:
        height, rate, roll, pitch, duration = (float(settings[f'window_{name}']) for name in (
            'height', 'rate', 'roll_deg', 'pitch_deg', 'duration'))
        return chosen_limits(settings['window_preset'], height, rate, radians(roll),
                             radians(pitch)), duration
    except (KeyError, ValueError):
        return None


def _quiet(scores: WindowScores, state: str) -> float:
    chosen = scores.quiet[scores.state == state]
    return float(np.mean(chosen)) if len(chosen) else np.nan


def _skill(scores: WindowScores) -> str:
    return fixed(scores.skill, 2, '') if isfinite(scores.skill) else '–'


def _crests(timings: Array) -> tuple[str, str, str]:
    if not len(timings):
        return '–', '–', '–'
    _, error, sd = np.abs(timings.T)
    return (fixed(float(np.median(error)), 2, ' s'), percent(float(np.mean(error <= sd))),
            percent(float(np.mean(error <= 1.96 * sd))))


def _over_time(scores: WindowScores, clock: Clock) -> str:
    """Draw the whole run and, if it is long, its most changing part below."""
    stamps = scores.issued_at
    span = int(stamps[0]), int(stamps[-1])
    views = [(clock, span)]
    if span[1] - span[0] > nanoseconds(1.5 * ZOOM):
        views.append((Clock(clock.start, 's'), _changing(scores)))
    with canvas(2.0 + 2.4 * (len(views) - 1), 'Landing windows over time') as drawing:
        panels = drawing.figure.subplots(
            len(views), 1, squeeze=False, height_ratios=(1, 1.3)[:len(views)])[:, 0]
        for panel, (time, (first, last)) in zip(panels, views, strict=True):
            near = (stamps >= first) & (stamps <= last)
            x = time(stamps[near])
            panel.plot(x, scores.probability[near], color=BLUE, linewidth=1)
            _strip(panel, -0.32, time, stamps[near], scores.state[near])
            _strip(panel, -0.55, time, stamps[near],
                   np.where(scores.quiet[near] == 1, GO, NO_GO))
            panel.set(xlabel=time.label, xlim=time(np.array([first, last])), ylim=(-0.6, 1.05))
            panel.set_yticks([-0.47, -0.24, 0, 0.5, 1], ['came', 'said', '0', '0.5', '1'])
            panel.set_ylabel('probability', loc='top')
        if len(views) > 1:
            panels[0].axvspan(*clock(np.array(views[1][1])), color=ORANGE, alpha=0.13,
                              linewidth=0)
    return drawing.svg


def _strip(panel: Axes, low: float, clock: Clock, stamps: Stamps,
           states: NDArray[np.str_]) -> None:
    """Draw states as a strip of colours, each up to the next stamp but for gaps."""
    until = np.diff(stamps, append=stamps[-1:])
    step = int(1.5 * np.median(until))
    ends = stamps + np.minimum(until, step)
    # bars that touch are one: hair lines would show between them
    new = np.flatnonzero(np.r_[True, (states[1:] != states[:-1]) | (until[:-1] > step)])
    stamps, states, ends = stamps[new], states[new], ends[np.r_[new[1:] - 1, -1]]
    for state, colour in COLOURS.items():
        chosen = states == state
        begin, end = clock(stamps[chosen]), clock(ends[chosen])
        panel.broken_barh(list(zip(begin.tolist(), (end - begin).tolist(), strict=True)),
                          (low, 0.16), facecolor=colour, linewidth=0)


def _changing(scores: WindowScores) -> tuple[int, int]:
    """Choose the minutes in which the deck became quiet or ceased to be most often (ns)."""
    length = nanoseconds(ZOOM)
    changes = scores.issued_at[1:][np.diff(scores.quiet) != 0]
    first, last = int(scores.issued_at[0]), int(scores.issued_at[-1])
    starts = range(first, max(last - length, first) + 1, length // 4)
    best = max(starts, key=lambda start: int(np.sum((changes >= start)
                                                    & (changes < start + length))))
    return best, min(best + length, last)


def _reliability(scores: WindowScores, timings: Array) -> str:
    said, came, number = np.array(scores.reliability()).T
    with canvas(3.4, 'Reliability of landing windows') as drawing:
        left, right = drawing.figure.subplots(1, 2)
        left.plot([0, 1], [0, 1], color=QUIET, linestyle=(0, (5, 3)), linewidth=1.2,
                  label='honest')
        left.plot(said, came, color=BLUE, linewidth=1.5, label='these windows')
        left.scatter(said, came, 12 + 200 * number / number.sum(), color=BLUE, zorder=3)
        left.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), xlabel='probability stated',
                 ylabel='share that stayed quiet')
        left.legend(loc='upper left')
        right.hist(np.clip(timings[:, 1], -1, 1), np.linspace(-1, 1, 41).tolist(), color=SKY)
        right.set(xlim=(-1, 1), xlabel='announced minus real time (s)',
                  ylabel='crests and troughs')
        right.yaxis.set_major_locator(ticks(4))
    return drawing.svg

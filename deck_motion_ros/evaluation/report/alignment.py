"""The alignment's chapter: misalignment with its sd, innovations, fading, phases."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, isfinite, nan
from typing import Any

import numpy as np

from deck_motion_ros.evaluation.contents import Contents, Handler
from deck_motion_ros.evaluation.metrics import Stamps
from deck_motion_ros.evaluation.report.drawing import (
    BLUE,
    canvas,
    Clock,
    GRID,
    INK,
    ORANGE,
    QUIET,
    SKY,
    ticks,
)
from deck_motion_ros.evaluation.report.page import figure, fixed, note, section, table
from deck_motion_ros.evaluation.report.view import Chapter, Options
from deck_motion_ros.geometry import matrix_from_quaternion
from deck_motion_ros.samples import Array, nanoseconds, Rejected, Vector3

AXES = ('forward', 'left', 'up')
FILTER = 'alignment: filter'
ARCMIN = 60 * degrees(1.0)


class AlignmentView:
    """
    What the alignment made of a launch.

    Parameters
    ----------
    options : Options
        Of the report; none is used.

    """

    subjects = ('alignment/misalignment',)
    thinned = ()

    def __init__(self, options: Options) -> None:
        self._found: list[tuple[int, Vector3]] = []
        self._sd: dict[int, Array] = {}
        self._truth: Vector3 | None = None
        self._health: list[tuple[int, float, float, str]] = []
        self.handlers: Mapping[str, Handler] = {
            'alignment/misalignment': self._misalignment,
            'alignment/attitude': self._attitude,
            'alignment/truth': self._true,
            '/diagnostics': self._diagnosed}

    def _misalignment(self, stamp: int, msg: Any) -> None:
        self._found.append((stamp, _finite(msg.vector.x, msg.vector.y, msg.vector.z)))

    def _true(self, stamp: int, msg: Any) -> None:
        self._truth = _finite(msg.vector.x, msg.vector.y, msg.vector.z)

    def _attitude(self, stamp: int, msg: Any) -> None:
        turn = msg.pose.pose.orientation
        mat = matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w))
        cov = np.reshape(msg.pose.covariance, (6, 6))[3:, 3:]
        self._sd[stamp] = np.sqrt(np.maximum(np.diagonal(mat.T @ cov @ mat), 0))

    def _diagnosed(self, stamp: int, msg: Any) -> None:
        for status in msg.status:
            if status.name == FILTER:
                values = {pair.key: pair.value for pair in status.values}
                self._health.append((
                    stamp, _number(values.get('innovations, mean square', '')),
                    _number(values.get('largest fading factor', '')), values.get('phase', '')))

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say what the bag shows."""
        if not self._found:
            return Chapter('No misalignment that can be used.', [], (), [])
        _, message, values = contents.states.get(FILTER, (0, '', {}))
        stamps = np.array([stamp for stamp, _ in self._found], np.int64)
        angles = ARCMIN * np.array([vector for _, vector in self._found])
        sd = ARCMIN * np.array([self._sd.get(stamp, np.full(3, nan)) for stamp, _ in self._found])
        truth = None if self._truth is None else ARCMIN * np.array(self._truth)
        window = _number(values.get('window (s)', ''))
        stroke = _number(values.get('stroke (s)', ''))
        launch = int(stamps[0]) + nanoseconds(window) if stroke > 0 else None
        end = None if launch is None else launch + nanoseconds(stroke)
        rows = [(name, fixed(float(angles[-1, k]), 2, "'"), _arcmin(float(sd[-1, k])),
                 '' if truth is None else fixed(float(angles[-1, k] - truth[k]), 2, "'"))
                for k, name in enumerate(AXES)]
        direction = values.get('least observable direction', '')
        worst = values.get('least observable sd (arcmin)', '')
        last, last_sd = (', '.join(row[k] for row in rows) for k in (1, 2))
        headline = [f'Last misalignment, about forward, left, up: {last}, sd {last_sd}.']
        if launch is not None:
            headline.append(f'Launched after {window:.1f} s of velocity matching; the stroke took '
                            f'{stroke:.1f} s.')
        if truth is not None:
            worst_error = float(np.max(np.abs(angles[-1] - truth)))
            headline.append(f"The largest error of an angle at the end is {worst_error:.2f}'.")
        return Chapter(
            'Misalignment of an aircraft on the catapult' + (
                '.' if truth is None else ', with its truth.'), headline, (),
            [section(
                'Misalignment',
                figure(_angles(stamps, angles, sd, truth, launch, end, clock),
                       'Estimate with its 95 % interval, in arcminutes'
                       + ('' if truth is None else '; dashed: the truth')
                       + ('' if launch is None else '; grey: the stroke') + '.'),
                table(('about', 'at the end', 'sd', 'error'), rows),
                note(f'Worst known is the turn about ({direction}) of the aircraft, forward, '
                     f"left, up: sd {worst}'.") if direction else ''),
             self._filter(clock, message)])

    def _filter(self, clock: Clock, message: str) -> str:
        """Show innovations, fading and phases, as ``/diagnostics`` told them."""
        if len(self._health) < 2:
            return ''
        stamps = np.array([stamp for stamp, *_ in self._health], np.int64)
        with canvas(3.4, 'Innovations and fading over time') as drawing:
            upper, lower = drawing.figure.subplots(2, 1, sharex=True)
            upper.plot(clock(stamps), [size for _, size, _, _ in self._health], color=BLUE,
                       marker='.')
            upper.axhline(1.0, color=QUIET, linestyle='--', linewidth=1)
            upper.set_ylabel('innovations')
            upper.set_ylim(0, 1.1 * upper.get_ylim()[1])
            lower.plot(clock(stamps), [factor for _, _, factor, _ in self._health], color=ORANGE,
                       marker='.', drawstyle='steps-post')
            lower.set_yscale('log')
            lower.set_ylabel('largest fading')
            lower.set_xlabel(clock.label)
            drawing.figure.align_ylabels()
        phases = [phase for *_, phase in self._health]
        changes = [f'{phase} at {float(clock(stamp)):.1f} {clock.unit}'
                   for stamp, phase, before in zip(stamps.tolist(), phases, ['', *phases],
                                                   strict=False) if phase != before]
        return section(
            'Filter', figure(drawing.svg,
                             'Mean square of the normalised innovations, 1 if all is well, and '
                             'the largest fading factor so far.'),
            note(f"Phases as reported: {', '.join(changes)}. Last word: {message}."))


def _angles(stamps: Stamps, angles: Array, sd: Array, truth: Array | None, launch: int | None,
            end: int | None, clock: Clock) -> str:
    """Draw the three angles (arcmin) with their intervals, each to its own scale."""
    time = clock(stamps)
    with canvas(5.2, 'Misalignment over time') as drawing:
        panels = drawing.figure.subplots(3, 1, sharex=True)
        for k, (panel, name) in enumerate(zip(panels, AXES, strict=True)):
            half = 1.96 * np.nan_to_num(sd[:, k])
            panel.fill_between(time, angles[:, k] - half, angles[:, k] + half, color=SKY,
                               alpha=0.55, linewidth=0)
            panel.plot(time, angles[:, k], color=BLUE)
            if truth is not None:
                panel.axhline(float(truth[k]), color=INK, linestyle='--', linewidth=1)
            if launch is not None and end is not None:
                begin, finish = clock(np.array([launch, end], np.int64)).tolist()
                panel.axvspan(begin, finish, color=GRID, zorder=0)
            centre, reach = float(angles[-1, k]), max(4 * float(half[-1]), 5.0)
            panel.set_ylim(centre - reach, centre + reach)
            panel.set_ylabel(f"{name} (')")
            panel.yaxis.set_major_locator(ticks(4))
            panel.margins(x=0)
        panels[-1].set_xlabel(clock.label)
        drawing.figure.align_ylabels()
    return drawing.svg


def _finite(*values: float) -> Vector3:
    if not np.all(np.isfinite(values)):
        raise Rejected('not finite')
    x, y, z = values
    return (x, y, z)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return nan


def _arcmin(value: float) -> str:
    return fixed(value, 2, "'") if isfinite(value) else '–'

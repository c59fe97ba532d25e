"""The guidance node's chapter: its phases, what it commanded, and how the aircraft came down."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import Any

import numpy as np

from deck_motion_ros.evaluation.contents import Contents, Handler
from deck_motion_ros.evaluation.metrics import Series
from deck_motion_ros.evaluation.report.drawing import (
    BLUE,
    canvas,
    Clock,
    GREEN,
    GRID,
    INK,
    line,
    SKY,
)
from deck_motion_ros.evaluation.report.page import (
    duration,
    figure,
    fixed,
    metres,
    section,
    table,
)
from deck_motion_ros.evaluation.report.view import Chapter, Options
from deck_motion_ros.samples import Array

COLOURS = {'approach': GRID, 'hold': SKY, 'descent': GREEN}


class GuidanceView:
    """What a bag holds of the guidance node."""

    subjects = ('landing/cmd_vel',)
    thinned = ()

    def __init__(self, options: Options) -> None:
        self._stamps: list[int] = []
        self._commands: list[tuple[float, ...]] = []
        self._when: list[int] = []
        self._places: list[tuple[float, ...]] = []
        self._said: list[tuple[int, str]] = []
        self.handlers: Mapping[str, Handler] = {
            'landing/cmd_vel': self._command, 'landing/odometry': self._place,
            '/diagnostics': self._status}

    def _command(self, stamp: int, msg: Any) -> None:
        velocity = msg.twist.linear
        self._stamps.append(stamp)
        self._commands.append((velocity.x, velocity.y, velocity.z))

    def _place(self, stamp: int, msg: Any) -> None:
        place = msg.pose.pose.position
        self._when.append(stamp)
        self._places.append((place.x, place.y, place.z))

    def _status(self, stamp: int, msg: Any) -> None:
        self._said += [(stamp, status.message) for status in msg.status
                       if status.name == 'guidance: phase']

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say how the aircraft was led down."""
        commands, places = np.array(self._commands), np.reshape(self._places, (-1, 3))
        phases = self._phases()
        parts = [figure(self._drawn(commands, places, phases, clock),
                        'Above the height over the deck, below the commanded vertical speed '
                        'relative to it. Behind them the phases: approach grey, hold light blue, '
                        'descent green.')]
        if phases:
            parts.append(table(('phase', 'lasted', 'mean vertical command', 'fastest across'), [
                (phase, duration(last - first), *self._in_words(commands, first, last))
                for phase, first, last in phases]))
        aborts = contents.states.get('guidance: input', (0, '', {}))[2].get('aborts', '0')
        ended = f'; the last was {phases[-1][0]}' if phases else ''
        headline = [f'The guidance went through {len(phases)} phases with {aborts} aborts{ended}.']
        if len(places):
            x, y, z = places[-1].tolist()
            headline.append(
                f'At the end the aircraft was {metres(z)} over the deck and '
                f'{metres(float(np.hypot(x, y)))} from its middle, with a commanded vertical '
                f'speed of {fixed(float(commands[-1, 2]), 2, " m/s")}.')
        return Chapter('Velocity commands of the guidance.', headline, (),
                       [section('Guidance', *parts)])

    def _phases(self) -> list[tuple[str, int, int]]:
        """List the phases with when each began and ended, as precisely as was said."""
        found = [(phase, next(group)[0]) for phase, group in groupby(
            self._said, key=lambda item: item[1])]
        ends = [first for _, first in found[1:]] + [self._stamps[-1]]
        return [(phase, first, max(first, last))
                for (phase, first), last in zip(found, ends, strict=True)]

    def _in_words(self, commands: Array, first: int, last: int) -> tuple[str, str]:
        stamps = np.array(self._stamps)
        during = commands[(stamps >= first) & (stamps <= last)]
        if not len(during):
            return '–', '–'
        return (fixed(float(during[:, 2].mean()), 2, ' m/s'),
                fixed(float(np.hypot(*during[:, :2].T).max()), 2, ' m/s'))

    def _drawn(self, commands: Array, places: Array, phases: list[tuple[str, int, int]],
               clock: Clock) -> str:
        with canvas(4.2, 'Guidance') as drawing:
            above, below = drawing.figure.subplots(2, 1, sharex=True)
            for phase, first, last in phases:
                for axes in (above, below):
                    axes.axvspan(*clock(np.array([first, last])).tolist(), linewidth=0,
                                 color=COLOURS.get(phase, GRID), alpha=0.25)
            if len(places):
                line(above, Series.of(self._when, places[:, 2]), clock, 1.0, color=BLUE)
            line(below, Series.of(self._stamps, commands[:, 2]), clock, 1.0, color=INK)
            above.set_ylabel('height (m)')
            below.set_ylabel('commanded (m/s)')
            below.set_xlabel(clock.label)
        return drawing.svg

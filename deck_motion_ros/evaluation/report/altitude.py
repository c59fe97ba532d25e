"""The altitude node's chapter: height over the sea, what was promised of it, and its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, nan
from typing import Any

import numpy as np

from deck_motion_ros.evaluation.contents import Contents, Handler
from deck_motion_ros.evaluation.metrics import Series, Stamps
from deck_motion_ros.evaluation.report.drawing import (
    BLUE,
    canvas,
    Clock,
    GREEN,
    INK,
    line,
    QUIET,
    SKY,
    thinned,
    ticks,
)
from deck_motion_ros.evaluation.report.page import (
    figure,
    fixed,
    metres,
    note,
    percent,
    section,
    table,
)
from deck_motion_ros.evaluation.report.view import Chapter, Options
from deck_motion_ros.messages import range_sample
from deck_motion_ros.samples import Array, Rejected

FILTER = 'altitude: filter'  # status in which the node says what it believes


@dataclass(frozen=True, eq=False)
class HeightErrors:
    """
    Estimates of a height and its rate against the truth, as rms and share within the stated sd.

    Attributes
    ----------
    rmse, worst : float
        m, or m/s.
    nees : float
        Mean of error^2 / variance; 1 = honest.
    within : tuple of 2 float
        Shares within 1 and 2 sd; 0.68 and 0.95 are honest.

    """

    rmse: float
    worst: float
    nees: float
    within: tuple[float, float]

    @classmethod
    def of(cls, error: Array, var: Array) -> HeightErrors:
        """Judge errors, of which NaN is left out, by the variances stated for them."""
        there = np.isfinite(error) & (var > 0)
        if not there.any():
            return cls(nan, nan, nan, (nan, nan))
        error, sds = error[there], np.abs(error[there]) / np.sqrt(var[there])
        return cls(float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))),
                   float(np.mean(sds**2)), (float(np.mean(sds <= 1)), float(np.mean(sds <= 2))))


class AltitudeView:
    """What a bag holds of the altitude node; with ``altitude/truth`` it is judged."""

    subjects = ('altitude/odometry',)
    thinned = ()

    def __init__(self, options: Options) -> None:
        self._estimates: list[tuple[int, float, float, float, float]] = []
        self._truth: list[tuple[int, float, float]] = []
        self._ranges: list[tuple[int, float]] = []
        self._echoless = 0
        self.handlers: Mapping[str, Handler] = {
            'altitude/odometry': self._estimate, 'altitude/truth': self._true,
            'altimeter/range': self._range}

    def _estimate(self, stamp: int, msg: Any) -> None:
        self._estimates.append((
            stamp, msg.pose.pose.position.z, msg.twist.twist.linear.z, msg.pose.covariance[14],
            msg.twist.covariance[14]))

    def _true(self, stamp: int, msg: Any) -> None:
        self._truth.append((stamp, msg.pose.pose.position.z, msg.twist.twist.linear.z))

    def _range(self, stamp: int, msg: Any) -> None:
        try:
            self._ranges.append((stamp, range_sample(msg).distance))
        except Rejected:
            self._echoless += 1

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say how high the aircraft was, and how far to rely on it."""
        stamps = np.array([row[0] for row in self._estimates], np.int64)
        height, rate, var, rate_var = np.array([row[1:] for row in self._estimates]).T
        when = [row[0] for row in self._truth]
        truth, true_rate = (Series.of(when, [row[k] for row in self._truth]) for k in (1, 2))
        judged = len(truth) > 1
        error, rate_error = (value - true.at(stamps) if judged else np.full(len(stamps), nan)
                             for value, true in ((height, truth), (rate, true_rate)))
        found, of_rate = HeightErrors.of(error, var), HeightErrors.of(rate_error, rate_var)
        parts = [figure(
            self._drawn(stamps, height, var, truth, clock),
            'Height above mean sea level (blue) with twice its standard deviation'
            + (', the true one (green)' if judged else '')
            + ', and what the altimeter measured (grey): the height above the water, '
            'waves and bias included.')]
        if judged:
            parts += [
                figure(self._errors(stamps, error, var, clock),
                       'Estimated minus true height, and twice the standard deviation that was '
                       'stated.'),
                table(('', 'RMS error', 'largest', 'error² / variance', 'within 1 sd',
                       'within 2 sd'),
                      [('height', metres(found.rmse), metres(found.worst), *_honesty(found)),
                       ('rate', _speed(of_rate.rmse), _speed(of_rate.worst), *_honesty(of_rate))]),
                note('Honest: error² / variance 1, 68 % within 1 sd and 95 % within 2. The error '
                     'of a height is mostly one constant, the bias of the altimeter, so that a '
                     'single flight may be far from these and yet honest.')]
        parts.append(self._believed(contents))
        ready = np.sqrt(np.median(var)) if np.all(var > 0) else nan
        headline = [f'The height above mean sea level was {metres(float(height.min()))} to '
                    f'{metres(float(height.max()))}'
                    + (f', known to {metres(ready)} (1 sd, median).' if isfinite(ready) else '.')]
        tiles = []
        if judged:
            headline.insert(0, f'The height above mean sea level was off by {metres(found.rmse)} '
                               f'RMS; {percent(found.within[1])} of the errors were within '
                               'twice the stated deviation.')
            tiles = [('height_error', metres(found.rmse), 'error of the height, RMS'),
                     ('height_nees', fixed(found.nees, 2, '') if isfinite(found.nees) else '–',
                      'error² / stated variance')]
        recorded = 'Height of an aircraft above mean sea level' + (
            ', with its truth.' if judged else '.')
        return Chapter(recorded, headline, tiles, [section('Height over the sea', *parts)])

    def _drawn(self, stamps: Stamps, height: Array, var: Array, truth: Series,
               clock: Clock) -> str:
        with canvas(3.6, 'Height over the sea') as drawing:
            panel = drawing.figure.subplots()
            seen = Series.of([row[0] for row in self._ranges], [row[1] for row in self._ranges])
            line(panel, seen, clock, 1.0, color=QUIET, lw=0.5, alpha=0.6, label='altimeter')
            _band(panel, stamps, height, var, clock)
            line(panel, Series.of(stamps, height), clock, 1.0, color=BLUE, label='estimate')
            if len(truth):
                line(panel, truth, clock, 1.0, color=GREEN, lw=1.0, ls='--', label='truth')
            panel.set_ylabel('height (m)')
            _finish(panel, clock)
        return drawing.svg

    def _errors(self, stamps: Stamps, error: Array, var: Array, clock: Clock) -> str:
        with canvas(2.4, 'Error of the height over the sea') as drawing:
            panel = drawing.figure.subplots()
            _band(panel, stamps, np.zeros(len(var)), var, clock)
            panel.axhline(0.0, color=INK, lw=0.8)
            line(panel, Series.of(stamps, error), clock, 1.0, color=BLUE, label='error')
            panel.set_ylabel('error (m)')
            _finish(panel, clock)
        return drawing.svg

    def _believed(self, contents: Contents) -> str:
        """Tabulate what the node said last of itself, and the drop-outs."""
        _, _, values = contents.states.get(FILTER, (0, '', {}))
        rows = [(name, value) for name, value in values.items() if value != 'nan']
        if self._echoless:
            rows.append(('ranges without an echo', str(self._echoless)))
        return table(('at the end', ''), rows, texts=2) if rows else ''


def _band(panel: Any, stamps: Stamps, middle: Array, var: Array, clock: Clock) -> None:
    low, high = (thinned(clock(stamps), middle + side * np.sqrt(var)) for side in (-2, 2))
    times = np.union1d(low[0], high[0])
    panel.fill_between(times, np.interp(times, *low), np.interp(times, *high), color=SKY,
                       alpha=0.5, lw=0, label='± 2 sd')


def _finish(panel: Any, clock: Clock) -> None:
    panel.set_xlabel(clock.label)
    panel.yaxis.set_major_locator(ticks(6))
    panel.margins(x=0)
    panel.legend(loc='upper right', ncols=4)


def _honesty(found: HeightErrors) -> tuple[str, str, str]:
    nees = fixed(found.nees, 2, '') if isfinite(found.nees) else '–'
    return nees, percent(found.within[0]), percent(found.within[1])


def _speed(value: float) -> str:
    return fixed(value, 2, ' m/s') if isfinite(value) else '–'

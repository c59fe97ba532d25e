"""The landing node's chapter: the way to the deck, how well it was known, and the ranges."""

from __future__ import annotations

from collections.abc import Mapping
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
    ORANGE,
    QUIET,
    SKY,
)
from deck_motion_ros.evaluation.report.page import figure, metres, note, percent, section, table
from deck_motion_ros.evaluation.report.view import Chapter, Options
from deck_motion_ros.messages import odometry_sample, range_sample
from deck_motion_ros.samples import Array

AXES = ('forward', 'left', 'up')
OFF = 5.0  # standard deviations: a range that is farther off the position cannot be right


class LandingView:
    """What a bag holds of the landing node; with ``landing/truth`` it is judged."""

    subjects = ('landing/odometry',)
    thinned = ()

    def __init__(self, options: Options) -> None:
        self._stamps: list[int] = []
        self._vars: list[tuple[float, ...]] = []
        self._truth: list[tuple[int, tuple[float, ...]]] = []
        self._ranges: list[tuple[int, str, float]] = []
        self._positions: list[tuple[float, ...]] = []
        self.handlers: Mapping[str, Handler] = {
            'landing/odometry': self._estimate, 'landing/truth': self._true,
            'uwb/range': self._range}

    def _estimate(self, stamp: int, msg: Any) -> None:
        sample = odometry_sample(msg)
        self._stamps.append(stamp)
        self._positions.append(sample.position)
        self._vars.append(sample.pose_var[:3])

    def _true(self, stamp: int, msg: Any) -> None:
        position = msg.pose.pose.position
        self._truth.append((stamp, (position.x, position.y, position.z)))

    def _range(self, stamp: int, msg: Any) -> None:
        sample = range_sample(msg)
        self._ranges.append((stamp, sample.frame_id, sample.distance))

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say where the aircraft came from, and how far to rely on it."""
        stamps = np.array(self._stamps, np.int64)
        position, var = np.array(self._positions), np.array(self._vars)
        found = [Series.of(stamps, column) for column in position.T]
        when = [stamp for stamp, _ in self._truth]
        truth = [Series.of(when, [place[k] for _, place in self._truth]) for k in range(3)]
        judged = len(truth[0]) > 1
        error = np.stack([column - (true.at(stamps) if judged else np.nan)
                          for column, true in zip(position.T, truth, strict=True)], axis=1)
        anchors = _anchors(contents)
        parts = [
            figure(self._way(position, truth, anchors, judged),
                   'The aircraft in the axes of the deck, from above and from the side (blue)'
                   + (', its true way (green)' if judged else '')
                   + (' and the anchors (black).' if anchors else '.'))]
        if judged or var.any():
            parts.append(figure(
                self._sure(stamps, error if judged else None, var, clock),
                ('Estimated minus true position, and twice' if judged else 'Twice')
                + ' the standard deviation that was stated.'))
        if judged:
            parts.append(table(
                ('', 'RMS error', 'stated sd, RMS', 'within 2 sd'),
                [(name, metres(_rms(error[:, k])), metres(float(np.sqrt(np.mean(var[:, k])))),
                  percent(_within(error[:, k], var[:, k]))) for k, name in enumerate(AXES)]))
        parts.append(self._judged_ranges(contents, anchors, found, clock))
        last = var[-1]
        known = (f'; at the end it was known to {metres(float(np.sqrt(last[:2].mean())))} across '
                 f'and {metres(float(np.sqrt(last[2])))} in height (1 sd)') * bool(last.any())
        headline = [f'The aircraft was followed from {metres(float(position[0, 2]))} to '
                    f'{metres(float(position[-1, 2]))} over the deck{known}.']
        tiles = []
        if judged:
            across = float(np.hypot(_rms(error[:, 0]), _rms(error[:, 1])))
            headline.insert(0, f'The position over the deck was off by {metres(across)} across '
                               f'and {metres(_rms(error[:, 2]))} in height, RMS.')
            tiles = [('landing_across', metres(across), 'error across the deck, RMS'),
                     ('landing_height', metres(_rms(error[:, 2])), 'error of the height, RMS')]
        recorded = 'An aircraft over the deck' + (', with its truth.' if judged else '.')
        return Chapter(recorded, headline, tiles, [section('Landing', *parts)])

    def _way(self, position: Array, truth: list[Series], anchors: Mapping[str, Array],
             judged: bool) -> str:
        with canvas(4.2, 'Way of the aircraft') as drawing:
            plan, profile = drawing.figure.subplots(1, 2)
            places = np.array([*anchors.values()]).reshape(-1, 3)
            for axes, up in ((plan, 1), (profile, 2)):
                axes.plot(position[:, 0], position[:, up], color=BLUE)
                if judged:
                    axes.plot(truth[0].values, truth[up].values, color=GREEN, linewidth=0.8)
                axes.plot(places[:, 0], places[:, up], 's', color=INK, markersize=4)
                axes.set(xlabel='forward (m)', ylabel=f'{AXES[up]} (m)')
                axes.set_aspect('equal', adjustable='datalim')
        return drawing.svg

    def _sure(self, stamps: Stamps, error: Array | None, var: Array, clock: Clock) -> str:
        with canvas(4.6, 'Error over the deck') as drawing:
            for k, axes in enumerate(drawing.figure.subplots(3, 1, sharex=True)):
                bound = 2 * np.sqrt(var[:, k])
                axes.fill_between(clock(stamps), -bound, bound, color=SKY, linewidth=0)
                if error is not None:
                    line(axes, Series.of(stamps, error[:, k]), clock, 1.0, color=INK)
                axes.set_ylabel(f'{AXES[k]} (m)')
            axes.set_xlabel(clock.label)
        return drawing.svg

    def _judged_ranges(self, contents: Contents, anchors: Mapping[str, Array],
                       found: list[Series], clock: Clock) -> str:
        """Draw what each range says beside the position, if the anchors are known."""
        known = [row for row in self._ranges if row[1] in anchors]
        if not known:
            return note('No ranges of known anchors were recorded.')
        stamps = np.array([row[0] for row in known], np.int64)
        place = np.stack([series.at(stamps) for series in found], axis=1)
        points = np.array([anchors[row[1]] for row in known])
        excess = np.array([row[2] for row in known]) - np.linalg.norm(place - points, axis=1)
        there = np.isfinite(excess)
        stamps, excess = stamps[there], excess[there]
        limit = OFF * float(contents.settings['landing'].get('range_sd', '0.05'))
        off = np.abs(excess) > limit
        with canvas(2.6, 'Ranges') as drawing:
            axes = drawing.figure.subplots()
            axes.plot(clock(stamps[~off]), excess[~off], '.', color=QUIET, markersize=2)
            axes.plot(clock(stamps[off]), excess[off], '.', color=ORANGE, markersize=4)
            axes.set(xlabel=clock.label, ylabel='too long (m)')
        count = int(off.sum())
        return figure(drawing.svg, (
            f'Measured range minus distance of the position from the anchor; {count} of '
            f'{len(off)} are more than {metres(limit)} off (orange).'))


def _anchors(contents: Contents) -> dict[str, Array]:
    """Return the anchors' positions by name, from what the node said of its parameters."""
    told = contents.settings.get('landing', {})
    names = [name for name in told.get('anchor_frames', '').split(', ') if name]
    values = [float(value) for value in told.get('anchor_positions', '').split(', ') if value]
    if not names or len(values) != 3 * len(names):
        return {}
    return dict(zip(names, np.reshape(values, (-1, 3)), strict=True))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values)))) if np.isfinite(values).any() else np.nan


def _within(error: Array, var: Array) -> float:
    there = np.isfinite(error)
    return float(np.mean(np.abs(error[there]) <= 2 * np.sqrt(var[there]))) if there.any() else (
        np.nan)

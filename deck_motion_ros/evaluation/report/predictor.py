"""The predictor's chapter: ship motion, forecast against what came, calibration."""

from __future__ import annotations

from math import isfinite

import numpy as np

from deck_motion_ros.evaluation.assessment import assessed, Assessment
from deck_motion_ros.evaluation.contents import Contents
from deck_motion_ros.evaluation.metrics import (
    Comparison,
    motion_statistics,
    rms,
    zero_crossing_period,
)
from deck_motion_ros.evaluation.record import Record, ShipReader
from deck_motion_ros.evaluation.report import predictor_figures as figures
from deck_motion_ros.evaluation.report.drawing import Clock
from deck_motion_ros.evaluation.report.page import (
    duration,
    figure,
    fixed,
    metres,
    note,
    percent,
    period,
    ratio,
    section,
    table,
    Tile,
    typeset,
)
from deck_motion_ros.evaluation.report.view import Chapter, Options
from deck_motion_ros.evaluation.report.window import landing_windows
from deck_motion_ros.samples import NANOSECONDS, nanoseconds

SHOWN_HORIZONS = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 10.0)
ZOOM = 120.0  # s


class PredictorView(ShipReader):
    """Ship motion and its forecasts; see :class:`View`."""

    def __init__(self, options: Options) -> None:
        super().__init__()
        self._options = options
        self.subjects = tuple(self.handlers)

    def chapter(self, contents: Contents, clock: Clock) -> Chapter:
        """Say what the ship did and how good the forecasts were."""
        record = self.record(contents, self._options.lever_arm)
        assessment = assessed(record, self._options.warm_up)
        sections = [_motion(record, assessment, clock)]
        if assessment:
            sections += [_forecast(record, assessment, clock), _by_horizon(record, assessment),
                         _calibration(assessment),
                         landing_windows(record, assessment.warm_up, clock)]
        return Chapter(
            _recorded(record),
            _sentences(assessment) if assessment else _motion_sentences(record),
            _tiles(assessment) if assessment else (),
            (*sections, _spectra(record)))


def _sentences(assessment: Assessment) -> list[str]:
    """Say how good the forecast was, in plain words."""
    it, whole = assessment.judged, assessment.whole
    ahead = f'{it.horizon:g} s ahead'
    text = [f'{ahead} the height of the touchdown point was forecast with an error of '
            f'{metres(it.rmse)} RMS.',
            f'Saying “it stays as it is” would have been wrong by {metres(it.persistence)}, '
            f'saying “it is at rest” by {metres(it.zero)}.']
    rival = min(it.persistence, it.zero)
    if it.rmse > rival:
        text.append('Here the simpler answer was the better one.')
    useful = assessment.useful
    if useful > 0:
        text.append(f'Up to {_reach(assessment)} ahead the error stayed below half the motion.')
    elif useful == 0:
        text.append('At no horizon did the error stay below half the motion.')
    coverage = it.coverage(0.95)
    if assessment.absent:
        text.append(f"No {' and no '.join(assessment.absent)} came: what is missing counts as 0 "
                    'here, while the interval stated allows for it.')
    elif isfinite(coverage):
        verdict = ('the forecast is surer of itself than it should be' if coverage < 0.92 else
                   'it could be bolder' if coverage > 0.975 else 'that is honest')
        text.append(f'The 95 % interval it stated held {percent(coverage)} of what came: '
                    f'{verdict}.')
    if assessment.warm_up:
        text.append(f'Over the whole run, its first {assessment.warm_up:g} s of learning '
                    f'included: {metres(whole.rmse)} against {metres(whole.persistence)}.')
    if len(assessment.crests) >= 10:
        text.append(f'Half of the crests announced 2 to 4 s ahead came within '
                    f'{np.median(np.abs(assessment.crests)):.2f} s of their time; guessing would '
                    f'give {zero_crossing_period(assessment.reference) / 4:.1f} s.')
    return text


def _motion_sentences(record: Record) -> list[str]:
    start, end = record.span
    if not record.motion:
        return [f'{duration(end - start)} were recorded; the bag holds no ship motion.']
    parts = []
    for name, series in record.motion.items():
        found = motion_statistics(series)
        parts.append(f'significant heave {metres(found.significant)}' if name == 'heave' else
                     f'{name} sd {np.degrees(found.sd):.2f}°')
    text = [f"{duration(end - start)} of ship motion: {', '.join(parts)}."]
    nodes = record.contents.settings
    if record.height is None and nodes and 'predictor' not in nodes:
        return text  # nobody was asked for a forecast
    if record.height is None:
        return [*text, 'The bag holds no forecast.']
    if record.lever_arm is None:
        return [*text, 'The forecast is not judged: the bag does not state the lever arm of the '
                'touchdown point; give it to the report.']
    return [*text, 'The record is too short to judge the forecast.']


def _recorded(record: Record) -> str:
    if not record.motion:
        return 'The bag holds no ship motion.'
    return f"Ship motion: {', '.join(record.motion)}. " + (
        'The true motion is there too, as a simulator knows it.' if any(record.truth) else
        'The true motion is not known, as on any real ship.')


def _reach(assessment: Assessment) -> str:
    """Write the useful horizon; a dash where it is not known."""
    useful = assessment.useful
    beyond = ' or more' * (useful > 0 and useful == assessment.horizons[-1].horizon)
    return f'{useful:.1f} s{beyond}' if isfinite(useful) else '–'


def _tiles(assessment: Assessment) -> tuple[Tile, ...]:
    it = assessment.judged
    return (('rmse', metres(it.rmse), f'error of the forecast {it.horizon:g} s ahead, RMS'),
            ('persistence', metres(it.persistence), 'error of “it stays as it is”'),
            ('zero', metres(it.zero), 'error of “it is at rest”'),
            ('useful', _reach(assessment), 'ahead the error stays below half the motion'),
            ('coverage', percent(it.coverage(0.95)), 'of what came lay in the 95 % interval'))


def _motion(record: Record, assessment: Assessment | None, clock: Clock) -> str:
    if not record.motion:
        return ''
    rows = []
    shown = dict(record.motion)
    if assessment:
        shown['touchdown point'] = assessment.reference
    for name, series in shown.items():
        found = motion_statistics(series)
        angle = name in ('roll', 'pitch')
        scale, unit, digits = (float(np.degrees(1)), '°', 2) if angle else (1.0, ' m', 2)
        if not angle and found.sd < 0.1:
            scale, unit, digits = 100.0, ' cm', 1
        values = [fixed(scale * value, digits, unit) for value in (
            found.mean, found.sd, found.low, found.high, found.significant)]
        rows.append((name, *values, period(found.zero_crossing_period),
                     period(found.peak_period)))
    return section(
        'The motion',
        figure(figures.motion(record.motion, clock),
               'Roll positive port side up, pitch positive bow down, heave positive up. '
               'Lines break where nothing was measured.'),
        table(('', 'mean', 'sd', 'lowest', 'highest', 'significant', 'zero-crossing period',
               'peak period'), rows),
        note('Significant: four standard deviations, crest to trough; what an experienced eye '
             'calls the height of the motion. Zero-crossing period: mean time between upward '
             'passages of the mean. Peak period: where the spectrum is highest.'))


def _forecast(record: Record, assessment: Assessment, clock: Clock) -> str:
    whole, judged = assessment.whole, assessment.judged
    start, end = record.span
    zoom = _liveliest(judged) if end - start > nanoseconds(1.5 * ZOOM) else None
    kind = 'true' if any(record.truth) else 'measured'
    svg = figures.forecast(whole, assessment.reference, clock, zoom,
                           start + nanoseconds(assessment.warm_up), kind)
    caption = (
        'Above the whole run, below its liveliest two minutes (shaded above). ' * bool(zoom) +
        f'Every point of the blue line was forecast {judged.horizon:g} s before the time it is '
        'drawn at; the black line of what came should stay in the blue band 95 % of the time. '
        'Left of the dashed line the forecast was still learning the ship: '
        f'{assessment.warm_up:g} s that the figures leave out.')
    rows = [(name, f'{len(item)}', metres(item.rmse), metres(item.bias),
             metres(item.persistence), metres(item.zero), percent(item.coverage(0.6827)),
             percent(item.coverage(0.95)), f'{item.nis:.2f}')
            for name, item in ((f'after {assessment.warm_up:g} s', judged), ('whole run', whole))]
    arm = ', '.join(typeset(f'{value:g}') for value in record.lever_arm or ())
    against = (
        'Scored against the true motion in the bag.' if any(record.truth) else
        'Scored against the measurements that came later: the noise of the sensor is part of '
        'every error.')
    return section(
        'Forecast against what came',
        figure(svg, caption),
        table(('', 'forecasts', 'RMSE', 'bias', 'stays as it is', 'at rest', 'in 68 %',
               'in 95 %', 'mean NIS'), rows, strong=0),
        note(f'{against} The touchdown point lies at ({arm}) m in the ship (forward, left, up). '
             '“Stays as it is” is the height measured when the forecast was issued; “at rest” '
             'is zero. All three are judged at the same instants. NIS: squared error over the '
             'variance stated, 1 if honest.'))


def _by_horizon(record: Record, assessment: Assessment) -> str:
    if not assessment.horizons:
        return ''
    rows: list[tuple[str, ...]] = []
    strong = -1
    has_floor = bool(np.isfinite(assessment.floor).any())
    for item, floor in zip(assessment.horizons, assessment.floor.tolist(), strict=True):
        if min(abs(item.horizon - shown) for shown in SHOWN_HORIZONS) < 0.01:
            if abs(item.horizon - assessment.judged.horizon) < 0.01:
                strong = len(rows)
            rows.append((
                f'{item.horizon:g} s', metres(item.rmse), metres(item.persistence),
                metres(item.zero), ratio(item.share),
                *((metres(floor), ratio(item.rmse / floor)) * has_floor),
                metres(rms(item.sd[np.isfinite(item.sd)])), percent(item.coverage(0.6827)),
                percent(item.coverage(0.95))))
    parts = [
        figure(figures.error_by_horizon(assessment.horizons, assessment.floor,
                                        assessment.judged.horizon),
               'The farther ahead, the larger the error. The forecast is worth having where its '
               'line lies below both simple answers; it is honest where the dotted line, the '
               'error it expects of itself, lies on its own.'),
        table(('ahead', 'RMSE', 'stays as it is', 'at rest', '/ motion',
               *(('floor, estimated', '/ floor') * has_floor), 'stated', 'in 68 %', 'in 95 %'),
              rows, strong),
        note('/ motion: the error as a share of the standard deviation of what came; it is below '
             f'0.5 up to {_reach(assessment)} ahead.' + (
                 ' Floor: an estimate of the least error possible, from a long autoregression '
                 'that knew the whole record beforehand; no bound, for many samples a second '
                 'average the noise of a sensor.') * has_floor)]
    if assessment.axes:
        parts.append(table(
            (f'{assessment.judged.horizon:g} s ahead', 'RMSE', 'stays as it is', 'at rest',
             'in 95 %'),
            [(name, *(f'{np.degrees(value):.2f}°' for value in (
                item.rmse, item.persistence, item.zero)), percent(item.coverage(0.95)))
             for name, item in assessment.axes.items()]))
    if record.contents.every > 1:
        parts.append(note(f'From one in {record.contents.every} forecasts, chosen evenly.'))
    return section('Error by horizon', *parts)


def _calibration(assessment: Assessment) -> str:
    if not len(assessment.judged.normalised):
        return ''
    return section(
        'Calibration',
        figure(figures.calibration(assessment.judged),
               'Left: how much of what came lay inside intervals of every size. On the dashed '
               'line the forecast is honest, below it too sure of itself, above it too cautious. '
               'Right: the errors, each divided by the standard deviation stated for it.'))


def _spectra(record: Record) -> str:
    svg = figures.spectra(record.motion)
    return svg and section('Spectra', figure(
        svg, 'How the energy of each motion is spread over frequency (0.1 Hz is a period of '
        '10 s), from the longest stretch without a gap. The area is the variance.'))


def _liveliest(comparison: Comparison) -> tuple[int, int]:
    """Choose the two minutes in which the most came (ns)."""
    length = nanoseconds(ZOOM)
    first, last = int(comparison.valid_at[0]), int(comparison.valid_at[-1])
    starts = range(first, max(last - length, first) + 1, length // 4)
    best = max(starts, key=lambda start: rms(comparison.came[
        (comparison.valid_at >= start) & (comparison.valid_at < start + length)]))
    return best, max(min(best + length, last), best + NANOSECONDS)

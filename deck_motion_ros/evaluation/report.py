"""One page that a ship's officer and an engineer both like to read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from html import escape
from math import isfinite
import os
from pathlib import Path
import re

import numpy as np

from deck_motion_ros import __version__
from deck_motion_ros.evaluation import figures
from deck_motion_ros.evaluation.metrics import (
    Comparison,
    crest_errors,
    crests,
    motion_statistics,
    rms,
    Series,
    zero_crossing_period,
)
from deck_motion_ros.evaluation.record import read_record, Record
from deck_motion_ros.samples import Array, AXES, NANOSECONDS, nanoseconds, seconds, Vector3

SHOWN_HORIZONS = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 10.0)
ZOOM = 120.0  # s
MOST_GAPS = 12  # listed
SETTINGS = ': settings'  # ends the name of a status that states a node's parameters


@dataclass(frozen=True, eq=False)
class Assessment:
    """
    The forecasts of a bag, judged.

    Attributes
    ----------
    warm_up : float
        Seconds from the first measurement that are left out of everything but ``whole``.
    whole, judged : Comparison
        Height of the touchdown point at the predictor's horizon.
    horizons : list of Comparison
        The same for every horizon of the forecast.
    axes : dict of str to Comparison
        Roll and pitch (rad) at the predictor's horizon, if the forecast has it.
    crests : ndarray
        Announced minus true time (s) of crests 2 to 4 s ahead.
    reference : Series
        Height that came (m).
    absent : list of str
        Axes that never came and count as 0.

    """

    warm_up: float
    whole: Comparison
    judged: Comparison
    horizons: list[Comparison]
    axes: dict[str, Comparison]
    crests: Array
    reference: Series
    absent: list[str]

    def sentences(self) -> list[str]:
        """Say how good the forecast was, in plain words."""
        it = self.judged
        ahead = f'{it.horizon:g} s ahead'
        text = [f'{ahead} the height of the touchdown point was forecast with an error of '
                f'{_metres(it.rmse)} RMS.',
                f'Saying “it stays as it is” would have been wrong by {_metres(it.persistence)}, '
                f'saying “it is at rest” by {_metres(it.zero)}.']
        rival = min(it.persistence, it.zero)
        if it.rmse > rival:
            text.append('Here the simpler answer was the better one.')
        coverage = it.coverage(0.95)
        if self.absent:
            text.append(f"No {' and no '.join(self.absent)} came: what is missing counts as 0 "
                        'here, while the interval stated allows for it.')
        elif isfinite(coverage):
            verdict = ('the forecast is surer of itself than it should be' if coverage < 0.92 else
                       'it could be bolder' if coverage > 0.975 else 'that is honest')
            text.append(f'The 95 % interval it stated held {_percent(coverage)} of what came: '
                        f'{verdict}.')
        if self.warm_up:
            text.append(f'Over the whole run, its first {self.warm_up:g} s of learning included: '
                        f'{_metres(self.whole.rmse)} against {_metres(self.whole.persistence)}.')
        if len(self.crests) >= 10:
            text.append(f'Half of the crests announced 2 to 4 s ahead came within '
                        f'{np.median(np.abs(self.crests)):.2f} s of their time; guessing would '
                        f'give {zero_crossing_period(self.reference) / 4:.1f} s.')
        return text


def assessed(record: Record, warm_up: float | None = None) -> Assessment | None:
    """
    Judge the forecasts of a record.

    Parameters
    ----------
    record : Record
        What a bag holds.
    warm_up : float, optional
        Seconds to leave out at the start; 120 if the record is longer than 5 minutes, else 20.

    Returns
    -------
    Assessment or None
        ``None`` where there is nothing to judge, or no lever arm to judge it with.

    """
    if record.height is None or record.lever_arm is None or not record.motion:
        return None
    start, end = record.span
    if warm_up is None:
        warm_up = 120.0 if end - start > 300 * NANOSECONDS else 20.0
    judged_from = start + nanoseconds(warm_up)
    came, was = record.came(), record.was()
    whole = record.height.against(came, was)[0]
    judged = whole.issued_from(judged_from)
    if not len(judged):
        return None
    axes: dict[str, Comparison] = {}
    horizons: list[Comparison] = []
    errors = np.empty(0)
    densest = max(record.truth if any(record.truth) else record.measured,
                  key=lambda axis: len(axis) if axis else 0)
    assert densest is not None
    reference = Series.of(densest.stamps, came(densest.stamps))
    if record.forecast:
        horizons = [item.issued_from(judged_from) for item in record.forecast['height'].against(
            came, was)]
        for axis, name in enumerate(AXES[:2]):
            for item in record.forecast[name].against(record.came(axis), record.was(axis)):
                if abs(item.horizon - judged.horizon) < 0.01 and len(item):
                    axes[name] = item.issued_from(judged_from)
        ahead = record.forecast['height']
        late = ahead.issued_at >= judged_from
        errors = crest_errors((ahead.issued_at[late] - reference.stamps[0]) / NANOSECONDS,
                              ahead.horizons, ahead.mean[late], crests(reference))
    absent = [name for name in AXES if name not in record.motion]
    return Assessment(warm_up, whole, judged, [item for item in horizons if len(item)],
                      axes, errors, reference, absent)


def write_report(bag: str | Path, html_path: str | Path, *, lever_arm: Vector3 | None = None,
                 warm_up: float | None = None, namespace: str | None = None,
                 remap: Sequence[str] = (), title: str = '') -> list[str]:
    """
    Write one self-contained HTML page about a bag.

    Parameters
    ----------
    bag, html_path : str or Path
        From where to where.
    lever_arm : tuple of 3 float, optional
        The touchdown point in ship axes (m), where the bag's ``/diagnostics`` do not state it.
    warm_up : float, optional
        See :func:`assessed`.
    namespace, remap
        See :func:`read_record`.
    title : str
        Heading; the bag's name if empty.

    Returns
    -------
    list of str
        The headline in plain sentences.

    Raises
    ------
    ValueError
        If the bag cannot be read or its topics are ambiguous.
    OSError
        If the page cannot be written; nothing half-written stays behind.

    """
    record = read_record(bag, lever_arm, namespace, remap)
    assessment = assessed(record, warm_up)
    headline = assessment.sentences() if assessment else _motion_sentences(record)
    page = _page(record, assessment, headline, title or record.name)
    path = Path(html_path)
    draft = path.with_name(f'.{path.name}.partial')
    try:
        draft.write_text(page, encoding='utf-8')
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
    return headline


def _motion_sentences(record: Record) -> list[str]:
    start, end = record.span
    if not record.motion:
        return [f'{_duration(end - start)} were recorded; the bag holds no ship motion.']
    parts = []
    for name, series in record.motion.items():
        found = motion_statistics(series)
        parts.append(f'significant heave {_metres(found.significant)}' if name == 'heave' else
                     f'{name} sd {np.degrees(found.sd):.2f}°')
    text = [f"{_duration(end - start)} of ship motion: {', '.join(parts)}."]
    if record.height is None:
        return [*text, 'The bag holds no forecast.']
    if record.lever_arm is None:
        return [*text, 'The forecast is not judged: the bag does not state the lever arm of the '
                'touchdown point; give it to the report.']
    return [*text, 'The record is too short to judge the forecast.']


# --- the page -------------------------------------------------------------------------------

def _page(record: Record, assessment: Assessment | None, headline: list[str], title: str) -> str:
    start, end = record.span
    clock = figures.Clock.of(start, end)
    sections = [_recorded(record), _motion(record, assessment, clock)]
    if assessment:
        sections += [_forecast(record, assessment, clock), _by_horizon(record, assessment),
                     _calibration(assessment)]
    sections += [_spectra(record), _gaps(record, clock), _settings(record)]
    when = f'{_moment(start)} · {_duration(end - start)}'
    lead = ' '.join(escape(sentence) for sentence in headline[1:])
    return PAGE.format(
        title=escape(title), when=escape(when), style=STYLE, headline=escape(headline[0]),
        lead=lead, tiles=_tiles(assessment) if assessment else '', version=__version__,
        sections='\n'.join(section for section in sections if section))


PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} · deck motion report</title>
<style>{style}</style>
</head>
<body>
<header>
<p class="eyebrow">Deck motion report</p>
<h1>{title}</h1>
<p class="when">{when}</p>
<div class="headline"><p class="first">{headline}</p><p>{lead}</p></div>
{tiles}
</header>
<main>
{sections}
</main>
<footer>deck_motion_ros {version}. Roll positive port side up, pitch positive bow down, heave and
height positive up; heights are above where the point rests with roll = pitch = heave = 0.</footer>
</body>
</html>
"""

STYLE = """
:root { --ink: #24292f; --quiet: #59636e; --line: #e1e4e8; --wash: #f5f7f9; --blue: #0072b2; }
* { box-sizing: border-box; }
html { background: #fff; }
body { max-width: 62rem; margin: 0 auto; padding: 3rem 2rem 2rem; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
h1 { margin: 0; font-size: 1.9rem; line-height: 1.2; font-weight: 650; overflow-wrap: anywhere; }
h2 { margin: 3rem 0 .6rem; padding-top: 1.4rem; border-top: 1px solid var(--line);
  font-size: 1.25rem; font-weight: 650; }
p { margin: .5rem 0; max-width: 46rem; }
.eyebrow { margin: 0 0 .3rem; color: var(--blue); font-size: .8rem; font-weight: 650;
  letter-spacing: .08em; text-transform: uppercase; }
.when, figcaption, .note, footer { color: var(--quiet); }
.when { margin: .3rem 0 1.4rem; }
.headline { padding: 1.1rem 1.4rem; border-left: 4px solid var(--blue); background: var(--wash); }
.headline .first { font-size: 1.25rem; line-height: 1.4; font-weight: 600; }
.tiles { display: grid; grid-template-columns: repeat(4, 1fr); gap: 1rem; margin: 1.2rem 0 0; }
.tile { padding: .8rem 1rem; border: 1px solid var(--line); border-radius: 6px; }
.tile b { display: block; font-size: 1.6rem; line-height: 1.25; font-weight: 650; }
.tile.main b { color: var(--blue); }
.tile span { color: var(--quiet); font-size: .88rem; line-height: 1.3; display: block; }
figure { margin: 1rem 0 1.6rem; overflow-x: auto; }
figure svg { display: block; width: 100%; height: auto; }
figcaption, .note { margin-top: .5rem; max-width: 46rem; font-size: .92rem; }
table { margin: 1rem 0 1.4rem; border-collapse: collapse; font-size: .92rem;
  font-variant-numeric: tabular-nums; }
th, td { padding: .3rem 1.1rem .3rem 0; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: baseline; white-space: nowrap; }
th { color: var(--quiet); font-weight: 500; border-bottom-color: #c4cad0; }
td.text, th.text { text-align: left; white-space: normal; overflow-wrap: break-word;
  max-width: 34rem; }
tr.strong td { font-weight: 650; }
.scroll { overflow-x: auto; }
footer { margin-top: 3rem; padding-top: 1rem; border-top: 1px solid var(--line);
  font-size: .85rem; }
@media (max-width: 44rem) { body { padding: 1.5rem 1rem; }
  .tiles { grid-template-columns: repeat(2, 1fr); } figure svg { min-width: 40rem; } }
@media print {
  @page { margin: 15mm 14mm; }
  html { font-size: 10.5px; }
  body { padding: 0; max-width: none; font-size: 10.5px; }
  h2 { margin-top: 1.8rem; padding-top: 1rem; break-after: avoid; }
  figure, table, .tiles, .headline { break-inside: avoid; }
  .scroll { overflow: visible; }
  * { print-color-adjust: exact; }
}
"""


def _section(heading: str, *parts: str) -> str:
    return f'<section>\n<h2>{escape(heading)}</h2>\n' + '\n'.join(parts) + '\n</section>'


def _figure(svg: str, note: str) -> str:
    return f'<figure>{svg}<figcaption>{escape(note)}</figcaption></figure>'


def _note(text: str) -> str:
    return f'<p class="note">{escape(text)}</p>'


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], strong: int = -1,
           texts: int = 1) -> str:
    """Set a table whose first ``texts`` columns are text, one row of it strong."""
    def cells(tag: str, row: Sequence[str]) -> str:
        return ''.join(f'<{tag}{TEXT * (column < texts)}>{_typeset(cell)}</{tag}>'
                       for column, cell in enumerate(row))
    body = ''.join(f"<tr{' class=strong' * (number == strong)}>{cells('td', row)}</tr>\n"
                   for number, row in enumerate(rows))
    return (f'<div class="scroll"><table><thead><tr>{cells("th", head)}</tr></thead>\n'
            f'<tbody>{body}</tbody></table></div>')


TEXT = ' class="text"'


def _typeset(text: str) -> str:
    """Escape a cell, with a true minus where a number begins."""
    return escape(re.sub(r'^-(?=\d)', '\N{MINUS SIGN}', text))


def _tiles(assessment: Assessment) -> str:
    it = assessment.judged
    tiles = [('rmse', _metres(it.rmse), f'error of the forecast {it.horizon:g} s ahead, RMS'),
             ('persistence', _metres(it.persistence), 'error of “it stays as it is”'),
             ('zero', _metres(it.zero), 'error of “it is at rest”'),
             ('coverage', _percent(it.coverage(0.95)), 'of what came lay in the 95 % interval')]
    return '<div class="tiles">' + ''.join(
        f'<div class="tile{" main" * (key == "rmse")}"><b id="{key}">{value}</b>'
        f'<span>{label}</span></div>' for key, value, label in tiles) + '</div>'


def _recorded(record: Record) -> str:
    rows = []
    for name, (kind, found) in record.topics.items():
        longest = max((length for _, length in found.gaps), default=0.0)
        rows.append((name, kind, f'{found.count}', _rate(found.rate),
                     f'{longest:.1f} s' if longest else '–'))
    text = 'The bag holds no ship motion.'
    if record.motion:
        text = f"Ship motion: {', '.join(record.motion)}. " + (
            'The true motion is there too, as a simulator knows it.' if any(record.truth) else
            'The true motion is not known, as on any real ship.')
    return _section(
        'What was recorded',
        f'<p>{text}</p>',
        _table(('topic', 'type', 'messages', 'rate', 'longest gap'), rows, texts=2),
        _note('Rates and gaps are those of the time stamps in the messages; a gap is 2.5 times '
              'as long as nine of ten steps are at most, and does not count in the rate.'))


def _motion(record: Record, assessment: Assessment | None, clock: figures.Clock) -> str:
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
        values = [_fixed(scale * value, digits, unit) for value in (
            found.mean, found.sd, found.low, found.high, found.significant)]
        rows.append((name, *values, _period(found.zero_crossing_period),
                     _period(found.peak_period)))
    return _section(
        'The motion',
        _figure(figures.motion(record.motion, clock),
                'Roll positive port side up, pitch positive bow down, heave positive up. '
                'Lines break where nothing was measured.'),
        _table(('', 'mean', 'sd', 'lowest', 'highest', 'significant', 'zero-crossing period',
                'peak period'), rows),
        _note('Significant: four standard deviations, crest to trough; what an experienced eye '
              'calls the height of the motion. Zero-crossing period: mean time between upward '
              'passages of the mean. Peak period: where the spectrum is highest.'))


def _forecast(record: Record, assessment: Assessment, clock: figures.Clock) -> str:
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
    rows = [(name, f'{len(item)}', _metres(item.rmse), _metres(item.bias),
             _metres(item.persistence), _metres(item.zero), _percent(item.coverage(0.6827)),
             _percent(item.coverage(0.95)), f'{item.nis:.2f}')
            for name, item in ((f'after {assessment.warm_up:g} s', judged), ('whole run', whole))]
    arm = ', '.join(_typeset(f'{value:g}') for value in record.lever_arm or ())
    against = (
        'Scored against the true motion in the bag.' if any(record.truth) else
        'Scored against the measurements that came later: the noise of the sensor is part of '
        'every error.')
    return _section(
        'Forecast against what came',
        _figure(svg, caption),
        _table(('', 'forecasts', 'RMSE', 'bias', 'stays as it is', 'at rest', 'in 68 %',
                'in 95 %', 'mean NIS'), rows, strong=0),
        _note(f'{against} The touchdown point lies at ({arm}) m in the ship (forward, left, up). '
              '“Stays as it is” is the height measured when the forecast was issued; “at rest” '
              'is zero. All three are judged at the same instants. NIS: squared error over the '
              'variance stated, 1 if honest.'))


def _by_horizon(record: Record, assessment: Assessment) -> str:
    if not assessment.horizons:
        return ''
    rows: list[tuple[str, ...]] = []
    strong = -1
    for item in assessment.horizons:
        if min(abs(item.horizon - shown) for shown in SHOWN_HORIZONS) < 0.01:
            if abs(item.horizon - assessment.judged.horizon) < 0.01:
                strong = len(rows)
            rows.append((f'{item.horizon:g} s', _metres(item.rmse), _metres(item.persistence),
                         _metres(item.zero), _metres(rms(item.sd[np.isfinite(item.sd)])),
                         _percent(item.coverage(0.68)), _percent(item.coverage(0.95))))
    parts = [
        _figure(figures.error_by_horizon(assessment.horizons, assessment.judged.horizon),
                'The farther ahead, the larger the error. The forecast is worth having where its '
                'line lies below both simple answers; it is honest where the dotted line, the '
                'error it expects of itself, lies on its own.'),
        _table(('ahead', 'RMSE', 'stays as it is', 'at rest', 'stated', 'in 68 %', 'in 95 %'),
               rows, strong)]
    if assessment.axes:
        parts.append(_table(
            (f'{assessment.judged.horizon:g} s ahead', 'RMSE', 'stays as it is', 'at rest',
             'in 95 %'),
            [(name, *(f'{np.degrees(value):.2f}°' for value in (
                item.rmse, item.persistence, item.zero)), _percent(item.coverage(0.95)))
             for name, item in assessment.axes.items()]))
    if record.every > 1:
        parts.append(_note(f'From one in {record.every} forecasts, chosen evenly.'))
    return _section('Error by horizon', *parts)


def _calibration(assessment: Assessment) -> str:
    if not len(assessment.judged.normalised):
        return ''
    return _section(
        'Calibration',
        _figure(figures.calibration(assessment.judged),
                'Left: how much of what came lay inside intervals of every size. On the dashed '
                'line the forecast is honest, below it too sure of itself, above it too cautious. '
                'Right: the errors, each divided by the standard deviation stated for it.'))


def _spectra(record: Record) -> str:
    svg = figures.spectra(record.motion)
    return svg and _section('Spectra', _figure(
        svg, 'How the energy of each motion is spread over frequency (0.1 Hz is a period of '
        '10 s), from the longest stretch without a gap. The area is the variance.'))


def _gaps(record: Record, clock: figures.Clock) -> str:
    shown = {name: found for name, (_, found) in record.topics.items()
             if found.count and name != '/diagnostics'}
    gaps = sorted(((length, stamp, name) for name, found in shown.items()
                   for stamp, length in found.gaps), reverse=True)
    parts = [_figure(figures.presence(shown, clock),
                     'Blue: messages came; orange: a gap. The stamps of touchdown/height and '
                     'touchdown/prediction lie ahead by the horizon.')] if gaps else [
        '<p>No topic had a gap.</p>']
    if gaps:
        parts.append(_table(
            ('topic', f'after ({clock.unit})', 'gap'),
            [(name, f'{clock(stamp):.2f}', f'{length:.2f} s')
             for length, stamp, name in gaps[:MOST_GAPS]]))
        if len(gaps) > MOST_GAPS:
            parts.append(_note(f'The longest {MOST_GAPS} of {len(gaps)} gaps.'))
    troubles = [(name, what, f'{count}') for name, found in shown.items() for what, count in (
        ('the same stamp again', found.duplicates), ('a stamp older than one before',
                                                     found.backwards)) if count]
    troubles += [(topic, f'not usable for this report: {reason}', f'{count}')
                 for (topic, reason), count in record.unusable.items()]
    for name, (_, _, values) in record.states.items():
        troubles += [(name, key, value) for key, value in values.items()
                     if value != '0' and re.match('rejected|restarts|.*unexpected', key)]
    troubles += [(name, 'warnings or errors on /diagnostics', f'{count}')
                 for name, count in record.warned.items() if count]
    if troubles:
        parts.append(_table(('where', 'what', 'how often'), troubles, texts=2))
    else:
        parts.append('<p>No message was rejected, repeated or out of order.</p>')
    reports = [(name, message) for name, (_, message, _) in record.states.items()
               if not name.endswith(SETTINGS)]
    if reports:
        parts.append(_table(('reported by', 'last state'), reports, texts=2))
    return _section('Gaps and rejects', *parts)


def _settings(record: Record) -> str:
    stated = {'predictor': record.settings} if record.settings else {}
    stated |= {name.removesuffix(SETTINGS): values
               for name, (_, _, values) in record.states.items() if name.endswith(SETTINGS)}
    return _section('Settings', *(
        _table((node, ''), sorted(values.items()), texts=2)
        for node, values in stated.items())) if stated else ''


# --- words and figures ----------------------------------------------------------------------

def _liveliest(comparison: Comparison) -> tuple[int, int]:
    """Choose the two minutes in which the most came (ns)."""
    length = nanoseconds(ZOOM)
    first, last = int(comparison.valid_at[0]), int(comparison.valid_at[-1])
    starts = range(first, max(last - length, first) + 1, length // 4)
    best = max(starts, key=lambda start: rms(comparison.came[
        (comparison.valid_at >= start) & (comparison.valid_at < start + length)]))
    return best, max(min(best + length, last), best + NANOSECONDS)


def _metres(value: float) -> str:
    """
    Write a length as people say it.

    >>> _metres(2.2466), _metres(0.0312)
    ('2.25 m', '3.1 cm')
    """
    if not isfinite(value):
        return '–'
    return _fixed(value, 2, ' m') if abs(value) >= 0.0995 else _fixed(100 * value, 1, ' cm')


def _fixed(value: float, digits: int, unit: str) -> str:
    """Write a number with so many digits; what rounds to 0 has no sign."""
    return f'{round(value, digits) + 0.0:.{digits}f}{unit}'


def _percent(value: float) -> str:
    return f'{100 * value:.1f} %' if isfinite(value) else '–'


def _period(value: float) -> str:
    return f'{value:.1f} s' if isfinite(value) else '–'


def _rate(value: float) -> str:
    return f'{value:.3g} Hz' if isfinite(value) else '–'


def _duration(length: int) -> str:
    """
    Write a duration (ns).

    >>> _duration(624_000_000_000)
    '10 min 24 s'
    """
    total = seconds(length)
    if total < 60:
        return f'{total:.1f} s'
    hours, rest = divmod(round(total), 3600)
    minutes, remainder = divmod(rest, 60)
    return (f'{hours} h ' if hours else '') + f'{minutes} min {remainder} s'


def _moment(stamp: int) -> str:
    """Write a stamp as date and time; small ones count from the recorder's own zero."""
    if stamp < nanoseconds(365 * 86400.0):
        return f'start at {seconds(stamp):.2f} s of its own clock'
    return f'{datetime.fromtimestamp(stamp // NANOSECONDS, timezone.utc):%Y-%m-%d %H:%M:%S} UTC'

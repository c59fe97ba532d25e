"""
Recorded logs into bags: CSV files, raw NMEA 0183 logs, UWB range files.

What every import does: the bag holds the messages in the order of the file; a log time is the
stamp, or the topic's newest stamp so far where the file steps back, so that reading by log time
keeps that order. A row or sentence that cannot be used is counted by kind with the number of its
first line, never guessed. An axis that is not in the file is not in the bag. A sensor that gives
attitude alone says so (covariance[0] = -1 for rates and specific force); variances that the file
does not state are 0 = unknown. Without a heading the yaw is 0.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
import csv
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import partial, reduce
from itertools import islice
from math import ceil, isfinite, nan, radians
from operator import xor
from pathlib import Path
import re
from typing import Any, TextIO

from deck_motion_ros import geometry, messages, topics
from deck_motion_ros.config import parameters
from deck_motion_ros.estimators.landing import LandingConfig
from deck_motion_ros.recording import BagTypes, BagWriter, encode
from deck_motion_ros.samples import (
    HeaveSample,
    ImuSample,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
    RangeSample,
)

END_OF_TIME = 2**31  # s: what a ROS stamp can hold

# What the landing node is told of recorded ranges, which come without inertial data.
CARRIED = LandingConfig(
    deck_static=True, range_sd=0.2, range_scale_sd=0.01, range_bias_time=1e4,
    target_acceleration_psd=0.2, target_vertical_psd=0.01, inertial_bias_sd=0.0,
    start_velocity_sd=1.5)
DRIVEN = LandingConfig(
    deck_static=True, known_height=0.0, range_sd=0.5, range_scale_sd=0.1, range_bias_sd=0.1,
    range_bias_time=1e5, target_acceleration_psd=0.05, inertial_bias_sd=0.0,
    start_velocity_sd=2.0)


class ImportFailed(ValueError):
    """A file that cannot be imported; the text is one line: what is wrong and where."""


@dataclass
class ImportSummary:
    """
    What an import read, wrote and left out.

    Attributes
    ----------
    source, bag : Path
        From where to where.
    kind : str
        ``CSV``, ``NMEA`` or ``UWB``.
    messages : Counter
        Messages written, by topic.
    first_stamp, last_stamp : int
        Oldest and newest stamp written (ns).
    skipped : dict
        Reason -> (how often, first line): rows or sentences that could not be used.
    other_sentences : Counter
        NMEA sentences that nothing here needs, by their first word.
    backwards : int
        Messages stamped before an earlier one of their topic: written all the same.
    notes : list of str
        What was decided on the way.
    files : list of Path
        Files written beside the bag.

    """

    source: Path
    bag: Path
    kind: str = ''
    messages: Counter[str] = field(default_factory=Counter)
    first_stamp: int = 0
    last_stamp: int = 0
    skipped: dict[str, tuple[int, int]] = field(default_factory=dict)
    other_sentences: Counter[str] = field(default_factory=Counter)
    backwards: int = 0
    notes: list[str] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)

    def skip(self, reason: str, line: int) -> None:
        """Count a row or sentence that could not be used."""
        count, first = self.skipped.get(reason, (0, line))
        self.skipped[reason] = (count + 1, first)

    def __str__(self) -> str:
        written = ', '.join(f'{count} {topic}' for topic, count in self.messages.items())
        length = (self.last_stamp - self.first_stamp) / NANOSECONDS
        text = [f'{self.source.name} ({self.kind}): {written} in {length:.1f} s', *self.notes]
        text += [f'skipped {count}: {reason} (first in line {line})'
                 for reason, (count, line) in self.skipped.items()]
        if self.backwards:
            text.append(f'{self.backwards} stamps older than one before them: kept')
        if self.other_sentences:
            text.append('not needed: ' + ', '.join(
                f'{count} {name}' for name, count in sorted(self.other_sentences.items())))
        return '\n'.join(text + [f'also written: {path}' for path in self.files])


def import_file(path: str | Path, out_bag: str | Path, time_column: str = '') -> ImportSummary:
    """
    Turn a recorded log into a bag; the format is recognised from the content.

    Parameters
    ----------
    path : str or Path
        A CSV file with a time column ``t_s`` (seconds; another ``t_..._s`` if there is none) and
        ``heave_m`` (up), ``roll_deg`` (port side up) with ``pitch_deg`` (bow **up**),
        ``heading_deg``; or a UWB file ``..._ranges.csv`` (``t_s``, ``anchor_id``, ``range_m``)
        beside its ``..._anchors.csv`` and, if there is one, ``..._truth.csv``; or a log of NMEA
        sentences, the time of arrival before each if there is one.
    out_bag : str or Path
        Folder of the bag, which must not exist. UWB anchors are written beside it as a parameter
        file of the landing node, ``..._landing.yaml``.
    time_column : str
        Another time column of a CSV file.

    Returns
    -------
    ImportSummary

    Raises
    ------
    ImportFailed
        If the format is unknown, a column is missing or nothing in it can be used.
    OSError
        If a file cannot be read or written. Nothing half-written stays behind.

    """
    summary = ImportSummary(Path(path), Path(out_bag))
    read = _recognised(summary.source)
    samples, parameter_file = read(summary.source, summary, time_column)
    if not samples:
        reasons = ', '.join(f'{count} x {reason}'
                            for reason, (count, _) in summary.skipped.items())
        raise ImportFailed(
            f"{summary.source}: nothing to import ({reasons or 'no row or sentence of use'})")
    _write(samples, summary)
    if parameter_file:
        beside = summary.bag.with_name(f'{summary.bag.name}_landing.yaml')
        beside.write_text(parameter_file, encoding='utf-8')
        summary.files.append(beside)
    return summary


Samples = list[tuple[str, Any]]  # topic, sample
Reader = Callable[[Path, ImportSummary, str], tuple[Samples, str]]


def _recognised(source: Path) -> Reader:
    with source.open(encoding='utf-8-sig', errors='replace') as file:
        start = [line.strip() for line in islice(file, 50)]
    if any(re.search(r'[$!]\w{4,6},', line) for line in start):
        return _nmea
    columns = _names(start[0].split(',')) if start else []
    if len(columns) > 1 and all(re.fullmatch(r'[a-z]\w*', name) for name in columns):
        return _uwb if {'anchor_id', 'range_m'} <= set(columns) else _csv
    raise ImportFailed(f'{source}: neither CSV with a line of column names nor NMEA sentences')


def _names(cells: Sequence[str]) -> list[str]:
    return [cell.strip().strip('"').lower() for cell in cells]


# --- into the bag ---------------------------------------------------------------------------

BUILDERS: dict[str, tuple[str, Callable[[BagTypes, Any], Any]]] = {
    'ship/imu': (topics.IMU, partial(messages.imu_message, rates=False)),
    'ship/heave': (topics.POINT, messages.heave_message),
    'uwb/range': (topics.RANGE, messages.range_message),
    'landing/truth': (topics.ODOMETRY, messages.odometry_message),
}


def _write(samples: Samples, summary: ImportSummary) -> None:
    newest: dict[str, int] = {}
    timed = []
    for topic, sample in samples:
        summary.messages[topic] += 1
        summary.backwards += sample.stamp < newest.get(topic, 0)
        newest[topic] = max(sample.stamp, newest.get(topic, 0))
        timed.append((newest[topic], topic, sample))
    timed.sort(key=lambda event: event[0])  # stable: keeps the file's order
    stamps = [sample.stamp for _, sample in samples]
    summary.first_stamp, summary.last_stamp = min(stamps), max(stamps)
    types = BagTypes()
    with BagWriter(summary.bag, atomic=True) as writer:
        for topic in newest:
            writer.add_topic(f'/{topic}', BUILDERS[topic][0])
        for log_time, topic, sample in timed:
            type_name, build = BUILDERS[topic]
            writer.write(f'/{topic}', log_time, encode(type_name, build(types, sample)))


def _motion(stamp: int, roll_deg: float, pitch_up_deg: float, heading_deg: float,
            heave: float) -> Iterator[tuple[str, Any]]:
    """
    Give the samples of one set of measurements, NaN = absent.

    Raises
    ------
    ValueError
        If an angle is out of range.

    """
    if abs(roll_deg) > 180 or abs(pitch_up_deg) > 90 or abs(heading_deg) > 360:
        raise ValueError('angle out of range')
    if isfinite(roll_deg) and isfinite(pitch_up_deg):
        yaw = geometry.yaw_from_heading(radians(heading_deg)) if isfinite(heading_deg) else 0.0
        attitude = geometry.quaternion_from_rpy(
            radians(roll_deg), geometry.pitch_bow_down(radians(pitch_up_deg)), yaw)
        unknown = (0.0, 0.0, 0.0)
        yield 'ship/imu', ImuSample(stamp, 'ship_base_link', attitude, unknown, unknown, unknown)
    if isfinite(heave):
        yield 'ship/heave', HeaveSample(stamp, 'ship_level', heave)


# --- CSV ------------------------------------------------------------------------------------

class _Table:
    """A CSV file with a line of column names."""

    def __init__(self, path: Path, summary: ImportSummary) -> None:
        self.path, self._summary = path, summary
        with self._open() as file:
            self.columns = _names(next(csv.reader(file), []))

    def _open(self) -> TextIO:
        return self.path.open(newline='', encoding='utf-8-sig', errors='replace')

    def present(self, *names: str) -> list[str]:
        """Choose those of the names that are columns."""
        return [name for name in names if name in self.columns]

    def time_column(self, wanted: str) -> str:
        """Choose the time column: the one asked for, ``t_s``, another ``t_..._s``."""
        usable = [wanted] if wanted else sorted(
            (name for name in self.columns if re.fullmatch(r't_(\w+_)?s', name)), key=len)
        if not usable or usable[0] not in self.columns:
            raise self.lacks(f"the time column {wanted or 't_s'}")
        return usable[0]

    def lacks(self, what: str) -> ImportFailed:
        """Name what is needed and what is there."""
        return ImportFailed(f"{self.path}: needs {what}; it has {', '.join(self.columns)}")

    def rows(self, *names: str) -> list[tuple[int, list[float]]]:
        """List line and the named numbers of each row; one that lacks any of them is counted."""
        for name in names:
            if name not in self.columns:
                raise self.lacks(name)
        places = [self.columns.index(name) for name in names]
        found = []
        with self._open() as file:
            reader = csv.reader(file)
            next(reader)
            for row in filter(any, reader):
                try:
                    values = [float(row[place]) for place in places]
                except (ValueError, IndexError):
                    values = [nan]
                if all(abs(value) < END_OF_TIME for value in values):
                    found.append((reader.line_num, values))
                else:
                    self._summary.skip(f'{self.path.name}: not a usable number', reader.line_num)
        return found


def _origin(times: list[float], summary: ImportSummary) -> int:
    """Choose the whole seconds to add where a file begins before 0, which no bag can hold."""
    shift = max(0, ceil(-min(times, default=0.0)))
    if shift:
        summary.notes.append(f'{shift} s added to all stamps: the file begins before 0')
    return shift


def _csv(source: Path, summary: ImportSummary, time_column: str) -> tuple[Samples, str]:
    summary.kind = 'CSV'
    table = _Table(source, summary)
    time = table.time_column(time_column)
    angles, heave = table.present('roll_deg', 'pitch_deg'), table.present('heave_m')
    if len(angles) == 1 or not angles + heave:
        raise table.lacks('heave_m, or roll_deg with pitch_deg')
    names = [*angles, *(table.present('heading_deg') if angles else []), *heave]
    unused = [name for name in table.columns if name not in (time, *names)]
    summary.notes.append(f'stamps: {time}, counted from 0')
    if unused:
        summary.notes.append(f"columns not used: {', '.join(unused)}")
    rows = table.rows(time, *names)
    origin = _origin([values[0] for _, values in rows], summary)
    samples: Samples = []
    for line, (moment, *values) in rows:
        axes = dict(zip(names, values, strict=True))
        try:
            samples += _motion(nanoseconds(origin + moment), *(
                axes.get(name, nan) for name in ('roll_deg', 'pitch_deg', 'heading_deg', 'heave_m')
            ))
        except ValueError as error:
            summary.skip(str(error), line)
    return samples, ''


def _uwb(source: Path, summary: ImportSummary, time_column: str) -> tuple[Samples, str]:
    summary.kind = 'UWB'
    stem = source.name.removesuffix('_ranges.csv')
    anchors_file, truth_file = (
        source.with_name(f'{stem}_{what}.csv') for what in ('anchors', 'truth'))
    if stem == source.name or not anchors_file.is_file():
        raise ImportFailed(f'{source}: UWB ranges X_ranges.csv need their anchors X_anchors.csv')
    table = _Table(source, summary)
    anchor_table = _Table(anchors_file, summary)
    anchors = {f'anchor_{number:g}': place
               for number, place in _places(anchor_table, 'anchor_id')}
    ranges = table.rows(table.time_column(time_column), 'anchor_id', 'range_m')
    truth = []
    if truth_file.is_file():
        truth_table = _Table(truth_file, summary)
        truth = _places(truth_table, truth_table.time_column(''))
    times = [values[0] for _, values in ranges] + [moment for moment, _ in truth]
    origin = _origin(times, summary)
    samples: Samples = []
    for line, (moment, number, distance) in ranges:
        frame = f'anchor_{number:g}'
        if frame in anchors and distance > 0:
            samples.append(('uwb/range', RangeSample(
                nanoseconds(origin + moment), frame, distance, 0.0)))
        else:
            summary.skip('unknown anchor, or range not above 0', line)
    level, unknown = (0.0, 0.0, 0.0, 1.0), (nan, nan, nan)
    samples += [('landing/truth', OdometrySample(
        nanoseconds(origin + moment), 'deck', 'uav_deck', place, level, unknown, unknown,
        (0.0,) * 6)) for moment, place in truth]
    config, assumed = (CARRIED, 'a radio carried on foot, ranges good to 0.2 m and 1 %') if (
        'z_m' in anchor_table.columns) else (
        DRIVEN, 'a vehicle on a plane, ranges good to 0.5 m, up to 10 % too long')
    told = {'anchor_frames': [*anchors],
            'anchor_positions': [value for place in anchors.values() for value in place],
            **_told(config)}
    text = ''.join(f'    {name}: {_yaml(value)}\n' for name, value in told.items())
    return samples, (
        f'# Anchors of {source.name}: x, y, z in deck (m). No ship motion came with it.\n'
        f'# Assumed: {assumed}\n'
        f'landing:\n  ros__parameters:\n{text}')


def _told(config: LandingConfig) -> dict[str, Any]:
    """Return the parameters that are not the defaults; NaN says unset."""
    return {name: value for name, rule in parameters(LandingConfig).items()
            if (value := getattr(config, name)) != rule.default and value == value}


def _yaml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(str, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _places(table: _Table, key: str) -> list[tuple[float, tuple[float, float, float]]]:
    """List key and position of each row; a file in the plane has z = 0."""
    height = table.present('z_m')
    return [(first, (x, y, z[0] if z else 0.0))
            for _, (first, x, y, *z) in table.rows(key, 'x_m', 'y_m', *height)]


# --- NMEA -----------------------------------------------------------------------------------

ISO_TIME = re.compile(r'(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d):(\d\d(?:\.\d+)?)')
ZDA_TIME = re.compile(r'(\d\d)(\d\d)(\d\d(?:\.\d*)?)')


def _nmea(source: Path, summary: ImportSummary, time_column: str) -> tuple[Samples, str]:
    """
    Read ``$PSXN,23`` (roll, pitch bow up, heading, heave positive down), ``ZDA`` and ``HDT``.

    A set of motions is stamped with the last ZDA time: the time of a replayed log's arrival lies.
    Of several sets after one ZDA the first is used: nothing tells when the others were measured.
    Sets before the first ZDA are dropped; a log without any ZDA is stamped by arrival.
    ``$PSXN,20`` with a last field of 2 declares roll and pitch invalid.
    """
    summary.kind = 'NMEA'
    sets: list[tuple[int, int | None, int | None, list[float]]] = []
    clock, heading, attitude_valid = None, nan, True
    for line, arrival, fields in _sentences(source, summary):
        word = fields[0]
        try:
            if word.endswith('ZDA'):
                clock = _zda_stamp(fields)
            elif word.endswith('HDT'):
                heading = _number(fields[1])
            elif word == 'PSXN' and fields[1] == '20':
                attitude_valid = fields[5] != '2'
            elif word == 'PSXN' and fields[1] == '23':
                roll, pitch, own_heading, heave_down = map(_number, fields[2:6])
                if not attitude_valid:
                    summary.skip('roll and pitch declared invalid by PSXN,20', line)
                    roll = pitch = nan
                sets.append((line, clock, arrival, [
                    roll, pitch, own_heading if isfinite(own_heading) else heading,
                    geometry.heave_up(heave_down)]))
            else:
                summary.other_sentences[','.join(fields[:2]) if word == 'PSXN' else word] += 1
        except (ValueError, IndexError):
            summary.skip(f'malformed {word}', line)
    by_zda = clock is not None
    summary.notes.append(f"stamps: {'the last ZDA time' if by_zda else 'arrival, without ZDA'}")
    samples: Samples = []
    before = None
    for line, zda, arrival, motion in sets:
        stamp = zda if by_zda else arrival
        try:
            if stamp is None:
                raise ValueError('PSXN before the first ZDA' if by_zda else 'PSXN without a time')
            if stamp == before:
                raise ValueError('PSXN with the same time as the one before')
            found = list(_motion(stamp, *motion))
            if not found:
                raise ValueError('empty PSXN')
        except ValueError as error:
            summary.skip(str(error), line)
        else:
            samples += found
            before = stamp
    return samples, ''


def _sentences(source: Path, summary: ImportSummary) -> Iterator[
        tuple[int, int | None, list[str]]]:
    """Yield line, time of arrival (ns) and fields of each sentence with a right checksum."""
    with source.open(encoding='ascii', errors='replace') as file:
        for line, text in enumerate(file, 1):
            prefix, start, sentence = text.strip().replace('!', '$').partition('$')
            body, star, checksum = sentence.partition('*')
            if not start:
                if text.strip():
                    summary.skip('no sentence', line)
            elif not star:
                summary.skip('no checksum', line)
            elif checksum.strip().upper() != f'{reduce(xor, body.encode(), 0):02X}':
                summary.skip('wrong checksum', line)
            else:
                yield line, _arrival(prefix), body.split(',')


def _number(text: str) -> float:
    """Read a field; an empty one is NaN. Raise ValueError for any other non-number."""
    value = float(text) if text.strip() else nan
    if text.strip() and not isfinite(value):
        raise ValueError(text)
    return value


def _arrival(prefix: str) -> int | None:
    match = ISO_TIME.search(prefix)
    try:
        return _utc_stamp(*match.groups()) if match else None
    except ValueError:
        return None


def _zda_stamp(fields: list[str]) -> int:
    match = ZDA_TIME.fullmatch(fields[1])
    if not match:
        raise ValueError(fields[1])
    day, month, year = fields[2:5]
    return _utc_stamp(year, month, day, *match.groups())


def _utc_stamp(year: str, month: str, day: str, hour: str, minute: str, second: str) -> int:
    """Read a date and time (UTC) as nanoseconds; ValueError if there is no such time."""
    start = datetime(int(year), int(month), int(day), int(hour), int(minute), tzinfo=timezone.utc)
    stamp = int(start.timestamp()) * NANOSECONDS + nanoseconds(float(second))
    if not 0 <= float(second) < 61 or not 0 <= stamp < END_OF_TIME * NANOSECONDS:
        raise ValueError('no time')
    return stamp

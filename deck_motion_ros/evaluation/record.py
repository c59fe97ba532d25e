"""What a bag holds, as the series and forecasts that the metrics compare."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import struct
from typing import Any
from zlib import crc32

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.evaluation.metrics import (
    compared,
    Comparison,
    Regularity,
    regularity,
    Series,
    Stamps,
    touchdown_height,
)
from deck_motion_ros.geometry import attitude_of_mounted, rpy_from_quaternion
from deck_motion_ros.names import absolute, remappings
from deck_motion_ros.recording import BagReader, BagTypes
from deck_motion_ros.samples import (
    Array,
    AXES,
    NANOSECONDS,
    nanoseconds,
    Quaternion,
    Rejected,
    seconds,
    Vector3,
)
from deck_motion_ros.topics import BY_NAME

MOST_FORECASTS = 4000  # read from one bag: enough for every figure
INPUTS = ('ship/imu', 'ship/heave', 'ship/odometry')
JOINTS = ('height', 'roll', 'pitch')

Axes = tuple[Series | None, Series | None, Series | None]
Status = tuple[int, str, dict[str, str]]  # level, message, values


@dataclass(frozen=True, eq=False)
class Trajectories:
    """
    The forecasts of one quantity.

    Attributes
    ----------
    issued_at : ndarray of int64, shape (n,)
        Nanoseconds.
    horizons : ndarray, shape (m,)
        Seconds ahead.
    mean, sd : ndarray, shape (n, m)
        NaN where not stated.

    """

    issued_at: Stamps
    horizons: Array
    mean: Array
    sd: Array

    def against(self, came: Callable[[Stamps], Array],
                measured: Callable[[Stamps], Array]) -> list[Comparison]:
        """Set every horizon beside what came; see :func:`compared`."""
        return [compared(horizon, self.issued_at, self.issued_at + nanoseconds(horizon),
                         self.mean[:, column], self.sd[:, column], came, measured)
                for column, horizon in enumerate(self.horizons.tolist())]


@dataclass(eq=False)
class Record:
    """
    A bag, read.

    Attributes
    ----------
    name : str
        Of the bag.
    topics : dict of str to (str, Regularity)
        Type and stamps of every topic.
    measured, truth : tuple of 3 (Series or None)
        Roll, pitch (rad, REP-103), heave (m, up), as measured and as they were.
    height : Trajectories or None
        ``touchdown/height``, one horizon.
    forecast : dict of str to Trajectories
        ``height``, ``roll`` and ``pitch`` of ``touchdown/forecast``.
    every : int
        Every so many-th forecast was read.
    lever_arm : tuple of 3 float or None
        The touchdown point in ship axes (m), as given or as the predictor states it.
    settings : dict of str to str
        What the predictor says of its settings on ``/diagnostics``.
    states : dict of str to (int, str, dict)
        Last level, message and values of every other status, by its name.
    warned : Counter
        Statuses above level 0, by name.
    unusable : Counter
        Messages that could not be used here, by (topic, reason).

    """

    name: str
    topics: dict[str, tuple[str, Regularity]] = field(default_factory=dict)
    measured: Axes = (None, None, None)
    truth: Axes = (None, None, None)
    height: Trajectories | None = None
    forecast: dict[str, Trajectories] = field(default_factory=dict)
    every: int = 1
    lever_arm: Vector3 | None = None
    settings: dict[str, str] = field(default_factory=dict)
    states: dict[str, Status] = field(default_factory=dict)
    warned: Counter[str] = field(default_factory=Counter)
    unusable: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def span(self) -> tuple[int, int]:
        """First and last stamp of the ship's motion, of all topics where there is none (ns)."""
        ends = [(int(axis.stamps[0]), int(axis.stamps[-1])) for axis in self.motion.values()] or [
            (found.first, found.last) for _, found in self.topics.values() if found.count]
        return min(first for first, _ in ends), max(last for _, last in ends)

    @property
    def motion(self) -> dict[str, Series]:
        """The measured axes by name, the true ones where nothing was measured."""
        axes = self.measured if any(self.measured) else self.truth
        return {name: axis for name, axis in zip(AXES, axes, strict=True) if axis is not None}

    def was(self, axis: int | None = None) -> Callable[[Stamps], Array]:
        """Give the measured height of the touchdown point, or one axis, at stamps."""
        return self._at(self.measured if any(self.measured) else self.truth, axis)

    def came(self, axis: int | None = None) -> Callable[[Stamps], Array]:
        """Give the same as it truly was; as measured where the bag has no truth."""
        return self._at(self.truth if any(self.truth) else self.measured, axis)

    def _at(self, axes: Axes, axis: int | None) -> Callable[[Stamps], Array]:
        arm = self.lever_arm
        if axis is None and arm is not None:
            return lambda stamps: touchdown_height(axes, stamps, arm)
        chosen = None if axis is None else axes[axis]
        return lambda stamps: np.full(len(stamps), np.nan) if chosen is None else chosen.at(stamps)


def read_record(bag: str | Path, lever_arm: Vector3 | None = None,
                namespace: str | None = None, remap: Sequence[str] = ()) -> Record:
    """
    Read a bag for judging.

    Parameters
    ----------
    bag : str or Path
        The bag.
    lever_arm : tuple of 3 float, optional
        The touchdown point in ship axes (m); otherwise the settings on ``/diagnostics`` say it.
    namespace : str, optional
        Of the ship's topics; needed only where a bag holds several.
    remap : sequence of str
        Rules ``old:=new`` for topics that go by other names.

    Raises
    ------
    BagError
        If the bag cannot be read.
    ValueError
        If the bag holds several namespaces and none is chosen, or a rule is wrong.

    """
    reader = BagReader(bag)
    if namespace is None:
        namespace = _namespace(list(reader.topics))
    rules = remappings(remap, namespace)

    def resolved(ours: str) -> str:
        full = absolute(ours, namespace)
        return rules.get(full, full)

    collector = _Collector(resolved, reader.counts)
    record = Record(reader.path.resolve().name, every=collector.every)
    headed = {name for name, kind in reader.topics.items() if _has_header(kind)}
    stamps: dict[str, list[int]] = {name: [] for name in reader.topics}
    for topic, log_time, data in reader.messages():
        stamp = _first_stamp(data) if topic in headed and len(data) >= 12 else log_time
        stamps[topic].append(stamp)
        kind, use = collector.handlers.get(topic, ('', None))
        if use and kind != reader.topics[topic]:
            record.unusable[topic, f'not of type {kind}'] += 1
        elif use and not (topic in collector.thinned and crc32(data[4:12]) % collector.every):
            try:
                use(stamp, reader.decode(topic, data))
            except Rejected as rejection:
                record.unusable[topic, rejection.reason] += 1
    record.topics = {name: (kind, regularity(stamps[name]))
                     for name, kind in sorted(reader.topics.items())}
    collector.fill(record, lever_arm)
    return record


def _namespace(names: list[str]) -> str:
    """Find the namespace of the ship's topics."""
    for chosen in (('touchdown/height', 'touchdown/forecast'), (*INPUTS, 'ship/truth')):
        found = sorted({name.removesuffix(ours) for name in names for ours in chosen
                        if name.endswith(f'/{ours}')})
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"the bag holds the namespaces {', '.join(found)}: choose one")
    return '/'


def _has_header(kind: str) -> bool:
    try:
        return 'header' in BagTypes()[kind].__dataclass_fields__
    except KeyError:
        return False


def _first_stamp(data: bytes) -> int:
    """Read the header's stamp (ns) without decoding the message."""
    sec, nanosec = struct.unpack_from('<iI' if data[1] & 1 else '>iI', data, 4)
    return int(sec * NANOSECONDS + nanosec)


class _Collector:
    """The messages of a bag on their way into series."""

    def __init__(self, resolved: Callable[[str], str], counts: Mapping[str, int]) -> None:
        self.thinned = {resolved('touchdown/forecast'), resolved('touchdown/forecast_sd')}
        self.every = 1 + max(counts.get(name, 0) for name in self.thinned) // MOST_FORECASTS
        self.handlers: dict[str, tuple[str, Callable[[int, Any], None]]] = {
            resolved(name): (BY_NAME[name].type, use) for name, use in (
                ('ship/imu', self._imu), ('ship/heave', self._heave),
                ('ship/odometry', self._odometry), ('ship/truth', self._truth),
                ('touchdown/height', self._height),
                ('touchdown/prediction', self._prediction),
                ('touchdown/forecast', self._forecast),
                ('touchdown/forecast_sd', self._forecast_sd),
                ('/diagnostics', self._diagnostics))}
        self._attitudes: list[tuple[int, Quaternion]] = []
        self._heaves: list[tuple[int, float]] = []
        self._odometries: list[tuple[int, Quaternion | None, float]] = []
        self._truths: list[tuple[int, Quaternion | None, float]] = []
        self._heights: dict[int, float] = {}
        self._sds: dict[int, float] = {}
        self._ahead: list[int] = []
        self._means: dict[int, Array] = {}
        self._mean_sds: dict[int, Array] = {}
        self._horizons = np.empty(0)
        self._newest = 0
        self._states: dict[str, Status] = {}
        self._warned: Counter[str] = Counter()

    def _imu(self, stamp: int, msg: Any) -> None:
        self._newest = max(stamp, self._newest)
        sample = messages.imu_sample(msg)
        if sample.orientation is not None:
            self._attitudes.append((stamp, sample.orientation))

    def _heave(self, stamp: int, msg: Any) -> None:
        self._newest = max(stamp, self._newest)
        self._heaves.append((stamp, messages.heave_sample(msg).height))

    def _odometry(self, stamp: int, msg: Any) -> None:
        self._newest = max(stamp, self._newest)
        sample = messages.odometry_sample(msg)
        self._odometries.append((stamp, sample.orientation, sample.position[2]))

    def _truth(self, stamp: int, msg: Any) -> None:
        sample = messages.odometry_sample(msg)
        self._truths.append((stamp, sample.orientation, sample.position[2]))

    def _height(self, stamp: int, msg: Any) -> None:
        self._heights[stamp] = msg.point.z
        self._ahead.append(stamp - self._newest)

    def _prediction(self, stamp: int, msg: Any) -> None:
        self._sds[stamp] = float(msg.pose.covariance[14])**0.5

    def _forecast(self, stamp: int, msg: Any) -> None:
        """Note up, roll and pitch of every point, shape (m, 3)."""
        if not msg.points or not all(point.transforms for point in msg.points):
            raise Rejected('forecast without points')
        self._means[stamp] = np.array([
            (point.transforms[0].translation.z, *rpy_from_quaternion((
                rotation.x, rotation.y, rotation.z, rotation.w))[:2])
            for point in msg.points for rotation in (point.transforms[0].rotation,)])
        self._horizons = np.array([point.time_from_start.sec + seconds(
            point.time_from_start.nanosec) for point in msg.points])

    def _forecast_sd(self, stamp: int, msg: Any) -> None:
        if not set(JOINTS) <= set(msg.joint_names):
            raise Rejected('joints not known')
        columns = [msg.joint_names.index(name) for name in JOINTS]
        self._mean_sds[stamp] = np.array([point.positions[columns] for point in msg.points])

    def _diagnostics(self, stamp: int, msg: Any) -> None:
        for status in msg.status:
            values = {pair.key: pair.value for pair in status.values}
            self._states[status.name] = (int(status.level), status.message, values)
            self._warned[status.name] += status.level > 0

    def fill(self, record: Record, lever_arm: Vector3 | None) -> None:
        """Put everything that was collected into a record."""
        record.states, record.warned = self._states, self._warned
        stated = [name for name, (_, _, values) in self._states.items() if 'lever_arm' in values]
        for name in stated:
            record.settings = record.states.pop(name)[2]
        record.lever_arm = lever_arm or _vector(record.settings.get('lever_arm', ''))
        mount = np.radians(_vector(record.settings.get('sensor_rpy_deg', '')) or (0.0, 0.0, 0.0))
        roll, pitch = _angles([(stamp, attitude_of_mounted(attitude, tuple(mount)))
                               for stamp, attitude in self._attitudes])
        record.measured = (roll, pitch, _series(self._heaves))
        if not any(record.measured):
            record.measured = _axes(self._odometries)
        record.truth = _axes(self._truths)
        if self._heights:
            record.height = self._height_forecasts(record.settings.get('horizon', ''))
        if self._means and record.lever_arm:
            record.forecast = self._joint_forecasts(record.lever_arm[2])

    def _height_forecasts(self, stated: str) -> Trajectories:
        try:
            horizon = float(stated)
        except ValueError:
            horizon = round(float(np.median(self._ahead)) / NANOSECONDS, 2)
        valid_at = np.array(sorted(self._heights), np.int64)
        return Trajectories(
            valid_at - nanoseconds(horizon), np.array([horizon]),
            np.array([[self._heights[stamp]] for stamp in valid_at.tolist()]),
            np.array([[self._sds.get(stamp, np.nan)] for stamp in valid_at.tolist()]))

    def _joint_forecasts(self, arm_up: float) -> dict[str, Trajectories]:
        size = len(self._horizons)
        issued_at = [stamp for stamp in sorted(self._means) if len(self._means[stamp]) == size]
        silence = np.full((size, 3), np.nan)
        mean = np.stack([self._means[stamp] for stamp in issued_at])
        sd = np.stack([self._mean_sds.get(stamp, silence) for stamp in issued_at])
        mean[:, :, 0] -= arm_up  # ship_level begins at the reference point, the height at rest
        return {name: Trajectories(np.array(issued_at, np.int64), self._horizons,
                                   mean[:, :, joint], sd[:, :, joint])
                for joint, name in enumerate(JOINTS)}


def _vector(text: str) -> Vector3 | None:
    try:
        x, y, z = map(float, text.split(','))
    except ValueError:
        return None
    return x, y, z


def _series(rows: Sequence[tuple[int, float]]) -> Series | None:
    return Series.of(*map(list, zip(*rows, strict=True))) if rows else None


def _angles(rows: Sequence[tuple[int, Quaternion]]) -> tuple[Series | None, Series | None]:
    angles = [(stamp, rpy_from_quaternion(attitude)) for stamp, attitude in rows]
    return (_series([(stamp, rpy[0]) for stamp, rpy in angles]),
            _series([(stamp, rpy[1]) for stamp, rpy in angles]))


def _axes(rows: Sequence[tuple[int, Quaternion | None, float]]) -> Axes:
    roll, pitch = _angles([(stamp, attitude) for stamp, attitude, _ in rows if attitude])
    return roll, pitch, _series([(stamp, heave) for stamp, _, heave in rows])

"""Ship motion and its forecasts in a bag, as the series that the metrics compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.evaluation.contents import Contents, Handler, read_contents
from deck_motion_ros.evaluation.metrics import (
    compared,
    Comparison,
    Series,
    Stamps,
    touchdown_height,
)
from deck_motion_ros.geometry import attitude_of_mounted, rpy_from_quaternion
from deck_motion_ros.samples import (
    Array,
    AXES,
    LandingWindow,
    NANOSECONDS,
    nanoseconds,
    Quaternion,
    Rejected,
    seconds,
    Vector3,
)

JOINTS = ('height', 'roll', 'pitch')

Axes = tuple[Series | None, Series | None, Series | None]


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
    Ship motion and its forecasts, as a bag holds them.

    Attributes
    ----------
    contents : Contents
        The bag.
    measured, truth : tuple of 3 (Series or None)
        Roll, pitch (rad, REP-103), heave (m, up), as measured and as they were.
    height : Trajectories or None
        ``touchdown/height``, one horizon.
    forecast : dict of str to Trajectories
        ``height``, ``roll`` and ``pitch`` of ``touchdown/forecast``.
    lever_arm : tuple of 3 float or None
        The touchdown point in ship axes (m), as given or as the predictor states it.
    windows : sequence of LandingWindow
        ``touchdown/window``, by stamp.

    """

    contents: Contents
    measured: Axes = (None, None, None)
    truth: Axes = (None, None, None)
    height: Trajectories | None = None
    forecast: dict[str, Trajectories] = field(default_factory=dict)
    lever_arm: Vector3 | None = None
    windows: Sequence[LandingWindow] = ()

    @property
    def span(self) -> tuple[int, int]:
        """First and last stamp of what sensors measured (ns)."""
        return self.contents.span

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
    Read ship motion and forecasts alone.

    Parameters
    ----------
    bag, namespace, remap
        See :func:`read_contents`.
    lever_arm : tuple of 3 float, optional
        The touchdown point in ship axes (m); otherwise the settings on ``/diagnostics`` say it.

    """
    reader = ShipReader()
    return reader.record(read_contents(bag, (reader,), namespace, remap), lever_arm)


class ShipReader:
    """Takes ship motion and forecasts from a bag; see :class:`Reader`."""

    thinned = ('touchdown/forecast', 'touchdown/forecast_sd')

    def __init__(self) -> None:
        self.handlers: Mapping[str, Handler] = {
            'ship/imu': self._imu, 'ship/heave': self._heave, 'ship/odometry': self._odometry,
            'ship/truth': self._truth, 'touchdown/height': self._height,
            'touchdown/prediction': self._prediction, 'touchdown/forecast': self._forecast,
            'touchdown/forecast_sd': self._forecast_sd, 'touchdown/window': self._window}
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
        self._windows: dict[int, LandingWindow] = {}
        self._newest = 0

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

    def _window(self, stamp: int, msg: Any) -> None:
        self._windows[stamp] = messages.window_sample(msg)

    def record(self, contents: Contents, lever_arm: Vector3 | None = None) -> Record:
        """Make a record of everything that was taken."""
        settings = contents.settings.get('predictor', {})
        lever_arm = lever_arm or _vector(settings.get('lever_arm', ''))
        mount = np.radians(_vector(settings.get('sensor_rpy_deg', '')) or (0.0, 0.0, 0.0))
        roll, pitch = _angles([(stamp, attitude_of_mounted(attitude, tuple(mount)))
                               for stamp, attitude in self._attitudes])
        measured = (roll, pitch, _series(self._heaves))
        return Record(
            contents, measured if any(measured) else _axes(self._odometries),
            _axes(self._truths),
            self._height_forecasts(settings.get('horizon', '')) if self._heights else None,
            self._joint_forecasts(lever_arm[2]) if self._means and lever_arm else {}, lever_arm,
            [self._windows[stamp] for stamp in sorted(self._windows)])

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

"""
An aircraft over a rolling deck from ranges to radios on it (Pan2020).

The default, ``joint``, is one filter in level axes. The inertial units of ship and aircraft are
dead-reckoned on their own, each from rest at its first sample; what the filter estimates is what
they leave open: a start, a constant velocity, and their slowly varying error of acceleration. So
it is linear between ranges, and a range may act at any stamp near by.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from math import inf, isfinite, nan, radians
from typing import NamedTuple

import numpy as np

from deck_motion_ros.config import parameter
from deck_motion_ros.estimators.dead_reckoning import InertialTrack
from deck_motion_ros.estimators.multilateration import (
    dilution,
    extents,
    gauss_newton,
    RangeErrors,
)
from deck_motion_ros.estimators.ranging import JointFilter, PaperFilter
from deck_motion_ros.estimators.strapdown import check_plausible
from deck_motion_ros.estimators.suspicion import CheckedFilter, Epoch
from deck_motion_ros.geometry import conjugate, quaternion_from_rpy, rotated
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    NANOSECONDS,
    RangeSample,
    Rejected,
    seconds,
    Vector3,
)
from deck_motion_ros.streams import Rewind, StampGate

PAN2020_ANCHORS = (1.5, 1.5, 0.5, -1.5, 1.5, 1.0, -1.5, -1.5, 0.5, 1.5, -1.5, 1.0)
FLAT = 0.05  # m: a set of anchors with a smaller rms extent counts as flat
LONGEST_LAG = NANOSECONDS // 2  # how late a range may come
MAX_JUMP = 10.0  # s of silence; beyond, a stamp needs confirmation
LOST = 2.0  # m: sd of a position that is lost, near the deck
DOUBT = 9.0  # of two solutions whose costs differ by less, either may be the right one
SIDES = ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))
NOBODY = -1  # owner of what is known instead of measured
FAR, KNOWN_SD = 1e6, 0.02  # m
AXES: tuple[Vector3, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class LandingConfig:
    """Parameters of the landing node."""

    method: str = parameter(
        'joint', 'joint: one filter of everything; paper: Pan2020, whose deck neither turns nor '
        'accelerates', choices=('joint', 'paper'))
    anchor_frames: tuple[str, ...] = parameter(
        ('anchor_1', 'anchor_2', 'anchor_3', 'anchor_4'), 'frame_id of the ranges to each anchor')
    anchor_positions: tuple[float, ...] = parameter(
        PAN2020_ANCHORS, 'x, y, z of each anchor in deck, one after another', 'm', -1e4, 1e4)
    range_sd: float = parameter(
        0.05, 'White noise of a range, where the message does not say', 'm', 1e-4, 100.0)
    range_bias_sd: float = parameter(
        0.0, "What is not known of each anchor's slowly varying bias; 0 = no bias states", 'm',
        0.0, 100.0)
    range_scale_sd: float = parameter(
        0.0, 'What is not known of the share by which all ranges are too long; 0 = nothing', '',
        0.0, 1.0)
    range_bias_time: float = parameter(
        300.0, 'Correlation time of biases and scale', 's', 1.0, 1e6)
    deck_lever_arm: Vector3 = parameter(
        (-67.97, 3.05, 19.5), 'Origin of deck, the centre of the landing platform, in '
        'ship_base_link: forward, left, up', 'm', -1000.0, 1000.0, length=3)
    deck_static: bool = parameter(
        False, 'The deck is level and still, its axes east, north, up: ship/imu is not needed')
    antenna_lever_arm: Vector3 = parameter(
        (0.0, 0.0, 0.0), "The aircraft's radio in uav_base_link: forward, left, up", 'm',
        -100.0, 100.0, length=3)
    target_acceleration_psd: float = parameter(
        0.2, 'White acceleration of the aircraft where uav/imu does not tell it', '(m/s^2)^2 s',
        1e-9, 1e4)
    target_vertical_psd: float = parameter(
        nan, 'The same along the vertical; unset = as target_acceleration_psd', '(m/s^2)^2 s',
        1e-9, 1e4)
    deck_acceleration_psd: float = parameter(
        0.2, 'White acceleration of the ship where ship/imu does not tell it', '(m/s^2)^2 s',
        0.0, 1e4)
    inertial_noise: float = parameter(
        0.008, 'White noise of the difference of both measured accelerations', '(m/s^2) s^0.5',
        0.0, 10.0)
    inertial_bias_sd: float = parameter(
        0.04, 'Slow error of that difference: of the sensors, and gravity times tilt', 'm/s^2',
        0.0, 10.0)
    inertial_bias_time: float = parameter(
        100.0, 'Correlation time of the slow error', 's', 1.0, 1e6)
    ship_rate_sd: float = parameter(
        4e-4, "Noise of the ship's turn rate, which makes velocity over the deck", 'rad/s',
        0.0, 1.0)
    start_velocity_sd: float = parameter(
        5.0, 'Speed over the deck at the start, in each axis', 'm/s', 0.01, 1000.0)
    known_height: float = parameter(
        nan, 'Height over deck that the aircraft is known to keep; unset = any', 'm', -1e4, 1e4)
    paper_noise: Vector3 = parameter(
        (0.0, 0.0, 1.0), 'Method paper: what a second adds to the sd of position (m), velocity '
        '(m/s) and acceleration (m/s^2)', '', 0.0, 1e4, length=3)
    ship_sensor_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'How the sensor of ship/imu is mounted: its roll, pitch, yaw in '
        'ship_base_link', 'deg', -360.0, 360.0, length=3)
    uav_sensor_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'How the sensor of uav/imu is mounted: its roll, pitch, yaw in '
        'uav_base_link', 'deg', -360.0, 360.0, length=3)
    deck_frame: str = parameter('deck', 'Axes of the ship, origin on the landing platform')
    uav_deck_frame: str = parameter('uav_deck', 'At the aircraft, parallel to deck')
    ship_base_link_frame: str = parameter('ship_base_link', "The ship's body frame")
    uav_base_link_frame: str = parameter('uav_base_link', "The aircraft's body frame")

    def points(self) -> Array:
        """
        Return the positions of the anchors, shape (n, 3).

        Raises
        ------
        ValueError
            If names and positions do not fit, or the anchors cannot give a position.

        """
        names, values = self.anchor_frames, self.anchor_positions
        if len(values) != 3 * len(names):
            raise ValueError(f"parameter 'anchor_positions' needs {3 * len(names)} numbers for "
                             f"{len(names)} anchor_frames, not {len(values)}")
        if len(set(names)) < len(names):
            raise ValueError("parameter 'anchor_frames' names an anchor twice")
        points = np.reshape(np.array(values, dtype=float), (-1, 3))
        if len(points) < 3:
            raise ValueError(
                f"parameter 'anchor_frames' needs 3 anchors or more, not {len(names)}")
        if extents(points)[1] < FLAT:
            raise ValueError("parameter 'anchor_positions': all anchors are on one line")
        if self.method == 'paper' and self.is_flat():
            raise ValueError("parameter 'method': paper needs anchors that are not in one plane")
        return points

    def is_flat(self) -> bool:
        """Say whether all anchors are in one plane: then two places fit their ranges."""
        return bool(extents(np.reshape(self.anchor_positions, (-1, 3)))[2] < FLAT)


@dataclass(frozen=True, slots=True, eq=False)
class LandingEstimate:
    """
    The aircraft over the deck.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    position, velocity : ndarray, shape (3,)
        In ``deck``, and its rate of change there (m, m/s).
    cov : ndarray, shape (6, 6)
        Of the errors of position and velocity.

    """

    stamp: int
    position: Array
    velocity: Array
    cov: Array


class _Range(NamedTuple):
    """A range in the filter's axes: stamp (ns), anchor, from where, distance, variance (m)."""

    stamp: int
    owner: int
    point: Vector3
    distance: float
    var: float


class LandingEstimator:
    """
    Ranges and inertial data in, the aircraft over the deck out.

    Messages act at their stamps, ranges of one stamp together: these wait for one another, for as
    long as nothing else comes, if the ranges before came together. There is one estimate for each
    new stamp of ``uav/imu`` or of ranges; what comes later than an estimate's stamp shows in the
    next.

    Parameters
    ----------
    config : LandingConfig

    Attributes
    ----------
    restarts : int
        How often the clock was found to have been set anew.
    opened : int
        How often the filter started: at first, after a long silence, and where most anchors
        contradicted it.
    outliers : Counter
        Ranges that were rejected by what the others said, by anchor.

    Raises
    ------
    ValueError
        If the anchors cannot give a position.

    """

    START_SPAN = NANOSECONDS  # of the ranges from which the filter starts
    START_COUNT = 8

    def __init__(self, config: LandingConfig) -> None:
        self.config = config
        self._points = config.points()
        self._index = {name: k for k, name in enumerate(config.anchor_frames)}
        self._arm = np.zeros(3) if config.deck_static else np.array(config.deck_lever_arm)
        self._anchors: list[Vector3] = [
            (x, y, z) for x, y, z in (self._points + self._arm).tolist()]
        level, up = config.target_acceleration_psd, config.target_vertical_psd
        self._target = np.array([level, level, up if isfinite(up) else level])
        self._deck = np.full(3, config.deck_acceleration_psd)
        self._white = np.full(3, config.inertial_noise**2)
        self._errors = RangeErrors(
            len(self._points), config.range_bias_sd, config.range_scale_sd)
        self.restarts = self.opened = 0
        self.outliers: Counter[str] = Counter()
        self._error_prior: tuple[Array, Array] | None = None  # what a filter knew that is no more
        self._start()

    def _start(self) -> None:
        config = self.config
        ship, uav = (quaternion_from_rpy(*map(radians, rpy)) for rpy in (
            config.ship_sensor_rpy_deg, config.uav_sensor_rpy_deg))
        self._ship, self._uav = InertialTrack(ship), InertialTrack(uav)
        self._gates: dict[str, StampGate] = {}
        self._rewind = Rewind()
        self._epoch: list[RangeSample] = []  # of one stamp, not used yet
        self._closed = (0, 0)  # stamp of the newest epoch that acted, and its number of ranges
        self._memory: deque[_Range] = deque()
        self._filter: CheckedFilter | None = None
        self._tried: int | None = None  # stamp of the newest attempt to start it
        self._paper = None if config.method == 'joint' else PaperFilter(
            self._points, config.range_sd, config.paper_noise)
        self._round: dict[int, float] = {}  # ranges by anchor, for the paper's filter
        self._time = 0  # stamp of the filter
        self._newest: int | None = None  # stamp of all messages
        self._given: int | None = None  # stamp of the newest estimate

    def update(self, topic: str, sample: ImuSample | RangeSample) -> list[LandingEstimate]:
        """
        Use one sample of ``ship/imu``, ``uav/imu`` or ``uwb/range``.

        Returns
        -------
        list of LandingEstimate
            What it completes, oldest first.

        Raises
        ------
        Rejected
            If the sample's stamp or content cannot be used.

        """
        stamp, source = sample.stamp, topic
        if isinstance(sample, RangeSample):
            source = sample.frame_id
            if source not in self._index:
                raise Rejected('unknown anchor')
            if not 0 < sample.distance < inf:
                raise Rejected('range not above 0')
        elif sample.orientation is None:
            raise Rejected('no attitude')
        else:
            check_plausible(sample)
        self._admit(source, stamp)
        if isinstance(sample, RangeSample):
            if self._newest is not None and self._newest - stamp > LONGEST_LAG:
                raise Rejected('too late')
            if not self._knows_deck(stamp):
                raise Rejected('no ship attitude')
        made = self._close_epoch() if self._epoch and stamp != self._epoch[0].stamp else []
        if isinstance(sample, RangeSample):
            self._epoch.append(sample)
            if len(self._epoch) >= self._closed[1]:
                made += self._close_epoch()
        elif topic == 'ship/imu':
            self._ship.update(sample)
        else:
            self._uav.update(sample)
            made += self._estimate(stamp)
        self._newest = max(stamp, self._newest or stamp)
        return made

    def _admit(self, source: str, stamp: int) -> None:
        """Check a stamp against those of its source, or of all after a long silence."""
        gate = self._gates.get(source)
        if gate is None or (gate.newest is not None and self._newest is not None
                            and self._newest - gate.newest > MAX_JUMP * NANOSECONDS):
            gate = self._gates[source] = StampGate(MAX_JUMP)
        anew = gate.admit(stamp, self._newest)
        if anew or self._rewind.is_over(stamp, self._newest):
            self._close_filter()
            self._start()
            self._gates[source] = gate
            self.restarts += 1

    def _knows_deck(self, stamp: int) -> bool:
        return self.config.deck_static or abs(self._ship.age(stamp)) <= self._ship.patience

    def _close_epoch(self) -> list[LandingEstimate]:
        """Let the waiting ranges act."""
        samples, self._epoch = self._epoch, []
        stamp = samples[0].stamp
        before, count = self._closed
        self._closed = stamp, len(samples) + (count if stamp == before else 0)
        if self._paper is not None:
            return self._paper_estimate(stamp, samples)
        ranges = [*map(self._placed, samples)]
        if isfinite(self.config.known_height):
            ranges.append(self._known_height(stamp))
        if self._filter is not None:
            self._advance(stamp)
            if _is_lost(self._filter.estimate()[1], samples[0].distance):
                self._close_filter()
            else:
                self._correct(self._filter, ranges)
        self._memory.extend(ranges)
        while (len(self._memory) > self.START_COUNT
               and stamp - self._memory[1].stamp >= self.START_SPAN):
            self._memory.popleft()
        if (self._filter is None or self._filter.contradicted) and self._open(stamp):
            self.opened += 1
        return self._estimate(stamp)

    def _close_filter(self) -> None:
        """Forget the position; what is known of the radios stays."""
        if self._filter is not None:
            self._error_prior, self._filter = self._filter.errors(), None
        self._memory.clear()

    def _placed(self, sample: RangeSample) -> _Range:
        owner = self._index[sample.frame_id]
        return _Range(sample.stamp, owner, self._point(sample.stamp, self._anchors[owner]),
                      sample.distance, sample.var or self.config.range_sd**2)

    def _known_height(self, stamp: int) -> _Range:
        """Say a known height as a range, from far below the deck."""
        x, y, z = self._arm.tolist()
        return _Range(stamp, NOBODY, self._point(stamp, (x, y, z - FAR)),
                      FAR + self.config.known_height, KNOWN_SD**2)

    def _point(self, stamp: int, anchor: Vector3) -> Vector3:
        """Return from where the filter's position is measured by a range to an anchor."""
        ship_attitude, (x, y, z), _ = self._ship.at(stamp)
        uav_attitude, (u, v, w), _ = self._uav.at(stamp)
        a, b, c = rotated(ship_attitude, anchor)
        p, q, r = rotated(uav_attitude, self.config.antenna_lever_arm)
        return (a + x - u - p, b + y - v - q, c + z - w - r)

    def _open(self, stamp: int) -> bool:
        """Start the filter from the newest ranges, above the deck; say whether that worked."""
        if self._tried is not None and stamp - self._tried < self.START_SPAN // 5:
            return False
        config, memory = self.config, self._memory
        owners = np.array([item.owner for item in memory])
        heard = np.unique(owners[owners != NOBODY])
        if (stamp - memory[0].stamp < self.START_SPAN or len(memory) < self.START_COUNT
                or len(heard) < 3 or extents(self._points[heard])[1] < FLAT):
            return False
        self._tried = stamp
        times = np.array([seconds(item.stamp - stamp) for item in memory])
        ranges = np.array([item.distance for item in memory])
        reach = float(np.median(ranges[owners != NOBODY]))
        var = np.array([item.var for item in memory]) + self._psd(stamp)[0] * np.abs(times)**3 / 3
        points = np.array([item.point for item in memory])
        x, y, z = (self._arm + self._points.mean(axis=0)).tolist()
        fixes = [fix for ahead, left in SIDES if (fix := gauss_newton(
            points, ranges, np.sqrt(var),
            np.array(self._point(stamp, (x + reach * ahead, y + reach * left, z + reach))), times,
            config.start_velocity_sd, owners, self._errors, self._error_prior, robust=True))]
        fix = min(fixes, key=lambda item: item.cost, default=None)
        if fix is None or _is_lost(fix.cov, reach / 2) or any(
                other.cost < fix.cost + DOUBT and np.linalg.norm(
                    other.position - fix.position) > LOST for other in fixes):
            return False
        self._filter = CheckedFilter(JointFilter(
            fix, config.inertial_bias_sd, config.inertial_bias_time, self._errors,
            config.range_bias_time), len(self._points))
        self._time = stamp
        return True

    def _psd(self, stamp: int) -> Array:
        """Return the density of the white acceleration that nobody measures, by axis."""
        uav, ship = self._measured(stamp)
        return np.asarray(self._white + (not uav) * self._target + (not ship) * self._deck)

    def _measured(self, stamp: int) -> tuple[bool, bool]:
        """Say whether the accelerations of aircraft and ship are measured."""
        return (self._uav.is_inertial(stamp),
                self.config.deck_static or self._ship.is_inertial(stamp))

    def _advance(self, stamp: int) -> None:
        assert self._filter is not None
        if stamp > self._time:
            self._filter.advance(seconds(stamp - self._time), self._psd(stamp))
            self._time = stamp

    def _correct(self, joint: CheckedFilter, ranges: list[_Range]) -> None:
        """Let ranges of one stamp correct the filter; note which it rejects."""
        weights = joint.use(Epoch(
            [item.point for item in ranges], [item.owner for item in ranges],
            np.array([item.distance for item in ranges]), np.array([item.var for item in ranges]),
            seconds(self._time - ranges[0].stamp)))
        for item, weight in zip(ranges, weights.tolist(), strict=True):
            if item.owner != NOBODY:
                self.outliers[self.config.anchor_frames[item.owner]] += weight == 0

    def _estimate(self, stamp: int) -> list[LandingEstimate]:
        """Give the estimate at ``stamp``, if there can be one and none was given since."""
        if self._filter is None or not self._knows_deck(stamp) or (
                self._given is not None and stamp <= self._given):
            return []
        self._advance(stamp)
        self._given = stamp
        attitude, ship_position, ship_velocity = self._ship.at(stamp)
        _, uav_position, uav_velocity = self._uav.at(stamp)
        known = np.array([*uav_position, *uav_velocity]) - [*ship_position, *ship_velocity]
        state, state_cov = self._filter.estimate()
        level = state + known
        to_deck = np.array([rotated(conjugate(attitude), axis) for axis in AXES]).T
        x, y, z = self._ship.rate
        turning = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ to_deck
        jacobian = np.zeros((6, 6))
        jacobian[:3, :3] = jacobian[3:, 3:] = to_deck
        jacobian[3:, :3] = -turning
        deck = jacobian @ level
        cov = jacobian @ state_cov @ jacobian.T
        if not self.config.deck_static:
            cov[3:, 3:] += self.config.ship_rate_sd**2 * (
                deck[:3] @ deck[:3] * np.eye(3) - np.outer(deck[:3], deck[:3]))
        return [LandingEstimate(stamp, deck[:3] - self._arm, deck[3:], cov)]

    def _paper_estimate(self, stamp: int, samples: list[RangeSample]) -> list[LandingEstimate]:
        """Use the ranges once all anchors have one, as if they had been taken together."""
        assert self._paper is not None
        self._round.update((self._index[item.frame_id], item.distance) for item in samples)
        if len(self._round) < len(self._points) or (
                self._given is not None and stamp <= self._given):
            return []
        ranges = np.array([self._round[k] for k in range(len(self._points))])
        self._round.clear()
        self._paper.update(seconds(stamp - (self._given or stamp)), ranges)
        self._given = stamp
        state, cov = self._paper.state, self._paper.cov
        return [LandingEstimate(stamp, state[:3], state[3:6], cov[:6, :6])]

    def accuracy(self) -> str:
        """Say what accuracy the inputs allow, in words."""
        if self.config.method == 'paper':
            return 'ranges alone'
        uav, ship = self._measured(self._newest or 0)
        if uav and ship:
            return 'inertial: both accelerations are measured'
        if ship:
            return 'tracking: no acceleration of the aircraft'
        if uav:
            return 'tracking: no acceleration of the ship'
        return 'attitude only: no acceleration is measured'

    def doubts(self) -> dict[str, float]:
        """Return with what probability an anchor was moved or is in the shade, if above 0.1."""
        found = self._filter.doubts() if self._filter is not None else {}
        return {self.config.anchor_frames[anchor]: probability
                for anchor, probability in found.items() if probability > 0.1}

    def dilution(self, position: Array) -> Array:
        """Return by what noise of ranges is multiplied in x, y, z at a position in deck (m)."""
        return dilution(self._points, position)


def _is_lost(cov: Array, distance: float) -> bool:
    """Say whether a position is too vague for a range (m) to be linear in it."""
    return float(np.trace(cov[:3, :3])) > max(LOST, distance / 4)**2

"""Transfer alignment on the catapult (Bai2016): streams in, misalignment and attitude out."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import exp, hypot, nan, radians, sqrt

import numpy as np

from deck_motion_ros.config import parameter
from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.fading import StrongTracking
from deck_motion_ros.estimators.joining import Interpolated
from deck_motion_ros.estimators.strapdown import check_plausible, MAX_FORCE
from deck_motion_ros.estimators.transfer import (
    ACROSS,
    ALL,
    BIAS,
    Disturbance,
    reference_velocity,
    TransferFilter,
    TransferModel,
)
from deck_motion_ros.geometry import (
    matrix_from_quaternion,
    matrix_from_rpy,
    quaternion_from_matrix,
    rotation_vectors,
    transformed,
)
from deck_motion_ros.samples import (
    Array,
    ImuSample,
    NANOSECONDS,
    Quaternion,
    Rejected,
    Vector3,
    VelocitySample,
)
from deck_motion_ros.streams import StampGate

ARCMIN = radians(1 / 60)
STANDARD_GRAVITY = 9.80665  # m/s^2
MICRO_G = 1e-6 * STANDARD_GRAVITY
DEG_H = radians(1) / 3600
LAUNCH = STANDARD_GRAVITY / 2  # m/s^2 beyond gravity
PAPER_VELOCITY_SD = 0.1  # m/s: of the paper's first velocity, with which its figures come out
UNIT_STEP = 0.01  # s: track_*_sd are meant per step of this length
PATIENCE = NANOSECONDS // 20  # by which the velocimeter may come late
HELD = 3 * NANOSECONDS // 2  # by which the master may come late
OFFSET = 2 * NANOSECONDS  # between the newest stamps of two streams that flow: not one clock
QUIET = 0.1  # s without thrust that end the stroke
SHORT = 1.0  # s: a stroke that ends sooner was broken off
REST = 1.0  # s at rest on the velocimeter, after a stroke: the next launch is prepared
JUMP = 3.0  # m/s by which the velocimeter must not differ from the navigator
JUMP_TIME = 0.3  # s after which it is believed all the same
GAP_RATE, GAP_FORCE = 0.02, 10.0  # sd of what a missing sample of the slave would have shown
MAX_SPEED = 200.0  # m/s: no aircraft on a catapult
PHASES = ('waiting', 'hold', 'stroke', 'done', 'aborted')


@dataclass(frozen=True, slots=True)
class AlignmentConfig:
    """Parameters of the alignment."""

    method: str = parameter(
        'strong_tracking', 'strong_tracking: bias states, fading where the nose gear shakes; '
        'paper: Bai2016 as printed but corrected; kalman: bias states, no fading',
        choices=('strong_tracking', 'paper', 'kalman'))
    latitude_deg: float = parameter(
        40.0, "Of the ship: the Earth's rate and gravity", 'deg', -85.0, 85.0)
    track_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), "Catapult track in the ship's axes: its roll, pitch, yaw", 'deg',
        -180.0, 180.0, length=3)
    ldv_sd: float = parameter(
        0.01, 'White noise of the velocimeter, where the message does not say', 'm/s',
        1e-4, 10.0)
    track_lateral_sd: float = parameter(
        0.02, 'What "no motion across the track" is worth, every 0.01 s', 'm/s', 1e-4, 10.0)
    track_vertical_sd: float = parameter(
        0.05, 'What "no motion normal to the track" is worth, every 0.01 s', 'm/s', 1e-4, 10.0)
    lever_arm: Vector3 = parameter(
        (0.0, 0.0, 0.0), "Aircraft's start relative to the master unit, ship axes", 'm',
        -1000.0, 1000.0, length=3)
    misalignment_sd_arcmin: Vector3 = parameter(
        (30.0, 30.0, 60.0), 'What is known of the misalignment at first: about forward, left, up',
        'arcmin', 0.01, 600.0, length=3)
    fading_weights: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), 'alpha of method paper: three of attitude, which must be '
        '0, three of velocity', '', 0.0, 1.0, length=6)
    slave_accel_bias_sd_ug: float = parameter(
        100.0, "Constant bias of the slave's accelerometers", 'ug', 0.0, 1e5)
    slave_gyro_drift_sd_deg_h: float = parameter(
        0.01, "Constant drift of the slave's gyros", 'deg/h', 0.0, 1000.0)
    slave_accel_white_sd: float = parameter(
        2e-4, "White noise of the slave's specific force: sd of its mean over 1 s", 'm/s^2',
        0.0, 1.0)
    slave_gyro_white_sd: float = parameter(
        1e-6, "White noise of the slave's turn rate: sd of its mean over 1 s", 'rad/s', 0.0, 0.1)
    master_accel_bias_sd_ug: float = parameter(
        50.0, "Constant bias of the master's accelerometers, with which its velocity drifts",
        'ug', 0.0, 1e5)
    master_gyro_drift_sd_deg_h: float = parameter(
        0.001, "Constant drift of the master's gyros", 'deg/h', 0.0, 1000.0)
    master_accel_white_sd: float = parameter(
        1e-4, "White noise of the master's specific force: sd of its mean over 1 s", 'm/s^2',
        0.0, 1.0)
    master_gyro_white_sd: float = parameter(
        1e-7, "White noise of the master's turn rate: sd of its mean over 1 s", 'rad/s', 0.0, 0.1)
    accel_range: float = parameter(
        200.0, "Full scale of the slave's accelerometers: at it they are saturated", 'm/s^2',
        20.0, MAX_FORCE)
    master_sensor_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'How the sensor of master/imu is mounted: its roll, pitch, yaw in '
        'ship_base_link', 'deg', -360.0, 360.0, length=3)
    slave_sensor_rpy_deg: Vector3 = parameter(
        (0.0, 0.0, 0.0), 'How the sensor of slave/imu is mounted: its roll, pitch, yaw in '
        'uav_base_link', 'deg', -360.0, 360.0, length=3)
    map_frame: str = parameter('map', 'Axes east, north, up')
    track_frame: str = parameter('track', 'Frame of the catapult, x along the stroke')
    ship_base_link_frame: str = parameter('ship_base_link', "The ship's body frame")
    uav_base_link_frame: str = parameter('uav_base_link', "The aircraft's body frame")

    def __post_init__(self) -> None:
        if any(self.fading_weights[:3]):
            raise ValueError(
                "parameter 'fading_weights' must be 0 for attitude (the first three): the turn "
                'about the specific force is not observable, and with fading it diverges')


def transfer_model(config: AlignmentConfig) -> TransferModel:
    """Say what the filter of ``config.method`` believes; only ``paper`` does without biases."""
    paper = config.method == 'paper'
    return TransferModel(
        0.0 if paper else MICRO_G * hypot(
            config.slave_accel_bias_sd_ug, config.master_accel_bias_sd_ug),
        DEG_H * config.slave_gyro_drift_sd_deg_h, config.slave_gyro_white_sd,
        hypot(config.slave_accel_white_sd, config.master_accel_white_sd),
        Disturbance() if config.method == 'strong_tracking' else None,
        StrongTracking(config.fading_weights) if paper else None, feedback=not paper)


@dataclass(frozen=True, slots=True, eq=False)
class AlignmentEstimate:
    """
    What is known at a joined stamp.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    misalignment : ndarray, shape (3,)
        mu, slave = master Exp(mu) at the first joined stamp, about forward, left, up (rad).
    misalignment_cov : ndarray, shape (3, 3)
        Of its error (rad^2).
    orientation : tuple of 4 float
        Slave to ENU now, x, y, z, w.
    attitude_cov : ndarray, shape (3, 3)
        Of its error about east, north, up (rad^2).

    """

    stamp: int
    misalignment: Array
    misalignment_cov: Array
    orientation: Quaternion
    attitude_cov: Array


class Aligner:
    """
    Align the slave by the velocity of master and velocimeter, from the first messages on.

    A sample of the slave acts once the master covers its stamp; the velocimeter is waited for a
    twentieth of a second. In the stroke the filter fades where the accelerometers are shaken; at
    its end the reference no longer holds, and nothing more comes out until another aircraft rests
    on the velocimeter.

    Parameters
    ----------
    config : AlignmentConfig
        Parameters.

    Attributes
    ----------
    phase : str
        Of PHASES.
    window, stroke : float
        Seconds of velocity matching before the launch, and of the stroke.
    dropped : int
        Samples of the slave without master.
    gaps, saturated, jumps, aborts, restarts : int
        Missing and saturated samples of the slave, velocimeter out of the question, launches
        broken off, alignments begun anew.
    skew : float
        By which the reference is late, as the speeds of the stroke show it, with what a
        vibration leaves of velocity in it (s); NaN before.
    jitter : float
        Sd of the slave's sampling interval (s).
    surprise : float
        Recent mean of the normalised squared innovation: 1 if all is well.
    largest_factor : float
        Of the fading in this alignment.

    """

    def __init__(self, config: AlignmentConfig) -> None:
        self.config = config
        self._model = transfer_model(config)
        self._earth = Earth(radians(config.latitude_deg))
        self._mat_track = matrix_from_rpy(*np.radians(config.track_rpy_deg))
        self._mounts = {name: matrix_from_rpy(*np.radians(angles)) for name, angles in (
            ('master/imu', config.master_sensor_rpy_deg),
            ('slave/imu', config.slave_sensor_rpy_deg))}
        self._gates = {name: StampGate() for name in (
            'master/imu', 'slave/imu', 'master/velocity', 'ldv/velocity')}
        self.dropped = self.gaps = self.saturated = self.jumps = self.restarts = self.aborts = 0
        self.offsets: dict[str, float] = {}
        self._clear()

    def _clear(self) -> None:
        """Begin a new alignment."""
        self.filter: TransferFilter | None = None
        self.phase = 'waiting'
        self.window = self.stroke = self.jitter = 0.0
        self.skew = nan
        self.surprise = self.largest_factor = 1.0
        self._attitude, self._velocity = Interpolated(1.2), Interpolated(1.2)
        self._rate: tuple[int, Array] | None = None
        self._waiting: deque[ImuSample] = deque()
        self._speeds: deque[VelocitySample] = deque(maxlen=1000)
        self._before: ImuSample | None = None
        self._interval = 0.0
        self._way = self._quiet = self._rest = self._unheard = self._jumping = 0.0
        self._speed = self._peak = self._pushed = self._start_speed = 0.0
        self._mat_first = np.eye(3)
        self._first_cov = np.zeros((3, 3))

    def update(self, topic: str, sample: ImuSample | VelocitySample) -> list[AlignmentEstimate]:
        """
        Use a sample; return the estimates that are complete with it.

        Parameters
        ----------
        topic : str
            ``master/imu``, ``master/velocity``, ``ldv/velocity`` or ``slave/imu``.
        sample : ImuSample or VelocitySample
            What came there.

        Raises
        ------
        Rejected
            If it cannot be used.

        """
        self._check(topic, sample)
        others = self._gates['slave/imu'].newest
        restarted = self._gates[topic].admit(sample.stamp)
        if restarted:
            self._restart()
        if topic != 'slave/imu':
            self._compare_clocks(topic, sample.stamp, others)
        if isinstance(sample, ImuSample):
            if topic == 'master/imu':
                self._take_attitude(sample)
            else:
                self._waiting.append(sample)
        elif topic == 'master/velocity':
            self._velocity.add(sample.stamp, np.array([*sample.velocity, *sample.var]))
        elif self._before is not None and sample.stamp <= self._before.stamp:
            raise Rejected('too late')
        else:
            self._speeds.append(sample)
        return self._advance()

    @property
    def refused(self) -> str:
        """Which streams have another clock than the slave; '' if none has."""
        return ', '.join(f'{topic} {seconds:+.1f} s' for topic, seconds in self.offsets.items())

    def misalignment_sd(self) -> Array:
        """Return the sd about forward, left, up (rad), shape (3,); NaN before the first join."""
        if self.filter is None:
            return np.full(3, nan)
        return np.asarray(np.sqrt(np.diagonal(self._misalignment_cov())))

    def least_observable(self) -> tuple[Array, float]:
        """Return the direction that is known worst (slave's axes, unit vector) and its sd."""
        if self.filter is None:
            return np.full(3, nan), nan
        values, vectors = np.linalg.eigh(self.filter.attitude_cov())
        worst = vectors[:, 2] * (1 if vectors[np.argmax(np.abs(vectors[:, 2])), 2] > 0 else -1)
        return worst, sqrt(values[2])

    def bias_excess(self) -> float:
        """Return by how many sd an estimated accelerometer bias is not what its grade says."""
        if self.filter is None or not self._model.bias_sd:
            return 0.0
        prior = self._model.bias_sd**2
        learned = np.maximum(prior - np.diagonal(self.filter.cov)[BIAS], 1e-4 * prior)
        return float(np.max(np.abs(self.filter.bias) / np.sqrt(learned)))

    def _check(self, topic: str, sample: ImuSample | VelocitySample) -> None:
        if isinstance(sample, VelocitySample):
            speed = max(map(abs, sample.velocity[:1 if topic == 'ldv/velocity' else 3]))
            if speed > MAX_SPEED:
                raise Rejected('implausible velocity')
            return
        if topic == 'master/imu' and sample.orientation is None:
            raise Rejected('no attitude')
        if topic == 'slave/imu' and not any(sample.specific_force):
            raise Rejected('no specific force')
        check_plausible(sample)

    def _restart(self) -> None:
        self.restarts += 1
        self._clear()

    def _compare_clocks(self, topic: str, stamp: int, slave: int | None) -> None:
        """Refuse to join streams whose newest stamps are seconds apart while both flow."""
        apart = 0 if slave is None else stamp - slave
        if abs(apart) <= OFFSET:
            self.offsets.pop(topic, None)
            return
        self.offsets[topic] = apart / NANOSECONDS
        if self.filter is not None:
            self._restart()

    def _take_attitude(self, sample: ImuSample) -> None:
        mount = self._mounts['master/imu']
        assert sample.orientation is not None
        mat = matrix_from_quaternion(sample.orientation) @ mount.T
        rate = mount @ np.array(sample.angular_velocity)
        # the mean over the interval is that of its middle: carried on to its end
        before, self._rate = self._rate, (sample.stamp, rate)
        if before is not None and sample.stamp - before[0] < NANOSECONDS // 2:
            rate = (3 * rate - before[1]) / 2
        quaternion = np.array(quaternion_from_matrix(mat))
        known = self._attitude.value
        if known is not None and known[:4] @ quaternion < 0:
            quaternion = -quaternion
        self._attitude.add(sample.stamp, np.array([*quaternion, *rate, *sample.attitude_var]))

    def _advance(self) -> list[AlignmentEstimate]:
        """Let the slave's samples act whose stamps the others cover."""
        found = []
        while self._waiting:
            head = self._waiting[0]
            age = self._waiting[-1].stamp - head.stamp
            covered = self._attitude.covers(head.stamp) and self._velocity.covers(head.stamp)
            heard = bool(self._speeds) and self._speeds[-1].stamp >= head.stamp
            if age < HELD and not covered or age < PATIENCE and not heard:
                break
            self._waiting.popleft()
            attitude = self._attitude.at(head.stamp) if covered else None
            velocity = self._velocity.at(head.stamp) if covered else None
            if attitude is None or velocity is None or self.offsets:
                self.dropped += 1
                attitude = velocity = None
            estimate = self._use(head, attitude, velocity)
            if estimate is not None:
                found.append(estimate)
        return found

    def _use(self, sample: ImuSample, attitude: Array | None,
             velocity: Array | None) -> AlignmentEstimate | None:
        """Let one sample of the slave act, with the master at its stamp."""
        before, self._before = self._before, sample
        speeds = self._heard(sample.stamp)
        mount = self._mounts['slave/imu']
        rate, force = (mount @ np.array(vec) for vec in (
            sample.angular_velocity, sample.specific_force))
        if attitude is not None and velocity is not None:
            mat = matrix_from_quaternion(tuple(attitude[:4] / np.linalg.norm(attitude[:4])))
        if self.filter is None or before is None:
            if attitude is None or velocity is None:
                return None
            return self._begin(sample.stamp, mat, attitude, velocity, speeds)
        dt = (sample.stamp - before.stamp) / NANOSECONDS
        if dt > max(1.0, 3 * self._interval):
            self._restart()
            return None
        push = transformed(self.filter.mat, force) + self._earth.gravity
        self._follow(push, dt)
        self._doubt(sample, dt)
        self.filter.integrate(rate, force, dt)
        self._unheard += dt
        if self.phase in ('done', 'aborted'):
            self._await_next(speeds, push, dt)
            return None
        if self._quiet or attitude is None or velocity is None:
            return None
        return self._match(sample.stamp, mat, attitude, velocity, speeds, push, dt)

    def _heard(self, stamp: int) -> VelocitySample | None:
        """Return the newest of the velocimeter's samples up to ``stamp`` (ns) that is unused."""
        newest = None
        while self._speeds and self._speeds[0].stamp <= stamp:
            newest = self._speeds.popleft()
        return newest

    def _begin(self, stamp: int, mat: Array, attitude: Array, velocity: Array,
               heard: VelocitySample | None) -> AlignmentEstimate:
        config = self.config
        speed = heard.velocity[0] if heard else 0.0
        reference = self._reference(mat, attitude, velocity, speed)
        axes = mat @ self._mat_track
        mat_r = self._mat_r(axes, velocity, heard, UNIT_STEP)
        if heard is None:
            mat_r[0, 0] = 1.0  # at rest, but who knows
        prior = mat @ np.diag(np.square(ARCMIN * np.array(config.misalignment_sd_arcmin))) @ mat.T
        first = PAPER_VELOCITY_SD**2 * np.eye(3) if config.method == 'paper' else (
            axes @ mat_r @ axes.T)
        self.filter = TransferFilter(self._model, self._earth, mat, reference, prior, first)
        self._mat_first, self._first_cov = mat, np.diag(np.maximum(attitude[7:], 0))
        self.phase = 'hold'
        self._start_speed = float(axes[:, 0] @ reference)
        return self._estimate(stamp)

    def _follow(self, push: Array, dt: float) -> None:
        """Find the launch, before its sample is integrated, and the end of the stroke."""
        assert self.filter is not None
        thrust = sqrt(push @ push) > LAUNCH
        if self.phase == 'hold':
            if thrust:
                self.phase = 'stroke'
                self.filter.launch()
            else:
                self.window += dt
        if self.phase == 'stroke':
            self.stroke += dt
            self._quiet = 0.0 if thrust else self._quiet + dt
            if self._quiet > QUIET:
                self.stroke -= self._quiet
                broken = self.stroke < SHORT or self._speed < self._peak / 2
                self.phase = 'aborted' if broken else 'done'
                self.aborts += broken

    def _doubt(self, sample: ImuSample, dt: float) -> None:
        """Count what is missing of the slave's increments, and how its stamps scatter."""
        assert self.filter is not None
        usual = self._interval or dt
        self._interval = min(1.02 * usual, dt)
        missing = dt - usual
        if missing > usual / 2:
            self.gaps += 1
            self.filter.doubt(GAP_RATE * missing, GAP_FORCE * missing)
        else:
            share = 1 - exp(-dt)
            self.jitter = sqrt((1 - share) * self.jitter**2 + share * missing**2)
        if max(map(abs, sample.specific_force)) >= self.config.accel_range:
            self.saturated += 1
            self.filter.doubt(0.0, self.config.accel_range * dt)

    def _await_next(self, heard: VelocitySample | None, push: Array, dt: float) -> None:
        """After a stroke: begin anew once an aircraft rests on the velocimeter."""
        still = sqrt(push @ push) < LAUNCH and self._unheard < 0.5
        if heard is not None:
            self._unheard = 0.0
            still = still and abs(heard.velocity[0]) < 1.0
        self._rest = self._rest + dt if still else 0.0
        if self._rest > REST:
            self._restart()

    def _match(self, stamp: int, mat: Array, attitude: Array, velocity: Array,
               heard: VelocitySample | None, push: Array, dt: float) -> AlignmentEstimate | None:
        """Step the filter, if there is something to use."""
        transfer = self.filter
        assert transfer is not None
        axes = mat @ self._mat_track
        along = axes[:, 0]
        deck = self._reference(mat, attitude, velocity, 0.0)
        own = float(along @ (transfer.vec_v - deck))
        if self.phase == 'stroke':
            self._pushed += dt * float(push @ along)
            self._way += dt * own
        if heard is None and (self._unheard < PATIENCE / NANOSECONDS
                              or transfer.dt < 0.9 * UNIT_STEP):
            return None
        if heard is not None:
            self._unheard = 0.0
            speed = heard.velocity[0] + (stamp - heard.stamp) / NANOSECONDS * float(push @ along)
            if self._out_of_question(speed - own, transfer.dt):
                heard = None
            else:
                self._note_speed(speed, float(along @ deck))
        seen = ACROSS if heard is None else ALL
        reference = self._reference(mat, attitude, velocity, own if heard is None else speed)
        transfer.step(reference, axes, self._mat_r(axes, velocity, heard, transfer.dt), seen)
        if transfer.dt:  # the launch waits for its direction
            return None
        self.surprise += 0.02 * (float(transfer.size) - self.surprise)
        self.largest_factor = max(self.largest_factor, float(transfer.factor))
        return self._estimate(stamp)

    def _out_of_question(self, difference: float, dt: float) -> bool:
        assert self.filter is not None
        spread = 5 * sqrt(float(np.trace(self.filter.cov[3:6, 3:6])))
        if abs(difference) <= JUMP + spread:
            self._jumping = 0.0
            return False
        self.jumps += 1
        self._jumping += dt
        if self._jumping < JUMP_TIME:
            return True
        self._jumping = 0.0
        self.filter.doubt(0.0, abs(difference))
        return False

    def _note_speed(self, speed: float, deck: float) -> None:
        """Compare the speeds of the stroke, to see how late the reference is."""
        self._speed, self._peak = speed, max(self._peak, speed)
        if self.phase != 'stroke':
            self._start_speed = speed + deck
        elif self.stroke > 0.5 and speed > 5.0:
            late = self._pushed - (speed + deck - self._start_speed)
            self.skew = late / speed * self.stroke

    def _reference(self, mat: Array, attitude: Array, velocity: Array, speed: float) -> Array:
        along = self._mat_track[:, 0]
        rate = attitude[4:7] - mat.T @ self._earth.rate
        return reference_velocity(mat, rate, velocity[:3], self._arm(), along, np.array(speed))

    def _arm(self) -> Array:
        return np.asarray(self.config.lever_arm + self._way * self._mat_track[:, 0])

    def _mat_r(self, axes: Array, velocity: Array, heard: VelocitySample | None,
               dt: float) -> Array:
        """Return the reference's covariance in track axes (m^2/s^2)."""
        config, arm = self.config, self._arm()
        longer = UNIT_STEP / min(dt, 0.1)
        ldv = heard.var[0] if heard is not None and heard.var[0] > 0 else config.ldv_sd**2
        turning = (DEG_H * config.master_gyro_drift_sd_deg_h)**2 + (
            config.master_gyro_white_sd**2 / dt)
        var = np.array([ldv, longer * config.track_lateral_sd**2,
                        longer * config.track_vertical_sd**2]) + turning * (arm @ arm)
        # an error of the master lasts from one of its samples to the next
        master = np.maximum(velocity[3:], 0) * max(self._velocity.spacing / dt, 1.0)
        return np.asarray(np.diag(var) + axes.T @ (master[:, None] * axes))

    def _misalignment_cov(self) -> Array:
        assert self.filter is not None
        start = self.filter.start
        return np.asarray(self.filter.start_cov() + start.T @ self._first_cov @ start)

    def _estimate(self, stamp: int) -> AlignmentEstimate:
        assert self.filter is not None
        return AlignmentEstimate(
            stamp, rotation_vectors(self._mat_first.T @ self.filter.start),
            self._misalignment_cov(), quaternion_from_matrix(self.filter.mat),
            self.filter.cov[:3, :3])

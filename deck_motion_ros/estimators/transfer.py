"""
The filter of transfer alignment: an error-state Kalman filter round a strapdown navigator.

All arrays may have leading dimensions ``...``: the node runs one filter, the Monte Carlo hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.fading import (
    faded,
    fading_factors,
    remembered,
    StrongTracking,
    surprise,
)
from deck_motion_ros.estimators.strapdown import advanced, Increments
from deck_motion_ros.geometry import (
    cross,
    EYE,
    rotation_matrix,
    skew,
    slight_rotation,
    transformed,
)
from deck_motion_ros.samples import Array

STATES = 12
PHI, VEL, BIAS, DIST = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
ALL, ACROSS = slice(0, 3), slice(1, 3)  # what the reference gives in track axes
IDENTITY = np.eye(STATES)
NOISE = 5.0  # sd of a change of the force that is taken for noise
CHANGE = 0.009  # s: least time over which the force changes


@dataclass(frozen=True)
class Disturbance:
    """
    What shakes the slave's accelerometers in the stroke, known only by what it does.

    At first the thrust hides it, but along the track alone. So for a moment, in which the ship
    has hardly moved, it is what the force across the track shows beyond the force before the
    launch, and along the track what goes with that where the force changes.

    From then on the disturbance relaxes, and is stirred: by as much as the measured force changes,
    in the direction in which it changes; by as much as it relaxes, for that is a guess; and
    where an innovation is still a surprise, by what explains it. So the filter fades while the
    nose gear shakes, along that shaking, and no longer.

    Attributes
    ----------
    relaxation : float
        Time constant of the disturbance (s).
    memory : float
        Share of the stirring that is left one step later.
    wait : float
        Time from the launch to the first step (s): changes must have shown a direction.
    shown : float
        Time from the launch (s) in which the force across the track shows the disturbance.
    steady : float
        Sd of what else changes that force until then (m/s^2).
    late : float
        Sd of the reference's delay (s), of which the thrust makes an error of velocity.
    gate : float
        From which normalised squared innovation on one is a surprise.
    clear : float
        Standard deviations that a component of a surprise has at least.

    """

    relaxation: float = 0.07
    memory: float = 0.6
    wait: float = 0.03
    shown: float = 0.1
    steady: float = 0.05
    late: float = 0.005
    gate: float = 8.0
    clear: float = 3.0


@dataclass(frozen=True)
class TransferModel:
    """
    What the filter believes.

    Attributes
    ----------
    bias_sd : float
        Constant accelerometer bias, slave's less master's (m/s^2).
    drift_sd : float
        Constant gyro drift (rad/s), as the growth of the attitude's variance.
    turn_sd, push_sd : float
        White noise of turn rate and specific force, slave's and master's: sd of the mean over
        1 s (rad/s, m/s^2).
    disturbance : Disturbance or None
        None: the accelerometers are not disturbed.
    tracking : StrongTracking or None
        The fading of Bai2016, with weights of attitude and velocity.
    feedback : bool
        Take what is estimated out of the navigator at once; the paper leaves it beside.

    """

    bias_sd: float
    drift_sd: float
    turn_sd: float
    push_sd: float
    disturbance: Disturbance | None = None
    tracking: StrongTracking | None = None
    feedback: bool = True


class TransferFilter:
    """
    Attitude and velocity of the slave, corrected by a reference velocity.

    States, as errors of the navigator: attitude phi about ENU (true = Exp(phi) estimate, rad),
    velocity (m/s, ENU), bias and disturbance of the accelerometers (m/s^2, body). What is
    estimated is taken out of the navigator at once, so that angles need not be small.

    Parameters
    ----------
    model : TransferModel
        What it believes.
    earth : Earth
        Gravity and rates.
    mat : ndarray, shape (..., 3, 3)
        First attitude, body to ENU: the master's.
    vec_v : ndarray, shape (..., 3)
        First velocity (m/s, ENU): the reference's.
    mat_phi, mat_vel : ndarray, shape (..., 3, 3)
        Covariances of their errors, about and along ENU.

    Attributes
    ----------
    vec_v, bias, disturbance : ndarray, shape (..., 3)
        Of the navigator.
    cov : ndarray, shape (..., 12, 12)
        Of the states.
    launched : bool
        In the stroke: only there the accelerometers are taken for disturbed. See
        :meth:`launch`.
    innovation, size, factor : ndarray
        Of the newest step: reference less navigator in track axes over its sd, shape (..., m);
        normalised square, 1 on average, and by how much fading multiplied the variance of the
        velocity, shape (...).

    """

    def __init__(self, model: TransferModel, earth: Earth, mat: Array, vec_v: Array,
                 mat_phi: Array, mat_vel: Array) -> None:
        self.model, self._earth = model, earth
        self._mat = self._start = mat
        self.vec_v = self._reference = vec_v
        self.bias, self.disturbance, self._push = np.zeros((3, *vec_v.shape))
        self._vec_x = np.zeros((*vec_v.shape[:-1], STATES))
        self.cov = np.zeros((*vec_v.shape[:-1], STATES, STATES))
        self.cov[..., PHI, PHI], self.cov[..., VEL, VEL] = mat_phi, mat_vel
        self.cov[..., BIAS, BIAS] = model.bias_sd**2 * EYE
        self.launched = False
        self.innovation = np.zeros_like(vec_v)
        self.size = self.factor = np.ones(vec_v.shape[:-1])
        self.dt = self._age = 0.0  # s since the last step, since the first
        self._stroke = self._compared = 0.0  # s from the launch to now, to the earlier force
        self._complete = True
        self._before: Increments | None = None
        # newest, in the body, and what it was before the launch and a moment ago
        self._force = transformed(mat.swapaxes(-1, -2), -earth.gravity)
        self._calm = self._earlier = self._force
        self._stir, self._fresh = np.zeros((2, *vec_v.shape, 3))
        self._left = 0.0  # of the disturbance after this step
        self._spread = np.zeros(vec_v.shape[:-1])  # of the velocity, from the fading of this step
        self._mat_v: Array | None = None
        self._axes = EYE  # ENU at the start to ENU now, against the stars
        self._doubt = np.zeros(2)

    @property
    def mat(self) -> Array:
        """Estimate of the attitude now, body to ENU, shape (..., 3, 3)."""
        return self._mat if self.model.feedback else np.asarray(
            rotation_matrix(self._vec_x[..., PHI]) @ self._mat)

    @property
    def start(self) -> Array:
        """Estimate of the first attitude, shape (..., 3, 3)."""
        return self._start if self.model.feedback else np.asarray(
            self._axes.swapaxes(-1, -2) @ rotation_matrix(self._vec_x[..., PHI])
            @ self._axes @ self._start)

    def integrate(self, rate: Array, force: Array, dt: float) -> None:
        """
        Carry the navigator over one interval of the slave.

        Parameters
        ----------
        rate, force : ndarray, shape (..., 3)
            Means over the interval, body axes (rad/s, m/s^2).
        dt : float
            Its length (s).

        """
        now = Increments(rate * dt, (force - self.bias) * dt)
        self._mat, self.vec_v = advanced(self._mat, self.vec_v, now, self._before or now, dt,
                                        self._earth)
        self._before, self._force = now, force
        if self.launched:
            self._stroke += dt
            if self._stroke - self._compared > CHANGE:
                if self._compared:
                    self._fresh = self._fresh + _beyond(
                        force - self._earlier, NOISE * sqrt(2 / dt) * self.model.push_sd)
                self._earlier, self._compared = force, self._stroke
        self._push = self._push + dt * force
        self.dt += dt

    def launch(self) -> None:
        """Say that the next interval belongs to the stroke."""
        self.launched = True
        self._calm = self._force

    def doubt(self, turn: float, push: float) -> None:
        """Say that increments since the last step are missing: sd of them (rad, m/s)."""
        self._doubt += (turn * turn, push * push)

    def step(self, reference: Array, mat_track: Array, mat_r: Array, seen: slice = ALL) -> None:
        """
        Use a reference velocity (Bai2016 eq 7, 17-22).

        Parameters
        ----------
        reference : ndarray, shape (..., 3)
            Velocity of the slave as master and velocimeter know it (m/s, ENU).
        mat_track : ndarray, shape (..., 3, 3)
            Track to ENU.
        mat_r : ndarray, shape (3, 3)
            Covariance of its error in track axes.
        seen : slice
            ``ALL``, or ``ACROSS`` without velocimeter.

        """
        complete, disturbance = seen == ALL, self.model.disturbance
        if disturbance and self.launched and self._stroke < disturbance.wait:
            return
        fading = self._disturb(mat_track[..., 0])
        mat_phi = self._transition(reference if complete and self._complete else None)
        mat_q = self._noise() + fading
        mat_h = np.zeros((*self.vec_v.shape, STATES))
        mat_h[..., VEL] = mat_track.swapaxes(-1, -2)
        mat_h, mat_r = mat_h[..., seen, :], mat_r[seen, seen]
        vec_x = transformed(mat_phi, self._vec_x)
        innovation = transformed(mat_h[..., VEL], reference - self.vec_v + vec_x[..., VEL])
        cov = mat_phi @ self.cov @ mat_phi.swapaxes(-1, -2)
        if self.model.tracking:
            cov = self._faded(self.model.tracking, cov, mat_q, mat_h, mat_r, innovation)
        cov = cov + mat_q
        mat_s = mat_h @ cov @ mat_h.swapaxes(-1, -2) + mat_r
        sd = np.sqrt(np.diagonal(mat_s, axis1=-2, axis2=-1))
        self.innovation = innovation / sd
        inverse = np.asarray(np.linalg.inv(mat_s), dtype=float)
        share, self.size = surprise(innovation, inverse, disturbance.gate if disturbance else 1.0)
        if disturbance and self.launched:
            if share.any():
                vec = np.where(np.abs(innovation) > disturbance.clear * sd, innovation, 0.0)
                vec = np.sqrt(share)[..., None] / self.dt * transformed(
                    (mat_h[..., VEL] @ self._mat).swapaxes(-1, -2), vec)
                fading = self._entering(_square(vec))
                cov = cov + fading
                self._spread = self._spread + np.trace(fading[..., VEL, VEL], axis1=-2, axis2=-1)
                inverse = np.asarray(np.linalg.inv(
                    mat_h @ cov @ mat_h.swapaxes(-1, -2) + mat_r), dtype=float)
            spread = np.trace(cov[..., VEL, VEL], axis1=-2, axis2=-1)
            self.factor = spread / (spread - self._spread)
        gain = cov @ mat_h.swapaxes(-1, -2) @ inverse
        kept = IDENTITY - gain @ mat_h
        self.cov = kept @ cov @ kept.swapaxes(-1, -2) + gain @ mat_r @ gain.swapaxes(-1, -2)
        self._correct(vec_x - transformed(gain, innovation))
        self._reference, self._complete = reference, complete
        self._push, self.dt = np.zeros(self.vec_v.shape), 0.0

    def attitude_cov(self) -> Array:
        """Return the covariance of the attitude now in body axes, shape (..., 3, 3), rad^2."""
        return np.asarray(self.mat.swapaxes(-1, -2) @ self.cov[..., PHI, PHI] @ self.mat)

    def start_cov(self) -> Array:
        """Return the covariance of the first attitude, in body axes then (rad^2)."""
        turned = self._axes @ self.start
        return np.asarray(turned.swapaxes(-1, -2) @ self.cov[..., PHI, PHI] @ turned)

    def _disturb(self, along: Array) -> Array:
        """Carry the disturbance on, and into the velocity; return what covariance enters."""
        model, dt = self.model.disturbance, self.dt
        if model is None or not self.launched:
            return np.zeros(self.cov.shape)
        self._stir = model.memory * self._stir + self._fresh
        self._fresh = np.zeros(self._stir.shape)
        first = self._stroke <= dt
        if first or self._stroke < model.shown:
            self._left = 0.0
            gain, cov, thrust = self._shown(model, along)
            left = transformed(gain, self._force - self._calm)
            push = transformed(gain, self._push - dt * self._calm)
            fading = self._entering(cov)
            # one error at all these steps
            fading[..., VEL, VEL] *= max(2 * self._stroke / dt - 1, 1.0)
            if first:
                fading[..., VEL, VEL] += model.late**2 * _square(transformed(self._mat, thrust))
        else:
            self._left = exp(-dt / model.relaxation)
            left = self._left * self.disturbance
            push = dt * left
            fading = self._entering(self._stir + _square(self.disturbance - left))
        self.disturbance = left
        self.vec_v = self.vec_v - transformed(self._mat, push)
        self._spread = np.trace(fading[..., VEL, VEL], axis1=-2, axis2=-1)
        return fading

    def _shown(self, model: Disturbance, along: Array) -> tuple[Array, Array, Array]:
        """
        Return disturbance by force beyond the calm one, its covariance, and the thrust.

        It is as the force changes, but as large as across the track, where it is measured.
        """
        along = transformed(self._mat.swapaxes(-1, -2), along)
        across = EYE - _square(along)
        beyond = self._force - self._calm
        aside = transformed(across, beyond)
        thrust = beyond - aside
        changes = np.trace(across @ self._stir @ across, axis1=-2, axis2=-1)
        cov = ((aside * aside).sum(-1) / np.maximum(changes, 1e-30))[..., None, None] * self._stir
        turned = skew(thrust) @ self._mat.swapaxes(-1, -2)  # thrust across, by errors of attitude
        mat_r = model.steady**2 * EYE + turned @ self.cov[..., PHI, PHI] @ turned.swapaxes(-1, -2)
        gain = cov @ across @ np.linalg.inv(across @ cov @ across + mat_r) @ across
        return gain, cov - gain @ cov, thrust

    def _transition(self, reference: Array | None) -> Array:
        """
        Return Phi (Bai2016 eq 2, 3), shape (..., 12, 12).

        The force in it is what the reference shows, not the disturbed one; eq 3 prints the
        master's, which has no thrust.
        """
        dt, mat = self.dt, self._mat
        turn = dt * (self._earth.rate + self._earth.transport_rate(self.vec_v))
        if reference is None:
            push = transformed(mat, self._push - dt * (self.bias + self.disturbance))
        else:
            push = reference - self._reference - dt * self._earth.gravity
        mat_phi = np.empty_like(self.cov)
        mat_phi[:] = IDENTITY
        mat_phi[..., PHI, PHI] -= skew(turn)
        mat_phi[..., VEL, PHI] = skew(push)
        mat_phi[..., VEL, BIAS] = dt * mat
        mat_phi[..., VEL, DIST] = (self._left * dt) * mat
        mat_phi[..., DIST, DIST] = self._left * EYE
        return mat_phi

    def _noise(self) -> Array:
        """Return Q, shape (..., 12, 12)."""
        model, dt = self.model, self.dt
        self._age += dt
        mat_q = np.zeros(self.cov.shape)
        turn, push = self._doubt
        mat_q[..., PHI, PHI] = (dt * model.turn_sd**2 + turn + (
            2 * self._age - dt) * dt * model.drift_sd**2) * EYE
        mat_q[..., VEL, VEL] = (dt * model.push_sd**2 + push) * EYE
        self._doubt = np.zeros(2)
        return mat_q

    def _entering(self, cov: Array) -> Array:
        """Return what a covariance of the disturbance (body) makes of that of the states."""
        mat = np.zeros((*self.vec_v.shape, STATES)).swapaxes(-1, -2)
        mat[..., VEL, :] = self.dt * self._mat
        mat[..., DIST, :] = EYE
        return np.asarray(mat @ cov @ mat.swapaxes(-1, -2))

    def _faded(self, tracking: StrongTracking, cov: Array, mat_q: Array, mat_h: Array,
               mat_r: Array, innovation: Array) -> Array:
        if self._mat_v is not None and self._mat_v.shape[-1] != innovation.shape[-1]:
            self._mat_v = None
        self._mat_v = remembered(self._mat_v, innovation, tracking.memory)
        spread = np.einsum('...mi,...mi->...i', mat_h @ cov, mat_h)
        factors = fading_factors(tracking, self._mat_v, mat_r,
                                 mat_h @ mat_q @ mat_h.swapaxes(-1, -2), spread[..., :6])
        self.factor = factors.max(axis=-1)
        return faded(cov, np.concatenate([factors, np.ones_like(factors)], axis=-1))

    def _correct(self, vec_x: Array) -> None:
        """Take what is known of the navigator's errors out of it."""
        self._axes = slight_rotation(-self.dt * (
            self._earth.rate + self._earth.transport_rate(self.vec_v))) @ self._axes
        if not self.model.feedback:
            self._vec_x = vec_x
            return
        turn = rotation_matrix(vec_x[..., PHI])
        self._mat = turn @ self._mat
        self._start = self._axes.swapaxes(-1, -2) @ turn @ self._axes @ self._start
        self.vec_v = self.vec_v - vec_x[..., VEL]
        self.bias = self.bias + vec_x[..., BIAS]
        self.disturbance = self.disturbance + vec_x[..., DIST]


def _square(vec: Array) -> Array:
    """Return v v', shape (..., 3, 3)."""
    return vec[..., :, None] * vec[..., None, :]


def _beyond(vec: Array, limit: float) -> Array:
    """Return v v', shape (..., 3, 3), where v is larger than noise; else 0."""
    square = _square(vec)
    size = np.trace(square, axis1=-2, axis2=-1)[..., None, None]
    return np.where(size > limit * limit, square, 0.0)


def reference_velocity(mat: Array, rate: Array, velocity: Array, arm: Array, along: Array,
                       speed: Array) -> Array:
    """
    Return the velocity of a point that moves over the deck (Bai2016 eq 7, with the lever arm).

    Parameters
    ----------
    mat : ndarray, shape (..., 3, 3)
        Ship to ENU.
    rate : ndarray, shape (..., 3)
        Turn rate of the ship relative to the Earth, ship axes (rad/s).
    velocity : ndarray, shape (..., 3)
        Of the master unit (m/s, ENU).
    arm : ndarray, shape (..., 3)
        From it to the point, ship axes (m).
    along : ndarray, shape (3,)
        Direction of the track in ship axes.
    speed : ndarray, shape (...)
        Along the track (m/s).

    Returns
    -------
    ndarray, shape (..., 3)
        m/s, ENU.

    """
    return velocity + transformed(mat, cross(rate, arm) + speed[..., None] * along)

"""All axes learned together on an even grid: rival vector autoregressions, combined and scored."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deck_motion_ros.estimators.combining import Combination, Mask
from deck_motion_ros.estimators.resampling import Grid
from deck_motion_ros.estimators.seakeeping import SeakeepingFit
from deck_motion_ros.estimators.var import ForgettingVar
from deck_motion_ros.samples import Array

# order, memory (both in slots of about 0.5 s), samples that couplings must be worth, samples that
# what ships do in waves is worth
RIVALS = ((24, 600, 0, 0), (36, 200, 50, 0), (60, 300, 20, 0), (100, 2400, 0, 1000),
          (100, 10000, 0, 3000), (100, 300, 0, 30000))
SPACING = 0.5
KNOTS: Array = SPACING * np.arange(25.0)  # s ahead
# cubics 1, u, u^2, u^3 through two knots, of value and rate: factors of the values there and of
# the rates there
HERMITE = np.array([[[1, 0, -3, 2], [0, 0, 3, -2], [0, 1, -2, 1], [0, 0, -1, 1]],
                    [[0, -6, 6, 0], [0, 6, -6, 0], [1, -4, 3, 0], [0, -2, 3, 0]]], float)
POWERS = np.arange(4)[:, None]
HERMITE[0, 2:] *= SPACING
HERMITE[1, :2] /= SPACING
KINDS = np.array([[0], [1]])  # value, slope; this, next
SETTLE = 3.0  # s in which a forecast beyond the knots nears the mean
SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12  # of a cubic in its middle, by five points


@dataclass(frozen=True, slots=True, eq=False)
class JointOutlook:
    """
    What the joint model says of the future, frozen.

    Attributes
    ----------
    time : float
        Of the instant from which it looks ahead (s).
    motion_at : ndarray, shape (2, knots, m)
        Value and rate at ``KNOTS`` seconds ahead, without the guest's share.
    times : ndarray, shape (horizons,)
        The scored horizons, seconds ahead of ``time``.
    guest : ndarray, shape (horizons, m)
        The guest's weights at them.
    cov_at : ndarray, shape (2, horizons, m, m)
        Error covariances of the whole combination's value and rate at them.
    trust : float
        How far they rest on experience: 0 not at all, 1 fully.
    mean_at : ndarray, shape (m,)
        Of the motion: the value in the far future.
    rise : ndarray, shape (m,)
        Sd of the motion over that of the error at the last horizon, at least 1.

    """

    time: float
    motion_at: Array
    times: Array
    guest: Array
    cov_at: Array
    trust: float
    mean_at: Array
    rise: Array

    def shares(self, ahead: Array) -> Array:
        """Return the guest's weights some seconds on and their slopes (1/s), shape (2, n, m)."""
        k, u = _place(ahead, self.times)
        share = self.guest[k]
        rise = self.guest[k + 1] - share
        inside = (ahead > self.times[0]) & (ahead < self.times[-1])
        slope = inside / (self.times[k + 1] - self.times[k])
        return np.array([share + u[:, None] * rise, slope[:, None] * rise])

    def mean(self, ahead: float) -> list[float]:
        """Predict the axes ``ahead`` seconds on, without the guest's share."""
        if ahead > KNOTS[-1]:
            return list(self.motion(np.array([ahead]))[0, 0].tolist())
        at = max(ahead / SPACING, 0.0)
        k = min(int(at), len(KNOTS) - 2)
        u = at - k
        weights = HERMITE[0] @ (1.0, u, u * u, u * u * u)
        found: list[float] = (weights @ self.motion_at[:, k:k + 2].reshape(4, -1)).tolist()
        return found

    def motion(self, ahead: Array) -> Array:
        """Predict the same and its rate for some times: shape (2, n, m)."""
        k, u = _place(ahead, KNOTS)
        weights = HERMITE @ u**POWERS
        around = self.motion_at[:, k + KINDS].reshape(4, len(ahead), -1)
        found = np.asarray(np.einsum('akn,knm->anm', weights, around))
        if (late := _late(ahead, KNOTS[-1])) is not None:  # as a critically damped spring
            away, push = found[0] - self.mean_at, found[0] - self.mean_at + SETTLE * found[1]
            found = np.exp(-late) * np.stack([
                away + push * late, found[1] - push * late / SETTLE])
            found[0] += self.mean_at
        return found

    def spread(self, ahead: Array) -> Array:
        """Return the covariances of value and rate for some times: shape (2, n, m, m)."""
        k, u = _place(ahead, self.times)
        u = u[:, None, None]
        cov = np.asarray((1 - u) * self.cov_at[:, k] + u * self.cov_at[:, k + 1])
        if (late := _late(ahead, self.times[-1])) is not None:
            scale = 1 + (self.rise - 1) * (1 - np.exp(-late))
            cov *= scale[:, :, None] * scale[:, None, :]
        return cov


def _late(ahead: Array, last: float) -> Array | None:
    """Say how many SETTLE seconds after ``last`` times come, shape (n, 1); None if none does."""
    return np.maximum(ahead - last, 0.0)[:, None] / SETTLE if (ahead > last).any() else None


def _place(at: Array, knots: Array) -> tuple[NDArray[np.int_], Array]:
    """Find the knot before each of some numbers and the share of the way to the next, 0 to 1."""
    place = np.interp(at, knots, np.arange(len(knots)))
    before = np.minimum(place.astype(int), len(knots) - 2)
    return before, place - before


class JointModel:
    """
    Learn how all axes move together and look ahead.

    Rivals of different order and memory (:class:`ForgettingVar`), "the mean" and a guest from
    outside forecast each slot; :class:`Combination` weighs them. One rival is refitted every
    1.5 s, in turn. Some lean on what ships do in waves (:class:`SeakeepingFit`): they are good
    while little was seen, and after a turn. What is promised is the combination's error variance
    by the rivals' error covariance, times what the promises turned out to be worth. A turn makes
    all of them forget, if the heading is known.

    Parameters
    ----------
    which : sequence of int
        Axes: which of ROLL, PITCH, HEAVE; m of them.
    grid : Grid

    Attributes
    ----------
    times : ndarray, shape (horizons,)
        Seconds from an instant to the middles of the slots that are scored.
    heading : float or None
        Of the ship (rad, without jumps), if it is known.

    """

    HORIZONS = (0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)  # s, scored
    BACK = 5  # past slots that the readout uses
    CAPACITY = 2400  # slots remembered for the mean
    REFIT_EVERY = 1.5  # s, one of the rivals in turn
    WEIGH_EVERY = 6  # slots
    HALF_LIFE, PROMISE_HALF_LIFE = 40.0, 120.0  # s
    ALARM_HALF_LIVES = np.array([5.0, 20.0])  # s: to widen, to narrow
    TRIAL = 30.0  # s of promises kept before they are trusted fully
    BASIS = 20.0  # slots scored before anything is promised
    BELIEF = 4.0  # slots that the initial belief in the promises weighs
    LONG = 600.0  # slots: only a longer memory can be outdated for long
    WELL_FED = 12.0  # slots for each lag: who has so many should be good
    OUTDATED = 1.5  # times the best rival's error variance: what was learned is outdated
    RELEARN = 120.0  # s of quick forgetting then
    BEYOND = 4.0  # sd: farther errors are not learned in full
    WORST = 400.0  # squares of sd that the alarm believes
    AFLOAT = 200.0  # slots: half the window of the mean that ship and sea are fitted about
    ROUGH = 10.0  # s: of so short a past the mean is worthless; it soon is good
    LEAST = 1e-12  # variance: nothing is known better (rad^2, m^2)

    def __init__(self, which: Sequence[int], grid: Grid) -> None:
        step, axes = grid.step, len(which)
        self.axes, self.grid = axes, grid
        self.heading: float | None = None
        shrink = min(0.5 / step, 1.0)  # slower input: as many seconds, not as many slots
        self._rivals = [ForgettingVar(axes, max(round(order * shrink), 6), memory * shrink, cross)
                        for order, memory, cross, _ in RIVALS]
        self._worth = [samples * shrink for *_, samples in RIVALS]
        self._fit = SeakeepingFit(which, grid)
        self._steps = np.unique([max(round(time / step), 1) for time in self.HORIZONS])
        self._around = self._steps[:, None] + np.arange(-1, 4)  # with one past slot before
        self.times: Array = self._steps * step - grid.age
        self._ahead = int((KNOTS[-1] + grid.age) / step) + self.BACK + 1
        self._between = _place(np.arange(1.0, self._ahead + 1), self._steps)
        # rates are slopes of what is read, which err by less than rates read off the slots
        around = SPACING * np.arange(-2.0, len(KNOTS) + 2.0)
        read = readout(grid, np.asarray(around), self.BACK, self._ahead)
        slopes = [SLOPE @ read[k:k + 5] / SPACING for k in range(len(KNOTS))]
        self._readout = np.stack([read[2:-2], slopes])
        self._reach = max(rival.order for rival in self._rivals)
        self._track = np.zeros((2 * self.CAPACITY * grid.ticks, axes))  # slots ending at each tick
        self._size = 0  # of the track
        self._run = 0  # ticks since the last interruption
        self._turn = 0  # slots ever
        self._every = max(round(self.REFIT_EVERY / step), 2)
        self._learned = [0] * len(RIVALS)  # slot up to which a rival has learned
        self._known: deque[bool] = deque(maxlen=self._every * len(RIVALS))  # slots
        self._recent: deque[Array] = deque(maxlen=grid.ticks)
        self._mean: Array = np.zeros(axes)
        self._low = self._high = self._origin = np.zeros(axes)  # all below is about the origin
        self._bounds = self._low, self._high
        self._noise_var: Array = np.zeros(axes)

        # forecasts of the coming slots, and at the scored steps: rivals and the mean
        number, h, width = len(RIVALS) + 2, len(self._steps), self._reach * axes
        self._forecast = np.zeros((number - 1, self._ahead, axes, width))
        self._offset = np.zeros((number - 1, self._ahead, axes))
        self._scored = np.zeros((number - 1, h, axes, width))
        self._lags = np.zeros(number, int)  # of everybody's model
        self._fitted = np.zeros(number, bool)
        self._fitted[-2:] = True
        self._introduced = self._fitted.copy()
        self._combination = Combination(h, axes, number, self.HALF_LIFE / step)
        self._weights = np.zeros((h, axes, number))
        self._weights[..., -1] = 1.0
        self._losses = np.ones(number)
        self._combined = np.zeros((self._ahead * axes, width)), np.zeros((self._ahead, axes))

        # rings of what was said at the last slots; promised are value and slope, and their sd
        ring = int(self._steps[-1]) + 3
        self._said = np.zeros((ring, h, number, axes))
        self._spoke = np.zeros((ring, number), bool)
        self._promised = np.zeros((ring, 2, h, axes))
        self._promised_sd = np.full((ring, h, axes), np.inf)
        # moments of normalised errors: value, slope; before any came they are believed to be 1
        self._errors = self.BELIEF * np.broadcast_to(np.eye(axes), (2, h, axes, axes))
        self._number = np.full(h, self.BELIEF)
        self._noise_share = np.array([[[1.0]], [[SLOPE @ SLOPE / step**2]]])  # of a slot's noise
        self._promise_fade = 0.5 ** (step / self.PROMISE_HALF_LIFE)
        self._alarm_fade = 0.5 ** (step / self.ALARM_HALF_LIVES)
        self._alarm: Array = np.ones(2)
        self._renew_spread()
        self._seen: JointOutlook | None = None  # what outlook returned since the last tick

    def interrupt(self) -> None:
        """Forget the recent past, not what was learned: samples were missing for long."""
        self._run, self._seen = 0, None
        self._recent.clear()
        self._known.clear()
        self._spoke[:] = False
        self._promised_sd[:] = np.inf

    def profile(self, axes: Sequence[int]) -> dict[str, Array]:
        """Return what the rivals learned of these axes and how they erred, for :meth:`recall`."""
        grid = np.array([self.grid.tick, self.grid.ticks, *axes], float)
        return {'grid': grid, 'errors': self._combination.covariance} | {
            f'rival{k}': rival.learned(self._mean) for k, rival in enumerate(self._rivals)}

    def recall(self, profile: Mapping[str, Array], axes: Sequence[int]) -> None:
        """Start with what an earlier run learned, if it had these axes and this grid."""
        grid = profile.get('grid', np.zeros(2))
        stored = grid[2:].tolist()
        if not {*axes} <= {*stored} or not np.allclose(
                grid[:2], [self.grid.tick, self.grid.ticks], rtol=0.05, atol=0.0):
            return
        place = np.array([stored.index(axis) for axis in axes])
        errors = profile.get('errors', np.zeros(0))
        number = len(self._fitted)
        known = errors.shape == (len(self._steps), len(stored), number, number)
        if known:
            self._combination.recall(errors[:, place], self.BASIS)
        for k, rival in enumerate(self._rivals):
            if self._worth[k] > rival.memory:
                continue  # it leans on the fit, which starts afresh: this may be another sea
            learned = profile.get(f'rival{k}', np.zeros((1, 0)))
            if learned.shape[1] == len(stored) * (rival.order + 1):
                rows = (np.arange(rival.order + 1)[:, None] * len(stored) + place).ravel()
                rival.recall(learned[np.append(rows, -1)][:, rows])
                self._introduced[k] = known

    @property
    def ends_slot(self) -> bool:
        """Say whether the next tick ends a slot."""
        return (self._run + 1) % self.grid.ticks == 0

    def advance(self, values: Array, known: bool, guest: Array | None,
                noise_var: Array) -> None:
        """
        Take one tick.

        Parameters
        ----------
        values : ndarray, shape (m,)
            Means over the tick, or values at its end (:class:`Tick`).
        known : bool
            False: bridged, to be neither learned nor scored.
        guest : ndarray, shape (2, horizons, m), or None
            The guest's forecasts of value and rate at ``times`` where ``ends_slot``; without
            them the slot is learned but nothing is forecast.
        noise_var : ndarray, shape (m,)
            Variance of the noise of a slot.

        """
        self._seen = None
        if not self._size:
            self._origin = values
        self._recent.append(values - self._origin)
        self._run += 1
        self._noise_var = noise_var
        if self._size == len(self._track):
            self._size //= 2
            self._track[:self._size] = self._track[self._size:]
        self._track[self._size] = sum(self._recent) / len(self._recent)
        self._size += 1
        if self._run % self.grid.ticks:
            return
        self._turn += 1
        self._known.append(known)
        at = self._turn % len(self._spoke)
        self._spoke[at], self._promised_sd[at] = False, np.inf
        if not known:
            return
        slot = self._track[self._size - 1]
        self._low, self._high = np.minimum(self._low, slot), np.maximum(self._high, slot)
        reach = (self._high - self._low) / 4
        self._bounds = self._low - reach, self._high + reach
        self._score()
        if self._turn % self._every == 1:
            self._refit(self._turn // self._every % len(self._rivals))
        if self._turn % (2 * self._every) == 0:
            self._fit_ship()
        if self._turn % self.WEIGH_EVERY == 0 or self._run == self.grid.ticks:
            self._weigh()
        self._renew_spread()
        if guest is not None:
            self._say(at, guest - np.array([self._origin, 0 * self._origin])[:, None])

    def _past(self, slots: int) -> Array:
        """Return the last slots (slots, m), the newest first; the mean before they began."""
        there = min(slots, self._run // self.grid.ticks)
        past = np.empty((slots, self.axes))
        past[:there] = self._newest(there)
        past[there:] = self._mean
        return past

    def _newest(self, slots: int) -> Array:
        ticks, size = self.grid.ticks, self._size
        return self._track[size - 1 - (slots - 1) * ticks:size:ticks][::-1][:slots]

    def _score(self) -> None:
        """Compare what was said for this slot with it."""
        horizons, past = np.arange(len(self._steps)), self._past(5)
        # the slope of two slots before: only now its other side is known
        back = (self._turn - self._steps - 2 * KINDS) % len(self._spoke)
        came = np.array([past[0], SLOPE @ past[::-1] / self.grid.step])
        promised = self._promised[back, KINDS, horizons]
        sd = self._promised_sd[back, horizons]
        errors, kept = (promised - came[:, None]) / sd, np.isfinite(sd[..., 0])
        fade = np.where(kept, self._promise_fade, 1.0)
        before, self._number = self._number, fade[0] * self._number + kept[0]
        usual = np.einsum('khii->khi', self._errors) / np.array([before, self._number])[..., None]
        worth = np.minimum(np.square(errors[0]) / usual[0], self.WORST)[
            kept[0] & (self.times < 3.1)]
        if len(worth):
            self._alarm += (1 - self._alarm_fade) * (float(worth.mean()) - self._alarm)
        # what is beyond BEYOND of the usual is scaled back to it: the alarm is for that
        tame = 1 / np.maximum(np.abs(errors) / (self.BEYOND * np.sqrt(usual)), 1.0)
        self._combination.score((self._said[back[0], horizons] - past[0]) * tame[0, :, None],
                                self._spoke[back[0]])
        errors *= tame
        self._errors *= fade[..., None, None]
        self._errors += errors[..., :, None] * errors[..., None, :]

    def _fit_ship(self) -> None:
        """Let the fit of ship and sea learn the slots since its last turn and go one step."""
        fit = self._fit
        if self.heading is not None:
            kept = fit.head(self.heading)
            if kept < 1:  # motion in another sea was learned, and who was good at it
                for rival in self._rivals:
                    rival.fade(kept)
                self._combination.fade(kept, self.BASIS)
        new = min(2 * self._every, self._run // self.grid.ticks - fit.order)
        if new > 0:
            slots = self._newest(fit.order + new)[::-1] - self._smooth_mean(self.AFLOAT)
            fit.learn(slots, np.array(self._known)[-new:])
            fit.improve(self._noise_var)

    def _refit(self, index: int) -> None:
        """Let one rival learn the slots since its last turn and solve."""
        rival = self._rivals[index]
        new = min(self._turn - self._learned[index], len(self._known),
                  self._run // self.grid.ticks - rival.order)
        self._learned[index] = self._turn
        if new > 0:
            rival.learn(self._newest(rival.order + new)[::-1], np.array(self._known)[-new:])
        slots = self._run // self.grid.ticks
        lags = min(rival.order, slots)
        # beside what this ship did before, what ships do counts less
        worth = max(self._worth[index] - rival.recalled, 0.0)
        expected = self._fit.expected(rival.order, worth) if worth else None
        if expected is None and not rival.is_ready:
            return
        if (rival.memory > self.LONG and rival.weight > self.WELL_FED * rival.order
                and self._losses[index] > self.OUTDATED):
            rival.forget(int(self.RELEARN / self.grid.step))
        self._mean = self._smooth_mean(rival.memory)
        try:
            model = rival.solve(self._mean, np.sqrt(self._noise_var), expected, lags,
                                (self.ROUGH / slots / self.grid.step)**6)
        except np.linalg.LinAlgError:
            return  # keep the model there is
        forecast, offset = model.ahead(self._ahead)
        self._lags[index], width = lags, forecast.shape[2]
        self._forecast[index, ..., width:] = self._scored[index, ..., width:] = 0.0
        self._forecast[index, ..., :width] = forecast
        self._scored[index, ..., :width] = forecast[self._steps - 1]
        self._offset[index] = offset
        self._fitted[index] = True

    def _smooth_mean(self, memory: float) -> Array:
        """Average the last two memories with a Hann window: waves cancel as in no plain mean."""
        count = min(int(2 * memory), self.CAPACITY, self._size // self.grid.ticks)
        window = np.sin(np.pi * (np.arange(count) + 0.5) / count)**2
        return np.asarray(window @ self._newest(count) / window.sum())

    @property
    def _speaking(self) -> Mask:
        """Who has a model and the past it needs."""
        return np.asarray(self._fitted & (self._lags <= self._run // self.grid.ticks))

    def _weigh(self) -> None:
        """Renew the weights and the combined forecast of all but the guest."""
        for index in np.flatnonzero(self._speaking & ~self._introduced).tolist():
            self._combination.introduce(index, self._speaking & self._introduced)
            self._introduced[index] = True
        self._losses = self._combination.losses(self._noise_var + self.LEAST)
        scored = self._combination.scored >= self.BASIS  # before, the guest speaks alone
        self._weights = np.where(scored[:, None, None], self._combination.weights(
            self._speaking, self._noise_var + self.LEAST), self._weights)
        self._offset[-1] = self._mean
        own = self._weights[..., :-1] + np.eye(len(self._spoke[0]) - 1)[-1] * 1e-12
        own /= own.sum(axis=-1, keepdims=True)
        at, u = self._between
        shares = own[at] + u[:, None, None] * (own[at + 1] - own[at])
        forecast = shares[:, :, None] @ self._forecast.transpose(1, 2, 0, 3)
        self._combined = (forecast.reshape(-1, forecast.shape[3]),
                          np.einsum('kaj,jka->ka', shares, self._offset))

    def _trajectory(self, past: Array) -> Array:
        """Look ahead: the coming slots, shape (ahead, m), without the guest."""
        forecast, offset = self._combined
        return self._bounded((forecast @ past.ravel()).reshape(offset.shape) + offset)

    def _bounded(self, slots: Array) -> Array:
        """Keep forecasts within what the axes have ever done, and half as much again."""
        low, high = self._bounds
        return np.asarray(np.minimum(np.maximum(slots, low), high))

    def _say(self, at: int, guest: Array) -> None:
        """Note what everybody forecasts now, and what is promised of the combination."""
        past = self._past(self._reach)
        flat = self._scored.reshape(-1, self._scored.shape[3]) @ past.ravel()
        said = flat.reshape(self._scored.shape[:3]) + self._offset[:, self._steps - 1]
        self._said[at, :, :-1] = self._bounded(said).transpose(1, 0, 2)
        self._said[at, :, -1] = guest[0]
        self._spoke[at] = self._speaking
        slots = np.vstack([past[1::-1], self._trajectory(past)])
        around = slots[self._around]
        own = np.array([around[:, 2], SLOPE @ around / self.grid.step])
        share = self._weights[..., -1]
        self._promised[at] = share * guest + (1 - share) * own
        self._promised_sd[at] = self._sd

    def _renew_spread(self) -> None:
        """Renew promised sds, and what the outlook says of covariances, once a slot."""
        weights, among = self._weights[..., None], self._combination.covariance
        var = (among @ weights * weights).sum(axis=(2, 3))
        sd = np.sqrt(np.maximum(var, 0.0) + self._noise_var + self.LEAST)
        tested = self._tested
        self._sd = np.where(tested[:, None] < self.BASIS, np.inf, sd)
        cov = self._errors * (sd[:, :, None] * sd[:, None, :] / self._number[:, None, None])
        # the noise of what came is set aside, at most half of the variance
        noise = self._noise_var * self._noise_share / np.maximum(
            np.einsum('khii->khi', cov), 1e-30)
        root = np.sqrt(1 - np.minimum(noise, 0.5))
        widen = max(float(self._alarm[0]) / 1.5, min(float(self._alarm[1]) / 0.6, 1.0))
        self._cov = widen * cov * root[..., :, None] * root[..., None, :]
        kept = min(float(self._number.min()) - self.BELIEF, float(tested.min()))
        self._trust = min(max(kept * self.grid.step / self.TRIAL, 0.0), 1.0)
        motion = among[-1, :, -2, -2]  # the errors of "the mean"
        self._rise = np.sqrt(np.maximum(motion / self._cov[0, -1].diagonal(), 1.0))

    @property
    def _tested(self) -> Array:
        """Slots scored, shape (horizons,); after an interruption nobody is himself at once."""
        own: Array = np.maximum(self._run // self.grid.ticks - self._steps, 0)
        return np.minimum(self._combination.scored, own)

    def outlook(self, time: float) -> JointOutlook:
        """Freeze what is known at the newest instant, ``time`` (s)."""
        if self._seen is None:
            past = self._past(self._reach)
            slots = np.vstack([past[self.BACK - 1::-1], self._trajectory(past)])
            motion = self._readout @ slots
            motion[0] += self._origin
            self._seen = JointOutlook(time, motion, self.times, self._weights[..., -1], self._cov,
                                      self._trust, self._mean + self._origin, self._rise)
        return self._seen


def readout(grid: Grid, times: Array, back: int, ahead: int) -> Array:
    """
    Read values off a series of slots: the best linear interpolation of ship motion.

    The slots' averaging is undone. Motion is taken to have power up to 0.45 Hz, or as far as the
    slots can carry, falling off above 0.25 Hz; a slot to have noise of 1e-4 of it.

    Parameters
    ----------
    grid : Grid
        Of the slots.
    times : ndarray, shape (n,)
        Seconds after the end of the newest past slot.
    back, ahead : int
        Slots before and after that instant.

    Returns
    -------
    ndarray, shape (n, back + ahead)
        Weights of the slots.

    """
    frequency = np.linspace(0, min(0.45, 0.45 / grid.step), 60)
    power = 1 / (1 + (frequency / 0.25)**4)
    power /= power.sum()
    passes = (np.sinc(frequency * grid.step) * np.sinc(frequency * grid.tick)**2
              if grid.ticks > 1 else np.ones(len(frequency)))
    middles = np.arange(1 - back, ahead + 1) * grid.step - grid.age
    omega = 2 * np.pi * frequency
    value = np.zeros((len(times), back + ahead))
    for k, time in enumerate(times):
        near = np.argsort(np.abs(middles - time), kind='stable')[:2 * back]
        lags = middles[near, None] - middles[near]
        cov = np.cos(lags[..., None] * omega) @ (power * passes**2) + 1e-4 * np.eye(len(near))
        shift = np.outer(time - middles[near], omega)
        value[k, near] = np.linalg.solve(cov, np.cos(shift) @ (power * passes))
    return value

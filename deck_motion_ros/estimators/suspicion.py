"""Which anchor is not where it was surveyed: a filter for each guess, weighed by likelihood."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from copy import copy
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from deck_motion_ros.estimators.multilateration import REJECT
from deck_motion_ros.estimators.ranging import Innovation, JointFilter
from deck_motion_ros.samples import Array, Vector3

SHARE = 0.1  # weight of the newest range in the strain of its anchor
STRAINED = 3.5 * sqrt(SHARE / (2 - SHARE))  # in honest standard deviations
PAST = 60  # ranges among which it may have begun
STARTS = (0.0, 0.6)  # where in them
PRIOR = log(0.01)  # that it was this anchor, once there is suspicion
OUTLIER = log(1e-3)  # density of a rejected range times its sd: 1 in 10, over 100 sd
GONE = -12.0  # of a guess, relative to the best one
LONGEST = 10.0  # s, after which the best guess is taken
NEAR, CALM = 2.0, 3.0  # a bias mostly within so many sd for so many s is over


class Epoch(NamedTuple):
    """
    Ranges that act together.

    Attributes
    ----------
    points : sequence of 3 float
        Where each was measured from (m).
    owners : sequence of int
        The anchor of each; below 0 = none.
    distances, var : ndarray, shape (m,)
        Measured, and the variances of their noise (m).
    lag : float
        How long ago (s).

    """

    points: Sequence[Vector3]
    owners: Sequence[int]
    distances: Array
    var: Array
    lag: float


class _Past(NamedTuple):
    """The filter, what it went on by, and the ranges that it used then."""

    joint: JointFilter
    dt: float
    psd: Array
    epoch: Epoch


class Guess:
    """
    A filter, and the logarithm of how likely it makes the ranges.

    Attributes
    ----------
    joint : JointFilter
    score : float

    """

    def __init__(self, joint: JointFilter, score: float = 0.0) -> None:
        self.joint, self.score = joint, score

    def use(self, epoch: Epoch, scored: bool = True) -> Innovation:
        """Use ranges."""
        expected, mat_h = self.joint.expected(epoch.points, epoch.lag, epoch.owners)
        new = self.joint.update(epoch.distances - expected, mat_h, epoch.var)
        if scored:
            rejected = epoch.var[new.weights == 0]
            self.score += float(
                np.linalg.slogdet(new.information / (2 * np.pi))[1] / 2
                - new.residual @ new.information @ new.residual / 2
                + np.sum(OUTLIER - np.log(rejected) / 2))
        return new

    def replay(self, past: Sequence[_Past]) -> None:
        """Go through what is past."""
        for _, dt, psd, epoch in past:
            self.joint.advance(dt, psd)
            self.use(epoch)


class CheckedFilter:
    """
    The joint filter, and what it would be if one of the anchors had been moved or shaded.

    While all is well there is one filter. Each anchor has a strain: the recent mean of how far
    its ranges are off, in standard deviations, which is about 0. Where one strains, every anchor
    in turn is guessed to have a bias of unknown size since some moment of the newest ranges. All
    these filters start from the common past, and go on until their likelihoods have told; until
    then the estimate is that of their mixture.

    Parameters
    ----------
    joint : JointFilter
        To start with.
    anchors : int
        Number of anchors.

    """

    def __init__(self, joint: JointFilter, anchors: int) -> None:
        self._shares = [0.0] * anchors  # of rejected ranges
        self._strains = [0.0] * anchors
        self._decide(Guess(joint))

    def _decide(self, guess: Guess) -> None:
        self._guesses = [guess]
        self._past: deque[_Past] = deque()
        self._mark()
        self._calm = 0.0
        self._strains = [0.0] * len(self._strains)

    def _mark(self) -> None:
        """Remember the filter as it is now; what comes is counted from here."""
        self._before, self._dt, self._noise = copy(self._guesses[0].joint), 0.0, np.zeros(3)

    @property
    def contradicted(self) -> bool:
        """Whether most of the newest ranges were rejected, or most anchors are in doubt."""
        doubted = min(len(guess.joint.doubted) for guess in self._guesses)
        return max(sum(self._shares), doubted) > len(self._shares) / 2

    def advance(self, dt: float, psd: Array) -> None:
        """Go on, as :meth:`JointFilter.advance`."""
        for guess in self._guesses:
            guess.joint.advance(dt, psd)
        self._dt += dt
        self._noise = self._noise + dt * psd

    def use(self, epoch: Epoch) -> Array:
        """Use ranges; return the weights that they have in the best guess."""
        doubtful = len(self._guesses) > 1
        results = [guess.use(epoch, doubtful) for guess in self._guesses]
        scores = [guess.score for guess in self._guesses]
        top = max(scores)
        new = results[scores.index(top)]
        for owner, weight, value in zip(epoch.owners, new.weights.tolist(), new.standard.tolist(),
                                        strict=True):
            if owner >= 0:
                value = max(-REJECT, min(REJECT, value))
                self._strains[owner] += SHARE * (value - self._strains[owner])
                self._shares[owner] += SHARE * ((weight == 0) - self._shares[owner])
        if doubtful:
            best = self._guesses[scores.index(top)]
            rivals = [guess for guess in self._guesses if guess.score > top + GONE
                      and {*guess.joint.doubted} != {*best.joint.doubted}]
            if not rivals or self._dt > LONGEST:
                self._decide(best)
        else:
            self._watch(epoch)
        return new.weights

    def _watch(self, epoch: Epoch) -> None:
        """Ask whether an anchor strains, or whether one has calmed down."""
        self._past.append(_Past(self._before, self._dt, self._noise / (self._dt or 1.0), epoch))
        while len(self._past) * len(epoch.owners) > PAST:
            self._past.popleft()
        joint = self._guesses[0].joint
        if joint.doubted:
            size, anchor = min((abs(mean / sd), anchor)
                               for anchor, (mean, sd) in joint.biases().items())
            self._calm = max(0.0, self._calm + self._dt * (1 if size < NEAR else -5))
            if self._calm > CALM:
                self._decide(Guess(joint.trusting(anchor)))
        self._mark()
        if max(map(abs, self._strains)) > STRAINED:
            self._suspect()

    def _suspect(self) -> None:
        """Start a filter for each anchor, from when it suits the ranges best."""
        past = [*self._past]
        plain, done = Guess(copy(past[0].joint)), 0
        best: dict[int, Guess] = {}
        for start in [int(share * len(past)) for share in STARTS]:
            plain.replay(past[done:start])
            done = start
            for anchor in {owner for item in past for owner in item.epoch.owners if owner >= 0}:
                guess = Guess(plain.joint.doubting(anchor), plain.score + PRIOR)
                guess.replay(past[start:])
                if anchor not in best or guess.score > best[anchor].score:
                    best[anchor] = guess
        plain.replay(past[done:])
        self._guesses = [plain, *best.values()]

    def _weights(self) -> Array:
        scores = np.array([guess.score for guess in self._guesses])
        weights = np.exp(scores - scores.max())
        return np.asarray(weights / weights.sum())

    def estimate(self) -> tuple[Array, Array]:
        """Return position and velocity, shape (6,), and their covariance, of the mixture."""
        if len(self._guesses) == 1:
            joint = self._guesses[0].joint
            return joint.state[:6], joint.cov[:6, :6]
        weights = self._weights()
        states = np.array([guess.joint.state[:6] for guess in self._guesses])
        covs = np.array([guess.joint.cov[:6, :6] for guess in self._guesses])
        mean = weights @ states
        away = states - mean
        return mean, np.tensordot(weights, covs, 1) + (weights[:, None] * away).T @ away

    def doubts(self) -> dict[int, float]:
        """Return the probability that an anchor's ranges have a bias, for those in doubt."""
        found: dict[int, float] = {}
        for guess, weight in zip(self._guesses, self._weights().tolist(), strict=True):
            for anchor in guess.joint.doubted:
                found[anchor] = found.get(anchor, 0.0) + weight
        return found

    def errors(self) -> tuple[Array, Array]:
        """Return mean and sd of the errors that all ranges may have, of the best guess."""
        return max(self._guesses, key=lambda guess: guess.score).joint.errors()

"""
Guidance of an aircraft to a moving deck: approach, hold, descent.

The aircraft takes velocities relative to the ship's mean motion. It is led over the deck, waits
there, and descends at a steady rate. With a forecast of the deck it chooses when to be down: at a
time when the deck will move with it, so that the two close slowly; without one it descends at
once, whatever the deck does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, hypot, inf, sqrt

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from deck_motion_ros.config import parameter
from deck_motion_ros.samples import (
    Array,
    DeckForecast,
    GO,
    LandingWindow,
    OdometrySample,
    Rejected,
    seconds,
    Vector3,
    WAIT,
)
from deck_motion_ros.streams import OutputSchedule, StampGate

APPROACH, HOLD, DESCENT = 'approach', 'hold', 'descent'
STALE = 1.5  # s: age at which a forecast is not believed any more
EARLIEST = -0.5  # s: nor one that is newer than the aircraft's position by more
COMMITTED = 0.4  # s before touchdown: no new plan, but down to the deck as it moves
MISSED = 1.0  # s after the planned touchdown: time for another plan
NEAREST, FARTHEST, STEP = 1.5, 9.5, 0.1  # s ahead: times at which a touchdown may be planned
LEEWAY = 1.0  # s by which a new plan may differ from the one before
LAST_ABORT = 1.0  # m over the deck, below which it goes down in any case
NEAR_HOLD = 1.5  # m off the height of the hold that still are it
EARLY, MOST_CLOSING = 0.1, 0.25  # m above the deck before the end; m/s


@dataclass(frozen=True, slots=True)
class GuidanceConfig:
    """Parameters of the guidance."""

    method: str = parameter(
        'forecast', 'forecast: touch down when the deck will move with the aircraft; plain: '
        'descend as soon as the aircraft is above the deck', choices=('forecast', 'plain'))
    approach_speed: float = parameter(2.5, 'Horizontal speed at most', 'm/s', 0.1, 30.0)
    climb_speed: float = parameter(1.5, 'Vertical speed at most', 'm/s', 0.1, 10.0)
    horizontal_gain: float = parameter(
        0.6, 'Horizontal speed for each metre off the platform', '1/s', 0.01, 5.0)
    vertical_gain: float = parameter(
        0.2, 'Vertical speed for each metre off the hold: low, not to follow the waves', '1/s',
        0.01, 5.0)
    hold_height: float = parameter(
        4.0, 'Height of the hold over the deck', 'm', 0.5, 100.0)
    hold_radius: float = parameter(
        0.7, 'Horizontal distance within which the aircraft is above the deck', 'm', 0.05, 50.0)
    settle_time: float = parameter(
        3.0, 'How long it stays there before it descends', 's', 0.0, 600.0)
    descent_speed: float = parameter(
        0.7, 'Rate of descent, of method plain or without a forecast', 'm/s', 0.05, 5.0)
    slowest_descent: float = parameter(0.3, 'Least planned rate of descent', 'm/s', 0.0, 5.0)
    fastest_descent: float = parameter(1.6, 'Largest planned rate of descent', 'm/s', 0.1, 10.0)
    touchdown_speed: float = parameter(
        0.3, 'Wanted speed of aircraft and deck towards one another', 'm/s', 0.05, 5.0)
    tolerance: float = parameter(
        0.15, 'How far the planned speed may be from that at first; grows by as much each '
        'patience', 'm/s', 0.0, 5.0)
    abort_speed: float = parameter(
        1.2, 'Planned speed from which on it goes back to the hold', 'm/s', 0.1, 10.0)
    patience: float = parameter(
        20.0, 'How long it waits for touchdown/window to allow a landing', 's', 0.0, 3600.0)
    response_time: float = parameter(
        0.4, 'Time constant with which the aircraft takes a velocity', 's', 0.0, 10.0)
    contact_height: float = parameter(
        0.0, 'Height of the aircraft over deck when it touches it', 'm', -10.0, 10.0)
    forecast_sd: float = parameter(
        1.5, 'Sd of touchdown/prediction in z from which on forecasts are not used', 'm',
        0.01, 100.0)
    command_rate: float = parameter(10.0, 'Commands per second of stamp time', 'Hz', 0.1, 200.0)
    deck_frame: str = parameter('deck', 'Axes of the ship, origin on the landing platform')
    uav_deck_frame: str = parameter('uav_deck', 'At the aircraft, parallel to deck')
    ship_level_frame: str = parameter('ship_level', 'Level frame of the forecasts')


@dataclass(frozen=True, slots=True)
class Command:
    """
    What the aircraft shall do.

    Attributes
    ----------
    stamp : int
        Nanoseconds.
    velocity : tuple of 3 float
        Relative to the ship's mean motion, in ``deck`` (m/s).
    phase : str
        ``approach``, ``hold`` or ``descent``.
    touchdown_in : float
        Seconds until the planned touchdown; infinite where none is planned.

    """

    stamp: int
    velocity: Vector3
    phase: str
    touchdown_in: float


class DeckAhead:
    """
    What a forecast says of the deck, seen from a later stamp.

    Parameters
    ----------
    forecast : DeckForecast

    """

    def __init__(self, forecast: DeckForecast) -> None:
        self._stamp = forecast.stamp
        self._height = CubicHermiteSpline(
            forecast.times, forecast.position[:, 2], forecast.velocity[:, 2])
        self._rate = self._height.derivative()

    def age(self, stamp: int) -> float:
        """Return how old the forecast is at ``stamp`` (s)."""
        return seconds(stamp - self._stamp)

    def at(self, stamp: int, ahead: Array) -> tuple[Array, Array]:
        """Return height (m) and rate (m/s) of the deck ``ahead`` (s) of ``stamp``."""
        times = ahead + self.age(stamp)
        return self._height(times), self._rate(times)


@dataclass(frozen=True, slots=True)
class Plan:
    """A touchdown: when (s ahead), rate of descent and closing speed there (m/s)."""

    time: float
    descent: float
    closing: float


class Guidance:
    """
    Positions over the deck and forecasts in, velocity commands out.

    The axes of ``deck`` count as level: what roll and pitch turn a command by is for the feedback.

    Parameters
    ----------
    config : GuidanceConfig

    Attributes
    ----------
    phase : str
        ``approach``, ``hold`` or ``descent``.
    aborts : int
        Descents that were broken off.
    restarts : int
        How often the clock was found to have been set anew.

    """

    def __init__(self, config: GuidanceConfig) -> None:
        self.config = config
        self.aborts = self.restarts = 0
        self._start()

    def _start(self) -> None:
        self._gate = StampGate()
        self._schedule = OutputSchedule(self.config.command_rate)
        self.phase = APPROACH
        self._deck: DeckAhead | None = None
        self._window: LandingWindow | None = None
        self._prediction_sd = 0.0
        self._above_since: int | None = None  # the aircraft is over the deck
        self._plan: Plan | None = None
        self._planned_at = 0

    def update(self, topic: str,
               sample: OdometrySample | DeckForecast | LandingWindow) -> list[Command]:
        """
        Use one sample of ``landing/odometry`` or ``touchdown/*``.

        Returns
        -------
        list of Command
            One for ``landing/odometry``, at most ``command_rate`` times a second.

        Raises
        ------
        Rejected
            If the sample's stamp or content cannot be used.

        """
        if isinstance(sample, DeckForecast):
            if len(sample.times) < 2 or not np.all(np.diff(sample.times) > 0):
                raise Rejected('no forecast')
            self._deck = DeckAhead(sample)
        elif isinstance(sample, LandingWindow):
            self._window = sample
        elif topic == 'touchdown/prediction':
            self._prediction_sd = sqrt(max(sample.pose_var[2], 0.0))
        else:
            if self._gate.admit(sample.stamp):
                self.restarts += 1
                self._start()
                self._gate.admit(sample.stamp)
            if self._schedule.is_due(sample.stamp):
                self._schedule.take(sample.stamp)
                return [self._command(sample)]
        return []

    def _command(self, sample: OdometrySample) -> Command:
        config, stamp, (x, y, over) = self.config, sample.stamp, sample.position
        away = hypot(x, y)
        self._change_phase(sample, away)
        along = min(config.horizontal_gain, config.approach_speed / max(away, 1e-9))
        if self.phase == DESCENT:
            up = -(self._plan.descent if self._plan else config.descent_speed)
        else:
            error = config.hold_height - over
            up = max(-config.climb_speed, min(config.climb_speed, config.vertical_gain * error))
        touchdown_in = self._plan.time - seconds(stamp - self._planned_at) if self._plan else inf
        return Command(stamp, (-along * x, -along * y, up), self.phase, touchdown_in)

    def _change_phase(self, sample: OdometrySample, away: float) -> None:
        """Go on to the next phase when it is time, or back, and renew the plan."""
        config, stamp = self.config, sample.stamp
        over = sample.position[2]
        if self.phase != DESCENT:
            near = away < config.hold_radius and abs(over - config.hold_height) < NEAR_HOLD
            if not near and self.phase == APPROACH:
                return
            self.phase = HOLD
            self._above_since = stamp if self._above_since is None else self._above_since
            held = seconds(stamp - self._above_since)
            if near and held >= config.settle_time and self._may_descend(sample, held):
                self.phase = DESCENT
        elif self._plan is not None:
            remaining = self._plan.time - seconds(stamp - self._planned_at)
            if COMMITTED > remaining > -MISSED:
                self._plan = replace(self._plan, descent=self._settling(stamp))
                return
            plan = (self._best(sample, max(COMMITTED, remaining - LEEWAY), remaining + LEEWAY)
                    or self._best(sample, COMMITTED, FARTHEST))
            if plan is not None and plan.closing <= config.abort_speed:
                self._plan, self._planned_at = plan, stamp
            elif over > LAST_ABORT:
                self.phase, self._plan, self._above_since = HOLD, None, stamp
                self.aborts += 1

    def _fresh(self, stamp: int) -> DeckAhead | None:
        """Return the forecast, if it is of this time."""
        deck = self._deck
        return deck if deck is not None and EARLIEST <= deck.age(stamp) <= STALE else None

    def _settling(self, stamp: int) -> float:
        """Return the rate of descent that closes as wanted with the deck as it moves now."""
        config = self.config
        deck = self._fresh(stamp)
        if deck is None:
            return config.descent_speed
        _, rate = deck.at(stamp, np.array([config.response_time]))
        return config.touchdown_speed - float(rate[0])

    def _may_descend(self, sample: OdometrySample, held: float) -> bool:
        """Look for a time to touch down at; say whether to begin."""
        config = self.config
        self._plan = None
        if (config.method == 'plain' or self._fresh(sample.stamp) is None
                or self._prediction_sd > config.forecast_sd):
            return True
        plan = self._best(sample, NEAREST, FARTHEST)
        share = 1 + held / config.patience
        if plan is None or abs(plan.closing - config.touchdown_speed) > config.tolerance * share:
            return False
        window = self._window
        if window is not None and held < config.patience and window.state != GO and not (
                window.state == WAIT and window.seconds <= plan.time):
            return False
        self._plan, self._planned_at = plan, sample.stamp
        return True

    def _best(self, sample: OdometrySample, nearest: float, farthest: float) -> Plan | None:
        """Find the touchdown between two times ahead (s) whose speed is nearest to the wanted."""
        config, deck = self.config, self._fresh(sample.stamp)
        if deck is None or farthest <= nearest:
            return None
        ahead = np.linspace(0.0, STEP * (count := ceil(farthest / STEP)), count + 1)
        height, rate = deck.at(sample.stamp, ahead)
        over = sample.position[2] - config.contact_height + height[0]
        climbing = sample.linear_velocity[2] + rate[0]
        # a step of the commanded velocity is taken with a lag: after t, t - slow counts as taken
        slow = config.response_time * (1 - np.exp(-ahead / config.response_time))
        start = ceil(nearest / STEP)
        drop = over - height[start:] + climbing * slow[start:]
        descent = drop / (ahead[start:] - slow[start:])
        closing = descent + rate[start:]
        gap = (over + climbing * slow - height)[None] - descent[:, None] * (ahead - slow)[None]
        early = (gap < EARLY) & (ahead[None] < ahead[start:, None] - EARLY / MOST_CLOSING)
        good = (descent >= config.slowest_descent) & (descent <= config.fastest_descent) & (
            ~early.any(axis=1))
        if not good.any():
            return None
        cost = np.where(good, np.abs(closing - config.touchdown_speed), inf)
        k = int(np.argmin(cost))
        return Plan(float(ahead[start + k]), float(descent[k]), float(closing[k]))

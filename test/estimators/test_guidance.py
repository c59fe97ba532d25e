"""Guidance: its phases, its plans against a deck that moves as told, bad input."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

from deck_motion_ros.estimators.guidance import Guidance, GuidanceConfig
from deck_motion_ros.samples import (
    DeckForecast,
    LandingWindow,
    NANOSECONDS,
    nanoseconds,
    OdometrySample,
    Rejected,
)

ZERO = (0.0, 0.0, 0.0)
TIMES = np.linspace(0.5, 10.0, 20)
PERIOD, SIZE = 9.0, 1.2  # s, m: of the deck's motion in these tests


def odometry(time, position, velocity=ZERO, z_var=0.0):
    return OdometrySample(nanoseconds(time), 'deck', 'uav_deck', position, (0.0, 0.0, 0.0, 1.0),
                          velocity, ZERO, (0.0, 0.0, z_var, 0.0, 0.0, 0.0))


def deck(time):
    angle = 2 * pi * np.asarray(time) / PERIOD
    return SIZE * np.sin(angle), SIZE * 2 * pi / PERIOD * np.cos(angle)


def forecast(time):
    height, rate = deck(time + TIMES)
    position, velocity = np.zeros((2, len(TIMES), 3))
    position[:, 2], velocity[:, 2] = height, rate
    return DeckForecast(nanoseconds(time), 'ship_level', TIMES, position, velocity)


def window(time, state, seconds=5.0):
    return LandingWindow(nanoseconds(time), state, seconds, 0.9, 1.0, 0.1, 4.0, 0.1)


def flown(guidance, start, told=True, response=0.4, state=None):
    """Fly to touchdown over the sine; return closing speed, time and phases."""
    place, velocity, phases = list(start), [0.0] * 3, []
    for k in range(3000):
        time = k * 0.05
        height, rate = (float(value) for value in deck(time))
        over = place[2] - height
        if over <= 0:
            return rate - velocity[2], time, phases
        if told and k % 4 == 0:
            guidance.update('touchdown/forecast', forecast(time))
        if state and k % 10 == 0:
            guidance.update('touchdown/window', window(time, state))
        for order in guidance.update('landing/odometry', odometry(
                time, (place[0], place[1], over), (*velocity[:2], velocity[2] - rate))):
            wanted, phases = order.velocity, [*phases, order.phase]
        velocity = [v + (w - v) * 0.05 / response
                    for v, w in zip(velocity, wanted, strict=True)]
        place = [p + 0.05 * v for p, v in zip(place, velocity, strict=True)]
    pytest.fail('it never touched down')


def test_phases_follow_one_another():
    _, _, phases = flown(Guidance(GuidanceConfig()), (10.0, 20.0, 15.0))
    changes = [phase for k, phase in enumerate(phases) if k == 0 or phase != phases[k - 1]]
    assert changes == ['approach', 'hold', 'descent']


@pytest.mark.parametrize('delay', [0.0, 1.5, 3.0, 4.5, 6.0, 7.5])
def test_with_a_true_forecast_it_closes_as_slowly_as_wanted(delay):
    config = GuidanceConfig(settle_time=delay)
    closing, _, _ = flown(Guidance(config), (0.0, 0.0, 4.0))
    assert closing == pytest.approx(config.touchdown_speed, abs=0.25)


def test_without_it_chance_decides():
    closing = [flown(Guidance(GuidanceConfig(method='plain', settle_time=delay)), (0.0, 0.0, 4.0),
                     told=False)[0] for delay in np.arange(0.0, 9.0, 1.5)]
    assert max(closing) > 1.2
    assert [flown(Guidance(GuidanceConfig(settle_time=delay)), (0.0, 0.0, 4.0), told=False)[0]
            for delay in np.arange(0.0, 9.0, 1.5)] == closing  # nothing was told


def test_speed_limits_and_direction_of_the_approach():
    guidance = Guidance(GuidanceConfig())
    order, = guidance.update('landing/odometry', odometry(1.0, (30.0, -40.0, 15.0)))
    assert order.velocity == pytest.approx((-1.5, 2.0, -1.5))
    assert order.phase == 'approach'
    assert order.touchdown_in == inf


def test_commands_come_at_their_rate():
    guidance = Guidance(GuidanceConfig(command_rate=5.0))
    orders = [order for k in range(101) for order in guidance.update(
        'landing/odometry', odometry(k * 0.01, (0.0, 0.0, 4.0)))]
    assert len(orders) == 6
    assert np.diff([order.stamp for order in orders]) == pytest.approx(
        NANOSECONDS / 5, rel=0.11)


def test_it_waits_for_the_window_and_loses_patience():
    quick = Guidance(GuidanceConfig(patience=30.0))
    slow = Guidance(GuidanceConfig(patience=30.0))
    _, go, _ = flown(quick, (0.0, 0.0, 4.0), state='go')
    _, no_go, _ = flown(slow, (0.0, 0.0, 4.0), state='no_go')
    assert go < 25
    assert 30 < no_go < 60


def test_a_forecast_that_is_stale_or_too_vague_is_not_used():
    for spoil, issued in (('stale', 0.0), ('vague', 9.9), ('of another clock', 3610.0)):
        guidance = Guidance(GuidanceConfig(settle_time=0.0))
        guidance.update('touchdown/forecast', forecast(issued))
        if spoil == 'vague':
            guidance.update('touchdown/prediction', odometry(12.9, ZERO, z_var=9.0))
        guidance.update('landing/odometry', odometry(10.0, (0.0, 0.0, 4.0)))
        order, = guidance.update('landing/odometry', odometry(10.2, (0.0, 0.0, 4.0)))
        assert (order.phase, order.touchdown_in) == ('descent', inf)
        assert order.velocity[2] == -GuidanceConfig().descent_speed


def test_it_goes_back_when_the_deck_comes_up():
    guidance = Guidance(GuidanceConfig(settle_time=0.0))
    flat = forecast(0.0)
    still = DeckForecast(0, 'ship_level', TIMES, 0 * flat.position, 0 * flat.velocity)
    guidance.update('touchdown/forecast', still)
    orders = [order for k in range(10) for order in guidance.update(
        'landing/odometry', odometry(k * 0.1, (0.0, 0.0, 4.0 - 0.03 * k), (0.0, 0.0, -0.3)))]
    assert orders[-1].phase == 'descent'
    rising = np.zeros((len(TIMES), 3))
    rising[:, 2] = 1.6
    guidance.update('touchdown/forecast', DeckForecast(
        nanoseconds(1.0), 'ship_level', TIMES, rising * TIMES[:, None], rising))
    order, = guidance.update('landing/odometry', odometry(1.1, (0.0, 0.0, 3.6), (0, 0, -1.9)))
    assert order.phase == 'hold'
    assert order.velocity[2] > 0
    assert guidance.aborts == 1


def test_a_touchdown_that_was_missed_is_planned_anew():
    guidance = Guidance(GuidanceConfig(settle_time=0.0))
    still = DeckForecast(0, 'ship_level', TIMES, np.zeros((20, 3)), np.zeros((20, 3)))
    phases = []
    for k in range(160):  # the aircraft does not come down
        time = 0.1 * k
        guidance.update('touchdown/forecast', replace(still, stamp=nanoseconds(time)))
        order, = guidance.update('landing/odometry', odometry(time, (0.0, 0.0, 3.5)))
        phases.append((order.phase, order.touchdown_in))
    assert {phase for phase, _ in phases[1:]} <= {'hold', 'descent'}
    assert phases[-1][1] > -1.1


def test_bad_input():
    guidance = Guidance(GuidanceConfig())
    good = forecast(0.0)
    for times in (TIMES[:1], TIMES[::-1]):
        with pytest.raises(Rejected, match='no forecast'):
            guidance.update('touchdown/forecast', replace(
                good, times=times, position=good.position[:len(times)],
                velocity=good.velocity[:len(times)]))
    guidance.update('landing/odometry', odometry(10.0, (0.0, 0.0, 4.0)))
    with pytest.raises(Rejected, match='older stamp'):
        guidance.update('landing/odometry', odometry(9.0, (0.0, 0.0, 4.0)))
    for k in range(9):
        try:
            guidance.update('landing/odometry', odometry(5.0 + 0.1 * k, (0.0, 0.0, 4.0)))
        except Rejected:
            pass
    assert guidance.restarts == 0
    for k in range(9, 12):
        guidance.update('landing/odometry', odometry(5.0 + 0.1 * k, (0.0, 0.0, 4.0)))
    assert guidance.restarts == 1

"""Landings in closed loop over a real forecast, few of them."""

from dataclasses import replace

import numpy as np
import pytest

from deck_motion_ros.estimators.guidance import GuidanceConfig
from deck_motion_ros.evaluation.guidance import (
    Aircraft,
    CASES,
    deck_record,
    draw,
    land,
    landings,
    METHODS,
    rows,
)


@pytest.fixture(scope='module')
def record():
    return deck_record(replace(CASES[0], duration=420.0, waves=200), output_rate=5.0)


@pytest.fixture(scope='module')
def flown(record):
    return {'destroyer_ss5': {name: landings(record, config, 8, 1, settle=100.0)
                              for name, config in METHODS.items()}}


def test_a_forecast_halves_the_speed_of_touchdown(flown):
    figures = {row.name: row.value for row in rows(flown)}
    assert figures['destroyer_ss5_closing_to_plain'] < 0.6
    assert figures['destroyer_ss5_forecast_not_down'] == 0
    assert figures['destroyer_ss5_forecast_horizontal_median'] < 1.0
    assert figures['destroyer_ss5_forecast_hold_median'] >= GuidanceConfig().settle_time


def test_same_seed_same_landing(record):
    one, other, third = (land(record, 150.0, GuidanceConfig(), Aircraft(),
                              np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == other != third


def test_in_a_calm_without_gusts_it_lands_softly_in_the_middle(record):
    calm = replace(record, position=0 * record.position, velocity=0 * record.velocity, said=[])
    landing = land(calm, 10.0, GuidanceConfig(method='plain', descent_speed=0.4),
                   Aircraft(gust_sd=0.0, error_sd=(0.0,) * 3, rate_error_sd=0.0),
                   np.random.default_rng(1))
    assert landing.closing == pytest.approx(0.4, abs=0.01)
    assert landing.horizontal < 0.05
    assert landing.aborts == 0


def test_picture(flown, tmp_path):
    draw(flown, tmp_path / 'landing.png')
    assert (tmp_path / 'landing.png').read_bytes().startswith(b'\x89PNG')

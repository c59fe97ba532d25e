"""The strapdown navigator against python-ins and against the truth."""

from math import radians

import numpy as np
import pandas as pd
from pyins import strapdown, transform
import pytest

from deck_motion_ros.earth import Earth
from deck_motion_ros.estimators.strapdown import advanced, Increments
from deck_motion_ros.geometry import rotation_vectors
from deck_motion_ros.simulation.catapult import (
    ARCMIN,
    CatapultSensors,
    CatapultSimulatorConfig,
)

TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
TO_FRD = np.diag([1.0, -1.0, -1.0])
EXACT = dict.fromkeys(('slave_accel_bias_sd_ug', 'slave_gyro_drift_sd_deg_h',
                       'slave_accel_white_sd', 'slave_gyro_white_sd'), 0.0)


@pytest.fixture(scope='module', params=[100.0, 400.0])
def launch(request):
    """Ten seconds on a rolling ship, the last three of them on the catapult."""
    config = CatapultSimulatorConfig(
        deck='steady', deck_roll_deg=3.0, hold=7.0, rate=request.param,
        lever_arm=(20.0, 5.0, 3.0), misalignment_arcmin=(0.0, 0.0, 0.0), **EXACT)
    sensors = CatapultSensors(config, np.random.default_rng(1))
    data = sensors.measure(0, round(10 * config.rate) + 1)
    dt = 1 / config.rate
    increments = [Increments(rate * dt, force * dt) for rate, force in zip(
        data.slave_rate[:, 0], data.slave_force[:, 0], strict=True)]
    there = sensors.launch.reference(data.times)
    return dt, increments, data.times, there.mat, sensors.launch.velocity(there)


def navigated(launch):
    dt, increments, _, mats, velocities = launch
    mat, velocity, earth = mats[0], velocities[0], Earth(radians(40.0))
    for before, now in zip(increments, increments[1:], strict=False):
        mat, velocity = advanced(mat, velocity, now, before, dt, earth)
    return mat, velocity


def test_it_follows_the_truth(launch):
    mat, velocity = navigated(launch)
    _, _, _, mats, velocities = launch
    assert np.max(np.abs(rotation_vectors(mat @ mats[-1].T))) < 1e-3 * ARCMIN
    np.testing.assert_allclose(velocity, velocities[-1], atol=1e-4)


def test_it_agrees_with_python_ins(launch):
    mat, velocity = navigated(launch)
    _, increments, times, mats, velocities = launch
    north, east, down = TO_NED @ velocities[0]
    roll, pitch, heading = transform.mat_to_rph(TO_NED @ mats[0] @ TO_FRD)
    peer = strapdown.Integrator(pd.Series({
        'lat': 40.0, 'lon': -63.0, 'alt': 0.0, 'VN': north, 'VE': east, 'VD': down,
        'roll': roll, 'pitch': pitch, 'heading': heading}))
    table = np.hstack([np.array([item.turn for item in increments]) @ TO_FRD,
                       np.array([item.push for item in increments]) @ TO_FRD])
    imu = pd.DataFrame(table, index=times, columns=[
        'gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'])
    peer.integrate(strapdown.compute_increments_from_imu(imu, 'increment'))
    end = peer.get_pva()
    theirs = TO_NED.T @ transform.mat_from_rph(end[['roll', 'pitch', 'heading']]) @ TO_FRD
    assert np.max(np.abs(rotation_vectors(mat @ theirs.T))) < 1e-3 * ARCMIN
    np.testing.assert_allclose(TO_NED @ velocity, end[['VN', 'VE', 'VD']].astype(float),
                               atol=1e-5)


def test_many_runs_at_once_are_each_alone():
    rng, earth = np.random.default_rng(2), Earth(0.7)
    mats = np.tile(np.eye(3), (4, 1, 1))
    velocity, turn, push, old = rng.normal(size=(4, 4, 3)) * np.array(
        [10.0, 0.01, 0.1, 0.01])[:, None, None]
    now, before = Increments(turn, push), Increments(old, push)
    mat, new = advanced(mats, velocity, now, before, 0.01, earth)
    for k in range(4):
        alone = advanced(mats[k], velocity[k], Increments(turn[k], push[k]),
                         Increments(old[k], push[k]), 0.01, earth)
        np.testing.assert_allclose(mat[k], alone[0], atol=1e-14)
        np.testing.assert_allclose(new[k], alone[1], atol=1e-14)

"""The turning Earth against another library and by hand."""

from math import radians

import numpy as np
from pyins import earth as pyins_earth
import pytest

from deck_motion_ros.earth import Earth


@pytest.mark.parametrize('latitude', [-60.0, 0.0, 40.0, 75.0])
def test_gravity_and_rates_are_those_of_pyins(latitude):
    here = Earth(radians(latitude))
    assert -here.gravity[2] == pytest.approx(pyins_earth.gravity(latitude, 0.0), rel=1e-8)
    north, _, down = pyins_earth.rate_n(latitude)
    np.testing.assert_allclose(here.rate, [0.0, north, -down], rtol=1e-6, atol=1e-18)
    meridian, normal, _ = pyins_earth.principal_radii(latitude, 0.0)
    np.testing.assert_allclose(
        here.transport_rate(np.array([50.0, -20.0, 3.0])),
        [20.0 / meridian, 50.0 / normal, 50.0 * np.tan(radians(latitude)) / normal], rtol=1e-9)


def test_velocities_of_many_runs_at_once():
    here, velocities = Earth(0.7), np.arange(12.0).reshape(2, 2, 3)
    np.testing.assert_array_equal(here.transport_rate(velocities)[1, 0],
                                  here.transport_rate(velocities[1, 0]))

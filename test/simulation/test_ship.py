"""The ship against limits, the paper's own differential equation, waveresponse and her records."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
import waveresponse

from deck_motion_ros.simulation.sea import (
    Bretschneider,
    dense_waves,
    GRAVITY,
    joined,
    random_waves,
    Waves,
    WaveSystem,
)
from deck_motion_ros.simulation.ship import (
    Course,
    HEAVE,
    Hull,
    HULLS,
    motion_lines,
    PITCH,
    ROLL,
    ShipInWaves,
    speed_up_at,
    SURGE,
    SWAY,
    transfer_functions,
    turn_at,
    YAW,
)

pytestmark = pytest.mark.filterwarnings('ignore::DeprecationWarning:waveresponse')
DESTROYER = HULLS['destroyer']
SEA = WaveSystem(Bretschneider(3.25, 9.7), np.radians(135))


def one_wave(omega, direction, phase=0.6):
    return Waves(np.ones(1), np.array([omega]), np.array([direction]), np.array([phase]))


def short_crested(count=600, seed=1):
    return random_waves(SEA, count, np.random.default_rng(seed))


@pytest.mark.parametrize('hull', list(HULLS.values()), ids=list(HULLS))
@pytest.mark.parametrize('direction, yaw, speed', [
    (0.4, 0.0, 0.0), (2.0, 0.7, 5.0), (-1.1, 2.5, 8.0), (pi, 0.0, 8.0)])
def test_ship_lies_on_a_long_wave_like_a_raft(hull, direction, yaw, speed):
    waves = one_wave(2 * pi / 120, direction)  # 22 km long
    times = np.linspace(0, 120, 200)
    motion = ShipInWaves(hull, waves, Course(yaw, speed)).motion(times)
    bow = np.array([cos(yaw), sin(yaw)])
    port = np.array([-sin(yaw), cos(yaw)])

    def slope(along):
        position = motion.track.position
        return (waves.elevation(times, position + along)
                - waves.elevation(times, position - along)) / 2

    steepest = waves.omega[0]**2 / GRAVITY
    value = motion.value
    np.testing.assert_allclose(
        value[:, HEAVE], waves.elevation(times, motion.track.position), atol=0.03)
    np.testing.assert_allclose(value[:, PITCH], -slope(bow), atol=0.05 * steepest)
    np.testing.assert_allclose(value[:, ROLL], slope(port), atol=0.08 * steepest)


@pytest.mark.parametrize('direction', [0.3, 1.7, -2.5])
def test_ship_goes_with_the_water_of_a_long_wave(direction):
    # under a crest the water moves the way the wave travels, as fast as the surface rises a
    # quarter of a period before
    waves = one_wave(2 * pi / 60, direction, phase=0.0)
    motion = ShipInWaves(DESTROYER, waves, Course(0.0, 0.0)).motion(np.array([0.0]))
    towards = waves.omega[0] * np.array([cos(direction), sin(direction)])
    np.testing.assert_allclose(motion.rate[0, [SURGE, SWAY]], towards, atol=0.03 * waves.omega[0])


def test_yaw_turns_the_bow_with_the_water_ahead():
    waves = one_wave(2 * pi / 40, np.radians(60))
    times = np.linspace(0, 40, 100)
    there = ShipInWaves(DESTROYER, waves, Course(0.0, 0.0)).motion(times).value[:, YAW]
    # two small floats 5 m ahead and astern of the reference point drift apart sideways
    tiny = Hull(0.1, 0.1, 0.01, 1.0, 1.0, 0.5)
    sways = []
    for x in (5.0, -5.0):
        k = waves.omega[0]**2 / GRAVITY
        here = one_wave(waves.omega[0], waves.direction[0], 0.6 - k * cos(waves.direction[0]) * x)
        sways.append(ShipInWaves(tiny, here, Course(0.0, 0.0)).motion(times).value[:, SWAY])
    np.testing.assert_allclose(there, (sways[0] - sways[1]) / 10, atol=0.1 * np.abs(there).max())


@pytest.mark.parametrize('hull', list(HULLS.values()), ids=list(HULLS))
def test_ship_does_not_feel_short_waves(hull):
    heading = np.linspace(-pi, pi, 73)
    response = transfer_functions(hull, np.full(73, 4.0), heading, np.array(0.0))
    slope = 4.0**2 / GRAVITY
    assert np.abs(response[[SURGE, SWAY, HEAVE]]).max() < 0.1
    assert np.abs(response[[ROLL, PITCH, YAW]]).max() < 0.1 * slope


@pytest.mark.parametrize('omega, heading, speed', [
    (0.45, pi, 7.5), (0.7, pi, 0.0), (0.75, 2.4, 7.5), (0.9, 1.2, 4.0), (0.6, 0.3, 7.5),
    (1.1, 0.0, 14.0)])  # in the last one the ship overtakes the waves
def test_heave_and_pitch_solve_the_equation_of_jensen_2004(omega, heading, speed):
    hull, g = DESTROYER, GRAVITY
    k = omega**2 / g
    beam, draught = hull.beam * hull.block_coefficient, hull.draught
    alpha = 1 - speed / sqrt(g * hull.length) * sqrt(k * hull.length) * cos(heading)
    a = 2 * sin(omega**2 * beam * alpha**2 / (2 * g)) * exp(-omega**2 * draught * alpha**2 / g)
    f = sqrt((1 - k * draught)**2 + (a**2 / (k * beam * alpha**3))**2)
    k_e = abs(k * cos(heading))
    big_f = exp(-k * draught) * f * 2 / (k_e * hull.length) * sin(k_e * hull.length / 2)
    big_g = exp(-k * draught) * f * 24 / ((k_e * hull.length)**2 * hull.length) * (
        sin(k_e * hull.length / 2) - k_e * hull.length / 2 * cos(k_e * hull.length / 2))
    encounter = alpha * omega
    inertia, damping = 2 * k * draught / omega**2, a**2 / (k * beam * abs(alpha)**3 * omega)

    def equation(t, y):
        heave, heave_rate, pitch, pitch_rate = y
        return [heave_rate, (big_f * cos(encounter * t) - heave - damping * heave_rate) / inertia,
                pitch_rate, (big_g * sin(encounter * t) - pitch - damping * pitch_rate) / inertia]

    times = 400 + np.linspace(0, 2 * pi / abs(encounter), 50)
    solved = solve_ivp(equation, (0, times[-1]), np.zeros(4), t_eval=times, rtol=1e-9, atol=1e-11)
    one = np.array([omega]), np.array([heading]), np.array(speed)
    response = transfer_functions(hull, *one)[:, 0]
    turning = np.exp(1j * encounter * times)
    np.testing.assert_allclose((response[HEAVE] * turning).real, solved.y[0], atol=1e-3)
    bow_down = -np.sign(cos(heading)) * solved.y[2]  # their pitch: bow up in a following sea
    np.testing.assert_allclose((response[PITCH] * turning).real, bow_down, atol=1e-5)


@pytest.mark.parametrize('hull', list(HULLS.values()), ids=list(HULLS))
def test_roll_swings_up_at_its_own_period_and_lags_by_a_quarter(hull):
    omega = 2 * pi / hull.roll_period
    shift = np.array([0.5, 1.0, 1.5]) * omega
    roll = transfer_functions(hull, shift, np.full(3, pi / 2), np.array(0.0))[ROLL]
    slope = -1j * shift**2 / GRAVITY  # beam sea from starboard: the port side goes up after it
    quick = np.abs(roll / slope)
    assert quick[1] > quick[0] > quick[2]
    assert np.angle(roll[1] / slope[1]) == pytest.approx(-pi / 2, abs=1e-9)
    assert quick[1] < 1 / (2 * hull.roll_damping)


def test_port_and_starboard_are_mirror_images():
    omega, heading = np.meshgrid(np.linspace(0.2, 2, 20), np.linspace(0.1, 3, 20))
    port = transfer_functions(DESTROYER, omega, heading, np.array(7.0))
    starboard = transfer_functions(DESTROYER, omega, -heading, np.array(7.0))
    mirror = np.array([1, -1, 1, -1, 1, -1])[:, None, None]
    np.testing.assert_allclose(starboard, mirror * port, rtol=1e-12)


def test_waves_that_run_with_the_ship_are_harmless():
    omega = GRAVITY / 8.0 * np.array([1 - 1e-9, 1.0, 1 + 1e-9])  # encounter frequency 0
    response = transfer_functions(DESTROYER, omega, np.zeros(3), np.array(8.0))
    assert np.isfinite(response).all()
    np.testing.assert_allclose(response[:, 0], response[:, 2], rtol=1e-6, atol=1e-6)


def grids(hull, speed):
    """Return waveresponse's view of the sea and of the ship's roll, pitch and heave."""
    omega, heading = np.linspace(0.2, 3.0, 561), np.radians(np.arange(0, 360, 3.0))
    spectrum = waveresponse.WaveSpectrum.from_spectrum1d(
        omega, heading, Bretschneider(3.25, 9.7).density(omega),
        lambda _, angle: waveresponse.CosineHalfSpreading(1)(0.1, angle), np.radians(135),
        clockwise=False, waves_coming_from=False)
    both = np.meshgrid(omega, heading, indexing='ij')
    response = transfer_functions(hull, *both, np.array(speed))
    return spectrum, [waveresponse.RAO(omega, heading, response[axis], clockwise=False,
                                       waves_coming_from=False) for axis in (ROLL, PITCH, HEAVE)]


@pytest.mark.parametrize('hull', list(HULLS.values()), ids=list(HULLS))
def test_covariance_and_lever_arm_agree_with_waveresponse(hull):
    spectrum, raos = grids(hull, 7.5)
    cov = motion_lines(hull, dense_waves(SEA), 0.0, 7.5).covariance(np.zeros(1))[0]
    sds = [waveresponse.calculate_response(rao, spectrum, 0.0).std() for rao in raos]
    np.testing.assert_allclose(np.sqrt(np.diag(cov)), sds, rtol=0.01)
    for arm in ((-67.97, 3.05, 19.5), (50.0, -10.0, 5.0)):
        there = waveresponse.rigid_transform_heave(arm, raos[2], raos[0], raos[1])
        height = np.array([arm[1], -arm[0], 1.0])
        assert sqrt(height @ cov @ height) == pytest.approx(
            waveresponse.calculate_response(there, spectrum, 0.0).std(), rel=0.01)


def test_record_has_the_exact_covariances_at_every_lag():
    waves = short_crested(200)
    record = ShipInWaves(DESTROYER, waves, Course(0.2, 7.5)).motion(np.arange(24000) * 1.0)
    values = record.value[:, [ROLL, PITCH, HEAVE]]
    lags = np.array([0, 1, 3, 10])
    exact = motion_lines(DESTROYER, waves, 0.2, 7.5).covariance(lags * 1.0)
    scale = np.sqrt(np.outer(*2 * [np.diag(exact[0])]))
    for lag, expected in zip(lags, exact, strict=True):
        measured = values[lag:].T @ values[:len(values) - lag] / (len(values) - lag)
        np.testing.assert_allclose(measured / scale, expected / scale, atol=0.04)


def test_seas_have_the_ensembles_covariance_on_average():
    lags = np.array([0.0, 2.0, 7.0])
    exact = motion_lines(DESTROYER, dense_waves(SEA), 0.0, 7.5).covariance(lags)
    seas = [motion_lines(DESTROYER, short_crested(seed=seed), 0.0, 7.5).covariance(lags)
            for seed in range(20)]
    scale = np.sqrt(np.outer(*2 * [np.diag(exact[0])]))
    np.testing.assert_allclose(np.mean(seas, axis=0) / scale, exact / scale, atol=0.03)
    assert np.std([sea[0, HEAVE - 2, HEAVE - 2] for sea in seas]) < 0.3 * exact[0, 0, 0]


def test_covariance_is_one_of_a_stationary_process():
    lags = np.linspace(-30, 30, 61)
    cov = motion_lines(DESTROYER, short_crested(), 0.0, 7.5).covariance(lags)
    np.testing.assert_allclose(cov, cov[::-1].swapaxes(1, 2), atol=1e-12)
    big = np.block([[cov[30 + i - j] for j in range(20)] for i in range(20)])
    assert np.linalg.eigvalsh(big).min() > -1e-9
    assert abs(cov[25, 1, 2]) > 0.3 * sqrt(cov[30, 1, 1] * cov[30, 2, 2])  # pitch follows heave


def test_course_turns_as_told():
    course = Course(0.3, 6.0, (turn_at(100.0, pi / 2, np.radians(1.0)),
                               speed_up_at(150.0, 4.0, 0.05)))
    times = np.linspace(0, 600, 6001)
    track = course.at(times)
    assert track.yaw[0] == 0.3 and track.speed[0] == 6.0
    assert track.yaw[-1] == pytest.approx(0.3 + pi / 2) and track.speed[-1] == 10.0
    assert np.degrees(track.yaw_rate.max()) == pytest.approx(1.0, rel=1e-4)
    assert track.acceleration.max() == pytest.approx(0.05, rel=1e-4)
    lengths = np.linalg.norm(np.diff(track.position, axis=0), axis=1)
    assert lengths.sum() == pytest.approx(np.mean(track.speed) * 600, rel=1e-4)
    moved = np.gradient(track.position, times, axis=0)
    np.testing.assert_allclose(moved[1:-1], track.velocity[1:-1], atol=1e-3)
    np.testing.assert_allclose(
        np.gradient(track.yaw, times)[1:-1], track.yaw_rate[1:-1], atol=2e-5)


@pytest.mark.parametrize('changes', [
    (), (turn_at(20.0, -pi / 2, np.radians(3.0)),), (speed_up_at(10.0, -6.0, 0.1),),
    (turn_at(20.0, 2.0, np.radians(2.0)), speed_up_at(30.0, 5.0, 0.2))])
def test_motion_is_continuous_and_its_rate_its_derivative(changes):
    ship = ShipInWaves(DESTROYER, short_crested(120), Course(0.2, 7.5, changes))
    times = np.arange(0, 100, 0.02)
    motion = ship.motion(times)
    scale = motion.rate.std(axis=0)
    slope = np.gradient(motion.value, times, axis=0)
    assert np.abs((slope - motion.rate)[1:-1] / scale).max() < 1e-2
    assert np.abs(np.diff(motion.rate, axis=0) / scale).max() < 0.2


def test_turned_ship_moves_as_if_she_had_never_gone_another_course():
    waves = short_crested(300)
    turned = ShipInWaves(DESTROYER, waves, Course(0.0, 7.5, (turn_at(60.0, 1.2, 0.02),)))
    after = turned.motion(np.arange(200, 7400) / 1.0).value[:, [ROLL, PITCH, HEAVE]]
    exact = motion_lines(DESTROYER, waves, 1.2, 7.5).covariance(np.zeros(1))[0]
    before = motion_lines(DESTROYER, waves, 0.0, 7.5).covariance(np.zeros(1))[0]
    np.testing.assert_allclose(after.std(axis=0), np.sqrt(np.diag(exact)), rtol=0.06)
    assert not np.allclose(np.diag(exact), np.diag(before), rtol=0.3)  # else it shows nothing


def test_a_later_turn_does_not_touch_what_was_before():
    times = np.arange(0, 100, 0.5)
    straight, turning = (ShipInWaves(DESTROYER, short_crested(100), Course(0.5, 7.5, changes))
                         for changes in ((), (turn_at(100.0, 1.0, 0.02),)))
    np.testing.assert_allclose(turning.motion(times).value, straight.motion(times).value,
                               atol=1e-9)


def test_record_does_not_depend_on_how_it_is_asked_for():
    ship = ShipInWaves(DESTROYER, short_crested(100), Course(
        0.5, 7.5, (turn_at(10.0, 1.0, 0.05), speed_up_at(60.0, 2.0, 0.2))))
    times = np.sort(np.random.default_rng(3).uniform(0, 120, 700))
    whole = ship.motion(times)
    single = [ship.motion(times[k:k + 1]) for k in range(len(times))]
    for name in ('value', 'rate'):
        np.testing.assert_allclose(
            getattr(whole, name), np.concatenate([getattr(one, name) for one in single]),
            atol=1e-9)


def test_the_sea_adds_up():
    rng = np.random.default_rng(4)
    parts = [random_waves(SEA, 50, rng), random_waves(WaveSystem(
        Bretschneider(2.0, 14.0), 0.0, 20.0), 50, rng)]
    times, course = np.arange(0, 60, 0.5), Course(0.1, 5.0)
    one, two, both = (ShipInWaves(DESTROYER, waves, course).motion(times).value
                      for waves in (*parts, joined(parts)))
    np.testing.assert_allclose(one + two, both, atol=1e-9)


@pytest.mark.parametrize('hull', list(HULLS.values()), ids=list(HULLS))
def test_motion_is_proportional_to_the_sea(hull):
    lines = [motion_lines(hull, dense_waves(WaveSystem(
        Bretschneider(height, 10.0), 2.0), 60, 12), 0.0, 5.0).covariance(np.zeros(1))[0]
        for height in (1.5, 3.0)]
    np.testing.assert_allclose(lines[1], 4 * lines[0], rtol=1e-9, atol=1e-12)

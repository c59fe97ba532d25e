"""Rotations and lever arms against scipy, hand-solvable cases and the paper's own matrix."""

from math import atan2, cos, degrees, pi, radians, sin, sqrt

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import waveresponse

from deck_motion_ros import geometry

ARM = (-67.97, 3.05, 19.5)
ANGLE = st.floats(-pi, pi)
PITCH = st.floats(-1.5, 1.5)
COORDINATE = st.floats(-300.0, 300.0)
VECTOR = st.tuples(COORDINATE, COORDINATE, COORDINATE)


def scipy_rotation(roll: float, pitch: float, yaw: float) -> Rotation:
    """Rz(yaw) Ry(pitch) Rx(roll), by scipy's intrinsic z, y, x."""
    return Rotation.from_euler('ZYX', [yaw, pitch, roll])


@given(ANGLE, PITCH, ANGLE)
def test_quaternion_is_scipys(roll, pitch, yaw):
    ours = np.array(geometry.quaternion_from_rpy(roll, pitch, yaw))
    theirs = scipy_rotation(roll, pitch, yaw).as_quat()
    assert min(abs(ours - theirs).max(), abs(ours + theirs).max()) < 1e-12


@given(ANGLE, PITCH, ANGLE)
def test_rpy_survive_the_way_through_a_quaternion(roll, pitch, yaw):
    back = geometry.rpy_from_quaternion(geometry.quaternion_from_rpy(roll, pitch, yaw))
    for angle, returned in zip((roll, pitch, yaw), back, strict=True):
        assert abs(geometry.wrapped(angle - returned)) < 1e-7


@pytest.mark.parametrize('pitch', [pi / 2, -pi / 2])
def test_at_the_pole_the_rotation_survives_although_its_angles_do_not(pitch):
    quaternion = geometry.quaternion_from_rpy(0.3, pitch, -0.8)
    back = geometry.quaternion_from_rpy(*geometry.rpy_from_quaternion(quaternion))
    lost = Rotation.from_quat(quaternion) * Rotation.from_quat(back).inv()
    assert lost.magnitude() < 1e-6


def test_signs_of_rep_103():
    """Roll lifts the port side, pitch lowers the bow, yaw turns the bow from east to north."""
    small = 0.01
    port = geometry.rotated(geometry.quaternion_from_rpy(small, 0, 0), (0.0, 1.0, 0.0))
    bow = geometry.rotated(geometry.quaternion_from_rpy(0, small, 0), (1.0, 0.0, 0.0))
    ahead = geometry.rotated(geometry.quaternion_from_rpy(0, 0, small), (1.0, 0.0, 0.0))
    assert port[2] == pytest.approx(sin(small))
    assert bow[2] == pytest.approx(-sin(small))
    assert ahead[1] == pytest.approx(sin(small))


@given(ANGLE, PITCH, ANGLE, ANGLE, PITCH, ANGLE, VECTOR)
def test_products_and_rotated_vectors_are_scipys(r1, p1, y1, r2, p2, y2, vec):
    a, b = (geometry.quaternion_from_rpy(*rpy) for rpy in ((r1, p1, y1), (r2, p2, y2)))
    both = scipy_rotation(r1, p1, y1) * scipy_rotation(r2, p2, y2)
    product = geometry.multiply(a, b)
    assert np.allclose(geometry.rotated(product, vec), both.apply(vec), atol=1e-9)
    assert np.allclose(geometry.rotated(geometry.conjugate(product), vec),
                       both.inv().apply(vec), atol=1e-9)
    assert np.allclose(geometry.matrix_from_rpy(r1, p1, y1) @ vec,
                       scipy_rotation(r1, p1, y1).apply(vec), atol=1e-9)


@given(ANGLE, PITCH, ANGLE)
def test_rotation_vector_is_scipys_whatever_the_quaternions_sign(roll, pitch, yaw):
    quaternion = geometry.quaternion_from_rpy(roll, pitch, yaw)
    theirs = scipy_rotation(roll, pitch, yaw)
    for sign in (1, -1):
        x, y, z, w = quaternion
        ours = geometry.rotation_vector((sign * x, sign * y, sign * z, sign * w))
        assert np.linalg.norm(ours) <= pi + 1e-12
        assert (Rotation.from_rotvec(ours) * theirs.inv()).magnitude() < 1e-7


@given(VECTOR)
def test_tiny_rotation_vectors_keep_their_digits(direction):
    tiny = np.array(direction) * 1e-12
    ours = geometry.rotation_vector(tuple(Rotation.from_rotvec(tiny).as_quat()))
    assert np.allclose(ours, tiny, rtol=1e-6, atol=1e-20)


@pytest.mark.parametrize('quaternion', [
    (0.0, 0.0, 0.0, 0.0), (float('nan'), 0.0, 0.0, 1.0), (float('inf'), 0.0, 0.0, 1.0)])
def test_what_is_no_rotation_has_no_normalised_form(quaternion):
    assert geometry.normalised(quaternion) is None


@given(ANGLE, PITCH, ANGLE, st.floats(0.1, 10.0))
def test_normalised_undoes_scaling(roll, pitch, yaw, scale):
    unit = geometry.quaternion_from_rpy(roll, pitch, yaw)
    x, y, z, w = unit
    assert geometry.normalised((scale * x, scale * y, scale * z, scale * w)) == pytest.approx(unit)


@given(ANGLE, PITCH, ANGLE, VECTOR)
def test_body_rates_are_the_derivative_of_the_rotation(roll, pitch, yaw, rates):
    rates = np.array(rates) / 300
    step = 1e-6
    before, after = (scipy_rotation(*(np.array([roll, pitch, yaw]) + sign * step / 2 * rates))
                     for sign in (-1, 1))
    numeric = (before.inv() * after).as_rotvec() / step  # in body axes
    ours = geometry.angular_velocity((roll, pitch, yaw), tuple(rates))
    assert np.allclose(ours, numeric, atol=1e-7)
    level = Rotation.from_euler('Z', yaw).inv() * scipy_rotation(roll, pitch, yaw)
    assert np.allclose(geometry.rate_axes(pitch) @ rates, level.apply(ours), atol=1e-9)


@given(ANGLE, PITCH, ANGLE, st.tuples(ANGLE, PITCH, ANGLE))
def test_a_mounted_sensor_gives_the_bodys_attitude(roll, pitch, yaw, mount_rpy):
    """The sensor's axes seen by the world: the body's, then its mounting in the body."""
    sensor = scipy_rotation(roll, pitch, yaw) * scipy_rotation(*mount_rpy)
    body = geometry.attitude_of_mounted(tuple(sensor.as_quat()), mount_rpy)
    assert (Rotation.from_quat(body) * scipy_rotation(roll, pitch, yaw).inv()).magnitude() < 1e-7


def test_a_sensor_facing_port_reads_the_ships_roll_as_its_pitch():
    """Port side up: the sensor's own bow (to port) rises, which is negative pitch."""
    sensor = geometry.quaternion_from_rpy(0.0, -0.1, pi / 2)
    body = geometry.attitude_of_mounted(sensor, (0.0, 0.0, pi / 2))
    assert geometry.rpy_from_quaternion(body) == pytest.approx((0.1, 0.0, 0.0))


@pytest.mark.parametrize('heading_deg, yaw_deg', [
    (0, 90), (90, 0), (180, -90), (270, 180), (359, 91), (45, 45), (-90, 180), (450, 0)])
def test_compass_headings(heading_deg, yaw_deg):
    assert geometry.yaw_from_heading(radians(heading_deg)) == pytest.approx(radians(yaw_deg))


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles(angle):
    wrapped = geometry.wrapped(angle)
    assert -pi - 1e-9 < wrapped <= pi
    assert cos(wrapped) == pytest.approx(cos(angle), abs=1e-9)
    assert sin(wrapped) == pytest.approx(sin(angle), abs=1e-9)


@pytest.mark.parametrize('bow_up_deg, roll_deg, heave, height', [
    (1.0, 2.0, 0.5, -0.594660), (1.05, 6.0, 1.5, 0.463133), (1.05, 0.0, 0.0, -1.248820),
    (0.0, 6.0, 0.0, 0.211989), (0.0, 0.0, 0.0, 0.0)])
def test_reference_heights_of_li2014(bow_up_deg, roll_deg, heave, height):
    roll, pitch = radians(roll_deg), geometry.pitch_bow_down(radians(bow_up_deg))
    assert geometry.height_above_rest(roll, pitch, heave, ARM) == pytest.approx(height, abs=1e-6)
    vec, _, _ = geometry.turned_arm(np.array(roll), np.array(pitch), ARM)
    assert float(vec[2]) + heave - ARM[2] == pytest.approx(height, abs=1e-6)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), VECTOR)
def test_height_is_the_papers_matrix_in_the_papers_axes(roll, bow_up, paper_arm):
    """Rx(p) Ry(r) for axes starboard, forward, up; the row that gives z, heave outside."""
    paper = Rotation.from_euler('XY', [bow_up, roll]).apply(paper_arm)
    arm = geometry.from_starboard_forward_up(paper_arm)
    ours = geometry.height_above_rest(roll, geometry.pitch_bow_down(bow_up), 0.7, arm)
    assert ours == pytest.approx(paper[2] + 0.7 - paper_arm[2], abs=1e-9)


def test_equation_14_as_printed_is_another_height():
    """Its row is transposed: it turns the level axes into the ship's, not the other way."""
    starboard, forward, up = -3.05, -67.97, 19.5
    bow_up, roll = radians(1.05), radians(6.0)
    printed = Rotation.from_euler('XY', [bow_up, roll]).inv().apply([starboard, forward, up])[2]
    assert abs(printed - up - (0.463133 - 1.5)) > 0.005
    heave_turned = 1.5 * cos(bow_up) * cos(roll)
    assert abs(heave_turned - 1.5) > 0.005


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), VECTOR)
def test_turned_arm_and_its_derivatives(roll, pitch, arm):
    step = 1e-6

    def turned(roll: float, pitch: float) -> np.ndarray:
        return scipy_rotation(roll, pitch, 0.0).apply(arm)

    vec, by_roll, by_pitch = geometry.turned_arm(np.array([roll]), np.array([pitch]), arm)
    assert vec.shape == by_roll.shape == by_pitch.shape == (1, 3)
    assert np.allclose(vec[0], turned(roll, pitch), atol=1e-9)
    numeric = (turned(roll + step, pitch) - turned(roll - step, pitch)) / (2 * step)
    assert np.allclose(by_roll[0], numeric, atol=1e-6)
    numeric = (turned(roll, pitch + step) - turned(roll, pitch - step)) / (2 * step)
    assert np.allclose(by_pitch[0], numeric, atol=1e-6)


@pytest.mark.parametrize('arm', [ARM, (-35.0, 0.0, 6.0), (20.0, -8.0, 3.0)])
def test_small_motions_move_a_point_as_waveresponse_says(arm):
    """Its rigid-body transfer of RAOs (x forward, y port, z up; small angles)."""
    freq, dirs = np.array([0.5, 1.0]), np.array([0.0, 90.0])
    rng = np.random.default_rng(7)
    values = rng.normal(size=(3, 2, 2)) + 1j * rng.normal(size=(3, 2, 2))
    heave, roll, pitch = (waveresponse.RAO(freq, dirs, grid, degrees=True) for grid in values)
    theirs = waveresponse.rigid_transform_heave(np.array(arm), heave, roll, pitch).grid()[2]
    _, by_roll, by_pitch = geometry.turned_arm(np.array(0.0), np.array(0.0), arm)
    assert np.allclose(values[0] + by_roll[2] * values[1] + by_pitch[2] * values[2], theirs)


def test_a_rolling_ship_by_pencil():
    """A point 3 m to port and 4 m up lies on a circle of 5 m about the keel line."""
    start = atan2(4.0, 3.0)
    for roll_deg in (-90, -30, 0, 10, 53):
        height = geometry.height_above_rest(radians(roll_deg), 0.0, 0.0, (0.0, 3.0, 4.0))
        assert height == pytest.approx(5.0 * sin(start + radians(roll_deg)) - 4.0)
    assert degrees(start) == pytest.approx(53.1301, abs=1e-4)
    assert sqrt(3.0**2 + 4.0**2) == 5.0


def vectors(scale):
    return np.array([[0.0, 0.0, 0.0], [1.0, -2.0, 0.5], [0.0, 0.0, 1e-9]]) * scale


@pytest.mark.parametrize('scale', [1e-3, 1.0])
def test_rotation_matrices_are_scipys_alone_and_in_numbers(scale):
    many = vectors(scale)
    expected = Rotation.from_rotvec(many).as_matrix()
    np.testing.assert_allclose(geometry.rotation_matrix(many), expected, atol=1e-14)
    for vec, mat in zip(many, expected, strict=True):
        np.testing.assert_allclose(geometry.rotation_matrix(vec), mat, atol=1e-14)
    np.testing.assert_allclose(geometry.rotation_vectors(expected), many, atol=1e-14)


def test_a_slight_rotation_is_off_by_the_third_power():
    vec = np.array([2e-4, -1e-4, 2e-4])
    difference = geometry.slight_rotation(vec) - geometry.rotation_matrix(vec)
    assert np.max(np.abs(difference)) < 3e-4**3 / 6


def test_cross_products_are_numpys():
    a, b = np.random.default_rng(1).normal(size=(2, 4, 5, 3))
    np.testing.assert_allclose(geometry.cross(a, b), np.cross(a, b), atol=1e-14)
    np.testing.assert_allclose(geometry.transformed(geometry.skew(a[0, 0]), b[0, 0]),
                               np.cross(a[0, 0], b[0, 0]))


@pytest.mark.parametrize('vec', [(0.1, 0.2, 0.3), (3.0, 0.0, 0.0), (0.0, 3.1, 0.0),
                                 (0.0, 0.5, 3.0)])
def test_a_matrix_and_its_quaternion_turn_alike(vec):
    mat = geometry.rotation_matrix(np.array(vec))
    quaternion = geometry.quaternion_from_matrix(mat)
    np.testing.assert_allclose(geometry.matrix_from_quaternion(quaternion), mat, atol=1e-14)
    np.testing.assert_allclose(geometry.rotated(quaternion, (1.0, 2.0, 3.0)),
                               mat @ (1.0, 2.0, 3.0))

"""Recorded logs into bags: signs, stamps, what is left out and what is counted."""

import csv
import dataclasses
from functools import reduce
from math import degrees, radians
from operator import xor

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from ruamel.yaml import YAML

from deck_motion_ros import messages
from deck_motion_ros.config import configured
from deck_motion_ros.estimators.landing import LandingConfig
from deck_motion_ros.geometry import rpy_from_quaternion
from deck_motion_ros.importers import DRIVEN, import_file, ImportFailed
from deck_motion_ros.params_file import read_params_file
from deck_motion_ros.recording import BagReader
from deck_motion_ros.replaying import replay

SECOND = 1_000_000_000
FIRST_OF_AUGUST = 1_406_851_200  # 2014-08-01 00:00:00 UTC, from the calendar


def sentence(body):
    return f'${body}*{reduce(xor, body.encode(), 0):02X}'


def zda(time='000001.50', date='01,08,2014'):
    return sentence(f'INZDA,{time},{date},,')


def psxn(roll=1.0, pitch=2.0, heading=90.0, heave=0.5):
    return sentence(f'PSXN,23,{roll},{pitch},{heading},{heave}')


class Imported:
    """A file, imported and read again."""

    def __init__(self, source, bag):
        self.summary = import_file(source, bag)
        reader = BagReader(bag)
        self.topics = reader.topics
        self.log_times, self.imus, self.heaves, self.raw = [], [], [], []
        for topic, log_time, data in reader.messages():
            message = reader.decode(topic, data)
            self.raw.append((topic, message))
            self.log_times.append(log_time)
            if topic == '/ship/imu':
                self.imus.append(messages.imu_sample(message))
            elif topic == '/ship/heave':
                self.heaves.append(messages.heave_sample(message))

    @property
    def rpy(self):
        return np.array([rpy_from_quaternion(imu.orientation) for imu in self.imus])

    @property
    def skipped(self):
        return self.summary.skipped


@pytest.fixture
def imported(tmp_path):
    """Return a function that imports lines of text."""
    def from_lines(*lines, name='log.csv', end='\n'):
        source = tmp_path / name
        source.write_text(end.join(lines) + end, encoding='utf-8', newline='')
        return Imported(source, tmp_path / 'bag')
    return from_lines


# --- CSV

def test_csv_signs_units_and_stamps(imported):
    found = imported('t_s,roll_deg,pitch_deg,heave_m,heading_deg',
                     '0.17,2,3,-0.58,218.26', '1.17,-2,-3,0.4,0')
    assert [imu.stamp for imu in found.imus] == [170_000_000, 1_170_000_000]
    assert found.log_times == [170_000_000] * 2 + [1_170_000_000] * 2
    assert [topic for topic, _ in found.raw] == ['/ship/imu', '/ship/heave'] * 2
    assert np.degrees(found.rpy) == pytest.approx(np.array(
        [[2, -3, 90 - 218.26], [-2, 3, 90]]))  # pitch turns bow down, heading to ENU yaw
    assert [heave.height for heave in found.heaves] == [-0.58, 0.4]
    assert {imu.frame_id for imu in found.imus} == {'ship_base_link'}
    assert {heave.frame_id for heave in found.heaves} == {'ship_level'}


def test_attitude_sensor_does_not_claim_rates_and_force(imported):
    found = imported('t_s,roll_deg,pitch_deg', '0,1,2')
    assert found.topics == {'/ship/imu': 'sensor_msgs/msg/Imu'}
    message = found.raw[0][1]
    assert message.angular_velocity_covariance[0] == -1
    assert message.linear_acceleration_covariance[0] == -1
    assert not message.orientation_covariance.any()  # known attitude, unknown variance
    assert found.rpy[0, 2] == 0


def test_heave_alone(imported):
    found = imported('t_s,heave_m,north_m,west_m', '0,1.5,7,8', '0.781,-1,7,8')
    assert found.topics == {'/ship/heave': 'geometry_msgs/msg/PointStamped'}
    assert [heave.stamp for heave in found.heaves] == [0, 781_000_000]
    assert 'columns not used: north_m, west_m' in found.summary.notes


def test_layout_of_the_file_does_not_matter(imported):
    found = imported('\ufeff Heave_M , T_S ,note', '1.5, 3 ,"a, b"', '', '2.5,4,', end='\r\n')
    assert [(heave.stamp // SECOND, heave.height) for heave in found.heaves] == [
        (3, 1.5), (4, 2.5)]


@pytest.mark.parametrize(('header', 'choice', 'first'), [
    ('t_arrival_s,heave_m,t_s', '', 2), ('t_arrival_s,heave_m', '', 0),
    ('t_s,heave_m,t_arrival_s', 't_arrival_s', 2)])
def test_time_column_is_chosen(tmp_path, header, choice, first):
    source = tmp_path / 'log.csv'
    source.write_text(f'{header}\n0,1,2\n')
    import_file(source, tmp_path / 'bag', choice)
    assert next(BagReader(tmp_path / 'bag').messages())[1] == first * SECOND


def test_bad_rows_are_counted_with_their_first_line(imported):
    found = imported('t_s,roll_deg,pitch_deg,heave_m', '0,1,1,1', '1,,1,1', '2,nan,1,1',
                     '3,1,one,1', '4,1', 'inf,1,1,1', '1e99,1,1,1', '7,181,1,1', '8,1,-91,1',
                     '9,1,1,1')
    assert found.skipped == {'log.csv: not a usable number': (6, 3),
                             'angle out of range': (2, 9)}
    assert [imu.stamp // SECOND for imu in found.imus] == [0, 9]
    assert 'skipped 6: log.csv: not a usable number (first in line 3)' in str(found.summary)


def test_steps_back_are_kept_in_the_order_of_the_file(imported):
    found = imported('t_s,heave_m', '1,0.1', '2,0.2', '2,0.3', '1.5,0.4', '3,0.5')
    assert [heave.height for heave in found.heaves] == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert [heave.stamp / SECOND for heave in found.heaves] == [1, 2, 2, 1.5, 3]
    assert found.summary.backwards == 1


def test_times_before_zero_are_moved_by_whole_seconds(imported):
    found = imported('t_s,heave_m', '-1.25,1', '0.5,1')
    assert [heave.stamp for heave in found.heaves] == [750_000_000, 2_500_000_000]
    assert any(note.startswith('2 s added') for note in found.summary.notes)


@pytest.mark.parametrize(('header', 'needs'), [
    ('t_s,roll_deg,heave_m', 'needs heave_m, or roll_deg with pitch_deg; it has t_s, roll_deg'),
    ('t_s,surge_m', 'needs heave_m, or roll_deg with pitch_deg'),
    ('roll_deg,pitch_deg', 'needs the time column t_s'),
    ('anchor_id,x_m,y_m', 'needs the time column t_s')])
def test_missing_columns_are_named(imported, tmp_path, header, needs):
    with pytest.raises(ImportFailed, match=needs) as error:
        imported(header, '0,1,2')
    assert '\n' not in str(error.value)
    assert [path.name for path in tmp_path.iterdir()] == ['log.csv']


@pytest.mark.parametrize('content', [
    b'', b'\n\n', b'hello\n', b'1,2,3\n4,5,6\n', bytes(range(256)) * 20, b'{"roll": [1, 2]}\n'])
def test_foreign_files_are_refused(tmp_path, content):
    source = tmp_path / 'file'
    source.write_bytes(content)
    with pytest.raises(ImportFailed, match='neither CSV .* nor NMEA'):
        import_file(source, tmp_path / 'bag')
    assert [path.name for path in tmp_path.iterdir()] == ['file']


def test_file_without_a_usable_row_makes_no_bag(imported, tmp_path):
    with pytest.raises(ImportFailed, match='nothing to import .2 x log.csv: not a usable'):
        imported('t_s,heave_m', 'x,1', '1,x')
    assert not (tmp_path / 'bag').exists()


def test_existing_bag_is_left_alone(tmp_path):
    source = tmp_path / 'log.csv'
    source.write_text('t_s,heave_m\n0,1\n')
    (tmp_path / 'bag').mkdir()
    with pytest.raises(ValueError, match='exists'):
        import_file(source, tmp_path / 'bag')
    assert list((tmp_path / 'bag').iterdir()) == []


def test_absent_file_and_unwritable_folder(tmp_path):
    with pytest.raises(FileNotFoundError):
        import_file(tmp_path / 'nothing.csv', tmp_path / 'bag')
    source = tmp_path / 'log.csv'
    source.write_text('t_s,heave_m\n0,1\n')
    with pytest.raises(ValueError, match='cannot be made'):
        import_file(source, source / 'bag')


# --- NMEA

def test_psxn_signs_and_the_stamp_of_zda(imported):
    found = imported('2030-01-01T00:00:00Z ' + zda(), '2030-01-01T00:00:09Z ' + psxn(
        roll=1.5, pitch=2.5, heading=90, heave=0.5), name='log')
    stamp = FIRST_OF_AUGUST * SECOND + 1_500_000_000
    assert found.imus[0].stamp == found.heaves[0].stamp == found.log_times[0] == stamp
    assert np.degrees(found.rpy[0]) == pytest.approx([1.5, -2.5, 0])
    assert found.heaves[0].height == -0.5


@given(roll=st.floats(-60, 60), pitch=st.floats(-45, 45), heading=st.floats(0, 359.99),
       heave=st.floats(-20, 20))
def test_any_set_survives_the_way_through_a_bag(tmp_path_factory, roll, pitch, heading, heave):
    folder = tmp_path_factory.mktemp('nmea')
    (folder / 'log').write_text(f'{zda()}\n{psxn(roll, pitch, heading, heave)}\n')
    found = Imported(folder / 'log', folder / 'bag')
    turn = radians(90 - heading)
    assert found.rpy[0, :2] == pytest.approx([radians(roll), -radians(pitch)], abs=1e-9)
    assert np.exp(1j * found.rpy[0, 2]) == pytest.approx(np.exp(1j * turn), abs=1e-9)
    assert found.heaves[0].height == -heave


def test_sentences_that_cannot_be_used_are_counted_by_kind(imported):
    good = psxn()
    found = imported(
        'a line of the logger', good, zda(), good, good[:-2] + '00', good[:-3],
        zda('000002.50'), sentence('PSXN,23,1,2,3'), sentence('PSXN,23,x,2,3,4'),
        sentence('PSXN,23,,,,'), psxn(pitch=100), psxn(heave='nan'), sentence('PSXN,23,1,2,3,4'),
        sentence('PSXN,23,5,6,7,8'), zda('250000.00'), zda('', ',,'), sentence('GPGGA,1,2'),
        sentence('PSXN,22,1,2'), sentence('PSXN,22,1,2'), '!' + sentence('AIVDM,1')[1:],
        name='log')
    assert found.skipped == {
        'no sentence': (1, 1), 'PSXN before the first ZDA': (1, 2), 'wrong checksum': (1, 5),
        'no checksum': (1, 6), 'malformed PSXN': (3, 8), 'empty PSXN': (1, 10),
        'angle out of range': (1, 11), 'PSXN with the same time as the one before': (1, 14),
        'malformed INZDA': (2, 15)}
    assert found.summary.other_sentences == {'GPGGA': 1, 'PSXN,22': 2, 'AIVDM': 1}
    assert [imu.stamp % (60 * SECOND) / SECOND for imu in found.imus] == [1.5, 2.5]
    assert degrees(found.rpy[1, 0]) == pytest.approx(1)  # the first of two sets of one time


def test_heading_comes_from_hdt_where_psxn_has_none(imported):
    found = imported(zda(), sentence('GPHDT,80,T'), psxn(heading=''), name='log')
    assert degrees(found.rpy[0, 2]) == pytest.approx(10)


def test_axes_that_psxn_leaves_empty_stay_absent(imported):
    found = imported(zda(), psxn(roll='', pitch='', heading=''), zda('000003.00'),
                     psxn(heave=''), name='log')
    assert [heave.stamp % (60 * SECOND) // SECOND for heave in found.heaves] == [1]
    assert [imu.stamp % (60 * SECOND) // SECOND for imu in found.imus] == [3]


def test_attitude_declared_invalid_is_not_used(imported):
    found = imported(zda(), sentence('PSXN,20,1,0,0,2'), psxn(), zda('000003.00'),
                     sentence('PSXN,20,1,2,2,1'), psxn(), name='log')
    assert (len(found.heaves), len(found.imus)) == (2, 1)
    assert found.skipped == {'roll and pitch declared invalid by PSXN,20': (1, 3)}


def test_without_zda_the_arrival_counts(imported):
    found = imported('2014-08-01T00:00:02.2500Z ' + psxn(), psxn(),
                     '2014-08-01T00:00:03.25Z ' + psxn(), name='log')
    assert [imu.stamp - FIRST_OF_AUGUST * SECOND for imu in found.imus] == [
        2_250_000_000, 3_250_000_000]
    assert found.skipped == {'PSXN without a time': (1, 2)}


def test_nothing_tells_the_time(imported, tmp_path):
    with pytest.raises(ImportFailed, match='nothing to import .1 x PSXN without a time'):
        imported(psxn(), name='log')
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(('log', 'table', 'midnight', 'dropped'), [
    ('NBP1406_s330-2014-08-01', 'nbp_20140801_seapath330', FIRST_OF_AUGUST, 0),
    ('NBP1406_seap-2014-08-01', 'nbp_20140801_seapath200', FIRST_OF_AUGUST, 0),
    ('SKQ201822S_ins_seapath_position-2018-12-06', 'sikuliaq_20181206_seapath',
     1_544_054_400, 1)])
def test_raw_log_and_table_of_one_sensor_agree(data_dir, tmp_path, log, table, midnight, dropped):
    raw = Imported(data_dir / 'nmea' / log, tmp_path / 'raw')
    flat = Imported(data_dir / 'ship' / f'{table}.csv', tmp_path / 'flat')
    with (data_dir / 'ship' / f'{table}.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert len(raw.imus) == len(raw.heaves) == len(flat.imus) == len(rows) > 490
    assert [imu.stamp - midnight * SECOND for imu in raw.imus] == [
        imu.stamp for imu in flat.imus]
    assert raw.rpy == pytest.approx(flat.rpy, abs=1e-9)
    assert [heave.height for heave in raw.heaves] == [heave.height for heave in flat.heaves] == [
        pytest.approx(float(row['heave_m'])) for row in rows]
    assert np.degrees(flat.rpy[:, 1]) == pytest.approx(
        np.array([-float(row['pitch_deg']) for row in rows]))
    assert sum(count for count, _ in raw.skipped.values()) == dropped


def test_heave_of_the_raw_log_goes_up_with_the_antenna(data_dir, tmp_path):
    """GGA's altitude is another sensor's word for up: the sign was not assumed."""
    log = data_dir / 'nmea' / 'NBP1406_s330-2014-08-01'
    altitude = np.array([float(line.split(',')[9]) for line in log.read_text().splitlines()
                         if 'GGA' in line])
    heave = np.array([sample.height for sample in Imported(log, tmp_path / 'bag').heaves])
    assert np.corrcoef(altitude, heave)[0, 1] > 0.99


@pytest.mark.parametrize(('table', 'topics', 'count'), [
    ('yacht_piran_n2k', {'/ship/imu'}, 5846), ('r2sonic_launch_20150708',
                                               {'/ship/imu', '/ship/heave'}, 1203),
    ('sig1000_float_20170724', {'/ship/imu'}, 4096),
    ('nbp_20140801_merged_2hz', {'/ship/imu', '/ship/heave'}, 1249)])
def test_recorded_tables_are_taken_whole(data_dir, tmp_path, table, topics, count):
    summary = import_file(data_dir / 'ship' / f'{table}.csv', tmp_path / 'bag')
    assert {f'/{topic}' for topic in summary.messages} == topics
    assert set(summary.messages.values()) == {count}
    assert summary.skipped == {}


# --- UWB

@pytest.fixture
def ranges(tmp_path):
    """Return the file of a small UWB record with anchors and truth."""
    (tmp_path / 'yard_ranges.csv').write_text(
        't_s,anchor_id,range_m\n-0.5,9,3.5\n0.25,12,4\n0.5,7,1\n0.75,9,0\n')
    (tmp_path / 'yard_anchors.csv').write_text('anchor_id,x_m,y_m\n9,1.5,-2\n12,3,4\n')
    (tmp_path / 'yard_truth.csv').write_text('t_s,x_m,y_m,heading_rad\n0,5,6,1\n0.5,7,8,1\n')
    return tmp_path / 'yard_ranges.csv'


def test_ranges_with_anchors_and_truth(ranges, tmp_path):
    found = Imported(ranges, tmp_path / 'bag')
    assert [topic for topic, _ in found.raw] == [
        '/uwb/range', '/landing/truth', '/uwb/range', '/landing/truth']
    assert found.log_times == [500_000_000, SECOND, 1_250_000_000, 1_500_000_000]
    first, truth = found.raw[0][1], found.raw[1][1]
    assert (first.header.frame_id, first.range, first.variance) == ('anchor_9', 3.5, 0)
    assert (truth.header.frame_id, truth.child_frame_id) == ('deck', 'uav_deck')
    place = truth.pose.pose.position
    assert (place.x, place.y, place.z) == (5, 6, 0)
    assert np.isnan(truth.twist.twist.linear.x)  # the file does not say how fast it went
    assert found.skipped == {'unknown anchor, or range not above 0': (2, 4)}


def test_anchors_become_a_parameter_file(ranges, tmp_path):
    summary = import_file(ranges, tmp_path / 'bag')
    assert summary.files == [tmp_path / 'bag_landing.yaml']
    parameters = YAML(typ='safe').load(summary.files[0])['landing']['ros__parameters']
    told = dataclasses.replace(DRIVEN, anchor_frames=('anchor_9', 'anchor_12'),
                               anchor_positions=(1.5, -2.0, 0.0, 3.0, 4.0, 0.0))
    assert repr(configured(LandingConfig, parameters)) == repr(told)
    assert all(isinstance(value, float) for value in parameters['anchor_positions'])


def test_ranges_without_anchors_are_refused(ranges, tmp_path):
    (tmp_path / 'yard_anchors.csv').unlink()
    with pytest.raises(ImportFailed, match='need their anchors'):
        import_file(ranges, tmp_path / 'bag')


def test_recorded_ranges(data_dir, tmp_path):
    found = Imported(data_dir / 'uwb' / 'plaza1_ranges.csv', tmp_path / 'bag')
    assert found.summary.messages == {'uwb/range': 3529, 'landing/truth': 9658}
    ranges = [message.range for topic, message in found.raw if topic == '/uwb/range']
    with (data_dir / 'uwb' / 'plaza1_ranges.csv').open() as file:
        assert ranges == [float(np.float32(row['range_m'])) for row in csv.DictReader(file)]


@pytest.mark.parametrize(('name', 'start', 'limit'), [
    ('hanyang_los_trajectory_a_case_1', 0.0, 1.4), ('hanyang_los_trajectory_b_case_3', 0.0, 1.4),
    ('plaza1', 300.0, 1.0)])
def test_recorded_ranges_replay_honestly(data_dir, tmp_path, name, start, limit):
    settings, = import_file(data_dir / 'uwb' / f'{name}_ranges.csv', tmp_path / 'bag').files
    replay(tmp_path / 'bag', tmp_path / 'out', 'landing', read_params_file(settings, 'landing'))
    reader = BagReader(tmp_path / 'out')
    rows = {'/landing/odometry': [], '/landing/truth': []}
    for topic, _, data in reader.messages():
        if topic in rows:
            message = reader.decode(topic, data)
            place = message.pose.pose.position
            rows[topic].append((messages.stamp_of(message) / SECOND, place.x, place.y, place.z,
                                *message.pose.covariance[[0, 7, 14]]))
    estimate, truth = (np.array(found) for found in rows.values())
    times = estimate[:, 0]
    scored = (times > truth[0, 0] + start) & (times < truth[-1, 0])
    true = np.stack([np.interp(times, truth[:, 0], column) for column in truth[:, 1:4].T], axis=1)
    rmse = np.sqrt(np.mean(np.sum((estimate[:, 1:4] - true)[scored]**2, axis=1)))
    stated = np.sqrt(np.mean(np.sum(estimate[scored, 4:], axis=1)))
    assert rmse < limit
    assert 0.5 < stated / rmse < 2.0

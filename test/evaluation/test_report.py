"""The report: its numbers are those of the metrics, and the page needs nothing but itself."""

from dataclasses import replace
from html.parser import HTMLParser
from math import sqrt
import re

import numpy as np
import pytest
from scipy.signal import lfilter

from deck_motion_ros import messages, topics
from deck_motion_ros.evaluation import report
from deck_motion_ros.evaluation.assessment import assessed, floor_of
from deck_motion_ros.evaluation.contents import Contents
from deck_motion_ros.evaluation.metrics import Series
from deck_motion_ros.evaluation.record import read_record, Record
from deck_motion_ros.evaluation.report import write_report
from deck_motion_ros.evaluation.report.page import note, section
from deck_motion_ros.evaluation.report.view import Chapter
from deck_motion_ros.geometry import height_above_rest, quaternion_from_rpy
from deck_motion_ros.recording import BagError, BagTypes, BagWriter, encode
from deck_motion_ros.samples import (
    HeaveSample,
    ImuSample,
    MotionForecast,
    OdometrySample,
    Rejected,
    TouchdownForecast,
    TouchdownPose,
    VectorSample,
)

SECOND = 1_000_000_000
ARM = (-30.0, 2.0, 8.0)
HORIZONS = np.arange(1, 21) * 0.5
TYPES = BagTypes()
NONE = (0.0, 0.0, 0.0)
EVERYTHING = ('What was recorded', 'The motion', 'Forecast against what came', 'Error by horizon',
              'Calibration', 'Spectra', 'Gaps and rejects', 'Settings')


def true_motion(times):
    """Return roll, pitch, heave of a swell with a period of 9 s and some of 6.1 s."""
    swell, sea = 2 * np.pi * times / 9, 2 * np.pi * times / 6.1
    return np.stack([0.05 * np.sin(swell), 0.02 * np.cos(swell) + 0.01 * np.sin(sea),
                     0.9 * np.sin(swell + 1) + 0.3 * np.sin(sea)], axis=-1)


def true_height(times):
    return np.array([height_above_rest(*motion, ARM) for motion in true_motion(times).tolist()])


def error(horizon, number):
    """Return the forecast's error by construction: 5 cm per second ahead, up and down."""
    return 0.05 * horizon * (-1)**number


class Ship:
    """Writes what a ship, a predictor and a simulator would publish."""

    def __init__(self, bag, start=1_700_000_000, rate=4.0, noise=0.02, namespace=''):
        self.writer = BagWriter(bag)
        self.start, self.rate, self.namespace = start, rate, namespace
        self.noise = noise * np.random.default_rng(8).standard_normal((5000, 3))

    def write(self, name, kind, time, message):
        topic = name if name.startswith('/') else f'{self.namespace}/{name}'
        self.writer.add_topic(topic, kind)
        self.writer.write(topic, self.stamp(time), encode(kind, message))

    def stamp(self, time):
        return self.start * SECOND + round(time * SECOND)

    def sail(self, duration, angles=True, heave=True, truth=True, forecast=True,
             lever_arm=True, gap=(0, 0)):
        for number in range(round(duration * self.rate)):
            time = number / self.rate
            stamp = self.stamp(time)
            roll, pitch, up = (true_motion(np.array(time)) + self.noise[number]).tolist()
            attitude = quaternion_from_rpy(roll, pitch, 0.4)
            if gap[0] < time < gap[1]:
                continue
            if angles:
                self.write('ship/imu', topics.IMU, time, messages.imu_message(TYPES, ImuSample(
                    stamp, 'ship_base_link', attitude, NONE, NONE, NONE), rates=False))
            if heave:
                self.write('ship/heave', topics.POINT, time, messages.heave_message(
                    TYPES, HeaveSample(stamp, 'ship_level', up)))
            if truth:
                roll, pitch, up = true_motion(np.array(time)).tolist()
                self.write('ship/truth', topics.ODOMETRY, time, messages.odometry_message(
                    TYPES, OdometrySample(
                        stamp, 'ship_level', 'ship_base_link', (0.0, 0.0, up),
                        quaternion_from_rpy(roll, pitch, 0.4), NONE, NONE, (0.0,) * 6)))
            if forecast:
                self.forecast(time, number)
        if lever_arm:
            self.write('/diagnostics', topics.DIAGNOSTICS, duration, messages.diagnostics_message(
                TYPES, self.stamp(duration), '/predictor', [
                    ('predictor: input', 0, 'predicting', {
                        'rejected ship/imu: older stamp': '7', 'rejected ship/heave: x': '0'}),
                    ('predictor: settings', 0, '<shaping>', {
                        'horizon': '3.0', 'lever_arm': ', '.join(map(str, ARM))}),
                    ('simulator: settings', 0, '', {'hull': 'destroyer <1>'})]))
        self.writer.close()

    def forecast(self, time, number):
        """Publish forecasts with known errors and a stated sd of 0.8 of them."""
        motion = true_motion(time + HORIZONS)
        height = true_height(time + HORIZONS) + error(HORIZONS, number)
        sd = 0.8 * np.abs(error(HORIZONS, number))
        cov = np.zeros((20, 3, 3))
        cov[:, 0, 0] = cov[:, 1, 1] = 0.01**2
        position = np.zeros((20, 3))
        position[:, 2] = height + ARM[2]
        ahead = TouchdownForecast(self.stamp(time), HORIZONS, height, sd, 0 * sd, 0 * sd, position,
                                  position, MotionForecast(HORIZONS, motion, cov, motion, cov))
        three = 5
        pose_cov = np.zeros((6, 6))
        pose_cov[2, 2] = sd[three]**2
        valid_at = self.stamp(time + 3)
        self.write('touchdown/height', topics.POINT, time, messages.point_message(
            TYPES, valid_at, 'touchdown_rest', float(height[three])))
        self.write('touchdown/prediction', topics.ODOMETRY, time, messages.touchdown_message(
            TYPES, TouchdownPose(valid_at, position[three], (0.0, 0.0, 0.0, 1.0), pose_cov,
                                 np.zeros(6), np.zeros((6, 6))), 'ship_level', 'touchdown'))
        self.write('touchdown/forecast', topics.MULTI_DOF_TRAJECTORY, time,
                   messages.forecast_message(TYPES, ahead, 'ship_level', 'touchdown'))
        self.write('touchdown/forecast_sd', topics.TRAJECTORY, time,
                   messages.forecast_sd_message(TYPES, ahead, 'ship_level'))


class Page(HTMLParser):
    """A page taken apart; complains of what a page must not have."""

    VOID = ('meta', 'br', 'hr')

    def __init__(self, path):
        super().__init__()
        self.open, self.headings, self.ids, self.references = [], [], [], []
        self.cells, self.by_id, self.figures, self.text = [], {}, 0, ''
        source = path.read_text(encoding='utf-8')
        for foreign in ('http:', 'https:', '//www', '<script', '<link', '<img', '@import', 'nan',
                        'src='):
            assert foreign not in source
        self.references += re.findall(r'url\(([^)]*)\)', source)
        self.feed(source)
        assert self.open == []
        assert len(self.ids) == len(set(self.ids))
        assert {reference.lstrip('#') for reference in self.references} <= set(self.ids)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.figures += tag == 'figure'
        self.ids += [attrs['id']] if 'id' in attrs else []
        self.references += [value for name, value in attrs.items() if name.endswith('href')]
        if tag not in self.VOID:
            self.open.append((tag, attrs.get('id')))

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        tag, name = self.open[-1] if self.open else ('', None)
        if tag == 'h2':
            self.headings.append(data)
        if tag in ('td', 'th'):
            self.cells.append(data)
        if name:
            self.by_id[name] = data
        if tag != 'style':
            self.text += data


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    """Return a bag with everything in it."""
    bag = tmp_path_factory.mktemp('report') / 'voyage'
    Ship(bag).sail(120.0)
    return bag


@pytest.fixture
def sailed(tmp_path):
    """Return a function that writes a bag and gives its folder and the page it makes."""
    def sail(duration=45.0, report=None, **what):
        ship = {key: what.pop(key) for key in ('start', 'namespace', 'rate') if key in what}
        Ship(tmp_path / 'bag', **ship).sail(duration, **what)
        write_report(tmp_path / 'bag', tmp_path / 'page.html', **(report or {}))
        return Page(tmp_path / 'page.html')
    return sail


def test_known_errors_come_out_at_every_horizon(simulated):
    found = assessed(read_record(simulated))
    assert found.warm_up == 20.0
    assert len(found.horizons) == 20
    for comparison in found.horizons:
        assert comparison.rmse == pytest.approx(0.05 * comparison.horizon, rel=0.01)
        assert comparison.nis == pytest.approx(1 / 0.8**2, rel=0.02)
        assert comparison.coverage(0.68) == 0
        assert comparison.coverage(0.95) == 1
    assert found.judged.horizon == 3.0
    assert found.judged.rmse == pytest.approx(0.15, rel=0.01)
    assert len(found.whole) - len(found.judged) == 20 * 4
    assert found.axes['roll'].rmse == pytest.approx(0, abs=1e-4)  # forecast = truth
    assert found.axes['pitch'].persistence > 0.02
    assert np.median(np.abs(found.crests)) < 0.15


def test_useful_horizon_is_where_the_error_reaches_half_the_motion(simulated):
    """By construction the error is 5 cm per second ahead; four times as much reaches it."""
    found = assessed(read_record(simulated))
    worse = replace(found, horizons=[
        replace(item, mean=item.came + 4 * item.error) for item in found.horizons])
    motion = np.std(true_height(np.arange(20.0, 120.0, 0.25)))
    assert worse.useful == pytest.approx(0.5 * motion / 0.2, rel=0.05)
    assert found.useful == 10.0


def autoregressive(rng, size, decay):
    return lfilter([sqrt(1 - decay**2)], [1.0, -decay], rng.standard_normal(size))


@pytest.mark.parametrize('rate', [1.0, 2.0, 10.0])
def test_estimated_floor_is_that_of_a_known_process(rate):
    """A heave x' = decay x + noise: the error after h seconds is sqrt(1 - decay^2h)."""
    rng, decay = np.random.default_rng(2), 0.8
    size = round(3000 * rate)
    stamps = SECOND * 1_700_000_000 + np.round(np.arange(size) / rate * SECOND).astype(np.int64)
    heave = Series.of(stamps, 3 + autoregressive(rng, size, decay**(1 / rate)))
    roll = Series.of(stamps, 0.1 * autoregressive(rng, size, 0.1**(1 / rate)))
    horizons = np.array([0.1, 1.0, 2.0, 5.0])
    record = Record(Contents('made'), (roll, None, heave), lever_arm=(0.0, 2.0, 0.0))
    found = floor_of(record, horizons.tolist())
    expected = np.sqrt(1 - decay**(2 * horizons) + (2 * 0.1)**2 * (1 - 0.1**(2 * horizons)))
    assert found[1:] == pytest.approx(expected[1:], rel=0.08)
    assert np.isnan(found[0])

def test_estimated_floor_is_without_the_noise_where_the_truth_is_known():
    rng, size = np.random.default_rng(5), 4000
    stamps = SECOND * 1_700_000_000 + np.arange(size) * SECOND // 2
    true = autoregressive(rng, size, 0.9)
    noise = 0.5 * rng.standard_normal(size)
    record = Record(Contents('made'), (None, None, Series.of(stamps, true + noise)),
                    lever_arm=(0.0, 0.0, 0.0))
    with_noise, = floor_of(record, [1.0])
    record.truth = (None, None, Series.of(stamps, true))
    without, = floor_of(record, [1.0])
    assert with_noise**2 - without**2 == pytest.approx(0.25, rel=0.05)
    # Riccati: p the variance before, p r / (p + r) after a measurement
    before = 1.0
    for _ in range(100):
        after = before * 0.25 / (before + 0.25)
        before = 0.81 * after + 0.19
    assert without == pytest.approx(sqrt(0.81**2 * after + 0.81 * 0.19 + 0.19), rel=0.05)


@pytest.mark.parametrize('values', [np.zeros(900), np.sin(np.arange(100.0))])
def test_no_floor_is_estimated_of_what_does_not_tell(values):
    stamps = SECOND * 1_700_000_000 + np.arange(len(values)) * SECOND
    record = Record(Contents('made'), (None, None, Series.of(stamps, values)),
                    lever_arm=(0.0, 0.0, 0.0))
    assert np.isnan(floor_of(record, [1.0, 3.0])).all()


def test_floor_and_ratio_are_on_the_page_of_a_record_long_enough(sailed):
    page = sailed(240.0, rate=1.0)
    assert '/ floor' in page.cells
    row = page.cells.index('3 s')
    rmse, floor, over = (page.cells[row + column] for column in (1, 5, 6))
    assert rmse == '0.15 m'
    assert floor.endswith('m') and over != '–'


def test_truth_is_the_yardstick_and_measurement_what_persists(simulated):
    times = np.arange(20.0, 117.0, 0.25)
    wrong = true_height(times + 3) - true_height(times)
    measured = 0.02 * sqrt(1 + 30**2 + 2**2)  # noise of heave, of pitch and roll at their arms
    judged = assessed(read_record(simulated)).judged
    assert judged.zero == pytest.approx(np.sqrt(np.mean(true_height(times + 3)**2)), rel=0.01)
    assert judged.persistence == pytest.approx(
        np.sqrt(np.mean(wrong**2) + measured**2), rel=0.03)


def test_page_shows_the_numbers_of_the_metrics(simulated, tmp_path):
    headline = write_report(simulated, tmp_path / 'page.html', title='A <voyage> & back')
    found = assessed(read_record(simulated)).judged
    page = Page(tmp_path / 'page.html')
    assert page.by_id['rmse'] == f'{found.rmse:.2f} m' == '0.15 m'
    assert page.by_id['persistence'] == f'{found.persistence:.2f} m'
    assert page.by_id['zero'] == f'{found.zero:.2f} m'
    assert page.by_id['useful'] == '10.0 s or more'
    assert page.by_id['coverage'] == '100.0 %'
    assert '0.15 m' in headline[0]
    assert f'{found.persistence:.2f} m' in headline[1]
    assert tuple(page.headings) == EVERYTHING
    assert page.figures == 5
    assert 'A <voyage> & back' in page.text
    assert '2023-11-14 22:13:20 UTC · 2 min 0 s' in page.text
    assert ['predictor: input', 'rejected ship/imu: older stamp', '7'] == page.cells[
        (place := page.cells.index('rejected ship/imu: older stamp')) - 1:place + 2]
    assert 'rejected ship/heave: x' not in page.cells
    assert page.cells[page.cells.index('hull') + 1] == 'destroyer <1>'
    assert 'true' in page.text


def test_same_bag_same_page(simulated, tmp_path):
    pages = [tmp_path / name for name in ('one.html', 'two.html')]
    for page in pages:
        write_report(simulated, page)
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_a_real_ship_is_scored_against_its_measurements(sailed):
    page = sailed(truth=False)
    assert 'as on any real ship' in page.text
    assert 'noise of the sensor is part of every error' in page.text
    assert float(page.by_id['rmse'].split()[0]) > 0.15


@pytest.mark.parametrize(('what', 'shown', 'missing'), [
    ({}, ['roll', 'pitch', 'heave'], []),
    ({'heave': False}, ['roll', 'pitch'], ['heave']),
    ({'angles': False}, ['heave'], ['roll', 'pitch'])])
def test_motion_alone(sailed, what, shown, missing):
    page = sailed(truth=False, forecast=False, lever_arm=False, **what)
    assert page.headings == ['What was recorded', 'The motion', 'Spectra', 'Gaps and rejects']
    assert 'no forecast' in page.text
    assert all(name in page.cells for name in shown)
    assert not any(name in page.cells for name in missing)


def test_forecast_of_a_ship_without_heave_sensor_says_so(sailed):
    page = sailed(truth=False, heave=False)
    assert 'No heave came' in page.text
    assert 'Forecast against what came' in page.headings


def test_lever_arm_can_be_given_and_its_absence_is_said(sailed, tmp_path):
    page = sailed(lever_arm=False)
    assert 'does not state the lever arm' in page.text
    assert 'Forecast against what came' not in page.headings
    write_report(tmp_path / 'bag', tmp_path / 'page.html', lever_arm=ARM, warm_up=5.0)
    assert Page(tmp_path / 'page.html').by_id['rmse'] == '0.15 m'


def test_horizon_is_found_where_nobody_states_it(sailed, tmp_path):
    sailed(lever_arm=False, report={'lever_arm': ARM})
    assert assessed(read_record(tmp_path / 'bag', ARM)).judged.horizon == 3.0


def test_namespace_is_found(sailed):
    assert sailed(namespace='/palmer').by_id['rmse'] == '0.15 m'


def test_two_ships_need_a_choice(tmp_path):
    ship = Ship(tmp_path / 'bag', namespace='/north')
    for name in ('/north', '/south'):
        ship.namespace = name
        ship.forecast(0.0, 0)
    ship.writer.close()
    with pytest.raises(ValueError, match='/north/, /south/: choose one'):
        write_report(tmp_path / 'bag', tmp_path / 'page.html')
    assert read_record(tmp_path / 'bag', ARM, namespace='south').height is not None


def test_remapped_inputs_are_found(tmp_path):
    ship = Ship(tmp_path / 'bag')
    ship.write('mru/heave', topics.POINT, 0.0, messages.heave_message(
        TYPES, HeaveSample(ship.stamp(0.0), 'ship_level', 1.0)))
    ship.writer.close()
    record = read_record(tmp_path / 'bag', remap=['ship/heave:=mru/heave'])
    assert list(record.motion) == ['heave']


def test_gap_is_listed(sailed):
    page = sailed(forecast=False, gap=(20, 35))
    row = page.cells.index('15.00 s')
    assert page.cells[row - 2] in ('/ship/heave', '/ship/imu', '/ship/truth')
    assert page.cells[row - 1] == '20.00'
    assert 'No topic had a gap' not in page.text


def test_turned_sensor_is_turned_back(tmp_path):
    ship = Ship(tmp_path / 'bag', noise=0.0)
    attitude = quaternion_from_rpy(0.1, 0.0, np.pi / 2)  # of a sensor whose x looks to port
    ship.write('ship/imu', topics.IMU, 0.0, messages.imu_message(TYPES, ImuSample(
        ship.stamp(0), 'mru', attitude, NONE, NONE, NONE)))
    ship.write('/diagnostics', topics.DIAGNOSTICS, 1.0, messages.diagnostics_message(
        TYPES, ship.stamp(1), '/predictor', [('predictor: settings', 0, '', {
            'lever_arm': '0, 0, 0', 'sensor_rpy_deg': '0, 0, 90'})]))
    ship.writer.close()
    roll, pitch, _ = read_record(tmp_path / 'bag').measured
    # the sensor's roll, about an axis to port, is the ship's pitch
    assert pitch.values == pytest.approx([0.1])
    assert roll.values == pytest.approx([0.0], abs=1e-9)


@pytest.mark.parametrize('count', [1, 2, 3, 20])
def test_a_few_messages_make_a_page_too(sailed, count):
    page = sailed(count / 4.0)
    assert 'The motion' in page.headings
    assert 'too short' in page.text


def test_a_recording_that_counts_from_zero_has_no_date(sailed):
    page = sailed(start=0, forecast=False)
    assert '1970' not in page.text
    assert 'of its own clock' in page.text


def test_unusable_messages_are_counted(tmp_path):
    ship = Ship(tmp_path / 'bag')
    for time, height in enumerate((1.0, float('nan'), float('inf'), 2.0)):
        ship.write('ship/heave', topics.POINT, time, messages.point_message(
            TYPES, ship.stamp(time), 'ship_level', height))
    empty = TYPES[topics.MULTI_DOF_TRAJECTORY](
        header=messages.point_message(TYPES, ship.stamp(0), '', 0.0).header,
        joint_names=[], points=[])
    ship.write('touchdown/forecast', topics.MULTI_DOF_TRAJECTORY, 0.0, empty)
    ship.write('ship/imu', topics.POINT, 0.0, messages.point_message(
        TYPES, ship.stamp(0), 'ship_level', 1.0))
    ship.writer.close()
    record = read_record(tmp_path / 'bag')
    assert record.contents.unusable == {
        ('/ship/heave', 'not finite'): 2, ('/touchdown/forecast', 'forecast without points'): 1,
        ('/ship/imu', f'not of type {topics.IMU}'): 1}
    assert record.motion['heave'].values.tolist() == [1.0, 2.0]
    write_report(tmp_path / 'bag', tmp_path / 'page.html')
    assert 'not usable for this report: not finite' in Page(tmp_path / 'page.html').cells


class MisalignmentView:
    """The least a view can be."""

    subjects = ('alignment/misalignment',)
    thinned = ()

    def __init__(self, options):
        self.found = []
        self.handlers = {'alignment/misalignment': self.take, 'ship/imu': self.refuse}

    def take(self, stamp, msg):
        self.found.append((stamp, msg.vector.x))

    def refuse(self, stamp, msg):
        raise Rejected('not for alignment')

    def chapter(self, contents, clock):
        self.times = [float(clock(stamp)) for stamp, _ in self.found]
        return Chapter('The misalignment is there.', ['Aligned.'],
                       [('count', f'{len(self.found)}', 'estimates')],
                       [section('Misalignment', note(f'{self.times}'))])


@pytest.fixture
def both_views(monkeypatch):
    monkeypatch.setattr(report, 'VIEWS', (report.PredictorView, MisalignmentView))


def align(ship, duration):
    for time in range(duration):
        ship.write('alignment/misalignment', topics.VECTOR, time, messages.vector_message(
            TYPES, VectorSample(ship.stamp(time), 'uav_base_link', (0.1, 0.0, 0.0))))


def test_a_bag_of_another_subject_has_that_chapter_alone(both_views, tmp_path):
    ship = Ship(tmp_path / 'bag', namespace='/cat')
    align(ship, 3)
    ship.writer.close()
    assert write_report(tmp_path / 'bag', tmp_path / 'page.html') == ['Aligned.']
    page = Page(tmp_path / 'page.html')
    assert page.headings == ['What was recorded', 'Misalignment', 'Gaps and rejects']
    assert page.by_id == {'count': '3'}
    assert '[0.0, 1.0, 2.0]' in page.text
    assert 'Ship motion' not in page.text


def test_a_bag_of_two_subjects_has_both_chapters_in_order(both_views, tmp_path):
    ship = Ship(tmp_path / 'bag')
    align(ship, 40)
    ship.sail(40.0)
    headline = write_report(tmp_path / 'bag', tmp_path / 'page.html')
    page = Page(tmp_path / 'page.html')
    assert page.headings == [*EVERYTHING[:-2], 'Misalignment', *EVERYTHING[-2:]]
    assert page.by_id['count'] == '40'
    assert page.by_id['rmse'] == '0.15 m'
    assert '3 s ahead' in headline[0]
    assert headline[-1] == 'Aligned.'
    row = page.cells.index('not usable for this report: not for alignment')
    assert page.cells[row - 1:row + 2:2] == ['/ship/imu', '160']


def test_what_could_be_judged_leads(both_views, tmp_path):
    ship = Ship(tmp_path / 'bag')
    align(ship, 5)
    ship.sail(5.0, forecast=False)
    headline = write_report(tmp_path / 'bag', tmp_path / 'page.html')
    assert headline[0] == 'Aligned.'
    assert 'of ship motion' in headline[1]


def test_a_bag_of_no_subject_says_so(tmp_path):
    ship = Ship(tmp_path / 'bag')
    ship.write('somewhere/else', topics.POINT, 0.0, messages.point_message(
        TYPES, ship.stamp(0), '', 0.0))
    ship.writer.close()
    headline, = write_report(tmp_path / 'bag', tmp_path / 'page.html')
    assert 'nothing that a report can judge' in headline
    assert Page(tmp_path / 'page.html').headings == ['What was recorded', 'Gaps and rejects']


def test_nothing_stays_behind_where_the_page_cannot_be_written(simulated, tmp_path):
    (tmp_path / 'page.html').mkdir()
    with pytest.raises(OSError):
        write_report(simulated, tmp_path / 'page.html')
    assert [path.name for path in tmp_path.iterdir()] == ['page.html']
    with pytest.raises(BagError):
        write_report(tmp_path / 'nowhere', tmp_path / 'other.html')
    assert not (tmp_path / 'other.html').exists()

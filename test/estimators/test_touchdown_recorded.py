"""The predictor on real ships: forecasts against what came, and no harm done on any record."""

import csv
from math import isfinite, radians, sqrt

import numpy as np
import pytest

from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.geometry import height_above_rest, quaternion_from_rpy
from deck_motion_ros.samples import HeaveSample, ImuSample

SECOND = 1_000_000_000
ZERO = (0.0, 0.0, 0.0)
AFT = (-35.0, 0.0, 0.0)


def record(path, time='t_s'):
    """Read a record: times, roll, pitch (rad, bow down), heave (m); NaN where there is none."""
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    columns = [np.array([float(row.get(name) or 'nan') for row in rows])
               for name in (time, 'roll_deg', 'pitch_deg', 'heave_m')]
    times, roll, pitch_bow_up, heave = columns
    return times, np.radians(roll), -np.radians(pitch_bow_up), heave


def fed(path, time='t_s', rows=None, **config):
    """Feed a record; return times, true heights of the point and the predictions."""
    config = PredictorConfig(lever_arm=AFT, **config)
    predictor, made = TouchdownPredictor(config), []
    times, roll, pitch, heave = (column[:rows] for column in record(path, time))
    for t, r, p, h in zip(*(column.tolist() for column in (times, roll, pitch, heave)),
                          strict=True):
        stamp = round(t * SECOND)
        if isfinite(r):
            made += predictor.update(ImuSample(
                stamp, 'ship_base_link', quaternion_from_rpy(r, p, 0.3), ZERO, ZERO, ZERO))
        if isfinite(h):
            made += predictor.update(HeaveSample(stamp, 'ship_level', h))
    height = np.array([height_above_rest(*row, AFT) for row in np.nan_to_num(
        np.column_stack([roll, pitch, heave])).tolist()])
    return times, height, made


def scored(times, height, made, horizon, start):
    """Return errors, promised sds and persistence errors of the forecasts issued after start."""
    errors, sds, persistence = [], [], []
    for prediction in made:
        issued = prediction.issued_at / SECOND
        if issued < start or issued + horizon > times[-1]:
            continue
        ahead = prediction.forecast(np.array([horizon]))
        came = np.interp(issued + horizon, times, height)
        errors.append(ahead.height[0] - came)
        sds.append(ahead.height_sd[0])
        persistence.append(np.interp(issued, times, height) - came)
    return np.array(errors), np.array(sds), np.array(persistence)


def rms(values):
    """Return the root mean square."""
    return sqrt(np.mean(np.square(values)))


@pytest.fixture(scope='module', params=['adaptive', 'shaping'])
def palmer(data_dir, request):
    """Predictions on R/V Nathaniel B. Palmer, 1 Hz."""
    return fed(data_dir / 'ship/nbp_20140801_seapath330.csv', method=request.param)


def test_palmer_three_seconds_ahead(palmer):
    errors, _, persistence = scored(*palmer, 3.0, 120.0)
    assert len(errors) > 490
    assert rms(persistence) == pytest.approx(2.2, abs=0.1)
    assert rms(errors) < 0.75


@pytest.mark.parametrize('horizon', [1.0, 2.0, 3.0, 5.0, 8.0, 10.0])
def test_palmer_promises(palmer, horizon):
    """The 95 % intervals hold, and no forecast is worse than the ship's own spread."""
    errors, sds, _ = scored(*palmer, horizon, 120.0)
    assert 0.88 <= np.mean(np.abs(errors) < 1.96 * sds) <= 0.995
    assert 0.55 < rms(errors) / rms(sds) < 1.2
    assert rms(errors) < 1.1 * np.std(palmer[1])


def test_two_sensors_of_one_ship_give_much_the_same(palmer, data_dir):
    other = fed(data_dir / 'ship/nbp_20140801_seapath200.csv')
    errors, _, _ = scored(*other, 3.0, 120.0)
    assert rms(errors) < 0.8
    ours = {p.issued_at / SECOND: p.height for p in palmer[2] if p.issued_at > 120 * SECOND}
    times = np.array([p.issued_at / SECOND for p in other[2]])
    heights = np.array([p.height for p in other[2]])
    apart = [h - np.interp(t, times, heights) for t, h in ours.items() if t < times[-1]]
    assert rms(apart) < 0.8


@pytest.mark.parametrize('method', ['adaptive', 'shaping'])
def test_two_hertz_uneven(data_dir, method):
    record = data_dir / 'ship/nbp_20140801_merged_2hz.csv'
    errors, sds, _ = scored(*fed(record, method=method), 3.0, 120.0)
    assert rms(errors) < 0.75
    assert 0.88 <= np.mean(np.abs(errors) < 1.96 * sds) <= 0.995


def test_flat_calm_does_no_harm(data_dir):
    """R/V Sikuliaq: the forecast may not be worse than to say "no motion" (with her trim)."""
    times, height, made = fed(data_dir / 'ship/sikuliaq_20181206_seapath.csv')
    errors, _, _ = scored(times, height, made, 3.0, 120.0)
    assert rms(errors) < 1.1 * np.std(height[times > 120])


def test_yacht_is_not_made_worse_than_saying_its_mean(data_dir):
    """No heave at all; a fixed narrow filter is 14 times worse than zero on her roll."""
    path = data_dir / 'ship/yacht_piran_n2k.csv'
    times, height, made = fed(path, 't_arrival_s')
    errors, sds, _ = scored(times, height, made, 3.0, 120.0)
    assert rms(errors) < 1.1 * np.std(height[times > 120])


FILES = [('nbp_20140801_seapath330.csv', 't_s'), ('nbp_20140801_seapath200.csv', 't_s'),
         ('nbp_20140801_merged_2hz.csv', 't_s'),
         ('nbp_20140801_upsampled10hz_DERIVED.csv', 't_s'),
         ('sikuliaq_20181206_seapath.csv', 't_s'), ('yacht_piran_n2k.csv', 't_s'),
         ('yacht_piran_n2k.csv', 't_arrival_s'), ('r2sonic_launch_20150708.csv', 't_s'),
         ('sig1000_float_20170724.csv', 't_s'), ('waverider_2005-07-01_first12h.csv', 't_s')]


@pytest.mark.parametrize('name, time', FILES)
def test_every_record_gives_numbers(data_dir, name, time):
    times, height, made = fed(data_dir / 'ship' / name, time, rows=1500)
    assert len(made) > 0.7 * min(len(times), 10 * (times[-1] - times[0]))
    for prediction in made[::7]:
        pose, table = prediction.pose(), prediction.forecast()
        for values in (prediction.height, pose.pose_cov, pose.twist_cov, table.height,
                       table.height_sd, table.rate, table.rate_sd, table.velocity):
            assert np.isfinite(values).all()
        assert abs(prediction.height) < 3 * np.abs(height).max() + 0.5
    stamps = [prediction.issued_at for prediction in made]
    assert stamps == sorted(set(stamps))


INTERLEAVED = [('nbp_20140801_seapath330.csv', 1.0, 1.3),
               ('nbp_20140801_merged_2hz.csv', 1.0, 0.6),
               ('nbp_20140801_merged_2hz.csv', 3.0, 4.8)]


@pytest.mark.parametrize('name, horizon, worst', INTERLEAVED)
def test_interleaved_promises(data_dir, name, horizon, worst):
    """Zhang2021's parabola is good for a second; beyond, its sd says how bad it is."""
    errors, sds, persistence = scored(
        *fed(data_dir / 'ship' / name, method='interleaved'), horizon, 120.0)
    assert len(errors) > 490
    assert rms(errors) < worst
    assert 0.88 <= np.mean(np.abs(errors) < 1.96 * sds) <= 0.99
    assert 0.7 < rms(errors) / rms(sds) < 1.2


def test_adaptive_promises(data_dir):
    """All axes learned together: less than half the error of the filters alone."""
    record = data_dir / 'ship' / 'nbp_20140801_seapath330.csv'
    errors, sds, persistence = scored(*fed(record, method='adaptive'), 3.0, 120.0)
    assert len(errors) > 490
    assert rms(errors) < 0.3 and rms(persistence) > 2.0
    assert 0.9 <= np.mean(np.abs(errors) < 1.96 * sds)


@pytest.mark.parametrize('method', ['adaptive', 'interleaved'])
@pytest.mark.parametrize('name, time', FILES)
def test_other_methods_give_numbers_on_every_record(data_dir, name, time, method):
    _, _, made = fed(data_dir / 'ship' / name, time, rows=600, method=method)
    assert made
    for prediction in made[::7]:
        pose, table = prediction.pose(), prediction.forecast()
        for values in (prediction.height, pose.pose_cov, pose.twist_cov, table.height,
                       table.height_sd, table.rate, table.rate_sd, table.velocity):
            assert np.isfinite(values).all()


def test_reference_of_degrees():
    """The records count pitch bow up: 1 deg of it lowers a point 35 m aft by 0.61 m."""
    assert height_above_rest(0.0, -radians(1.0), 0.0, AFT) == pytest.approx(-0.6108, abs=1e-4)

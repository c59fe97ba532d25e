"""Parameters as dataclass fields: what is taken, what is refused, and in which words."""

from array import array
from dataclasses import dataclass, field, fields
from math import inf, isnan, nan

from hypothesis import given
from hypothesis import strategies as st
import pytest

from deck_motion_ros.config import configured, Parameter, parameter, parameters, unknown_names
from deck_motion_ros.estimators.touchdown import PredictorConfig


@dataclass(frozen=True)
class Sample:
    """One field of every kind."""

    length: float = parameter(3.0, 'a length', 'm', 0.5, 10.0)
    count: int = parameter(4, 'a number', low=1, high=9)
    name: str = parameter('a', 'a word', choices=('a', 'b'))
    on: bool = parameter(True, 'a switch')
    arm: tuple = parameter((0.0, 0.0, 1.0), 'a vector', 'm', -5.0, 5.0, length=3)
    frames: tuple = parameter((), 'words')
    start: float = parameter(nan, 'unset until known', 's', 0.0)
    free: float = parameter(0.0, 'anything')


def test_defaults_stay():
    sample = configured(Sample, {})
    assert (sample.length, sample.count, sample.arm) == (3.0, 4, (0.0, 0.0, 1.0))
    assert isnan(sample.start)


@given(st.integers(1, 10))
def test_a_whole_number_is_taken_where_a_decimal_is_meant(value):
    taken = configured(Sample, {'length': value, 'arm': [0, -value // 2, 1.5]})
    assert type(taken.length) is float and taken.length == value
    assert all(type(item) is float for item in taken.arm)


@pytest.mark.parametrize('name, value, taken', [
    ('arm', (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)), ('arm', array('d', [1, 2, 3]), (1.0, 2.0, 3.0)),
    ('frames', ['x', 'y'], ('x', 'y')), ('frames', [], ()), ('on', False, False),
    ('count', 9, 9), ('length', 0.5, 0.5), ('length', 10, 10.0), ('name', 'b', 'b')])
def test_good_values(name, value, taken):
    result = getattr(configured(Sample, {name: value}), name)
    assert result == taken and type(result) is type(taken)


@pytest.mark.parametrize('name, value, words', [
    ('length', 10.5, '0.5 to 10 m'), ('length', 0.49, '0.5 to 10 m'), ('length', nan, 'within'),
    ('length', inf, 'within'), ('length', '3', 'decimal'), ('length', True, 'decimal'),
    ('length', [3.0], 'decimal'), ('length', None, 'decimal'), ('length', 10**400, 'within'),
    ('count', 0, '1 to 9'), ('count', 3.0, 'whole'), ('count', False, 'whole'),
    ('count', '3', 'whole'), ('name', 'c', 'a, b'), ('name', 1, 'text'), ('on', 1, 'true or'),
    ('on', 'true', 'true or'), ('arm', [0.0, 0.0], '3 numbers'), ('arm', 1.0, 'list'),
    ('arm', 'abc', 'list'), ('arm', [0.0, 6.0, 0.0], '-5 to 5 m'),
    ('arm', [0.0, 'a', 0.0], 'decimal'), ('arm', [0.0, nan, 0.0], 'within'),
    ('frames', [1, 2], 'text'), ('frames', 'abc', 'list'), ('start', -1.0, 'at least 0 s'),
    ('start', inf, 'at least 0 s'), ('free', nan, 'finite'), ('free', -inf, 'finite')])
def test_bad_values_name_the_parameter_and_the_rule(name, value, words):
    with pytest.raises(ValueError) as error:
        configured(Sample, {name: value})
    text = str(error.value)
    assert f"'{name}'" in text and words in text
    assert '\n' not in text


def test_unset_may_be_said():
    assert isnan(configured(Sample, {'start': nan}).start)


def test_unknown_names():
    with pytest.raises(ValueError, match="'horizont'"):
        configured(Sample, {'length': 1.0, 'horizont': 3.0})
    values = {'b': 1, 'a': 1, 'length': 1.0, 'use_sim_time': True,
              'qos_overrides./ship/imu.subscription.depth': 3}
    assert unknown_names(Sample, values) == ['a', 'b']


def test_a_field_without_default_is_a_mistake_of_ours():
    @dataclass(frozen=True)
    class Bad:
        x: float = field(metadata={'meaning': 'no default', 'unit': ''})

    with pytest.raises(TypeError, match='Bad.x'):
        parameters(Bad)


@pytest.mark.parametrize('low, high, unit, span', [
    (None, None, '', ''), (0.0, None, 'm', 'at least 0 m'), (None, 1e-6, '', 'at most 1e-06'),
    (0.1, 10.0, 's', '0.1 to 10 s'), (None, None, 'deg', 'any deg')])
def test_spans(low, high, unit, span):
    assert Parameter('x', 0.0, 'x', unit, low, high).span() == span


def test_the_predictors_parameters_are_the_contracts():
    config, table = PredictorConfig(), parameters(PredictorConfig)
    assert config.method == 'adaptive'
    assert config.horizon == 3.0 and (table['horizon'].low, table['horizon'].high) == (0.1, 10.0)
    assert config.lever_arm == (-67.97, 3.05, 19.5)
    assert (config.attitude_sd, config.heave_sd, config.output_rate) == (0.0005, 0.05, 10.0)
    assert config.sensor_rpy_deg == (0.0, 0.0, 0.0)
    for frame in ('ship_level', 'ship_base_link', 'touchdown', 'touchdown_rest'):
        assert getattr(config, f'{frame}_frame') == frame


def test_every_default_keeps_its_own_rule():
    for item in fields(PredictorConfig):
        rule = parameters(PredictorConfig)[item.name]
        assert repr(rule.check(rule.default)) == repr(rule.default)  # nan too
        assert rule.meaning
        if isinstance(rule.default, float):
            assert rule.low is not None and rule.high is not None

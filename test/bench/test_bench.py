"""The benches measure what they say: peers that agree, figures that are whole. Never how fast."""

from dataclasses import asdict
from io import StringIO
import json
import os
import resource
import sys

import numpy as np
import pytest
from rich.console import Console

from deck_motion_ros import bench
from deck_motion_ros.bench import figures, filters, live, offline
from deck_motion_ros.bench.figures import Figure
from deck_motion_ros.recording import BagReader

KEYS = {'bench', 'name', 'value', 'unit', 'reference', 'reference_value', 'ratio'}


def test_json_has_the_rows_of_the_contract(tmp_path):
    path, screen = tmp_path / 'bench.json', StringIO()
    assert bench.run(['simulator'], path, Console(file=screen, width=160)) == 0
    rows = json.loads(path.read_text())
    assert [row['name'] for row in rows] == ['speed', 'sample']
    for row in rows:
        assert row.keys() == KEYS and row['bench'] == 'simulator' and row['value'] > 0
        assert row['reference'] is row['reference_value'] is row['ratio'] is None
        assert f"simulator {row['name']}" in screen.getvalue()


@pytest.mark.parametrize('names, path, words', [
    (['kalman', 'kelman'], None,
     "'kelman'.* kalman, latency, replay, recorder, memory, simulator"),
    (['simulator'], 'nowhere/bench.json', 'nowhere')])
def test_wrong_input_is_named_before_anything_runs(monkeypatch, tmp_path, names, path, words):
    monkeypatch.setattr(bench, 'in_own_process', lambda name: pytest.fail('it ran'))
    with pytest.raises(ValueError, match=words):
        bench.run(names, path and tmp_path / path, Console(file=StringIO()))


def test_a_bench_that_fails_is_reported_and_the_others_run(monkeypatch):
    def run_or_fail(name):
        return in_own_process('nonsense') if name == 'latency' else [
            Figure(name, 'speed', 2.0, 'm')]

    in_own_process, screen = bench.in_own_process, StringIO()
    monkeypatch.setattr(bench, 'in_own_process', run_or_fail)
    assert bench.run(['latency', 'replay'], None, Console(file=screen, width=160)) == 1
    assert "latency: KeyError: 'nonsense'" in screen.getvalue()
    assert 'replay speed' in screen.getvalue()


def test_what_a_bench_gives_arrives_as_it_comes(monkeypatch, tmp_path):
    given = [0.25, 'a remark', Figure('b', 'head', 1.0, 'm'), 1.0,
             Figure('b', 'detail', 2.0, 'm', headline=False)]
    lines = [json.dumps(asdict(item) if isinstance(item, Figure) else item) for item in given]
    child = tmp_path / 'child'
    child.write_text('#!/bin/sh\n' + ''.join(f"echo '{line}'\n" for line in lines))
    child.chmod(0o755)
    monkeypatch.setattr(sys, 'executable', str(child))
    assert list(bench.in_own_process('given')) == given
    monkeypatch.setitem(bench.BENCHES, 'given', None)
    path, screen = tmp_path / 'bench.json', StringIO()
    assert bench.run(['given'], path, Console(file=screen, width=160)) == 0
    assert [row['name'] for row in json.loads(path.read_text())] == ['head', 'detail']
    text = screen.getvalue()
    assert 'a remark' in text and 'b head' in text and 'b detail' not in text
    assert '1 more figures: --json' in text


def test_long_benches_run_only_by_name(monkeypatch):
    ran = []
    monkeypatch.setattr(bench, 'in_own_process', lambda name: ran.append(name) or [])
    bench.run([], None, Console(file=StringIO()))
    assert set(ran) == set(bench.BENCHES) - {'prediction', 'window'}


def test_rounds_are_compared_in_pairs():
    figure = figures.compared('b', 'n', 'u', [2.0, 8.0, 9.0], 'peer', [1.0, 2.0, 9.0], '>= 2')
    assert (figure.value, figure.reference_value, figure.ratio) == (8.0, 2.0, 2.0)
    assert figure.spread == (1.5, 3.0) and figure.met


@pytest.mark.parametrize('value, goal, met', [
    (2.0, '>= 2', True), (1.9, '>= 2', False), (2.0, '<= 2', True), (2.1, '<= 2', False),
    (95.0, '93 to 97', True), (92.9, '93 to 97', False), (2.0, '', None)])
def test_a_goal_without_reference_judges_the_value(value, goal, met):
    assert Figure('b', 'n', value, 'u', goal=goal).met is met


def test_tasks_take_turns():
    turns = []
    times = figures.alternated(3, lambda: turns.append('a'), lambda: turns.append('b'))
    assert turns == ['a', 'b'] * 3
    assert [len(row) for row in times] == [3, 3] and np.min(times) >= 0


def test_one_filter_agrees_with_filterpy():
    values = np.cumsum(np.random.default_rng(2).normal(size=300)).tolist()
    ours, theirs = ([run(values[:n], predict) for n in (1, 2, 300) for predict in (True, False)]
                    for run in (filters.single_filter, filters.filterpy_filter))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)


def test_many_filters_agree_with_simdkalman_and_with_one():
    tables = list(np.random.default_rng(3).normal(size=(3, 50, 4)))
    ours = filters.many_filters(tables)
    np.testing.assert_allclose(ours, filters.simdkalman_filters(tables), rtol=1e-9, atol=1e-12)
    one, _ = filters.single_filter(tables[1][:, 2].tolist())
    assert ours[1][-1, 2] == pytest.approx(one, rel=1e-9)


def test_the_filters_are_compared_with_peers_that_agree():
    rows = list(filters.kalman(steps=40, runs=3, run_steps=20, rounds=1))
    assert [(row.name, row.reference) for row in rows] == [
        ('step', 'filterpy'), ('step_and_prediction', 'filterpy'), ('monte_carlo', 'simdkalman')]
    assert all(row.ratio == pytest.approx(row.value / row.reference_value) for row in rows)
    with pytest.raises(RuntimeError, match='something else'):
        filters.check([1.0, 2.0], [1.0, 2.0 + 1e-6], 'peer')
    with pytest.raises(RuntimeError, match='something else'):
        filters.check([1.0, np.nan], [1.0, 2.0], 'peer')


def test_a_missing_peer_is_named_and_gives_no_ratio(monkeypatch):
    for name in ('filterpy.kalman', 'simdkalman'):
        monkeypatch.setitem(sys.modules, name, None)
    rows = list(filters.kalman(steps=40, runs=3, run_steps=20, rounds=1))
    assert all(row.value > 0 and row.ratio is row.reference_value is row.met is None
               for row in rows)
    assert 'filterpy (not installed): no ratio for kalman step' in bench.remarks(rows)


def test_a_figure_is_a_row_under_the_head():
    rows = [Figure('a', 'b', 1234.5, 's'), Figure('a', 'c', 0.1234, 'm', 'peer', 2.0, 0.0617,
                                                  (0.05, 0.07), '>= 0.1')]
    first, second = map(bench.cells, rows)
    assert len(first) == len(second) == len(bench.HEAD)
    assert '1,234' in first and '0.123' in second and '0.05 to 0.07' in second
    assert second[-1] == 'missed'


def test_nothing_is_cut_off_at_80_columns(capsys):
    row = Figure('kalman', 'step_and_prediction', 209_046_462.0, 'steps/s', 'simdkalman',
                 3_184_695.0, 66.3, (63.7, 66.6), '>= 50')
    for width, shown in ((80, False), (120, True)):
        Console(file=sys.stdout, width=width).print(bench._table([row], width))
        text = capsys.readouterr().out
        assert all(word in text for word in ('209,046,462', 'simdkalman', '66.3', 'met'))
        assert '\u2026' not in text and ('63.7' in text) == shown


def test_the_bag_of_the_replay_is_the_ship_at_100_hz(tmp_path):
    offline.write_ship(tmp_path / 'bag', 2.0)
    reader = BagReader(tmp_path / 'bag')
    assert reader.counts == {'/ship/imu': 200, '/ship/heave': 200}
    stamps = [reader.decode(name, data).header.stamp
              for name, _, data in reader.messages(['/ship/heave'])]
    times = [stamp.sec * 10**9 + stamp.nanosec for stamp in stamps]
    assert abs(np.diff(times) / 1e7 - 1).max() < 1e-6
    row, = offline.replay(duration=2.0, rounds=1)
    assert row.ratio == pytest.approx(row.value / row.reference_value)


def test_memory_is_the_resident_memory_of_this_process():
    resident, growth = offline.memory(first=1.0, last=2.0)
    limit = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    for value in (resident.reference_value, resident.value):
        assert 0.2 * limit < value <= 1.01 * limit
    assert growth.value == pytest.approx(resident.value - resident.reference_value)


def test_cpu_time_is_the_kernels():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    mine = usage.ru_utime + usage.ru_stime
    assert mine - 0.1 < live.cpu_seconds(os.getpid()) < mine + 1.0


def test_predictor_and_echo_answer(monkeypatch, domain_id):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain_id))
    median, p99, late = live.latency(phases=2, per_phase=10)
    assert median.reference == p99.reference == 'echo'
    assert 0 < median.value <= p99.value and 0 < median.reference_value <= p99.reference_value
    assert 0 <= late.value <= 10


def test_the_recorder_gets_every_message(monkeypatch, domain_id):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain_id))
    lost, rate, cpu = live.recorder(rate=500, duration=0.5)
    assert (lost.value, lost.unit) == (0, 'of 250 messages')
    assert rate.value > 0 and cpu.value >= 0

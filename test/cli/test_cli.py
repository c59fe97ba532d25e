"""The command line: what it writes, says and returns."""

import json
import signal
import subprocess
import sys

import pytest

from deck_motion_ros.cli import main

NMEA = """\
2014-08-01T00:00:00.285000Z $INZDA,000000.17,01,08,2014,,*7E
2014-08-01T00:00:00.522000Z $INHDT,218.26,T*1A
"""


def run(capfd, *argv):
    """Run one command; return status, output and error output."""
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in argv])
    out, err = capfd.readouterr()
    return end.value.code or 0, out, err


def write_csv(path, rows=400):
    lines = ['t_s,roll_deg,pitch_deg,heave_m']
    lines += [f'{k / 4:.2f},{k % 8 - 4},{k % 5 - 2},{(k % 7 - 3) / 10}' for k in range(rows)]
    path.write_text('\n'.join(lines))
    return path


def test_import_replay_report(tmp_path, capfd):
    source = write_csv(tmp_path / 'ship.csv')
    params = tmp_path / 'my.yaml'
    params.write_text('/**:\n  ros__parameters:\n    lever_arm: [-35.0, 0.0, 0.0]\n')
    status, out, _ = run(capfd, 'import', source, tmp_path / 'bag')
    assert status == 0 and '400' in out
    status, out, _ = run(capfd, 'replay', tmp_path / 'bag', tmp_path / 'out', '--node',
                         'predictor', '--params-file', params, '-p', 'output_rate:=2.0')
    assert status == 0 and '800 messages in, 1000 out' in out
    status, out, _ = run(capfd, 'report', tmp_path / 'out', '-o', tmp_path / 'page.html')
    assert status == 0 and 'forecast with an error of' in out and 'stays as it is' in out
    assert '-35.0, 0.0, 0.0' in (tmp_path / 'page.html').read_text().replace('\u2212', '-')


def test_replay_and_report_under_other_names(tmp_path, capfd):
    """What a replay with two rules writes, a report with the same rules reads."""
    run(capfd, 'import', write_csv(tmp_path / 'ship.csv'), tmp_path / 'bag')
    out = tmp_path / 'out'
    rules = '--remap', 'touchdown/height:=/deck', '--remap', 'touchdown/forecast:=ahead'
    run(capfd, 'replay', tmp_path / 'bag', out, '--node', 'predictor', *rules)
    status, found, _ = run(capfd, 'report', out, '-o', tmp_path / 'page.html', *rules)
    assert status == 0 and 'forecast with an error of' in found
    status, found, _ = run(capfd, 'report', out, '-o', tmp_path / 'page.html')
    assert status == 0 and 'forecast with an error of' not in found
    status, _, err = run(capfd, 'report', out, '--remap', 'height')
    assert status == 2 and "'height' is no remapping" in err


def test_papers_json(tmp_path, capfd):
    status, out, _ = run(capfd, 'papers', 'Li2014', '--runs', '20', '--json', tmp_path / 'f.json')
    assert status == 0 and 'touchdown_rmse_3s' in out
    rows = {row['name']: row for row in json.loads((tmp_path / 'f.json').read_text())}
    assert {'touchdown_rmse_3s': 'm', 'pitch_paper_rmse_3s': 'deg', 'pitch_mru_rmse_3s': 'deg',
            'roll_mru_rmse_3s': 'deg', 'heave_mru_rmse_3s': 'm'}.items() <= {
        name: row['unit'] for name, row in rows.items()}.items()
    row = rows['touchdown_rmse_3s']
    assert set(row) == {'paper', 'name', 'value', 'unit', 'printed', 'floor'}
    assert row['printed'] is None and row['value'] == pytest.approx(row['floor'], rel=0.1)


@pytest.mark.parametrize('argv, words', [
    (['replay', 'nowhere', 'out', '--node', 'predictor'], 'nowhere: does not exist'),
    (['report', 'nowhere'], 'nowhere'),
    (['recover', 'nowhere'], 'nowhere'),
    (['import', 'nowhere.csv', 'out'], 'nowhere.csv'),
    (['papers', 'Nobody1999'], "unknown paper 'Nobody1999'; there are Li2014"),
    (['papers', '--runs', '0'], '--runs must be'),
    (['papers', 'Li2014', '--json', 'nowhere/f.json'], 'nowhere/f.json: there is no such folder'),
    (['report', '.', '--warm-up', 'nan'], 'warm-up must be'),
    (['report', '.', '--warm-up', '-1'], 'warm-up must be'),
    (['report', '.', '--lever-arm', 'inf', '0', '0'], 'lever arm and warm-up must be'),
    (['bench', 'nothing'], 'nothing'),
    (['demo', '--duration', '0'], '--duration must be'),
])
def test_wrong_input_ends_with_2_and_one_line(tmp_path, monkeypatch, capfd, argv, words):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capfd, *argv)
    assert status == 2
    assert err.startswith('error: ') and err.count('\n') == 1 and words in err
    assert not list(tmp_path.iterdir())


def test_a_page_that_cannot_be_written_and_a_node_with_nothing_to_say(tmp_path, capfd):
    run(capfd, 'import', write_csv(tmp_path / 'ship.csv', 20), tmp_path / 'bag')
    page = tmp_path / 'nowhere' / 'page.html'
    assert run(capfd, 'report', tmp_path / 'bag', '-o', page) == (
        2, '', f'error: {page}: No such file or directory\n')
    status, out, err = run(capfd, 'replay', tmp_path / 'bag', tmp_path / 'out', '--node',
                           'landing')
    assert status == 0 and ', 0 out' in out
    assert err == 'warning: landing has published nothing: no position yet\n'


def test_output_that_exists_is_not_touched(tmp_path, capfd):
    source = write_csv(tmp_path / 'ship.csv', 20)
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'mine').write_text('mine')
    status, _, err = run(capfd, 'import', source, tmp_path / 'bag')
    assert status == 2 and 'already exists' in err
    assert (tmp_path / 'bag' / 'mine').read_text() == 'mine'


def test_log_without_motion_is_refused(tmp_path, capfd):
    (tmp_path / 'log').write_text(NMEA)
    status, _, err = run(capfd, 'import', tmp_path / 'log', tmp_path / 'bag')
    assert status == 2 and err.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['log']


def test_ctrl_c_twice_ends_with_130_and_one_word(tmp_path, monkeypatch, capfd):
    cleared = []

    def interrupted(folder):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            cleared.append(folder)

    monkeypatch.setattr('deck_motion_ros.recording.recover', interrupted)
    try:
        assert run(capfd, 'recover', tmp_path) == (130, '', 'interrupted\n')
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    assert cleared == [tmp_path]


def test_help_does_not_wait_for_numpy():
    done = subprocess.run([sys.executable, '-X', 'importtime', '-m', 'deck_motion_ros', '--help'],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and 'replay' in done.stdout
    assert 'numpy' not in done.stderr


def test_demo_leaves_bag_and_report(tmp_path):
    done = subprocess.run(
        [sys.executable, '-m', 'deck_motion_ros', 'demo', '--duration', '6', '--output',
         str(tmp_path / 'demo')], capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    assert sorted(path.name for path in (tmp_path / 'demo').iterdir()) == ['bag', 'report.html']
    from deck_motion_ros.recording import BagReader

    counts = BagReader(tmp_path / 'demo' / 'bag').counts
    assert counts['/ship/imu'] == counts['/ship/heave'] == counts['/ship/truth'] == 300
    assert counts['/touchdown/height'] == counts['/touchdown/forecast'] == 60


def test_palmer_by_the_readme(data_dir, tmp_path, capfd):
    params = tmp_path / 'F.yaml'
    params.write_text('predictor:\n  ros__parameters:\n    lever_arm: [-35.0, 0.0, 0.0]\n')
    log = data_dir / 'nmea' / 'NBP1406_s330-2014-08-01'
    assert run(capfd, 'import', log, tmp_path / 'palmer')[0] == 0
    assert run(capfd, 'replay', tmp_path / 'palmer', tmp_path / 'out', '--node', 'predictor',
               '--params-file', params)[0] == 0
    status, out, _ = run(capfd, 'report', tmp_path / 'out', '--warm-up', '0', '-o',
                         tmp_path / 'palmer.html')
    assert status == 0
    first, second = out.splitlines()[:2]
    assert 0.2 < float(first.split('error of ')[1].split(' m')[0]) < 0.35
    assert float(second.split('wrong by ')[1].split(' m')[0]) == pytest.approx(2.25, abs=0.02)

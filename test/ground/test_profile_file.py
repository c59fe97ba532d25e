"""Ship profiles in files: the same numbers back, and no file that is not one."""

import os

import numpy as np
import pytest

from deck_motion_ros.profile_file import load_profile, save_profile


def profile():
    """Make a profile of two axes and one rival of order 2."""
    moments = np.random.default_rng(1).normal(size=(6, 6))
    return {'grid': np.array([0.1, 5.0, 0.0, 2.0]),
            'rival0': np.vstack([moments @ moments.T, np.full(6, 40.0)])}


def test_the_same_numbers_come_back(tmp_path):
    path = tmp_path / 'ship.npz'
    for scale in (1.0, 2.0):  # the second replaces the first
        saved = profile() | {'rival0': scale * profile()['rival0']}
        save_profile(path, saved)
        loaded = load_profile(path)
        assert loaded.keys() == saved.keys()
        assert all(np.array_equal(loaded[name], saved[name]) for name in saved)
    assert [item.name for item in tmp_path.iterdir()] == ['ship.npz']


def test_same_profile_same_bytes(tmp_path):
    for name in ('one', 'two'):
        save_profile(tmp_path / name, profile())
    assert (tmp_path / 'one').read_bytes() == (tmp_path / 'two').read_bytes()


def test_a_failed_save_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / 'ship.npz'
    save_profile(path, profile())
    before = path.read_bytes()

    def full(fd):
        raise OSError('no space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(OSError, match='no space'):
        save_profile(path, {'grid': np.ones(4)})
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ['ship.npz']


def changed(**arrays):
    return {'version': np.array(1), **profile(), **arrays}


BAD = {
    'wrong version': (changed(version=np.array(7)), 'version 7, not 1'),
    'no version': (profile(), 'not a ship profile'),
    'no grid': ({'version': np.array(1), 'rival0': profile()['rival0']}, 'not a ship profile'),
    'not a number': (changed(rival0=np.full((7, 6), np.nan)), "'rival0'.*not finite"),
    'not square': (changed(rival0=np.ones((6, 6))), r"'rival0'.*shape \(6, 6\)"),
    'not of these axes': (changed(rival0=np.ones((6, 5))), r"'rival0'.*shape \(6, 5\)"),
    'errors of other axes': (changed(errors=np.ones((7, 3, 4, 4))), r"'errors'.*shape"),
    'errors below zero': (changed(errors=-np.ones((7, 2, 4, 4))), "'errors'.*negative"),
    'scalar': (changed(rival0=np.array(1.0)), r"'rival0'.*shape"),
    'whole numbers': (changed(rival0=np.ones((7, 6), int)), "'rival0'.*int64"),
    'negative variances': (changed(rival0=-profile()['rival0']), "'rival0'.*negative"),
    'unknown axes': (changed(grid=np.array([0.1, 5.0, 0.0, 3.0])), "'grid'.*axes"),
    'no time step': (changed(grid=np.array([0.0, 5.0, 0.0, 2.0])), "'grid'.*time step"),
    'nothing of a grid': (changed(grid=np.zeros(0)), "'grid'"),
}


@pytest.mark.parametrize('kind', BAD)
def test_a_wrong_profile_is_named(tmp_path, kind):
    arrays, words = BAD[kind]
    path = tmp_path / 'ship.npz'
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=f'ship.npz: .*{words}'):
        load_profile(path)


def test_a_file_that_is_no_profile_is_named(tmp_path):
    path = tmp_path / 'ship.npz'
    save_profile(path, profile())
    whole = path.read_bytes()
    pickled = tmp_path / 'pickled.npz'
    np.savez(pickled, version=np.array({'a': 1}, dtype=object))
    for content in (b'', b'text', whole[:len(whole) // 2], pickled.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ValueError, match='ship.npz: not a ship profile') as error:
            load_profile(path)
        assert '\n' not in str(error.value)
    for there in (tmp_path / 'none.npz', tmp_path):
        with pytest.raises(ValueError, match=str(there)):
            load_profile(there)

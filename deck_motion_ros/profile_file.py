"""Ship profiles in files: what the predictor learned, kept for its next start."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any
from zipfile import BadZipFile

import numpy as np

from deck_motion_ros.samples import Array, AXES

VERSION = 1


def save_profile(path: Path, profile: Mapping[str, Array]) -> None:
    """
    Write a profile as npz, whole or not at all: a file of that name is replaced in one step.

    Parameters
    ----------
    path : Path
        In a folder that exists.
    profile : mapping of str to ndarray
        Of :meth:`deck_motion_ros.estimators.adaptive.AdaptivePredictor.profile`.

    Raises
    ------
    OSError
        If it cannot be written.

    """
    arrays: dict[str, Any] = {'version': np.array(VERSION), **profile}
    with NamedTemporaryFile(dir=path.parent, prefix=f'.{path.name}.', delete=False) as file:
        try:
            np.savez(file, **arrays)
            file.flush()
            os.fsync(file.fileno())
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def load_profile(path: Path) -> dict[str, Array]:
    """
    Read a profile.

    Raises
    ------
    ValueError
        If there is no such file or it is not a profile of this version; the text says which file
        and what is wrong.

    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
    except FileNotFoundError:
        raise ValueError(f'{path}: there is no such profile') from None
    except (OSError, ValueError, EOFError, TypeError, AttributeError, BadZipFile):
        raise ValueError(f'{path}: not a ship profile') from None
    version = arrays.pop('version', None)
    if version is None or 'grid' not in arrays:
        raise ValueError(f'{path}: not a ship profile')
    if version.shape or version != VERSION:
        raise ValueError(f'{path}: a ship profile of version {version}, not {VERSION}')
    for name, array in arrays.items():
        fault = _fault(name, array, arrays['grid'])
        if fault:
            raise ValueError(f"{path}: '{name}' of this ship profile {fault}")
    return arrays


def _fault(name: str, array: Array, grid: Array) -> str:
    """Say what is wrong with one array of a profile, ``''`` if nothing is."""
    if array.dtype != np.float64:
        return f'holds {array.dtype}, not float64'
    if not np.isfinite(array).all():
        return 'holds numbers that are not finite'
    if name == 'grid':
        axes = array[2:].tolist() if array.ndim == 1 else []
        wrong = not axes or sorted({*axes} & {*range(len(AXES))}) != axes or array[:2].min() <= 0
        return 'names no axes and time step' if wrong else ''
    size = array.shape[-1] if array.ndim else 0
    if name == 'errors':
        if array.ndim != 4 or array.shape[1:3] != (len(grid) - 2, size):
            return f'has shape {array.shape}'
        return 'holds negative variances' if np.einsum('hajj->haj', array).min() < 0 else ''
    if array.shape != (size + 1, size) or size % (len(grid) - 2):
        return f'has shape {array.shape}'
    return 'holds negative variances' if array.diagonal().min() < 0 or array[-1].min() < 0 else ''

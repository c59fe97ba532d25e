"""When the predictor's ship profile is read and written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.profile_file import load_profile, save_profile
from deck_motion_ros.samples import Array, nanoseconds


class ProfileKeeper:
    """
    Load a ship profile at the start; save one every ``EVERY`` seconds of stamps and at the end.

    Parameters
    ----------
    config : PredictorConfig
        Names the files.
    warn : callable
        Takes a warning if a file cannot be written, or serves no purpose.

    Attributes
    ----------
    loaded : dict of str to ndarray
        The profile to start with; empty if there is none.

    Raises
    ------
    ValueError
        If the profile cannot be read or the folder to save in does not exist.

    """

    EVERY = 60.0

    def __init__(self, config: PredictorConfig, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self._path: Path | None = None
        self._due: int | None = None
        self.loaded: dict[str, Array] = {}
        if config.method != 'adaptive':
            if config.profile or config.save_profile:
                warn(f'method {config.method} has no ship profile: none is loaded or saved')
            return
        if config.save_profile:
            self._path = Path(config.save_profile)
            if not self._path.parent.is_dir():
                raise ValueError(f'{self._path}: there is no such folder')
        first = config.profile == config.save_profile and not Path(config.profile).exists()
        if config.profile and not first:
            self.loaded = load_profile(Path(config.profile))

    def update(self, stamp: int, predictor: TouchdownPredictor) -> None:
        """Save if that is due at a stamp (ns)."""
        if self._path is None:
            return
        every = nanoseconds(self.EVERY)
        if self._due is None or stamp < self._due - every:  # the start, or a clock set anew
            self._due = stamp + every
        elif stamp >= self._due:
            self._due = stamp + every
            self.save(predictor)

    def save(self, predictor: TouchdownPredictor) -> None:
        """Save what the predictor has learned, if anything."""
        profile = predictor.profile()
        if self._path is None or not profile:
            return
        try:
            save_profile(self._path, profile)
        except OSError as error:
            self._warn(f'ship profile not saved: {error}')

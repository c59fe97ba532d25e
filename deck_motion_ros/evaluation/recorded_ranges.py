"""
Real ranges without inertial units: ``python -m deck_motion_ros.evaluation.recorded_ranges DIR``.

Prints how far the landing estimator is from the recorded truth. What is assumed beyond the
anchors is what ``deck_motion import`` writes: Hanyang, a person who walks with the radio in hand:
speeds of about 1 m/s, hardly any vertical acceleration, ranges good to 0.2 m and 1 %. Plaza1, a
mower on a plane whose radios read some percent too long (7 % turns out), each with a bias of its
own.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
import sys

import numpy as np

from deck_motion_ros.estimators.landing import LandingConfig, LandingEstimate, LandingEstimator
from deck_motion_ros.evaluation.rows import Row
from deck_motion_ros.importers import CARRIED, DRIVEN
from deck_motion_ros.samples import Array, nanoseconds, RangeSample, Rejected, seconds

RADIO_HEIGHT = 1.1  # m


@dataclass(frozen=True, eq=False)
class Followed:
    """
    Estimates against the truth.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Seconds from the first estimate.
    error : ndarray, shape (n, 3)
        m.
    cov : ndarray, shape (n, 3, 3)
        What the estimator says of it.

    """

    times: Array
    error: Array
    cov: Array

    def rmse(self, axes: slice = slice(3), start: float = 0.0) -> float:
        """Return the root mean square error over some axes from ``start`` (s) on."""
        error = self.error[self.times >= start, axes]
        return sqrt(float(np.mean(np.sum(np.square(error), axis=1))))

    def sd(self, axes: slice = slice(3), start: float = 0.0) -> float:
        """Return what the estimator says that should be."""
        cov = self.cov[self.times >= start, axes, axes]
        return sqrt(float(np.mean(np.trace(cov, axis1=1, axis2=2))))


def followed(folder: Path, name: str, config: LandingConfig) -> Followed:
    """
    Let the estimator follow a record.

    Parameters
    ----------
    folder : Path
        Of NAME_anchors.csv, NAME_ranges.csv and NAME_truth.csv.
    name : str
        Of the record.
    config : LandingConfig
        Everything but the anchors.

    """
    anchors = {row['anchor_id']: _place(row) for row in _rows(folder, name, 'anchors')}
    estimator = LandingEstimator(replace(
        config, anchor_frames=tuple(anchors),
        anchor_positions=tuple(np.ravel([*anchors.values()]).tolist())))
    estimates: list[LandingEstimate] = []
    for row in _rows(folder, name, 'ranges'):
        stamp = nanoseconds(float(row['t_s']) + 1.0)  # no stamp is below 0
        try:
            estimates += estimator.update('uwb/range', RangeSample(
                stamp, row['anchor_id'], float(row['range_m']), 0.0))
        except Rejected:
            pass  # the records have duplicates, and clocks that go back
    truth = [*_rows(folder, name, 'truth')]
    when = np.array([float(row['t_s']) for row in truth]) + 1.0
    places = np.array([_place(row) for row in truth])
    times = np.array([seconds(item.stamp) for item in estimates])
    there = (times >= when[0]) & (times <= when[-1])
    true = np.stack([np.interp(times, when, column) for column in places.T], axis=1)
    error = np.array([item.position for item in estimates]) - true
    cov = np.array([item.cov[:3, :3] for item in estimates])
    return Followed(times[there] - times[0], error[there], cov[there])


def _rows(folder: Path, name: str, what: str) -> list[dict[str, str]]:
    with (folder / f'{name}_{what}.csv').open(newline='') as file:
        return [*csv.DictReader(file)]


def _place(row: dict[str, str]) -> tuple[float, float, float]:
    return (float(row['x_m']), float(row['y_m']), float(row.get('z_m', 0.0)))


def recorded_ranges(folder: Path) -> list[Row]:
    """
    Follow the Hanyang and Plaza1 records.

    The Hanyang truth starts at height 0, and the ranges from less than 6 m put the radio 1.05 and
    1.15 m above it: ``_radio`` takes the truth for the ground below the radio.

    Parameters
    ----------
    folder : Path
        Of the records.

    """
    rows = []
    carried = replace(CARRIED, antenna_lever_arm=(0.0, 0.0, RADIO_HEIGHT))
    for case, name in (('a', 'hanyang_los_trajectory_a_case_1'),
                       ('b', 'hanyang_los_trajectory_b_case_3')):
        for suffix, config in (('', CARRIED), ('_radio', carried)):
            walk = followed(folder, name, config)
            rows += [Row('Hanyang', f'rmse_{case}{suffix}', walk.rmse(), 'm'),
                     Row('Hanyang', f'sd_{case}{suffix}', walk.sd(), 'm')]
    mower, plane = followed(folder, 'plaza1', DRIVEN), slice(2)
    return [*rows, Row('Plaza1', 'rmse_after_300s', mower.rmse(plane, 300.0), 'm'),
            Row('Plaza1', 'sd_after_300s', mower.sd(plane, 300.0), 'm'),
            Row('Plaza1', 'rmse', mower.rmse(plane), 'm')]


if __name__ == '__main__':
    for figure in recorded_ranges(Path(sys.argv[1])):
        print(f'{figure.paper:10s} {figure.name:20s} {figure.value:7.3f} {figure.unit}')

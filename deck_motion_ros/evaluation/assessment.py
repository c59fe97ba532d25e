"""The forecasts of a bag, judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from deck_motion_ros.estimators.scoring import useful_horizon
from deck_motion_ros.evaluation.floor import estimated_floor
from deck_motion_ros.evaluation.metrics import Comparison, crest_errors, crests, Series
from deck_motion_ros.evaluation.record import Record
from deck_motion_ros.samples import Array, AXES, NANOSECONDS, nanoseconds

FLOOR_STEP = 0.25  # s at least between the samples of which the floor is estimated
FLOOR_SAMPLES = 10_000  # at most: 40 minutes of these, below a second of work
FLOOR_LENGTH = 180.0  # s without a gap at least


@dataclass(frozen=True, eq=False)
class Assessment:
    """
    The forecasts of a bag, judged.

    Attributes
    ----------
    warm_up : float
        Seconds from the first measurement that are left out of everything but ``whole``.
    whole, judged : Comparison
        Height of the touchdown point at the predictor's horizon.
    horizons : list of Comparison
        The same for every horizon of the forecast.
    floor : ndarray, shape (horizons,)
        Estimate of the least error that is possible (m), see :func:`floor_of`.
    axes : dict of str to Comparison
        Roll and pitch (rad) at the predictor's horizon, if the forecast has it.
    crests : ndarray
        Announced minus true time (s) of crests 2 to 4 s ahead.
    reference : Series
        Height that came (m).
    absent : list of str
        Axes that never came and count as 0.

    """

    warm_up: float
    whole: Comparison
    judged: Comparison
    horizons: list[Comparison]
    floor: Array
    axes: dict[str, Comparison]
    crests: Array
    reference: Series
    absent: list[str]

    @property
    def useful(self) -> float:
        """Longest horizon (s) at which the error stays below half the motion."""
        return useful_horizon([item.horizon for item in self.horizons],
                              [item.share for item in self.horizons])


def assessed(record: Record, warm_up: float | None = None) -> Assessment | None:
    """
    Judge the forecasts of a record.

    Parameters
    ----------
    record : Record
        What a bag holds.
    warm_up : float, optional
        Seconds to leave out at the start; 120 if the record is longer than 5 minutes, else 20.

    Returns
    -------
    Assessment or None
        ``None`` where there is nothing to judge, or no lever arm to judge it with.

    """
    if record.height is None or record.lever_arm is None or not record.motion:
        return None
    start, end = record.span
    if warm_up is None:
        warm_up = 120.0 if end - start > 300 * NANOSECONDS else 20.0
    judged_from = start + nanoseconds(warm_up)
    came, was = record.came(), record.was()
    whole = record.height.against(came, was)[0]
    judged = whole.issued_from(judged_from)
    if not len(judged):
        return None
    axes: dict[str, Comparison] = {}
    horizons: list[Comparison] = []
    errors = np.empty(0)
    densest = max(record.truth if any(record.truth) else record.measured,
                  key=lambda axis: len(axis) if axis else 0)
    assert densest is not None
    reference = Series.of(densest.stamps, came(densest.stamps))
    if record.forecast:
        horizons = [part for item in record.forecast['height'].against(came, was)
                    if len(part := item.issued_from(judged_from))]
        for axis, name in enumerate(AXES[:2]):
            for item in record.forecast[name].against(record.came(axis), record.was(axis)):
                if abs(item.horizon - judged.horizon) < 0.01 and len(item):
                    axes[name] = item.issued_from(judged_from)
        ahead = record.forecast['height']
        late = ahead.issued_at >= judged_from
        errors = crest_errors((ahead.issued_at[late] - reference.stamps[0]) / NANOSECONDS,
                              ahead.horizons, ahead.mean[late], crests(reference))
    absent = [name for name in AXES if name not in record.motion]
    floor = floor_of(record, [item.horizon for item in horizons])
    return Assessment(warm_up, whole, judged, horizons, floor, axes, errors, reference, absent)


def floor_of(record: Record, horizons: Sequence[float]) -> Array:
    """
    **Estimate** the least error possible from the record itself; see :func:`estimated_floor`.

    From its longest stretch without a gap, the latest part of it if it is long. Where the truth is
    known, the measurement noise is taken out.

    Parameters
    ----------
    record : Record
        With a lever arm.
    horizons : sequence of float
        Seconds ahead, increasing.

    Returns
    -------
    ndarray, shape (horizons,)
        Rms error of the height (m); NaN where the record does not tell.

    """
    assert record.lever_arm is not None
    unknown = np.full(len(horizons), np.nan)
    forward, left, _ = record.lever_arm
    axes = record.measured if any(record.measured) else record.truth
    moving = [(axis, weight) for axis, weight in zip(axes, (left, -forward, 1.0), strict=True)
              if axis and np.ptp(axis.values) > 0]
    if not moving or not horizons:
        return unknown
    step = max(FLOOR_STEP, *(axis.period for axis, _ in moving))
    stamps = np.arange(max(axis.stamps[0] for axis, _ in moving),
                       min(axis.stamps[-1] for axis, _ in moving), nanoseconds(step))
    rows = np.stack([axis.at(stamps) for axis, _ in moving], axis=-1)
    gaps = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    before, after = max(pairwise([-1, *gaps.tolist(), len(rows)]),
                        key=lambda ends: ends[1] - ends[0])
    run = slice(max(before + 1, after - FLOOR_SAMPLES), after)
    if step * (run.stop - run.start) < FLOOR_LENGTH:
        return unknown
    noise = record.was()(stamps[run]) - record.came()(stamps[run])
    grid = step * np.arange(1, int(horizons[-1] / step) + 2)
    found = estimated_floor(rows[run] - rows[run].mean(axis=0), step,
                            [weight for _, weight in moving], grid.tolist())
    square = np.interp(horizons, grid, found**2, left=np.nan) - np.nanvar(noise)
    return np.sqrt(np.where(square > 0, square, np.nan))

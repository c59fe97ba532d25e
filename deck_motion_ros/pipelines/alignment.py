"""The alignment between its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.estimators.alignment import (
    Aligner,
    AlignmentConfig,
    AlignmentEstimate,
    ARCMIN,
)
from deck_motion_ros.messages import Types
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, Status, WARN
from deck_motion_ros.samples import Vector3, VectorSample

ERROR = 2
UNKNOWN = 1e6  # m^2: variance of the position, which is not estimated
SURPRISED = 2.0  # mean normalised squared innovation
STRANGE = 4.0  # sd by which a bias may be off its grade
LATE = 0.05  # s
WINDOW = 1.0  # s


class AlignmentPipeline(Pipeline):
    """Two inertial units and a velocimeter in, misalignment and attitude out."""

    node = 'alignment'
    config_class = AlignmentConfig

    def __init__(self, config: AlignmentConfig, types: Types,
                 warn: Callable[[str], None]) -> None:
        super().__init__(config, types, warn)
        self._aligner = Aligner(config)

    def _update(self, topic: str, sample: Any) -> list[AlignmentEstimate]:
        return self._aligner.update(topic, sample)

    def _messages(self, estimate: AlignmentEstimate) -> Iterator[tuple[str, Any]]:
        config, types = self.config, self._types
        forward, left, up = estimate.misalignment.tolist()
        misalignment: Vector3 = (forward, left, up)
        yield 'alignment/misalignment', messages.vector_message(types, VectorSample(
            estimate.stamp, config.uav_base_link_frame, misalignment))
        cov = UNKNOWN * np.eye(6)
        cov[3:, 3:] = estimate.attitude_cov
        yield 'alignment/attitude', messages.pose_message(
            types, estimate.stamp, config.map_frame, (0.0, 0.0, 0.0), estimate.orientation, cov)

    def _state(self) -> tuple[int, str]:
        aligner = self._aligner
        if aligner.refused:
            return ERROR, f'refused: clocks differ from that of slave/imu: {aligner.refused}'
        silent = [name for name in self._topics if not self.accepted[name]]
        if silent and silent != ['ldv/velocity']:
            return WARN, f"nothing joined yet: no {', '.join(silent)}"
        troubles = [text for text, holds in (
            (f'innovations {aligner.surprise:.1f} times their size',
             aligner.surprise > SURPRISED),
            ('accelerometers off their grade, or latitude_deg wrong',
             aligner.bias_excess() > STRANGE),
            (f'reference {1e3 * aligner.skew:.0f} ms late, or vibration left that much velocity',
             abs(aligner.skew) > LATE),
            (f'launched after {aligner.window:.1f} s of velocity matching',
             aligner.stroke > 0 and aligner.window < WINDOW),
            (f'{aligner.saturated} samples of slave/imu saturated', aligner.saturated > 0),
            ('launch broken off', aligner.phase == 'aborted'),
            ('no ldv/velocity', bool(silent))) if holds]
        return (WARN if troubles else OK), '; '.join([aligner.phase, *troubles])

    def _counts(self) -> dict[str, str]:
        aligner = self._aligner
        return {'join drops': str(aligner.dropped), 'gaps of slave/imu': str(aligner.gaps),
                'saturated': str(aligner.saturated), 'velocimeter jumps': str(aligner.jumps),
                'launches broken off': str(aligner.aborts), 'restarts': str(aligner.restarts)}

    def _statuses(self) -> list[Status]:
        aligner = self._aligner
        direction, worst_sd = aligner.least_observable()
        sd = aligner.misalignment_sd() / ARCMIN
        innovation = aligner.filter.innovation if aligner.filter else np.empty(0)
        values = {
            'phase': aligner.phase,
            'window (s)': f'{aligner.window:.2f}',
            'stroke (s)': f'{aligner.stroke:.2f}',
            'innovations, mean square': f'{aligner.surprise:.2f}',
            'innovation (sd)': ', '.join(f'{value:.2f}' for value in innovation),
            'largest fading factor': f'{aligner.largest_factor:.1f}',
            'sd forward, left, up (arcmin)': ', '.join(f'{value:.3f}' for value in sd),
            'least observable direction': ', '.join(f'{value:.3f}' for value in direction),
            'least observable sd (arcmin)': f'{worst_sd / ARCMIN:.3f}',
            'skew (ms)': f'{1e3 * aligner.skew:.1f}',
            'stamp jitter (ms)': f'{1e3 * aligner.jitter:.3f}'}
        return [(f'{self.node}: filter', OK, aligner.phase, values)]

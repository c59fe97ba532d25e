"""The landing estimator between its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.estimators.landing import LandingConfig, LandingEstimate, LandingEstimator
from deck_motion_ros.messages import Types
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, Status, WARN

PARALLEL = (0.0, 0.0, 0.0, 1.0)  # child and parent axes are the same


class LandingPipeline(Pipeline):
    """Ranges and inertial data in, the aircraft over the deck out."""

    node = 'landing'
    config_class = LandingConfig

    def __init__(self, config: LandingConfig, types: Types, warn: Callable[[str], None]) -> None:
        super().__init__(config, types, warn)
        self._estimator = LandingEstimator(config)
        self._newest: LandingEstimate | None = None
        if config.is_flat():
            warn('all anchors are in one plane: the aircraft is taken to be above it, and its '
                 'height is poor near it')

    def _update(self, topic: str, sample: Any) -> list[LandingEstimate]:
        return self._estimator.update(topic, sample)

    def _messages(self, estimate: LandingEstimate) -> Iterator[tuple[str, Any]]:
        config, types = self.config, self._types
        self._newest = estimate
        pose_cov, twist_cov = np.zeros((2, 6, 6))
        pose_cov[:3, :3], twist_cov[:3, :3] = estimate.cov[:3, :3], estimate.cov[3:, 3:]
        position, velocity = estimate.position.tolist(), estimate.velocity.tolist()
        yield 'landing/odometry', messages.estimate_message(
            types, estimate.stamp, config.deck_frame, config.uav_deck_frame, position, PARALLEL,
            pose_cov, velocity, (0.0, 0.0, 0.0), twist_cov)
        yield 'landing/pose', messages.pose_message(
            types, estimate.stamp, config.deck_frame, position, PARALLEL, pose_cov)

    def _state(self) -> tuple[int, str]:
        if not self._outputs:
            return WARN, 'no position yet'
        doubts = ' or '.join(f'{anchor} ({100 * probability:.0f} %)'
                             for anchor, probability in self._estimator.doubts().items())
        if doubts:
            return WARN, f'ranges of {doubts} contradict the others'
        return OK, self._estimator.accuracy()

    def _counts(self) -> dict[str, str]:
        outliers = sorted(self._estimator.outliers.items())
        return {'accuracy': self._estimator.accuracy(), 'starts': str(self._estimator.opened),
                'restarts': str(self._estimator.restarts),
                **{f'outliers {anchor}': str(count) for anchor, count in outliers}}

    def _statuses(self) -> list[Status]:
        if self._newest is None:
            return []
        factors = self._estimator.dilution(self._newest.position)
        sds = np.sqrt(np.diag(self._newest.cov)[:3])
        values = {f'dilution {axis}': f'{factor:.2f}'
                  for axis, factor in zip('xyz', factors.tolist(), strict=True)}
        values |= {f'sd {axis}': f'{sd:.3f}' for axis, sd in zip('xyz', sds.tolist(), strict=True)}
        flat = self.config.is_flat()
        return [(f'{self.node}: geometry', WARN if flat else OK,
                 'anchors in one plane' if flat else 'anchors in space', values)]

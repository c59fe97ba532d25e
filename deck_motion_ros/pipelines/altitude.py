"""The altitude estimator between its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.estimators.altitude import (
    AltitudeConfig,
    AltitudeEstimate,
    AltitudeEstimator,
)
from deck_motion_ros.messages import Types
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, Status, WARN

UNKNOWN = 1e6  # m^2, rad^2 ...: variance of what is not estimated
SILENT = 2.0  # s
UNSAFE = ('combined is unsafe: nothing ties its height to a measurement, and it diverges after '
          'about 30 s')
DROP_OUTS = ('not finite', 'outside min_range and max_range', 'no echo')


class AltitudePipeline(Pipeline):
    """Altimeter and accelerometer in, height above mean sea level out."""

    node = 'altitude'
    config_class = AltitudeConfig

    def __init__(self, config: AltitudeConfig, types: Types,
                 warn: Callable[[str], None]) -> None:
        super().__init__(config, types, warn)
        self._estimator = AltitudeEstimator(config)
        if config.method == 'combined':
            warn(UNSAFE)

    def _update(self, topic: str, sample: Any) -> list[AltitudeEstimate]:
        return self._estimator.update(sample)

    def _messages(self, estimate: AltitudeEstimate) -> Iterator[tuple[str, Any]]:
        pose_cov, twist_cov = UNKNOWN * np.stack([np.eye(6), np.eye(6)])
        pose_cov[2, 2], twist_cov[2, 2] = estimate.cov[0, 0], estimate.cov[1, 1]
        yield 'altitude/odometry', messages.estimate_message(
            self._types, estimate.stamp, self.config.mean_sea_frame, self.config.uav_level_frame,
            (0.0, 0.0, estimate.height), (0.0, 0.0, 0.0, 1.0), pose_cov,
            (0.0, 0.0, estimate.rate), (0.0, 0.0, 0.0), twist_cov)

    def _state(self) -> tuple[int, str]:
        estimator = self._estimator
        if not self._outputs:
            return WARN, 'no output yet: needs uav/imu, and a range or initial_height'
        if estimator.silence > SILENT:
            return WARN, f'no range that fits for {estimator.silence:.0f} s'
        if self.config.use_rate and not estimator.uses_rates:
            return WARN, 'altimeter/rate does not fit and is not used'
        if self.config.method == 'combined':
            return WARN, UNSAFE
        return OK, 'estimating'

    def _counts(self) -> dict[str, str]:
        drop_outs = sum(self._rejected[f'altimeter/range: {reason}'] for reason in DROP_OUTS)
        counts = self._estimator.counts
        return {'altimeter drop-outs': str(drop_outs),
                **{name: str(count) for name, count in sorted(counts.items())}}

    def _statuses(self) -> list[Status]:
        estimator = self._estimator
        sea = estimator.belief.waves.sea
        values = {
            'significant wave height (m)': f'{sea.height:.2f}',
            'mean wave period (s)': f'{sea.mean_period:.1f}',
            'range innovations, mean square': f'{estimator.ranges.mean:.2f}',
            'rate innovations, mean square': f'{estimator.rates.mean:.2f}',
            'height sd (m)': f'{estimator.height_sd:.3f}',
            'unobservable': 'height against altimeter bias: both may be off by as much, in '
                            'opposite directions',
            'unobservable sd (m)': f'{estimator.unobservable_sd:.3f}'}
        return [(f'{self.node}: filter', OK, f'sea of {sea.height:.1f} m', values)]

"""The predictor between its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from deck_motion_ros import messages
from deck_motion_ros.estimators.scoring import RunningScore
from deck_motion_ros.estimators.touchdown import (
    FORECAST_TIMES,
    PredictorConfig,
    TouchdownPrediction,
    TouchdownPredictor,
)
from deck_motion_ros.messages import Types
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, Status, WARN
from deck_motion_ros.pipelines.profile import ProfileKeeper
from deck_motion_ros.pipelines.score import score_status
from deck_motion_ros.samples import TouchdownForecast, TouchdownPose

SCORED = (1.0, 2.0, 3.0, 5.0, 8.0, 10.0)  # s ahead, and the node's horizon


class PredictorPipeline(Pipeline):
    """Ship motion in, the touchdown point ahead out."""

    node = 'predictor'
    config_class = PredictorConfig

    def __init__(self, config: PredictorConfig, types: Types,
                 warn: Callable[[str], None]) -> None:
        super().__init__(config, types, warn)
        self._keeper = ProfileKeeper(config, warn)
        self._predictor = TouchdownPredictor(config, self._keeper.loaded)
        self._lookout = config.lookout()
        # what is scored among the times of the forecast and, last, the node's horizon
        times = [*FORECAST_TIMES.tolist(), config.horizon]
        self._scored = [times.index(time) for time in sorted({*SCORED, config.horizon})]
        self._start_score()

    def _start_score(self) -> None:
        self._restarts = self._predictor.restarts
        self._score = RunningScore(self.config.lever_arm, sorted({*SCORED, self.config.horizon}))

    def _update(self, topic: str, sample: Any) -> list[TouchdownPrediction]:
        made = self._predictor.update(sample)
        self._keeper.update(sample.stamp, self._predictor)
        if self._predictor.restarts > self._restarts:
            self._start_score()
        for axis, value, var in self._predictor.measured:
            self._score.measure(axis, sample.stamp, value, var)
        return made

    def _messages(self, estimate: TouchdownPrediction) -> Iterator[tuple[str, Any]]:
        config, types = self.config, self._types
        yield 'touchdown/height', messages.point_message(
            types, estimate.valid_at, config.touchdown_rest_frame, estimate.height)
        pose = estimate.pose()
        yield 'touchdown/prediction', messages.touchdown_message(
            types, pose, config.ship_level_frame, config.touchdown_frame)
        forecast = estimate.forecast()
        self._keep(estimate, pose, forecast)
        yield 'touchdown/forecast', messages.forecast_message(
            types, forecast, config.ship_level_frame, config.touchdown_frame)
        yield 'touchdown/forecast_sd', messages.forecast_sd_message(
            types, forecast, config.ship_level_frame)
        window = self._lookout.update(estimate)
        if window is not None:
            yield 'touchdown/window', messages.window_message(types, window)

    def _keep(self, estimate: TouchdownPrediction, pose: TouchdownPose,
              forecast: TouchdownForecast) -> None:
        """Keep a forecast until what came can be compared."""
        if self._score.is_due(estimate.issued_at):
            mean = np.append(forecast.height, estimate.height)
            var = np.append(forecast.height_sd**2, pose.pose_cov[2, 2])
            self._score.forecast(estimate.issued_at, mean[self._scored], var[self._scored])

    def close(self) -> None:
        """Save the ship profile, if one is to be kept."""
        self._keeper.save(self._predictor)

    def _statuses(self) -> list[Status]:
        return [score_status(self._score.scores(), self.config.horizon, self._score.window)]

    def _state(self) -> tuple[int, str]:
        if self.accepted:
            return OK, 'predicting'
        return WARN, 'no usable message yet'

    def _counts(self) -> dict[str, str]:
        return {'restarts': str(self._predictor.restarts)}

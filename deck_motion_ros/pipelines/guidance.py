"""The guidance between its topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isfinite
from typing import Any

from deck_motion_ros import messages
from deck_motion_ros.estimators.guidance import Command, Guidance, GuidanceConfig
from deck_motion_ros.messages import Types
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, Status, WARN


class GuidancePipeline(Pipeline):
    """Position over the deck and forecasts in, velocity commands out."""

    node = 'guidance'
    config_class = GuidanceConfig

    def __init__(self, config: GuidanceConfig, types: Types, warn: Callable[[str], None]) -> None:
        super().__init__(config, types, warn)
        self._guidance = Guidance(config)
        self._newest: Command | None = None

    def _update(self, topic: str, sample: Any) -> list[Command]:
        return self._guidance.update(topic, sample)

    def _messages(self, estimate: Command) -> Iterator[tuple[str, Any]]:
        self._newest = estimate
        yield 'landing/cmd_vel', messages.twist_message(
            self._types, estimate.stamp, self.config.deck_frame, estimate.velocity)

    def _state(self) -> tuple[int, str]:
        if self._newest is None:
            return WARN, 'no position of the aircraft yet'
        if self.config.method == 'forecast' and not self.accepted['touchdown/forecast']:
            return WARN, f'{self._newest.phase}, without a forecast of the deck'
        return OK, self._newest.phase

    def _counts(self) -> dict[str, str]:
        return {'aborts': str(self._guidance.aborts), 'restarts': str(self._guidance.restarts)}

    def _statuses(self) -> list[Status]:
        if self._newest is None:
            return []
        left = self._newest.touchdown_in
        values = {'touchdown_in': f'{left:.1f}' if isfinite(left) else ''}
        return [(f'{self.node}: phase', OK, self._newest.phase, values)]

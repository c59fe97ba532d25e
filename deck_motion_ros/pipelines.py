"""Message in, messages out: what a live node and a replay do alike, without ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from typing import Any

from deck_motion_ros import messages
from deck_motion_ros.estimators.touchdown import PredictorConfig, TouchdownPredictor
from deck_motion_ros.messages import Types
from deck_motion_ros.samples import Rejected
from deck_motion_ros.topics import inputs

OK, WARN = 0, 1
Status = tuple[str, int, str, dict[str, str]]


class PredictorPipeline:
    """
    The predictor between its topics.

    Parameters
    ----------
    config : PredictorConfig
    types : Types
        Message classes of the outputs.
    warn : callable
        Takes each warning, once.

    Attributes
    ----------
    accepted : Counter
        Messages used, by topic.

    """

    node = 'predictor'
    config_class = PredictorConfig

    def __init__(self, config: PredictorConfig, types: Types,
                 warn: Callable[[str], None]) -> None:
        self.config = config
        self._types = types
        self._warn = warn
        self._predictor = TouchdownPredictor(config)
        self._converters: Mapping[str, Callable[[Any], Any]] = {
            'ship/imu': messages.imu_sample,
            'ship/heave': messages.heave_sample,
            'ship/odometry': messages.odometry_sample}
        frames = {'ship/imu': config.ship_base_link_frame}
        self._frames = {topic: frames.get(topic, config.ship_level_frame)
                        for topic in self._converters}
        self.accepted: Counter[str] = Counter()
        self._rejected: Counter[str] = Counter()
        self._odd: Counter[str] = Counter()
        self._outputs = 0

    def take(self, topic: str, msg: Any) -> Iterator[tuple[str, Any]]:
        """
        Use one message of an input topic; give the (topic, message) pairs to publish, in order.

        A message that cannot be used is counted by its reason and warned of once per reason.
        """
        try:
            sample = self._converters[topic](msg)
            predictions = self._predictor.update(sample)
        except Rejected as rejection:
            self._count(self._rejected, f'{topic}: {rejection.reason}', 'rejected')
            return
        self.accepted[topic] += 1
        if sample.frame_id != self._frames[topic]:
            self._count(self._odd, f'{topic}: unexpected frame_id', f'used; it is '
                        f"'{sample.frame_id}' where '{self._frames[topic]}' is expected")
        config, types = self.config, self._types
        for prediction in predictions:
            self._outputs += 1
            yield 'touchdown/height', messages.point_message(
                types, prediction.valid_at, config.touchdown_rest_frame, prediction.height)
            yield 'touchdown/prediction', messages.touchdown_message(
                types, prediction.pose(), config.ship_level_frame, config.touchdown_frame)
            forecast = prediction.forecast()
            yield 'touchdown/forecast', messages.forecast_message(
                types, forecast, config.ship_level_frame, config.touchdown_frame)
            yield 'touchdown/forecast_sd', messages.forecast_sd_message(
                types, forecast, config.ship_level_frame)

    def _count(self, counter: Counter[str], key: str, what: str) -> None:
        counter[key] += 1
        if counter[key] == 1:
            self._warn(f'{key} ({what}; counted from here on)')

    def diagnostics(self) -> list[Status]:
        """Report input and settings as (name, level, message, values)."""
        silent = [topic.name for topic in inputs(self.node) if not self.accepted[topic.name]]
        waiting = 'ship/odometry' in silent and len(silent) == 3
        level, text = OK, 'predicting'
        if waiting:
            level, text = WARN, 'no usable message yet'
        elif self._rejected:
            text = f'predicting, {sum(self._rejected.values())} messages rejected'
        values = {'outputs': str(self._outputs), 'restarts': str(self._predictor.restarts)}
        for word, counter in (('accepted', self.accepted), ('rejected', self._rejected),
                              ('odd', self._odd)):
            values |= {f'{word} {key}': str(count) for key, count in sorted(counter.items())}
        return [(f'{self.node}: input', level, text, values),
                (f'{self.node}: settings', OK, self.config.method, settings(self.config))]


def settings(config: Any) -> dict[str, str]:
    """
    Write a configuration as text by name; lists with ``', '`` between the elements.

    >>> settings(PredictorConfig())['lever_arm']
    '-67.97, 3.05, 19.5'
    """
    values = {item.name: getattr(config, item.name) for item in fields(config)}
    return {name: ', '.join(map(str, value)) if isinstance(value, tuple) else str(value)
            for name, value in values.items()}


PIPELINES = {PredictorPipeline.node: PredictorPipeline}

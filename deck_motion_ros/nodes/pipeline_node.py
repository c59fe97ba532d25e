"""The shell round a pipeline: subscribe, take, publish."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any

from rclpy.node import Node

from deck_motion_ros.nodes.diagnostics import DiagnosticsPublisher
from deck_motion_ros.nodes.parameters import configuration
from deck_motion_ros.nodes.shell import output_qos, overridable, RclTypes, sensor_qos
from deck_motion_ros.pipelines import PIPELINES, Status, WARN
from deck_motion_ros.topics import inputs, outputs


class PipelineNode(Node):
    """
    A live estimator: the pipeline of that name between its topics.

    Parameters
    ----------
    name : str
        Node and pipeline.
    kwargs
        Passed on to rclpy's Node.

    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        kind, types = PIPELINES[name], RclTypes()
        config = configuration(self, kind.config_class)
        self.pipeline = kind(config, types, self.get_logger().warning)
        self._publishers_by_topic = {
            topic.name: self.create_publisher(types[topic.type], topic.name, output_qos(),
                                              qos_overriding_options=overridable())
            for topic in outputs(name)}
        # the executor serves ready topics in this order: the later of one stamp first, so that in
        # a backlog no newer stamp of the earlier topic overtakes it
        for topic in reversed(inputs(name)):
            self.create_subscription(types[topic.type], topic.name,
                                     partial(self._on_message, topic.name), sensor_qos(),
                                     qos_overriding_options=overridable())
        self._counted: Counter[str] = Counter()
        self._quiet: Counter[str] = Counter()  # reports in a row without a new message
        self._diagnostics = DiagnosticsPublisher(self, self._report)

    def _on_message(self, topic: str, msg: Any) -> None:
        for out_topic, out_msg in self.pipeline.take(topic, msg):
            self._publishers_by_topic[out_topic].publish(out_msg)

    def destroy_node(self) -> None:
        """Close the pipeline, then the node."""
        self.pipeline.close()
        super().destroy_node()

    def _report(self) -> list[Status]:
        accepted, statuses = self.pipeline.accepted, self.pipeline.diagnostics()
        for topic, count in accepted.items():
            self._quiet[topic] = self._quiet[topic] + 1 if count == self._counted[topic] else 0
        self._counted = accepted.copy()
        silent = [topic for topic, reports in self._quiet.items() if reports > 1]  # 1 Hz is not
        if silent:
            name, _, _, values = statuses[0]
            statuses[0] = (name, WARN, f"{', '.join(silent)} silent for 2 s or more", values)
        return statuses

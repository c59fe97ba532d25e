"""The altitude node: height above mean sea level, from altimeter and accelerometer."""

from __future__ import annotations

from typing import Any

from deck_motion_ros.nodes.pipeline_node import PipelineNode
from deck_motion_ros.nodes.shell import run


class AltitudeNode(PipelineNode):
    """See :class:`deck_motion_ros.pipelines.altitude.AltitudePipeline`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('altitude', **kwargs)


def main() -> None:
    """Run the node."""
    run(AltitudeNode)


if __name__ == '__main__':
    main()

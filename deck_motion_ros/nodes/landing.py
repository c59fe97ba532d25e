"""The landing node: an aircraft over the deck, from ranges to radios on it."""

from __future__ import annotations

from typing import Any

from deck_motion_ros.nodes.pipeline_node import PipelineNode
from deck_motion_ros.nodes.shell import run


class LandingNode(PipelineNode):
    """See :class:`deck_motion_ros.pipelines.LandingPipeline`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('landing', **kwargs)


def main() -> None:
    """Run the node."""
    run(LandingNode)


if __name__ == '__main__':
    main()

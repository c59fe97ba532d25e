"""The guidance node: velocity commands that lead an aircraft to the deck."""

from __future__ import annotations

from typing import Any

from deck_motion_ros.nodes.pipeline_node import PipelineNode
from deck_motion_ros.nodes.shell import run


class GuidanceNode(PipelineNode):
    """See :class:`deck_motion_ros.pipelines.GuidancePipeline`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('guidance', **kwargs)


def main() -> None:
    """Run the node."""
    run(GuidanceNode)


if __name__ == '__main__':
    main()

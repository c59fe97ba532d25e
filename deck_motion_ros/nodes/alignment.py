"""The alignment node: the misalignment of an aircraft on the catapult."""

from __future__ import annotations

from typing import Any

from deck_motion_ros.nodes.pipeline_node import PipelineNode
from deck_motion_ros.nodes.shell import run


class AlignmentNode(PipelineNode):
    """See :class:`deck_motion_ros.pipelines.alignment.AlignmentPipeline`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('alignment', **kwargs)


def main() -> None:
    """Run the node."""
    run(AlignmentNode)


if __name__ == '__main__':
    main()

"""The predictor node: the touchdown point ahead, from the ship's motion."""

from __future__ import annotations

from typing import Any

from deck_motion_ros.nodes.pipeline_node import PipelineNode
from deck_motion_ros.nodes.shell import run


class PredictorNode(PipelineNode):
    """See :class:`deck_motion_ros.pipelines.PredictorPipeline`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('predictor', **kwargs)


def main() -> None:
    """Run the node."""
    run(PredictorNode)



if __name__ == '__main__':
    main()

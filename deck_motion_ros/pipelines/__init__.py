"""Message in, messages out: what a live node and a replay do alike, without ROS."""

from collections.abc import Mapping

from deck_motion_ros.pipelines.alignment import AlignmentPipeline
from deck_motion_ros.pipelines.altitude import AltitudePipeline
from deck_motion_ros.pipelines.guidance import GuidancePipeline
from deck_motion_ros.pipelines.landing import LandingPipeline
from deck_motion_ros.pipelines.pipeline import OK, Pipeline, settings, Status, WARN
from deck_motion_ros.pipelines.predictor import PredictorPipeline

__all__ = ['AlignmentPipeline', 'AltitudePipeline', 'GuidancePipeline', 'LandingPipeline', 'OK',
           'Pipeline', 'PIPELINES', 'PredictorPipeline', 'settings', 'Status', 'WARN']

PIPELINES: Mapping[str, type[Pipeline]] = {kind.node: kind for kind in (
    PredictorPipeline, AlignmentPipeline, AltitudePipeline, LandingPipeline, GuidancePipeline)}

"""What all nodes do alike between their topics."""

import pytest

from deck_motion_ros import messages
from deck_motion_ros.estimators.touchdown import PredictorConfig
from deck_motion_ros.pipelines import PredictorPipeline
from deck_motion_ros.recording import BagTypes, encode
from deck_motion_ros.samples import NANOSECONDS, OdometrySample
from deck_motion_ros.topics import BY_NAME

TYPES, ZERO = BagTypes(), (0.0, 0.0, 0.0)


@pytest.mark.parametrize('second, outputs', [(0, 5), (2**31 - 100, 5), (2**31 - 1, 0)])
def test_a_stamp_that_leaves_no_room_for_a_forecast_is_rejected(second, outputs):
    """A ROS stamp ends in 2038; one more, and the message cannot be made."""
    pipeline = PredictorPipeline(PredictorConfig(), TYPES, lambda text: None)
    sample = OdometrySample(second * NANOSECONDS, 'ship_level', 'ship_base_link', ZERO,
                            (0.0, 0.0, 0.0, 1.0), ZERO, ZERO, (0.0,) * 6)
    made = list(pipeline.take('ship/odometry', messages.odometry_message(TYPES, sample)))
    assert len([encode(BY_NAME[name].type, msg) for name, msg in made]) == outputs
    rejected = pipeline.diagnostics()[0][3].get('rejected ship/odometry: implausible stamp')
    assert rejected == (None if outputs else '1')

"""
Bags in and out: the folders that ``ros2 bag record -s mcap`` writes, without ROS.

:class:`BagWriter` writes them, :class:`BagReader` reads them (and other rosbag2 folders),
:func:`recover` repairs what a killed recorder left.
"""

from deck_motion_ros.recording.background import BackgroundWriter
from deck_motion_ros.recording.definitions import BagError, BagTopic, BagTypes, describe, encode
from deck_motion_ros.recording.gaps import SequenceGaps
from deck_motion_ros.recording.parameters import PlayerConfig, RecorderConfig, TopicChoice
from deck_motion_ros.recording.playback import schedule
from deck_motion_ros.recording.quality import fitting_offer, fitting_request
from deck_motion_ros.recording.reading import BagReader
from deck_motion_ros.recording.recovery import recover, Recovered
from deck_motion_ros.recording.writing import BagWriter

__all__ = [
    'BackgroundWriter', 'BagError', 'BagReader', 'BagTopic', 'BagTypes', 'BagWriter', 'describe',
    'encode', 'fitting_offer', 'fitting_request', 'PlayerConfig', 'recover', 'Recovered',
    'RecorderConfig', 'schedule', 'SequenceGaps', 'TopicChoice',
]

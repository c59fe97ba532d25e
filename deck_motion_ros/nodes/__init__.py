"""The ROS 2 nodes: convert, update, convert, publish."""

from deck_motion_ros.blas import use_one_thread

use_one_thread()

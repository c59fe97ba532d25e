"""The ROS 2 nodes: convert, update, convert, publish."""

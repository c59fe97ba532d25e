"""A node that only sends back the header of each ``ship/imu``: the least any node can do."""

from __future__ import annotations

from typing import Any


def main() -> None:
    """Run the node ``echo`` until it is interrupted."""
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from deck_motion_ros.nodes.shell import output_qos, RclTypes, sensor_qos
    from deck_motion_ros.topics import IMU, POINT

    types = RclTypes()
    point = types[POINT]
    rclpy.init()
    node = rclpy.create_node('echo')
    publisher = node.create_publisher(point, 'touchdown/height', output_qos())

    def echo(msg: Any) -> None:
        publisher.publish(point(header=msg.header))

    node.create_subscription(types[IMU], 'ship/imu', echo, sensor_qos())
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()

"""The ROS 2 graph: the only room that imports rclpy."""

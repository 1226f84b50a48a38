"""The graph: processes, nodes and bags. Only `nodes` imports rclpy, only `bag` rosbags."""

"""The graph: processes, nodes and bags. Only `nodes` imports rclpy, only the files of bags mcap and rosbags."""

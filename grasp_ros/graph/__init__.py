"""The graph: nodes (`nodes`, of parts in `ros`, `health`, `lockstep`), their tools and processes, and bags (`bag`).

Whatever imports rclpy lies in `nodes`, its parts and `tools`; whatever imports mcap or rosbags, in `bag`.
"""

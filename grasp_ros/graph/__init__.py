"""The graph: nodes (`nodes`, on what all of them share, `ros`), their processes, and bags (`bag`).

The way of a command: `nodes.lockstep`, or `nodes.free_running`, admits it as `nodes.loop` has it and waits for all;
`nodes.plant` steps with them; `nodes.monitor` has `nodes.synchronizer` put it beside the state that it answers, and
`bag.recorder` writes both.

Whatever imports rclpy lies in `nodes` and `ros`; whatever imports mcap or rosbags, in `bag`.
"""

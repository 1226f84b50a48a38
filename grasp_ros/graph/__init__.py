"""The graph: nodes (`nodes`, of parts in `ros`, `health`, `lockstep`), their tools and processes, and bags (`bag`).

The way of a command: `lockstep.lockstep`, or `lockstep.free_running`, admits it as `lockstep.loop` has it and waits for
all; `nodes.plant` steps with them; `nodes.monitor` has `lockstep.synchronizer` put it beside the state that it answers,
and `bag.recorder` writes both.

Whatever imports rclpy lies in `nodes`, its parts and `tools`; whatever imports mcap or rosbags, in `bag`.
"""

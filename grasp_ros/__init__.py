"""A grasp held together by impacts: exact simulation, control and measurement over ROS 2.

Rooms, each importing only from those before it: `physics` (no ROS, no files, no clocks), `scene`, `simulation`
and `reference`, `bag`, `nodes` (the only one with rclpy) and `studies`, `cli`.
"""

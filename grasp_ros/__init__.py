"""A grasp held together by Hunt-Crossley impacts: exact simulation, control and measurement over ROS 2.

Rooms, each importing only from those before it: `physics` (equations), `exact` (the compiled integrator), `scene` (what
a file may say), `methods` (the other integrators), `simulation` (a run without ROS), `graph` (nodes and bags),
`verification` (reference, oracles, hard cases), `studies` (what is measured and written), `cli`.
"""

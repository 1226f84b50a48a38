"""`physics.control`, compiled: the law of a controller for the kernels, and for the node that runs one."""

from __future__ import annotations

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.physics import control

measured = kernel(control.measured)
feedback = kernel(control.feedback)
limited = kernel(control.limited)

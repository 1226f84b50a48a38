"""`physics.impact_law`, compiled: the scalars of the impact law for all kernels."""

from __future__ import annotations

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.physics import impact_law

elastic_force = kernel(impact_law.elastic_force)
elastic_slope = kernel(impact_law.elastic_slope)
damping_factor = kernel(impact_law.damping_factor)
stored_energy = kernel(impact_law.stored_energy)
energy_quotient = kernel(impact_law.energy_quotient)

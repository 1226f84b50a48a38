"""Restitution e of a Hunt-Crossley contact: its closed form is (1 - e p v) exp(e p v) = (1 + p v) exp(-p v)."""

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import lambertw

import grasp_ros as gr

body = {"mass_kg": 1.0, "velocity_m_per_s": 0.0}
contact = {"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.5}
speed, measured = np.geomspace(1e-3, 10.0, 41), []
for v in speed:
    arm = {"mass_kg": 1.0, "position_m": -0.01, "velocity_m_per_s": v}
    scene = gr.compose("hit", {"time": {"duration_s": 20.0, "control_period_s": 0.001}, "left_arm": arm,
                               "object": {**body, "position_m": 0.0}, "left_contact": contact})
    measured.append(gr.simulate(scene, grid=[0.0]).contacts("left")["restitution"][0])
pv = contact["dissipation_s_per_m"] * speed
exact = (1.0 + lambertw(-(1.0 + pv) * np.exp(-1.0 - pv)).real) / pv
plt.semilogx(speed, exact, label="closed form")
plt.semilogx(speed, measured, "o", fillstyle="none", label="simulated")
plt.xlabel("speed of approach, m/s")
plt.ylabel("coefficient of restitution")
plt.legend(title=f"largest difference {np.abs(measured - exact).max():.0e}")
plt.savefig("restitution.png", dpi=150)

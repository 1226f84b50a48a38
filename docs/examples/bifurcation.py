"""Bifurcation of an arm that a sine drives against a heavy object: a point for each period, after a minute."""

import matplotlib.pyplot as plt
import numpy as np

import grasp_ros as gr

step, end, begin = 0.005, 100.0, 60.0  # s
hammer = gr.load("hammer", ["object.mass_kg=1e9", f"time.duration_s={end}", f"time.control_period_s={step}"])
force = {"amplitude_N": 2.0, "frequency_Hz": 1.0}
scene = gr.compose("driven", {**hammer.values, "left_arm_sine": force}, title="An arm driven against a wall")
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for steps in range(91, 230):  # whole control periods, over which the force is constant
    period = step * steps
    run = gr.simulate(scene.changed({"left_arm_sine.frequency_Hz": 1.0 / period}), grid=[0.0])
    times = period * np.arange(round(begin / period), int(end / period))
    axes.plot(np.full(len(times), 1.0 / period), run.at(times)[:, 1], ".", color="black", markersize=1)
axes.set(xlabel="frequency of the force, Hz", ylabel="velocity of the arm once a period, m/s", title=scene.title)
figure.savefig("bifurcation.png", dpi=150)

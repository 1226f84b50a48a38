"""The motion of a scene at the times of a measurement, and its derivatives by numbers of the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.identification.measured import Measured
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Entry, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, compose
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.scene.effects.force import FORCED
from grasp_ros.sensitivity.directions import directions
from grasp_ros.simulation.differentiate import carry, complete
from grasp_ros.simulation.sampled_plant import SampledPlant
from grasp_ros.simulation.ticks import tick_of


def motion(data: Measured, scene: Scene, keys: Sequence[str], rows: int) -> tuple[Array, Array, Array]:
    """States (rows, 6) at the first times of a measurement, their derivatives (rows, 6, n), and touches (k, 2).

    A touch is its time in s and its side. Recorded inputs act as they were; without them the controllers of the scene.
    A run that does not get there is refused.
    """
    times, recorded = data.t[:rows], data.inputs is not None
    scene = _plant(scene) if recorded else _until(scene, times)
    integrator = Integrator(scene.system, continuous=not data.sampled)
    carrier = carry(scene, integrator, directions(scene, keys, data.sampled), times, data.sampled)
    if data.inputs is None:
        states = complete(scene, integrator, data.sampled, times)
    else:
        plant = SampledPlant(scene.system, scene.period_ns, integrator)
        states = np.vstack([plant.follow(data.inputs[: rows - 1]), plant.state])
        if plant.status is not Status.DONE:
            raise Refused(f"{scene.name}: {plant.stop}")
    carrier.finish(times[-1] if recorded else scene.duration)
    events = integrator.event_table
    return states, carrier.out, events[events[:, Entry.KIND] == Transition.TOUCH][:, [Entry.TIME, Entry.BODY]]


def _until(scene: Scene, times: Array) -> Scene:
    """A scene that ends at the first tick behind the last of some times, if not before."""
    ticks = int(tick_of(scene, times[-1:])[0]) + 1
    return scene.changed({"time.duration_s": scene.time_of(ticks)}) if ticks < scene.ticks else scene


def _plant(scene: Scene) -> Scene:
    """What is left of a scene where all that acts from outside is known: bodies and contacts."""
    return compose(scene.name, {
        section: numbers for section, numbers in scene.values.items()
        if BY_SECTION[section].node == "plant" and section != "loop" and section not in FORCED
    })

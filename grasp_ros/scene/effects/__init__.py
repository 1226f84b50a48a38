"""The effects that a scene can name: one file each, and one line each here.

The order is that of the topics in a bag and that in which effects build the system.
"""

from grasp_ros.scene.effects import bodies, contact, feedback, force, friction, loop, saturation, sensing, tilt, time

EFFECTS = (
    *time.EFFECTS,
    *bodies.EFFECTS,
    *feedback.EFFECTS,
    *contact.EFFECTS,
    *loop.EFFECTS,
    *sensing.EFFECTS,
    *saturation.EFFECTS,
    *friction.EFFECTS,
    *tilt.EFFECTS,
    *force.EFFECTS,
)
BY_SECTION = {effect.section: effect for effect in EFFECTS}

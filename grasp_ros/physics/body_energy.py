"""The energy of one body by itself and the size of its terms, which is what roundings are relative to.

It works on floats and on NumPy arrays: `exact.driver.energy_check` compiles the same source for every segment,
`energy` uses it for every control period.
"""

from typing import Any

from grasp_ros.physics.layout import EPS


def body_energy(mass: Any, stiffness: Any, force: Any, x: Any, v: Any, place: Any) -> Any:
    """m v^2 + k x^2 - 2 f x in J of V, which is twice the energy, and the sum of the sizes of its terms.

    k (x - f/k)^2 differs by the constant f^2/k only, which may be far larger. `place` in m is the scale of the rounding
    of x: |x| + |x_o| for an arm in contact, whose position follows from that of the object, also where x = 0.
    """
    kinetic = mass * v * v
    size = kinetic + (stiffness * (abs(x) + EPS * place) + 2.0 * abs(force)) * place
    return kinetic + stiffness * x * x - 2.0 * force * x, size

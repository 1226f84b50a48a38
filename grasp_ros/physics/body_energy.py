"""The energy of one body by itself and the size of its terms, which is what roundings are relative to.

It works on floats and on NumPy arrays: `exact.driver.energy_check` compiles the same source for every segment,
`energy` uses it for every control period.
"""

from typing import Any

from grasp_ros.physics.layout import EPS


def body_energy(mass: Any, stiffness: Any, force: Any, x: Any, v: Any, place: Any) -> Any:
    """m v^2 + k x^2 - 2 f x in J of V, which is twice the energy, and the sum of the sizes of its terms.

    k (x - f/k)^2 would be the same but for a constant, (f/k)^2, that may be large beside it. `place` in m is what the
    digits of x are relative to: the position of an arm in contact follows from that of the object, |x| + |x_o|; x = 0
    has their rounding, too.
    """
    kinetic = mass * v * v
    size = kinetic + (stiffness * (abs(x) + EPS * place) + 2.0 * abs(force)) * place
    return kinetic + stiffness * x * x - 2.0 * force * x, size

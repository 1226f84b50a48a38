"""The energy of one body by itself and the size of its terms, which is what roundings are relative to.

Both work on floats and on NumPy arrays; `exact.energy_check` compiles the same source for every segment, `energy` uses
it for every control period.
"""

from typing import Any


def body_energy(mass: Any, stiffness: Any, force: Any, x: Any, v: Any) -> Any:
    """m v^2 + k x^2 - 2 f x in J of V, which is twice the energy.

    k (x - f/k)^2 would be the same but for a constant, (f/k)^2, that may be large beside it.
    """
    return mass * v * v + stiffness * x * x - 2.0 * force * x


def energy_size(mass: Any, stiffness: Any, force: Any, x: Any, v: Any, place: Any) -> Any:
    """Sum of the sizes of its terms in J; `place` in m is what the digits of x are relative to.

    The position of an arm in contact follows from that of the object and has its digits: place = |x| + |x_o|.
    """
    return mass * v * v + (stiffness * abs(x) + 2.0 * abs(force)) * place

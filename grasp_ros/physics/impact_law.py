"""The impact law: Hertz stiffness with Hunt-Crossley damping, its tension cut off by condition (10).

    fw = H u^(3/2) (1 + p u')   if u >= 0 and u' >= -1/p, else 0     (6), (7), (10)

u > 0 is penetration, u' > 0 approach, H in N/m^1.5, p in s/m. All but `energy_quotient` take floats or NumPy arrays,
and `exact.impact` compiles their source for the kernels. `model.impact_force` combines them for any u and u'.
Another exponent, a multiple of 1/2, changes this file; products in `exact.contact.series` and `sensitivity.contact`;
which powers of t are whole in `exact.automaton.edge.coming_push`; in `exact.contact` the terms of `motion_sizes` and,
for speed alone, `turning_rate`; and the key of H in `domain`, `scene.effects` and all scenes. Tests: docs/oracles.md.

References
----------
H. Hertz, Ueber die Beruehrung fester elastischer Koerper, J. reine angew. Math. 92 (1882): the exponent 3/2.
K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42
(1975): the damping in proportion to the elastic force.
"""

import math
from typing import Any

import numpy as np

EXPONENT = 1.5
STORED = 1.0 + EXPONENT  # exponent of the elastic energy in u
STORED_ROOT = round(2.0 * STORED)  # the same in sqrt(u), a whole number


def elastic_force(hertzian: Any, u: Any) -> Any:
    """H u^(3/2) in N, for u >= 0 in m; as u sqrt(u), which a factor of 4 in u multiplies by 8 without rounding."""
    return hertzian * (u * np.sqrt(u))


def elastic_slope(hertzian: Any, u: Any) -> Any:
    """Derivative of the elastic force by u, (3/2) H u^(1/2) in N/m, for u >= 0 in m."""
    return EXPONENT * hertzian * np.sqrt(u)


def damping_factor(dissipation: Any, u_rate: Any) -> Any:
    """1 + p u': what the damping multiplies the elastic force by. Its sign is condition (10)'s second half."""
    return 1.0 + dissipation * u_rate


def stored_energy(hertzian: Any, u: Any) -> Any:
    """Elastic energy (2/5) H u^(5/2) in J, for u >= 0 in m; V counts it twice, (19)."""
    return 1.0 / STORED * hertzian * u * u * np.sqrt(u)


def energy_quotient(u0: float, u1: float) -> Any:
    """Difference quotient of the energy stored at u0 and u1, in m, and its derivative by u1, for H = 1; u < 0 has none.

    Without cancellation: a divided difference in the square roots of u.
    """
    if u0 <= 0.0 and u1 <= 0.0:
        return 0.0, 0.0
    a, b = math.sqrt(max(u0, 0.0)), math.sqrt(max(u1, 0.0))
    if u0 <= 0.0:
        span, b3 = u1 - u0, b * b * b
        return 0.4 * b3 * b * b / span, b3 / span - 0.4 * b3 * b * b / (span * span)
    if u1 <= 0.0:
        span, a5 = u0 - u1, a * a * a * a * a
        return 0.4 * a5 / span, 0.4 * a5 / (span * span)
    total = b**4 + b**3 * a + b * b * a * a + b * a**3 + a**4
    slope = 3.0 * b**3 + 6.0 * b * b * a + 4.0 * b * a * a + 2.0 * a**3
    return 0.4 * total / (a + b), 0.2 * slope / (a + b) ** 2

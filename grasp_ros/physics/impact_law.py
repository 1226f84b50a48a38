"""The impact law: Hertz stiffness with Hunt-Crossley damping, its tension cut off by condition (10).

    fw = H u^(3/2) (1 + p u')   if u >= 0 and u' >= -1/p, else 0     (6), (7), (10)

u > 0 is penetration, u' > 0 approach, H in N/m^1.5, p in s/m. Each function takes floats or NumPy arrays, and
`exact.impact` compiles the same source for the kernels. `model.impact_force` combines them for any u and u'.
Another exponent changes powers of w in `exact.contact.series` and `sensitivity.base_series`, TAIL in
`exact.contact.taylor_step`, a mean slope in `sensitivity.propagate`, scales in `exact.contact.step_unit`, the impulse
in `domain`, bounds of `lyapunov.reach`, quotients of `methods.discrete_gradient`, and the key of H, its unit and texts
in `scene.effects.contact` and `scene.parameter`. Tests: docs/oracles.md.

References
----------
H. Hertz, Ueber die Beruehrung fester elastischer Koerper, J. reine angew. Math. 92 (1882): the exponent 3/2.
K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42
(1975): the damping in proportion to the elastic force.
"""

from typing import Any

import numpy as np


def elastic_force(hertzian: Any, u: Any) -> Any:
    """H u^(3/2) in N, for u >= 0 in m; as u sqrt(u), which a factor of 4 in u multiplies by 8 without rounding."""
    return hertzian * (u * np.sqrt(u))


def elastic_slope(hertzian: Any, u: Any) -> Any:
    """Derivative of the elastic force by u, (3/2) H u^(1/2) in N/m, for u >= 0 in m."""
    return 1.5 * hertzian * np.sqrt(u)


def damping_factor(dissipation: Any, u_rate: Any) -> Any:
    """1 + p u': what the damping multiplies the elastic force by. Its sign is condition (10)'s second half."""
    return 1.0 + dissipation * u_rate


def stored_energy(hertzian: Any, u: Any) -> Any:
    """Elastic energy (2/5) H u^(5/2) in J, for u >= 0 in m; V counts it twice, (19)."""
    return 0.4 * hertzian * u * u * np.sqrt(u)

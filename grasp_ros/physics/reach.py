"""How far a level of V_c lets the bodies go: what proves that a motion has settled for good.

V_c >= K x^2 bounds an arm, V_c >= (4/5) H u^(5/2) a deformation, and the arms enclose the object, (35) to (37). Where
V_c never rises, under continuous feedback to 0, that bounds all that follows. `observe.settling` compiles the same
source for its kernels.
"""

from typing import Any

import numpy as np

from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of


def reach(bodies: Any, pairs: Any, V_c: Any) -> Any:
    """Largest displacements of left arm, object and right arm, and largest deformations of both pairs, in m.

    An arm that is not driven to 0, an object that the arms do not enclose or that a force pushes, and a pair that
    cannot push have no bound: infinite. What is not there stays at 0. `bodies` (3, 4) have the feedback in them,
    `pairs` are (2, 2), see `layout`; `V_c` is in J.
    """
    left = middle = right = 0.0
    if bodies[LEFT, Of.MASS] > 0.0:
        driven = bodies[LEFT, Of.STIFFNESS] > 0.0 and bodies[LEFT, Of.FORCE] == 0.0
        left = np.sqrt(V_c / bodies[LEFT, Of.STIFFNESS]) if driven else np.inf
    if bodies[RIGHT, Of.MASS] > 0.0:
        driven = bodies[RIGHT, Of.STIFFNESS] > 0.0 and bodies[RIGHT, Of.FORCE] == 0.0
        right = np.sqrt(V_c / bodies[RIGHT, Of.STIFFNESS]) if driven else np.inf
    u_l = (1.25 * V_c / pairs[LEFT, Law.HERTZIAN]) ** 0.4 if pairs[LEFT, Law.HERTZIAN] > 0.0 else np.inf
    u_r = (1.25 * V_c / pairs[RIGHT, Law.HERTZIAN]) ** 0.4 if pairs[RIGHT, Law.HERTZIAN] > 0.0 else np.inf
    if bodies[OBJECT, Of.MASS] > 0.0:
        arms = bodies[LEFT, Of.MASS] > 0.0 and bodies[RIGHT, Of.MASS] > 0.0
        middle = max(left + u_l, right + u_r) if arms and bodies[OBJECT, Of.FORCE] == 0.0 else np.inf
    return left, middle, right, u_l, u_r

"""Derivatives of many variants of a scene, on all cores; each row has the bits of a run of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.given import names, truth
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import check_keys
from grasp_ros.simulation.differentiate import Sensitivity, differentiate
from grasp_ros.simulation.ensemble import chunks, in_threads
from grasp_ros.simulation.outcomes import GROUPS
from grasp_ros.simulation.simulate import simulate
from grasp_ros.simulation.tables import frame_of
from grasp_ros.simulation.variants import Variants


@dataclass(frozen=True, eq=False)
class SensitivityTable(Frozen):
    """Last states of n variants of a scene, with their derivatives by k numbers.

    Attributes
    ----------
    scene : Scene
    keys : tuple of str
        The numbers, "section.key"; each derivative is by the unit of its key.
    changes : dict of str to array (n,)
    state : array (n, 6), m and m/s
        NaN in rows that were refused or stopped, as all below.
    state_rates : array (n, 6, k)
    V_c : array (n,), J
    V_c_rates : array (n, k)
    corner : array (n,), s
        From when on one-sided derivatives differ, see `Sensitivity`; inf: they do not.
    stops : dict of int to str
        Why a row was refused or stopped.
    """

    scene: Scene
    keys: tuple[str, ...]
    changes: dict[str, Array]
    state: Array
    state_rates: Array
    V_c: Array
    V_c_rates: Array
    corner: Array
    stops: dict[int, str]

    def dataframe(self) -> Any:
        """A `pandas.DataFrame`, a row for each variant; derivatives are columns such as "x_left_end by KEY".

        Raises
        ------
        Refused
            If pandas is not installed.
        """
        names, columns = (*GROUPS["last_state"], "V_c"), np.column_stack([self.state, self.V_c])
        rates = np.concatenate([self.state_rates, self.V_c_rates[:, None]], axis=1)
        by = {f"{name} by {key}": rates[:, i, j] for j, key in enumerate(self.keys) for i, name in enumerate(names)}
        return frame_of({**self.changes, **dict(zip(names, columns.T, strict=True)), **by, "corner": self.corner})


def ensemble_sensitivities(
    scene: Scene, changes: Mapping[str, ArrayLike], keys: Sequence[str], *, sampled: bool = False,
    accuracy: float = ACCURACY, threads: int | None = None,
) -> SensitivityTable:
    """Differentiate the last states of variants of a scene.

    Parameters
    ----------
    scene : Scene
    changes : mapping of str to array (n,)
        Numbers of the scene by "section.key", one for each row; without any there is one row, the scene itself.
    keys : sequence of str
        "section.key": initial values, and any number of the scene that enters smoothly.
    sampled, accuracy
        As in `simulate`.
    threads : int, optional
        Default: one for each core. The result does not depend on it.

    Raises
    ------
    Refused
        If a key is not known, or a number has no derivative.
    """
    keys, sampled = names("keys", keys), truth("sampled", sampled)
    check_keys(scene, keys, sampled)  # what is refused of all rows
    variants = Variants(scene, changes)

    def row(i: int) -> Sensitivity | str:
        try:
            own = variants.row(i)
            run = simulate(own, grid=np.array([own.duration]), sampled=sampled, accuracy=accuracy)
            return differentiate(run, keys)
        except Refused as refusal:
            return str(refusal)

    n, k = variants.rows, len(keys)
    shapes = (n, 6), (n, 6, k), (n,), (n, k), (n,)
    state, rates, level, level_rates, corner = (np.full(shape, np.nan) for shape in shapes)
    stops: dict[int, str] = {}
    for (i, _), found in in_threads(lambda span, _: row(span[0]), chunks(n, 1), threads):
        if isinstance(found, str):
            stops[i] = found
            continue
        state[i], rates[i] = found.state[-1], found.state_rates[-1]
        level[i], level_rates[i] = found.V_c[-1], found.V_c_rates[-1]
        corner[i] = np.inf if found.corner is None else found.corner
    return SensitivityTable(scene, keys, variants.changes, state, rates, level, level_rates, corner, stops)

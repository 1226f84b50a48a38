"""Derivatives of the rows of an ensemble: each row has those of a run of its own, to the last bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.errors import Refused
from grasp_ros.simulation.chunk import Chunk, Setup
from grasp_ros.simulation.differentiate import differentiate
from grasp_ros.simulation.outcomes import BY, CORNER, GROUPS, V_C_END
from grasp_ros.simulation.simulate import simulate
from grasp_ros.simulation.variants import Variants

DIFFERENTIATED = (*GROUPS["last_state"], V_C_END)


def with_derivatives(chunk: Chunk, variants: Variants, setup: Setup, keys: Sequence[str], stop: NDArray[np.int64]
                     ) -> Chunk:
    """A chunk of rows with the derivatives of their last states, see `ensemble`; a `stop` that is not 0 ends it early.

    A row that has none says why among the stops, and has nan.
    """
    n, stops = variants.rows, dict(chunk.stops)
    rates, level, corner = np.full((n, len(DIFFERENTIATED), len(keys)), np.nan), np.full(n, np.nan), np.full(n, np.nan)
    for i in np.flatnonzero(chunk.status == 0).tolist():
        if stop[0]:
            break
        scene = variants.row(i)
        try:
            found = differentiate(simulate(
                scene, grid=np.array([scene.duration]), sampled=setup.sampled, setting=setup.accuracy,
                max_events=setup.max_events, max_work=setup.max_work), keys)
        except Refused as refusal:
            stops[i] = str(refusal)
            continue
        rates[i], level[i] = np.vstack([found.state_rates[-1], found.V_c_rates[-1]]), found.V_c[-1]
        corner[i] = np.inf if found.corner is None else found.corner
    columns = {f"{name}{BY}{key}": rates[:, row, column] for column, key in enumerate(keys)
               for row, name in enumerate(DIFFERENTIATED)}
    return chunk._replace(columns={**chunk.columns, V_C_END: level, **columns, CORNER: corner}, stops=stops)

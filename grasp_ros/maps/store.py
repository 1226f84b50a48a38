"""The file of a map: a Zarr group, which xarray opens, and which a computation fills chunk by chunk.

Each chunk of each column is a file of its own, which appears under its name when it is whole. The mark of a chunk is
written last, so that a computation that was killed, or whose disk is full, has lost at most the chunks that nobody
had marked; the same command goes on with the rest. A NetCDF file would be damaged as a whole.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.maps.plan import Plan
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import decoding, writing
from grasp_ros.scene.versions import versions
from grasp_ros.simulation.chunk import STATUSES, Chunk
from grasp_ros.simulation.ensemble import Span
from grasp_ros.simulation.outcomes import find

FORMAT, MARKS, STATUS = "grasp_ros map", "done", "status"
AGAIN = "what is done is kept: the same command goes on"


class Store:
    """The file of one plan.

    Parameters
    ----------
    path : Path
        A new directory, or the map of the same plan.
    plan : Plan
    rows : int
        Rows of a chunk; of a new file only.

    Raises
    ------
    Refused
        If there is something else, or it cannot be written.
    """

    def __init__(self, path: Path, plan: Plan, rows: int) -> None:
        self.path, self.plan = path, plan
        wanted = json.loads(json.dumps(plan.to_document()))
        if path.exists():
            self._group = open_group(path, "r+")
            self._check(wanted)
        else:
            with _writing(path):
                self._group = _create(path, plan, wanted, rows)
        self.chunk = int(self._group.attrs["chunk_rows"])

    def _check(self, wanted: dict[str, Any]) -> None:
        for what, own in (("plan", wanted), ("versions", versions())):
            found = self._group.attrs[what]
            other = ", ".join(key for key in own if found.get(key) != own[key])
            if other:
                allowed = "a new path, or a map of the same"
                raise Refused(f"{self.path}: a map of another {what} ({other}); allowed: {allowed}")

    @property
    def spans(self) -> list[Span]:
        """Chunks that are still to be done, as their first row and the one behind their last."""
        first: list[int] = (np.flatnonzero(self._group[MARKS][:] == 0) * self.chunk).tolist()
        return [(row, min(row + self.chunk, self.plan.rows)) for row in first]

    def write(self, span: Span, chunk: Chunk) -> None:
        """Write a chunk, and then its mark.

        Raises
        ------
        Refused
            If it cannot be written; the chunk counts as not done.
        """
        lines = self.plan.rows // self.plan.shape[0]
        part = slice(span[0] // lines, span[1] // lines)
        with _writing(self.path):
            for name, values in {**chunk.columns, STATUS: chunk.status}.items():
                self._group[name][part] = values.reshape(-1, *self.plan.shape[1:])
            self._group[MARKS][span[0] // self.chunk] = 1

    @property
    def seconds(self) -> float:
        """Time in s that went into it so far."""
        return float(self._group.attrs["seconds"])

    def add_seconds(self, seconds: float) -> None:
        """Count time that went into it."""
        with _writing(self.path):
            self._group.attrs["seconds"] = self.seconds + seconds


def _create(path: Path, plan: Plan, document: dict[str, Any], rows: int) -> Any:
    """A new file: columns without values, coordinates, and all that the values depend on."""
    import zarr

    lines = plan.rows // plan.shape[0]
    height = max(1, rows // lines)
    names = ("row",) if plan.sample else tuple(axis.name for axis in plan.axes)
    path.parent.mkdir(parents=True, exist_ok=True)
    group = zarr.create_group(path, zarr_format=3, attributes={
        "format": FORMAT, "plan": document, "versions": versions(), "chunk_rows": height * lines,
        "statuses": list(STATUSES), "seconds": 0.0,
    })
    chunks = (height, *plan.shape[1:])
    for column in find(plan.setup.outcomes):
        group.create_array(column.name, shape=plan.shape, chunks=chunks, dtype="f8", fill_value=np.nan,
                           dimension_names=names, attributes={"units": column.unit, "long_name": column.text})
    group.create_array(STATUS, shape=plan.shape, chunks=chunks, dtype="i1", fill_value=-1, dimension_names=names,
                       attributes={"long_name": "-1: not done; otherwise a place in `statuses`"})
    count = -(-plan.shape[0] // height)
    group.create_array(MARKS, shape=(count,), chunks=(1,), dtype="u1", fill_value=0, dimension_names=("chunk",))
    for i, axis in enumerate(plan.axes):
        values = plan.variants(0, plan.rows).changes[axis.keys[0]] if plan.sample else axis.values
        group.create_array(axis.name, data=values, dimension_names=(names[0] if plan.sample else names[i],))
    return group


def open_group(path: Path, mode: str = "r") -> Any:
    """The Zarr group of a map.

    Raises
    ------
    Refused
        If it is none, or damaged.
    """
    import zarr

    with decoding(path, "a map"):
        group = zarr.open_group(path, mode=mode, zarr_format=3)  # version 2 has arrays that are code
        if group.attrs.get("format") != FORMAT:
            raise Refused(f"{path}: not a map; allowed: a new path, or what `grasp map` has written")
        parts = (MARKS, STATUS, *(axis["name"] for axis in group.attrs["plan"]["axes"]))
        missing = [name for name in parts if not (path / name / "zarr.json").is_file()]
        missing += [name for name in ("versions", "chunk_rows", "seconds") if name not in group.attrs]
        if missing:
            raise Refused(f"{path}: a damaged map: without {', '.join(missing)}; allowed: a whole one")
    return group


def read(path: str | os.PathLike[str]) -> Any:
    """A map as an `xarray.Dataset`, with what is not done as nan.

    Raises
    ------
    Refused
        If it is no map.
    """
    import xarray

    path = Path(path)
    group = open_group(path)
    data = xarray.open_zarr(path, consolidated=False, chunks=None, zarr_format=3)
    data = data.drop_vars(MARKS)
    return data.set_coords([axis["name"] for axis in group.attrs["plan"]["axes"]])


def columns_of(data: Any) -> list[str]:
    """Names of the outcomes of a map."""
    return [name for name in data.data_vars if name != STATUS]


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Refuse a path that cannot be written, and say that what is done is kept."""
    try:
        with writing(path):
            yield
    except Refused as error:
        raise Refused(f"{error}; {AGAIN}" if path.exists() else str(error)) from None

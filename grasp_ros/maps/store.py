"""The file of a map: a Zarr group, which xarray opens, and which a computation fills chunk by chunk.

Each chunk of each column is a file of its own, which appears under its name when it is whole. A chunk is done when all
of its files are there, so that a computation that was killed, or whose disk is full, has lost at most the chunk that it
was writing; the same command goes on with the rest. A NetCDF file would be damaged as a whole.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.maps.plan import Plan
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import decoding, replaced, writing
from grasp_ros.scene.versions import versions
from grasp_ros.simulation.chunk import STATUSES, Chunk
from grasp_ros.simulation.ensemble import Span
from grasp_ros.simulation.outcomes import find

FORMAT, STATUS, NOT_DONE = "grasp_ros map", "status", -1
ZARR = (AttributeError,)  # of zarr, where metadata are of another type
ALL_FILES = {"array.write_empty_chunks": True}  # of zarr: by itself it leaves out chunks of which all is nan


class Store:
    """The file of one plan: a new directory, or the map of the same plan; anything else is refused.

    `rows` are those of a chunk, of a new file only.
    """

    def __init__(self, path: Path, plan: Plan, rows: int = 1) -> None:
        self.path, self.plan = path, plan
        wanted = json.loads(json.dumps(plan.to_document()))
        self._lines = plan.rows // plan.shape[0]
        if not os.path.exists(path):
            try:
                _to_its_end(_create, path, plan, wanted, max(1, rows // self._lines))
            except Refused:
                if not os.path.exists(path):  # otherwise another process has made it meanwhile
                    raise
        self._group = open_group(path, "r+")
        made, allowed = self._group.attrs["versions"], "allowed: a new path, or a map of the same"
        other = [key for key in wanted if self._group.attrs["plan"].get(key) != wanted[key]]
        if other:
            raise Refused(f"{path}: a map of another plan ({', '.join(other)}); {allowed}")
        other = [f"{key} {made.get(key)}, not {own}" for key, own in versions().items() if made.get(key) != own]
        if other:
            raise Refused(f"{path}: a map that was made with {', '.join(other)}; {allowed}")

    @property
    def spans(self) -> list[Span]:
        """Chunks that are still to be done, as their first row and the one behind their last."""
        size = self._group[STATUS].chunks[0] * self._lines
        return [(i * size, min((i + 1) * size, self.plan.rows)) for i in _undone(self._group, self.path)]

    def write(self, span: Span, chunk: Chunk) -> None:
        """Write a chunk; if that cannot be done, which is refused, it counts as not done."""
        import zarr

        part = slice(span[0] // self._lines, span[1] // self._lines)
        try:
            with writing(self.path), zarr.config.set(ALL_FILES):
                _to_its_end(self._fill, part, {**chunk.columns, STATUS: chunk.status})
        except Refused as error:
            raise Refused(f"{error}; results are kept: the same command resumes") from None

    def _fill(self, part: slice, columns: Mapping[str, np.ndarray]) -> None:
        for name, values in columns.items():
            self._group[name][part] = values.reshape(-1, *self.plan.shape[1:])


def _to_its_end(write: Callable[..., object], *arguments: object) -> None:
    """Write in a thread, for whose end a Ctrl-C waits: zarr would go on in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(write, *arguments).result()


def _create(path: Path, plan: Plan, document: dict[str, Any], height: int) -> None:
    """A new file: columns without values, coordinates, and all that the values depend on."""
    import zarr

    names = _dimensions(plan)
    with replaced(path) as part, zarr.config.set(ALL_FILES):
        path.parent.mkdir(parents=True, exist_ok=True)
        group = zarr.create_group(part, zarr_format=3, attributes={
            "format": FORMAT, "plan": document, "versions": versions(), "statuses": list(STATUSES)})
        packed = {"compressors": zarr.codecs.ZstdCodec(checksum=True)}
        grid = {"shape": plan.shape, "chunks": (height, *plan.shape[1:]), "dimension_names": names, **packed}
        for column in find(plan.setup.outcomes):
            group.create_array(column.name, **grid, dtype="f8", fill_value=np.nan,
                               attributes={"units": column.unit, "long_name": column.text})
        group.create_array(STATUS, **grid, dtype="i1", fill_value=NOT_DONE,
                           attributes={"long_name": f"{NOT_DONE}: not done; otherwise an index of `statuses`"})
        for i, axis in enumerate(plan.axes):
            values = plan.variants(0, plan.rows).changes[axis.keys[0]] if plan.sample else axis.values
            name = names[0] if plan.sample else names[i]
            group.create_array(axis.name, data=values, dimension_names=(name,), **packed)


def open_group(path: Path, mode: str = "r") -> Any:
    """The Zarr group of a map; what is none, or damaged, is refused."""
    import zarr

    other = Refused(f"{path}: not a map; allowed: a new path, or what `grasp map` has written")
    with decoding(path, "a map", also=ZARR):
        if not (path / "zarr.json").is_file():
            raise other
        group = zarr.open_group(path, mode=mode, zarr_format=3)  # version 2 has arrays that are code
        if group.attrs.get("format") != FORMAT:
            raise other
        missing = [name for name in (*_columns(group), *_axes(group)) if not (path / name / "zarr.json").is_file()]
        missing += ["versions"] if not isinstance(group.attrs.get("versions"), dict) else []
        if not missing:
            _check(group, path)
            missing = [name for name in _axes(group) if group[name].nchunks_initialized < group[name].nchunks]
        if missing:
            raise Refused(f"{path}: a damaged map: without {', '.join(missing)}; allowed: a whole one")
    return group


def _check(group: Any, path: Path) -> None:
    """Refuse a column or an axis that is not what `_create` makes, by its name."""
    plan = Plan.from_document(group.attrs["plan"])
    names, columns = _dimensions(plan), _columns(group)
    sizes, height = dict(zip(names, plan.shape, strict=True)), None
    for name in (*reversed(columns), *_axes(group)):
        with decoding(path / name, "a whole part of a map", also=ZARR):
            own, its = group[name], (name,) if name in sizes else names
            shape, kind = tuple(sizes[each] for each in its), np.dtype("i1" if name == STATUS else "f8")
            height = height or own.chunks[0]  # of the status
            chunks = (height, *shape[1:]) if name in columns else own.chunks
            if (own.shape, own.dtype, own.metadata.dimension_names, own.chunks) != (shape, kind, its, chunks):
                raise Refused("its shape, type, dimensions or chunks are others")
            if not isinstance(own.attrs.get("units"), str) and name in columns and name != STATUS:
                raise Refused("it has no unit")


def _dimensions(plan: Plan) -> tuple[str, ...]:
    return ("row",) if plan.sample else tuple(axis.name for axis in plan.axes)


def _columns(group: Any) -> list[str]:
    return [*(column.name for column in find(group.attrs["plan"]["setup"]["outcomes"])), STATUS]


def _axes(group: Any) -> list[str]:
    return [axis["name"] for axis in group.attrs["plan"]["axes"]]


def _undone(group: Any, path: Path) -> list[int]:
    """Chunks that lack a file, by their number."""
    status, names = group[STATUS], _columns(group)
    keys = [status.metadata.encode_chunk_key((i, *[0] * (status.ndim - 1))) for i in range(status.cdata_shape[0])]
    return [i for i, key in enumerate(keys) if not all((path / name / key).is_file() for name in names)]


def read(path: str | os.PathLike[str]) -> Any:
    """A map as an `xarray.Dataset`; a chunk that is not done, or lacks a file, is nan and has the status -1.

    What is no map, or damaged, is refused.
    """
    import xarray

    path = Path(path)
    group = open_group(path)
    height, names = group[STATUS].chunks[0], _columns(group)
    with decoding(path, "a map", also=ZARR):
        data = xarray.open_zarr(path, consolidated=False, chunks=None, zarr_format=3)[[*names, *_axes(group)]]
        for name in _axes(group):
            data[name].load()
    for name in names:
        own = group[name]
        with decoding(path / name, "a whole column; delete its `c`, and the same command computes the map again"):
            # one after the other: what zarr reads beside a damaged chunk complains when the process ends
            chunks = [own[first : first + height] for first in range(0, own.shape[0], height)]
        data[name] = data[name].copy(data=np.concatenate(chunks))
    for i in _undone(group, path):
        for name in names:
            data[name].values[i * height : (i + 1) * height] = NOT_DONE if name == STATUS else np.nan
    return data.set_coords(_axes(group))


def columns_of(data: Any) -> list[str]:
    """Names of the outcomes of a map."""
    return [name for name in data.data_vars if name != STATUS]

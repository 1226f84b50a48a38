"""A motion as a table: the columns with their units, for xarray, pandas and text files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from grasp_ros.physics.energy import Energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.parameter import UNITS as KEYS

if TYPE_CHECKING:  # it imports this file
    from grasp_ros.simulation.trajectory import Trajectory

TIME = ("t", "s", "time")
_ENDINGS = {unit: ending for ending, unit in reversed(KEYS.items())} | {"J": "_J", "W": "_W", "1": ""}


class Column(NamedTuple):
    """One column of the table."""

    name: str
    unit: str
    text: str
    read: Callable[[Trajectory, Energy], Array]


def _place(name: str, place: int) -> Callable[[Trajectory, Energy], Array]:
    return lambda motion, _: np.asarray(getattr(motion, name))[:, place]


def _level(name: str) -> Callable[[Trajectory, Energy], Array]:
    return lambda _, level: np.asarray(getattr(level, name))


_BODIES = {body: NAMES[body] for body in sorted(COLUMN, key=COLUMN.__getitem__)}
_ARMS = {body: name for body, name in _BODIES.items() if body != OBJECT}
COLUMNS: tuple[Column, ...] = (
    *(Column(f"{symbol}_{name}", unit, f"{text} of the {name} mass", _place("state", COLUMN[body] + k))
      for body, name in _BODIES.items()
      for k, (symbol, unit, text) in enumerate((("x", "m", "position"), ("v", "m/s", "velocity")))),
    *(Column(f"command_{name}", "N", f"command of the {name} controller", _place("command", body))
      for body, name in _ARMS.items()),
    *(Column(f"input_{name}", "N", f"force of controller and outside on the {name} mass", _place("inputs", body))
      for body, name in _BODIES.items()),
    *(Column(f"impact_{name}", "N", f"impact force of the {name} contact", _place("impacts", body))
      for body, name in _ARMS.items()),
    Column("V", "J", "the paper's Lyapunov function (16)", _level("V")),
    Column("V_c", "J", "its continuous repair, twice the energy", _level("V_c")),
    Column("V_rate", "W", "its rate (18)", _level("V_rate")),
    Column("mode", "1", "contacts: 0 none, 1 left, 2 right, 3 both", _level("mode")),
)
HEADS = {  # of a text file, by the names of the columns
    name: name + _ENDINGS[unit] for name, unit in (TIME[:2], *(column[:2] for column in COLUMNS))
}


def values_of(motion: Trajectory) -> dict[str, Array]:
    """Values (n,) of each column."""
    level = motion.energy
    return {column.name: column.read(motion, level) for column in COLUMNS}


def attributes_of(motion: Trajectory) -> dict[str, Any]:
    """What the table is of."""
    return {
        "title": motion.scene.title, "scene": motion.scene.name, "scene_yaml": motion.scene.to_yaml(),
        "method": motion.method, "setting": motion.setting, "status": motion.status.name, "energy_of": motion.energy_of,
    }


def dataset_of(motion: Trajectory) -> Any:
    """See `trajectory.Trajectory.dataset`."""
    try:
        import xarray
    except ModuleNotFoundError as error:
        raise Refused(f"dataset() needs {error.name}; pip install '.[data]' in the checkout") from None
    name, unit, text = TIME
    values = values_of(motion)
    return xarray.Dataset(
        {column.name: (name, values[column.name], {"units": column.unit, "long_name": column.text})
         for column in COLUMNS},
        {name: (name, motion.t, {"units": unit, "long_name": text})}, attributes_of(motion),
    )


def dataframe_of(motion: Trajectory) -> Any:
    """See `trajectory.Trajectory.dataframe`."""
    frame = frame_of({TIME[0]: motion.t, **values_of(motion)}).set_index(TIME[0])
    units = {TIME[0]: TIME[1], **{column.name: column.unit for column in COLUMNS}}
    frame.attrs = {**attributes_of(motion), "units": units}
    return frame


def write_csv(motion: Trajectory, file: BinaryIO) -> None:
    """See `trajectory.Trajectory.to_csv`; numbers have all their digits."""
    write_rows(file, [*HEADS.values()], [motion.t, *values_of(motion).values()])


def frame_of(columns: Mapping[str, np.ndarray]) -> Any:
    """A `pandas.DataFrame`.

    Raises
    ------
    Refused
        If pandas is not installed.
    """
    try:
        import pandas
    except ModuleNotFoundError as error:
        raise Refused(f"dataframe() needs {error.name}; pip install '.[data]' in the checkout") from None
    return pandas.DataFrame(dict(columns))


def write_rows(file: BinaryIO, heads: Sequence[str], columns: Sequence[np.ndarray]) -> None:
    """Comma-separated rows below their heads; numbers with all their digits."""
    file.write((",".join(heads) + "\n").encode())
    for row in zip(*(column.tolist() for column in columns), strict=True):
        file.write((",".join(map(str, row)) + "\n").encode())

"""A motion as a table: the columns with their units, for xarray, pandas and text files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from grasp_ros.physics.energy import Energy
from grasp_ros.physics.errors import need
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import BODIES, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES, UNITS
from grasp_ros.scene.files import opened

A_MOTION = "a Trajectory or a Recording"
_ENDINGS = {unit: ending for ending, unit in reversed(UNITS.items())} | {"J": "_J", "W": "_W", "1": ""}


class Column(NamedTuple):
    """One column of the table."""

    name: str
    unit: str
    text: str


TIME = Column("t", "s", "time")
COLUMNS: tuple[Column, ...] = (
    *(Column(f"{symbol}_{name}", unit, f"{text} of the {name} mass")
      for name in NAMES.values() for symbol, unit, text in (("x", "m", "position"), ("v", "m/s", "velocity"))),
    *(Column(f"command_{name}", "N", f"command of the {name} controller") for name in SIDES),
    *(Column(f"input_{name}", "N", f"force of controller and outside on the {name} mass") for name in NAMES.values()),
    *(Column(f"impact_{name}", "N", f"impact force of the {name} contact") for name in SIDES),
    Column("V", "J", "the paper's Lyapunov function (16)"),
    Column("V_c", "J", "its continuous repair, twice the energy"),
    Column("V_rate", "W", "the rate of V_c under continuous feedback (18)"),
    Column("mode", "1", "contacts: 0 none, 1 left, 2 right, 3 both"),
)
HEADS = {own.name: own.name + _ENDINGS[own.unit] for own in (TIME, *COLUMNS)}  # of a text file, by columns


class Motion:
    """Base of what can be drawn and taken as a table: a trajectory or a recording."""

    if TYPE_CHECKING:  # dataclasses would take these for defaults of their fields
        @property
        def scene(self) -> Scene: """The scene."""
        @property
        def t(self) -> Array: """Times (n,) in s."""
        @property
        def state(self) -> Array: """States (n, 6) in m and m/s."""
        @property
        def command(self) -> Array: """Commands (n, 2) in N."""
        @property
        def inputs(self) -> Array: """Forces (n, 3) in N that act on the bodies from then on."""
        @property
        def impacts(self) -> Array: """Impact forces (n, 2) in N."""
        @property
        def energy(self) -> Energy: """V, V_c, V' and the contact mode."""
        @property
        def energy_of(self) -> str: """Whose energy that is."""
        @property
        def origin(self) -> dict[str, Any]: """Where the motion comes from, by name."""

    def __repr__(self) -> str:
        """In a line: whose motion, at how many times, and where it comes from."""
        origin = ", ".join(f"{name} {value}" for name, value in self.origin.items())
        return f"<{type(self).__name__} of {self.scene.name}: {len(self.t)} times, {origin}>"

    def dataset(self) -> Any:
        """An `xarray.Dataset` over `t`: states, forces, energies, with names and units as attributes.

        Raises
        ------
        Refused
            If xarray is not installed.
        """
        need("dataset()", "xarray")
        import xarray

        values = {TIME.name: self.t, **_values_of(self)}
        return xarray.Dataset({own.name: (TIME.name, values[own.name], {"units": own.unit, "long_name": own.text})
                                for own in (TIME, *COLUMNS)}, attrs=_attributes_of(self))

    def dataframe(self) -> Any:
        """The same as a `pandas.DataFrame`; units by column in its `attrs["units"]`.

        Raises
        ------
        Refused
            If pandas is not installed.
        """
        frame = frame_of({TIME.name: self.t, **_values_of(self)}).set_index(TIME.name)
        frame.attrs = {**_attributes_of(self), "units": {own.name: own.unit for own in (TIME, *COLUMNS)}}
        return frame

    def to_csv(self, path: str | os.PathLike[str] | BinaryIO) -> None:
        """The same as a text file, by its path or open: a row for each time; units in the names of the columns.

        Numbers have all their digits.

        Raises
        ------
        Refused
            If the file cannot be written.
        """
        with opened(path) as file:
            write_rows(file, [*HEADS.values()], [self.t, *_values_of(self).values()])


def _values_of(motion: Motion) -> dict[str, Array]:
    """Values (n,) of each column."""
    level = motion.energy
    values = (*motion.state.T, *motion.command.T, *motion.inputs[:, BODIES].T, *motion.impacts.T, level.V, level.V_c,
              level.V_rate, level.mode)
    return {column.name: np.asarray(own) for column, own in zip(COLUMNS, values, strict=True)}


def _attributes_of(motion: Motion) -> dict[str, Any]:
    """What the table is of."""
    scene = motion.scene
    return {"title": scene.title, "scene": scene.name, "scene_yaml": scene.to_yaml(), "energy_of": motion.energy_of,
            **motion.origin}


def frame_of(columns: Mapping[str, np.ndarray]) -> Any:
    """A `pandas.DataFrame`; without pandas it is refused."""
    need("dataframe()", "pandas")
    import pandas

    return pandas.DataFrame(dict(columns))


def write_rows(file: BinaryIO, heads: Sequence[str], columns: Sequence[np.ndarray]) -> None:
    """Comma-separated rows below their heads; numbers with all their digits."""
    file.write((",".join(heads) + "\n").encode())
    for row in zip(*(column.tolist() for column in columns), strict=True):
        file.write((",".join(map(str, row)) + "\n").encode())

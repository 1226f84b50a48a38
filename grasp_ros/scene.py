"""Scenes: strict YAML files that say everything about a run.

`PARAMETERS` is the one table of what a scene can set; validation, documentation and error messages come from it.
Every key carries its unit. Nothing is repaired: a file that is not exactly right is refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grasp_ros import strict_yaml
from grasp_ros.physics.model import Arm, Array, Contact, Grasp

NANOSECONDS = 1_000_000_000


class SceneError(ValueError):
    """A scene that cannot be run as written: names the file, the key, the value and what is allowed."""


class Parameter(NamedTuple):
    """One number of a scene."""

    key: str  # ends with its unit
    low: float
    high: float
    text: str
    open_low: bool = False  # whether low itself is excluded

    @property
    def allowed(self) -> str:
        """The range in words."""
        return f"a number {'>' if self.open_low else '>='} {self.low:g} and <= {self.high:g}"

    def accepts(self, value: float) -> bool:
        """Whether a finite number is in the range."""
        return (self.low < value if self.open_low else self.low <= value) and value <= self.high


_MASS = Parameter("mass_kg", 0.0, 1e9, "mass", open_low=True)
_MOTION = (
    Parameter("position_m", -1e9, 1e9, "initial position"),
    Parameter("velocity_m_per_s", -1e9, 1e9, "initial velocity"),
)
_ARM = (
    _MASS,
    Parameter("stiffness_N_per_m", 0.0, 1e12, "spring of the arm, k"),
    Parameter("damping_Ns_per_m", 0.0, 1e12, "damper of the arm, c"),
    *_MOTION,
)
_CONTACT = (
    Parameter("hertz_N_per_m1_5", 0.0, 1e15, "Hertz coefficient of the impact, H", open_low=True),
    Parameter("dissipation_s_per_m", 0.0, 1e12, "energy loss of the impact, p"),
)
_FEEDBACK = (
    Parameter("position_gain_N_per_m", -1e12, 1e12, "gain of the position feedback, Kp"),
    Parameter("velocity_gain_Ns_per_m", -1e12, 1e12, "gain of the velocity feedback, Kv"),
)
PARAMETERS: Mapping[str, tuple[Parameter, ...]] = {
    "time": (
        Parameter("duration_s", 0.0, 1e9, "length of the run", open_low=True),
        Parameter("control_period_s", 0.0, 1e3, "how long a command is held if the feedback is sampled", open_low=True),
    ),
    "left_arm": _ARM,
    "object": (_MASS, *_MOTION),
    "right_arm": _ARM,
    "left_contact": _CONTACT,
    "right_contact": _CONTACT,
    "left_feedback": _FEEDBACK,
    "right_feedback": _FEEDBACK,
}


@dataclass(frozen=True)
class Scene:
    """A validated scene.

    Attributes
    ----------
    name : str
        Name of the file without its ending.
    title : str
    readings : tuple of str
        Where the source leaves something open: what this scene assumes.
    values : mapping of str to mapping of str to float
        Every number, by section and key of `PARAMETERS`.
    """

    name: str
    title: str
    readings: tuple[str, ...]
    values: Mapping[str, Mapping[str, float]]

    @property
    def grasp(self) -> Grasp:
        """The physical model with its gains."""
        return Grasp(
            self._arm("left"), self._arm("right"), self._contact("left"), self._contact("right"),
            self.values["object"]["mass_kg"],
        )

    @property
    def initial_state(self) -> Array:
        """x_l, v_l, x_o, v_o, x_r, v_r at t = 0, shape (6,), m and m/s."""
        bodies = (self.values[name] for name in ("left_arm", "object", "right_arm"))
        return np.array([number for body in bodies for number in (body["position_m"], body["velocity_m_per_s"])])

    @property
    def duration(self) -> float:
        """Length of the run in s."""
        return self.values["time"]["duration_s"]

    @property
    def period_ns(self) -> int:
        """Control period in ns."""
        return round(self.values["time"]["control_period_s"] * NANOSECONDS)

    @property
    def ticks(self) -> int:
        """Number of control periods in the run."""
        return round(self.duration * NANOSECONDS) // self.period_ns

    def time_of(self, tick: int) -> float:
        """Time of a tick in s: an integer number of ns, rounded once."""
        return tick * self.period_ns / NANOSECONDS

    def feedback_in_words(self, sampled: bool) -> str:
        """What acts on the arms: the paper's continuous feedback, or commands that are held."""
        return f"each command held for {self.period_ns / 1e6:g} ms" if sampled else "continuous feedback"

    def to_yaml(self) -> str:
        """The whole scene as YAML; `parse` of it gives the same scene to the last bit."""
        values = {section: dict(numbers) for section, numbers in self.values.items()}
        document = {"title": self.title, "readings": list(self.readings), **values}
        return strict_yaml.dump(document)

    def _arm(self, side: str) -> Arm:
        arm, gains = self.values[f"{side}_arm"], self.values[f"{side}_feedback"]
        return Arm(
            arm["mass_kg"], arm["stiffness_N_per_m"], arm["damping_Ns_per_m"], gains["position_gain_N_per_m"],
            gains["velocity_gain_Ns_per_m"],
        )

    def _contact(self, side: str) -> Contact:
        contact = self.values[f"{side}_contact"]
        return Contact(contact["hertz_N_per_m1_5"], contact["dissipation_s_per_m"])


def names() -> list[str]:
    """Names of the scenes that come with the package."""
    return sorted(entry.name.removesuffix(".yaml") for entry in _library().iterdir() if entry.name.endswith(".yaml"))


def load(reference: str, settings: Sequence[str] = ()) -> Scene:
    """Read a scene of the package by its name, or a file by its path.

    Parameters
    ----------
    reference : str
    settings : sequence of str
        "section.key=value": numbers that replace those of the file.

    Raises
    ------
    SceneError
        If there is no such scene, or if it cannot be run as written.
    """
    path = Path(reference)
    if path.suffix in (".yaml", ".yml"):
        if not path.is_file():
            raise SceneError(f"{reference}: no such file")
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise SceneError(f"{reference}: {error}; allowed: UTF-8 text") from None
        return parse(text, path.stem, str(path), settings)
    if reference not in names():
        known = ", ".join(names())
        raise SceneError(f"{reference}: no such scene; allowed: a path that ends in .yaml, or one of {known}")
    return parse((_library() / f"{reference}.yaml").read_text(encoding="utf-8"), reference, reference, settings)


def parse(text: str, name: str, source: str, settings: Sequence[str] = ()) -> Scene:
    """Validate the text of a scene; `source` is the file that errors name.

    Raises
    ------
    SceneError
        If the text is not a scene that can be run as written.
    """
    try:
        document = strict_yaml.load(text)
    except ValueError as error:
        raise SceneError(f"{source}: {' '.join(str(error).split())}") from None
    if not isinstance(document, dict):
        raise SceneError(f"{source}: not a mapping; allowed: the keys title, readings, {', '.join(PARAMETERS)}")
    for setting in settings:
        _apply(document, setting)
    _check_keys(source, "", document, ("title", "readings", *PARAMETERS))
    title, readings = document["title"], document["readings"]
    if not isinstance(title, str):
        raise SceneError(f"{source}: title: {title!r} is not allowed; allowed: a text")
    if not isinstance(readings, list) or not all(isinstance(reading, str) for reading in readings):
        raise SceneError(f"{source}: readings: {readings!r} is not allowed; allowed: a list of texts")
    values = {section: _section(source, section, document[section]) for section in PARAMETERS}
    scene = Scene(name, title, tuple(readings), values)
    _check_combinations(source, scene)
    return scene


def _library() -> Any:
    return resources.files("grasp_ros.config")


def _apply(document: dict[Any, Any], setting: str) -> None:
    match = re.fullmatch(r"(\w+)\.(\w+)=(.*)", setting)
    if match is None:
        raise SceneError(f"--set {setting}: not understood; allowed: section.key=value")
    section, key, value = match.groups()
    if section not in PARAMETERS or key not in (parameter.key for parameter in PARAMETERS[section]):
        known = (f"{name}.{parameter.key}" for name in PARAMETERS for parameter in PARAMETERS[name])
        raise SceneError(f"--set {setting}: no such key; allowed: {', '.join(known)}")
    try:
        number = strict_yaml.load(value)
    except ValueError as error:
        raise SceneError(f"--set {setting}: {error}; allowed: a number") from None
    numbers = document.setdefault(section, {})
    if isinstance(numbers, dict):  # anything else is refused with the file
        numbers[key] = number


def _check_keys(source: str, prefix: str, found: Mapping[Any, Any], allowed: Sequence[str]) -> None:
    for key in found:
        if key not in allowed:
            known = ", ".join(allowed)
            raise SceneError(f"{source}: {prefix}{key}: unknown key with the value {found[key]!r}; allowed: {known}")
    for key in allowed:
        if key not in found:
            raise SceneError(f"{source}: {prefix}{key}: missing; allowed: exactly the keys {', '.join(allowed)}")


def _section(source: str, section: str, found: Any) -> dict[str, float]:
    table = PARAMETERS[section]
    keys = [parameter.key for parameter in table]
    if not isinstance(found, dict):
        raise SceneError(f"{source}: {section}: {found!r} is not allowed; allowed: a mapping with {', '.join(keys)}")
    _check_keys(source, f"{section}.", found, keys)
    return {parameter.key: _number(source, section, parameter, found[parameter.key]) for parameter in table}


def _number(source: str, section: str, parameter: Parameter, value: Any) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not parameter.accepts(value):  # NaN is in no range
        raise SceneError(f"{source}: {section}.{parameter.key}: {value!r} is not allowed; allowed: {parameter.allowed}")
    return float(value)


def _check_combinations(source: str, scene: Scene) -> None:
    for side in ("left", "right"):
        arm = scene.grasp.left if side == "left" else scene.grasp.right
        for name, total in (
            ("stiffness_N_per_m + position_gain_N_per_m", arm.stiffness + arm.position_gain),
            ("damping_Ns_per_m + velocity_gain_Ns_per_m", arm.damping + arm.velocity_gain),
        ):
            if total < 0.0:
                raise SceneError(f"{source}: {side}_arm, {side}_feedback: {name} is {total!r}; allowed: a sum >= 0")
    for key in ("control_period_s", "duration_s"):
        seconds = scene.values["time"][key]
        if round(seconds * NANOSECONDS) / NANOSECONDS != seconds or seconds < 1 / NANOSECONDS:
            raise SceneError(f"{source}: time.{key}: {seconds!r} is not allowed; allowed: whole nanoseconds")
    if round(scene.duration * NANOSECONDS) % scene.period_ns:
        raise SceneError(
            f"{source}: time.duration_s: {scene.duration!r} is not allowed; allowed: a whole number of control periods"
            f" of {scene.values['time']['control_period_s']!r} s"
        )

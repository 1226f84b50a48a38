"""Scenes: strict YAML files that define a run completely.

A scene is composed of effects, each a section of the file, see `grasp_ros.scene.effects`: what it does not name is not
simulated. Every key carries its unit. Nothing is repaired: a file that is not exactly right is refused.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from grasp_ros import CONFIG
from grasp_ros.physics import given
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System
from grasp_ros.scene.effects import BY_SECTION, build, named
from grasp_ros.scene.effects.base import NANOSECONDS, Effect, Output, Parameter
from grasp_ros.scene.effects.loop import HELD
from grasp_ros.scene.effects.time import nanoseconds, period_ns
from grasp_ros.scene.files import YAML, read_text, reading
from grasp_ros.scene.strict_yaml import dump
from grasp_ros.scene.strict_yaml import load as load_yaml
from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV, Topic
from grasp_ros.scene.validation import TEXTS, SceneError, apply_settings, check_domain, check_keys, read, read_sections


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Frozen):
    """A validated scene; `load`, `parse`, `compose` and `changed` make one.

    Attributes
    ----------
    name : str
        Name of the file without its ending.
    title : str
    readings : tuple of str
        Where the source leaves something open: what this scene assumes.
    watch : str
        What to watch for; may be empty.
    values : mapping of str to mapping of str to float, int or tuple of float
        Every number that the scene names, by section and key.
    """

    name: str
    title: str
    readings: tuple[str, ...]
    watch: str
    values: Mapping[str, Mapping[str, Any]]

    @property
    def effects(self) -> list[Effect]:
        """What the scene names, in the order of the registry."""
        return named(self.values)

    @cached_property
    def system(self) -> System:
        """What is simulated, as arrays; not to be changed."""
        return build(self.values)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Valid but suspicious settings, a sentence each: the key, its value, why it is odd, and what may be meant."""
        return tuple(warning for effect in self.effects for warning in effect.warnings(self.values, self.system))

    @property
    def initial_state(self) -> Array:
        """x_l, v_l, x_o, v_o, x_r, v_r at t = 0, shape (6,), m and m/s; 0 for what is not there."""
        return self.system.state.copy()

    @property
    def duration(self) -> float:
        """Length of the run in s."""
        return float(self.values["time"]["duration_s"])

    @cached_property
    def period_ns(self) -> int:
        """Control period in ns."""
        return period_ns(self.values)

    @cached_property
    def ticks(self) -> int:
        """Number of control periods in the run."""
        return nanoseconds(self.duration) // self.period_ns

    @property
    def sampled(self) -> bool:
        """Whether the scene itself holds its commands over control periods."""
        return self.system.sampled

    @property
    def outputs(self) -> list[Output]:
        """Forces that the plant publishes, one per topic."""
        return list({output.topic: output for effect in self.effects for output in effect.outputs}.values())

    @property
    def controllers(self) -> dict[str, Topic]:
        """Command topics of the controllers by the names of their executables."""
        return {effect.node: effect.commands for effect in self.effects if effect.commands is not None}

    @property
    def topics(self) -> list[Topic]:
        """Topics with one message per tick, in the order in which they are recorded."""
        return [JOINT_STATES, *self.controllers.values(), *(output.topic for output in self.outputs), LYAPUNOV]

    @property
    def live(self) -> list[str]:
        """Numbers, as "section.key", that controllers may be given in place of the scene's while they run."""
        return [name for name in self.numbers_of(*self.controllers) if self.parameter(name).live]

    def numbers_of(self, *nodes: str) -> dict[str, float]:
        """Numbers by "section.key" that belong to nodes."""
        return {
            f"{effect.section}.{key}": value for effect in self.effects if effect.node in nodes
            for key, value in self.values[effect.section].items()
        }

    def caveats(self, sampled: bool) -> list[str]:
        """Why V_c may rise, if the commands are held or not; empty: it cannot."""
        held = [HELD] if sampled and not self.sampled and self.system.laws else []
        return [*held, *self.system.caveats]

    def certificate_in_words(self, sampled: bool) -> str:
        """Whether V_c can rise in this scene, and why."""
        caveats = self.caveats(sampled)
        return f"V_c may rise: {'; '.join(caveats)}" if caveats else "V_c cannot rise"

    def why_unsettled(self, sampled: bool) -> str:
        """Why V_c may not prove that a run settles."""
        return self.certificate_in_words(sampled) if self.caveats(sampled) else "a mass need not return to 0"

    def time_of(self, tick: Any) -> Any:
        """Time of a tick, or of an array of ticks, in s: an integer number of ns, rounded once."""
        return tick * self.period_ns / NANOSECONDS

    def feedback_in_words(self, sampled: bool, by_user: bool = False) -> str:
        """What acts on the arms: the paper's continuous feedback, or held commands; `by_user`: also of a user."""
        if not (self.system.laws or by_user):
            return "no controller"
        return f"each command held for {self.period_ns / 1e6:g} ms" if sampled else "continuous feedback"

    def changed(self, numbers: Mapping[str, float]) -> Scene:
        """The scene with other numbers, by "section.key"; if more than its duration differs, its texts say so.

        Raises
        ------
        SceneError
            If the result cannot be run.
        """
        document = self._document()
        for name, number in given.mapping("numbers", numbers).items():
            key = self.parameter(name).key
            document[name.partition(".")[0]][key] = number
        return _read(document, self.name, self.name, self.values)

    def parameter(self, name: str) -> Parameter:
        """What a number of the scene is, by "section.key".

        Raises
        ------
        SceneError
            If the scene does not name it.
        """
        section, _, key = str(name).partition(".")
        if key not in self.values.get(section, {}):
            if section in self.values and any(own.key == key for own in BY_SECTION[section].parameters):
                raise SceneError(f"{self.name}: {name}: not set in this scene; set it first, to 0 for instance")
            known = [f"{own}.{key}" for own, found in self.values.items() for key in found]
            raise SceneError(f"{self.name}: {name}: not in this scene; {allowed(str(name), known)}")
        return next(own for own in BY_SECTION[section].parameters if own.key == key)

    def to_yaml(self) -> str:
        """The whole scene as YAML; `parse` of it gives the same scene to the last bit."""
        return dump(self._document())

    def __repr__(self) -> str:
        """In a line; `to_yaml` has the numbers."""
        return f"<Scene {self.name}: {self.title}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the scene as a file has it."""
        return f"<pre>{escape(self.to_yaml())}</pre>"

    def _document(self) -> dict[str, Any]:
        """What a file with this scene holds."""
        watch = {"watch": self.watch} if self.watch else {}
        values = {section: dict(numbers) for section, numbers in self.values.items()}
        return {"title": self.title, "readings": self.readings, **watch, **values}


def names() -> list[str]:
    """Names of the scenes that come with the package, the paper's cases first."""
    found = [entry.name.removesuffix(".yaml") for entry in CONFIG.iterdir() if entry.name.endswith(".yaml")]
    return sorted(found, key=lambda name: (not name.startswith("case_"), name))


def text_of(name: str) -> str:
    """The file of one of them, as it was written."""
    return (CONFIG / f"{name}.yaml").read_text(encoding="utf-8")


def load(reference: str | os.PathLike[str], settings: Sequence[str] = ()) -> Scene:
    """Read a scene of the package by its name, or a file by its path.

    Parameters
    ----------
    reference : str or path
    settings : sequence of str
        "section.key=value": numbers that replace those of the file, or name what it does not. "section={}" names a
        section without numbers, which has none in the file. Each once, in any order.

    Raises
    ------
    SceneError
        If there is no such scene, or if it cannot be run as written.
    """
    given.instance("reference", reference, (str, os.PathLike), "a name or a path")
    reference, path = os.fspath(reference), Path(reference)
    if path.suffix.lower() in YAML:
        with reading(reference, SceneError):
            if not path.is_file():
                raise SceneError(f"{reference}: {'is no file' if path.exists() else 'no such file'}")
        return parse(read_text(path, SceneError), path.stem, str(path), settings)
    if reference not in names():
        known = allowed(reference, names(), "a path that ends in .yaml, or one of ")
        raise SceneError(f"{reference or repr(reference)}: no such scene; {known}")
    return parse(text_of(reference), reference, reference, settings)


def parse(text: str, name: str, source: str, settings: Sequence[str] = ()) -> Scene:
    """Validate the text of a scene; `source` is the file that errors name.

    Raises
    ------
    SceneError
        If the text is not a scene that can be run as written.
    """
    try:
        document = load_yaml(given.text("text", text))
    except Refused as error:
        raise SceneError(f"{source}: {error}") from None
    if not isinstance(document, dict):
        raise SceneError(f"{source}: not a mapping; allowed: the keys {', '.join((*TEXTS, *BY_SECTION))}")
    before: Mapping[str, Any] | None = None
    if settings := given.names("settings", settings):
        with suppress(SceneError):  # what is wrong without settings may be right with them
            before = read_sections(source, document)
    apply_settings(settings, document)
    return _read(document, name, source, before)


def compose(
    name: str, sections: Mapping[str, Mapping[str, Any]], *, title: str | None = None, readings: Sequence[str] = (),
    watch: str = "",
) -> Scene:
    """A scene from its sections, validated like a file.

    Parameters
    ----------
    name : str
        Name of the scene, which errors name as well.
    sections : mapping of str to mapping of str to float, int or sequence of float
        Numbers by section and key, as a file has them: `{"time": {"duration_s": 1.0, ...}, "loop": {}, ...}`.
    title : str, optional
        Default: the name.
    readings : sequence of str
    watch : str
        See `Scene`.

    Raises
    ------
    SceneError
        If it is not a scene that can be run.
    """
    check_keys(name, "", given.mapping("sections", sections), tuple(BY_SECTION), ("time",))
    texts = {"title": name if title is None else title, "readings": readings, "watch": watch}
    return _read({**texts, **sections}, name, name)


def _read(document: Mapping[Any, Any], name: str, source: str, before: Mapping[str, Any] | None = None) -> Scene:
    """The one place where a scene is made: from a file, from sections, or from a scene with the numbers `before`."""
    scene = Scene(name, *read(source, document, before))
    check_domain(source, scene.values, scene.system)
    return scene

"""Pages of the reference that need no ROS: each is made of what the code itself says."""

from __future__ import annotations

import argparse
import importlib
import inspect
from collections.abc import Iterator
from enum import Enum
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli import main as cli
from grasp_ros.cli.parser import COMMANDS
from grasp_ros.exact import Status
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Mode
from grasp_ros.scene import topics
from grasp_ros.scene.effects import EFFECTS
from lab import __main__ as laboratory
from lab.studies.pages import table

TWINS = ("right_", "object_pulse", "object_sine", "object_table")  # sections that have a twin
PUBLIC = {  # modules and their public names; what has `__all__` says it itself, and is listed where it is met first
    "grasp_ros": (), "grasp_ros.scene": (), "grasp_ros.simulation": (), "grasp_ros.exact": (),
    "grasp_ros.simulation.quantities": ("settling_times", "contact_intervals"),
    "grasp_ros.simulation.losses": ("losses",),
    "grasp_ros.simulation.outcomes": ("OUTCOMES",),
    "grasp_ros.physics.energy": ("energy", "Energy", "energy_balance", "EnergyBalance"),
    "grasp_ros.physics.layout": ("Transition",), "grasp_ros.physics.model": ("Mode",),
    "grasp_ros.physics.errors": ("Refused",), "grasp_ros.physics.observation": ("OBSERVABLES",),
    "grasp_ros.graph.bag": ("read", "Recording", "BagError"), "grasp_ros.graph.bag.verify": ("verify", "laws_of"),
    "grasp_ros.graph.bag.summary": ("summary",),
}


def python() -> str:
    """The public Python interface, for mkdocstrings to fill in."""
    parts = ["# Python", "All quantities are in SI units. The names on this page are public and do not change within"
             " a release. Arguments and results are in the site, which `make docs` builds, and in `help(...)`."]
    known: set[str] = set()
    for name, listed in PUBLIC.items():
        module = importlib.import_module(name)
        things = {member: getattr(module, member) for member in listed or module.__all__}
        names = [f"{thing.__module__}.{thing.__qualname__}" for thing in things.values()
                  if inspect.isclass(thing) or inspect.isfunction(thing)]
        fresh = [f"::: {place}" for place in names if place not in known]
        known.update(names)
        parts += [f"## {name}", str(module.__doc__).split("\n", 1)[0], _names(name, things), *fresh] if fresh else []
    return "\n\n".join(parts)


def _names(module: str, things: dict[str, Any]) -> str:
    """Names of a module, with a line each, and where they come from."""
    rows = [(f"`{module}.{name}`", _cell(str(thing.__doc__).partition("\n\n")[0]),
             f"`{thing.__module__}.{thing.__qualname__}`") for name, thing in things.items()
            if inspect.isclass(thing) or inspect.isfunction(thing)]
    return table(("name", "what it is", "defined as"), rows)


def scene_keys() -> str:
    """Sections and keys of scenes."""
    parts = [
        "# Scenes",
        "A scene is one YAML file. Each section is an effect; what a file does not name is not simulated."
        " [Write a scene](../how-to/write-a-scene.md) shows one. A section named `left_...` has a twin `right_...`, and"
        " the external forces exist for `left_arm`, `object` and `right_arm`. Beside the sections a file has `title`"
        " and `readings`, a list of texts that say where its numbers come from, and may have `watch`, a text.",
        "A *live* key may be set while the graph runs; an *optional* one may be left out.",
    ]
    for effect in [effect for effect in EFFECTS if not effect.section.startswith(TWINS)]:
        needs = f" Needs {', '.join(f'`{name}`' for name in effect.needs)}." if effect.needs else ""
        rows = [(f"`{own.key}`", own.unit, own.allowed, " ".join(
            word for word, holds in (("optional", own.optional), ("live", own.live)) if holds), own.text)
            for own in effect.parameters]
        parts += [f"## {effect.section}", f"{_sentence(effect.text)}{needs} Effect on V_c: {effect.certificate}."]
        parts += [table(("key", "unit", "allowed", "", "meaning"), rows)] if rows else []
    found = [(f"`{name}`", scenes.load(name).title) for name in scenes.names()]
    return "\n\n".join([*parts, "## Scenes of the package", table(("name", "title"), found)])


def commands() -> str:
    """The command line, and the commands of the laboratory."""
    parts = ["# Commands", "`grasp COMMAND --help` prints the same."]
    for name in COMMANDS:
        parts += [_command("grasp", name, dict(_subparsers(cli._parser([name])))[name])]
    parts += ["## python -m lab", "The laboratory examines the package. It runs from a checkout and is not installed."]
    rows = [(f"`{name}`", str(parser.description)) for name, parser in _subparsers(laboratory._parser())]
    return "\n\n".join([*parts, table(("name", "what it does"), rows)])


def _subparsers(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def _command(program: str, name: str, parser: argparse.ArgumentParser) -> str:
    formatter = argparse.HelpFormatter(parser.prog, width=100)
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, "")
    rows = [(_spelling(action), _cell(formatter._expand_help(action) if action.help else ""))
            for action in parser._actions if action.dest != "help" and action.help != argparse.SUPPRESS]
    nested = [_command(f"{program} {name}", inner, own) for inner, own in _subparsers(parser)]
    return "\n\n".join([
        f"## {program} {name}", _sentence(parser.description or ""), f"```\n{formatter.format_help().strip()}\n```",
        *([table(("argument", "meaning"), rows)] if rows else []), *nested])


def _spelling(action: argparse.Action) -> str:
    choices = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else None
    value = action.metavar or choices or (action.dest.upper() if action.option_strings else action.dest)
    if not action.option_strings:
        return _cell(f"`{value}`")
    takes = f" {value}" if action.nargs != 0 else ""
    return ", ".join(f"`{option}{takes}`" for option in action.option_strings)


def topics_page() -> str:
    """Topics of the graph."""
    known = {id(thing): thing for thing in _topics()}.values()
    rows = [(f"`{own.name}`", f"`{own.type}`", own.sender, own.text + (" Transient local." if own.latched else ""))
            for own in known]
    values = [(f"`{name}`", text) for name, text in topics.LYAPUNOV_VALUES.items()]
    return "\n\n".join([
        "# Topics", "All names but `/clock` and `/diagnostics` are relative and can be remapped. QoS is reliable.",
        table(("topic", "type", "from", "meaning"), rows), "## Values of lyapunov",
        table(("name", "meaning"), values)])


def _topics() -> Iterator[topics.Topic]:
    for thing in vars(topics).values():
        yield from (own for own in (thing.values() if isinstance(thing, dict) else [thing])
                    if isinstance(own, topics.Topic))


def statuses() -> str:
    """Exit codes, statuses of runs, events."""
    doc = str(cli.__doc__)
    codes = [entry.split(maxsplit=1) for entry in
             " ".join(doc.split("Exit statuses:")[1].split()).rstrip(".").replace("0;", "0 success;").split("; ")]
    transitions = [(f"`{own.name}`", str(int(own)), comment) for own, comment in _comments(Transition)]
    return "\n\n".join([
        "# Exit codes, statuses, events", "## Exit codes of grasp",
        table(("code", "when"), [(f"`{code}`", _cell(text)) for code, text in codes]),
        "Invalid input prints one line and exits with 2, a failed run with 1. A traceback is a bug: please report it.",
        "## Statuses of a run", "`Status`, by name; the value is the sentence that is printed.",
        table(("name", "value"), [(f"`{own.name}`", own.value) for own in Status]),
        "## Events", "`Transition`, by name and number.", table(("name", "number", "when"), transitions),
        "## Contact modes", table(("name", "number"), [(f"`{own.name}`", str(int(own))) for own in
                                                       (Mode.NONE, Mode.LEFT, Mode.RIGHT, Mode.BOTH)])])


def _comments(enum: type[Enum]) -> Iterator[tuple[Any, str]]:
    """Members of an enumeration with the comments beside them."""
    lines = [line.strip() for line in inspect.getsource(enum).splitlines()]
    for own in enum:
        yield own, next(line.partition("# ")[2] for line in lines if line.startswith(f"{own.name} ="))


def _sentence(text: str) -> str:
    text = _cell(text).rstrip(".")
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _cell(text: str) -> str:
    """A text that can stand in a table."""
    return " ".join(text.split()).replace("|", "\\|")

"""`grasp scenes` and `new`: the scenes that there are, and one to start from."""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import add_command, add_force, add_json, add_settings, complete_scenes
from grasp_ros.cli.checks import check_output, load_scene
from grasp_ros.cli.output import show, write_text
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import EFFECTS
from grasp_ros.scene.effects.base import Effect
from grasp_ros.scene.files import YAML
from grasp_ros.scene.scene import text_of
from grasp_ros.scene.strict_yaml import dump

DEFAULT = "case_01"
WIDTH = 100
HEAD = """\
A scene: one section for each thing that is simulated. What is not named is not simulated and costs nothing. All numbers
are SI; keys end with their unit. Delete sections, or take the # from the lines below to add one.
Try it with `grasp simulate THIS_FILE.yaml`, look at it with `grasp plot THIS_FILE.yaml`.
"""


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    sub = add_command(commands, "scenes", _scenes)
    complete_scenes(sub.add_argument("scene", nargs="?", help="print this one, as a file, with its comments"))
    add_json(sub)
    sub = add_command(commands, "new", _new)
    complete_scenes(sub.add_argument("--like", metavar="SCENE", default=DEFAULT,
                                     help=f"scene to copy (default {DEFAULT})"))
    add_settings(sub)
    sub.add_argument("file", metavar="FILE.yaml", type=Path,
                     help="new file, whose name is that of the scene; - is the standard output")
    add_force(sub)


def _scenes(options: argparse.Namespace) -> int:
    if options.scene is not None:
        scene = scenes.load(options.scene)
        packaged = options.scene in scenes.names()
        text = text_of(options.scene) if packaged else scene.to_yaml()
        show(options, text.rstrip("\n"), {"name": scene.name, "title": scene.title, "readings": scene.readings,
                                          "watch": scene.watch, **scene.values})
        return 0
    found = [scenes.load(name) for name in scenes.names()]
    width = max(len(scene.name) for scene in found)
    show(options, "\n".join(f"{scene.name:<{width}}  {scene.title}" for scene in found),
         [{"name": scene.name, "title": scene.title, "sections": list(scene.values)} for scene in found])
    return 0


def _new(options: argparse.Namespace) -> int:
    check_output(options.file, YAML, options.force)
    write_text(commented(load_scene(options.like, options.settings)), options.file)
    return 0


def commented(scene: Scene) -> str:
    """A scene as YAML with comments; `parse` gives the same scene."""
    text = [_comment(HEAD)]
    for key, value in (("title", scene.title), ("readings", scene.readings), ("watch", scene.watch)):
        if value or key != "watch":
            text.append(dump({key: value}))
    text += [_section(effect, scene) for effect in EFFECTS if effect.section in scene.values]
    text.append(_comment("What else there is, with an example for each:"))
    text += [_offer(effect) for effect in EFFECTS if effect.section not in scene.values]
    return "\n".join(text)


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in textwrap.wrap(" ".join(text.split()), WIDTH))


def _section(effect: Effect, scene: Scene) -> str:
    """One section that the scene has, and the keys that it could have."""
    own = scene.values[effect.section]
    lines = [_comment(effect.text)]
    lines.append(f"{effect.section}:\n" if own else f"{effect.section}: {{}}\n")
    for parameter in effect.parameters:
        meaning = f"{parameter.text}; {parameter.allowed}"
        if parameter.key in own:
            line = dump({parameter.key: own[parameter.key]}).rstrip("\n")
            lines.append(f"{textwrap.indent(line, '  ')}  # {meaning}\n" if "\n" not in line else
                         f"  # {meaning}\n{textwrap.indent(line, '  ')}\n")
        elif own:
            lines.append(f"  # {parameter.key}: ...  # {meaning}\n")
    return "".join(lines)


def _offer(effect: Effect) -> str:
    """One section that the scene does not have, as a comment."""
    needs = f" Needs {', '.join(effect.needs)}." if effect.needs else ""
    keys = "".join(f"#   {parameter.key}: {effect.example.get(parameter.key, '...')}  # {parameter.text}\n"
                   for parameter in effect.parameters)
    return _comment(f"{effect.text}.{needs}") + f"# {effect.section}:{'' if keys else ' {}'}\n{keys}"

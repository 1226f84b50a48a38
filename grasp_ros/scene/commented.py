"""A scene as a file to start from: every number with its meaning, unit and range, and what else a scene may say."""

from __future__ import annotations

import textwrap

from grasp_ros.scene.effects import EFFECTS
from grasp_ros.scene.effects.base import Effect
from grasp_ros.scene.scene import Scene
from grasp_ros.scene.strict_yaml import dump

WIDTH = 100
HEAD = """\
A scene: one section for each thing that is simulated. What is not named is not simulated and costs nothing. All numbers
are SI; keys end with their unit. Delete sections, or take the # from the lines below to add one.
Try it with `grasp simulate THIS_FILE.yaml`, look at it with `grasp plot THIS_FILE.yaml`.
"""


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
